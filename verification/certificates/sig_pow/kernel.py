"""The kernels of sig_pow as stages: what the generated C computes, and the numbers in it.

A stage holds the C statements that it describes. The proof compares them with the body of the
generated function, so that it cannot speak of another C than the one that ships; the numbers come
from the generated table. Another kernel with the same stages is another `Kernel`.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

MANTISSA_BITS = 23
BIAS = 127


class KernelError(Exception):
    """The generated C is not what a kernel describes."""


@dataclass(frozen=True)
class Correction:
    """A stage that corrects a fixed-point number by a quadratic a segment, rounded down.

    The unit is the argument's last place. With the offset ``d`` in the segment, the constant
    ``C`` and the slope ``w``, whose lowest bits are the curvature ``c``, the correction is
    ``floor(C + d (w + sign c d))`` in the scales that follow.

    Attributes:
        index_bits: leading bits of the fraction that choose the segment.
        fraction_bits: of the argument.
        step: the argument is a multiple of this.
        alternating: the offset counts down from the right end of an odd segment.
        sign: of the curvature.
        curvature_bits: lowest bits of the slope.
        curvature_scale: the quadratic's coefficient is c 2^-curvature_scale.
        extra_bits: of the constant behind the unit; the sum is rounded down to the unit.
        tied: the slope is the constant's fraction as well, and everything is rounded down once.
            Otherwise both products are rounded down on their own.
        added: what the table's constant contains besides the function, in units.
        argument_shift: the function is taken at the argument and so much more.
        c: the C statements.
    """

    index_bits: int
    fraction_bits: int
    step: Fraction
    alternating: bool
    sign: int
    curvature_bits: int
    curvature_scale: int
    extra_bits: int
    tied: bool
    added: int
    argument_shift: Fraction
    c: str

    @property
    def segments(self) -> int:
        """How many there are."""
        return 1 << self.index_bits

    @property
    def width(self) -> int:
        """Of a segment, in units."""
        return 1 << (self.fraction_bits - self.index_bits)

    def origin(self, segment: int) -> int:
        """The argument at which a segment's offset is zero."""
        return (segment + (segment % 2 if self.alternating else 0)) * self.width

    @property
    def rounding(self) -> tuple[Fraction, Fraction]:
        """Bounds of the C's integer less the exact quadratic, in units."""
        # Untied, the curvature's product is rounded down by less than one, and then multiplied
        # by the offset; the two other roundings together stay below one unit.
        bent = Fraction(0) if self.tied else Fraction(self.width, 1 << 32)
        return -1 - bent, bent


@dataclass(frozen=True)
class Product:
    """The stage ``b log2|x|``, a 64-bit product, cut off after so many bits of fraction."""

    fraction_bits: int
    c: str


@dataclass(frozen=True)
class Kernel:
    """A sig_pow: ``x · 2^(b log2|x|)`` in three integer stages and one multiplication.

    Attributes:
        function: the name in C.
        table: the array's name in C.
        log2: takes exponent and mantissa as a number to log2|x|.
        product: multiplies by b = a - 1.
        exp2: takes a number to the bits of its power of two, as a float.
        c: the last statements.
    """

    function: str
    table: str
    log2: Correction
    product: Product
    exp2: Correction
    c: str

    @property
    def header(self) -> str:
        """The file that declares it."""
        return f"{self.function}.h"

    @property
    def source(self) -> str:
        """The file that holds its table."""
        return f"{self.function}.c"

    @property
    def statements(self) -> str:
        """All C statements of the stages, with single spaces."""
        return tidy(self.log2.c + self.product.c + self.exp2.c + self.c)


STANDARD = Kernel(
    function="tdc_sig_pow",
    table="tdc_sig_pow_segments",
    log2=Correction(
        index_bits=6,
        fraction_bits=24,
        step=Fraction(2),
        alternating=True,
        sign=-1,
        curvature_bits=8,
        curvature_scale=32,
        extra_bits=0,
        tied=True,
        added=-(BIAS << 24),
        argument_shift=Fraction(0),
        c="""
        const uint32_t magnitude = tdc_in_order(tdc_bits(x)) << 1u;
        const tdc_sig_pow_segment *const near_x =
            tdc_address(&tdc_sig_pow_segments[(magnitude >> 18u) & 63u]);
        const uint64_t log2_word = near_x->log2;
        const uint32_t log2_slope = (uint32_t)log2_word;
        const int32_t log2_offset = tdc_shift_right(tdc_signed(magnitude << 13u), 13u);
        const int32_t log2_tilt =
            tdc_signed(log2_slope - ((log2_slope & 0xFFu) * (uint32_t)log2_offset));
        const int64_t log2_rise = (int64_t)log2_offset * log2_tilt;
        const uint64_t log2_correction = log2_word + (uint64_t)log2_rise;
        const int32_t logarithm = tdc_signed(magnitude + (uint32_t)(log2_correction >> 32u));
        """,
    ),
    product=Product(
        fraction_bits=23,
        c="""
        const int64_t power = (int64_t)a.minus_one_q31 * logarithm;
        const uint32_t power_q23 = (uint32_t)((uint64_t)power >> 32u);
        const int32_t unclamped = tdc_signed(power_q23 + (126u * 0x800000u));
        const uint32_t field = (uint32_t)((unclamped > 0) ? unclamped : 0);
        """,
    ),
    exp2=Correction(
        index_bits=6,
        fraction_bits=23,
        step=Fraction(1),
        alternating=False,
        sign=1,
        curvature_bits=8,
        curvature_scale=32,
        extra_bits=0,
        tied=True,
        added=1 << 23,
        argument_shift=Fraction(1, 2),
        c="""
        const tdc_sig_pow_segment *const near_power =
            tdc_address(&tdc_sig_pow_segments[(field >> 17u) & 63u]);
        const uint64_t exp2_word = near_power->exp2;
        const uint32_t exp2_slope = (uint32_t)exp2_word;
        const int32_t exp2_offset = tdc_signed(field & 0x1FFFFu);
        const int32_t exp2_tilt =
            tdc_signed(exp2_slope + ((exp2_slope & 0xFFu) * (uint32_t)exp2_offset));
        const int64_t exp2_rise = (int64_t)exp2_offset * exp2_tilt;
        const uint64_t exp2_correction = exp2_word + (uint64_t)exp2_rise;
        const uint32_t bits = tdc_in_order(field + (uint32_t)(exp2_correction >> 32u));
        """,
    ),
    c="""
    float multiplier;
    (void)memcpy(&multiplier, &bits, sizeof multiplier);
    return x * multiplier;
    """,
)

PRECISE = Kernel(
    function="tdc_sig_pow_precise",
    table="tdc_precise_segments",
    log2=Correction(
        index_bits=7,
        fraction_bits=24,
        step=Fraction(2),
        alternating=True,
        sign=-1,
        curvature_bits=12,
        curvature_scale=34,
        extra_bits=10,
        tied=False,
        added=0,
        argument_shift=Fraction(0),
        c="""
        const uint32_t magnitude = tdc_in_order(tdc_bits(x)) << 1u;
        const uint64_t log2_word =
            tdc_precise_address(&tdc_precise_segments[(magnitude >> 17u) & 127u])->log2;
        const uint32_t log2_slope = (uint32_t)log2_word;
        const int32_t log2_offset = tdc_shift_right(tdc_signed(magnitude << 14u), 4u);
        const int32_t log2_bend = tdc_high_half(log2_offset, tdc_signed(log2_slope << 20u));
        const int32_t log2_tilt = tdc_signed(log2_slope - (uint32_t)log2_bend);
        const int32_t log2_correction =
            tdc_signed((uint32_t)(log2_word >> 32u) +
                       (uint32_t)tdc_high_half(log2_offset, log2_tilt));
        const int32_t logarithm = tdc_signed(magnitude - (127u * 0x1000000u) +
                                             (uint32_t)tdc_shift_right(log2_correction, 10u));
        """,
    ),
    product=Product(
        fraction_bits=33,
        c="""
        const int64_t product = (int64_t)a.minus_one_q31 * logarithm;
        const uint64_t power = (uint64_t)product;
        const int32_t unclamped = tdc_signed((uint32_t)(power >> 32u) + (126u * 0x800000u));
        const uint32_t field = (uint32_t)((unclamped > 0) ? unclamped : 0);
        """,
    ),
    exp2=Correction(
        index_bits=7,
        fraction_bits=23,
        step=Fraction(1, 1 << 10),
        alternating=True,
        sign=1,
        curvature_bits=12,
        curvature_scale=34,
        extra_bits=10,
        tied=False,
        added=0,
        argument_shift=Fraction(0),
        c="""
        const uint64_t exp2_word =
            tdc_precise_address(&tdc_precise_segments[(field >> 16u) & 127u])->exp2;
        const uint32_t exp2_slope = (uint32_t)exp2_word;
        const uint32_t field_rest = (uint32_t)power >> 22u;
        const int32_t exp2_offset =
            tdc_signed((uint32_t)tdc_shift_right(tdc_signed(field << 15u), 5u) | field_rest);
        const int32_t exp2_bend = tdc_high_half(exp2_offset, tdc_signed(exp2_slope << 20u));
        const int32_t exp2_tilt = tdc_signed(exp2_slope + (uint32_t)exp2_bend);
        const int32_t exp2_correction =
            tdc_signed((uint32_t)(exp2_word >> 32u) + field_rest +
                       (uint32_t)tdc_high_half(exp2_offset, exp2_tilt));
        const uint32_t bits = tdc_in_order(field + 0x800000u +
                                           (uint32_t)tdc_shift_right(exp2_correction, 10u));
        """,
    ),
    c=STANDARD.c,
)

KERNELS = (STANDARD, PRECISE)


@dataclass(frozen=True)
class Stated:
    """What a header promises.

    Attributes:
        ulp: largest error in units of the last place.
        relative_log2: largest relative error, as an exponent of two.
        exponent_rounding: what a rounded exponent adds, in ulp for each unit of |log2 x|.
    """

    ulp: Fraction
    relative_log2: Fraction
    exponent_rounding: Fraction


@dataclass(frozen=True)
class GeneratedKernel:
    """A kernel with the numbers of its generated C.

    Attributes:
        kernel: the stages.
        log2: the table's words of 64 bits for log2.
        exp2: the table's words for exp2.
        stated: what the header promises.
        directory: where the C stands.
    """

    kernel: Kernel
    log2: tuple[int, ...]
    exp2: tuple[int, ...]
    stated: Stated
    directory: Path

    @property
    def body_sha256(self) -> str:
        """Of the function's statements, with single spaces and without comments."""
        return hashlib.sha256(self.kernel.statements.encode()).hexdigest()


def tidy(c: str) -> str:
    """C without comments, with single spaces and none inside parentheses' ends."""
    without = re.sub(r"/\*.*?\*/|//[^\n]*", " ", c, flags=re.DOTALL)
    return " ".join(without.split())


def read(kernel: Kernel, directory: Path) -> GeneratedKernel:
    """The generated C of a kernel.

    Raises:
        KernelError: the C is another one than the stages describe.
        OSError: a file is missing.
    """
    header = (directory / kernel.header).read_text(encoding="utf-8")
    source = (directory / kernel.source).read_text(encoding="utf-8")
    signature = f"static inline float {kernel.function}(const float x, const tdc_exponent a)"
    if header.count(signature) != 1:
        raise KernelError(f"{kernel.header}: no function {kernel.function}, or two")
    body = header.split(signature)[1].split("\n}")[0]
    if tidy(body) != "{ " + kernel.statements:
        raise KernelError(
            f"{kernel.header}: {kernel.function} does not have the proof's statements"
        )
    log2, exp2 = _table(kernel, source)
    return GeneratedKernel(kernel, log2, exp2, _stated(kernel, header), directory)


def _table(kernel: Kernel, source: str) -> tuple[tuple[int, ...], tuple[int, ...]]:
    found = re.search(
        re.escape(kernel.table) + r"\[(\d+)\] = \{\n(.*?)\n\};", source, flags=re.DOTALL
    )
    if found is None:
        raise KernelError(f"{kernel.source}: no table {kernel.table}")
    pair = r"\{0x([0-9A-F]{16})u, 0x([0-9A-F]{16})u\},"
    rows = re.findall(pair, found[2])
    rest = re.sub(pair, "", found[2]).split()
    for name, stage in (("log2", kernel.log2), ("exp2", kernel.exp2)):
        if not len(rows) == int(found[1]) == stage.segments or rest:
            raise KernelError(f"{kernel.source}: {stage.segments} segments for {name} expected")
    return tuple(int(row[0], 16) for row in rows), tuple(int(row[1], 16) for row in rows)


def _stated(kernel: Kernel, header: str) -> Stated:
    text = " ".join(header.replace("*", " ").split())
    bound = re.search(r"error is at most ([\d.]+) ulp of the result, 2\^(-[\d.]+) relative", text)
    rounding = re.search(r"rounded exponent adds at most ([\d.]+) \|log2 x\| ulp", text)
    if bound is None or rounding is None:
        raise KernelError(f"{kernel.header}: states no bound")
    ulp, relative, exponent = (Fraction(Decimal(t)) for t in (*bound.groups(), rounding[1]))
    return Stated(ulp, relative, exponent)
