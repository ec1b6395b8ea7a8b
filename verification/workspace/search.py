"""Looks for the range of the eigenvalues of M(q)^-1 Mbar, and for boxes on which it can be proved.

All in doubles without bounds of their rounding: nothing here is a proof, and a mistake here can
only make the checker refuse. M(q) is a CasADi expression, the composite-rigid-body algorithm of
:mod:`plant.compiled.rigid_body`, walked over arrays of numbers.

With the symmetric S = Mbar^-1/2 M Mbar^-1/2 the eigenvalues of M^-1 Mbar are those of S^-1, and all
of them are below r where r S - 1 is positive definite, above r where 1 - r S is. In each angle S is
a trigonometric polynomial of degree 2. On a box it is replaced by a parabola in each coordinate,
whose values are convex combinations of a few control matrices (its Bernstein form); how far that is
off, at most, comes from the Fourier coefficients of S. :mod:`verification.workspace.check` proves
the method.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from plant.compiled.rigid_body import Mass, inertia_matrix, joints, mass_numbers, tree
from verification.law_graph import walk

Doubles = NDArray[np.float64]
Whole = NDArray[np.int64]
Flags = NDArray[np.bool_]
Cell = tuple[tuple[int, int], ...]
"""Of each coordinate (k, p): the part from k/2^p to (k+1)/2^p of its range."""

_FREQUENCIES = 3
"""In each angle: 0, 1, 2."""
_POINTS = 2 * _FREQUENCIES - 1
"""So many samples of a circle determine S."""
_CONTROL = np.array([[1.0, 0.0, 0.0], [-0.5, 2.0, -0.5], [0.0, 0.0, 1.0]])
"""From a parabola's values at the ends and in the middle to its control points."""
_SLACK = 1.0 + 2.0**-16
"""By how much the error may be larger than it is: the checker's numbers are rounded otherwise."""
_AT_ONCE = 1 << 20
"""Numbers in a contraction's intermediate results, so that they stay in the cache."""
_SAMPLES, _STARTS = 8000, 12
_ROUNDS, _AROUND, _NARROWER = 40, 30, 0.75
"""Around the best samples better ones are looked for, each time in a smaller range."""

_OPERATIONS: dict[int, Callable[..., Doubles]] = {
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
    """S(q) of a robot, over arrays of joint positions, and its Fourier coefficients."""

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
        self.coordinates = len(moving)
        self.joints = len(chain)
        self._values = ca.Function("S", moving, ca.vertsplit(ca.vec(S)))

    def at(self, q: Doubles) -> Doubles:
        """S, shape (..., n, n), at coordinates q [rad], shape (..., number of coordinates)."""
        values = walk(self._values, list(np.moveaxis(q, -1, 0)), _OPERATIONS, np.float64)
        together = np.empty((*q.shape[:-1], len(values)))
        for k, value in enumerate(values):
            together[..., k] = value
        return together.reshape(*q.shape[:-1], self.joints, self.joints)

    @functools.cached_property
    def fourier(self) -> Fourier:
        """S as a trigonometric polynomial."""
        x = np.arange(_POINTS) * 2.0 * math.pi / _POINTS
        grid = np.stack(np.meshgrid(*[x] * self.coordinates, indexing="ij"), axis=-1)
        rows, columns = np.tril_indices(self.joints)
        S = self.at(grid.reshape(*[_POINTS] * self.coordinates, self.coordinates))
        return Fourier.of_samples(S[..., rows, columns], _basis(x))


@dataclass(frozen=True)
class Fourier:
    """Entries of matrices, lower triangles row by row, as trigonometric polynomials.

    Attributes:
        waves: coefficients at products of 1, cos x, sin x, cos 2x, sin 2x, shape (5, 5, ..., e).
        sizes: magnitudes of the complex coefficients, those of opposite frequencies added, shape
            (3, 3, ..., e).
    """

    waves: Doubles
    sizes: Doubles

    @classmethod
    def of_samples(cls, samples: Doubles, basis: Doubles) -> Fourier:
        """From values at five points of each circle, shape (5, 5, ..., e)."""
        waves = _along_each(np.linalg.inv(basis), samples)
        # Of a cos x + b sin x: a/2 - ib/2 at frequency 1, a/2 + ib/2 at -1.
        turned = np.eye(_POINTS, dtype=np.complex128)
        for f in range(1, _POINTS, 2):
            turned[f : f + 2, f : f + 2] = [[0.5, -0.5j], [0.5, 0.5j]]
        opposite = np.kron(np.eye(_FREQUENCIES), np.ones(2))[:, 1:]
        return cls(waves, _along_each(opposite, np.abs(_along_each(turned, waves))))


def _along_each(matrix: NDArray[Any], tensor: NDArray[Any]) -> NDArray[Any]:
    """A matrix applied along each axis but the last."""
    for axis in range(tensor.ndim - 1):
        tensor = np.moveaxis(np.tensordot(matrix, tensor, (1, axis)), 0, axis)
    return tensor


def _basis(x: Doubles) -> Doubles:
    """1, cos x, sin x, cos 2x, sin 2x, shape (..., 5)."""
    waves = [np.ones_like(x)]
    for f in range(1, _FREQUENCIES):
        waves += [np.cos(f * x), np.sin(f * x)]
    return np.stack(waves, axis=-1)


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
        q = low + (high - low) * random.uniform(0.0, 1.0, (_SAMPLES, len(low)))
        value = sign * np.linalg.eigvalsh(inertia.at(q))[:, which]
        start = np.argsort(value)[:_STARTS]
        best, least, reach = q[start], value[start], 0.25 * (high - low)
        for _ in range(_ROUNDS):
            step = reach * random.uniform(-1.0, 1.0, (_AROUND, *best.shape))
            q = np.clip(best + step, low, high)
            value = sign * np.linalg.eigvalsh(inertia.at(q))[..., which]
            winner = value.argmin(axis=0), np.arange(len(best))
            better = value[winner] < least
            best, least = (
                np.where(better[:, np.newaxis], q[winner], best),
                np.minimum(value[winner], least),
            )
            reach = reach * _NARROWER
        found.append(sign * float(least.min()))
    smallest, largest = found
    return Sampled(low=1.0 / largest, high=1.0 / smallest)


class Refinement:
    """Boxes that fill the ranges, and are halved where a bound of the eigenvalues needs it."""

    def __init__(self, inertia: Inertia, low: Doubles, high: Doubles, sign: int) -> None:
        """Begins with one box, which is all of the ranges.

        Args:
            inertia: of the robot.
            low: lower ends of the coordinates [rad].
            high: upper ends.
            sign: 1 for bounds above the eigenvalues of M^-1 Mbar, -1 for those below.
        """
        self._inertia, self._low, self._range, self._sign = inertia, low, high - low, sign
        self._k = np.zeros((1, len(low)), dtype=np.int64)
        self._p = np.zeros((1, len(low)), dtype=np.int64)

    @property
    def coordinates(self) -> int:
        """How many there are."""
        return len(self._low)

    @property
    def cells(self) -> list[Cell]:
        """The boxes of the last bound that was reached."""
        both = zip(self._k.tolist(), self._p.tolist(), strict=True)
        return [tuple(zip(k, p, strict=True)) for k, p in both]

    def reach(self, r: float, budget: int) -> int | None:
        """Halves boxes until sign (r S - 1) seems to be positive definite on all of them.

        Args:
            r: a bound of the eigenvalues of M^-1 Mbar.
            budget: of control matrices.

        Returns:
            How many control matrices it took. None if a box fails at its centre or the budget is
            spent; then the boxes are as before.
        """
        spent, k, p, done = 0, self._k, self._p, []
        while len(k):
            halves = []
            for some in _alike(p > 0):
                spent += len(some) * 3 ** int((p[some[0]] > 0).sum())
                tested = self._tested(k[some], p[some], r) if spent <= budget else None
                if tested is None:
                    return None
                definite, split = tested
                done.append((k[some[definite]], p[some[definite]]))
                k_open, p_open = k[some[~definite]], p[some[~definite]]
                halves += [(k_open + split * (k_open + i), p_open + split) for i in (0, 1)]
            k, p = (np.concatenate([half[i] for half in halves]) for i in (0, 1))
        self._k, self._p = (np.concatenate([boxes[i] for boxes in done]) for i in (0, 1))
        return spent

    def _tested(self, k: Whole, p: Whole, r: float) -> tuple[Flags, Whole] | None:
        """Which boxes pass, and by which coordinate to halve each that doesn't.

        All boxes were halved in the same coordinates. None if one fails at its centre.
        """
        inertia, n, halved = self._inertia, self._inertia.joints, p[0] > 0
        fourier = inertia.fourier
        half = 0.5 * self._range / 2.0**p
        center = self._low + (2 * k + 1) * half
        A = self._sign * (r * inertia.at(center) - np.eye(n))
        try:
            np.linalg.cholesky(A)
        except np.linalg.LinAlgError:
            return None
        inverse = np.linalg.inv(A)
        # Errors weigh by what is left of A in each joint.
        w = np.sqrt(np.einsum("baa->ba", inverse))

        off = _replacement_error(half, halved)
        error = _contracted(fourier.sizes, [1.0 + x[:, np.newaxis] for x in off])[:, 0]
        error = r * _SLACK * (error - fourier.sizes.sum(axis=tuple(range(len(halved)))))
        loss = np.einsum("bij,bj->bi", _full(error, n), w) / w
        control = _contracted(fourier.waves, _control_waves(center, half, halved))
        S = self._sign * r * control
        S[..., _diagonal(n)] -= self._sign + loss[:, np.newaxis]
        passed: Flags = np.all(_definite(S, n), axis=1)

        if not len(halved):
            return (passed, p) if passed.all() else None
        # What costs most in the direction that is nearest to failing: errors and parabolas.
        bad = ~passed
        S, w, inverse = S[bad], w[bad], inverse[bad]
        cost = np.empty((len(S), len(halved)))
        grid = S.reshape(len(S), *np.where(halved, 3, 1), S.shape[-1])
        for c in range(len(halved)):
            others = tuple(i for i in range(len(halved)) if i != c)
            alone = _full(off[c][bad] @ fourier.sizes.sum(axis=others), n)
            cost[:, c] = r * np.einsum("bij,bi,bj->b", alone, w, w)
            if halved[c]:
                first, middle, last = np.moveaxis(grid, c + 1, 0)
                bulge = (0.25 * (first + last) - 0.5 * middle).mean(
                    axis=tuple(range(1, len(halved)))
                )
                cost[:, c] += np.abs(np.einsum("bij,bij->b", _full(bulge, n), inverse))
        return passed, np.eye(len(halved), dtype=np.int64)[cost.argmax(axis=1)]


def _replacement_error(half: Doubles, halved: Flags) -> list[Doubles]:
    """How far a wave e^(ikx) is off, on boxes of such half widths, by coordinate.

    Each of shape (boxes, 3), for k = 0, 1, 2.
    """
    t = half[..., np.newaxis] * np.arange(_FREQUENCIES)
    parabola = np.minimum(t**3 / (9.0 * math.sqrt(3.0)), 2.25)
    return [parabola[:, c] if halved[c] else np.minimum(t[:, c], 2.0) for c in range(len(halved))]


def _control_waves(center: Doubles, half: Doubles, halved: Flags) -> list[Doubles]:
    """Control values of the five waves, by coordinate, each of shape (boxes, 3 or 1, 5)."""
    nodes = center[..., np.newaxis] + half[..., np.newaxis] * [-1.0, 0.0, 1.0]
    return [
        _CONTROL @ _basis(nodes[:, c]) if halved[c] else _basis(nodes[:, c, 1:2])
        for c in range(len(halved))
    ]


def _alike(rows: Flags) -> Iterator[Whole]:
    """Indices of equal rows, a few at a time."""
    kinds: dict[bytes, list[int]] = {}
    for i, row in enumerate(rows):
        kinds.setdefault(row.tobytes(), []).append(i)
    for same in kinds.values():
        step = max(1, _AT_ONCE // _largest(rows[same[0]]))
        yield from (np.array(same[i : i + step]) for i in range(0, len(same), step))


def _largest(halved: Flags) -> int:
    """How many numbers of an entry :func:`_contracted` has at once, for one box."""
    rest = len(halved) - np.arange(len(halved) + 1)
    done = np.concatenate([[0], np.cumsum(halved)])
    return int((3**done * _POINTS**rest).max())


def _contracted(tensor: Doubles, factors: Sequence[Doubles]) -> Doubles:
    """Sums over all axes of a tensor but the last.

    Args:
        tensor: shape (f, g, ..., e).
        factors: one for each summed axis, shapes (boxes, points, f), (boxes, points, g), ...

    Returns:
        Shape (boxes, points of all axes, e).
    """
    e = tensor.shape[-1]
    total = tensor.reshape(1, 1, -1)
    for factor in factors:
        size, _, f = factor.shape
        total = factor[:, np.newaxis] @ total.reshape(len(total), total.shape[1], f, -1)
        total = total.reshape(size, -1, total.shape[-1])
    return total.reshape(len(total), -1, e)


def _full(packed: Doubles, n: int) -> Doubles:
    """Symmetric matrices of their lower triangles."""
    full = np.empty((*packed.shape[:-1], n, n))
    rows, columns = np.tril_indices(n)
    full[..., rows, columns] = full[..., columns, rows] = packed
    return full


def _diagonal(n: int) -> Whole:
    """Where it is in a lower triangle."""
    rows, columns = np.tril_indices(n)
    return np.flatnonzero(rows == columns)


def _definite(packed: Doubles, n: int) -> Flags:
    """Whether all pivots of Gauss's elimination are positive."""
    entries = np.ascontiguousarray(np.moveaxis(packed, -1, 0))
    rows = [entries[i * (i + 1) // 2 : (i + 1) * (i + 2) // 2] for i in range(n)]
    positive = np.ones(packed.shape[:-1], dtype=np.bool_)
    for k in range(n):
        positive &= rows[k][k] > 0.0
        # Of what is lost only numbers matter that do not overflow.
        pivot = np.where(positive, rows[k][k], 1.0)
        for i in range(k + 1, n):
            factor = rows[i][k] / pivot
            for j in range(k + 1, i + 1):
                rows[i][j] -= factor * rows[j][k]
    return positive
