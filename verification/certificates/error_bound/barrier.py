"""Finds, in floating point, a closed curve that no disturbed motion of the error leaves.

The curve is marched: from rest on the left, always along the outermost of the directions that a
disturbance can give the motion, turned outwards a little, until it comes to rest on the right. The
other half is its mirror image. Where it arrives no farther out than it began, it is closed. Each
curve that closes is a barrier; the march is repeated from closer in while it still does.

Nothing here is a proof: what the corners are worth is for the checker to say.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Point: TypeAlias = tuple[float, float]

_ANGLES = 201
"""Disturbances of the velocity that are tried in each place."""
_SLACK = 0.25
"""Share of the outward turn that must be left at an edge's end and inside it."""
_PLACES = (0.2, 0.4, 0.6, 0.8, 1.0)
"""Where along an edge that is looked at."""
_SHORTEST = 1e-7
_FINE = 1e-3
_LONGEST = 0.2
"""Edges, in units of the curve's own size."""
_LOW = 0.005
_LEANS = (0.03, 0.1, 0.3, 1.0, 3.0)
_MOST_EDGES = 4000
_DOUBLINGS = 60
_CLOSE = 2e-3
"""How much closer in than its beginning the curve may end, relative, to be taken."""
_REFINEMENTS = 40


class NoBarrierError(Exception):
    """No curve was found; the message says why."""


@dataclass(frozen=True)
class Disturbed:
    """The error dynamics with a disturbance, in floating point.

        e' = w + d,  w' = -KD sig(w + d)^alpha - KP sig(e)^beta      (of the velocity)
        e' = w,      w' = -KD sig(w)^alpha - KP sig(e)^beta + d      (of the acceleration)

    Attributes:
        KD, KP, alpha, beta: of the error dynamics (17).
        size: largest |d|.
        of_velocity: whether d is added to the velocity, else to the acceleration.
    """

    KD: float
    KP: float
    alpha: float
    beta: float
    size: float
    of_velocity: bool

    def velocities(self, e: float, w: float) -> Floats:
        """All that (e', w') can be, sampled, of shape (n, 2)."""
        if self.of_velocity:
            v = w + self.size * np.linspace(-1.0, 1.0, _ANGLES)
            d = 0.0
        else:
            v = np.array([w, w])
            d = self.size * np.array([-1.0, 1.0])
        rate = -self.KD * _sig(v, self.alpha) - self.KP * math.copysign(abs(e) ** self.beta, e) + d
        return np.column_stack([v, rate])


def _sig(x: Floats, exponent: float) -> Floats:
    return np.sign(x) * np.abs(x) ** exponent


@dataclass(frozen=True)
class March:
    """A curve from rest on the left to rest on the right, in units of its own size.

    Attributes:
        system: whose motions it keeps in.
        scale: units of e and w.
        turn: outwards, of each edge, in rad.
        bend: how far an edge may deviate from the outermost direction in the end, in rad.
    """

    system: Disturbed
    scale: Point
    turn: float
    bend: float

    def outermost(self, place: Point, direction: Point) -> float:
        """The angle from a direction, outwards, of the outermost possible motion."""
        found = self.system.velocities(place[0] * self.scale[0], place[1] * self.scale[1])
        x, y = found[:, 0] / self.scale[0], found[:, 1] / self.scale[1]
        dx, dy = direction
        return float(np.max(np.arctan2(dx * y - dy * x, dx * x + dy * y)))

    def run(self, start: float) -> list[Point]:
        """The corners from (-start, 0) to an end on the axis.

        Raises:
            NoBarrierError: it does not get there: it is too close in.
        """
        place, direction = (-start, 0.0), (0.0, 1.0)
        corners, length = [place], 0.05
        while len(corners) < _MOST_EDGES:
            ahead = self.outermost(place, direction)
            if abs(ahead) > math.pi / 2:
                raise NoBarrierError("a disturbance moves the error any way")
            direction = _turned(direction, ahead + self.turn)
            length = self._length(place, direction, min(2 * length, _LONGEST))
            after = _along(place, direction, length)
            if after[1] <= 0:
                if after[0] <= 0:
                    raise NoBarrierError("a disturbance moves the error back")
                share = place[1] / (place[1] - after[1])
                return [*corners, _along(place, direction, share * length)]
            place = after
            corners.append(place)
            end = self._end(place)
            if end is not None:
                return [*corners, end]
        raise NoBarrierError("the damping is too weak for a curve of few edges")

    def _end(self, place: Point) -> Point | None:
        """Where an edge to the axis may end, close to it; a node would be approached for ever."""
        if place[0] > 0 and place[1] < _LOW:
            for lean in _LEANS:
                size = math.hypot(lean, 1.0)
                direction, length = (lean / size, -1 / size), size * place[1]
                places = (_along(place, direction, length * p) for p in (0.0, *_PLACES))
                if max(self.outermost(p, direction) for p in places) <= -_SLACK * self.turn:
                    return place[0] + lean * place[1], 0.0
        return None

    def _length(self, place: Point, direction: Point, length: float) -> float:
        """The longest edge tried that all motions cross inwards and that does not go astray."""
        while length > _SHORTEST:
            angles = [self.outermost(_along(place, direction, length * p), direction) for p in _PLACES]
            bent = angles[-1] < -self.bend - self.turn and length > _FINE
            if max(angles) <= -_SLACK * self.turn and not bent:
                return length
            length /= 2
        raise NoBarrierError(f"the motion turns too fast {place} {direction} {angles}")


def _turned(direction: Point, angle: float) -> Point:
    c, s = math.cos(angle), math.sin(angle)
    x, y = c * direction[0] - s * direction[1], s * direction[0] + c * direction[1]
    size = math.hypot(x, y)
    return x / size, y / size


def _along(place: Point, direction: Point, length: float) -> Point:
    return place[0] + length * direction[0], place[1] + length * direction[1]


def barrier(system: Disturbed, turn: float, bend: float) -> list[Point]:
    """The corners of the upper half of a closed curve, from (-E, 0) to (E, 0).

    Args:
        system: whose motions it keeps in.
        turn: outwards, of each edge, in rad.
        bend: of an edge against the outermost motion, in rad.

    Raises:
        NoBarrierError: none is found.
    """
    size = _first_size(system)
    scale = size
    outside: list[Point] | None = None
    inside = 0.0
    start = 1.0
    for _ in range(_DOUBLINGS):
        try:
            corners = March(system, scale, turn, bend).run(start)
        except NoBarrierError:
            corners = []
        if corners and corners[-1][0] < start:
            break
        start *= 2.0
    else:
        raise NoBarrierError("no curve closes: the damping is too weak against the disturbance")
    # From here on in numbers of the system's own units: each march has another scale.
    low, high = inside, start * scale[0]
    best = _own(corners, scale)
    end = best[-1][0]
    for _ in range(_REFINEMENTS):
        if end >= (1 - _CLOSE) * high or high - low < _CLOSE * high:
            break
        # The end of one march is where the next would begin; where that is too close in, half way.
        trial = max(end, low + 0.1 * (high - low)) if low < end else (low + high) / 2
        trial *= 1 + _CLOSE / 4
        if not low < trial < high:
            trial = (low + high) / 2
        scale = max(-min(p[0] for p in best), max(p[0] for p in best)), max(p[1] for p in best)
        try:
            corners = _own(March(system, scale, turn, bend).run(trial / scale[0]), scale)
        except NoBarrierError:
            corners = []
        if corners and corners[-1][0] < trial:
            best, high, end = corners, trial, corners[-1][0]
        else:
            low = trial
    return [*best[:-1], (high, 0.0)]


def _own(corners: Sequence[Point], scale: Point) -> list[Point]:
    return [(scale[0] * e, scale[1] * w) for e, w in corners]


def _first_size(system: Disturbed) -> Point:
    """About how large the curve is."""
    push = system.KD * system.size**system.alpha if system.of_velocity else system.size
    e = (push / system.KP) ** (1 / system.beta)
    w = math.sqrt(2 * system.KP * e ** (system.beta + 1) / (system.beta + 1))
    return e, max(w, system.size) if system.of_velocity else w
