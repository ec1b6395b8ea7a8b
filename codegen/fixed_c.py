"""Fixed-point C of a controller: the printed law, and what the template is given besides."""

from __future__ import annotations

from codegen.c99 import Statement
from codegen.controller import Controller, Joint
from codegen.exact import DISPLACEMENT_MAX, binary32
from codegen.fixed_point import (
    SLIDING_INTEGRAL_MAX,
    TORQUE_LIMIT_MAX,
    fixed_config_values,
    fixed_joint,
    formats,
    print_fixed_law,
)
from codegen.literals import float_literal
from codegen.source import ControllerSource, GenerationError
from codegen.structs import Field, Range, Scalar

_FILES = ("tdc_fixed.h", "tdc_fixed.c")


def fixed_source(controller: Controller) -> ControllerSource:
    """What a controller's fixed-point C is made from."""
    chosen = formats(controller)
    # Every joint's law was looked at for overflow; its text is the same for all.
    joint = fixed_joint(controller, controller.joints[0], chosen)
    printed = print_fixed_law(controller.options, joint, chosen)
    torque_law = printed["torque_law"]
    config = [fixed_config_values(controller, each) for each in controller.joints]
    default_text = _Defaults(controller)

    def initialiser(field: Field, each: Joint) -> str:
        value = config[controller.joints.index(each)][field.name]
        if isinstance(value, tuple):
            exponent, scale = value
            return f"{{{exponent}u, {scale}}} /* {default_text(field, each)} */"
        if field.quantity is None:
            return str(value)
        return f"{value} /* {default_text(field, each)} */"

    demanded = "filtered_torque" if controller.options.low_pass else "control_torque"
    context = {
        "torque_type": "int32_t",
        "torque": "torque_q",
        "zero": "0",
        "holding_error": "TDC_OUT_OF_RANGE",
        "sample_time_literal": float_literal(binary32(controller.sample_time)),
        "counts_type": "float",
        "interface_headers": ["tdc_fixed.h"],
        "formats": chosen,
        "sliding_integral_max": SLIDING_INTEGRAL_MAX,
        "torque_limit_max": TORQUE_LIMIT_MAX,
        "measurement": printed["measurement"],
        "switch_on": printed["switch_on"],
        "torque_law": torque_law,
        "demanded_torque": demanded,
        "memory": _MEMORY,
        "even_motion": _EVEN_MOTION,
        "signals": _signals(torque_law + printed["measurement"]),
        "counts_per_rad": lambda each: float_literal(binary32(1.0 / each.rad_per_count)),
        "initialiser": initialiser,
        "check": _check,
    }
    statements = (*printed["measurement"], *printed["switch_on"], *torque_law)
    return ControllerSource("controller_fixed.c.j2", _FILES, statements, context, default_text)


# Fields of joint_state that not every law has: what joint_step() stores in them,
_MEMORY = {
    "displacement_change": "change_counts",
    "error_q8": "error_q8",
    "reference_velocity_q": "reference_velocity",
}
# and what they are while the robot moves evenly.
_EVEN_MOTION = {
    "displacement_change": "0",
    "error_q8": "position_error_q8(input, i)",
    "reference_velocity_q": "input->reference_velocity_q[i]",
}


def _signals(statements: tuple[Statement, ...]) -> frozenset[str]:
    """The signals that the statements read, among those that not every law has."""
    text = " ".join(s.expression for s in statements)
    names = ("error_change_q8", "displacement ", "displacement_change", "last_reference_velocity")
    return frozenset(name.strip() for name in names if name in f"{text} ")


class _Defaults:
    """A field's default in the units of the specification, for the header's comment."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller

    def __call__(self, field: Field, joint: Joint) -> str:
        texts = {
            "damping": f"KD = {_plain(joint.kd)}, alpha = {_plain(joint.alpha)}",
            "stiffness": f"KP = {_plain(joint.kp)}, beta = {_plain(joint.beta)}",
            "correction": f"lambda = {_plain(joint.lambda_)}, gamma = {_plain(joint.gamma)}",
            "inertia_factor": f"{_plain(joint.inertia)} kg m^2",
            "torque_limit_q": f"{_plain(joint.torque_limit)} N m",
            "max_displacement": str(joint.max_displacement),
            "max_displacement_change": str(self._controller.max_displacement_change(joint)),
        }
        ratio = self._controller.low_pass_ratio
        if field.name in texts:
            return texts[field.name]
        if ratio is None:
            raise GenerationError(f"{field.name} has no default")
        return _plain(ratio)


def _plain(value: object) -> str:
    """A short decimal where it is exact, else the fraction."""
    decimal = f"{float(value):.9g}"  # type: ignore[arg-type]
    return decimal if type(value)(decimal) == value else str(value)  # type: ignore[call-arg]


def _check(field: Field) -> str:
    """The C condition of a field's own range; what fields have together is checked besides."""
    value = f"gains->{field.name}"
    if field.type is Scalar.FIXED_POWER:
        # Without restoring force (0) nothing converges; gamma may be 0.
        return "" if field.name == "correction" else f"({value}.exponent_q31 > 0u) ? 1u : 0u"
    if field.range is Range.FACTOR:
        return f"(({value} != 0) && ({value} != INT32_MIN)) ? 1u : 0u"
    if field.range is Range.DISPLACEMENT:
        return f"(({value} >= 1) && ({value} <= {DISPLACEMENT_MAX})) ? 1u : 0u"
    if field.range in (Range.TORQUE_LIMIT, Range.FIXED_DISPLACEMENT):
        return f"({value} > 0) ? 1u : 0u"
    if field.range is Range.FIXED_RATIO:
        return f"(({value} > 0) && ({value} <= TDC_FIXED_ONE_Q30)) ? 1u : 0u"
    raise GenerationError(f"no check is known for {field.name}: {field.range}")
