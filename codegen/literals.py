"""Numbers as C literals: the shortest text that is read back as the same number."""

from __future__ import annotations

import math

from codegen.exact import binary32


class UnprintableError(Exception):
    """The law contains something that has no C, or no name where it needs one."""


def float_literal(value: float) -> str:
    """The shortest C literal of a binary32 number, with suffix ``f``.

    Raises:
        UnprintableError: the number is not finite or not exactly binary32.
    """
    if not math.isfinite(value) or binary32(value) != value:
        raise UnprintableError(
            f"{value!r} is no binary32 number: make it an input of the law, which is rounded once"
        )
    candidates = (float(f"{value:.{digits}g}") for digits in range(1, 10))
    shortest = next(c for c in candidates if _rounds_to(c, value))
    return f"{shortest!r}f"


def _rounds_to(candidate: float, value: float) -> bool:
    try:
        return binary32(candidate) == value
    except OverflowError:  # a short decimal just beyond the largest binary32 number
        return False


def double_literal(value: float) -> str:
    """The shortest C literal of a binary64 number.

    Raises:
        UnprintableError: the number is not finite.
    """
    if not math.isfinite(value):
        raise UnprintableError(f"{value!r} is no number")
    return repr(value)
