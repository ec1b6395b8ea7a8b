"""The structures of the generated C as data: one table for the header and for every binding.

The C header, the default configuration, the run-time check and the ctypes binding are all made
from :func:`layout`; no structure is typed twice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

from codegen.controller import Controller, Joint
from codegen.exact import binary32
from codegen.law import GAINS, LawOptions
from codegen.sig_pow import exponent_q31


class Scalar(Enum):
    """The scalar types of the interface, by their C names; all are four bytes wide."""

    FLOAT = "float"
    INT32 = "int32_t"
    UINT32 = "uint32_t"
    EXPONENT = "tdc_exponent"


class Range(Enum):
    """Which values the run-time check takes, in words."""

    POSITIVE = "greater than 0"
    NOT_NEGATIVE = "0 or greater"
    RATIO = "greater than 0, at most 1"
    RESTORING_EXPONENT = "greater than 0, below 2"
    EXPONENT = "0 or greater, below 2"
    DISPLACEMENT = "1 to 2^30"
    ON_ERROR = "TDC_HOLD_TORQUE or TDC_ZERO_TORQUE"
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


_UNIT_SUFFIX = {"kg m^2": "_kgm2", "N m": "_Nm", "rad/s": "_rad_per_s", "rad/s^2": "_rad_per_s2"}

_GAIN_RANGES = {
    "inertia": Range.POSITIVE,
    "kd": Range.NOT_NEGATIVE,
    "kp": Range.NOT_NEGATIVE,
    "lambda": Range.NOT_NEGATIVE,
    "alpha": Range.RESTORING_EXPONENT,
    "beta": Range.RESTORING_EXPONENT,
    "gamma": Range.EXPONENT,
    "torque_limit": Range.POSITIVE,
    "low_pass_ratio": Range.RATIO,
}
_EXPONENT_RANGES = (Range.RESTORING_EXPONENT, Range.EXPONENT)


def _gain(name: str) -> Field:
    gain, range_ = GAINS[name], _GAIN_RANGES[name]
    kind = Scalar.EXPONENT if range_ in _EXPONENT_RANGES else Scalar.FLOAT
    field_name = name + _UNIT_SUFFIX.get(gain.unit, "")
    return Field(field_name, kind, gain.meaning, gain.unit, range=range_, quantity=name)


def layout(options: LawOptions, joints: int) -> Layout:
    """The structures of a controller with these options and this number of joints."""
    joint_config = _joint_config(options)
    joint_state = _joint_state(options)
    joint_memory = _joint_memory(joint_state)
    return Layout(
        joint_config,
        _config(joint_config, joints),
        joint_state,
        joint_memory,
        _state(joint_memory, joints),
        _input(options, joints),
        _scale(options),
    )


def _joint_config(options: LawOptions) -> Struct:
    names = [name for name in GAINS if name != "low_pass_ratio" or options.low_pass]
    return Struct(
        "joint_config",
        "The gains of one joint; all may be tuned while the controller runs.",
        (
            *(_gain(name) for name in names),
            Field(
                "max_displacement",
                Scalar.INT32,
                "largest plausible change of counts in a tick",
                "count",
                range=Range.DISPLACEMENT,
            ),
        ),
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
            Field("joint", joint_config, "gains of each joint", count=joints),
        ),
    )


def _joint_state(options: LawOptions) -> Struct:
    fields = [
        Field("counts", Scalar.INT32, "position at the last tick", "count"),
        Field("displacement", Scalar.INT32, "q(t-L) - q(t-2L)", "count"),
    ]
    if options.acceleration == "delayed":
        fields.append(Field("displacement_change", Scalar.INT32, "last second difference", "count"))
    if options.velocity_error == "error-difference":
        fields.append(Field("error_q8", Scalar.INT32, "position error at t-L", "count/256"))
    if options.velocity_error == "half-sample":
        fields.append(Field("reference_velocity_rad_per_s", Scalar.FLOAT, "qd_d(t-L)", "rad/s"))
    fields += [
        Field("sliding_integral_rad_per_s", Scalar.FLOAT, "s - ed, integral part of (26)", "rad/s"),
        Field("applied_torque_Nm", Scalar.FLOAT, "tau(t-L), as applied after saturation", "N m"),
    ]
    return Struct("joint_state", "What one joint remembers from tick to tick.", tuple(fields))


def _joint_memory(joint_state: Struct) -> Struct:
    return Struct(
        "joint_memory",
        "The last tick's memory of a joint, and room for the next one.",
        (
            Field(
                "tick",
                joint_state,
                "the last one's index is the lowest bit of the phase",
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
            Field("phase", Scalar.UINT32, "TDC_PHASE_START or TDC_PHASE_RUNNING after init"),
            Field("saturated_joints", Scalar.UINT32, "bit i is set while joint i is cut to its limit"),
            Field("joint", joint_memory, "memory of each joint", count=joints),
        ),
    )


def _input(options: LawOptions, joints: int) -> Struct:
    fields = [
        Field("counts", Scalar.INT32, "measured position; may wrap", "count", joints),
        Field(
            "reference_position_q8",
            Scalar.INT32,
            "reference position in 1/256 count; wraps with the counts",
            "count/256",
            joints,
        ),
        Field(
            "reference_velocity_rad_per_s", Scalar.FLOAT, "qd_d(t) of the joint", "rad/s", joints
        ),
        Field(
            "reference_acceleration_rad_per_s2",
            Scalar.FLOAT,
            "qdd_d(t) of the joint",
            "rad/s^2",
            joints,
        ),
    ]
    if options.torque_report:
        fields.append(
            Field(
                "applied_torque_Nm",
                Scalar.FLOAT,
                "torque that the drive reports for the last tick",
                "N m",
                joints,
            )
        )
    return Struct("input", "What the controller is told at each tick.", tuple(fields))


def _scale(options: LawOptions) -> Struct:
    difference = "1/256 count" if options.velocity_error == "error-difference" else "count"
    return Struct(
        "scale",
        "From counts to SI units, fixed by the encoder and the sample time.",
        (
            Field("position", Scalar.FLOAT, "angle of 1/256 count", "rad", quantity="position"),
            Field(
                "velocity",
                Scalar.FLOAT,
                f"velocity of one {difference} a tick",
                "rad/s",
                quantity="velocity",
            ),
            Field(
                "acceleration",
                Scalar.FLOAT,
                "acceleration of one count a tick a tick",
                "rad/s^2",
                quantity="acceleration",
            ),
        ),
    )


# --- The values of a controller ----------------------------------------------------------------

FieldValue = float | int
"""A binary32 number for floats, an integer for all other scalars."""


def joint_config_values(controller: Controller, joint: Joint) -> dict[str, FieldValue]:
    """The default configuration of a joint, by field name."""
    exact = {name: getattr(joint, _attribute(name)) for name in GAINS if name != "low_pass_ratio"}
    if controller.low_pass_ratio is not None:
        exact["low_pass_ratio"] = controller.low_pass_ratio
    values: dict[str, FieldValue] = {"max_displacement": joint.max_displacement}
    for field in _joint_config(controller.options).fields:
        if field.quantity is not None:
            values[field.name] = scalar_value(field, exact[field.quantity])
    return values


def scalar_value(field: Field, value: Fraction) -> FieldValue:
    """The value as the field holds it: Q31 of a - 1 for an exponent, else binary32."""
    encode: Callable[[Fraction], FieldValue] = (
        exponent_q31 if field.type is Scalar.EXPONENT else binary32
    )
    return encode(value)


def scale_values(controller: Controller, joint: Joint) -> dict[str, float]:
    """The conversion factors of a joint, by field name."""
    sample_time = float(controller.sample_time)
    difference = 256.0 if controller.options.velocity_error == "error-difference" else 1.0
    return {
        "position": binary32(joint.rad_per_count / 256.0),
        "velocity": binary32(joint.rad_per_count / sample_time / difference),
        "acceleration": binary32(joint.rad_per_count / sample_time**2),
    }


def common_scale(controller: Controller) -> dict[str, float] | None:
    """The conversion factors of every joint where all have the same, else None.

    Constants in the code are cheaper than a table of them, and leave a register free.
    """
    first, *others = (scale_values(controller, joint) for joint in controller.joints)
    return first if all(other == first for other in others) else None


def _attribute(gain: str) -> str:
    return "lambda_" if gain == "lambda" else gain
