"""The structures of floating-point C as data, and the values that a controller puts into them."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from codegen.arithmetic import Real
from codegen.controller import Controller, Joint
from codegen.exact import binary32, binary64
from codegen.law import GAINS, LawOptions
from codegen.sig_pow import exponent_q31
from codegen.sig_pow64 import exponent64
from codegen.structs import Field, Layout, Range, Scalar, Struct, assemble

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


def _gain(name: str, real: Real) -> Field:
    gain, range_ = GAINS[name], _GAIN_RANGES[name]
    kind = Scalar(real.exponent if range_ in _EXPONENT_RANGES else real.type)
    field_name = name + _UNIT_SUFFIX.get(gain.unit, "")
    return Field(field_name, kind, gain.meaning, gain.unit, range=range_, quantity=name)


def floating_layout(controller: Controller) -> Layout:
    """The structures of a controller in floating-point C."""
    options, real, joints = controller.options, controller.arithmetic.real, len(controller.joints)
    joint_state = _joint_state(options, Scalar(real.type))
    return assemble(
        _joint_config(options, real),
        joint_state,
        _input(options, joints, Scalar(real.type)),
        _scale(options, Scalar(real.type)),
        joints,
    )


def _joint_config(options: LawOptions, real: Real) -> Struct:
    names = [name for name in GAINS if name != "low_pass_ratio" or options.low_pass]
    return Struct(
        "joint_config",
        "The gains of one joint; all may be tuned while the controller runs.",
        (
            *(_gain(name, real) for name in names),
            Field(
                "max_displacement",
                Scalar.INT32,
                "largest plausible change of counts in a tick",
                "count",
                range=Range.DISPLACEMENT,
            ),
            Field(
                "max_displacement_change",
                Scalar.INT32,
                "largest plausible change of that from tick to tick",
                "count",
                range=Range.DISPLACEMENT,
            ),
        ),
    )


def _joint_state(options: LawOptions, real: Scalar) -> Struct:
    fields = [
        Field("counts", Scalar.INT32, "position at the last tick", "count"),
        Field("displacement", Scalar.INT32, "q(t-L) - q(t-2L)", "count"),
    ]
    if options.acceleration == "delayed":
        fields.append(Field("displacement_change", Scalar.INT32, "last second difference", "count"))
    if options.velocity_error == "error-difference":
        fields.append(Field("error_q8", Scalar.INT32, "position error at t-L", "count/256"))
    if options.velocity_error == "half-sample":
        fields.append(Field("reference_velocity_rad_per_s", real, "qd_d(t-L)", "rad/s"))
    fields += [
        Field("sliding_integral_rad_per_s", real, "s - ed, integral part of (26)", "rad/s"),
        Field("applied_torque_Nm", real, "tau(t-L), as applied after saturation", "N m"),
    ]
    return Struct("joint_state", "What one joint remembers from tick to tick.", tuple(fields))


def _input(options: LawOptions, joints: int, real: Scalar) -> Struct:
    fields = [
        Field("counts", Scalar.INT32, "measured position; may wrap", "count", joints),
        Field(
            "reference_position_q8",
            Scalar.INT32,
            "reference position in 1/256 count; wraps with the counts",
            "count/256",
            joints,
        ),
        Field("reference_velocity_rad_per_s", real, "qd_d(t) of the joint", "rad/s", joints),
        Field(
            "reference_acceleration_rad_per_s2",
            real,
            "qdd_d(t) of the joint",
            "rad/s^2",
            joints,
        ),
    ]
    if options.torque_report:
        fields.append(
            Field(
                "applied_torque_Nm",
                real,
                "torque that the drive reports for the last tick",
                "N m",
                joints,
            )
        )
    return Struct("input", "What the controller is told at each tick.", tuple(fields))


def _scale(options: LawOptions, real: Scalar) -> Struct:
    difference = "1/256 count" if options.velocity_error == "error-difference" else "count"
    return Struct(
        "scale",
        "From counts to SI units, fixed by the encoder and the sample time.",
        (
            Field("position", real, "angle of 1/256 count", "rad", quantity="position"),
            Field(
                "velocity",
                real,
                f"velocity of one {difference} a tick",
                "rad/s",
                quantity="velocity",
            ),
            Field(
                "acceleration",
                real,
                "acceleration of one count a tick a tick",
                "rad/s^2",
                quantity="acceleration",
            ),
        ),
    )


# --- The values of a controller ----------------------------------------------------------------

FieldValue = float | int | tuple[float, float]
"""A number as the C holds it: real, integer, or an exponent in two parts."""


def floating_config_values(controller: Controller, joint: Joint) -> dict[str, FieldValue]:
    """The default configuration of a joint in floating-point C, by field name."""
    real = controller.arithmetic.real
    exact = {name: getattr(joint, _attribute(name)) for name in GAINS if name != "low_pass_ratio"}
    if controller.low_pass_ratio is not None:
        exact["low_pass_ratio"] = controller.low_pass_ratio
    values: dict[str, FieldValue] = {
        "max_displacement": joint.max_displacement,
        "max_displacement_change": controller.max_displacement_change(joint),
    }
    for field in _joint_config(controller.options, real).fields:
        if field.quantity is not None:
            values[field.name] = scalar_value(field, exact[field.quantity])
    return values


_ENCODERS: dict[Scalar, Callable[[Fraction], FieldValue]] = {
    Scalar.FLOAT: binary32,
    Scalar.DOUBLE: binary64,
    Scalar.EXPONENT: exponent_q31,
    Scalar.EXPONENT64: exponent64,
}


def scalar_value(field: Field, value: Fraction) -> FieldValue:
    """The value as the field holds it: a - 1 for an exponent, else the nearest number."""
    assert isinstance(field.type, Scalar)
    return _ENCODERS[field.type](value)


def scale_values(controller: Controller, joint: Joint) -> dict[str, float]:
    """The conversion factors of a joint, by field name."""
    nearest = controller.arithmetic.real.round
    sample_time = float(controller.sample_time)
    difference = 256.0 if controller.options.velocity_error == "error-difference" else 1.0
    return {
        "position": nearest(joint.rad_per_count / 256.0),
        "velocity": nearest(joint.rad_per_count / sample_time / difference),
        "acceleration": nearest(joint.rad_per_count / sample_time**2),
    }


def common_scale(controller: Controller) -> dict[str, float] | None:
    """The conversion factors of every joint where all have the same, else None.

    Constants in the code are cheaper than a table of them, and leave a register free.
    """
    first, *others = (scale_values(controller, joint) for joint in controller.joints)
    return first if all(other == first for other in others) else None


def _attribute(gain: str) -> str:
    return "lambda_" if gain == "lambda" else gain
