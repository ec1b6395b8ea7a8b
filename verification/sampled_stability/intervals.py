"""The set of all r = Mbar/M for which the sampled loop is Schur stable, exactly.

With z = (w+1)/(w-1) the unit disc becomes the left half plane, and the characteristic polynomial
one in w whose coefficients are affine in r. A root can reach the unit circle only where the
polynomial

    B(r) = p(1; r) p(-1; r) D(r)

is zero, D being the Hurwitz determinant of order n-1: by Orlando's formula it is, up to its
leading coefficient, the product of all sums of two roots (Gantmacher, The Theory of Matrices,
vol. 2, ch. XV). A stable loop has none of these zeros. So the positive zeros of B, isolated in
exact arithmetic, cut r > 0 into open cells that are stable or not as a whole; a rational number in
each decides, by the signs of all of its Hurwitz determinants. No rounded eigenvalue decides
anything.

The last cell is never stable: the coefficients of p grow with r, those of a stable monic
polynomial are bounded by binomial coefficients.
"""

from __future__ import annotations

import cmath
import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import Any

from flint import acb, arb, ctx, fmpq_poly

from verification.sampled_stability.loop import (
    Characteristic,
    Loop,
    characteristic,
    fraction,
    rational,
)

_DIGITS = 13
"""Significant decimal digits that enclose an end of an interval, at least."""
_PRECISION_BITS = 256


@dataclass(frozen=True)
class End:
    """An end of an interval: the one zero of a polynomial between two rational numbers.

    Attributes:
        below: rational number below it, or it itself.
        above: rational number above it, or it itself.
        polynomial: changes its sign between them, once.
    """

    below: Fraction
    above: Fraction
    polynomial: fmpq_poly

    def __float__(self) -> float:
        return float((self.below + self.above) / 2)

    def side(self, number: Fraction) -> int:
        """-1, 0 or 1 for a number below, at or above this end; exactly."""
        if not self.below < number < self.above:
            return (number >= self.above) - (number <= self.below)
        here, below = (self.polynomial(rational(x)) for x in (number, self.below))
        return 0 if here == 0 else (-1 if (here > 0) == (below > 0) else 1)


@dataclass(frozen=True)
class Margin:
    """By what the eigenvalues of M^-1 Mbar may still be multiplied; both bounds are safe.

    Attributes:
        down: any factor from here to 1 keeps the loop stable; less than 1.
        up: any factor from 1 to here keeps the loop stable; more than 1.
    """

    down: Fraction
    up: Fraction


@dataclass(frozen=True)
class Interval:
    """An open interval of r in which the loop is stable, and at whose ends it is not.

    Attributes:
        low: its lower end.
        high: its upper end.
    """

    low: End
    high: End

    def contains(self, low: Fraction, high: Fraction) -> bool:
        """Whether every r from ``low`` to ``high``, ends included, lies inside; exactly."""
        return low <= high and self.low.side(low) > 0 and self.high.side(high) < 0

    def margin(self, low: Fraction, high: Fraction) -> Margin | None:
        """What is left for r from ``low`` to ``high``; None if they are not all inside."""
        if not self.contains(low, high):
            return None
        return Margin(down=self.low.above / low, up=self.high.below / high)


@dataclass(frozen=True)
class Cell:
    """The numbers r between two neighbouring zeros of B, with one of them that was tested."""

    test: Fraction
    stable: bool


@dataclass(frozen=True)
class Analysis:
    """How the intervals of a loop were found.

    Attributes:
        loop: whose they are.
        characteristic: its polynomial.
        boundaries: the positive zeros of B in ascending order.
        cells: around them, one more.
    """

    loop: Loop
    characteristic: Characteristic
    boundaries: tuple[End, ...]
    cells: tuple[Cell, ...]

    @property
    def intervals(self) -> tuple[Interval, ...]:
        """The stable cells."""
        zero = End(Fraction(0), Fraction(0), fmpq_poly([0, 1]))
        ends = (zero, *self.boundaries)
        return tuple(
            Interval(ends[k], ends[k + 1]) for k, cell in enumerate(self.cells) if cell.stable
        )

    def frequency_hz(self, end: End) -> float:
        """How fast the loop oscillates at an end, about: where its root crosses the circle."""
        roots = [complex(z) for z in _roots(self.characteristic.at((end.below + end.above) / 2))]
        crossing = min((z for z in roots if z.imag >= 0), key=lambda z: abs(abs(z) - 1))
        return cmath.phase(crossing) / (2 * math.pi * float(self.loop.sample_time_s))


def stable_intervals(loop: Loop) -> tuple[Interval, ...]:
    """The set of all r > 0 for which the loop is stable, as open intervals in ascending order.

    A robot whose joints have the same KD, KP and lambda falls apart, with M(q) frozen, into one
    such loop for each eigenvalue of M(q)^-1 Mbar (all are real and positive): they must lie in an
    interval at every q, see :meth:`Interval.contains`.
    """
    return analyse(loop).intervals


def containing(intervals: Sequence[Interval], low: Fraction, high: Fraction) -> Interval | None:
    """The interval that contains every r from ``low`` to ``high``, or None."""
    return next((i for i in intervals if i.contains(low, high)), None)


def analyse(loop: Loop) -> Analysis:
    """Finds the intervals of a loop."""
    polynomial = characteristic(loop)
    return Analysis(loop, polynomial, *cut(polynomial))


def cut(polynomial: Characteristic) -> tuple[tuple[End, ...], tuple[Cell, ...]]:
    """The positive zeros of B, and the cells into which they cut r > 0."""
    hurwitz = _left_half_plane(polynomial)
    boundary = _boundary(hurwitz)
    # Zero for every r: two roots on the circle or mirrored in it whatever r is (as with KP = 0).
    ends = tuple(_positive_zeros(boundary)) if not boundary.is_zero() else ()
    return ends, tuple(Cell(test, _is_stable(hurwitz, test)) for test in _tests(ends))


# --- Hurwitz -----------------------------------------------------------------------------------


def _left_half_plane(polynomial: Characteristic) -> list[fmpq_poly]:
    """Coefficients in Q[r] of 1, w, w^2, ... of (w-1)^n p((w+1)/(w-1); r)."""
    n = polynomial.degree
    plus, minus = fmpq_poly([1, 1]), fmpq_poly([-1, 1])
    parts = [
        sum(
            (part[k] * plus**k * minus ** (n - k) for k in range(n + 1)),
            fmpq_poly(),
        )
        for part in (polynomial.constant, polynomial.ratio)
    ]
    return [fmpq_poly([parts[0][k], parts[1][k]]) for k in range(n + 1)]


def _minor(coefficients: Sequence[Any], order: int) -> Any:
    """The leading principal minor of the Hurwitz matrix, whose entry (i, j) is a[n - 2j + i].

    Rows and columns count from 1. Laplace's expansion works in any ring.
    """
    n = len(coefficients) - 1

    def entry(row: int, column: int) -> Any:
        index = n - 2 * column + row
        return coefficients[index] if 0 <= index <= n else 0

    @functools.cache
    def expand(row: int, columns: tuple[int, ...]) -> Any:
        if not columns:
            return 1
        return sum(
            (-1) ** k * entry(row, column) * expand(row + 1, (*columns[:k], *columns[k + 1 :]))
            for k, column in enumerate(columns)
            if entry(row, column) != 0
        )

    return expand(1, tuple(range(1, order + 1)))


def _boundary(hurwitz: list[fmpq_poly]) -> fmpq_poly:
    """B(r): the first coefficient is p(1; r), the last one is p(-1; r) up to its sign."""
    determinant: fmpq_poly = _minor(hurwitz, len(hurwitz) - 2)
    return hurwitz[-1] * hurwitz[0] * determinant


def _is_stable(hurwitz: list[fmpq_poly], ratio: Fraction) -> bool:
    """Hurwitz: all leading principal minors are positive, the leading coefficient made so."""
    numbers = [coefficient(rational(ratio)) for coefficient in hurwitz]
    if numbers[-1] == 0:
        return False
    sign = 1 if numbers[-1] > 0 else -1
    signed = [sign * number for number in numbers]
    return all(_minor(signed, order) > 0 for order in range(1, len(signed)))


# --- Zeros of B --------------------------------------------------------------------------------


def _roots(polynomial: fmpq_poly) -> list[acb]:
    """The distinct complex roots, isolated."""
    pairs: Any = polynomial.complex_roots()  # with multiplicities, which its stubs leave out
    return [root for root, _ in pairs]


def _positive_zeros(polynomial: fmpq_poly) -> Iterator[End]:
    """The distinct positive zeros of a polynomial, in ascending order."""
    once = polynomial / polynomial.gcd(polynomial.derivative())
    with ctx.workprec(_PRECISION_BITS):
        # FLINT isolates all zeros; the imaginary part of a real one is exactly zero.
        zeros = [root.real for root in _roots(once) if root.imag == 0]
        for zero in sorted(zeros, key=float):
            if zero > 0:
                yield _enclosed(zero, [z for z in zeros if z is not zero], once)


def _enclosed(zero: arb, others: Sequence[arb], polynomial: fmpq_poly) -> End:
    """Short decimal fractions around one zero alone, where the polynomial has opposite signs."""
    middle = fraction(zero.mid().fmpq())
    digits = _DIGITS + max(0, -math.floor(math.log10(middle)))
    while digits < _PRECISION_BITS // 4:
        place = round(middle * 10**digits)
        below, above = (Fraction(place + step, 10**digits) for step in (-1, 1))
        # Three widths away from all other zeros: then no two enclosures can touch.
        spare = 3 * (above - below)
        reach = rational(below - spare), rational(above + spare)
        alone = all(z < reach[0] or z > reach[1] for z in others)
        ends = [polynomial(rational(x)) for x in (below, above)]
        if alone and ends[0] * ends[1] < 0:
            return End(below, above, polynomial)
        digits += _DIGITS
    raise ArithmeticError(f"two zeros of B are as good as one, near {float(middle)}")


def _tests(ends: Sequence[End]) -> Iterator[Fraction]:
    """A number in each cell, with a small denominator."""
    low = Fraction(0)
    for end in ends:
        yield _between(low, end.below)
        low = end.above
    yield Fraction(math.floor(low) + 1)


def _between(low: Fraction, high: Fraction) -> Fraction:
    if low >= high:
        raise ArithmeticError(f"no cell from {float(low)} to {float(high)}")
    middle = (low + high) / 2
    candidates = (middle.limit_denominator(10**k) for k in itertools.count())
    return next(c for c in candidates if low < c < high)


# --- Certificate -------------------------------------------------------------------------------


def certificate(analysis: Analysis) -> dict[str, Any]:
    """What ``verification.sampled_stability.check`` verifies; exact numbers as text."""
    loop, polynomial = analysis.loop, analysis.characteristic

    def plain(value: object) -> object:
        return str(value) if isinstance(value, Fraction) else value

    def pair(end: End) -> list[str]:
        return [str(end.below), str(end.above)]

    return {
        "loop": {
            field.name.rstrip("_"): plain(getattr(loop, field.name)) for field in fields(loop)
        },
        "characteristic": {
            "constant": [str(c) for c in polynomial.constant.coeffs()],
            "ratio": [str(c) for c in polynomial.ratio.coeffs()],
        },
        "boundaries": [pair(end) for end in analysis.boundaries],
        "cells": [{"test": str(cell.test), "stable": cell.stable} for cell in analysis.cells],
        "intervals": [[pair(i.low), pair(i.high)] for i in analysis.intervals],
    }
