"""Verifies a certificate of a strict Lyapunov function, with the standard library alone.

It shares no code with what made the certificate and takes another way: W and its derivative are
those of the error e and its rate v themselves, by the chain rule along

    e' = v,    v' = -KD sig(v)^alpha - KP sig(e)^beta,
    W = S^((3 - alpha)/2) + delta ((2 - alpha) KP)^(1 - alpha/2) e v,
    S = v^2 + (2 - alpha) KP |e|^(2/(2 - alpha)),

in intervals of decimals that are rounded outward. Every motion's state is a point of one of three
segments, scaled by (e, v) -> (r^(2 - alpha) e, r v) or its mirror image: e = 1, v = 1 and v = -1.
What is homogeneous needs to be verified there only.

As a program, ``python -m verification.certificates.error_dynamics.check FILE``, it reads the gains
from the certificate and says which they are.
"""

from __future__ import annotations

import functools
import itertools
import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

_FORMAT = "error-dynamics-lyapunov-1"
_DIGITS = 30
_DOWN = Context(prec=_DIGITS, rounding=ROUND_FLOOR)
_UP = Context(prec=_DIGITS, rounding=ROUND_CEILING)
_DEEPEST = 8
"""A box is halved so often at most before it counts as refuted."""
_LOOSEST = Fraction(1, 10**6)
"""How much larger than what follows from c a settling bound may be, relative."""
_LONGEST = 400
_PARAMETERS = ("KD", "KP", "alpha", "beta")
_KEYS = {
    "finite-time": {"delta", "settling_time_bound_s", "boxes"},
    "exponential": {"d", "error_factor_squared"},
}
_FACES = ("e=1", "v=1", "v=-1")
_RATIONAL = re.compile(r"-?\d+(/\d+)?")


def complaints(certificate: Any, gains: Mapping[str, Fraction]) -> Iterator[str]:
    """Everything that is wrong with a certificate, one sentence each; none if it is verified.

    Args:
        certificate: as JSON has it.
        gains: KD, KP, alpha and beta that it must be of.
    """
    try:
        yield from _complaints(certificate, gains)
    except (KeyError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
        yield f"not a certificate: {type(error).__name__} {error}"


def _complaints(certificate: Any, gains: Mapping[str, Fraction]) -> Iterator[str]:
    claim = certificate["claim"]
    if certificate["format"] != _FORMAT or claim not in _KEYS:
        yield f"not a certificate of this kind: {certificate['format']!r}, {claim!r}"
        return
    if set(certificate) != {"format", "claim", "c", *_PARAMETERS, *_KEYS[claim]}:
        yield "a key is missing, or there is one too many"
        return
    for name in _PARAMETERS:
        if _rational(certificate[name]) != gains[name]:
            yield f"it is of another {name}"
            return
    if gains["KD"] <= 0 or gains["KP"] <= 0 or _rational(certificate["c"]) <= 0:
        yield "a gain or c is not positive"
        return
    yield from (_finite_time if claim == "finite-time" else _exponential)(certificate)


def _rational(text: Any) -> Fraction:
    """A fraction in lowest terms."""
    if not isinstance(text, str) or len(text) > _LONGEST or not _RATIONAL.fullmatch(text):
        raise ValueError(f"{text!r} is not a fraction as text")
    value = Fraction(text)
    if str(value) != text:
        raise ValueError(f"{text} is not in lowest terms")
    return value


# --- alpha = beta = 1 --------------------------------------------------------------------------


def _exponential(certificate: Mapping[str, Any]) -> Iterator[str]:
    """W = z^T P z with z = (e, v), z' = A z: P > 0 and A^T P + P A + c P <= 0, exactly."""
    KD, KP, alpha, beta, c, d, factor = (
        _rational(certificate[key]) for key in (*_PARAMETERS, "c", "d", "error_factor_squared")
    )
    if not alpha == beta == 1:
        yield "the error dynamics is not linear"
    A = ((Fraction(0), Fraction(1)), (-KP, -KD))
    P = ((KP, d / 2), (d / 2, Fraction(1)))
    PA = [[sum(P[i][k] * A[k][j] for k in range(2)) for j in range(2)] for i in range(2)]
    Q = [[PA[i][j] + PA[j][i] + c * P[i][j] for j in range(2)] for i in range(2)]
    determinant = P[0][0] * P[1][1] - P[0][1] ** 2
    if not (P[0][0] > 0 and determinant > 0):
        yield "W is not positive definite"
        return
    if not (Q[0][0] <= 0 and Q[1][1] <= 0 and Q[0][0] * Q[1][1] >= Q[0][1] ** 2):
        yield "W does not fall at the rate c"
    # The least W for a given e is e^2 det P / P_vv; from rest at e(0) it starts as KP e(0)^2.
    if factor != P[0][0] * P[1][1] / determinant:
        yield "the error's bound does not follow"


# --- beta = alpha / (2 - alpha) ----------------------------------------------------------------


@dataclass(frozen=True)
class _Interval:
    """All numbers from ``low`` to ``high``."""

    low: Decimal
    high: Decimal

    def __add__(self, other: _Interval) -> _Interval:
        return _Interval(_DOWN.add(self.low, other.low), _UP.add(self.high, other.high))

    def __neg__(self) -> _Interval:
        return _Interval(self.high.copy_negate(), self.low.copy_negate())

    def __sub__(self, other: _Interval) -> _Interval:
        return self + -other

    def __mul__(self, other: _Interval) -> _Interval:
        pairs = [(a, b) for a in (self.low, self.high) for b in (other.low, other.high)]
        return _Interval(
            min(_DOWN.multiply(a, b) for a, b in pairs), max(_UP.multiply(a, b) for a, b in pairs)
        )

    def __pow__(self, exponent: Fraction) -> _Interval:
        """Of numbers >= 0; the logarithm and its inverse are correctly rounded, by the library."""
        if exponent < 0 or self.low < 0:
            raise ValueError("a power of a negative number")
        return _Interval(_power(self.low, exponent).low, _power(self.high, exponent).high)

    def inverse(self) -> _Interval:
        """Of positive numbers."""
        if self.low <= 0:
            raise ValueError("no inverse")
        return _Interval(_DOWN.divide(1, self.high), _UP.divide(1, self.low))


@functools.lru_cache(maxsize=1 << 12)
def _power(base: Decimal, exponent: Fraction) -> _Interval:
    if base == 0:
        return _exactly(Fraction(0 if exponent else 1))
    logarithm = _UP.ln(base)
    product = _around(logarithm) * _exactly(exponent)
    low, high = _DOWN.exp(product.low), _UP.exp(product.high)
    return _Interval(_around(low).low, _around(high).high)


def _around(value: Decimal) -> _Interval:
    """A rounded value and one unit of its last place on both sides."""
    return _Interval(_DOWN.next_minus(value), _UP.next_plus(value))


def _exactly(value: Fraction) -> _Interval:
    top, bottom = Decimal(value.numerator), Decimal(value.denominator)
    return _Interval(_DOWN.divide(top, bottom), _UP.divide(top, bottom))


_ZERO, _ONE = _exactly(Fraction(0)), _exactly(Fraction(1))


@dataclass(frozen=True)
class _Sloped:
    """A quantity along a segment: its value, and its derivative by the place."""

    value: _Interval
    slope: _Interval

    def __add__(self, other: _Sloped) -> _Sloped:
        return _Sloped(self.value + other.value, self.slope + other.slope)

    def __neg__(self) -> _Sloped:
        return _Sloped(-self.value, -self.slope)

    def __sub__(self, other: _Sloped) -> _Sloped:
        return self + -other

    def __mul__(self, other: _Sloped) -> _Sloped:
        slope = self.slope * other.value + self.value * other.slope
        return _Sloped(self.value * other.value, slope)

    def __pow__(self, exponent: Fraction) -> _Sloped:
        power = self.value**exponent
        if self.slope == _ZERO:
            return _Sloped(power, _ZERO)
        return _Sloped(power, self.slope * _exactly(exponent) * power * self.value.inverse())


@dataclass(frozen=True)
class _Function:
    """W and how it falls.

    Attributes:
        KD, KP, alpha, beta: of the error dynamics.
        potential: (2 - alpha) KP.
        weight: of e v in W.
        c: of the claim.
    """

    KD: Fraction
    KP: Fraction
    alpha: Fraction
    beta: Fraction
    potential: _Interval
    weight: _Interval
    c: Fraction

    def at(self, face: str, place: _Interval, slope: _Interval) -> _Sloped | None:
        """W' + c W^(2/(3 - alpha)) on a segment, or None where W may not be positive.

        S' = -2 KD |v|^(alpha + 1) is the energy balance (21).
        """
        one, free = _Sloped(_ONE, _ZERO), _Sloped(place, slope)
        backward = face == "v=-1" or place.low < 0
        e, speed = (one, -free if backward else free) if face == "e=1" else (free, one)
        KD, KP, potential, weight, c, degree = (
            _Sloped(number, _ZERO)
            for number in (
                *(_exactly(self.KD), _exactly(self.KP), self.potential, self.weight),
                *(_exactly(self.c), _exactly(3 - self.alpha)),
            )
        )
        lever = e ** (self.beta + 1)
        S = speed * speed + potential * lever
        root = S ** ((1 - self.alpha) / 2)
        damping = KD * speed**self.alpha
        product, drag = e * speed, e * damping
        if backward:
            product, drag = -product, -drag
        W = S * root + weight * product
        if W.value.low <= 0:
            return None
        change = weight * (speed * speed - drag - KP * lever) - degree * root * damping * speed
        return change + c * W ** (2 / (3 - self.alpha))

    def holds(self, face: str, low: Fraction, high: Fraction) -> bool:
        """Whether W > 0 and W' + c W^(2/(3 - alpha)) <= 0 in a box.

        By the mean value theorem; where a power has no derivative, by the extremes of each term.
        """
        box = _Interval(_exactly(low).low, _exactly(high).high)
        if low == 0 or high == 0:
            plain = self.at(face, box, _ZERO)
            return plain is not None and plain.value.high <= 0
        middle = _exactly((low + high) / 2)
        excess, central = self.at(face, box, _ONE), self.at(face, middle, _ZERO)
        if excess is None or central is None:
            return False
        return (central.value + excess.slope * (box - middle)).high <= 0


def _finite_time(certificate: Mapping[str, Any]) -> Iterator[str]:
    KD, KP, alpha, beta, c, delta, bound = (
        _rational(certificate[key]) for key in (*_PARAMETERS, "c", "delta", "settling_time_bound_s")
    )
    if not (0 < alpha < 1 and beta * (2 - alpha) == alpha):
        yield "the exponents are not a finite-time pair"
        return
    potential = _exactly((2 - alpha) * KP)
    weight = _exactly(delta) * potential ** (1 - alpha / 2)
    function = _Function(KD, KP, alpha, beta, potential, weight, c)
    # W^((1 - alpha)/(3 - alpha)) falls at (1 - alpha)/(3 - alpha) c; from rest at e = 1 it is
    # potential^((1 - alpha)/2).
    least = _exactly((3 - alpha) / ((1 - alpha) * c)) * potential ** ((1 - alpha) / 2)
    if bound < Fraction(least.high) or bound > Fraction(least.high) * (1 + _LOOSEST):
        yield "the settling time's bound does not follow from c"
    if set(certificate["boxes"]) != set(_FACES):
        yield "the three segments are not covered"
        return
    faces = {
        name: [tuple(_rational(end) for end in box) for box in certificate["boxes"][name]]
        for name in _FACES
    }
    gaps = list(_gaps(faces, alpha))
    if gaps:
        yield from gaps
        return
    for name, boxes in faces.items():
        for low, high in boxes:
            if not _verified(function, name, low, high, _DEEPEST):
                yield f"{name}: W does not fall fast enough from {float(low)} to {float(high)}"
                return


def _gaps(faces: Mapping[str, Sequence[tuple[Fraction, ...]]], alpha: Fraction) -> Iterator[str]:
    """The boxes are in a row, have no zero inside, and the three segments meet every ray."""
    ends = {}
    for name, boxes in faces.items():
        if not boxes or any(len(box) != 2 or not box[0] < box[1] for box in boxes):
            yield f"{name}: a box is empty"
            return
        if any(one[1] != next_[0] for one, next_ in itertools.pairwise(boxes)):
            yield f"{name}: the boxes leave a gap or overlap"
        if any(low < 0 < high for low, high in boxes):
            yield f"{name}: zero is inside a box"
        ends[name] = boxes[0][0], boxes[-1][1]
    for name, side in (("v=-1", 0), ("v=1", 1)):
        # The ray through (1, v) meets v = 1 at e = v^(alpha - 2).
        last_v = abs(ends["e=1"][side])
        if ends[name][0] != 0:
            yield f"{name}: e = 0 is not covered"
        if (ends["e=1"][side] < 0) != (side == 0):
            yield f"e=1 does not reach {name}"
        elif (_exactly(last_v) ** (2 - alpha) * _exactly(ends[name][1])).low < 1:
            yield f"e=1 and {name} leave a gap"


def _verified(function: _Function, face: str, low: Fraction, high: Fraction, deeper: int) -> bool:
    if function.holds(face, low, high):
        return True
    middle = (low + high) / 2
    return deeper > 0 and all(
        _verified(function, face, *half, deeper - 1) for half in ((low, middle), (middle, high))
    )


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
    words = ", ".join(f"{key} = {value}" for key, value in gains.items())
    print("\n".join(found) if found else f"verified: {certificate['claim']} for {words}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
