"""Strict Lyapunov functions of the homogeneous and of the linear error dynamics.

For 0 < alpha < 1 and beta = alpha/(2 - alpha), in the coordinates

    X = sqrt((2 - alpha) KP) sig(e)^(1/(2 - alpha)),    Y = ed,    r^2 = X^2 + Y^2 = 2V of (20),
    kappa = KP^(1 - alpha/2) (2 - alpha)^(-alpha/2),    mu = KD / kappa,
    X' = kappa |X|^(alpha - 1) Y,    Y' = -kappa sig(X)^alpha - KD sig(Y)^alpha,

the function W = r^(3 - alpha) + delta sig(X)^(2 - alpha) Y is homogeneous, and so is its decrease:
one turn of the unit circle tells whether W > 0 and W' <= -c W^(2/(3 - alpha)) everywhere. Then W
is zero after (3 - alpha) / ((1 - alpha) c) W(0)^((1 - alpha)/(3 - alpha)) at the latest. The circle
is symmetric, half of it is proved, box by box in Arb; delta and c are found in floating point.

For alpha = beta = 1, W = ed^2 + KP e^2 + d e ed and W' <= -c W are quadratic forms, and exact.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np
from flint import arb, arb_series
from numpy.typing import NDArray

from verification.error_dynamics.balls import ball, exact, power, precision
from verification.error_dynamics.model import Parameters

Certificate: TypeAlias = dict[str, object]
"""As JSON has it; every number is a fraction as text."""

FORMAT = "error-dynamics-lyapunov-1"
_ANGLES = 500
_SLACK = Fraction(1, 1024)
"""Share of c that is given away: less would need more boxes."""
_DIGITS = 10**6
"""Of delta and c."""
_NARROWEST = Fraction(1, 2**40)
_CRITICAL_LOSS = Fraction(1, 10)
"""Share of the decay that a quadratic function of critically damped dynamics gives away."""


class NotProvedError(Exception):
    """No function of this form was found, or Arb refuses the one that was."""


def certificate(parameters: Parameters) -> Certificate:
    """A strict Lyapunov function with its certificate.

    Args:
        parameters: of a homogeneous pair with alpha < 1, or linear.

    Raises:
        NotProvedError: none is proved.
    """
    if parameters.linear:
        return _linear(parameters)
    if not parameters.homogeneous or parameters.alpha >= 1:
        raise NotProvedError("no strict function of this form is known for these exponents")
    delta = _best_delta(parameters)
    with precision():
        normal = _NormalForm(parameters, delta)
        decrease = _best_decrease(parameters, delta) * float(normal.kappa.mid())
        if not decrease > 0:
            raise NotProvedError("the damping is too weak or too strong for this form")
        c = _rounded_down(Fraction(decrease) * (1 - _SLACK))
        corner = exact(normal.radius)
        # Rounded up, so that the segments meet.
        v_end = Fraction(math.ceil(corner * _DIGITS), _DIGITS)
        x_end = -_rounded_down(-exact((ball(v_end) ** (ball(parameters.alpha) - 2)).upper()))
        ends = {"e=1": (-v_end, v_end), "v=1": (Fraction(0), x_end), "v=-1": (Fraction(0), x_end)}
        faces = {face: list(normal.boxes(c, face, *span)) for face, span in ends.items()}
        bound = normal.settling_bound(c)
    return {
        "format": FORMAT,
        "claim": "finite-time",
        **_of(parameters),
        "delta": str(delta),
        "c": str(c),
        "settling_time_bound_s": str(bound),
        "boxes": {face: [[str(a), str(b)] for a, b in boxes] for face, boxes in faces.items()},
    }


def _of(parameters: Parameters) -> dict[str, str]:
    return {name: str(getattr(parameters, name)) for name in ("KD", "KP", "alpha", "beta")}


# --- alpha = beta = 1 --------------------------------------------------------------------------


def _linear(parameters: Parameters) -> Certificate:
    """W = ed^2 + KP e^2 + d e ed, with W' <= -c W for an exact rational c.

    Weak damping: W' = -KD W for d = KD. Strong damping: d = 4 KP / KD reaches twice the slower
    root, of which the fraction below is a lower bound. Critical damping: W' <= -c W is possible
    for every c < KD, with d = KD (1 - eta) and (1 - c/KD)^2 >= eta/(2 - eta).
    """
    KD, KP = parameters.KD, parameters.KP
    excess = KD**2 - 4 * KP
    if excess < 0:
        d, c = KD, KD
    elif excess > 0:
        d = 4 * KP / KD
        with precision():
            twice_slower = ball(4 * KP) / (ball(KD) + ball(excess).sqrt())
            c = _rounded_down(exact(twice_slower.lower()))
    else:
        loss = _CRITICAL_LOSS
        d, c = KD * (1 - 2 * loss**2 / (1 + loss**2)), KD * (1 - loss)
    return {
        "format": FORMAT,
        "claim": "exponential",
        **_of(parameters),
        "d": str(d),
        "c": str(c),
        "error_factor_squared": str(KP / (KP - d**2 / 4)),
    }


def _rounded_down(value: Fraction) -> Fraction:
    """To six digits and more."""
    scale = _DIGITS * 10 ** max(0, -math.floor(math.log10(abs(value))))
    return Fraction(math.floor(value * scale), scale)


# --- beta = alpha / (2 - alpha) ----------------------------------------------------------------


class _NormalForm:
    """W and its decrease on the unit circle, in balls, in units of kappa."""

    def __init__(self, parameters: Parameters, delta: Fraction) -> None:
        self.alpha = ball(parameters.alpha)
        KP, two_less = ball(parameters.KP), 2 - self.alpha
        self.radius = (two_less * KP).sqrt()
        """r at e = 1, ed = 0."""
        self.kappa = KP ** (1 - self.alpha / 2) / two_less ** (self.alpha / 2)
        self.mu = ball(parameters.KD) / self.kappa
        self.delta = ball(delta)

    def _values(self, e: Any, v: Any, sign: int, c: arb) -> tuple[Any, Any]:
        """W, and W' + c W^(2/(3 - alpha)), at a place or along a power series of places.

        Args:
            e: of the place, at least 0.
            v: of the place, with one sign.
            sign: that of v.
            c: in units of kappa.
        """
        a, delta = self.alpha, self.delta
        X = self.radius * power(e, 1 / (2 - a))
        radius = (X * X + v * v).sqrt()
        cosine, size = X / radius, sign * v / radius
        lever, drag = power(cosine, 2 - a), power(size, a)
        W = 1 + sign * delta * lever * size
        energy = (3 - a) * self.mu * drag * size
        crossed = (2 - a) * size**2 - cosine**2 - sign * self.mu * lever * drag
        return W, delta * crossed - energy + c * power(W, 2 / (3 - a))

    def falls(self, face: str, low: Fraction, high: Fraction, c: arb) -> bool:
        """Whether W > 0 and W' < -c W^(2/(3 - alpha)) in a box of a segment.

        By the mean value theorem; where a power has no derivative, by the extremes of each term.
        """
        sign = 1 if face == "v=1" or (face == "e=1" and low >= 0) else -1
        middle, half = ball((low + high) / 2), ball((high - low) / 2)
        box = ball(low).union(ball(high))

        def place(u: Any) -> tuple[Any, Any]:
            one = u * 0 + 1
            return (one, u) if face == "e=1" else (u, sign * one)

        if low == 0 or high == 0:
            W, excess = self._values(*place(box), sign, c)
            return bool(W > 0 and excess < 0)
        W, excess = self._values(*place(middle), sign, c)
        over_W, over_excess = self._values(*place(arb_series([box, half])), sign, c)
        spread = arb(0, 1)
        return bool(
            over_W[0] > 0 and W + over_W[1] * spread > 0 and excess + over_excess[1] * spread < 0
        )

    def boxes(
        self, c: Fraction, face: str, start: Fraction, end: Fraction
    ) -> Iterator[tuple[Fraction, Fraction]]:
        """Boxes of one segment, in a row, as long as the claim is proved in one evaluation.

        Raises:
            NotProvedError: it is false somewhere, or too close to that.
        """
        scaled = ball(c) / self.kappa
        waiting = [(start, end)] if start >= 0 else [(Fraction(0), end), (start, Fraction(0))]
        while waiting:
            low, high = waiting.pop()
            if self.falls(face, low, high, scaled):
                yield low, high
                continue
            if high - low < _NARROWEST:
                raise NotProvedError("W does not fall as fast as floating point says")
            middle = (low + high) / 2
            waiting += [(middle, high), (low, middle)]

    def settling_bound(self, c: Fraction) -> Fraction:
        """Of the time from rest at e = 1, in s, rounded up."""
        degree = 1 - self.alpha
        bound = (3 - self.alpha) / (degree * ball(c)) * self.radius**degree
        places = 10**12
        return Fraction(math.ceil(exact(bound.upper()) * places), places)


# In floating point: what to prove.


def _decreases(parameters: Parameters, delta: float) -> NDArray[np.float64]:
    """-W'/(kappa W^(2/(3 - alpha))) along half the circle; -inf where W is not positive."""
    a = float(parameters.alpha)
    mu = float(parameters.KD) / (float(parameters.KP) ** (1 - a / 2) * (2 - a) ** (-a / 2))
    # Strong damping bends the circle's function where the speed is small.
    small = np.geomspace(1e-12, 1.0, _ANGLES)
    half = np.concatenate([small, np.linspace(0.0, np.pi / 2, _ANGLES), np.pi / 2 - small])
    angle = np.concatenate([-half, half])
    cosine, sine = np.abs(np.cos(angle)), np.sin(angle)
    lever, drag = cosine ** (2 - a), np.sign(sine) * np.abs(sine) ** a
    W = 1 + delta * lever * sine
    crossed = (2 - a) * sine**2 - cosine**2 - mu * lever * drag
    falls = (3 - a) * mu * np.abs(sine) ** (a + 1) - delta * crossed
    positive = W > 0
    return np.where(positive, falls / np.where(positive, W, 1.0) ** (2 / (3 - a)), -np.inf)


def _best_decrease(parameters: Parameters, delta: Fraction) -> float:
    return float(np.min(_decreases(parameters, float(delta))))


def _best_delta(parameters: Parameters) -> Fraction:
    """The delta whose least decrease is largest, by golden sections of its logarithm.

    The least over the circle of functions that are concave in delta where W is nearly 1 has one
    maximum in practice; another one would only cost tightness.
    """

    def least(log_delta: float) -> float:
        return float(np.min(_decreases(parameters, math.exp(log_delta))))

    grid = np.linspace(math.log(1e-9), math.log(4.0), 60)
    best = int(np.argmax([least(x) for x in grid]))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    ratio = (math.sqrt(5) - 1) / 2
    for _ in range(40):
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        low, high = (left, high) if least(left) < least(right) else (low, right)
    return _rounded_down(Fraction(math.exp((low + high) / 2)))
