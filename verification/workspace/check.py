"""Verifies a certificate of the eigenvalues of M(q)^-1 Mbar over a workspace.

This is the proof; what made the certificate only had to guess well. No code and no formula is
shared with it: M(q) is twice the kinetic energy of the links as a quadratic form,

    M_ij = sum over links k of  m_k u_ki . u_kj + w_ki . I_k w_kj,    u_ki = v_ki + w_ki x c_k,

with v_ki and w_ki the velocity of link k's frame and its spin, in that frame, for a unit speed of
joint i, and c_k and I_k centre of mass and inertia about it; the rotors' inertia is added on the
diagonal. The frames are that of the joints and w, v pass from each link to the next. The position
of a joint on the base is in none of this. Other joint positions are in turns, so that the whole
circle is a rational interval.

On a box with centre c and half widths h, S = r M - Mbar or Mbar - r M is enclosed by the mean value
form S(c) + sum_j dS/dq_j(box) [-h_j, h_j], in intervals of doubles that are rounded outwards after
each operation (sums and products of IEEE 754 are correctly rounded); sines and cosines come from
mpmath.iv. W S W^T is taken with any W, here about the inverse Cholesky factor of S(c): if it is
strictly diagonally dominant with a positive diagonal, S is positive definite (Gershgorin).
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

_HALVINGS = 3
"""So often is a box that stays open halved in all coordinates before it counts as refused."""
_DEEPEST = 40
_AT_ONCE = 4096


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
        yield "not positive definite at the centre of a box"
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        yield f"not a certificate: {type(error).__name__} {error}"


def _complaints(certificate: Mapping[str, Any]) -> Iterator[str]:
    _keys(certificate, "robot", "inertia_kgm2", "range_turns", "low", "high")
    links = [_link(row, k) for k, row in enumerate(certificate["robot"])]
    Mbar = [_number(x) for x in certificate["inertia_kgm2"]]
    ranges = [_range(pair) for pair in certificate["range_turns"]]
    if not links or len(Mbar) != len(links) or min(Mbar) <= 0:
        raise ValueError("Mbar has one number > 0 for each joint")
    if len(ranges) != sum(link.parent >= 0 for link in links):
        raise ValueError("each joint that is not on the base has a range")
    for side, sign in (("high", 1), ("low", -1)):
        claim = certificate[side]
        _keys(claim, "r", "boxes")
        r, boxes = _number(claim["r"]), [_cell(box, len(ranges)) for box in claim["boxes"]]
        if r <= 0:
            yield f"{side}: r = {r} is no eigenvalue of M^-1 Mbar"
        elif not _covers(boxes, ((0, 0),) * len(ranges)):
            yield f"{side}: the boxes do not cover the workspace"
        elif not _all_definite(links, Mbar, ranges, boxes, r, sign):
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


# --- Intervals, and functions of the joint positions on boxes ----------------------------------


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

    def magnitude(self) -> Doubles:
        largest: Doubles = np.maximum(np.abs(self.low), np.abs(self.high))
        return largest


def _outward(low: Doubles, high: Doubles) -> _Interval:
    return _Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def _exactly(values: Any) -> _Interval:
    return _Interval(np.asarray(values, dtype=np.float64), np.asarray(values, dtype=np.float64))


def _of_rational(number: Fraction) -> _Interval:
    nearest = float(number)
    here = _exactly(nearest)
    return here if Fraction(nearest) == number else _outward(here.low, here.high)


@dataclass(frozen=True)
class _Function:
    """A function on boxes: its values at the centres, and on the boxes those and its slopes."""

    center: _Interval
    box: _Interval
    slopes: Mapping[int, _Interval]

    def __add__(self, other: _Function) -> _Function:
        slopes = {**self.slopes}
        for j, slope in other.slopes.items():
            slopes[j] = slopes[j] + slope if j in slopes else slope
        return _Function(self.center + other.center, self.box + other.box, slopes)

    def __neg__(self) -> _Function:
        return _Function(-self.center, -self.box, {j: -s for j, s in self.slopes.items()})

    def __mul__(self, other: _Function) -> _Function:
        slopes = {j: s * other.box for j, s in self.slopes.items()}
        for j, slope in other.slopes.items():
            part = self.box * slope
            slopes[j] = slopes[j] + part if j in slopes else part
        return _Function(self.center * other.center, self.box * other.box, slopes)


_Value = _Function | None
"""None is 0, exactly."""
_Values = list[_Value]


def _constant(number: Fraction) -> _Value:
    if number == 0:
        return None
    value = _of_rational(number)
    return _Function(value, value, {})


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
    links: Sequence[_Link], turns: Mapping[int, tuple[_Function, _Function]]
) -> list[_Values]:
    """M on boxes; ``turns`` has cosine and sine of the joints that are coordinates."""
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


def _turn(axis: Sequence[Fraction], cosine: _Function, sine: _Function) -> list[_Values]:
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


def _cosine_and_sine(
    lows: Sequence[Fraction], highs: Sequence[Fraction], coordinate: int
) -> tuple[_Function, _Function]:
    """As functions of the joint position in radians, on intervals given in turns."""
    centers = [(a + b) / 2 for a, b in zip(lows, highs, strict=True)]
    cosine, sine = _trigonometric(centers, centers)
    wide_cosine, wide_sine = _trigonometric(lows, highs)
    return (
        _Function(cosine, wide_cosine, {coordinate: -wide_sine}),
        _Function(sine, wide_sine, {coordinate: wide_cosine}),
    )


def _trigonometric(
    lows: Sequence[Fraction], highs: Sequence[Fraction]
) -> tuple[_Interval, _Interval]:
    pairs = [_trigonometric_of(a, b) for a, b in zip(lows, highs, strict=True)]
    cosines, sines = (np.array([pair[i] for pair in pairs]).T for i in (0, 1))
    return _outward(cosines[0], cosines[1]), _outward(sines[0], sines[1])


@functools.lru_cache(maxsize=1 << 16)
def _trigonometric_of(
    low: Fraction, high: Fraction
) -> tuple[tuple[float, float], tuple[float, float]]:
    ends = (iv.mpf(x.numerator) / x.denominator for x in (low, high))
    first, last = ends
    angle = 2 * iv.pi * iv.mpf([first.a, last.b])
    cosine, sine = iv.cos(angle), iv.sin(angle)
    return (float(cosine.a), float(cosine.b)), (float(sine.a), float(sine.b))


# --- Positive definiteness on boxes ------------------------------------------------------------


def _all_definite(
    links: Sequence[_Link],
    Mbar: Sequence[Fraction],
    ranges: Sequence[tuple[Fraction, Fraction]],
    boxes: Sequence[Cell],
    r: Fraction,
    sign: int,
) -> bool:
    """Whether sign (r M - Mbar) is positive definite on all boxes."""
    waiting = [*boxes]
    for _ in range(_HALVINGS + 1):
        still = []
        for first in range(0, len(waiting), _AT_ONCE):
            some = waiting[first : first + _AT_ONCE]
            definite = _definite(links, Mbar, ranges, some, r, sign)
            still += [box for box, is_so in zip(some, definite, strict=True) if not is_so]
        if not still:
            return True
        if not ranges or len(still) > len(boxes):
            return False
        waiting = [half for box in still for half in _halves(box)]
    return False


def _halves(box: Cell) -> list[Cell]:
    parts: list[Cell] = [()]
    for k, p in box:
        parts = [(*part, (half, p + 1)) for part in parts for half in (2 * k, 2 * k + 1)]
    return parts


def _definite(
    links: Sequence[_Link],
    Mbar: Sequence[Fraction],
    ranges: Sequence[tuple[Fraction, Fraction]],
    boxes: Sequence[Cell],
    r: Fraction,
    sign: int,
) -> NDArray[np.bool_]:
    moving = [k for k, link in enumerate(links) if link.parent >= 0]
    turns, halves = {}, {}
    for c, (joint, (low, high)) in enumerate(zip(moving, ranges, strict=True)):
        lows = [low + (high - low) * Fraction(box[c][0], 2 ** box[c][1]) for box in boxes]
        highs = [low + (high - low) * Fraction(box[c][0] + 1, 2 ** box[c][1]) for box in boxes]
        turns[joint] = _cosine_and_sine(lows, highs, c)
        # Half the width in radians is pi times the width in turns, and 355/113 is above pi.
        halves[c] = np.nextafter(
            [float((b - a) * Fraction(355, 113)) for a, b in zip(lows, highs, strict=True)], np.inf
        )
    n, size = len(links), len(boxes)
    M = _inertia_matrix(links, turns)
    scale = _constant(sign * r)
    centers = _Interval(np.zeros((size, n, n)), np.zeros((size, n, n)))
    slopes = {c: _Interval(np.zeros((size, n, n)), np.zeros((size, n, n))) for c in halves}
    for i in range(n):
        for j in range(i + 1):
            fixed = _constant(-sign * Mbar[i]) if i == j else None
            entry = _sum([_product(scale, M[i][j]), fixed])
            if entry is None:
                continue
            for a, b in ((i, j), (j, i)):
                centers.low[:, a, b], centers.high[:, a, b] = entry.center.low, entry.center.high
                for c, slope in entry.slopes.items():
                    slopes[c].low[:, a, b], slopes[c].high[:, a, b] = slope.low, slope.high
    middle = 0.5 * (centers.low + centers.high)
    W = np.linalg.inv(np.linalg.cholesky(middle))
    total = _congruent(W, centers)
    for c, half in halves.items():
        reach = _congruent(W, slopes[c]).magnitude() * half[:, np.newaxis, np.newaxis]
        reach = np.nextafter(reach, np.inf)
        total = total + _Interval(-reach, reach)
    diagonal = np.einsum("bii->bi", total.low)
    beside = _exactly(np.zeros((size, n)))
    for j in range(n):
        column = np.where(np.arange(n) == j, 0.0, total.magnitude()[:, :, j])
        beside = beside + _exactly(column)
    # Written so that a NaN is no proof.
    dominant: NDArray[np.bool_] = np.all(diagonal > beside.high, axis=1)
    return dominant


def _congruent(W: Doubles, S: _Interval) -> _Interval:
    """W S W^T."""
    return _times(_times(_exactly(W), S), _exactly(np.swapaxes(W, 1, 2)))


def _times(A: _Interval, B: _Interval) -> _Interval:
    n = A.low.shape[-1]
    terms = [
        _Interval(A.low[:, :, k, np.newaxis], A.high[:, :, k, np.newaxis])
        * _Interval(B.low[:, np.newaxis, k, :], B.high[:, np.newaxis, k, :])
        for k in range(n)
    ]
    return functools.reduce(lambda a, b: a + b, terms)


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
