"""The vocabulary of the generated C's structures: scalar types, ranges, fields, structures."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from codegen.exact import LOST_TICKS_MAX


class Scalar(Enum):
    """The scalar types of the interface, by their C names."""

    FLOAT = "float"
    DOUBLE = "double"
    INT32 = "int32_t"
    UINT32 = "uint32_t"
    EXPONENT = "tdc_exponent"
    EXPONENT64 = "tdc_exponent64"
    FIXED_POWER = "tdc_fixed_power"


class Range(Enum):
    """Which values the run-time check takes, in words."""

    POSITIVE = "greater than 0"
    NOT_NEGATIVE = "0 or greater"
    RATIO = "greater than 0, at most 1"
    RESTORING_EXPONENT = "greater than 0, below 2"
    EXPONENT = "0 or greater, below 2"
    DISPLACEMENT = "1 to 2^30 - 1"
    FACTOR = "not 0; with the powers: no torque overflows"
    TORQUE_LIMIT = "greater than 0, at most MAX_TORQUE"
    FIXED_DISPLACEMENT = "1 to MAX_DISPLACEMENT"
    FIXED_RATIO = "greater than 0, at most 2^30"
    ON_ERROR = "TDC_HOLD_TORQUE or TDC_ZERO_TORQUE"
    LOST_TICKS = f"1 to {LOST_TICKS_MAX}"
    SWITCH = "0 or 1"
    IDENTITY = "as in the default configuration"


@dataclass(frozen=True)
class Field:
    """A field of a structure.

    Attributes:
        name: its C name, with the unit where it has one.
        type: a scalar type, or a structure.
        doc: a plain sentence.
        unit: its unit, empty for a pure number.
        count: how many elements, None for a single one.
        per_joint: whether these are one for each joint.
        range: what the run-time check takes, None where any value is taken.
        quantity: the law's name of the value (``codegen.law``), None where it has none.
    """

    name: str
    type: Scalar | Struct
    doc: str
    unit: str = ""
    count: int | None = None
    range: Range | None = None
    quantity: str | None = None
    per_joint: bool = True


@dataclass(frozen=True)
class Struct:
    """A structure of the interface, by its C name without the controller's prefix."""

    name: str
    doc: str
    fields: tuple[Field, ...]


@dataclass(frozen=True)
class Layout:
    """All structures of one controller; ``scale`` is private to the generated C file."""

    joint_config: Struct
    config: Struct
    joint_state: Struct
    joint_memory: Struct
    state: Struct
    input: Struct
    scale: Struct

    @property
    def public(self) -> tuple[Struct, ...]:
        """The structures of the header, in the order of their declaration."""
        return (
            self.joint_config,
            self.config,
            self.joint_state,
            self.joint_memory,
            self.state,
            self.input,
        )


def assemble(
    joint_config: Struct, joint_state: Struct, input_: Struct, scale: Struct, joints: int
) -> Layout:
    """All structures of a controller, from those that depend on how it computes."""
    joint_memory = _joint_memory(joint_state)
    return Layout(
        joint_config,
        _config(joint_config, joints),
        joint_state,
        joint_memory,
        _state(joint_memory, joints),
        input_,
        scale,
    )


def _config(joint_config: Struct, joints: int) -> Struct:
    return Struct(
        "config",
        "What the firmware engineer sets. The user owns it; the controller only reads it.",
        (
            Field(
                "specification",
                Scalar.UINT32,
                "identity of the specification that it was made for",
                range=Range.IDENTITY,
            ),
            Field(
                "on_error",
                Scalar.UINT32,
                "the torque after an error: the last one held, or zero",
                range=Range.ON_ERROR,
            ),
            Field(
                "max_lost_ticks",
                Scalar.UINT32,
                "lost ticks in a row before TDC_STOPPED",
                range=Range.LOST_TICKS,
            ),
            Field(
                "anti_windup",
                Scalar.UINT32,
                "whether the sliding variable of a saturated joint stops integrating",
                range=Range.SWITCH,
            ),
            Field("joint", joint_config, "gains of each joint", count=joints),
        ),
    )


def _joint_memory(joint_state: Struct) -> Struct:
    return Struct(
        "joint_memory",
        "The last good tick's memory of a joint, and room for the next one.",
        (
            Field(
                "tick",
                joint_state,
                "the last good one's index is the lowest bit of the phase",
                count=2,
                per_joint=False,
            ),
        ),
    )


def _state(joint_memory: Struct, joints: int) -> Struct:
    return Struct(
        "state",
        "The controller's memory. The user owns it and leaves it alone; init fills it.",
        (
            Field("phase", Scalar.UINT32, "one of TDC_PHASE_..., after init TDC_PHASE_START"),
            Field(
                "lost_ticks",
                Scalar.UINT32,
                "how many in a row, while the phase is TDC_PHASE_START or TDC_PHASE_LOST",
            ),
            Field(
                "saturated_joints", Scalar.UINT32, "bit i is set while joint i is cut to its limit"
            ),
            Field("joint", joint_memory, "memory of each joint", count=joints),
        ),
    )
