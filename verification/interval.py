"""Enclosures of what the binary32 C can compute: intervals with outward rounding.

The C rounds after every operation. If an operand lies in an interval, the result of the exact
operation lies in the interval of the exact results, and the rounded one in that interval widened
by the unit roundoff 2^-24, relative, plus one smallest subnormal for underflow (IEEE 754, round
to nearest). The kernel of sig(x)^a is widened by its own stated bound instead. Fused
multiply-adds are excluded: the C is compiled with -ffp-contract=off.

Intervals are pairs of arrays in double precision; their own rounding, 2^-53, is covered by a
margin many times larger. A sum with zero and a product with zero round nothing; they stay exact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen.law import LawFunction
from verification.law_graph import evaluate

Doubles = NDArray[np.float64]

UNIT_ROUNDOFF = 2.0**-24
"""Of binary32 with round to nearest."""

_MARGIN = 1.0 + 2.0**-20
_SMALLEST_NORMAL, _SMALLEST_SUBNORMAL = 2.0**-126, 2.0**-149
_KERNEL_UNDERFLOW = 4.0 * _SMALLEST_SUBNORMAL
"""How far a subnormal result of the kernel may be off (tdc_sig_pow.h)."""


@dataclass(frozen=True)
class Interval:
    """An enclosure of an array of numbers.

    Attributes:
        low: lower ends.
        high: upper ends, same shape.
        is_sign: whether the numbers are signs (-1, 0, 1); a product with one is exact.
    """

    low: Doubles
    high: Doubles
    is_sign: bool = False

    def contains(self, values: Doubles) -> NDArray[np.bool_]:
        """Whether each value lies inside, ends included; NaN does not."""
        inside: NDArray[np.bool_] = (self.low <= values) & (values <= self.high)
        return inside


def point(values: Any) -> Interval:
    """The interval of numbers that are known exactly."""
    exact = np.asarray(values, dtype=np.float64)
    return Interval(exact, exact)


def widened(interval: Interval, relative: float) -> Interval:
    """The interval with a relative error added at both ends, and the underflow."""
    factor = relative * _MARGIN
    return Interval(
        interval.low - np.abs(interval.low) * factor - _SMALLEST_SUBNORMAL,
        interval.high + np.abs(interval.high) * factor + _SMALLEST_SUBNORMAL,
    )


def rounded(interval: Interval) -> Interval:
    """What binary32 rounding can make of numbers in the interval."""
    return widened(interval, UNIT_ROUNDOFF)


def _rounded_unless(exact: NDArray[np.bool_], result: Interval) -> Interval:
    """What binary32 makes of the results of an operation, some of which need no rounding."""
    inexact = rounded(result)
    return Interval(
        np.where(exact, result.low, inexact.low), np.where(exact, result.high, inexact.high)
    )


def _is_zero(a: Interval) -> NDArray[np.bool_]:
    zero: NDArray[np.bool_] = (a.low == 0.0) & (a.high == 0.0)
    return zero


def _add(a: Interval, b: Interval) -> Interval:
    exact = _is_zero(a) | _is_zero(b)
    return _rounded_unless(exact, Interval(a.low + b.low, a.high + b.high))


def _subtract(a: Interval, b: Interval) -> Interval:
    return _add(a, _negate(b))


def _multiply(a: Interval, b: Interval) -> Interval:
    corners = (a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high)
    product = Interval(np.minimum.reduce(corners), np.maximum.reduce(corners))
    exact = _is_zero(a) | _is_zero(b) | np.bool_(a.is_sign or b.is_sign)
    return _rounded_unless(exact, product)


def _negate(a: Interval) -> Interval:
    return Interval(-a.high, -a.low)


def _minimum(a: Interval, b: Interval) -> Interval:
    return Interval(np.minimum(a.low, b.low), np.minimum(a.high, b.high))


def _maximum(a: Interval, b: Interval) -> Interval:
    return Interval(np.maximum(a.low, b.low), np.maximum(a.high, b.high))


def _sign(a: Interval) -> Interval:
    return Interval(np.sign(a.low), np.sign(a.high), is_sign=True)


def _magnitude(a: Interval) -> Interval:
    ends = np.abs(a.low), np.abs(a.high)
    holds_zero = (a.low <= 0.0) & (a.high >= 0.0)
    return Interval(np.where(holds_zero, 0.0, np.minimum(*ends)), np.maximum(*ends))


def kernel_power(x: Doubles, a: Doubles) -> Doubles:
    """What the kernel approximates for x >= 0 and 0 <= a < 2: x^a, but for tiny and for huge x.

    It multiplies x by x^(a - 1), with two exceptions. The bits of a subnormal x, read as a
    logarithm, are that of 2^-127 + x / 2: the result rises from 0 to the power of 2^-126. And the
    factor is never below the smallest normal float, so that x 2^-126 is the least for x >= 2^126.
    """
    read_as = np.where(x < _SMALLEST_NORMAL, 2.0**-127 + 0.5 * x, x)
    factor: Doubles = np.power(read_as, a - 1.0)
    result: Doubles = x * np.maximum(factor, _SMALLEST_NORMAL)
    return result


def _power(bound: float) -> Callable[[Interval, Interval], Interval]:
    """The kernel of |x|^a, |x| in an interval and a exact.

    The kernel's error is relative to :func:`kernel_power`, so that its own small steps down do not
    matter: the enclosure of that, which does rise with |x|, is widened.
    """

    def power(base: Interval, exponent: Interval) -> Interval:
        ends = kernel_power(base.low, exponent.low), kernel_power(base.high, exponent.high)
        enclosed = widened(Interval(*ends), bound)
        return Interval(enclosed.low - _KERNEL_UNDERFLOW, enclosed.high + _KERNEL_UNDERFLOW)

    return power


def rules(power_bound: float) -> dict[int, Callable[..., Interval]]:
    """What the operations of the law do to enclosures when binary32 C performs them.

    Args:
        power_bound: largest relative error of the kernel of |x|^a.
    """
    return {
        ca.OP_ADD: _add,
        ca.OP_SUB: _subtract,
        ca.OP_MUL: _multiply,
        ca.OP_NEG: _negate,
        ca.OP_FMIN: _minimum,
        ca.OP_FMAX: _maximum,
        ca.OP_SIGN: _sign,
        ca.OP_FABS: _magnitude,
        ca.OP_POW: _power(power_bound),
        ca.OP_CONSTPOW: _power(power_bound),
    }


def enclose(
    function: LawFunction, inputs: Mapping[str, Interval], power_bound: float
) -> dict[str, Interval]:
    """Enclosures of all quantities of a law function as binary32 C computes them.

    Args:
        function: the law whose operations the C performs, in the same order.
        inputs: enclosures of its inputs as the C holds them, by name.
        power_bound: largest relative error of the kernel of |x|^a.

    Raises:
        verification.law_graph.UnknownOperationError: an operation has no rounding rule here.
    """
    return evaluate(function, inputs, rules(power_bound), point)
