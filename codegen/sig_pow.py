"""sig(x)^a = |x|^a sgn(x) in binary32 by integer arithmetic: the tables, and how good they are.

The C is in ``templates/tdc_sig_pow.h.j2``; this module derives its tables and bounds its error.

Method. ``y = x · 2^(b log2|x|)`` with ``b = a - 1``. Sign, zeros, NaN, infinities and overflow come
out of the multiplication by ``x``, and ``a = 1`` is exact.

Both functions are taken in integers, by one quadratic a segment, 64 segments each:

- ``log2``: the bits of ``|x|``, shifted left by one, are its exponent and mantissa ``e + m`` in
  Q24. A quadratic in ``m`` corrects them by ``log2(1 + m) - m``.
- ``b log2|x|`` is the high word of a 64-bit product of Q31 and Q24: Q23, rounded down.
- ``exp2``: a number in Q23 is, read as the bits of a float, ``2^n (1 + f)``. A quadratic in the
  fraction ``f`` corrects it by ``2^f - 1 - f``.

A segment is a word of 64 bits, ``R``. Its low half ``w`` is the slope, in units 2^-32, whose
lowest eight bits are at the same time the curvature ``c``. With the offset ``d`` in the segment
the correction is the high half of ``R + d (w + s c d)``, with s = -1 for log2 and +1 for exp2.
That is two multiply-accumulates and one load. It ties the constant's fraction to the slope (``w``
is both), and rounds the curvature to an integer: the tables are fitted with both restrictions.

Error budget, worst cases, in units 2^-24 of the result (its ulp is 1 to 2 of these units):

===============================================================  =================
quadratic for log2: polynomial, rounded curvature, tied constant 1.31 ln 2 |a - 1|
log2 rounded down to Q24                                         0.50 ln 2 |a - 1|
product rounded down to Q23                                      1.00 ln 2
quadratic for exp2: the same three                               1.01
exp2 rounded down to a float                                     1.00
exponent rounded to Q31                                          2^-8 ln 2 |log2 x|
last multiplication                                              0.5 ulp
===============================================================  =================

Rounding down is centred by a half in the tables' constants. `composed_bounds` adds the
terms up segment by segment, with the mantissas at which they can meet; each fit's error is bounded
between the points that were looked at, too, by the second derivative. All floats in [2^-30, 2^7):
`exhaustive`.

A subnormal ``x`` has no leading one in its mantissa, so that its bits are no logarithm: the result
lies on a chord from 0 to the value at 2^-126. A scaling by 2^23 would mend it for one
multiplication and one 64-bit sum a power, which no signal of a robot is worth.
"""

from __future__ import annotations

import argparse
import ctypes
import functools
import json
import math
import os
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from fractions import Fraction
from itertools import pairwise, product
from pathlib import Path
from typing import Any

from mpmath import cos, log, mp, mpf, nint, pi, power

from codegen.rendering import environment

INDEX_BITS = 6
"""The segment is chosen by so many leading bits of the mantissa."""

SEGMENTS = 1 << INDEX_BITS
CURVATURE_BITS = 8
EXPONENT_Q31_MAX = 2**31 - 1
PAPER_EXPONENTS = ("0.95", "95/105", "0.98", "98/102", "0.4", "0.6", "0.8", "1.2", "1.5")
"""Exponents of the paper (alpha, alpha / (2 - alpha)) and a fan around them."""

_UNIT = 1 << 32
_PRECISION_BITS = 100
_FIT_NODES = 16
_CHECK_NODES = 64

Function = Callable[[int], int]
"""A function of the offset in the segment, in units 2^-32 of the last place."""


@dataclass(frozen=True)
class Segment:
    """A quadratic on one segment.

    Attributes:
        constant: in units of the last place.
        slope: 32 bits in two's complement, in units 2^-32; its lowest byte is the curvature.
        error: a bound of the distance to the function, in units of the last place, which holds
            at every offset and not only at those that were looked at.
    """

    constant: int
    slope: int
    error: float

    def word(self, constant: int) -> int:
        """The 64 bits of the C table, with ``constant`` added."""
        high = (self.constant + constant) % _UNIT
        return high * _UNIT + self.slope % _UNIT


@dataclass(frozen=True)
class Bounds:
    """What is proved of a kernel's error wherever base and result are normal floats.

    Attributes:
        ulp: the largest error in units of the result's last place.
        relative: the largest relative error.
    """

    ulp: float
    relative: float

    @classmethod
    def rounded_up(cls, ulp: float, units: float) -> Bounds:
        """From an error in ulp and one in units 2^-24 of the result."""
        return cls(math.ceil(ulp * 100) / 100, math.ceil(units * 100) / 100 * 2.0**-24)

    @property
    def text(self) -> str:
        """Both bounds, for people."""
        power = math.ceil(math.log2(self.relative) * 100) / 100
        return f"{self.ulp:.2f} ulp of the result, 2^{power:.2f} relative"


@dataclass(frozen=True)
class SigPowTables:
    """The tables of sig_pow, and what is proved of its error.

    Attributes:
        log2: 64 words; log2(1 + m) - m in units 2^-24, less 127.
        exp2: 64 words; 2^f - 1 - f in units 2^-23, plus one.
        bounds: of the error, for an exponent that is exact in Q31. One that was rounded to
            nearest adds 2^-8 ln 2 |log2 x| ulp at most.
    """

    log2: tuple[int, ...]
    exp2: tuple[int, ...]
    bounds: Bounds


@functools.cache
def tables() -> SigPowTables:
    """The tables for the C, the same on every platform: only integers decide."""
    precision = mp.prec
    mp.prec = _PRECISION_BITS
    try:
        log2 = tuple(_log2_segment(i) for i in range(SEGMENTS))
        exp2 = tuple(_exp2_segment(i) for i in range(SEGMENTS))
    finally:
        mp.prec = precision
    return SigPowTables(
        log2=tuple(s.word(-(127 << 24)) for s in log2),
        exp2=tuple(s.word(1 << 23) for s in exp2),
        bounds=composed_bounds(
            # Besides the fit's: half a unit from rounding down, and one from the product's.
            [math.log(2) * (s.error + 0.5 + 1.0) for s in log2],
            [2 * (s.error + 0.5) for s in exp2],
        ),
    )


def exponent_q31(a: Fraction | float) -> int:
    """``a - 1`` in Q31, the exponent as the C takes it.

    Args:
        a: the exponent, 0 <= a <= 2; a Fraction such as 95/105 is rounded once, to nearest.

    Returns:
        An int32. The error of the exponent is at most 2^-32, except near a = 2, which is stored
        as 2 - 2^-31.

    Raises:
        ValueError: ``a`` is outside [0, 2] or not a number.
    """
    if not 0 <= a <= 2:
        raise ValueError(f"the exponent of sig_pow must be from 0 to 2, not {a}")
    return min(round((Fraction(a) - 1) * 2**31), EXPONENT_Q31_MAX)


def _log2_segment(index: int) -> Segment:
    """Corrects e + m to log2(2^e (1 + m)) in Q24.

    The offset is what lies below the index's lowest bit, with that bit as its sign: it counts up
    from the left end of an even segment, and down from the right end of an odd one.
    """
    width = 1 << (24 - INDEX_BITS)
    odd = index % 2
    origin = (index + odd) * width

    def correction(d: int) -> int:
        m = mpf(origin + d) / 2**24
        return _centred((log(1 + m, 2) - m) * 2**24)

    def bending(d: int) -> mpf:
        return -1 / (log(2) * (1 + mpf(origin + d) / 2**24) ** 2) / 2**24

    return _fit(correction, bending, range(-odd * width, (1 - odd) * width + 1), sign=-1)


def _exp2_segment(index: int) -> Segment:
    """Corrects n + f, the bits of 2^n (1 + f), to those of 2^(n + f) in Q23."""
    width = 1 << (23 - INDEX_BITS)

    def correction(d: int) -> int:
        z = index * width + d
        # The product was rounded down: on average z stands for half a unit more.
        f = (mpf(z) + mpf(1) / 2) / 2**23
        return _centred((power(2, f) - 1) * 2**23 - z)

    def bending(d: int) -> mpf:
        f = (mpf(index * width + d) + mpf(1) / 2) / 2**23
        return log(2) ** 2 * power(2, f) / 2**23

    return _fit(correction, bending, range(width + 1), sign=1)


def _centred(value: mpf) -> int:
    """``value`` plus one half, because the C rounds down, in units 2^-32."""
    return int(nint((value + mpf(1) / 2) * _UNIT))


def _fit(f: Function, bending: Callable[[int], mpf], offsets: range, sign: int) -> Segment:
    """The best ``constant + d (slope + sign curvature d)`` under the packing, by minimax.

    Args:
        f: what to approximate.
        bending: its second derivative by the offset, in units of the last place; monotone.
        offsets: the segment; its length is a power of two, plus one.
        sign: of the curvature.
    """
    nodes = chebyshev_nodes(offsets, _FIT_NODES)
    values = [f(d) for d in nodes]
    middle, width = _FIT_NODES // 2, offsets[-1] - offsets[0]
    second_difference = abs(values[0] - 2 * values[middle] + values[-1])
    nearest = 2 * second_difference // width**2

    def error(constant: int, targets: list[tuple[int, int]], slope: int) -> int:
        start = constant * _UNIT + slope % _UNIT
        return max(abs(start + d * slope - target) for d, target in targets)

    best: tuple[int, int, int] | None = None
    for curvature in range(max(nearest - 1, 0), nearest + 3):
        # What is left for the straight line; it needs only a few steps of the slope to tilt.
        line = [(d, v - sign * curvature * d * d) for d, v in zip(nodes, values, strict=True)]
        (left, low), (right, high) = line[0], line[-1]
        secant = (high - low) // (right - left)
        origin = low - secant * left
        steps = 4 * _UNIT // width >> CURVATURE_BITS
        for constant in range(origin // _UNIT - 1, origin // _UNIT + 2):
            packed = (secant >> CURVATURE_BITS << CURVATURE_BITS) + curvature
            slopes = range(
                packed - (steps << CURVATURE_BITS),
                packed + (steps << CURVATURE_BITS),
                1 << CURVATURE_BITS,
            )
            slope = valley(slopes, functools.partial(error, constant, line))
            candidate = (error(constant, line, slope), constant, slope)
            best = candidate if best is None else min(best, candidate)
    assert best is not None
    _, constant, slope = best
    assert -(2**31) <= slope < 2**31

    def polynomial(d: int) -> int:
        curved = slope + sign * (slope % (1 << CURVATURE_BITS)) * d
        return constant * _UNIT + slope % _UNIT + d * curved

    nodes = chebyshev_nodes(offsets, _CHECK_NODES)
    largest = max(abs(polynomial(d) - f(d)) for d in nodes) + 1  # f is rounded to an integer
    # Between two nodes a function exceeds its values there by gap^2/8 of its second derivative at
    # most. That of the difference is a constant less a monotone function: the ends have it.
    constant_bending = mpf(2 * sign * (slope % (1 << CURVATURE_BITS))) / _UNIT
    steepest = max(abs(constant_bending - bending(end)) for end in (offsets[0], offsets[-1]))
    gap = max(after - before for before, after in pairwise(nodes))
    return Segment(constant, slope, float(mpf(largest) / _UNIT + mpf(gap) ** 2 / 8 * steepest))


def chebyshev_nodes(offsets: range, count: int) -> list[int]:
    """Chebyshev's points with both ends; mpmath rounds them alike everywhere."""
    start, width = offsets[0], offsets[-1] - offsets[0]
    return [start + int(nint(width * (1 - cos(pi * k / count)) / 2)) for k in range(count + 1)]


def valley(arguments: range, f: Callable[[int], Any]) -> int:
    """Where a function with a single valley is least, by ternary search."""
    low, high = 0, len(arguments) - 1
    while high - low > 2:
        third = (high - low) // 3
        if f(arguments[low + third]) <= f(arguments[high - third]):
            high -= third
        else:
            low += third
    return min(arguments[low : high + 1], key=f)


def composed_bounds(exponents: Sequence[float], multipliers: Sequence[float]) -> Bounds:
    """Bounds of the error for every x and every exponent in Q31.

    The mantissa of the result is the product of those of x, in log2's segment i, and of the
    multiplier, in exp2's segment j, halved if it reaches two.

    Args:
        exponents: for each segment of log2, the error of the multiplier that its exponent makes,
            relative, in units 2^-24.
        multipliers: for each segment of exp2, the error of the multiplier besides, in units 2^-24
            of a multiplier of 1.
    """
    worst_ulps, worst_units = 0.0, 0.0
    for (i, exponent), (j, multiplier) in product(enumerate(exponents), enumerate(multipliers)):
        x_low, x_high = 1 + i / len(exponents), 1 + (i + 1) / len(exponents)
        g_low, g_high = 2 ** (j / len(multipliers)), 2 ** ((j + 1) / len(multipliers))
        if x_low * g_low < 2:  # ulp = 2 units of the product's scale
            ulps = exponent * min(2.0, x_high * g_high) / 2
            ulps += multiplier * min(x_high, 2 / g_low) / 2 + 0.5
            units = exponent + multiplier / g_low + 1 / (x_low * g_low)
            worst_ulps, worst_units = max(worst_ulps, ulps), max(worst_units, units)
        if x_high * g_high > 2:
            ulps = exponent * x_high * g_high / 4 + multiplier * x_high / 4 + 0.5
            units = exponent + multiplier / g_low + 2 / max(2.0, x_low * g_low)
            worst_ulps, worst_units = max(worst_ulps, ulps), max(worst_units, units)
    return Bounds.rounded_up(worst_ulps, worst_units)


_SURVEY_C = r"""
#include <math.h>

#include "tdc_sig_pow.h"

typedef struct {
    double ulp, relative, drop_ulp;
    float ulp_at;
} survey_result;

/* All floats with bits from first to last against the host's pow in double (error 2^-52). */
void survey(uint32_t first, uint32_t last, double a, int32_t minus_one_q31, survey_result *result)
{
    const tdc_exponent exponent = {minus_one_q31};
    survey_result worst = {0.0, 0.0, 0.0, 0.0f};
    float before = 0.0f;
    for (uint32_t bits = first; bits <= last; ++bits) {
        float x;
        memcpy(&x, &bits, sizeof x);
        const float y = tdc_sig_pow(x, exponent);
        const double exact = pow((double)x, a);
        int binade;
        (void)frexp(exact, &binade);
        const double ulp = ldexp(1.0, binade - 24), error = fabs((double)y - exact);
        if (error / ulp > worst.ulp) {
            worst.ulp = error / ulp;
            worst.ulp_at = x;
        }
        worst.relative = fmax(worst.relative, error / exact);
        worst.drop_ulp = fmax(worst.drop_ulp, ((double)before - (double)y) / ulp);
        before = y;
    }
    *result = worst;
}
"""


class _SurveyResult(ctypes.Structure):
    _fields_ = (
        ("ulp", ctypes.c_double),
        ("relative", ctypes.c_double),
        ("drop_ulp", ctypes.c_double),
        ("ulp_at", ctypes.c_float),
    )


@dataclass(frozen=True)
class Survey:
    """The largest errors of one exponent over all floats of a range.

    Attributes:
        exponent: as it was asked for, a decimal or a fraction.
        ulp: largest error in units of the exact result's last place.
        ulp_at: where that is.
        relative: largest relative error.
        drop_ulp: the most that the result falls from one float to the next, in ulp.
    """

    exponent: str
    ulp: float
    ulp_at: float
    relative: float
    drop_ulp: float


def render(directory: Path, banner: str = "/* sig_pow on its own. */") -> tuple[Path, ...]:
    """Writes tdc.h, tdc_sig_pow.h and tdc_sig_pow.c to ``directory``; returns their paths."""
    templates = environment()
    paths = tuple(directory / name for name in ("tdc.h", "tdc_sig_pow.h", "tdc_sig_pow.c"))
    for path in paths:
        template = templates.get_template(f"{path.name}.j2")
        path.write_text(template.render(banner=banner, tables=tables()), encoding="utf-8")
    return paths


def exhaustive(exponents: Sequence[str], low: float, high: float) -> Iterator[Survey]:
    """Compares the C with the host's double-precision pow at every float in [low, high).

    Runs on all cores; about five seconds an exponent and core for [2^-30, 2^7).

    Raises:
        subprocess.CalledProcessError: the C compiler refused the C.
    """
    first, last = (struct.unpack("<I", struct.pack("<f", x))[0] for x in (low, high))
    step = 1 << 22
    with (
        tempfile.TemporaryDirectory() as scratch,
        ThreadPoolExecutor(os.cpu_count()) as pool,
    ):
        directory = Path(scratch)
        *_, source = render(directory)
        survey_source, library = directory / "survey.c", directory / "survey.so"
        survey_source.write_text(_SURVEY_C, encoding="utf-8")
        compiler = os.environ.get("CC", "cc")
        flags = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared")
        files = (str(survey_source), str(source), "-o", str(library), "-lm")
        subprocess.run([compiler, *flags, *files], check=True)
        survey = ctypes.CDLL(str(library)).survey
        survey.argtypes = (
            ctypes.c_uint32,
            ctypes.c_uint32,
            ctypes.c_double,
            ctypes.c_int32,
            ctypes.POINTER(_SurveyResult),
        )
        survey.restype = None
        for exponent in exponents:
            a = Fraction(exponent)

            def part(start: int, a: Fraction = a) -> _SurveyResult:
                result = _SurveyResult()
                end = min(start + step, last - 1)
                survey(start, end, float(a), exponent_q31(a), ctypes.byref(result))
                return result

            parts = list(pool.map(part, range(first, last, step)))
            worst = max(parts, key=lambda p: p.ulp)
            yield Survey(
                exponent,
                worst.ulp,
                worst.ulp_at,
                max(p.relative for p in parts),
                max(p.drop_ulp for p in parts),
            )


def _exponent(text: str) -> str:
    """An exponent on the command line, checked."""
    try:
        exponent_q31(Fraction(text))
    except (ValueError, ZeroDivisionError) as error:
        raise argparse.ArgumentTypeError(f"{text}: write a number from 0 to 2") from error
    return text


def main(arguments: Sequence[str] | None = None) -> int:
    """``python -m codegen.sig_pow``: the error bound; with --exhaustive, the measured errors."""
    parser = argparse.ArgumentParser(
        prog="python -m codegen.sig_pow",
        description="How accurate the generated sig_pow is: its bound, and every float measured.",
    )
    parser.add_argument(
        "--exhaustive", action="store_true", help="measure all floats in [2^-30, 2^7), ~1 minute"
    )
    parser.add_argument(
        "--exponents",
        nargs="+",
        type=_exponent,
        default=PAPER_EXPONENTS,
        help="decimals or fractions such as 95/105, from 0 to 2",
    )
    parser.add_argument(
        "--output", type=Path, default=Path("build/sig_pow.json"), help="the figures as JSON"
    )
    options = parser.parse_args(arguments)
    bound = tables()
    print(f"bound: {bound.bounds.text} (exponents exact in Q31)")
    if not options.exhaustive:
        return 0
    print(f"{'exponent':>8}  {'ulp':>5}  {'relative':>8}  {'at x':>12}  {'drop/ulp':>8}")
    surveys = []
    for row in exhaustive(options.exponents, 2.0**-30, 2.0**7):
        surveys.append(row)
        relative = f"2^{math.log2(row.relative):.2f}" if row.relative else "0"
        print(
            f"{row.exponent:>8}  {row.ulp:5.3f}  {relative:>8}  {row.ulp_at:12.6e}"
            f"  {row.drop_ulp:8.3f}",
            flush=True,
        )
    report = {
        "range": [2.0**-30, 2.0**7],
        "ulp_bound": bound.bounds.ulp,
        "relative_bound": bound.bounds.relative,
        "exhaustive": [asdict(row) for row in surveys],
    }
    options.output.parent.mkdir(parents=True, exist_ok=True)
    options.output.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
