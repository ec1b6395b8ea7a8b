"""Verifies a certificate of bounds of s and e under a bounded TDE error, with the standard library.

The claims are of one joint of the closed loop (32), with |eps| <= xi = tde_error at all times:

    s' = eps - lambda sig(s)^gamma,    e' = s + z,    z' = -KD sig(e')^alpha - KP sig(e)^beta

where z = e' - s, or, which is the same, e'' + KD sig(e')^alpha + KP sig(e)^beta = s'.

- ``sliding``: |s| <= S = (xi/lambda)^(1/gamma) (38). Two fractions enclose S; integers compare.
- ``by_sliding``: |e| from |s| <= S.
- ``by_sliding_rate``: |e| from |s'| <= xi + lambda S^gamma = 2 xi.
- ``uncorrected``: |e| of the loop without correction (27), where s' = eps.

The last three have a barrier: a curve around the origin, symmetric about it, of straight edges, in
the plane of e and z, or of e and e'. What is verified of it, by halving boxes of places and
disturbances in decimals that are rounded outward, is that on each closed edge every motion that
some disturbance allows crosses the edge inwards, strictly. So no motion that begins inside leaves.

Where beta = alpha/(2 - alpha) the scaling e -> r^(2 - alpha) e, z -> r z, with disturbances of s as
r and of s' as r^alpha, maps motions to motions. It is verified that each curve (r^(2 - alpha) e,
r z), r > 0, crosses each edge outwards, so that the scaled barriers are one inside the other and r
is a function of the place. Each of them is a barrier for its own scaled disturbance, and for
smaller ones too if r > 1, with a rate r' <= -c r^alpha for some c > 0, since edges are compact. So
every motion gets inside the barrier of its own disturbance in finite time: the bound is ultimate.
These two conclusions are by argument, here; the rest is by the certificate.

As a program, ``python -m verification.certificates.error_bound.check FILE``, it reads the gains
from the certificate and says which they are.
"""

from __future__ import annotations

import functools
import itertools
import json
import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeAlias

_FORMAT = "error-bound-1"
_DIGITS = 24
_DOWN = Context(prec=_DIGITS, rounding=ROUND_FLOOR)
_UP = Context(prec=_DIGITS, rounding=ROUND_CEILING)
_MOST_BOXES = 5000
"""Of an edge, before it counts as refuted."""
_MOST_CORNERS = 5000
_LOOSEST = Fraction(1, 10**6)
"""How much larger than what follows a bound may be, relative."""
_LARGEST_EXPONENT = 10**5
"""Of the integers that are compared."""
_LONGEST = 400
_PARAMETERS = ("KD", "KP", "alpha", "beta", "lambda", "gamma", "tde_error")
_BARRIERS = ("by_sliding", "by_sliding_rate", "uncorrected")
_CLAIMS = ("ultimate", "invariant")
_RATIONAL = re.compile(r"-?\d+(/\d+)?")

_Point: TypeAlias = tuple[Fraction, Fraction]


def complaints(certificate: Any, gains: Mapping[str, Fraction]) -> Iterator[str]:
    """Everything that is wrong with a certificate, one sentence each; none if it is verified.

    Args:
        certificate: as JSON has it.
        gains: KD, KP, alpha, beta, lambda, gamma and tde_error that it must be of.
    """
    try:
        yield from _complaints(certificate, gains)
    except (KeyError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
        yield f"not a certificate: {type(error).__name__} {error}"


def _complaints(certificate: Any, gains: Mapping[str, Fraction]) -> Iterator[str]:
    if certificate["format"] != _FORMAT:
        yield f"not a certificate of this kind: {certificate['format']!r}"
        return
    claims = set(certificate) - {"format", *_PARAMETERS}
    if not claims or not claims <= {"sliding", *_BARRIERS} or not {*_PARAMETERS} <= {*certificate}:
        yield "a key is missing, or there is one too many"
        return
    for name in _PARAMETERS:
        if _rational(certificate[name]) != gains[name]:
            yield f"it is of another {name}"
            return
    if min(gains["KD"], gains["KP"], gains["tde_error"]) <= 0:
        yield "a gain or the TDE error is not positive"
        return
    # Of s and of s'; |s'| <= xi + lambda |s|^gamma, in which the bound of s puts 2 xi.
    largest = {"uncorrected": gains["tde_error"]}
    if "sliding" in claims:
        yield from _sliding(certificate["sliding"], gains)
        largest["by_sliding"] = _rational(certificate["sliding"]["at_most"])
        largest["by_sliding_rate"] = 2 * gains["tde_error"]
    for name in _BARRIERS:
        if name not in claims:
            continue
        if name not in largest:
            yield f"{name}: no bound of s"
            return
        found = _barrier(certificate[name], gains, largest[name], name == "by_sliding")
        yield from (f"{name}: {complaint}" for complaint in found)


def _rational(text: Any) -> Fraction:
    """A fraction in lowest terms."""
    if not isinstance(text, str) or len(text) > _LONGEST or not _RATIONAL.fullmatch(text):
        raise ValueError(f"{text!r} is not a fraction as text")
    value = Fraction(text)
    if str(value) != text:
        raise ValueError(f"{text} is not in lowest terms")
    return value


# --- |s| ---------------------------------------------------------------------------------------


def _sliding(claimed: Mapping[str, Any], gains: Mapping[str, Fraction]) -> Iterator[str]:
    """Encloses (xi/lambda)^(1/gamma) by comparing integer powers."""
    if set(claimed) != {"at_least", "at_most"}:
        yield "sliding: a key is missing, or there is one too many"
        return
    low, high = (_rational(claimed[name]) for name in ("at_least", "at_most"))
    if gains["lambda"] <= 0 or gains["gamma"] <= 0:
        yield "sliding: (38) needs lambda and gamma greater than 0"
        return
    ratio = gains["tde_error"] / gains["lambda"]
    if not 0 < low <= high <= low * (1 + _LOOSEST):
        yield "sliding: not an enclosure, or a loose one"
    elif _is_less(high, ratio, 1 / gains["gamma"]):
        yield "sliding: (xi/lambda)^(1/gamma) is larger"
    elif _is_less(1 / low, 1 / ratio, 1 / gains["gamma"]):
        yield "sliding: (xi/lambda)^(1/gamma) is smaller"


def _is_less(value: Fraction, base: Fraction, exponent: Fraction) -> bool:
    """Whether value < base^exponent, of positive numbers, exactly."""
    p, q = exponent.numerator, exponent.denominator
    if max(p, q) > _LARGEST_EXPONENT:
        raise ValueError(f"the exponent {exponent} has too many digits for exact powers")
    left: int = value.numerator**q * base.denominator**p
    right: int = value.denominator**q * base.numerator**p
    return left < right


# --- |e| ---------------------------------------------------------------------------------------


def _barrier(
    claimed: Mapping[str, Any],
    gains: Mapping[str, Fraction],
    disturbance: Fraction,
    of_velocity: bool,
) -> Iterator[str]:
    """A barrier for a disturbance of its own, and what follows for the one that there is."""
    if set(claimed) != {"claim", "bound", "disturbance", "corners"}:
        yield "a key is missing, or there is one too many"
        return
    alpha, beta = gains["alpha"], gains["beta"]
    if alpha <= 0 or beta <= 0:
        yield "an exponent is not positive, and the error dynamics jumps"
        return
    own, bound = _rational(claimed["disturbance"]), _rational(claimed["bound"])
    homogeneous = alpha < 2 and beta * (2 - alpha) == alpha
    if claimed["claim"] != _CLAIMS[0 if homogeneous else 1]:
        yield f"{claimed['claim']!r} is not what a barrier proves for these exponents"
        return
    corners = [(_rational(e), _rational(w)) for e, w in claimed["corners"]]
    if not 2 < len(corners) <= _MOST_CORNERS:
        yield "not a curve"
        return
    if own <= 0 or bound <= 0:
        yield "the disturbance or the bound is not positive"
        return
    crooked = _crooked(corners, 2 - alpha if homogeneous else Fraction(1))
    if crooked:
        yield crooked
        return
    reach = max(abs(e) for e, _ in corners)
    if homogeneous:
        # e scales as the power 2 - alpha of s, and as the power 1/beta of s'.
        exponent = 2 - alpha if of_velocity else 1 / beta
        ratio = disturbance / own
        if _is_less(bound / reach, ratio, exponent):
            yield "the bound of |e| does not follow from the barrier"
        elif not _is_less(bound / reach / (1 + _LOOSEST), ratio, exponent):
            yield "the bound of |e| is looser than the barrier's"
    elif own != disturbance:
        yield "the barrier is of another disturbance, and does not scale for these exponents"
    elif bound != reach:
        yield "the bound of |e| is not the barrier's"
    field = _Field(gains["KD"], gains["KP"], alpha, beta, own, of_velocity)
    leak = _leak(field, tuple(corners))
    if leak:
        yield leak


def _crooked(corners: Sequence[_Point], weight: Fraction) -> str | None:
    """What is wrong with the upper half of a curve that (r^weight e, r w) is to cross outwards."""
    (left, low), (right, high) = corners[0], corners[-1]
    if low != 0 or high != 0 or left >= 0 or right != -left:
        return "the curve does not close with its mirror image"
    if any(w <= 0 for _, w in corners[1:-1]):
        return "a corner is not above the axis"
    for (e, w), (f, x) in itertools.pairwise(corners):
        across, up = w - x, f - e
        if not all(across * weight * p + up * q > 0 for p, q in ((e, w), (f, x))):
            return "the curve does not go round the origin"
    return None


@functools.lru_cache(maxsize=64)
def _leak(field: _Field, corners: tuple[_Point, ...]) -> str | None:
    """Where a motion may leave; barriers of several claims are the same."""
    for start, end in itertools.pairwise(corners):
        if not field.enters(start, end):
            return f"motions may leave between e = {float(start[0])} and {float(end[0])}"
    return None


@dataclass(frozen=True)
class _Field:
    """All rates that a bounded disturbance of velocity or of acceleration allows.

    Attributes:
        KD, KP, alpha, beta: of the error dynamics.
        size: of the disturbance.
        of_velocity: whether it is added to the velocity e', else to the acceleration.
    """

    KD: Fraction
    KP: Fraction
    alpha: Fraction
    beta: Fraction
    size: Fraction
    of_velocity: bool

    def enters(self, start: _Point, end: _Point) -> bool:
        """Whether every motion crosses a closed edge inwards; inside is to the right."""
        waiting = [_Box(Fraction(0), Fraction(1), Fraction(-1), Fraction(1))]
        for _ in range(_MOST_BOXES):
            if not waiting:
                return True
            box = waiting.pop()
            if self._leaves(start, end, box):
                return False
            waiting += self._open(start, end, box)
        return False

    def _leaves(self, start: _Point, end: _Point, box: _Box) -> bool:
        """Whether a motion in the middle of a box goes outwards, in floating point.

        It refuses sooner, and verifies nothing.
        """
        up, across = (float(x) for x in (end[0] - start[0], start[1] - end[1]))
        share, disturbance = (float(x) for x in box.middle)
        v = float(start[1]) - share * across
        push = float(self.size) * (disturbance if self.of_velocity else 1.0)
        v, push = (v + push, 0.0) if self.of_velocity else (v, abs(up) * push)
        forces = (
            float(gain) * math.copysign(abs(x) ** float(exponent), x)
            for gain, x, exponent in (
                (self.KD, v, self.alpha),
                (self.KP, float(start[0]) + share * up, self.beta),
            )
        )
        return across * v - up * sum(forces) + push >= 0

    def _open(self, start: _Point, end: _Point, box: _Box) -> tuple[_Box, ...]:
        """What is left of a box to look at: nothing where all motions go inwards."""
        (e, w), (f, x) = start, end
        up, across = f - e, w - x
        e_low, e_high = sorted((e + box.low * up, e + box.high * up))
        w_low, w_high = sorted((w - box.low * across, w - box.high * across))
        size = self.size if self.of_velocity else 0
        v_low, v_high = w_low + size * box.least, w_high + size * box.most
        damping, spring = -up * self.KD, -up * self.KP
        # The outward rate is across v + damping sig(v)^alpha + spring sig(e)^beta + push.
        push = abs(up) * (self.size - size)
        moved, spread = _most(across, (v_low, v_low), (v_high, v_high))
        damped, spread_damped = _most(damping, _sig(v_low, self.alpha), _sig(v_high, self.alpha))
        sprung, spread_sprung = _most(spring, _sig(e_low, self.beta), _sig(e_high, self.beta))
        if moved + damped + sprung + push < 0:
            return ()
        if not size or box.least == box.most:
            return box.halves_of_edge()
        rises = self._rises(across, damping, v_low, v_high)
        if rises is not None:
            # In each place the disturbance at one end of the box is the worst.
            return (box.at(box.most if rises else box.least),)
        spread += spread_damped
        by_edge = spread * (w_high - w_low) / (v_high - v_low)
        if spread_sprung + by_edge >= spread - by_edge:
            return box.halves_of_edge()
        return box.halves_of_disturbances()

    def _rises(
        self, across: Fraction, damping: Fraction, low: Fraction, high: Fraction
    ) -> bool | None:
        """Whether across v + damping sig(v)^alpha rises with v, or falls; None if not known."""
        if across * damping >= 0:
            return across + damping > 0
        if low < 0 < high:
            return None
        # The slope is across + alpha damping |v|^(alpha - 1).
        nearer, farther = sorted((abs(low), abs(high)))
        if nearer == 0 and self.alpha < 1:
            return None
        steps = [_sig(v, abs(self.alpha - 1)) for v in (nearer, farther)]
        powers = [p if self.alpha >= 1 else 1 / p for step in steps for p in step]
        slopes = [across + self.alpha * damping * p for p in (min(powers), max(powers))]
        return slopes[0] > 0 if slopes[0] * slopes[1] > 0 else None


@dataclass(frozen=True)
class _Box:
    """A part of an edge, and of the disturbances of velocity in units of the largest."""

    low: Fraction
    high: Fraction
    least: Fraction
    most: Fraction

    @property
    def middle(self) -> _Point:
        """Place on the edge, and disturbance."""
        return (self.low + self.high) / 2, (self.least + self.most) / 2

    def halves_of_edge(self) -> tuple[_Box, _Box]:
        middle, _ = self.middle
        return replace(self, high=middle), replace(self, low=middle)

    def halves_of_disturbances(self) -> tuple[_Box, _Box]:
        _, middle = self.middle
        return replace(self, most=middle), replace(self, least=middle)

    def at(self, disturbance: Fraction) -> _Box:
        """The box of one disturbance alone."""
        return replace(self, least=disturbance, most=disturbance)


def _most(factor: Fraction, low: _Point, high: _Point) -> tuple[Fraction, Fraction]:
    """Largest product with a number between two enclosed ones, and by how much it varies."""
    largest = factor * (high[1] if factor > 0 else low[0])
    return largest, abs(factor) * (high[1] - low[0])


@functools.lru_cache(maxsize=1 << 12)
def _sig(x: Fraction, exponent: Fraction) -> _Point:
    """Lower and upper bound of |x|^exponent sgn(x)."""
    if x < 0:
        low, high = _sig(-x, exponent)
        return -high, -low
    if x == 0:
        return Fraction(exponent == 0), Fraction(exponent == 0)
    top, bottom = Decimal(x.numerator), Decimal(x.denominator)
    return (
        Fraction(_power(_DOWN, _DOWN.divide(top, bottom), exponent)),
        Fraction(_power(_UP, _UP.divide(top, bottom), exponent)),
    )


def _power(context: Context, base: Decimal, exponent: Fraction) -> Decimal:
    """Rounded one way; the library rounds ln and exp correctly, and one place more is given."""
    further = context.next_minus if context is _DOWN else context.next_plus
    logarithm = further(context.ln(base))
    product = context.multiply(logarithm, Decimal(exponent.numerator))
    return further(context.exp(context.divide(product, Decimal(exponent.denominator))))


def main(arguments: Sequence[str]) -> int:
    """Verifies the certificate in a file; returns 0, 1 where it is refused, 2 for bad input."""
    try:
        (name,) = arguments
        certificate = json.loads(Path(name).read_text(encoding="utf-8"))
        gains = {key: _rational(certificate[key]) for key in _PARAMETERS}
    except (OSError, KeyError, TypeError, ValueError) as error:
        print(f"error: not one readable certificate: {error}", file=sys.stderr)
        return 2
    found = list(complaints(certificate, gains))
    claims = ", ".join(key for key in ("sliding", *_BARRIERS) if key in certificate)
    words = ", ".join(f"{key} = {value}" for key, value in gains.items())
    print("\n".join(found) if found else f"verified: {claims} for {words}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
