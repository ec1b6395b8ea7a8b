"""Verifies a certificate of the eigenvalues of M(q)^-1 Mbar over a workspace.

This is the proof; what made the certificate only had to guess well. No code and no formula is
shared with it: M(q) is twice the kinetic energy of the links as a quadratic form,

    M_ij = sum over links k of  m_k u_ki . u_kj + w_ki . I_k w_kj,    u_ki = v_ki + w_ki x c_k,

with v_ki and w_ki the velocity of link k's frame and its spin, in that frame, for a unit speed of
joint i, and c_k and I_k centre of mass and inertia about it; the rotors' inertia is added on the
diagonal. The frames are that of the joints and w, v pass from each link to the next. The position
of a joint on the base is in none of this. Other joint positions are in turns, so that the whole
circle is a rational interval. u and w are linear in the sine and cosine of each angle, M(q) is
therefore a trigonometric polynomial of degree 2 in each, and its values at five points of each
circle determine it. They are enclosed in intervals of doubles that are rounded outwards after each
operation (sums and products of IEEE 754 are correctly rounded); sines and cosines come from
mpmath.iv.

On a box with half widths h_j every wave e^(i k.q) is the product of one for each coordinate, and
each factor is replaced by a parabola, through its values at both ends and in the middle of the box,
or by its value in the middle alone where the range was never halved. With t = |k_j| h_j that is
wrong by no more than

    t^3 / (9 sqrt 3)    (remainder of the interpolation)    and no more than 1 + 5/4, or
    t                                                       and no more than 2,

and a product whose factors are wrong by a_j is wrong by no more than prod (1 + a_j) - 1. Summed,
each times the magnitude of its Fourier coefficient, this bounds how far each entry of M is off: by
K_ab, say. Then M is off by no more than the diagonal matrix of (K w)_a / w_a, with any w > 0, in
the order of symmetric matrices: 2 |x_a x_b| <= x_a^2 w_b / w_a + x_b^2 w_a / w_b.

A parabola is a convex combination of its three control values (its Bernstein form), and so is a
product of them of all combinations of control values. Where r M - Mbar, or Mbar - r M, less that
diagonal matrix, is positive definite at all of them, it is at every q of the box.
"""

from __future__ import annotations

import functools
import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from mpmath import iv
from numpy.typing import NDArray

Doubles = NDArray[np.float64]
Cell = tuple[tuple[int, int], ...]
"""Of each coordinate (k, p): the part from k/2^p to (k+1)/2^p of its range."""

_DEEPEST = 40
_MOST_COORDINATES = 6
_MOST_JOINTS = 16
_FREQUENCIES = 3
"""In each angle: 0, 1, 2."""
_POINTS = 5
"""So many values on a circle determine M."""
_ROUNDING = 2.0**-28
"""More than all rounding of sums of waves, relative to the sum of the coefficients' magnitudes.

A coefficient is a sum of 5 products for each of at most 6 coordinates, and so is a control value.
In each coordinate the weights of a coefficient add up to less than 1.3, those of the two waves of a
frequency in a control value to no more than 2 * 3. All 5^6 coefficients are wrong by less than
2^-53 * 100 * (5 * 1.3)^6 in sum, and a control value by less than 2^-53 * 100 * 6^6.
"""
_TAKEN_OFF = 2.0**-40
"""Of a diagonal, relative: more than the rounding of Cholesky's factorization."""
_AT_ONCE = 1 << 20
"""Numbers in the largest array of a test."""


def complaints(certificate: Mapping[str, Any]) -> Iterator[str]:
    """Everything that is wrong with a certificate, one sentence each; none if it is verified.

    Verified means: at every q whose coordinates are in the ranges, every eigenvalue of M(q)^-1 Mbar
    is above ``low`` and below ``high``, M(q) being that of the certificate's numbers.

    Args:
        certificate: as JSON has it.
    """
    try:
        yield from _complaints(certificate)
    except np.linalg.LinAlgError:
        yield "singular at the centre of a box"
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        yield f"not a certificate: {type(error).__name__} {error}"


def _complaints(certificate: Mapping[str, Any]) -> Iterator[str]:
    _keys(certificate, "robot", "inertia_kgm2", "range_turns", "low", "high")
    links = [_link(row, k) for k, row in enumerate(certificate["robot"])]
    Mbar = [_number(x) for x in certificate["inertia_kgm2"]]
    ranges = [_range(pair) for pair in certificate["range_turns"]]
    if not 0 < len(links) <= _MOST_JOINTS or len(Mbar) != len(links) or min(Mbar) <= 0:
        raise ValueError("Mbar has one number > 0 for each joint")
    if len(ranges) != sum(link.parent >= 0 for link in links):
        raise ValueError("each joint that is not on the base has a range")
    if len(ranges) > _MOST_COORDINATES:
        raise ValueError(f"more than {_MOST_COORDINATES} joint positions")
    inertia = _waves(links, len(ranges))
    for side, sign in (("high", 1), ("low", -1)):
        claim = certificate[side]
        _keys(claim, "r", "boxes")
        r, boxes = _number(claim["r"]), [_cell(box, len(ranges)) for box in claim["boxes"]]
        if r <= 0:
            yield f"{side}: r = {r} is no eigenvalue of M^-1 Mbar"
        elif not boxes and sign > 0 and _rotors_suffice(links, Mbar, r):
            continue
        elif not _covers(boxes, ((0, 0),) * len(ranges)):
            yield f"{side}: the boxes do not cover the workspace"
        elif not _all_definite(inertia, Mbar, ranges, boxes, r, sign):
            yield f"{side}: not shown that no eigenvalue is beyond r = {float(r)}"


# --- What a certificate says -------------------------------------------------------------------


@dataclass(frozen=True)
class _Link:
    parent: int
    rotation: list[list[Fraction]]
    offset: list[Fraction]
    axis: list[Fraction]
    mass: Fraction
    center: list[Fraction]
    inertia: list[list[Fraction]]
    armature: Fraction


def _keys(table: Mapping[str, Any], *names: str) -> None:
    if set(table) != set(names):
        raise ValueError(f"entries {sorted(table)}, not {sorted(names)}")


def _number(text: object) -> Fraction:
    # Fraction would also take exponents, and 1e999999999 fills the memory.
    if not isinstance(text, str) or re.fullmatch(r"-?[0-9]{1,400}(/[0-9]{1,400})?", text) is None:
        raise TypeError(f"{text!r} is no text of a rational number")
    if text.partition("/")[2].strip("0") == "" and "/" in text:
        raise ValueError(f"{text!r} divides by 0")
    return Fraction(text)


def _whole(value: object) -> int:
    if type(value) is not int:
        raise TypeError(f"{value!r} is no whole number")
    return value


def _vector(row: Sequence[object]) -> list[Fraction]:
    if len(row) != 3:
        raise ValueError(f"{row} has not three numbers")
    return [_number(x) for x in row]


def _matrix(rows: Sequence[Sequence[object]]) -> list[list[Fraction]]:
    if len(rows) != 3:
        raise ValueError(f"{rows} has not three rows")
    return [_vector(row) for row in rows]


def _link(row: Mapping[str, Any], index: int) -> _Link:
    _keys(
        row,
        *("parent", "rotation", "offset_m", "axis"),
        *("mass_kg", "center_of_mass_m", "inertia_kgm2", "armature_kgm2"),
    )
    link = _Link(
        _whole(row["parent"]),
        _matrix(row["rotation"]),
        _vector(row["offset_m"]),
        _vector(row["axis"]),
        _number(row["mass_kg"]),
        _vector(row["center_of_mass_m"]),
        _matrix(row["inertia_kgm2"]),
        _number(row["armature_kgm2"]),
    )
    if not -1 <= link.parent < index:
        raise ValueError(f"the parent of joint {index + 1} does not come before it")
    if any(link.inertia[i][j] != link.inertia[j][i] for i in range(3) for j in range(i)):
        raise ValueError(f"the inertia of link {index + 1} is not symmetric")
    # Rounded to doubles; what is far from a rotation is no robot's.
    rows = [*link.rotation, link.axis]
    for a, first in enumerate(rows):
        for b, second in enumerate(rows[: a + 1]):
            product = sum((x * y for x, y in zip(first, second, strict=True)), Fraction(0))
            if (a < 3 or b == 3) and abs(product - (a == b)) > Fraction(1, 10**12):
                raise ValueError(f"joint {index + 1} has no rotation or no unit axis")
    return link


def _range(pair: Sequence[object]) -> tuple[Fraction, Fraction]:
    low, high = (_number(x) for x in pair)
    if not -4 <= low < high <= 4:
        raise ValueError(f"no range of a joint: {pair}")
    return low, high


def _cell(box: Sequence[Sequence[object]], coordinates: int) -> Cell:
    cell = tuple((_whole(k), _whole(p)) for k, p in box)
    if len(cell) != coordinates or not all(0 <= p <= _DEEPEST and 0 <= k < 2**p for k, p in cell):
        raise ValueError(f"no box: {box}")
    return cell


def _covers(boxes: Sequence[Cell], cell: Cell) -> bool:
    """Whether boxes that all lie in a cell fill it; they come from halving it again and again."""
    waiting = [(list(boxes), cell)]
    while waiting:
        inside, whole = waiting.pop()
        if whole in inside:
            continue
        # A coordinate in which no box is as wide as the cell: the first that was halved.
        split = next(
            (j for j, (_, p) in enumerate(whole) if all(box[j][1] > p for box in inside)), None
        )
        if not inside or split is None:
            return False
        k, p = whole[split]
        for half in (2 * k, 2 * k + 1):
            part = [box for box in inside if box[split][0] >> (box[split][1] - p - 1) == half]
            waiting.append((part, (*whole[:split], (half, p + 1), *whole[split + 1 :])))
    return True


# --- Intervals ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Interval:
    low: Doubles
    high: Doubles

    def __add__(self, other: _Interval) -> _Interval:
        return _outward(self.low + other.low, self.high + other.high)

    def __neg__(self) -> _Interval:
        return _Interval(-self.high, -self.low)

    def __mul__(self, other: _Interval) -> _Interval:
        ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return _outward(np.minimum.reduce(ends), np.maximum.reduce(ends))

    def shaped(self, shape: Sequence[int]) -> _Interval:
        return _Interval(self.low.reshape(shape), self.high.reshape(shape))


def _outward(low: Doubles, high: Doubles) -> _Interval:
    return _Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def _exactly(values: Any) -> _Interval:
    return _Interval(np.asarray(values, dtype=np.float64), np.asarray(values, dtype=np.float64))


def _of_rational(number: Fraction) -> _Interval:
    nearest = float(number)
    here = _exactly(nearest)
    return here if Fraction(nearest) == number else _outward(here.low, here.high)


_Value = _Interval | None
"""None is 0, exactly."""
_Values = list[_Value]


def _constant(number: Fraction) -> _Value:
    if number == 0:
        return None
    return _of_rational(number)


def _constants(numbers: Sequence[Fraction]) -> _Values:
    return [_constant(x) for x in numbers]


def _sum(values: Sequence[_Value]) -> _Value:
    there = [v for v in values if v is not None]
    return functools.reduce(lambda a, b: a + b, there) if there else None


def _product(a: _Value, b: _Value) -> _Value:
    return None if a is None or b is None else a * b


def _minus(a: _Value) -> _Value:
    return None if a is None else -a


def _dot(a: _Values, b: _Values) -> _Value:
    return _sum([_product(x, y) for x, y in zip(a, b, strict=True)])


def _cross(a: _Values, b: _Values) -> _Values:
    return [
        _sum([_product(a[i], b[j]), _minus(_product(a[j], b[i]))])
        for i, j in ((1, 2), (2, 0), (0, 1))
    ]


def _applied(matrix: Sequence[_Values], vector: _Values) -> _Values:
    return [_dot(row, vector) for row in matrix]


def _plus(a: _Values, b: _Values) -> _Values:
    return [_sum([x, y]) for x, y in zip(a, b, strict=True)]


def _transposed(columns: Sequence[_Values]) -> list[_Values]:
    return [list(row) for row in zip(*columns, strict=True)]


# --- The inertia matrix ------------------------------------------------------------------------


def _inertia_matrix(
    links: Sequence[_Link], turns: Mapping[int, tuple[_Interval, _Interval]]
) -> list[_Values]:
    """M's lower triangle; ``turns`` has cosine and sine of the joints that are coordinates."""
    n = len(links)
    spins: list[dict[int, _Values]] = []
    speeds: list[dict[int, _Values]] = []
    M: list[_Values] = [[None] * n for _ in range(n)]
    for k, link in enumerate(links):
        spin: dict[int, _Values] = {k: _constants(link.axis)}
        speed: dict[int, _Values] = {k: [None] * 3}
        if link.parent >= 0:
            # The frame's axes in the parent's are the columns of rotation times turn.
            unplaced = _transposed([_constants(row) for row in link.rotation])
            unturned = _transposed(_turn(link.axis, *turns[k]))
            offset = _constants(link.offset)
            for i, w in spins[link.parent].items():
                v = _plus(speeds[link.parent][i], _cross(w, offset))
                spin[i] = _applied(unturned, _applied(unplaced, w))
                speed[i] = _applied(unturned, _applied(unplaced, v))
        spins.append(spin)
        speeds.append(speed)
        center, inertia = _constants(link.center), [_constants(row) for row in link.inertia]
        moved = {i: _plus(speed[i], _cross(w, center)) for i, w in spin.items()}
        for i, w in spin.items():
            momentum = _applied(inertia, w)
            for j in (j for j in spin if j <= i):
                linear = _product(_constant(link.mass), _dot(moved[i], moved[j]))
                M[i][j] = _sum([M[i][j], linear, _dot(spin[j], momentum)])
        M[k][k] = _sum([M[k][k], _constant(link.armature)])
    return M


def _turn(axis: Sequence[Fraction], cosine: _Interval, sine: _Interval) -> list[_Values]:
    """The rotation about an axis, by rows: e_j cos + (a x e_j) sin + a a_j (1 - cos)."""
    x, y, z = axis
    swept = [[Fraction(0), -z, y], [z, Fraction(0), -x], [-y, x, Fraction(0)]]
    rows: list[_Values] = []
    for i in range(3):
        row: _Values = []
        for j in range(3):
            along = axis[i] * axis[j]
            held = _product(_constant((i == j) - along), cosine)
            row.append(_sum([held, _product(_constant(swept[i][j]), sine), _constant(along)]))
        rows.append(row)
    return rows


def _cosine_and_sine(turns: Sequence[Fraction]) -> tuple[_Interval, _Interval]:
    """Of angles in turns."""
    pairs = np.array([_cosine_and_sine_of(x) for x in turns])
    return _Interval(*pairs[:, 0].T), _Interval(*pairs[:, 1].T)


@functools.lru_cache(maxsize=1 << 16)
def _cosine_and_sine_of(turns: Fraction) -> tuple[tuple[float, float], tuple[float, float]]:
    angle = 2 * iv.pi * iv.mpf(turns.numerator) / turns.denominator
    # mpmath's precision is that of doubles.
    cosine, sine = iv.cos(angle), iv.sin(angle)
    return (float(cosine.a), float(cosine.b)), (float(sine.a), float(sine.b))


# --- M as a sum of waves -----------------------------------------------------------------------


@dataclass(frozen=True)
class _Waves:
    """Entries of M's lower triangle, row by row, as trigonometric polynomials.

    Attributes:
        coefficients: at products of 1, cos x, sin x, cos 2x, sin 2x, shape (5, 5, ..., entries).
        sizes: sums of the magnitudes of the Fourier coefficients of e^(i k.q) over the signs of k,
            shape (3, 3, ..., entries).
        noise: by how much the entries may differ from all this, rounding included.
    """

    coefficients: Doubles
    sizes: Doubles
    noise: Doubles


def _waves(links: Sequence[_Link], coordinates: int) -> _Waves:
    circle = [Fraction(j, _POINTS) for j in range(_POINTS)]
    cosine, sine = _cosine_and_sine(circle)
    turns: dict[int, tuple[_Interval, _Interval]] = {}
    moving = [k for k, link in enumerate(links) if link.parent >= 0]
    for c, joint in enumerate(moving):
        shape = [_POINTS if i == c else 1 for i in range(coordinates)]
        turns[joint] = (cosine.shaped(shape), sine.shaped(shape))
    M = _inertia_matrix(links, turns)
    entries = [M[i][j] or _exactly(0.0) for i in range(len(links)) for j in range(i + 1)]
    grid = (_POINTS,) * coordinates
    low, high = (
        np.stack([np.broadcast_to(getattr(x, end), grid) for x in entries], axis=-1)
        for end in ("low", "high")
    )
    middle, axes = 0.5 * (low + high), tuple(range(coordinates))
    radius = np.max(np.maximum(high - middle, middle - low), axis=axes)

    # Sums over the points of a circle: at frequency f, the mean of M e^(-i f x).
    basis = _basis(circle)
    means = basis.T * np.array([[1.0], [2.0], [2.0], [2.0], [2.0]]) / _POINTS
    # To a cos x + b sin x belong a/2 - ib/2 at the positive frequency and a/2 + ib/2 at the other.
    turned = [means[0]]
    for f in (1, 3):
        turned += [0.5 * (means[f] - 1j * means[f + 1]), 0.5 * (means[f] + 1j * means[f + 1])]
    sizes = np.abs(_along_each(np.array(turned), middle))
    for axis in axes:
        sizes = np.add.reduceat(sizes, [0, 1, 3], axis=axis)
    sizes = sizes + _TAKEN_OFF * sizes.sum(axis=axes)  # more than they are rounded by
    # An error at the points is at most twice as large in each of the 5^d coefficients, by circle.
    noise = _ROUNDING * sizes.sum(axis=axes) + (2.0 * _POINTS) ** coordinates * radius
    return _Waves(_along_each(means, middle), sizes, noise)


def _basis(turns: Sequence[Fraction]) -> Doubles:
    """1, cos x, sin x, cos 2x, sin 2x of angles in turns, shape (angles, 5)."""
    columns = [np.ones(len(turns))]
    for f in range(1, _FREQUENCIES):
        columns += [x.low for x in _cosine_and_sine([f * x for x in turns])]
    return np.stack(columns, axis=-1)


def _along_each(matrix: NDArray[Any], tensor: NDArray[Any]) -> NDArray[Any]:
    """A matrix applied along each axis but the last."""
    for axis in range(tensor.ndim - 1):
        tensor = np.moveaxis(np.tensordot(matrix, tensor, (1, axis)), 0, axis)
    return tensor


def _at(tensor: Doubles, factors: Sequence[Doubles]) -> Doubles:
    """A tensor times one row of each factor, for all combinations of rows and each box.

    Args:
        tensor: shape (f_1, f_2, ..., entries).
        factors: shapes (boxes, rows, f_1), (boxes, rows, f_2), ...

    Returns:
        Shape (boxes, combinations, entries).
    """
    result = tensor.reshape(1, 1, -1)
    for factor in factors:
        boxes, _, waves = factor.shape
        parts = result.reshape(*result.shape[:2], waves, -1)
        result = np.matmul(factor[:, np.newaxis], parts).reshape(boxes, -1, parts.shape[-1])
    return result.reshape(len(result), -1, tensor.shape[-1])


# --- Positive definiteness on boxes ------------------------------------------------------------


def _rotors_suffice(links: Sequence[_Link], Mbar: Sequence[Fraction], r: Fraction) -> bool:
    """Whether r times the rotors' inertia alone is above Mbar: that of links only adds to it."""
    add = all(link.mass >= 0 and _not_negative(link.inertia) for link in links)
    return add and all(r * link.armature > x for link, x in zip(links, Mbar, strict=True))


def _not_negative(matrix: Sequence[Sequence[Fraction]]) -> bool:
    """Whether a symmetric matrix is positive semidefinite: no principal minor is negative."""
    (a, d, e), (_, b, f), (_, _, c) = matrix
    pairs = min(a * b - d * d, a * c - e * e, b * c - f * f)
    return min(a, b, c, pairs, a * b * c + 2 * d * e * f - a * f * f - b * e * e - c * d * d) >= 0


def _all_definite(
    inertia: _Waves,
    Mbar: Sequence[Fraction],
    ranges: Sequence[tuple[Fraction, Fraction]],
    boxes: Sequence[Cell],
    r: Fraction,
    sign: int,
) -> bool:
    """Whether sign (r M - Mbar) is positive definite on all boxes."""
    alike: dict[tuple[bool, ...], list[Cell]] = {}
    for box in boxes:
        alike.setdefault(tuple(p > 0 for _, p in box), []).append(box)
    for halved, group in alike.items():
        largest = max(3 ** sum(halved[:c]) * 5 ** (len(halved) - c) for c in range(len(halved) + 1))
        step = max(1, _AT_ONCE // (largest * len(inertia.noise)))
        for first in range(0, len(group), step):
            if not _definite(inertia, Mbar, ranges, group[first : first + step], r, sign).all():
                return False
    return True


def _definite(
    inertia: _Waves,
    Mbar: Sequence[Fraction],
    ranges: Sequence[tuple[Fraction, Fraction]],
    boxes: Sequence[Cell],
    r: Fraction,
    sign: int,
) -> NDArray[np.bool_]:
    """On each box; all are halved in the same coordinates."""
    n, scale = len(Mbar), float(r)
    sides = [_sides(pair, [box[c] for box in boxes]) for c, pair in enumerate(ranges)]
    centers, controls, grown = ([side[i] for side in sides] for i in range(3))
    diagonal = np.cumsum(np.arange(1, n + 1)) - 1
    shift = np.zeros(len(inertia.noise))
    shift[diagonal] = [float(x) for x in Mbar]

    off = _at(inertia.sizes, grown)[:, 0] - inertia.sizes.sum(axis=tuple(range(len(ranges))))
    off = scale * (off + inertia.noise) + _ROUNDING * shift
    center = _at(inertia.coefficients, centers)[:, 0]
    inverse = np.linalg.inv(_full(sign * (scale * center - shift), n))
    with np.errstate(invalid="ignore"):  # A NaN passes no test below.
        w = np.sqrt(np.einsum("baa->ba", inverse))
    loss = np.einsum("bij,bj->bi", _full(off, n), w) / w
    S = sign * (scale * _at(inertia.coefficients, controls) - shift)
    S[..., diagonal] -= (1.0 + _TAKEN_OFF) * loss[:, np.newaxis]
    definite: NDArray[np.bool_] = np.all(_factorizes(S, n), axis=1)
    return definite


def _sides(
    ends: tuple[Fraction, Fraction], parts: Sequence[tuple[int, int]]
) -> tuple[Doubles, Doubles, Doubles]:
    """Of boxes in one coordinate, all of them halved, or none.

    Returns:
        The five waves in the middle, shape (boxes, 1, 5), their control values, shape
        (boxes, 3 or 1, 5), and 1 + how far waves of frequency 0, 1, 2 are off, shape (boxes, 1, 3).
    """
    different = {part: i for i, part in enumerate(dict.fromkeys(parts))}
    place = [different[part] for part in parts]
    halved = parts[0][1] > 0
    width = [(ends[1] - ends[0]) / 2**p for _, p in different]
    first = [ends[0] + k * w for (k, _), w in zip(different, width, strict=True)]
    left, middle, right = (
        _basis([a + i * w / 2 for a, w in zip(first, width, strict=True)]) for i in range(3)
    )
    control = [left, 2.0 * middle - 0.5 * (left + right), right] if halved else [middle]
    # Half the width in radians is pi times the width in turns, and 355/113 is above pi.
    half = np.array([float(w * Fraction(355, 113)) for w in width])
    off = _wrong(half[:, np.newaxis] * np.arange(_FREQUENCIES), halved)
    return (
        middle[place, np.newaxis],
        np.stack(control, axis=1)[place],
        1.0 + off[place, np.newaxis],
    )


def _wrong(t: Doubles, parabola: bool) -> Doubles:
    """How far e^(i t x), |x| <= 1, may be from its parabola, or else from its value at 0."""
    # 9 sqrt 3 is above 15.5884.
    return np.minimum(t**3 / 15.5884, 2.25) if parabola else np.minimum(t, 2.0)


def _full(packed: Doubles, n: int) -> Doubles:
    """Symmetric matrices of their lower triangles."""
    rows, columns = np.tril_indices(n)
    full = np.empty((*packed.shape[:-1], n, n))
    full[..., rows, columns] = packed
    full[..., columns, rows] = packed
    return full


def _factorizes(packed: Doubles, n: int) -> NDArray[np.bool_]:
    """Whether symmetric matrices are proved to be positive definite.

    Cholesky's factorization in doubles that runs to its end is exact for a matrix that differs in
    each entry by no more than about (n + 1) 2^-53 sqrt(a_ii a_jj) (N. J. Higham, Accuracy and
    Stability of Numerical Algorithms, 2nd ed., SIAM 2002, theorem 10.3). That is less than what is
    taken off the diagonal before.
    """
    L = [
        [np.ascontiguousarray(packed[..., i * (i + 1) // 2 + j]) for j in range(i + 1)]
        for i in range(n)
    ]
    runs = np.ones(packed.shape[:-1], dtype=np.bool_)
    for i in range(n):
        L[i][i] = L[i][i] * (1.0 - _TAKEN_OFF)
    for j in range(n):
        for k in range(j):
            L[j][j] = L[j][j] - L[j][k] * L[j][k]
        runs = runs & (L[j][j] > 0.0)
        L[j][j] = np.sqrt(np.where(runs, L[j][j], 1.0))
        for i in range(j + 1, n):
            for k in range(j):
                L[i][j] = L[i][j] - L[i][k] * L[j][k]
            L[i][j] = L[i][j] / L[j][j]
    return runs


def main(arguments: Sequence[str]) -> int:
    """Checks the files that are named; returns 0, 1 where one is not verified, 2 for no file."""
    if not arguments:
        print("usage: python -m verification.workspace.check FILE...", file=sys.stderr)
        return 2
    worst = 0
    for name in arguments:
        try:
            found = list(complaints(json.loads(Path(name).read_text(encoding="utf-8"))))
        except (OSError, ValueError) as error:
            print(f"error: {name}: {error}: give a file of --certificate", file=sys.stderr)
            return 2
        print("\n".join([f"{name}: {'verified' if not found else 'NOT verified'}", *found]))
        worst = max(worst, 1 if found else 0)
    return worst


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
