"""Arb's balls of exact numbers, and their ends as doubles, rounded outward."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Any, TypeAlias

from flint import arb, arb_series, ctx, fmpq

PRECISION_BITS = 128

_TINY = 2.0**-1022
"""The smallest normal double."""

Enclosure: TypeAlias = tuple[float, float]
"""Lower and upper bound of a number, rounded outward."""


@contextmanager
def precision(bits: int = PRECISION_BITS, terms: int = 2) -> Iterator[None]:
    """Arb's global working precision and length of power series, for a block.

    Args:
        bits: of a ball's midpoint.
        terms: of a power series.
    """
    before = ctx.prec, ctx.cap
    ctx.prec, ctx.cap = bits, terms
    try:
        yield
    finally:
        ctx.prec, ctx.cap = before


def ball(value: Fraction | int) -> arb:
    """An exact number as a ball."""
    exact = Fraction(value)
    return arb(fmpq(exact.numerator, exact.denominator))


def exact(value: arb) -> Fraction:
    """The midpoint of a ball, exactly."""
    mantissa, exponent = value.mid().man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def enclosure(value: arb) -> Enclosure:
    """A ball's ends as doubles, rounded outward; its magnitude lies below 1e300."""
    if value.abs_upper() < _TINY:
        # The exact fraction of e^(-10^10) would fill the memory.
        return (0.0 if value >= 0 else -_TINY), 0.0 if value.is_zero() else _TINY
    return down(exact(value.lower())), up(exact(value.upper()))


def up(value: Fraction) -> float:
    """The smallest double that is not smaller."""
    return 0.0 - down(-value)


def down(value: Fraction) -> float:
    """The largest double that is not larger."""
    nearest = float(value)
    return nearest if Fraction(nearest) <= value else math.nextafter(nearest, -math.inf)


def power(base: Any, exponent: arb) -> Any:
    """``base ** exponent`` for a power series, or for a ball of numbers >= 0, zero included.

    The power rises with its base; Arb itself takes a logarithm, which zero has not.
    """
    if isinstance(base, arb_series) or base.lower() > 0:
        return base**exponent
    top = base.upper()
    return arb(0) if top == 0 else arb(0).union(top**exponent)
