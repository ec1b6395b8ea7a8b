"""How the generated C computes: which numbers, and how exactly it takes powers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from codegen.exact import binary32, binary64
from codegen.literals import double_literal, float_literal

Kind = Literal["floating-point", "fixed-point"]
Precision = Literal["float32", "float64"]
Accuracy = Literal["standard", "precise"]


@dataclass(frozen=True)
class Arithmetic:
    """What a specification asks for.

    Attributes:
        kind: floating-point, or fixed-point for cores without an FPU.
        precision: of a floating-point number; float64 is for cores with a double FPU.
        accuracy: of the powers in float32; see `codegen.sig_pow` and `codegen.sig_pow_precise`.
    """

    kind: Kind = "floating-point"
    precision: Precision = "float32"
    accuracy: Accuracy = "standard"

    @property
    def real(self) -> Real:
        """The floating-point numbers of the C."""
        if self.precision == "float64":
            return FLOAT64
        return FLOAT32_PRECISE if self.accuracy == "precise" else FLOAT32

    @property
    def torque(self) -> str:
        """The C type of a torque."""
        return "int32_t" if self.kind == "fixed-point" else self.real.type


@dataclass(frozen=True)
class Real:
    """A kind of floating-point number in C, and the functions for it.

    Attributes:
        type: its name in C.
        exponent: the type of an exponent of sig().
        power: the function for sig(x)^a.
        suffix: of the helpers in ``tdc.h`` and of those for other numbers.
        largest: the macro of the largest number.
        files: of the shared C, those that it needs besides ``tdc.h``.
        round: the nearest number.
        literal: its shortest literal.
    """

    type: str
    exponent: str
    power: str
    suffix: str
    largest: str
    files: tuple[str, ...]
    round: Callable[[Fraction | float], float]
    literal: Callable[[float], str]


FLOAT32 = Real(
    "float",
    "tdc_exponent",
    "tdc_sig_pow",
    "",
    "FLT_MAX",
    ("tdc_sig_pow.h", "tdc_sig_pow.c"),
    binary32,
    float_literal,
)
FLOAT32_PRECISE = Real(
    "float",
    "tdc_exponent",
    "tdc_sig_pow_precise",
    "",
    "FLT_MAX",
    ("tdc_sig_pow_precise.h", "tdc_sig_pow_precise.c"),
    binary32,
    float_literal,
)
FLOAT64 = Real(
    "double",
    "tdc_exponent64",
    "tdc_sig_pow64",
    "64",
    "DBL_MAX",
    ("tdc64.h", "tdc_sig_pow64.h", "tdc_sig_pow64.c"),
    binary64,
    double_literal,
)
