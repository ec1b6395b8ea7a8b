"""Exact numbers as pydantic types: fractions with ranges, one for all joints or one a joint."""

from __future__ import annotations

import contextlib
import math
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, WithJsonSchema

from codegen.problems import broken, show

FINITE_TIME = "finite-time"
DISPLACEMENT_MAX = 2**30 - 1
"""Counts in a tick: so that a limit and what lies within it add up to less than 2^31."""

COUNT_NOISE = 8
"""What two counts of noise in each reading come to in a second difference."""

LOST_TICKS_MAX = 2**10 - 1
"""So that what a joint moves in one more than these can be counted."""

EXPONENT_MAX = Fraction(2)
"""Exponents lie below 2: sig_pow keeps a - 1 as a signed fraction of 31 bits."""

_BINARY32_MIN = Fraction(1, 2**126)
_BINARY32_MAX = Fraction(2**24 - 1) * 2**104

_NUMBER_RULE = 'a finite number, or a fraction as text such as "95/105"'


def rational(value: object) -> Fraction:
    """An exact number from a TOML integer, decimal or fraction text."""
    if isinstance(value, str) and re.fullmatch(r"[+-]?\d{1,40}/\d{1,40}|[+-]?\d*\.?\d+", value):
        with contextlib.suppress(ZeroDivisionError):
            return _representable(Fraction(value))
    if isinstance(value, int | Fraction) and not isinstance(value, bool):
        return _representable(Fraction(value))
    if isinstance(value, Decimal) and value.is_finite():
        # As a fraction, 1e-999999999 would fill the memory.
        return _representable(Fraction(value) if abs(value.adjusted()) < 100 else None)
    if isinstance(value, float) and math.isfinite(value):
        return _representable(Fraction(value))
    raise broken(_NUMBER_RULE, f"write a number instead of {show(value)}")


def _representable(value: Fraction | None) -> Fraction:
    """The value, unless binary32 can't hold its magnitude; None is far outside."""
    if value is None or (value and not _BINARY32_MIN <= abs(value) <= _BINARY32_MAX):
        raise broken(
            "the generated C computes in binary32: 0, or a magnitude from 1.2e-38 to 3.4e38",
            "check the value's unit",
        )
    return value


@dataclass(frozen=True)
class InRange(AfterValidator):
    """A validator of numbers that says which rule it checks, for the reference of the keys."""

    rule: str = ""


def in_range(holds: Callable[[Any], bool], rule: str, fix: str) -> InRange:
    """A validator for numbers that must fulfil a rule."""

    def check(value: Any) -> Any:
        if not holds(value):
            raise broken(rule, fix)
        return value

    return InRange(check, rule)


def _finite_time_or_rational(value: object) -> Fraction | str:
    if value == FINITE_TIME:
        return FINITE_TIME
    if isinstance(value, str) and not re.search(r"\d", value):
        raise broken(
            f'a number, or "{FINITE_TIME}", which is alpha/(2 - alpha) (35)',
            f'write "{FINITE_TIME}" or a number',
        )
    return rational(value)


def _exponent_rule(name: str) -> tuple[str, str]:
    return (
        f"0 < {name} < {EXPONENT_MAX}",
        "1 is linear, the paper's best is 95/100; without restoring force (0) nothing converges",
    )


def as_list(value: object) -> object:
    """A single number as a list of one, so that a per-joint key takes either."""
    return value if isinstance(value, list | tuple) else [value]


_FRACTION = {"type": "string", "pattern": r"^[+-]?[0-9]+/[0-9]+$"}
_NUMBER_SCHEMA: dict[str, Any] = {"anyOf": [{"type": "number"}, _FRACTION]}
_BETA_SCHEMA: dict[str, Any] = {"anyOf": [*_NUMBER_SCHEMA["anyOf"], {"const": FINITE_TIME}]}


def _per_joint_schema(item: dict[str, Any]) -> WithJsonSchema:
    return WithJsonSchema(
        {"anyOf": [*item["anyOf"], {"type": "array", "items": item, "minItems": 1}]}
    )


Rational = Annotated[Fraction, BeforeValidator(rational), WithJsonSchema(_NUMBER_SCHEMA)]
Positive = Annotated[
    Rational, in_range(lambda v: v > 0, "greater than 0", "write a positive number")
]
NotNegative = Annotated[
    Rational, in_range(lambda v: v >= 0, "0 or greater", "write 0 or a positive number")
]
NotZero = Annotated[
    Rational,
    in_range(
        lambda v: v != 0, "not 0", "write the ratio; negative where the motor turns backwards"
    ),
]
Alpha = Annotated[Rational, in_range(lambda v: 0 < v < EXPONENT_MAX, *_exponent_rule("alpha"))]
Gamma = Annotated[
    Rational,
    in_range(
        lambda v: 0 <= v < EXPONENT_MAX,
        f"0 <= gamma < {EXPONENT_MAX}",
        "1 is linear, 0 is sliding mode, the paper's best is 0.4",
    ),
]
Beta = Annotated[
    Fraction | str,
    BeforeValidator(_finite_time_or_rational),
    in_range(lambda v: v == FINITE_TIME or 0 < v < EXPONENT_MAX, *_exponent_rule("beta")),
]

_PerJointNumber = (BeforeValidator(as_list), _per_joint_schema(_NUMBER_SCHEMA))
PerJointPositive = Annotated[tuple[Positive, ...], *_PerJointNumber]
PerJointNotNegative = Annotated[tuple[NotNegative, ...], *_PerJointNumber]
PerJointNotZero = Annotated[tuple[NotZero, ...], *_PerJointNumber]
PerJointAlpha = Annotated[tuple[Alpha, ...], *_PerJointNumber]
PerJointGamma = Annotated[tuple[Gamma, ...], *_PerJointNumber]
PerJointBeta = Annotated[
    tuple[Beta, ...], BeforeValidator(as_list), _per_joint_schema(_BETA_SCHEMA)
]


def binary32(value: Fraction | float) -> float:
    """The nearest binary32 number (round to even), as a Python float.

    Raises:
        OverflowError: the value lies beyond binary32.
    """
    return float(struct.unpack("<f", struct.pack("<f", float(value)))[0])


def binary64(value: Fraction | float) -> float:
    """The nearest binary64 number (round to even).

    Raises:
        OverflowError: the value lies beyond binary64.
    """
    return float(value)
