"""Finds, in floating point, a closed curve that no disturbed motion of the error leaves.

The curve is marched: from rest on the left, always along the outermost of the directions that a
disturbance can give the motion, turned outwards a little, until it comes to rest on the right. The
other half is its mirror image. Where it arrives no farther out than it began, it is closed. Each
curve that closes is a barrier; the march is repeated from closer in while it still does.

Where the damping is strong, motions come to rest along a node's lines, and three corners do for a
disturbance of the acceleration: the march, which follows the motions, would need very many.

Nothing here is a proof: what the corners are worth is for the checker to say.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Point: TypeAlias = tuple[float, float]

_SPREAD = np.linspace(-1.0, 1.0, 101)
"""Disturbances of the velocity that are tried in each place, in units of the largest."""
_ENDS = np.array([-1.0, 1.0])
"""Those of the acceleration."""
_SLACK = 0.25
"""Share of the outward turn that must be left at an edge's end and inside it."""
_PLACES = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
"""Where along an edge that is looked at."""
_HERE = np.zeros(1)
_PLACES_AND_START = np.array([0.0, *_PLACES])
_SHORTEST = 1e-4
_FINE = 1e-3
_LONGEST = 0.2
"""Edges, in units of the curve's own size."""
_TURNS = (1.0, 4.0, 16.0, 64.0, 256.0, 700.0)
"""That are tried, in the smallest."""
_DETOUR = 4e-3
_LOW = 0.005
_LEANS = (0.03, 0.1, 0.3, 1.0, 3.0)
_MOST_EDGES = 2000
"""Of one march."""
_MOST_IN_ALL = 8000
_WIDEST = 0.02
"""How much the curve may be larger than where it arrives, relative: else it is no bound to give."""
_DOUBLINGS = 16
_RESCALINGS = 2
_REFINEMENTS = 20
_CLOSE = 5e-4
"""How much closer in than its beginning the curve may end, relative, to be taken."""
_DARING = 0.98
_BACK = 0.3
"""Share of the way from what does not close, where the meeting is beyond it."""
_STEEPEST = 0.995
_MOST_LEAN = 10.0
"""The last edge is at least so much longer than it is leant."""
_NODE_FARTHER = 1.001
"""Than where the largest disturbance holds the error still."""
_NODE_LEANS = (1e-3, 1e-5, 1e-7)
"""Of the edge from rest, outwards, relative."""
_NODE_LEAST = 1e-6
"""Inwards, relative to what each term alone gives."""
_FROM_AN_END = np.array([0.0, *np.geomspace(1e-6, 0.5, 60)])
_ALONG = np.concatenate([_FROM_AN_END, 1.0 - _FROM_AN_END])
"""Where on an edge of these: closest at its ends, as sig is steepest where the error rests."""


_TOO = "the damping is too weak, or too strong, for a curve of few edges"


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

    def velocities(self, e: Floats, w: Floats) -> tuple[Floats, Floats]:
        """All that e' and w' can be in n places, sampled, each of shape (n, disturbances)."""
        spring = self.KP * _sig(e, self.beta)[:, None]
        if self.of_velocity:
            v = w[:, None] + self.size * _SPREAD
            return v, -self.KD * _sig(v, self.alpha) - spring
        rate = -self.KD * _sig(w, self.alpha)[:, None] - spring + self.size * _ENDS
        return np.broadcast_to(w[:, None], rate.shape), rate


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
        edges: ends where enough have been marched.
    """

    system: Disturbed
    scale: Point
    turn: float
    bend: float
    edges: Iterator[int]

    def outermost(self, place: Point, direction: Point, along: Floats) -> Floats:
        """The angles from a direction, outwards, of the outermost possible motions.

        Args:
            place: where they are looked at,
            direction: and from there in this direction,
            along: this far, of shape (n,).
        """
        dx, dy = direction
        e, w = (self.scale[k] * (place[k] + along * direction[k]) for k in (0, 1))
        x, y = self.system.velocities(e, w)
        x, y = x / self.scale[0], y / self.scale[1]
        angles: Floats = np.max(np.arctan2(dx * y - dy * x, dx * x + dy * y), axis=1)
        return angles

    def run(self, start: float) -> list[Point]:
        """The corners from (-start, 0) to an end on the axis.

        Raises:
            NoBarrierError: it does not get there: it is too close in.
        """
        place, direction = (-start, 0.0), (0.0, 1.0)
        corners, length = [place], 0.05
        while len(corners) < _MOST_EDGES and next(self.edges, None) is not None:
            ahead = float(self.outermost(place, direction, _HERE)[0])
            if abs(ahead) > math.pi / 2:
                raise NoBarrierError("a disturbance moves the error any way")
            direction, length = self._edge(place, _turned(direction, ahead), 2 * length)
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
        raise NoBarrierError(_TOO)

    def _end(self, place: Point) -> Point | None:
        """Where an edge to the axis may end, close to it; a node would be approached for ever."""
        if place[0] > 0 and place[1] < _LOW:
            for lean in _LEANS:
                size = math.hypot(lean, 1.0)
                direction, length = (lean / size, -1 / size), size * place[1]
                angles = self.outermost(place, direction, length * _PLACES_AND_START)
                if np.max(angles) <= -_SLACK * self.turn:
                    return place[0] + lean * place[1], 0.0
        return None

    def _edge(self, place: Point, outermost: Point, longest: float) -> tuple[Point, float]:
        """Direction and length of an edge that all motions cross inwards.

        Close to where a disturbance holds the error still, it takes a larger turn.
        """
        for times in _TURNS:
            turn = times * self.turn
            direction = _turned(outermost, turn)
            length = min(longest, _LONGEST if times == 1.0 else _DETOUR)
            while length > _SHORTEST:
                angles = self.outermost(place, direction, length * _PLACES)
                bent = angles[-1] < -self.bend - turn and length > _FINE
                if np.max(angles) <= -_SLACK * self.turn and not bent:
                    return direction, length
                length /= 2
        raise NoBarrierError("the disturbed motion turns too fast")


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
    edges = iter(range(_MOST_IN_ALL))
    curve = _first(system, turn, bend, edges)
    # With one scale at a time, that of the curve: another one would be another march.
    for _ in range(_RESCALINGS):
        curve = _closest(March(system, curve.size, turn, bend, edges), curve)
    if curve.gap > _WIDEST:
        raise NoBarrierError(_TOO)
    return curve.closed()


def at_a_node(system: Disturbed) -> list[Point]:
    """Three corners, (-E, 0), (-E - h, k (2E + h)), (E, 0): motions cross e' = k (E - e) inwards.

    Linear and overdamped, k may be anything between the two roots of k^2 - KD k + KP.

    Args:
        system: whose motions it keeps in; with a disturbance of the acceleration.

    Raises:
        NoBarrierError: the damping is not strong enough for it.
    """
    far = _NODE_FARTHER * (system.size / system.KP) ** (1 / system.beta)
    slopes = np.geomspace(system.KP / system.KD / 8, 8 * system.KD, 60)
    for slope, lean in itertools.product(map(float, slopes), _NODE_LEANS):
        top = (-far * (1 + lean), slope * far * (2 + lean))
        corners = [(-far, 0.0), top, (far, 0.0)]
        if all(_enters(system, *edge) for edge in itertools.pairwise(corners)):
            return corners
    raise NoBarrierError("the damping is too weak for three corners")


def _enters(system: Disturbed, start: Point, end: Point) -> bool:
    """Whether motions cross an edge inwards in all places that are looked at."""
    right, up = end[0] - start[0], end[1] - start[1]
    x, y = system.velocities(start[0] + _ALONG * right, start[1] + _ALONG * up)
    outward, size = right * y - up * x, np.abs(right * y) + np.abs(up * x)
    return bool(np.all(outward < -_NODE_LEAST * size))


@dataclass(frozen=True)
class _Curve:
    """A march that arrives no farther out than it began."""

    corners: tuple[Point, ...]

    @property
    def start(self) -> float:
        return -self.corners[0][0]

    @property
    def end(self) -> float:
        return self.corners[-1][0]

    @property
    def gap(self) -> float:
        """How much farther out it began, relative."""
        return 1 - self.end / self.start

    @property
    def size(self) -> Point:
        return max(abs(e) for e, _ in self.corners), max(w for _, w in self.corners)

    def closed(self) -> list[Point]:
        """The corners with the last edge leant outwards to where the mirror image begins."""
        low = _MOST_LEAN * self.gap * self.size[1]
        kept = [corner for corner in self.corners[1:-1] if corner[0] < 0 or corner[1] > low]
        return [self.corners[0], *kept, (self.start, 0.0)]


def _try(march: March, start: float) -> _Curve | None:
    """The curve from a start in the system's own units, if it arrives no farther out."""
    size_e, size_w = march.scale
    try:
        corners = march.run(start / size_e)
    except NoBarrierError:
        return None
    curve = _Curve(tuple((size_e * e, size_w * w) for e, w in corners))
    return curve if curve.end < curve.start else None


def _first(system: Disturbed, turn: float, bend: float, edges: Iterator[int]) -> _Curve:
    """A curve that is far out, or not so far."""
    push = system.KD * system.size**system.alpha if system.of_velocity else system.size
    e = (push / system.KP) ** (1 / system.beta)
    for _ in range(_DOUBLINGS):
        spring = system.KP * e**system.beta
        free = math.sqrt(2 * spring * e / (system.beta + 1))
        w = min(free, (spring / system.KD) ** (1 / system.alpha))
        if system.of_velocity:
            w = max(w, system.size)
        curve = _try(March(system, (e, w), turn, bend, edges), e)
        if curve is not None:
            return curve
        e *= 2.0
    raise NoBarrierError(_TOO)


def _closest(march: March, found: _Curve) -> _Curve:
    """The smallest curve that closes, nearly: where the next would begin a march has its end."""
    low, slope = 0.0, 0.0
    best = _try(march, found.start) or _try(march, 1.01 * found.start)
    if best is None:
        return found
    for _ in range(_REFINEMENTS):
        if best.gap < _CLOSE or best.start - low < _CLOSE * best.start:
            break
        # Where start and end would meet if the end moved as it last did.
        step = _DARING * (best.start - best.end) / (1 - slope)
        start = max(best.start - step, low + _BACK * (best.start - low))
        curve = _try(march, start)
        if curve is None:
            low = start
        else:
            slope = min(max((best.end - curve.end) / (best.start - start), 0.0), _STEEPEST)
            best = curve
    return best
