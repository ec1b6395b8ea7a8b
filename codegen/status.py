"""What a function of the generated C returns: one table for the header and for every binding."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Zero or positive is good, negative is an error; the names are the C's without ``TDC_``."""

    meaning: str

    def __new__(cls, value: int, meaning: str) -> Status:
        """A member with its meaning, as the header says it."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.meaning = meaning
        return member

    OK = 0, "torque is valid"
    SATURATED = 1, "torque is valid; at least one joint is at its limit"
    BAD_ARGUMENT = -1, "a pointer is NULL"
    BAD_CONFIG = -2, "the configuration breaks a rule of its header"
    NOT_INITIALISED = -3, "init has not filled this state"
    ENCODER_JUMP = -4, "lost tick: a joint moved further or otherwise than is plausible"
    NOT_FINITE = -5, "lost tick: an input is NaN or infinite, or the torque overflows"
    OUT_OF_RANGE = -6, "lost tick, fixed-point: an input is beyond its range"
    STOPPED = -7, "too many ticks in a row were lost; only init helps"


LOST = frozenset({Status.ENCODER_JUMP, Status.NOT_FINITE, Status.OUT_OF_RANGE})
"""Of a tick whose torque isn't the law's, and after which the controller goes on by itself."""
