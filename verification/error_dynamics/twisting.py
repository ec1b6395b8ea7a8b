"""The twisting algorithm edd + KD sgn(ed) + KP sgn(e) = 0, KP > KD, in closed form.

A falling error is accelerated by KP - KD, a rising one is braked by KP + KD: parabolas.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from fractions import Fraction

from flint import arb

from verification.error_dynamics.balls import ball, exact
from verification.error_dynamics.model import Parameters


@dataclass(frozen=True)
class Twisting:
    """Times of its motions, to be used within `balls.precision()`."""

    parameters: Parameters

    @property
    def _drive(self) -> Fraction:
        return self.parameters.KP - self.parameters.KD

    @property
    def _brake(self) -> Fraction:
        return self.parameters.KP + self.parameters.KD

    @property
    def ratio(self) -> Fraction:
        """Of |e| at a rest to that at the rest before."""
        return self._drive / self._brake

    def _first_rest(self, e: Fraction, ed: Fraction) -> tuple[Fraction, arb]:
        """|e| at the first rest, and when."""
        outward = e * ed >= 0
        fast = ed**2 + (0 if outward else 2 * self._drive * abs(e))
        peak = fast / (2 * self._brake) + (abs(e) if outward else 0)
        fall = arb(0) if outward else (ball(fast).sqrt() - ball(abs(ed))) / ball(self._drive)
        return peak, fall + ball(fast).sqrt() / ball(self._brake)

    def _half_turn(self, peak: Fraction) -> arb:
        """From rest to rest, in s."""
        speed = ball(2 * peak * self._drive).sqrt()
        return speed / ball(self._drive) + speed / ball(self._brake)

    def time_to_origin(self, e: Fraction, ed: Fraction) -> arb:
        """Settling time in s."""
        if not (e or ed):
            return arb(0)
        peak, start = (abs(e), arb(0)) if ed == 0 else self._first_rest(e, ed)
        return start + self._half_turn(peak) / (1 - ball(self.ratio).sqrt())

    def time_to_band(self, e: Fraction, ed: Fraction, band: Fraction) -> arb:
        """The last time that |e| equals a band's edge, in s; 0 where it never does."""
        peak, time = (abs(e), arb(0)) if ed == 0 else self._first_rest(e, ed)
        if peak <= band:
            if e * ed >= 0 or abs(e) <= band:
                return arb(0)
            fast = ball(ed**2 + 2 * self._drive * (abs(e) - band)).sqrt()
            return (fast - ball(abs(ed))) / ball(self._drive)
        turns = (ball(band) / ball(peak)).log() / ball(self.ratio).log()
        first, last = (int(exact(side.floor())) for side in (turns.lower(), turns.upper()))
        ratio = ball(self.ratio)
        times = []
        for n in range(max(first, 0), last + 1):
            every = self._half_turn(peak) * (1 - ratio.sqrt() ** n) / (1 - ratio.sqrt())
            above = (ball(peak) * ratio**n - ball(band)).nonnegative_part()
            times.append(every + (2 * above / ball(self._drive)).sqrt())
        return time + functools.reduce(arb.union, times)
