"""sig(x)^a in binary32 to two units of the last place: the tables of the `precise` accuracy.

The method is that of :mod:`codegen.sig_pow`, ``y = x · 2^(b log2|x|)`` with ``b = a - 1``, and so
are its first and last steps. In between there are twice as many segments, and quadratics that are
computed ten bits further and tied to nothing:

- ``log2``: 128 segments; the quadratic's value is Q34, and the logarithm is rounded to Q24.
- ``b log2|x|`` is a number of 64 bits, Q55.
- ``exp2``: 128 segments, argument and value Q33; the sum is rounded to a float.

A segment is a constant ``C`` and a word ``w``: the slope, in units 2^-32, whose lowest twelve bits
are at the same time the curvature ``c``. With the offset ``d`` in the segment, in units 2^-10 of
the segment's last place, the value is ``C + hi(d (w + s hi(d c 2^20)))``, where hi is the high
half of a product, with s = -1 for log2 and +1 for exp2.

Error budget, worst cases, in units 2^-24 of the result (its ulp is 1 to 2 of these units):

===============================================================  =================
quadratic for log2, with its roundings                           0.15 ln 2 |a - 1|
log2 rounded to Q24                                              0.50 ln 2 |a - 1|
quadratic for exp2, with its roundings                           0.06
rounding to a float                                              1.00
exponent rounded to Q31                                          2^-8 ln 2 |log2 x|
last multiplication                                              0.5 ulp
===============================================================  =================
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from mpmath import log, mp, mpf, nint, power

from codegen.sig_pow import Bounds, chebyshev_nodes, composed_bounds, valley

INDEX_BITS = 7
SEGMENTS = 1 << INDEX_BITS
EXTRA_BITS = 10
"""Bits behind the binary point of the standard kernel's integers."""

CURVATURE_BITS = 12
_EXTRA = 1 << EXTRA_BITS
_PRECISION_BITS = 120
_FIT_NODES = 16
_CHECK_NODES = 64


@dataclass(frozen=True)
class Segment:
    """A quadratic on one segment.

    Attributes:
        constant: in units 2^-10 of the last place.
        slope: 32 bits in two's complement, in units 2^-32; its lowest bits are the curvature.
        error: a bound of the distance to the function, roundings included, in units of the last
            place; it holds at every offset.
    """

    constant: int
    slope: int
    error: float

    @property
    def rounding_word(self) -> int:
        """The 64 bits of the C table: the constant and half a last place above, the slope below."""
        return (self.constant + _EXTRA // 2) % 2**32 * 2**32 + self.slope % 2**32


@dataclass(frozen=True)
class PreciseTables:
    """The tables of the precise kernel, and what is proved of its error.

    Attributes:
        log2: 128 words; log2(1 + m) - m in units 2^-34, and a half in 2^-24 for the rounding.
        exp2: 128 words; 2^f - 1 - f in units 2^-33, and a half in 2^-23 for the rounding.
        bounds: of the error, for an exponent that is exact in Q31.
    """

    log2: tuple[int, ...]
    exp2: tuple[int, ...]
    bounds: Bounds


@functools.cache
def precise_tables() -> PreciseTables:
    """The tables for the C, the same on every platform: mpmath rounds alike everywhere."""
    precision = mp.prec
    mp.prec = _PRECISION_BITS
    try:
        log2 = tuple(_log2_segment(i) for i in range(SEGMENTS))
        exp2 = tuple(_exp2_segment(i) for i in range(SEGMENTS))
    finally:
        mp.prec = precision
    return PreciseTables(
        log2=tuple(s.rounding_word for s in log2),
        exp2=tuple(s.rounding_word for s in exp2),
        bounds=composed_bounds(
            # Besides the fit's: rounding to nearest, and what is cut off exp2's argument.
            [math.log(2) * (s.error + 0.5) for s in log2],
            [2 * (s.error + 0.5 + 1 / _EXTRA) for s in exp2],
        ),
    )


def _log2_segment(index: int) -> Segment:
    """log2(1 + m) - m; the offset is that of the standard kernel, in finer units."""
    origin, offsets = _place(index, 24)

    def correction(d: int) -> mpf:
        m = (origin + mpf(d)) / 2**24
        return (log(1 + m, 2) - m) * 2**24

    def bending(d: int) -> mpf:
        return -1 / (log(2) * (1 + (origin + mpf(d)) / 2**24) ** 2) / 2**24

    return _fit(correction, bending, offsets, sign=-1)


def _exp2_segment(index: int) -> Segment:
    """2^f - 1 - f."""
    origin, offsets = _place(index, 23)

    def correction(d: int) -> mpf:
        f = (origin + mpf(d)) / 2**23
        return (power(2, f) - 1 - f) * 2**23

    def bending(d: int) -> mpf:
        return log(2) ** 2 * power(2, (origin + mpf(d)) / 2**23) / 2**23

    return _fit(correction, bending, offsets, sign=1)


def _place(index: int, bits: int) -> tuple[int, range]:
    """Where the offset is zero, and all offsets.

    They go up from the left end of an even segment, and down from the right end of an odd one.
    """
    width, odd = 1 << (bits - INDEX_BITS), index % 2
    return (index + odd) * width, range(-odd * width, (1 - odd) * width + 1)


def _fit(
    f: Callable[[int], mpf], bending: Callable[[int], mpf], offsets: range, sign: int
) -> Segment:
    """The best quadratic under the packing, by minimax.

    Args:
        f: what to approximate, in units of the last place.
        bending: its second derivative by the offset; monotone.
        offsets: the segment; its length is a power of two, plus one.
        sign: of the curvature.
    """
    nodes = chebyshev_nodes(offsets, _FIT_NODES)
    values = [f(d) for d in nodes]
    # hi(d 2^10 c 2^20) = c d / 4, and hi(d 2^10 c d / 4) = c d^2 2^-24 in units 2^-10.
    unit = mpf(2) ** -34
    nearest = int(nint(abs(bending((offsets[0] + offsets[-1]) // 2)) / 2 / unit))

    def line(slope: int) -> list[mpf]:
        curvature = sign * (slope % (1 << CURVATURE_BITS)) * unit
        return [
            value - mpf(slope) / 2**32 * d - curvature * d * d
            for d, value in zip(nodes, values, strict=True)
        ]

    def spread(slope: int) -> mpf:
        left = line(slope)
        return max(left) - min(left)

    best: tuple[mpf, int] | None = None
    for curvature in range(max(nearest - 1, 0), nearest + 2):
        tilt = line(curvature)
        secant = int(nint((tilt[-1] - tilt[0]) / (nodes[-1] - nodes[0]) * 2**32))
        packed = (secant >> CURVATURE_BITS << CURVATURE_BITS) + curvature
        step = 1 << CURVATURE_BITS
        slope = valley(range(packed - 12 * step, packed + 13 * step, step), spread)
        candidate = (spread(slope), slope)
        best = candidate if best is None else min(best, candidate)
    assert best is not None
    slope = best[1]
    assert -(2**31) <= slope < 2**31
    left = line(slope)
    # Both high halves are rounded down; the first one is then multiplied by d 2^10 / 2^32 < 1/4.
    constant = int(nint((max(left) + min(left)) / 2 * _EXTRA + mpf(1) / 2))
    return Segment(constant, slope, _error(constant, slope, f, bending, offsets, sign))


def _error(
    constant: int,
    slope: int,
    f: Callable[[int], mpf],
    bending: Callable[[int], mpf],
    offsets: range,
    sign: int,
) -> float:
    """A bound of the distance at every offset, those between the integers included."""
    curvature = mpf(sign * (slope % (1 << CURVATURE_BITS))) / 2**34
    nodes = chebyshev_nodes(offsets, _CHECK_NODES)
    at_nodes = max(
        abs(mpf(constant) / _EXTRA + mpf(slope) / 2**32 * d + curvature * d * d - f(d))
        for d in nodes
    )
    # As in codegen.sig_pow: between nodes the second derivative bounds what can be added.
    steepest = max(abs(2 * curvature - bending(end)) for end in (offsets[0], offsets[-1]))
    gap = max(after - before for before, after in pairwise(nodes))
    floors = mpf(1 + 0.25) / _EXTRA
    return float(at_nodes + mpf(gap) ** 2 / 8 * steepest + floors)
