"""sig(x)^a = |x|^a sgn(x) in binary64 for cores with a double FPU: tables, and how good they are.

The C is in ``templates/tdc_sig_pow64.h.j2``; this module derives its constants and bounds its
error.

Method. ``y = X · 2^(b log2|x| - s)`` with ``X = 2^s x`` and ``b = a - 1``. Sign, zeros, NaN,
infinities, overflow and gradual underflow come out of the multiplication by ``X``, and ``a = 1``
is exact. ``s`` is 64 for subnormal ``x``, so that they need no case of their own, and -64 from 2
on, so that the multiplier is a normal double for the largest ``x`` and the smallest ``a``, too.

Everything between is in units 1/64 of a power of two:

- ``64 log2|x| = N + rest``. ``N`` is the exponent and the six leading bits of the mantissa
  ``m``, rounded to the nearest ``c = 1 + i/64``. The rest is a table's ``64 log2 c - i`` and a
  polynomial of degree six in ``r``, ``m - c`` (exact) times a table's slope.
- ``b = high + low``, where ``high`` is a multiple of 2^-31: ``high N`` is exact, because 31 and 17
  bits are fewer than 53. What is left is small, and its rounding errors are, too.
- ``64 b log2|x| = k + f`` with the nearest integer ``k``. The multiplier is ``P + P g``, with the
  table's power ``P`` of two for ``k``, and ``g`` the sum of what the table's rounding lost of it
  and of a polynomial of degree five for ``2^(f/64) - 1``.

Error budget, worst cases, in units 2^-53 relative to the result (its ulp is 1 to 2 of these units):

========================================================  =====
polynomial for log2                                       0.038
rounding of log2's table                                  0.043
roundings on the way to log2                              0.065
roundings of the product with b                           0.093
polynomial for exp2                                       0.020
roundings on the way to the multiplier                    0.033
the multiplier rounded to a double, at a power of two     1.000
last multiplication, half an ulp of a mantissa near two   0.500
========================================================  =====

`tables` derives the terms and adds them up, as if all of them met in one x. The exponent's own
error is less than 2^-84, and is in them.
"""

from __future__ import annotations

import argparse
import ctypes
import functools
import math
import os
import random
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from mpmath import cos, exp, ldexp, log, matrix, mp, mpf, pi

from codegen.rendering import environment
from codegen.sig_pow import PAPER_EXPONENTS

INDEX_BITS = 6
"""The segment is chosen by so many leading bits of the mantissa."""

SEGMENTS = 1 << INDEX_BITS
HIGH_BITS = 31
"""The exponent's high part is a multiple of 2^-31."""

POWER_BIAS = 1017
"""The table's powers are 2^-1017 to 2^-1016: what the C adds to their exponent is no negative."""

LOG2_DEGREE = 6
EXP2_DEGREE = 5

_PRECISION_BITS = 200
_LOG2_REACH = mpf(1) / (2 * SEGMENTS)
"""|m/c - 1| is no more than this, in the segment of c = 1."""

_EXP2_REACH = mpf(1) / 2 + mpf(2) ** -30
"""|f| is no more than this: half an integer, and the rounding of what is rounded to an integer."""

_MOST_POWER = 1100
"""More than |(a - 1) log2|x|| ever is."""


@dataclass(frozen=True)
class Segment:
    """A row of the C's table, for i/64.

    Attributes:
        slope: 64/ln 2 / (1 + i/64), nearly: the polynomial's first coefficient is in it.
        excess: 64 log2(1 + i/64) - i.
        power: 2^(i/64 - 1017).
        tail: what its rounding lost, relative to ``power``; 24 bits of it are enough.
    """

    slope: float
    excess: float
    power: float
    tail: float


@dataclass(frozen=True)
class Term:
    """A term of the error budget.

    Attributes:
        name: what goes wrong.
        units: by how much at most, in units 2^-53 relative to the result.
    """

    name: str
    units: float


@dataclass(frozen=True)
class SigPow64Tables:
    """The constants of sig_pow in binary64, and what is proved of its error.

    Attributes:
        segments: 64 rows.
        log2: the coefficients of r^2 to r^6 in 64 log2(1 + r ...).
        exp2: the coefficients of f to f^5 in 2^(f/64) - 1.
        budget: the errors that can add up.
        ulp_bound: the largest error of a result in units of its last place, for an exponent from
            `exponent64`.
    """

    segments: tuple[Segment, ...]
    log2: tuple[float, ...]
    exp2: tuple[float, ...]
    budget: tuple[Term, ...]
    ulp_bound: float

    @property
    def power_bias(self) -> int:
        """The powers in the table are 2^-power_bias times too small."""
        return POWER_BIAS

    @property
    def table_bytes(self) -> int:
        """The size of the C's table."""
        return 8 * (len(self.log2) + len(self.exp2) + 4 * len(self.segments))


@functools.cache
def tables() -> SigPow64Tables:
    """The constants for the C, the same on every platform: mpmath rounds alike everywhere."""
    with mp.workprec(_PRECISION_BITS):
        first, *log2_exact = _log2_polynomial()
        exp2_exact = _exp2_polynomial()
        segments = tuple(_segment(i, first) for i in range(SEGMENTS))
        log2, exp2 = (tuple(map(float, c)) for c in (log2_exact, exp2_exact))
        budget = _budget(segments, first, log2_exact, exp2_exact)
    ulps = sum(term.units for term in budget)
    return SigPow64Tables(segments, log2, exp2, budget, math.ceil(ulps * 100) / 100)


def exponent64(a: Fraction | float) -> tuple[float, float]:
    """``a - 1`` in two doubles, the exponent as the C takes it.

    Args:
        a: the exponent, 0 <= a <= 2; a Fraction such as 95/105 is exact to 2^-84.

    Returns:
        high, a multiple of 2^-31, and low, no more than 2^-32.

    Raises:
        ValueError: ``a`` is outside [0, 2] or not a number.
    """
    if not 0 <= a <= 2:
        raise ValueError(f"the exponent of sig_pow must be from 0 to 2, not {a}")
    minus_one = Fraction(a) - 1
    high = Fraction(round(minus_one * 2**HIGH_BITS), 2**HIGH_BITS)
    return float(high), float(minus_one - high)


# Fits


def _interpolate(f: Sequence[mpf], nodes: Sequence[mpf]) -> list[mpf]:
    """The coefficients, lowest first, of the polynomial with the values ``f`` at the nodes."""
    rows = matrix([[node**k for k in range(len(nodes))] for node in nodes])
    return list(mp.lu_solve(rows, matrix(f)))


def _chebyshev_nodes(count: int, reach: mpf) -> list[mpf]:
    """The zeros of the Chebyshev polynomial of this degree, on [-reach, reach]."""
    return [reach * cos(pi * (2 * k + 1) / (2 * count)) for k in range(count)]


def _log2_polynomial() -> list[mpf]:
    """64 log2(1 + z) by degree six without a constant, for |z| <= 2^-7.

    It meets the function in the seven zeros of a Chebyshev polynomial, which is the minimax
    polynomial but for terms of higher order. One of them is zero: log2 1 = 0 is exact.

    Returns:
        The coefficient of z, and then those of r^2 to r^6, where r is that linear term.
    """
    nodes = [z for z in _chebyshev_nodes(LOG2_DEGREE + 1, _LOG2_REACH) if abs(z) > mpf(2) ** -60]
    assert len(nodes) == LOG2_DEGREE
    first, *higher = _interpolate([SEGMENTS * log(1 + z, 2) / z for z in nodes], nodes)
    return [first, *(c / first ** (n + 2) for n, c in enumerate(higher))]


def _exp2_polynomial() -> list[mpf]:
    """2^(f/64) - 1 by degree five without a constant, for |f| <= 1/2; coefficients of f to f^5."""
    nodes = _chebyshev_nodes(EXP2_DEGREE, _EXP2_REACH)
    return _interpolate([mp.expm1(f * log(2) / SEGMENTS) / f for f in nodes], nodes)


def _segment(index: int, first: mpf) -> Segment:
    fraction = mpf(index) / SEGMENTS
    exact = ldexp(mp.power(2, fraction), -POWER_BIAS)
    power = float(exact)
    return Segment(
        slope=float(first / (1 + fraction)),
        excess=float(SEGMENTS * log(1 + fraction, 2) - index),
        power=power,
        tail=_shortened(exact / mpf(power) - 1),
    )


def _shortened(value: mpf) -> float:
    with mp.workprec(24):
        return float(+value)


# Error budget


def _rounding(magnitude: mpf) -> mpf:
    """Half a unit in the last place of a double no larger than this."""
    return ldexp(mpf(1), int(mp.floor(log(magnitude, 2))) - 53)


def _budget(
    segments: Sequence[Segment], first: mpf, log2: Sequence[mpf], exp2: Sequence[mpf]
) -> tuple[Term, ...]:
    """Bounds of every error, added up as if all of them met at the worst x, with |a - 1| = 1."""
    units = ldexp(mpf(1), 53)
    of_power = units * log(2) / SEGMENTS * (1 + mpf(2) ** -20)
    """Of the multiplier, for an error of the power of two in 1/64."""

    r = first * _LOG2_REACH
    largest_rest = max(mpf(s.excess) for s in segments) + r
    tables_rounding = max(
        abs(mpf(s.excess) - (SEGMENTS * log(1 + mpf(i) / SEGMENTS, 2) - i))
        for i, s in enumerate(segments)
    )
    curve = sum(abs(c) * r ** (n + 2) for n, c in enumerate(log2))
    growth = sum(abs(c) * _EXP2_REACH ** (n + 1) for n, c in enumerate(exp2))
    # r is one product with a rounded slope, the curve eight roundings in a row at most, which
    # the rounded coefficients' come upon.
    linear = r * mpf(2) ** -52
    bent = curve * 10 * mpf(2) ** -53
    terms = {
        "polynomial for log2": of_power * _log2_fit_error(),
        "rounding of log2's table": of_power * tables_rounding,
        "roundings on the way to log2": of_power
        * (linear + bent + _rounding(r) + _rounding(largest_rest)),
        "roundings of the product with b": of_power
        * (
            2 * _rounding(largest_rest)
            + _rounding(_EXP2_REACH)
            # low times log2|x|: three roundings, and low's own.
            + 4 * mpf(2) ** -(HIGH_BITS + 53) * SEGMENTS * _MOST_POWER
        ),
        "polynomial for exp2": units * _exp2_fit_error(),
        # The largest coefficient's rounding, and the last product's and sum's, are relative to
        # the growth; the others to much less. The product with the power is one more.
        "roundings on the way to the multiplier": units * growth * 6 * mpf(2) ** -53,
        "the multiplier rounded to a double, at a power of two": mpf(1),
        "last multiplication, half an ulp of a mantissa near two": mpf(1) / 2,
    }
    return tuple(Term(name, math.ceil(float(value) * 1000) / 1000) for name, value in terms.items())


def _log2_fit_error() -> mpf:
    """Interpolation's remainder: the seventh derivative, and the Chebyshev polynomial's 2^-6."""
    n = LOG2_DEGREE + 1
    derivative = SEGMENTS / log(2) / n / (1 - _LOG2_REACH) ** n  # of log2, over 7!
    return derivative * _LOG2_REACH**n / 2 ** (n - 1)


def _exp2_fit_error() -> mpf:
    """The same for (2^(f/64) - 1)/f, whose fifth derivative is the sixth of 2^(f/64) over 6."""
    n = EXP2_DEGREE
    rate = log(2) / SEGMENTS
    derivative = rate ** (n + 1) * exp(rate * _EXP2_REACH) / mp.factorial(n) / (n + 1)
    return derivative * _EXP2_REACH ** (n + 1) / 2 ** (n - 1)


# Rendering


def render(directory: Path, banner: str = "/* sig_pow64 on its own. */") -> tuple[Path, ...]:
    """Writes tdc.h, tdc_sig_pow64.h and tdc_sig_pow64.c to ``directory``; returns their paths."""
    templates = environment()
    paths = tuple(directory / name for name in ("tdc.h", "tdc_sig_pow64.h", "tdc_sig_pow64.c"))
    for path in paths:
        template = templates.get_template(f"{path.name}.j2")
        path.write_text(template.render(banner=banner, tables=tables()), encoding="utf-8")
    return paths


# Measurement

_BATCH_C = r"""
#include "tdc_sig_pow64.h"

void batch(const double *x, double high, double low, double *result, uint32_t count)
{
    const tdc_exponent64 exponent = {high, low};
    for (uint32_t i = 0u; i < count; ++i) {
        result[i] = tdc_sig_pow64(x[i], exponent);
    }
}
"""


@dataclass(frozen=True)
class Sample:
    """The largest error of one exponent over random doubles.

    Attributes:
        exponent: as it was asked for, a decimal or a fraction.
        count: how many doubles were looked at.
        ulp: largest error in units of the exact result's last place.
        ulp_at: where that is.
    """

    exponent: str
    count: int
    ulp: float
    ulp_at: float


def error_ulp(x: float, a: Fraction, y: float) -> float:
    """How far y is from x^a, in units of the last place of x^a.

    Args:
        x: positive and finite.
        a: the exponent.
        y: what was computed. Infinity counts as 2^1024, and so does an x^a beyond.
    """
    with mp.workprec(_PRECISION_BITS):
        exact = mpf(x) ** (mpf(a.numerator) / a.denominator)
        infinity = ldexp(mpf(1), 1024)
        exact = min(exact, infinity)
        computed = infinity if math.isinf(y) else mpf(y)
        last_place = max(mp.frexp(exact)[1] - 53, -1074)
        return float(abs(computed - exact) / ldexp(mpf(1), last_place))


def sample(exponents: Sequence[str], count: int, seed: int = 1) -> Iterator[Sample]:
    """Compares the C with mpmath at random doubles, all binades alike.

    Args:
        exponents: decimals or fractions.
        count: how many doubles an exponent; about 20 000 take a second.
        seed: of the doubles.

    Raises:
        subprocess.CalledProcessError: the C compiler refused the C.
    """
    with tempfile.TemporaryDirectory() as scratch:
        directory = Path(scratch)
        *_, source = render(directory)
        batch_source, library = directory / "batch.c", directory / "batch.so"
        batch_source.write_text(_BATCH_C, encoding="utf-8")
        flags = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared")
        command = [os.environ.get("CC", "cc"), *flags, str(batch_source), str(source)]
        subprocess.run([*command, "-o", str(library)], check=True)
        batch = ctypes.CDLL(str(library)).batch
        batch.restype = None
        generator = random.Random(seed)
        for exponent in exponents:
            a = Fraction(exponent)
            words = [generator.randrange(1, 0x7FF0_0000_0000_0000) for _ in range(count)]
            x = [struct.unpack("<d", struct.pack("<Q", word))[0] for word in words]
            doubles = ctypes.c_double * count
            y = doubles()
            high, low = map(ctypes.c_double, exponent64(a))
            batch(doubles(*x), high, low, y, ctypes.c_uint32(count))
            errors = ((error_ulp(argument, a, y[i]), argument) for i, argument in enumerate(x))
            ulp, ulp_at = max(errors)
            yield Sample(exponent, count, ulp, ulp_at)


def _exponent(text: str) -> str:
    """An exponent on the command line, checked."""
    try:
        exponent64(Fraction(text))
    except (ValueError, ZeroDivisionError) as error:
        raise argparse.ArgumentTypeError(f"{text}: write a number from 0 to 2") from error
    return text


def main(arguments: Sequence[str] | None = None) -> int:
    """``python -m codegen.sig_pow64``: the error bound, its budget, and measured errors."""
    parser = argparse.ArgumentParser(
        prog="python -m codegen.sig_pow64",
        description="How accurate the generated sig_pow in double is: its bound, and samples.",
    )
    parser.add_argument("--count", type=int, default=20_000, help="random doubles an exponent")
    parser.add_argument(
        "--exponents",
        nargs="+",
        type=_exponent,
        default=PAPER_EXPONENTS,
        help="decimals or fractions such as 95/105, from 0 to 2",
    )
    options = parser.parse_args(arguments)
    for term in tables().budget:
        print(f"{term.name:<56}  {term.units:.3f}")
    print(f"bound: {tables().ulp_bound:.2f} ulp")
    print(f"{'exponent':>8}  {'ulp':>5}  {'at x':>12}   ({options.count} random doubles each)")
    for row in sample(options.exponents, options.count):
        print(f"{row.exponent:>8}  {row.ulp:5.3f}  {row.ulp_at:12.6e}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
