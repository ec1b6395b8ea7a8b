"""Both integer halves of the compiled C at every argument.

The C's own statements, cut out of the generated function, are compiled as two functions. What
they give is compared with log2 and exp2 at all 2^23 mantissas and all 2^23 fractions; and every
other exponent is shown to give the same integers, moved by the exponent.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
from flint import arb, ctx
from numpy.typing import NDArray

from plant.native import FLAGS, CompilerError, compiler
from verification.certificates.sig_pow.kernel import BIAS, MANTISSA_BITS, Correction
from verification.certificates.sig_pow.prove import (
    PER_UNIT,
    PIECES,
    Half,
    Proof,
    Statement,
    round_down,
)
from verification.evidence import Evidence

Words = NDArray[np.int64]
Doubles = NDArray[np.float64]

COUNT = 1 << MANTISSA_BITS
_BLOCK = 1 << 12
_TERMS = 5
_PRECISION_BITS = 120
_TOLERANCE = 2.0**-20
"""In units: what Taylor's remainder and double precision may spoil; `_exact` derives less."""

_HALVES_C = r"""
#include <stddef.h>
#include "%(header)s"

static int32_t logarithm_of(uint32_t bits_of_x)
{
    float x;
    memcpy(&x, &bits_of_x, sizeof x);
    %(log2)s
    return logarithm;
}

static uint32_t multiplier_of(uint32_t field)
{
    %(exp2)s
    return bits;
}

/* e = 0: x in [1, 2). */
void logarithms(int32_t *result)
{
    for (uint32_t k = 0; k < (1u << 23); ++k) {
        result[k] = logarithm_of((127u << 23) | k);
    }
}

void multipliers(uint32_t *result)
{
    for (uint32_t k = 0; k < (1u << 23); ++k) {
        result[k] = multiplier_of((126u << 23) | k);
    }
}

/* How many normal floats have another logarithm than that of their mantissa plus exponent. */
uint64_t odd_logarithms(const int32_t *at_zero)
{
    uint64_t odd = 0;
    for (uint32_t bits = 1u << 23; bits < (255u << 23); ++bits) {
        const int32_t exponent = (int32_t)(bits >> 23) - 127;
        odd += logarithm_of(bits) != at_zero[bits & 0x7FFFFFu] + exponent * 0x1000000;
    }
    return odd;
}

uint64_t odd_multipliers(const uint32_t *at_one)
{
    uint64_t odd = 0;
    for (uint32_t field = 0; field < (254u << 23); ++field) {
        const uint32_t moved = at_one[field & 0x7FFFFFu] - (126u << 23) + (field & ~0x7FFFFFu);
        odd += multiplier_of(field) != moved;
    }
    return odd;
}
"""


@dataclass(frozen=True)
class Integers:
    """What the compiled halves give, and how many arguments break the rule of the exponent."""

    logarithms: NDArray[np.int32]
    multipliers: NDArray[np.uint32]
    odd_logarithms: int
    odd_multipliers: int


def can_try_all(proof: Proof) -> bool:
    """Whether exp2's arguments are few enough: not those of a product in more than Q23."""
    return proof.generated.kernel.product.fraction_bits == MANTISSA_BITS


def integers(proof: Proof) -> Integers:
    """Compiles and runs both halves; about ten seconds.

    Raises:
        CompilerError: the compiler is missing or refuses the C.
    """
    generated = proof.generated
    kernel = generated.kernel
    text = _HALVES_C % {"header": kernel.header, "log2": kernel.log2.c, "exp2": kernel.exp2.c}
    with tempfile.TemporaryDirectory() as scratch:
        source, library = Path(scratch, "halves.c"), Path(scratch, "halves.so")
        source.write_text(text, encoding="utf-8")
        files = (str(source), str(generated.directory / kernel.source), "-o", str(library))
        command = [compiler(), *FLAGS, f"-I{generated.directory}", *files]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise CompilerError(f"the halves of {kernel.function}:\n{done.stderr}")
        halves = ctypes.CDLL(str(library))
        logarithms = np.empty(COUNT, np.int32)
        multipliers = np.empty(COUNT, np.uint32)
        halves.logarithms(logarithms.ctypes)
        halves.multipliers(multipliers.ctypes)
        odd = []
        for name, table in (("odd_logarithms", logarithms), ("odd_multipliers", multipliers)):
            count = getattr(halves, name)
            count.restype = ctypes.c_uint64
            odd.append(int(count(table.ctypes)))
    return Integers(logarithms, multipliers, *odd)


def _exact(stage: Correction, first: int, step: int) -> tuple[int, Doubles]:
    """The corrected number at a block of arguments: a whole part, and the rest in double.

    Taylor's polynomial of fourth degree around the block's middle. With s the distance by the
    whole, at most 2^-12: the remainder of log2 is 2^24 s^5 / (5 ln 2) and that of exp2
    2^24 (s ln 2)^5 / 120, both below 2^-37. The rest is below 2^14, in double good to 2^-35.
    """
    middle = first + step * _BLOCK // 2
    unit = arb(1 << stage.fraction_bits)
    ln2 = arb(2).log()
    shift = stage.argument_shift
    at = (arb(middle) + arb(shift.numerator) / shift.denominator) / unit
    coefficients: list[arb]
    if step == 2:
        coefficients = [(1 + at).log() / ln2]
        coefficients += [arb(-1) ** (n + 1) / (ln2 * n * (1 + at) ** n) for n in range(1, _TERMS)]
    else:
        power = (at * ln2).exp()
        coefficients = [power - 1]
        factor = arb(1)
        for n in range(1, _TERMS):
            factor = factor * ln2 / n
            coefficients.append(power * factor)
    scaled = [c * unit for c in coefficients]
    whole = round_down(scaled[0])
    distances = (np.arange(_BLOCK) - _BLOCK // 2) * step / float(1 << stage.fraction_bits)
    rest: Doubles = np.zeros(_BLOCK)
    for coefficient in reversed([scaled[0] - whole, *scaled[1:]]):
        rest = rest * distances + float(coefficient.mid())
    return whole, rest


def errors(stage: Correction, computed: Words) -> Doubles:
    """Computed less exact, in units, good to `_TOLERANCE`, at every argument in [0, 1).

    Args:
        stage: log2 or exp2.
        computed: the corrected fraction as the C has it, for each argument.
    """
    step = (1 << stage.fraction_bits) // len(computed)
    precision = ctx.prec
    ctx.prec = _PRECISION_BITS
    try:
        parts = []
        for start in range(0, len(computed), _BLOCK):
            whole, rest = _exact(stage, start * step, step)
            parts.append((computed[start : start + _BLOCK] - whole) - rest)
    finally:
        ctx.prec = precision
    return np.concatenate(parts)


def inside(stage: Correction, half: Half, error: Doubles) -> bool:
    """Whether every error is within the bounds that were proved for its piece."""
    below, above = stage.rounding
    by_piece = error.reshape(PIECES, -1)
    low = np.array(half.low) / PER_UNIT + float(below) - _TOLERANCE
    high = np.array(half.high) / PER_UNIT + float(above) + _TOLERANCE
    return bool((by_piece >= low[:, None]).all() and (by_piece <= high[:, None]).all())


def statements(proof: Proof, found: Integers) -> Iterator[Statement]:
    """What was found at every argument, beside what was proved."""
    kernel = proof.generated.kernel
    corrected = (
        ("log2", kernel.log2, proof.log2, found.logarithms.astype(np.int64)),
        ("exp2", kernel.exp2, proof.exp2, found.multipliers.astype(np.int64) - (BIAS << 23)),
    )
    what = {
        "log2": "the logarithm of all 2^23 mantissas",
        "exp2": "the multiplier of all 2^23 fractions",
    }
    for name, stage, half, computed in corrected:
        error = errors(stage, computed)
        low, high = Fraction(float(error.min())), Fraction(float(error.max()))
        yield Statement(
            f"{name}_every_argument",
            f"The compiled C gives {what[name]} within the bounds proved for each piece.",
            f"{float(low):.4f} to {float(high):.4f} units",
            Evidence.EXHAUSTIVE,
            inside(stage, half, error),
        )
    for name, odd, cases in (
        ("log2", found.odd_logarithms, "normal floats"),
        ("exp2", found.odd_multipliers, "exponent fields"),
    ):
        yield Statement(
            f"{name}_every_exponent",
            f"At all {254 << MANTISSA_BITS} {cases} the compiled C gives the same fraction, moved "
            "by the exponent.",
            f"{odd} exceptions",
            Evidence.EXHAUSTIVE,
            odd == 0,
        )
