"""Enclosures of what the binary32 C can compute: intervals with outward rounding.

The C rounds after every operation. If an operand lies in an interval, the result of the exact
operation lies in the interval of the exact results, and the rounded one in that interval widened
by the unit roundoff 2^-24, relative, plus one smallest subnormal for underflow (IEEE 754, round
to nearest). The kernel of sig(x)^a is widened by its own stated bound instead. Fused
multiply-adds are excluded: the C is compiled with -ffp-contract=off.

Intervals are pairs of arrays in double precision; their own rounding, 2^-53, is covered by a
margin many times larger.
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
_SMALLEST_SUBNORMAL = 2.0**-149
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


def _add(a: Interval, b: Interval) -> Interval:
    return rounded(Interval(a.low + b.low, a.high + b.high))


def _subtract(a: Interval, b: Interval) -> Interval:
    return rounded(Interval(a.low - b.high, a.high - b.low))


def _multiply(a: Interval, b: Interval) -> Interval:
    corners = (a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high)
    product = Interval(np.minimum.reduce(corners), np.maximum.reduce(corners))
    return product if a.is_sign or b.is_sign else rounded(product)


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


def _power(bound: float) -> Callable[[Interval, Interval], Interval]:
    """|x|^a of the kernel, |x| in an interval and a exact; rises with |x|.

    The kernel's error is relative to the exact power, so that its own small steps down do not
    matter: the enclosure of the power, which does rise, is widened.
    """

    def power(base: Interval, exponent: Interval) -> Interval:
        # 0^0 is 1 here; where x can be 0, the sign that it is multiplied with can be 0 too.
        ends = np.power(base.low, exponent.low), np.power(base.high, exponent.high)
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
