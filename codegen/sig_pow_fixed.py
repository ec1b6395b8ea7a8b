"""gain |x|^a sgn(x) for integers, on cores without an FPU: the tables, and how good they are.

The C is in ``templates/tdc_fixed.h.j2``; this module derives its tables, bounds its error, and
turns a gain and an exponent into the integers that the C takes.

Method. ``2^(a log2|x| + log2 gain)``, all in integers: ``|x|`` is shifted until its highest bit is
set, which gives the logarithm's integer part; one quadratic in the mantissa gives the fraction in
Q27. The product with ``a`` is Q26. What it lacks of 31, after the gain's logarithm is added, is
Q23: its integer part is the shift that puts the result to its place, its fraction goes through a
second quadratic to a significand in Q31.

A segment is a word of 64 bits: the constant, and the slope ``t`` in units 2^-31, whose lowest bits
are at the same time the curvature ``c``. With the offset ``d`` from the left end the value is
``constant + s d (t - (c d >> shift))``, with s = +1 for log2 and -1 for 2^(1 - f): slope and offset
are unsigned, so that all three long products are the high word of an unsigned one. ARMv6-M has to
put it together from four short ones. Two values of 2^(1 - f) are prescribed: the first one is what
rounds to 2^31 - 1 and, shifted, to a power of two; the last one is 2^31 - 1 in Q31, which rounds
to 0 where it stands for a result of less than 1/2. So saturation and underflow need no code of
their own.

Error budget, relative to the result, in units 2^-24:

==================================================================  ==================
quadratic for log2: polynomial, rounded curvature and slope         1.06 ln 2 a
mantissa cut to 28 bits, log2 rounded down to Q27                   0.10 ln 2 a
a log2|x| rounded down to Q23                                       1.00 ln 2
log2 gain rounded down to Q23                                       0.50 ln 2
quadratic for 2^(1 - f), the prescribed values, its rounding        1.55
==================================================================  ==================

Rounding down is centred by the tables' constants. `FixedTables.relative_bound` adds the terms up
with every segment's own error, which is bounded between the points that were looked at, too, by
the second derivative. Rounding the result adds half a unit.
"""

from __future__ import annotations

import argparse
import functools
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from mpmath import floor, iv, log, mpf, nint, power, workprec

from codegen.rendering import environment
from codegen.sig_pow import chebyshev_nodes, valley

EXPONENT_Q31_MAX = 2**32 - 1
SCALE_Q24_MAX = 2**31 - 1
ZERO_GAIN = -(2**31)
"""The scale that stands for a gain of zero."""

MAGNITUDE_MAX = 2**31 - 1
"""Where the results saturate."""

HASH_FACTOR = 0x07C4ACDD
"""Times 2^k - 1, for k from 1 to 32, it has 32 different values in its highest five bits."""

_PRECISION_BITS = 100
_FIT_NODES = 16
_CHECK_NODES = 64
_SLOPE_STEPS = 64
_SLOPE_LOG2_UNIT = 31
_ROUNDED_DOWN = 0.5
"""The mean of what rounding down takes, and the most that it differs from its mean."""


@dataclass(frozen=True)
class Form:
    """How the C evaluates a quadratic.

    Attributes:
        index_bits: the segment is chosen by so many bits.
        offset_bits: bits of the offset d in the segment.
        product_shift: d times the slope is shifted right by so much, in all.
        curvature_bits: lowest bits of the slope that are the curvature c.
        curvature_shift: c d is shifted right by so much before it is subtracted from the slope.
        sign: 1 if the function rises, -1 if it falls.
    """

    index_bits: int
    offset_bits: int
    product_shift: int
    curvature_bits: int
    curvature_shift: int
    sign: int

    @property
    def segments(self) -> int:
        """How many segments there are."""
        return 1 << self.index_bits

    @property
    def offsets(self) -> range:
        """All offsets in a segment."""
        return range(1 << self.offset_bits)

    @property
    def curvature_mask(self) -> int:
        """The bits of the curvature."""
        return (1 << self.curvature_bits) - 1

    @property
    def fraction_bits(self) -> int:
        """Bits after the point of `rise`."""
        return self.product_shift + self.curvature_shift

    def rise(self, slope: int, d: int) -> int:
        """What is added to the constant, before anything is rounded."""
        curved = (slope & self.curvature_mask) * d
        return self.sign * d * ((slope << self.curvature_shift) - curved)

    def rounded_rise(self, slope: int, d: int) -> int:
        """What the C adds to the constant."""
        bend = (slope & self.curvature_mask) * d >> self.curvature_shift
        return self.sign * (d * (slope - bend) >> self.product_shift)


LOG2 = Form(
    index_bits=6,
    offset_bits=22,
    product_shift=32,
    curvature_bits=10,
    curvature_shift=7,
    sign=1,
)
EXP2 = Form(
    index_bits=5,
    offset_bits=18,
    product_shift=23,
    curvature_bits=11,
    curvature_shift=4,
    sign=-1,
)


class FixedPower(NamedTuple):
    """gain |x|^a as the C takes it.

    Attributes:
        exponent_q31: a in units 2^-31, an uint32.
        scale_q24: log2(gain) in units 2^-24, an int32; `ZERO_GAIN` for a gain of zero.
    """

    exponent_q31: int
    scale_q24: int


@dataclass(frozen=True)
class Segment:
    """A quadratic on one segment.

    Attributes:
        constant: in units of the last place.
        slope: in units 2^-31; its lowest bits are the curvature.
        error: a bound of the distance to the function, in units of the last place, which holds
            at every offset and not only at those that were looked at; roundings in the C are not
            in it.
    """

    constant: int
    slope: int
    error: float

    @property
    def word(self) -> int:
        """The 64 bits of the C table."""
        return self.constant << 32 | self.slope


@dataclass(frozen=True)
class FixedTables:
    """The tables, and what is proved of the error.

    Attributes:
        log2: 64 words; 31 + log2(1 + m) in Q27.
        exp2: 32 words; 2^(1 - f) in Q31.
        log2_bound: the largest error of log2|x|.
        relative_bound: the largest relative error of a result before it is rounded to an integer,
            for every x, and every exponent and gain as they are stored.
    """

    log2: tuple[int, ...]
    exp2: tuple[int, ...]
    log2_bound: float
    relative_bound: float

    @property
    def log2_relative_bound(self) -> float:
        """The binary logarithm of `relative_bound`, rounded up to two decimals."""
        return math.ceil(math.log2(self.relative_bound) * 100) / 100

    @property
    def size(self) -> int:
        """Bytes of flash."""
        return 8 * (len(self.log2) + len(self.exp2))


@dataclass(frozen=True)
class _Target:
    """What a segment is to approximate.

    Attributes:
        value: the function of the offset, in units of the last place.
        bending: its second derivative by the offset, which is monotone.
        first: the prescribed value at the left end, if there is one.
        last: the prescribed value at the right end, if there is one.
    """

    value: Callable[[int], mpf]
    bending: Callable[[int], mpf]
    first: int | None = None
    last: int | None = None


@functools.cache
def tables() -> FixedTables:
    """The tables for the C, the same on every platform: only integers decide."""
    with workprec(_PRECISION_BITS):
        log2 = tuple(_fit(LOG2, _log2_target(i)) for i in range(LOG2.segments))
        exp2 = tuple(_fit(EXP2, _exp2_target(i)) for i in range(EXP2.segments))
    assert log2[0].constant >= 31 << 27, "log2 1 would be negative, which the C does not know"
    log2_bound = max(_log2_error(i, segment) for i, segment in enumerate(log2))
    exp2_bound = max(_exp2_error(j, segment) for j, segment in enumerate(exp2))
    # The product and the gain's logarithm, rounded in Q23: 1.5 units from end to end.
    exponent = 2 * log2_bound + 0.75 * 2.0**-23
    # (1 + u)(1 + v) - 1 and e^u - 1 exceed u + v and u by less than their millionth part.
    relative = (math.log(2) * exponent + exp2_bound) * (1 + 2.0**-20)
    return FixedTables(
        log2=tuple(segment.word for segment in log2),
        exp2=tuple(segment.word for segment in exp2),
        log2_bound=log2_bound,
        relative_bound=math.ceil(relative * 2**24 * 1000) / 1000 * 2.0**-24,
    )


def fixed_power(gain: Fraction, exponent: Fraction, base: Fraction = Fraction(1)) -> FixedPower:
    """``gain |base x|^exponent`` as the C takes it, both rounded once, to nearest.

    Args:
        gain: in units of the result over those of x to the exponent; zero or positive.
        exponent: 0 <= exponent < 2.
        base: what x is multiplied by first: its unit, in the gain's.

    Returns:
        The exponent with an error of 2^-32 at most (just below 2: 2^-31), and the gain's logarithm
        with one of 2^-25.

    Raises:
        ValueError: the exponent or the gain is out of range.
    """
    if not 0 <= exponent < 2:
        raise ValueError(f"the exponent of a power must be at least 0 and less than 2: {exponent}")
    if gain < 0:
        raise ValueError(f"the gain of a power must not be negative: {gain}")
    exponent_q31 = min(round(Fraction(exponent) * 2**31), EXPONENT_Q31_MAX)
    if gain == 0:
        return FixedPower(exponent_q31, ZERO_GAIN)
    with workprec(_PRECISION_BITS):
        logarithm = log(mpf(gain.numerator) / gain.denominator, 2)
        logarithm += (
            mpf(exponent.numerator)
            / exponent.denominator
            * log(mpf(base.numerator) / base.denominator, 2)
        )
        scale_q24 = int(nint(logarithm * 2**24))
    if not ZERO_GAIN < scale_q24 <= SCALE_Q24_MAX:
        raise ValueError(
            "the gain of a power must be from 2^-128 to 2^128 in the integers' units (or zero), "
            f"not 2^{float(logarithm):.1f}: choose other units for x or for the result"
        )
    return FixedPower(exponent_q31, scale_q24)


def magnitude_bound(stored: FixedPower, x_max: int) -> int:
    """The largest magnitude that the C can return for any x with |x| <= x_max.

    Args:
        stored: gain and exponent, as the C takes them.
        x_max: in units of x, from 0 to 2^31.

    Returns:
        A proven upper bound in units of the result, by interval arithmetic and the bound of the
        error; 2^31 - 1 where the result may saturate.

    Raises:
        ValueError: ``x_max`` is negative or no magnitude of an int32.
    """
    if not 0 <= x_max <= 2**31:
        raise ValueError(f"x_max must be from 0 to 2^31, not {x_max}")
    if x_max == 0 or stored.scale_q24 == ZERO_GAIN:
        return 0
    precision = iv.prec
    iv.prec = _PRECISION_BITS
    try:
        exponent = iv.mpf(stored.exponent_q31) / 2**31
        exponent = exponent * iv.log(iv.mpf(x_max)) / iv.log(iv.mpf(2))
        exponent += iv.mpf(stored.scale_q24) / 2**24
        result = iv.mpf(2) ** exponent * (1 + iv.mpf(tables().relative_bound)) + iv.mpf(0.5)
        with workprec(_PRECISION_BITS):
            return min(int(floor(mpf(result.b))), MAGNITUDE_MAX)
    finally:
        iv.prec = precision


def _log2_target(index: int) -> _Target:
    """31 + log2(1 + m) in Q27; the mantissa is cut, the value rounded down: on average by half."""

    def mantissa(d: int) -> mpf:
        return 1 + (mpf((index << 25) + (d << 3)) + mpf(7) / 2) / 2**31

    def value(d: int) -> mpf:
        return (31 + log(mantissa(d), 2)) * 2**27 + _ROUNDED_DOWN

    def bending(d: int) -> mpf:
        return -(mpf(2) ** 27) / (log(2) * mantissa(d) ** 2 * mpf(2) ** 56)

    return _Target(value, bending)


def _exp2_target(index: int) -> _Target:
    """2^(1 - f) in Q31, for the mean of all f that the argument may stand for."""

    def exact(d: int) -> mpf:
        return 2**31 * power(2, 1 - (mpf((index << 18) + d) + mpf(1) / 4) / 2**23)

    def value(d: int) -> mpf:
        # What is subtracted was rounded down.
        return exact(d) - _ROUNDED_DOWN

    def bending(d: int) -> mpf:
        return exact(d) * (log(2) / 2**23) ** 2

    # The C shifts them to (2^32 - 2 + 1) >> 1 = 2^31 - 1 and to 2^31 - 1 >> 31 = 0.
    return _Target(
        value,
        bending,
        first=2**32 - 2 if index == 0 else None,
        last=2**31 - 1 if index == EXP2.segments - 1 else None,
    )


def _fit(form: Form, target: _Target) -> Segment:
    """The best constant, slope and curvature under the packing, by minimax.

    Raises:
        AssertionError: the packing has no room for them.
    """
    nodes = chebyshev_nodes(form.offsets, _FIT_NODES)
    unit = 1 << form.fraction_bits
    values = [int(nint(target.value(d) * unit)) for d in nodes]
    middle, width = _FIT_NODES // 2, nodes[-1] - nodes[0]
    curved = abs(values[0] - 2 * values[middle] + values[-1])
    nearest = 2 * curved // width**2
    step = 1 << form.curvature_bits

    def constant_for(slope: int) -> int:
        if target.first is not None:
            return target.first
        if target.last is not None:
            return target.last - form.rounded_rise(slope, nodes[-1])
        gaps = [v - form.rise(slope, d) for d, v in zip(nodes, values, strict=True)]
        return (min(gaps) + max(gaps) + unit) // (2 * unit)

    def error(slope: int) -> int:
        start = constant_for(slope) * unit
        return max(abs(start + form.rise(slope, d) - v) for d, v in zip(nodes, values, strict=True))

    best: tuple[int, int] | None = None
    for curvature in range(nearest - 8, nearest + 9):
        assert 0 <= curvature < step
        chord = form.sign * (values[-1] - values[0]) // width
        secant = (chord + curvature * width) >> form.curvature_shift
        centre = secant // step * step + curvature
        slopes = range(centre - _SLOPE_STEPS * step, centre + _SLOPE_STEPS * step, step)
        slope = valley(slopes, error)
        candidate = (error(slope), slope)
        best = candidate if best is None else min(best, candidate)
    assert best is not None
    _, slope = best
    constant = constant_for(slope)
    assert 0 < (slope & (step - 1)) * width >> form.curvature_shift < slope < 2**32
    assert 0 <= constant < 2**32
    return Segment(constant, slope, _distance(form, target, constant, slope))


def _distance(form: Form, target: _Target, constant: int, slope: int) -> float:
    """A bound of the quadratic's error, roundings aside, in units of the last place."""
    unit = 1 << form.fraction_bits
    nodes = chebyshev_nodes(form.offsets, _CHECK_NODES)
    largest = max(abs(constant + mpf(form.rise(slope, d)) / unit - target.value(d)) for d in nodes)
    # Between two nodes a function exceeds its values there by gap^2/8 of its second derivative at
    # most. That of the difference is a constant less a monotone function: the ends have it.
    bending = mpf(-2 * form.sign * (slope & form.curvature_mask)) / unit
    steepest = max(abs(bending - target.bending(end)) for end in (nodes[0], nodes[-1]))
    gap = max(after - before for before, after in pairwise(nodes))
    # Rounding down c d moves the slope by less than a unit.
    moved = mpf(len(form.offsets)) / 2**form.product_shift
    return float((largest + mpf(gap) ** 2 / 8 * steepest + moved) * (1 + mpf(2) ** -40))


def _log2_error(index: int, segment: Segment) -> float:
    """A bound of the error of log2|x| in a segment."""
    steepest = 1 / (math.log(2) * (1 + index / LOG2.segments))
    cut = 3.5 * 2.0**-31 * steepest
    return (segment.error + _ROUNDED_DOWN) * 2.0**-27 + cut


def _exp2_error(index: int, segment: Segment) -> float:
    """A bound of the relative error of 2^(1 - f) in a segment."""
    smallest = math.ldexp(2 ** (1 - (index + 1) / EXP2.segments), 31)
    return (segment.error + _ROUNDED_DOWN) / smallest


def leading_zeros() -> tuple[int, ...]:
    """The table for cores that don't count them: by the highest bits of 2^k - 1 hashed."""
    hashed = {((2**k - 1) * HASH_FACTOR % 2**32) >> 27: 32 - k for k in range(1, 33)}
    return tuple(hashed[i] for i in range(32))


def template_values() -> dict[str, Any]:
    """What the templates are given."""
    made = tables()
    return {
        "tables": made,
        "log2_form": LOG2,
        "exp2_form": EXP2,
        "hash_factor": HASH_FACTOR,
        "leading_zeros": leading_zeros(),
    }


def render(directory: Path, banner: str = "/* Integer powers on their own. */") -> tuple[Path, ...]:
    """Writes tdc.h, tdc_fixed.h and tdc_fixed.c to ``directory``; returns their paths."""
    templates = environment()
    paths = tuple(directory / name for name in ("tdc.h", "tdc_fixed.h", "tdc_fixed.c"))
    for path in paths:
        template = templates.get_template(f"{path.name}.j2")
        path.write_text(template.render(banner=banner, **template_values()), encoding="utf-8")
    return paths


def main(arguments: Sequence[str] | None = None) -> int:
    """``python -m codegen.sig_pow_fixed``: the error's bound and the size of the tables."""
    parser = argparse.ArgumentParser(
        prog="python -m codegen.sig_pow_fixed",
        description="How accurate the power for integers is, and how large its tables are.",
    )
    parser.parse_args(arguments)
    made = tables()
    print(
        f"bound: relative 2^{made.log2_relative_bound:.2f}, and half a unit of the result"
        " (exponent and gain as stored)"
    )
    print(f"log2|x|: 2^{math.log2(made.log2_bound):.2f}")
    print(f"tables: {made.size} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
