"""The way of the error through the phase plane, for the pairs beta = alpha / (2 - alpha).

These pairs (35) are homogeneous: a motion that starts with a larger error is the same curve,
scaled. By the symmetry (e, ed) -> (-e, -ed) the speed y = |ed| may be taken as that of a falling
error; then a motion moves *inward* where e > 0 (sigma = -1: the damping brakes what the stiffness
drives) and *outward* where e < 0 (sigma = +1: both brake). With q = |e|^(1/(2 - alpha)) the shape
of a motion is a function of one coordinate, in one of two charts:

- ``REST``, at and near ed = 0: w = y / q, and q for the scale,
      P(w) = w^2/(2 - alpha) + sigma KD w^alpha + KP,
      d log q / dw = -w / ((2 - alpha) P),    dt = -sigma q^(1 - alpha) dw / P;
- ``CROSSING``, at and near e = 0: x = |e| / y^(2 - alpha), and y for the scale,
      S(x) = 1 + sigma (2 - alpha) KD x + (2 - alpha) KP x^(beta + 1),
      d log y / dx = -(sigma KD + KP x^beta) / S,    dt = sigma y^(1 - alpha) dx / S.

So all times are quadratures. They are enclosed panel by panel: a Taylor polynomial at the middle of
a panel, and Lagrange's remainder over the whole of it, in Arb. A positive root of the inward P is a
curve ed = -w e^(1/(2 - alpha)) that motions never cross: then the origin is a node.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

from flint import arb, arb_series

from verification.error_dynamics.balls import ball, power, precision
from verification.error_dynamics.classes import Approach
from verification.error_dynamics.model import Parameters

TERMS = 24
"""Of the Taylor polynomials."""
_TOLERANCE = 2.0**-58
"""Remainder that a panel may have: of 1 or its growth, and of the shortest time or its own."""
_FIRST = 2.0**-52
"""Width of the panel at an axis, where a power has no Taylor series, of the unit there."""
_MOST_HALVINGS = 2000
_MOST_BITS = 4096
_EXACT_DENOMINATOR = 2000
_UNIT = arb(0, 1)
"""The ball [-1, 1]."""
_ZERO_TO_ONE = arb(0).union(arb(1))


class UnresolvedError(Exception):
    """Arithmetic of this precision cannot tell; the message says what."""


# --- Node or focus -----------------------------------------------------------------------------


def critical_damping(parameters: Parameters) -> arb:
    """KD* = 2 KP^(1 - alpha/2) / ((2 - alpha) alpha^(alpha/2)): from here on a node.

    The least k^2/(2 - alpha) - KD k^alpha + KP over all slopes k > 0 is zero there.
    """
    alpha, KP = ball(parameters.alpha), ball(parameters.KP)
    return 2 * KP ** (1 - alpha / 2) / ((2 - alpha) * alpha ** (alpha / 2))


def equilibrium(parameters: Parameters) -> Approach:
    """Whether motions of a homogeneous pair end along a curve or turn around the origin, by KD*.

    Raises:
        UnresolvedError: KD equals KD* to more than a thousand digits, and may be equal.
    """
    bits = 64
    while bits <= _MOST_BITS:
        with precision(bits):
            excess = ball(parameters.KD) - critical_damping(parameters)
            if excess != 0 and not excess.contains(0):
                return Approach.NODE if excess > 0 else Approach.FOCUS
        if bits == 256 and _is_critical(parameters):
            return Approach.CRITICAL
        bits *= 2
    raise UnresolvedError("KD and KD* agree in more digits than can be told apart")


def _is_critical(parameters: Parameters) -> bool:
    """KD = KD*, exactly, for an alpha with a small denominator."""
    a, b = parameters.alpha.numerator, parameters.alpha.denominator
    if b > _EXACT_DENOMINATOR:
        return False
    left = (parameters.KD * (2 - parameters.alpha) / 2) ** (2 * b) * parameters.alpha**a
    return bool(left == parameters.KP ** (2 * b - a))


def invariant_slopes(parameters: Parameters) -> tuple[arb, arb] | None:
    """The slopes k of the curves ed = -k sig(e)^(1/(2 - alpha)) that no motion crosses, if any.

    They are the roots of k^2/(2 - alpha) - KD k^alpha + KP, which falls and then rises.
    """
    found = equilibrium(parameters)
    if found is Approach.FOCUS:
        return None
    alpha, KD, KP = ball(parameters.alpha), ball(parameters.KD), ball(parameters.KP)
    lowest = (KD * alpha * (2 - alpha) / 2) ** (1 / (2 - alpha))
    if found is Approach.CRITICAL:
        return lowest, lowest

    def positive(k: arb) -> bool | None:
        value = k * k / (2 - alpha) - KD * k**alpha + KP
        return None if value.contains(0) else bool(value > 0)

    far = lowest * 2
    while positive(far.mid()) is not True:
        far *= 2
    return _root(positive, arb(0), lowest.mid()), _root(positive, far.mid(), lowest.mid())


def _root(positive: Any, above: arb, below: arb) -> arb:
    """Where the sign changes, by bisection for as long as signs are certain."""
    while True:
        middle = ((above + below) / 2).mid()
        sign = positive(middle) if middle > 0 else True
        if sign is None or (above - below).abs_upper() < _TOLERANCE**2 * below:
            return above.union(below)
        above, below = (middle, below) if sign else (above, middle)


# --- Quadratures -------------------------------------------------------------------------------


class Chart(Enum):
    """The two coordinates of a motion's shape."""

    REST = "w"
    CROSSING = "x"


INWARD, OUTWARD = -1, 1


@dataclass(frozen=True)
class Leg:
    """A part of a motion, from a scale of 1.

    Attributes:
        chart: of the coordinate.
        sigma: INWARD or OUTWARD.
        start: the coordinate where it starts.
        end: where it ends.
        growth: of the logarithm of the scale.
        duration: in s, for a start at scale 1.
    """

    chart: Chart
    sigma: int
    start: arb
    end: arb
    growth: arb
    duration: arb


@dataclass(frozen=True)
class PhasePlane:
    """The phase plane of a homogeneous pair, in balls.

    It is to be made and used within ``precision(terms=TERMS + 1)``.

    Attributes:
        KD, KP, alpha, beta: of the dynamics.
        unit: where the charts meet, w = sqrt((2 - alpha) KP): equal kinetic and potential energy.
        slopes: of the two curves that are never crossed; None where there are none.
    """

    KD: arb
    KP: arb
    alpha: arb
    beta: arb
    unit: arb
    slopes: tuple[arb, arb] | None

    @classmethod
    def of(cls, parameters: Parameters) -> PhasePlane:
        """The phase plane of a homogeneous pair.

        Raises:
            UnresolvedError: it is too close to call whether there are such curves.
        """
        KD, KP, alpha, beta = (
            ball(getattr(parameters, name)) for name in ("KD", "KP", "alpha", "beta")
        )
        unit = ((2 - alpha) * KP).sqrt().mid()
        return cls(KD, KP, alpha, beta, unit, invariant_slopes(parameters))

    # --- The two charts ---

    def _terms(self, chart: Chart, sigma: int, u: Any) -> tuple[Any, Any]:
        """P or S, and the numerator of d log scale, for a ball or a power series."""
        if chart is Chart.REST:
            shape = u * u / (2 - self.alpha) + sigma * self.KD * power(u, self.alpha) + self.KP
            return shape, -u / (2 - self.alpha)
        stiffness = self.KP * power(u, self.beta)
        shape = 1 + (2 - self.alpha) * u * (sigma * self.KD + stiffness)
        return shape, -(sigma * self.KD + stiffness)

    def _touching_zero(self, chart: Chart, sigma: int, start: arb, end: arb) -> Leg:
        """The panel at an axis, from the extremes of both rates."""
        shape, numerator = self._terms(chart, sigma, start.union(end))
        growth = numerator / shape * (end - start)
        direction = -sigma if chart is Chart.REST else sigma
        rate = direction / shape * ((1 - self.alpha) * growth * _ZERO_TO_ONE).exp()
        return Leg(chart, sigma, start, end, growth, rate * (end - start))

    def panel(
        self, chart: Chart, sigma: int, start: arb, end: arb, grown: arb | None = None
    ) -> Leg | None:
        """A leg of one panel, away from the axes; None where its remainders are not small.

        Args:
            chart: of the coordinate.
            sigma: INWARD or OUTWARD.
            start: where it starts.
            end: where it ends.
            grown: growth before it; times count less, the more the scale has shrunk.
        """
        middle, half = (start + end) / 2, (end - start) / 2
        whole = start.union(end)
        series = arb_series([middle, half])
        shape, numerator = self._terms(chart, sigma, series)
        over_shape, over_numerator = self._terms(chart, sigma, arb_series([whole, half]))
        # The mean value theorem's range of P is narrower near a zero of it.
        coefficients = list(over_shape)
        coefficients[0] = shape[0] + coefficients[1] * _UNIT
        if coefficients[0].contains(0):
            return None
        over_shape = arb_series(coefficients)
        rate, over_rate = numerator / shape * half, over_numerator / over_shape * half

        growth = _polynomial(rate).integral()
        rest = over_rate[TERMS] * _UNIT * 2 / (TERMS + 1)
        before = -_at(growth, -1) + rest
        total = _at(growth, 1) + before + rest

        direction = (-sigma if chart is Chart.REST else sigma) * half
        degree = 1 - self.alpha
        speed = (degree * (growth + before)).exp() / shape * direction
        over_growth = over_rate.integral() + over_rate[0] * 2 * _ZERO_TO_ONE
        over_speed = (degree * over_growth).exp() / over_shape * direction
        time_rest = over_speed[TERMS] * _UNIT * 2 / (TERMS + 1)
        primitive = _polynomial(speed).integral()
        duration = _at(primitive, 1) - _at(primitive, -1) + time_rest
        if not rest.rad() < _TOLERANCE * (1 + abs(total)):
            return None
        if not time_rest.rad() < _TOLERANCE * (self.unit / self.KP + abs(duration)):
            # Where little is left of q, dt = sigma (2 - alpha)/w q^(1 - alpha) d log q will do.
            if grown is None or chart is Chart.CROSSING or not degree > 0:
                return None
            duration = sigma * (2 - self.alpha) * (degree * total).expm1() / (degree * whole)
            if not duration.rad() * (degree * grown).exp() < _TOLERANCE * self.unit / self.KP:
                return None
        return Leg(chart, sigma, start, end, total, duration)

    def legs(self, chart: Chart, sigma: int, start: arb, end: arb) -> Iterator[Leg]:
        """A way along one coordinate, in panels as short as the remainders need.

        Raises:
            UnresolvedError: no panels are short enough.
        """
        unit = self.unit if chart is Chart.REST else self.crossing_unit
        first = (unit * _FIRST).mid()
        if end == 0 and start <= first:
            yield self._touching_zero(chart, sigma, start, end)
            return
        if start == 0:
            yield self._touching_zero(chart, sigma, start, first)
            start = first
        waiting = [(start, first if end == 0 else end)]
        done, grown = 0, arb(0)
        while waiting:
            a, b = waiting.pop()
            leg = self.panel(chart, sigma, a, b, grown)
            if leg is not None:
                grown += leg.growth
                yield leg
                continue
            done += 1
            if done > _MOST_HALVINGS:
                raise UnresolvedError("the motion is too close to a curve that is never crossed")
            middle = ((a + b) / 2).mid()
            waiting += [(middle, b), (a, middle)]
        if end == 0:
            yield self._touching_zero(chart, sigma, first, end)

    @cached_property
    def crossing_unit(self) -> arb:
        """The same place as ``unit`` in the other chart."""
        return self.other(self.unit)

    def other(self, w: arb) -> arb:
        """x = |e| / y^(2 - alpha) for w = y / |e|^(1/(2 - alpha))."""
        return w ** (self.alpha - 2)


def _polynomial(series: arb_series) -> arb_series:
    """The series up to the remainder's power."""
    return arb_series([series[k] for k in range(TERMS)])


def _at(series: arb_series, side: int) -> arb:
    """The sum at 1 or -1."""
    return sum((series[k] * side**k for k in range(len(series))), arb(0))
