"""How long a motion of a homogeneous pair takes: to the origin, and into a band around it.

A motion of a focus turns around the origin; each half-turn from rest to rest is the last one,
scaled, so that all of them are a geometric series. A motion of a node ends along the curve
ed = -k sig(e)^(1/(2 - alpha)); on it q = |e|^(1/(2 - alpha)) obeys
q' = -k q^alpha / (2 - alpha).
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from flint import arb

from verification.error_dynamics.balls import ball, exact
from verification.error_dynamics.phase_plane import (
    INWARD,
    OUTWARD,
    Chart,
    Leg,
    PhasePlane,
    UnresolvedError,
)

_APPROACH = 2.0**-46
"""How much the time along a node's curve may be off, in s."""
_MOST_APPROACHES = 150
_MOST_BISECTIONS = 100
_EFOLDS = 30
"""Of a linear node's decay, that its slope must be known for."""


@dataclass(frozen=True)
class Piece:
    """A leg at its place in a motion.

    Attributes:
        leg: the leg, from scale 1.
        log_scale: logarithm of the scale where it starts.
        time: in s, where it starts.
    """

    leg: Leg
    log_scale: arb
    time: arb


@dataclass(frozen=True)
class End:
    """Where the pieces of a motion end: at rest, or close to a node's curve.

    Attributes:
        log_q: logarithm of q = |e|^(1/(2 - alpha)).
        time: in s.
        slopes: all values that w = |ed| / q takes from there on; None for rest.
    """

    log_q: arb
    time: arb
    slopes: arb | None = None


@dataclass(frozen=True)
class Motion:
    """A motion from its start to its first rest, or to a node's curve."""

    pieces: tuple[Piece, ...]
    end: End


class Motions:
    """All motions of one homogeneous pair.

    It is to be made and used within ``precision(terms=TERMS + 1)``.
    """

    def __init__(self, plane: PhasePlane) -> None:
        self.plane = plane
        self._degree = 1 - plane.alpha
        """Durations grow with q to this power."""

    # --- The way ---

    @cached_property
    def half_turn(self) -> Motion:
        """From rest at |e| = 1 to rest, in a focus."""
        return self._to_rest((*self._fall, *self._rise), arb(0))

    @cached_property
    def _fall(self) -> tuple[Leg, ...]:
        """From rest to e = 0, in a focus."""
        p = self.plane
        return (
            *p.legs(Chart.REST, INWARD, arb(0), p.unit),
            *p.legs(Chart.CROSSING, INWARD, p.crossing_unit, arb(0)),
        )

    @cached_property
    def _rise(self) -> tuple[Leg, ...]:
        """From e = 0 to rest."""
        p = self.plane
        return (
            *p.legs(Chart.CROSSING, OUTWARD, arb(0), p.crossing_unit),
            *p.legs(Chart.REST, OUTWARD, p.unit, arb(0)),
        )

    def motion(self, e: Fraction, ed: Fraction) -> Motion:
        """From an error in rad and its rate in rad/s, not both 0.

        Raises:
            UnresolvedError: it starts too close to a curve that is never crossed.
        """
        p = self.plane
        error, speed = (ball(abs(value)) for value in (e, ed))
        if e == 0:
            return self._to_rest(self._rise, speed.log())
        log_q = error.log() / (2 - p.alpha)
        w = speed / log_q.exp()
        if ed == 0:
            w = arb(0)
        near_rest = bool(w < p.unit)
        if e * ed > 0:
            if near_rest:
                return self._to_rest(p.legs(Chart.REST, OUTWARD, w, arb(0)), log_q)
            x = p.other(w)
            way = (
                *p.legs(Chart.CROSSING, OUTWARD, x, p.crossing_unit),
                *p.legs(Chart.REST, OUTWARD, p.unit, arb(0)),
            )
            return self._to_rest(way, speed.log())
        if p.slopes is not None and not w > p.slopes[1]:
            if not w < p.slopes[1]:
                raise UnresolvedError("the start is on the node's fast curve, or too close to it")
            return self._to_curve(w, log_q)
        if w == 0:
            return Motion((), End(log_q, arb(0)))
        if near_rest and p.slopes is None:
            way = (
                *p.legs(Chart.REST, INWARD, w, p.unit),
                *p.legs(Chart.CROSSING, INWARD, p.crossing_unit, arb(0)),
            )
            return self._to_rest((*way, *self._rise), log_q)
        way = tuple(p.legs(Chart.CROSSING, INWARD, p.other(w), arb(0)))
        return self._to_rest((*way, *self._rise), speed.log())

    def _to_rest(self, legs: Iterable[Leg], log_scale: arb) -> Motion:
        pieces = tuple(self._placed(legs, End(log_scale, arb(0))))
        return Motion(pieces, self._after(pieces[-1]))

    def _to_curve(self, w: arb, log_q: arb) -> Motion:
        """Ever closer to the node's slow curve, until the rest of the time is known well."""
        assert self.plane.slopes is not None
        slope = self.plane.slopes[0]
        pieces: list[Piece] = []
        end = End(log_q, arb(0), w.union(slope))
        for _ in range(_MOST_APPROACHES):
            if w.overlaps(slope) or self._unknown(end) < _APPROACH:
                break
            closer = ((w + slope) / 2).mid()
            if closer.overlaps(slope):
                break
            pieces += self._placed(self.plane.legs(Chart.REST, INWARD, w, closer), end)
            after = self._after(pieces[-1])
            w = closer
            end = End(after.log_q, after.time, w.union(slope))
        return Motion(tuple(pieces), end)

    def _placed(self, legs: Iterable[Leg], start: End) -> Iterator[Piece]:
        log_scale, time = start.log_q, start.time
        chart = None
        for leg in legs:
            if chart is not None and leg.chart is not chart:
                log_scale += self.plane.unit.log() * (1 if leg.chart is Chart.CROSSING else -1)
            chart = leg.chart
            yield Piece(leg, log_scale, time)
            time += self._lasting(leg, log_scale)
            log_scale += leg.growth

    def _lasting(self, leg: Leg, log_scale: arb) -> arb:
        return leg.duration * (self._degree * log_scale).exp()

    def _after(self, piece: Piece) -> End:
        time = piece.time + self._lasting(piece.leg, piece.log_scale)
        return End(piece.log_scale + piece.leg.growth, time)

    def overshoot(self) -> arb:
        """|e| at a rest over |e| at the rest before; 0 for a node, that has no second one."""
        if self.plane.slopes is not None:
            return arb(0)
        return ((2 - self.plane.alpha) * self.half_turn.end.log_q).exp()

    # --- Times ---

    def _along_curve(self, end: End, log_q: arb | None = None) -> arb:
        """From the end of a node's motion to a smaller q; without one to the origin.

        q' = -w q^alpha / (2 - alpha), for w anywhere between the end's and the curve's.
        """
        assert end.slopes is not None
        if self._degree == 0:
            assert log_q is not None
            return (end.log_q - log_q) / end.slopes
        rest = arb(0) if log_q is None else (self._degree * log_q).exp()
        travelled = ((self._degree * end.log_q).exp() - rest) / self._degree
        return (2 - self.plane.alpha) * travelled / end.slopes

    def _unknown(self, end: End) -> arb:
        """How much the time along a node's curve may be off, in s."""
        assert end.slopes is not None
        late = self._along_curve(end) if self._degree > 0 else arb(_EFOLDS) / end.slopes
        return late.rad()

    def time_to_origin(self, motion: Motion) -> arb:
        """Settling time in s, for alpha < 1."""
        end = motion.end
        scale = (self._degree * end.log_q).exp()
        if end.slopes is not None:
            return end.time + self._along_curve(end)
        if self.plane.slopes is not None:
            return end.time + scale * self.time_to_origin(self._from_rest)
        turn = self.half_turn.end
        return end.time + scale * turn.time / -(self._degree * turn.log_q).expm1()

    @cached_property
    def _from_rest(self) -> Motion:
        """A node's motion from rest at |e| = 1."""
        return self._to_curve(arb(0), arb(0))

    def time_to_band(self, motion: Motion, band: Fraction) -> arb:
        """When |e| is below a band for good, in s: the last time that it equals it, or 0."""
        log_q = ball(band).log() / (2 - self.plane.alpha)
        end = motion.end
        if end.slopes is not None or end.log_q < log_q:
            return self._last_crossing(motion, log_q)
        scale = (self._degree * end.log_q).exp()
        below = log_q - end.log_q
        if self.plane.slopes is not None:
            return end.time + scale * self._last_crossing(self._from_rest, below)
        turns = below / self.half_turn.end.log_q
        first, last = (int(exact(side.floor())) for side in (turns.lower(), turns.upper()))
        times = [self._after_turns(n, below) for n in range(max(first, 0), last + 1)]
        return end.time + scale * functools.reduce(arb.union, times)

    def _after_turns(self, turns: int, log_q: arb) -> arb:
        """From rest at |e| = 1, so many half-turns and the fall to a smaller q."""
        turn = self.half_turn.end
        ratio = (self._degree * turn.log_q).exp()
        every = arb(turns) if self._degree == 0 else (1 - ratio**turns) / (1 - ratio)
        fall = self._last_crossing(self.half_turn, log_q - turns * turn.log_q)
        return every * turn.time + ratio**turns * fall

    def _last_crossing(self, motion: Motion, log_q: arb) -> arb:
        """The last time that q falls to a value within a motion, or along the curve after it.

        0 where q is never above it.
        """
        for index, piece in reversed(tuple(enumerate(motion.pieces))):
            start, end = self._height(piece), self._height(piece, piece.leg)
            if piece.leg.sigma == INWARD and not start < log_q and end < log_q:
                crossing = self._crossing_in(piece, log_q)
                if start > log_q:
                    return crossing
                return self._above_until(motion.pieces[:index], log_q).union(crossing)
        if motion.end.slopes is None or motion.end.log_q < log_q:
            return arb(0)
        after = motion.end.time + self._along_curve(motion.end, log_q)
        if motion.end.log_q > log_q:
            return after
        return self._above_until(motion.pieces, log_q).union(after)

    def _above_until(self, pieces: tuple[Piece, ...], log_q: arb) -> arb:
        """The start of the last piece that certainly starts above a value of q, else 0."""
        above = (piece.time for piece in reversed(pieces) if self._height(piece) > log_q)
        return next(above, arb(0))

    def _height(self, piece: Piece, leg: Leg | None = None) -> arb:
        """Logarithm of q at the start of a piece, or after a leg of it."""
        log_scale, at = piece.log_scale, piece.leg.start
        if leg is not None:
            log_scale, at = log_scale + leg.growth, leg.end
        if piece.leg.chart is Chart.REST:
            return log_scale
        if at == 0:
            return arb.neg_inf()
        return log_scale + at.log() / (2 - self.plane.alpha)

    def _crossing_in(self, piece: Piece, log_q: arb) -> arb:
        """When q falls to a value within a piece, by bisection."""
        leg = piece.leg
        early, late = leg.start, leg.end
        first, last = piece.time, self._after(piece).time
        if early == 0 or late == 0:
            return first.union(last)
        for _ in range(_MOST_BISECTIONS):
            middle = ((early + late) / 2).mid()
            part = self.plane.panel(leg.chart, leg.sigma, leg.start, middle)
            if part is None:
                break
            height = self._height(piece, part)
            time = piece.time + self._lasting(part, piece.log_scale)
            if height > log_q:
                early, first = middle, time
            elif height < log_q:
                late, last = middle, time
            else:
                break
        return first.union(last)
