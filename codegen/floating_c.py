"""Floating-point C of a controller: the printed law, and what the template is given besides."""

from __future__ import annotations

import functools
from dataclasses import dataclass

from codegen import law
from codegen.arithmetic import Real
from codegen.c99 import Statement, print_law
from codegen.controller import Controller, Joint
from codegen.exact import DISPLACEMENT_MAX
from codegen.floating_point import common_scale, floating_config_values, scale_values
from codegen.source import ControllerSource, GenerationError
from codegen.structs import Field, Layout, Range, Scalar


@dataclass(frozen=True)
class PrintedLaw:
    """The statements of one joint's law in C."""

    measurement: tuple[Statement, ...]
    switch_on: tuple[Statement, ...]
    torque_law: tuple[Statement, ...]
    saturation: tuple[Statement, ...]
    signals: frozenset[str]
    """Names of the signals that the statements read."""

    @property
    def statements(self) -> tuple[Statement, ...]:
        """All statements in the order of the C."""
        return (*self.measurement, *self.switch_on, *self.torque_law, *self.saturation)


def print_joint_law(controller: Controller, structures: Layout) -> PrintedLaw:
    """The law of one joint as C statements, spelled for the templates."""
    fields = {f.quantity: f.name for f in structures.joint_config.fields if f.quantity}

    def spelling(parameter: law.Input) -> str:
        if parameter.home is law.Home.GAIN:
            return f"gains->{fields[parameter.name]}"
        if parameter.home is law.Home.SCALE:
            shared = common_scale(controller) is not None
            return f"{parameter.name.upper()}_SCALE" if shared else f"scale->{parameter.name}"
        if parameter.home is law.Home.CONSTANT:
            return f"TDC_{controller.name.upper()}_{parameter.name.upper()}_S"
        return parameter.name

    functions = (
        law.measurement(controller.options),
        law.switch_on(),
        law.torque_law(controller.options),
    )
    measurement, switch_on, torque_law = (
        print_law(f, spelling, controller.arithmetic.real) for f in functions
    )
    # The step looks first whether any torque must be limited; rarely one must.
    saturation = tuple(s for s in torque_law if s.name == "limited_torque")
    torque_law = tuple(s for s in torque_law if s not in saturation)
    signals = frozenset(i.name for f in functions for i in f.inputs if i.home is law.Home.SIGNAL)
    return PrintedLaw(measurement, switch_on, torque_law, saturation, signals)


def floating_source(controller: Controller, structures: Layout) -> ControllerSource:
    """What a controller's floating-point C is made from."""
    real = controller.arithmetic.real
    printed = print_joint_law(controller, structures)
    config = [floating_config_values(controller, joint) for joint in controller.joints]

    def default_text(field: Field, joint: Joint) -> str:
        return _default_text(field, joint, controller)

    def initialiser(field: Field, joint: Joint) -> str:
        value = config[controller.joints.index(joint)][field.name]
        if field.type is Scalar.EXPONENT:
            assert isinstance(value, int)
            return f"{{{_integer(value)}}} /* {default_text(field, joint)} */"
        if field.type is Scalar.EXPONENT64:
            assert isinstance(value, tuple)
            parts = ", ".join(map(real.literal, value))
            return f"{{{parts}}} /* {default_text(field, joint)} */"
        assert not isinstance(value, tuple)
        return _integer(value) if isinstance(value, int) else real.literal(value)

    demanded = "filtered_torque" if controller.options.low_pass else "control_torque"
    context = {
        "real": real,
        "torque_type": real.type,
        "torque": "torque_Nm",
        "zero": real.literal(0.0),
        "counts_type": real.type,
        "holding_error": "TDC_NOT_FINITE",
        "interface_headers": [f for f in real.files if "64" in f and f.endswith(".h")],
        "sample_time_literal": real.literal(real.round(controller.sample_time)),
        "measurement": printed.measurement,
        "switch_on": printed.switch_on,
        "torque_law": printed.torque_law,
        "signals": printed.signals,
        "saturation": printed.saturation,
        "demanded_torque": demanded,
        "measured": _MEASURED,
        "memory": {**_MEMORY, "applied_torque_Nm": demanded},
        "even_motion": _EVEN_MOTION,
        "literal": real.literal,
        "counts_per_rad": lambda joint: real.literal(real.round(1.0 / joint.rad_per_count)),
        "common_scale": common_scale(controller),
        "scale_values": lambda joint: scale_values(controller, joint),
        "initialiser": initialiser,
        "check": functools.partial(_check, real=real),
    }
    return ControllerSource(
        "controller.c.j2", real.files, printed.statements, context, default_text
    )


# Fields of joint_state that not every law has: what measure() finds for them,
_MEASURED = {"displacement_change": "change_counts", "error_q8": "error_counts_q8"}
# what joint_step() stores in them and in those that it computes,
_MEMORY = {
    **{field: f"now.{name}" for field, name in _MEASURED.items()},
    "reference_velocity_rad_per_s": "input->reference_velocity_rad_per_s[i]",
    "sliding_integral_rad_per_s": "next_sliding_integral",
}
# and what they are while the robot moves evenly.
_EVEN_MOTION = {
    "displacement_change": "0",
    "error_q8": "position_error_q8(input, i)",
    "reference_velocity_rad_per_s": "input->reference_velocity_rad_per_s[i]",
}


def _default_text(field: Field, joint: Joint, controller: Controller) -> str:
    """The default as the specification has it: a short decimal, or a fraction."""
    if field.quantity is None:
        return str(floating_config_values(controller, joint)[field.name])
    if field.quantity == "low_pass_ratio":
        exact = controller.low_pass_ratio
    else:
        exact = getattr(joint, "lambda_" if field.quantity == "lambda" else field.quantity)
    if exact is None:
        raise GenerationError(f"{field.name} has no default")
    decimal = f"{float(exact):.9g}"
    return decimal if type(exact)(decimal) == exact else str(exact)


def _integer(value: int) -> str:
    """An integer literal of int32_t; the smallest one has none and is spelled by its macro."""
    return "INT32_MIN" if value == -(2**31) else str(value)


def _check(field: Field, real: Real) -> str:
    """The C condition of a field's range, 1u where it holds."""
    value = f"gains->{field.name}"
    if field.range is Range.POSITIVE:
        return f"is_positive({value})"
    if field.range is Range.NOT_NEGATIVE:
        return f"is_not_negative({value})"
    if field.range is Range.RATIO:
        return f"is_positive({value}) & (({value} <= {real.literal(1.0)}) ? 1u : 0u)"
    if field.range is Range.RESTORING_EXPONENT and field.type is Scalar.EXPONENT:
        return f"({value}.minus_one_q31 > INT32_MIN) ? 1u : 0u"
    if field.range is Range.EXPONENT and field.type is Scalar.EXPONENT:
        return ""  # every tdc_exponent is in range
    if field.range is Range.RESTORING_EXPONENT:
        return f"is_exponent(&{value}, 0u)"
    if field.range is Range.EXPONENT:
        return f"is_exponent(&{value}, 1u)"
    if field.range is Range.DISPLACEMENT:
        return f"(({value} >= 1) && ({value} <= {DISPLACEMENT_MAX})) ? 1u : 0u"
    raise GenerationError(f"no check is known for {field.name}: {field.range}")
