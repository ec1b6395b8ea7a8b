"""Looks for the range of the eigenvalues of M(q)^-1 Mbar, and for boxes on which it can be proved.

All in doubles without rounding outwards: nothing here is a proof, and a mistake here can only make
the checker refuse. M(q) and its slopes are CasADi expressions, the composite-rigid-body algorithm
of :mod:`plant.compiled.rigid_body`, walked over arrays of numbers for samples and over arrays of
intervals for branch and bound.

With the symmetric S = Mbar^-1/2 M Mbar^-1/2 the eigenvalues of M^-1 Mbar are those of S^-1, and all
of them are below r where r M - Mbar is positive definite, above r where Mbar - r M is.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from plant.compiled.rigid_body import Mass, inertia_matrix, joints, mass_numbers, tree
from verification.law_graph import walk

Doubles = NDArray[np.float64]
Cell = tuple[tuple[int, int], ...]
"""Of each coordinate (k, p): the part from k/2^p to (k+1)/2^p of its range."""

MAX_BOXES = 60_000
_SLACK = 1.5
"""By how much a box's matrix may change more than it does: the checker's bounds are wider."""
_SAMPLES = 20_000
_ROUNDS, _NARROWER = 12, 0.5
"""The best sample is looked for again around itself, each time in a smaller range."""
_WHOLE_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class _Span:
    """Intervals, without care for rounding."""

    low: Doubles
    high: Doubles


def _times(a: _Span, b: _Span) -> _Span:
    ends = [x * y for x in (a.low, a.high) for y in (b.low, b.high)]
    return _Span(np.minimum.reduce(ends), np.maximum.reduce(ends))


def _square(a: _Span) -> _Span:
    ends = np.abs(a.low), np.abs(a.high)
    least = np.where((a.low <= 0.0) & (a.high >= 0.0), 0.0, np.minimum(*ends))
    return _Span(least**2, np.maximum(*ends) ** 2)


def _sine(a: _Span) -> _Span:
    ends = np.sin(a.low), np.sin(a.high)

    def passes(angle: float) -> NDArray[np.bool_]:
        inside: NDArray[np.bool_] = (
            np.ceil((a.low - angle) / _WHOLE_TURN) <= (a.high - angle) / _WHOLE_TURN
        )
        return inside

    return _Span(
        np.where(passes(-math.pi / 2), -1.0, np.minimum(*ends)),
        np.where(passes(math.pi / 2), 1.0, np.maximum(*ends)),
    )


def _cosine(a: _Span) -> _Span:
    return _sine(_Span(a.low + math.pi / 2, a.high + math.pi / 2))


def _negative(a: _Span) -> _Span:
    return _Span(-a.high, -a.low)


_SPANS: dict[int, Callable[..., _Span]] = {
    ca.OP_ADD: lambda a, b: _Span(a.low + b.low, a.high + b.high),
    ca.OP_SUB: lambda a, b: _Span(a.low - b.high, a.high - b.low),
    ca.OP_MUL: _times,
    ca.OP_NEG: _negative,
    ca.OP_SQ: _square,
    ca.OP_TWICE: lambda a: _Span(2.0 * a.low, 2.0 * a.high),
    ca.OP_SIN: _sine,
    ca.OP_COS: _cosine,
}
_NUMBERS: dict[int, Callable[..., Doubles]] = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_NEG: np.negative,
    ca.OP_SQ: np.square,
    ca.OP_TWICE: lambda a: 2.0 * a,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
}


class Inertia:
    """S(q) of a robot, over arrays of joint positions."""

    def __init__(self, model: pin.Model, Mbar: Sequence[float]) -> None:
        """Of a Pinocchio model with its armature; the joints on the base stay at 0.

        Args:
            model: from :func:`plant.model.build_model`.
            Mbar: diagonal [kg m^2].
        """
        chain = joints(model)
        masses = [Mass.of_numbers(mass_numbers(i)) for i in list(model.inertias)[1:]]
        q = [ca.SX.sym(f"q{i}") if j.parent >= 0 else ca.SX(0) for i, j in enumerate(chain)]
        moving = [q[i] for i, j in enumerate(chain) if j.parent >= 0]
        M = inertia_matrix(tree(chain, masses, ca.vertcat(*q)), [*map(float, model.armature)])
        root = 1.0 / np.sqrt(np.asarray(Mbar, dtype=np.float64))
        S = M * ca.SX(ca.DM(np.outer(root, root)))
        self._n = len(chain)
        slopes = [ca.densify(ca.jacobian(ca.vec(S), x)) for x in moving]
        self._values = ca.Function("S", moving, ca.vertsplit(ca.vec(S)))
        self._slopes = ca.Function(
            "slopes", moving, [x for slope in slopes for x in ca.vertsplit(slope)]
        )

    def at(self, q: Doubles) -> Doubles:
        """S, shape (..., n, n), at coordinates q [rad], shape (..., number of coordinates)."""
        values = walk(self._values, list(np.moveaxis(q, -1, 0)), _NUMBERS, np.float64)
        return self._stacked(values, q.shape[:-1])[..., 0, :, :]

    def on(self, low: Doubles, high: Doubles) -> tuple[Doubles, Doubles]:
        """Of S on boxes [rad]: its middle, and how far each coordinate takes its entries from it.

        Args:
            low: lower ends, shape (..., number of coordinates).
            high: upper ends, same shape.

        Returns:
            Shapes (..., n, n) and (..., number of coordinates, n, n).
        """
        middle, shape = self.at(0.5 * (low + high)), low.shape[:-1]
        inputs = [_Span(low[..., i], high[..., i]) for i in range(low.shape[-1])]
        slopes = walk(self._slopes, inputs, _SPANS, lambda x: _Span(np.asarray(x), np.asarray(x)))
        steepest = self._stacked([np.maximum(-s.low, s.high) for s in slopes], shape)
        return middle, 0.5 * (high - low)[..., np.newaxis, np.newaxis] * steepest

    def _stacked(self, values: Sequence[Any], shape: tuple[int, ...]) -> Doubles:
        """Entries of matrices one after the other, shape (..., how many matrices, n, n)."""
        together = np.zeros((*shape, len(values)))
        for k, value in enumerate(values):
            together[..., k] = value
        return together.reshape(*shape, -1, self._n, self._n)


@dataclass(frozen=True)
class Sampled:
    """The range of the eigenvalues of M^-1 Mbar over the postures that were tried.

    Attributes:
        low: least.
        high: largest.
    """

    low: float
    high: float


def sample(inertia: Inertia, low: Doubles, high: Doubles) -> Sampled:
    """Tries postures in a box [rad], and then more and more closely around the best.

    Args:
        inertia: of the robot.
        low: lower ends of the coordinates.
        high: upper ends.
    """
    random = np.random.default_rng(0)
    found = []
    for which, sign in ((0, 1.0), (-1, -1.0)):
        best, least = 0.5 * (low + high), math.inf
        reach = 0.5 * (high - low)
        for _ in range(_ROUNDS):
            around = np.clip(best, low + reach, high - reach)
            q = around + reach * random.uniform(-1.0, 1.0, (_SAMPLES // _ROUNDS, len(low)))
            values = sign * np.linalg.eigvalsh(inertia.at(q))[:, which]
            if values.min() < least:
                best, least = q[values.argmin()], float(values.min())
            reach = reach * _NARROWER
        found.append(sign * least)
    smallest, largest = found
    return Sampled(low=1.0 / largest, high=1.0 / smallest)


def boxes(inertia: Inertia, low: Doubles, high: Doubles, r: float, sign: int) -> list[Cell] | None:
    """Boxes that fill the ranges, on each of which sign (r S - 1) seems to be positive definite.

    Args:
        inertia: of the robot.
        low: lower ends of the coordinates [rad].
        high: upper ends.
        r: a bound of the eigenvalues of M^-1 Mbar.
        sign: 1 for a bound above them, -1 for one below.

    Returns:
        None if there would be too many.
    """
    count = len(low)
    k, p = np.zeros((1, count), dtype=np.int64), np.zeros((1, count), dtype=np.int64)
    done: list[Cell] = []
    while len(k):
        if len(done) + len(k) > MAX_BOXES:
            return None
        width = (high - low) / 2.0**p
        start = low + k * width
        middle, reach = inertia.on(start, start + width)
        changes = _SLACK * r * reach.sum(axis=-3)
        definite = _definite(sign * (r * middle - np.eye(middle.shape[-1])), changes)
        done += [
            tuple(zip(a, b, strict=True))
            for a, b in zip(k[definite].tolist(), p[definite].tolist(), strict=True)
        ]
        if not count and not definite.all():
            return None
        k, p, reach = k[~definite], p[~definite], reach[~definite]
        if count:
            # The coordinate by which the box's matrix changes most.
            split = np.einsum("bcij->bc", reach).argmax(axis=1)[:, np.newaxis] == np.arange(count)
            p = np.concatenate([p + split] * 2)
            k = np.concatenate([np.where(split, 2 * k, k), np.where(split, 2 * k + 1, k)])
    return done


def _definite(middle: Doubles, reach: Doubles) -> NDArray[np.bool_]:
    """Whether all pivots of Gauss's elimination are positive, whatever the entries in reach are."""
    n = middle.shape[-1]
    entry = {
        (i, j): _Span(middle[:, i, j] - reach[:, i, j], middle[:, i, j] + reach[:, i, j])
        for i, j in itertools.product(range(n), repeat=2)
        if j <= i
    }
    positive = np.ones(len(middle), dtype=np.bool_)
    for k in range(n):
        pivot = entry[k, k]
        positive &= pivot.low > 0.0
        # Of a box that is lost only numbers matter that do not overflow.
        pivot = _Span(*(np.where(positive, end, 1.0) for end in (pivot.low, pivot.high)))
        inverse = _Span(1.0 / pivot.high, 1.0 / pivot.low)
        for i in range(k + 1, n):
            for j in range(k + 1, i + 1):
                both = _square(entry[i, k]) if i == j else _times(entry[i, k], entry[j, k])
                entry[i, j] = _SPANS[ca.OP_SUB](entry[i, j], _times(both, inverse))
    return positive
