"""The law over exact numbers, with a bound on what double precision can make of each of them.

The law's instruction list is evaluated with mpmath numbers of ``DIGITS`` digits: next to 2^-53
their own rounding is nothing, and they count as exact. Beside each number runs a bound on its
distance to the double that CasADi computes (running error analysis: Higham, Accuracy and Stability
of Numerical Algorithms, 2nd ed., 2002, section 3.3), from the standard model
fl(a op b) = (a op b)(1 + d) + e with |d| <= 2^-53, and |e| <= 2^-1074 where a result is
subnormal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import mpmath
import numpy as np
from numpy.typing import NDArray

from codegen.law import LawFunction
from verification.law_graph import evaluate

Doubles = NDArray[np.float64]
Exacts = NDArray[np.object_]
"""Arrays of ``mpmath.mpf``."""

DIGITS = 70
UNIT_ROUNDOFF = 2.0**-53
"""Of binary64 with round to nearest."""
POWER_ERROR = 2.0 * UNIT_ROUNDOFF
"""Largest relative error of the C library's ``pow``, which CasADi calls: one unit in the last
place, as the GNU C library's manual lists it (Known Maximum Errors in Math Functions)."""

_SMALLEST_SUBNORMAL = 2.0**-1074
# The bounds are themselves computed in double: a few roundings an operation, well within this.
_MARGIN = 1.0 + 2.0**-20


@dataclass(frozen=True)
class Bounded:
    """Exact numbers, and how far the doubles that stand for them may be off.

    Attributes:
        value: the numbers, an array of ``mpmath.mpf``.
        error: largest distance of each to its double, same shape.
    """

    value: Exacts
    error: Doubles

    @property
    def magnitude(self) -> Doubles:
        """Absolute values, rounded to double."""
        return np.abs(self.value.astype(np.float64))


_as_exact = np.frompyfunc(mpmath.mpf, 1, 1)
_signs = np.frompyfunc(mpmath.sign, 1, 1)
_powers = np.frompyfunc(mpmath.power, 2, 1)


def exactly(values: Any) -> Bounded:
    """Doubles that are known exactly."""
    doubles = np.asarray(values, dtype=np.float64)
    return Bounded(np.asarray(_as_exact(doubles), dtype=object), np.zeros(doubles.shape))


def _rounded(value: Exacts, error: Doubles) -> Bounded:
    """An operation's exact result with the error of its operands, and its own rounding added."""
    magnitude = np.abs(value.astype(np.float64)) + error
    return Bounded(value, (error + UNIT_ROUNDOFF * magnitude) * _MARGIN)


def _add(a: Bounded, b: Bounded) -> Bounded:
    # Where a sum is subnormal it is exact: no underflow.
    return _rounded(a.value + b.value, a.error + b.error)


def _subtract(a: Bounded, b: Bounded) -> Bounded:
    return _rounded(a.value - b.value, a.error + b.error)


def _multiply(a: Bounded, b: Bounded) -> Bounded:
    error = a.magnitude * b.error + b.magnitude * a.error + a.error * b.error
    product = _rounded(a.value * b.value, error)
    return Bounded(product.value, product.error + _SMALLEST_SUBNORMAL * (product.error > 0.0))


def _negate(a: Bounded) -> Bounded:
    return Bounded(-a.value, a.error)


def _minimum(a: Bounded, b: Bounded) -> Bounded:
    return Bounded(np.minimum(a.value, b.value), np.maximum(a.error, b.error))


def _maximum(a: Bounded, b: Bounded) -> Bounded:
    return Bounded(np.maximum(a.value, b.value), np.maximum(a.error, b.error))


def _magnitude(a: Bounded) -> Bounded:
    return Bounded(np.abs(a.value), a.error)


def _sign(a: Bounded) -> Bounded:
    known = (a.magnitude > a.error * _MARGIN) | (a.error == 0.0)
    return Bounded(np.asarray(_signs(a.value), dtype=object), np.where(known, 0.0, 2.0))


def _power(base: Bounded, exponent: Bounded) -> Bounded:
    """x^a for x >= 0 and an exact a, 0 <= a <= 2, from an x that is off by at most r x.

    For r <= 1/2 the result is off by a r (1 + 2 r) x^a at most: by the derivative at the far end,
    which is largest at x (1 + r) for a > 1 and at x (1 - r) for a < 1. For larger r it lies, like
    the exact one, between 0 and (x + r x)^a.
    """
    value = np.asarray(_powers(base.value, exponent.value), dtype=object)
    x, a, result = base.magnitude, exponent.magnitude, np.abs(value.astype(np.float64))
    r = np.divide(base.error, x, out=np.zeros_like(x + a), where=x > 0.0)
    far = np.where(base.error > 0.0, np.power(x + base.error, a), 0.0) * _MARGIN
    error = np.where((r <= 0.5) & (x > 0.0), a * r * (1.0 + 2.0 * r) * result, far)
    rounding = POWER_ERROR * (result + error) + _SMALLEST_SUBNORMAL * (result > 0.0)
    return Bounded(value, (error + rounding) * _MARGIN)


_RULES: dict[int, Callable[..., Bounded]] = {
    ca.OP_ADD: _add,
    ca.OP_SUB: _subtract,
    ca.OP_MUL: _multiply,
    ca.OP_NEG: _negate,
    ca.OP_FMIN: _minimum,
    ca.OP_FMAX: _maximum,
    ca.OP_SIGN: _sign,
    ca.OP_FABS: _magnitude,
    ca.OP_POW: _power,
    ca.OP_CONSTPOW: _power,
}


def exact_law(function: LawFunction, inputs: Mapping[str, Bounded]) -> dict[str, Bounded]:
    """All quantities of a law function, exact, with the error bounds of the double ones.

    A fused multiply-add, should CasADi's build use one, only drops one of the roundings counted.

    Args:
        function: the law, or a part of it.
        inputs: the value of each of its inputs, by name.

    Raises:
        verification.law_graph.UnknownOperationError: an operation has no error rule here.
    """
    with mpmath.workdps(DIGITS), np.errstate(under="ignore"):
        return evaluate(function, inputs, _RULES, exactly)


def distance(exact: Bounded, doubles: Doubles) -> Doubles:
    """How far doubles are from the exact numbers."""
    with mpmath.workdps(DIGITS):
        difference = np.asarray(_as_exact(doubles), dtype=object) - exact.value
        apart: Doubles = np.abs(difference.astype(np.float64))
    return apart
