"""Certificates of bounds of s and e under a bounded TDE error.

What is to be proved is said in :mod:`check`, which proves it. Here numbers are found that it
accepts: corners of barriers in floating point, then rounded; powers in ball arithmetic, rounded up.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from flint import arb

from verification.certificates.error_bound.barrier import (
    Disturbed,
    NoBarrierError,
    at_a_node,
    barrier,
)
from verification.error_dynamics.balls import ball, exact, precision
from verification.error_dynamics.model import Parameters

Certificate: TypeAlias = dict[str, object]
"""As JSON has it; every number is a fraction as text."""

FORMAT = "error-bound-1"
_DIGITS = 9
"""Of a corner, of the largest one's."""
_BOUND_DIGITS = 12
_TURNS = (0.003, 0.0007)
"""Of a barrier's edges outwards, in rad: the weaker the damping, the less it can be."""
_BEND = 5.0
"""Of an edge against the outermost motion, in turns."""
_MOST_POWER = 10**5
"""The checker compares integer powers, no larger ones."""


class NotProvedError(Exception):
    """There is no certificate; the message says why."""


@dataclass(frozen=True)
class Barrier:
    """A barrier as the certificate has it.

    Attributes:
        disturbance: largest one that it is for.
        corners: of its upper half, from (-E, 0) to (E, 0).
    """

    disturbance: Fraction
    corners: tuple[tuple[Fraction, Fraction], ...]

    @property
    def reach(self) -> Fraction:
        """Largest |e| on it."""
        return max(abs(e) for e, _ in self.corners)


def sliding(tde_error: Fraction, lambda_: Fraction, gamma: Fraction) -> dict[str, str]:
    """An enclosure of (xi/lambda)^(1/gamma) (38).

    Raises:
        NotProvedError: gamma has too many digits to be compared exactly.
    """
    if max(gamma.numerator, gamma.denominator) > _MOST_POWER:
        raise NotProvedError("gamma has too many digits to compare powers exactly; write fewer")
    with precision():
        power = ball(tde_error / lambda_) ** (1 / ball(gamma))
        ends = exact(power.lower()), exact(power.upper())
    return {"at_least": str(_rounded(ends[0], -1)), "at_most": str(_rounded(ends[1], 1))}


def bound_of_e(
    parameters: Parameters, disturbance: Fraction, *, of_velocity: bool
) -> dict[str, object]:
    """A bound of |e| with its barrier, as a part of a certificate.

    Args:
        parameters: of the error dynamics.
        disturbance: largest |s| in rad/s, or largest |s'| in rad/s^2; greater than 0.
        of_velocity: which of both.

    Raises:
        NotProvedError: no barrier was found.
    """
    p = parameters
    own = Fraction(1) if p.homogeneous else disturbance
    found = _barrier(p, own, of_velocity)
    bound = found.reach
    if p.homogeneous:
        exponent = 2 - p.alpha if of_velocity else 1 / p.beta
        if max(exponent.numerator, exponent.denominator) > _MOST_POWER:
            raise NotProvedError("an exponent has too many digits to compare powers exactly")
        with precision():
            power: arb = ball(found.reach) * ball(disturbance / own) ** ball(exponent)
            bound = _rounded(exact(power.upper()), 1)
    return {
        "claim": "ultimate" if p.homogeneous else "invariant",
        "bound": str(bound),
        "disturbance": str(own),
        "corners": [[str(e), str(w)] for e, w in found.corners],
    }


@functools.lru_cache(maxsize=256)
def _barrier(p: Parameters, disturbance: Fraction, of_velocity: bool) -> Barrier:
    if p.alpha == 0 or p.beta == 0:
        raise NotProvedError(
            "alpha or beta is 0: the error dynamics jumps, and has no barrier here"
        )
    system = Disturbed(
        *(float(p.KD), float(p.KP), float(p.alpha), float(p.beta)), float(disturbance), of_velocity
    )
    attempts = [functools.partial(barrier, system, turn, _BEND * turn) for turn in _TURNS]
    if not of_velocity:
        attempts.insert(0, functools.partial(at_a_node, system))
    why = ""
    for attempt in attempts:
        try:
            return Barrier(disturbance, tuple(_rational(attempt())))
        except (NoBarrierError, OverflowError, ZeroDivisionError) as error:
            why = str(error)
    raise NotProvedError(f"no barrier was found: {why}")


def _rational(corners: list[tuple[float, float]]) -> Iterator[tuple[Fraction, Fraction]]:
    """Corners with a few digits; the ends are mirror images."""
    steps = [
        Fraction(10) ** (math.ceil(math.log10(max(abs(c[axis]) for c in corners))) - _DIGITS)
        for axis in (0, 1)
    ]
    rounded = [
        (round(e / float(steps[0])) * steps[0], round(w / float(steps[1])) * steps[1])
        for e, w in corners
    ]
    yield -rounded[-1][0], Fraction(0)
    yield from rounded[1:]


def _rounded(value: Fraction, direction: int) -> Fraction:
    """Down or up, to 12 digits."""
    scale = Fraction(10) ** (_BOUND_DIGITS - math.ceil(math.log10(value)))
    scaled = value * scale
    return Fraction(math.ceil(scaled) if direction > 0 else math.floor(scaled)) / scale
