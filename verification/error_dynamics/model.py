"""The desired error dynamics (17) of one joint, with exact numbers, and what kind of motion it has.

    edd + KD sig(ed)^alpha + KP sig(e)^beta = 0,    KD, KP > 0,    alpha, beta >= 0

Where an exponent is 0 the term is a sign, and a solution is one in Filippov's sense: at a jump the
term may take any value between -1 and 1.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import TypeAlias

FINITE_TIME = "finite-time"
"""As an exponent beta: alpha / (2 - alpha), exactly (35)."""

LARGEST = 10**9
"""Of a gain, of its inverse and of an exponent's denominator: beyond, a unit must be wrong."""
EXPONENT_LARGEST = 100

_NUMBER = re.compile(r"([+-]?\d{1,40})/(\d{1,40})|[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,2})?")


Number: TypeAlias = Fraction | Decimal | int | float | str


class ErrorDynamicsError(Exception):
    """A number that no error dynamics can have; the message says what would do."""


def number(name: str, value: Number) -> Fraction:
    """A number exactly as it is written: 0.95 is 19/20, not the double next to it.

    Args:
        name: of the quantity, for the message.
        value: a fraction or decimal as text, or a number; a float stands for its shortest decimal.

    Raises:
        ErrorDynamicsError: it is not a finite number.
    """
    text = str(value).strip()
    if len(text) <= 100 and _NUMBER.fullmatch(text) and not text.endswith("/0"):
        try:
            return Fraction(text)
        except ZeroDivisionError:
            pass
    raise ErrorDynamicsError(
        f"{name}: {text[:40]!r} is not a number; write a decimal or a fraction, as 0.95 or 19/20"
    )


def finite_time_beta(alpha: Fraction) -> Fraction:
    """The exponent of the position error that makes the dynamics homogeneous (35)."""
    return alpha / (2 - alpha)


@dataclass(frozen=True)
class Parameters:
    """Gains and exponents of one joint's desired error dynamics (17), exact.

    Attributes:
        KD: damping gain, in (rad/s)^(1 - alpha) / s.
        KP: stiffness gain, in rad^(1 - beta) / s^2.
        alpha: exponent of the velocity error.
        beta: exponent of the position error.
    """

    KD: Fraction
    KP: Fraction
    alpha: Fraction
    beta: Fraction

    def __post_init__(self) -> None:
        for name in ("KD", "KP"):
            gain = getattr(self, name)
            if gain <= 0:
                raise ErrorDynamicsError(
                    f"{name.lower()} = {show(gain)}: a gain must be greater than 0; without it the "
                    "error does not converge"
                )
            if not Fraction(1, LARGEST) <= gain <= LARGEST:
                raise ErrorDynamicsError(
                    f"{name.lower()} = {show(gain)}: expected from 1e-9 to 1e9; check its unit"
                )
        for name in ("alpha", "beta"):
            exponent = getattr(self, name)
            if not 0 <= exponent <= EXPONENT_LARGEST:
                raise ErrorDynamicsError(
                    f"{name} = {show(exponent)}: an exponent must be from 0 to {EXPONENT_LARGEST}; "
                    "1 is linear, below 1 is stiffer near zero"
                )
            if 0 < exponent < Fraction(1, 1000) or exponent.denominator > LARGEST**2:
                raise ErrorDynamicsError(
                    f"{name} = {show(exponent)}: write 0, or at least 1/1000, with fewer digits"
                )

    @property
    def homogeneous(self) -> bool:
        """Whether a larger motion is the same curve, scaled: beta = alpha / (2 - alpha) (35)."""
        return 0 < self.alpha < 2 and self.beta == finite_time_beta(self.alpha)

    @property
    def linear(self) -> bool:
        """Whether it is the linear error dynamics (7)."""
        return self.alpha == self.beta == 1


def parameters(KD: Number, KP: Number, alpha: Number, beta: Number) -> Parameters:
    """Exact parameters from numbers or text; beta may be "finite-time".

    Raises:
        ErrorDynamicsError: a value is no number, out of range, or has no finite-time partner.
    """
    exponent = number("alpha", alpha)
    if beta == FINITE_TIME:
        if not 0 < exponent < 1:
            raise ErrorDynamicsError(
                f"alpha = {show(exponent)}: beta = {FINITE_TIME} is alpha/(2 - alpha) for "
                "0 < alpha < 1 (34)(35); write such an alpha, or a number for beta"
            )
        partner = finite_time_beta(exponent)
    else:
        partner = number("beta", beta)
    return Parameters(number("kd", KD), number("kp", KP), exponent, partner)


def show(value: Fraction) -> str:
    """A fraction as a short decimal where it is one, else as a fraction."""
    decimal = repr(float(value))
    return decimal.removesuffix(".0") if Fraction(decimal) == value else str(value)
