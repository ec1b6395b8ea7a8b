"""The law in integers: counts and ticks, their formats, and the proof that nothing overflows.

Fixed-point C computes in the units of the encoder and the clock. With r radians a count and L
seconds a tick:

- positions and their errors are in 1/256 count, exact and wrapping, as in floating-point C;
- velocities in counts a tick and accelerations in counts a tick a tick are integers in units of
  2^-F, one F for all joints of a controller. An acceleration moves a velocity by itself in one
  tick, so that the integral in the sliding variable (26) is an exact sum of integers;
- torques are integers in units of 2^-T newton metres.

A gain and its power are one function, ``gain |x|^a`` from one of these units to another
(:mod:`codegen.sig_pow_fixed`): the gain becomes an offset of the logarithm and costs nothing.

What an input may be is limited: the reference moves no faster than the joint plausibly can, and
changes its velocity by no more in one tick. :func:`formats` follows the largest magnitude of every
quantity of the law from there, in exact integers, and takes the finest F and T with which every
sum and product fits into 32 bits. A specification for which there are none is refused, with the
quantity that overflows.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction

import casadi as ca

from codegen import law
from codegen.c99 import Graph, Statement, instruction_graph
from codegen.controller import Controller, Joint
from codegen.floating_point import FieldValue
from codegen.law import LawFunction, LawOptions
from codegen.literals import UnprintableError
from codegen.problems import Problem, SpecificationError
from codegen.sig_pow_fixed import FixedPower, fixed_power, magnitude_bound
from codegen.structs import Field, Layout, Range, Scalar, Struct, assemble

INT32_MAX = 2**31 - 1
SLIDING_INTEGRAL_MAX = 2**30 - 1
"""Where the integral part of the sliding variable stops: at half of what an integer can hold."""

TORQUE_LIMIT_MAX = 2**29
"""What a torque limit may be tuned to; what a joint remembers is never more."""

_FINEST, _COARSEST = 24, 8
_FINEST_TORQUE, _COARSEST_TORQUE = 24, 4
_RATIO_BITS = 30
# tdc_fixed_scale takes the high word of a product, rounded: the factor is scaled by 2^32.
_FACTOR_BITS = 32
_POWERS = {"kd": "damping", "kp": "stiffness", "lambda": "correction"}


@dataclass(frozen=True)
class Formats:
    """The units of a controller's integers.

    Attributes:
        fraction_bits: F, of velocities [2^-F count/tick] and accelerations [2^-F count/tick^2].
        torque_bits: T, of torques [2^-T N m].
    """

    fraction_bits: int
    torque_bits: int

    @property
    def max_displacement(self) -> int:
        """The largest that a joint's max_displacement may be tuned to [count]."""
        return (SLIDING_INTEGRAL_MAX + 1) >> (self.fraction_bits + 1)


@dataclass(frozen=True)
class FixedJoint:
    """What a joint's gains are in the units of the controller.

    Attributes:
        powers: exponent in Q31 and log2 of the gain in Q24, of damping, stiffness and correction.
        inertia_factor: torque a unit of acceleration, times 2^32; negative where counts fall as
            the joint's angle rises.
        torque_limit: in units of torque.
        low_pass_ratio: in Q30, None without a low-pass.
        max_displacement: [count].
    """

    powers: Mapping[str, FixedPower]
    inertia_factor: int
    torque_limit: int
    low_pass_ratio: int | None
    max_displacement: int


class _OverflowError(Exception):
    """A quantity that doesn't fit into 32 bits with these formats."""

    def __init__(self, quantity: str, magnitude: int) -> None:
        super().__init__(f"{quantity} may reach {magnitude / 2**31:.3g} times 2^31")
        self.quantity = quantity
        self.magnitude = magnitude


@functools.cache
def formats(controller: Controller) -> Formats:
    """The finest formats with which nothing overflows.

    Raises:
        SpecificationError: there are none; it names the quantity, the joint, and what to change.
    """
    last: tuple[Joint, _OverflowError] | None = None
    for fraction_bits in range(_FINEST, _COARSEST - 1, -1):
        for torque_bits in range(_FINEST_TORQUE, _COARSEST_TORQUE - 1, -1):
            chosen = Formats(fraction_bits, torque_bits)
            problem = _first_overflow(controller, chosen)
            if problem is None:
                return chosen
            last = problem
            if problem[1].quantity not in _TORQUES:
                break  # coarser torques won't help
    assert last is not None
    joint, overflow = last
    raise SpecificationError(
        controller.name,
        [
            Problem(
                "arithmetic",
                f'"fixed-point" (joint {joint.name})',
                f"every quantity of the law fits into 32 bits; in the coarsest units {overflow}",
                _REMEDIES.get(overflow.quantity, "lower the gains of this joint, or its speed"),
            )
        ],
    )


_TORQUES = (
    "inertia_factor",
    "torque_limit",
    "time_delay_estimate",
    "control_torque",
    "filtered_torque",
)
_REMEDIES = {
    "velocity_error": "lower safety.max_speed_rad_per_s, or use an encoder with fewer counts",
    "damping": "lower law.kd or safety.max_speed_rad_per_s",
    "stiffness": "lower law.kp or law.beta",
    "correction": "lower law.lambda or law.gamma",
    "control_torque": "lower law.inertia_kgm2 or safety.max_speed_rad_per_s",
    "time_delay_estimate": "lower law.inertia_kgm2 or safety.max_speed_rad_per_s",
}


def _first_overflow(controller: Controller, chosen: Formats) -> tuple[Joint, _OverflowError] | None:
    for joint in controller.joints:
        try:
            fixed = fixed_joint(controller, joint, chosen)
            print_fixed_law(controller.options, fixed, chosen)
        except _OverflowError as overflow:
            return joint, overflow
    return None


def fixed_joint(controller: Controller, joint: Joint, chosen: Formats) -> FixedJoint:
    """A joint's numbers in these units.

    Raises:
        _OverflowError: the inertia, the torque limit or a gain doesn't fit.
    """
    rad, tick = abs(Fraction(joint.rad_per_count)), controller.sample_time
    unit = Fraction(1, 2**chosen.fraction_bits)
    acceleration = tick**2 / rad / unit  # from rad/s^2 to units
    velocity = rad / tick * unit  # from units to rad/s
    bases = {
        "damping": (joint.kd, joint.alpha, velocity),
        "stiffness": (joint.kp, joint.beta, rad / 256),
        "correction": (joint.lambda_, joint.gamma, velocity),
    }
    sign = 1 if joint.counts_per_joint_rev > 0 else -1
    factor = sign * round(joint.inertia / acceleration * 2**chosen.torque_bits * 2**_FACTOR_BITS)
    limit = round(joint.torque_limit * 2**chosen.torque_bits)
    for name, magnitude, most in (
        ("inertia_factor", abs(factor), INT32_MAX),
        ("torque_limit", limit, TORQUE_LIMIT_MAX),
        ("velocity_error", joint.max_displacement, chosen.max_displacement),
    ):
        if magnitude > most:
            raise _OverflowError(name, magnitude * INT32_MAX // most)
    ratio = controller.low_pass_ratio
    return FixedJoint(
        {
            name: _power(name, gain * acceleration, exponent, base)
            for name, (gain, exponent, base) in bases.items()
        },
        factor,
        limit,
        None if ratio is None else round(ratio * 2**_RATIO_BITS),
        joint.max_displacement,
    )


def _power(name: str, gain: Fraction, exponent: Fraction, base: Fraction) -> FixedPower:
    """A term of the law; one whose gain is beyond what a logarithm in Q24 holds is too large."""
    try:
        return fixed_power(gain, exponent, base=base)
    except ValueError as error:
        if gain < 1:
            return fixed_power(Fraction(0), exponent)  # less than a unit for every x of 32 bits
        raise _OverflowError(name, 2**128 * INT32_MAX) from error


# --- The law in C, and the largest magnitudes ---------------------------------------------------


@dataclass(frozen=True)
class _Value:
    """An expression in C with its unit and its largest magnitude in that unit."""

    text: str
    unit: str
    magnitude: int
    atom: bool = False

    @property
    def operand(self) -> str:
        return self.text if self.atom else f"({self.text})"


_COUNT, _POSITION, _MOTION, _TORQUE, _RATIO = "count", "count/256", "motion", "N m", "ratio"


def print_fixed_law(
    options: LawOptions, joint: FixedJoint, chosen: Formats
) -> dict[str, tuple[Statement, ...]]:
    """The C of the law's three parts, by their names.

    Raises:
        _OverflowError: a quantity might not fit into 32 bits.
        UnprintableError: the law contains something that has no C in integers.
    """
    known = _signals(chosen)
    printed: dict[str, tuple[Statement, ...]] = {}
    for function in (law.measurement(options), law.switch_on(), law.torque_law(options)):
        statements, values = _FixedPrinter(function, known, joint, chosen).statements()
        printed[function.name] = statements
        known |= {name: v for name, v in values.items() if name != "sliding_integral"}
    return printed


def _signals(chosen: Formats) -> dict[str, _Value]:
    """What the law starts from, and how large it may be.

    A limit may be lowered while the controller runs, below what it remembers: what counts is what
    a limit may be tuned to.
    """
    displacement = chosen.max_displacement
    motion = displacement << chosen.fraction_bits
    magnitudes = {
        "error_q8": (_POSITION, 2**31),
        "error_change_q8": (_POSITION, 512 * displacement),
        "displacement": (_COUNT, displacement),
        "displacement_change": (_COUNT, 2 * displacement),
        "reference_velocity": (_MOTION, motion),
        "last_reference_velocity": (_MOTION, motion),
        "reference_acceleration": (_MOTION, motion),
        "last_torque": (_TORQUE, TORQUE_LIMIT_MAX),
        "sliding_integral": (_MOTION, SLIDING_INTEGRAL_MAX),
    }
    return {name: _Value(name, *about, atom=True) for name, about in magnitudes.items()}


@dataclass
class _FixedPrinter:
    """Prints one function of the law; every node is an expression with unit and magnitude."""

    function: LawFunction
    known: Mapping[str, _Value]
    joint: FixedJoint
    chosen: Formats

    def statements(self) -> tuple[tuple[Statement, ...], dict[str, _Value]]:
        """The C definitions, and the values that they name."""
        self._graph: Graph = instruction_graph(self.function)
        self._named: dict[int, _Value] = {}
        made: list[Statement] = []
        values: dict[str, _Value] = {}
        for quantity, node in zip(self.function.quantities, self._graph.outputs, strict=True):
            self._quantity = quantity.name
            value = self._named.get(node) or self._value(node)
            made.append(
                Statement(
                    quantity.name,
                    value.text,
                    quantity.equation,
                    self._unit_text(value.unit),
                    quantity.meaning,
                )
            )
            values[quantity.name] = _Value(quantity.name, value.unit, value.magnitude, atom=True)
            self._named[node] = values[quantity.name]
        return tuple(made), values

    def _unit_text(self, unit: str) -> str:
        units = {
            _MOTION: f"2^-{self.chosen.fraction_bits} count/tick",
            _TORQUE: f"2^-{self.chosen.torque_bits} N m",
        }
        return units.get(unit, unit)

    def _made(self, text: str, unit: str, magnitude: int, atom: bool = False) -> _Value:
        if magnitude > INT32_MAX and unit != _POSITION:
            raise _OverflowError(self._quantity, magnitude)
        return _Value(text, unit, magnitude, atom)

    def _value(self, index: int) -> _Value:
        if index in self._named:
            return self._named[index]
        node = self._graph.nodes[index]
        if node.input is not None and node.input.name in self.known:
            return self.known[node.input.name]
        if node.input is not None and node.input.name == "torque_limit":
            return _Value("gains->torque_limit_q", _TORQUE, TORQUE_LIMIT_MAX, atom=True)
        if node.op in _OPERATIONS:
            return _OPERATIONS[node.op](self, *node.arguments, index)
        raise UnprintableError(f"{self._quantity}: an operation without C in integers")

    def _sum(self, left: int, right: int, index: int) -> _Value:
        a, b = self._value(left), self._value(right)
        if a.unit != b.unit:
            raise UnprintableError(f"{self._quantity}: {a.unit} and {b.unit} are added")
        sign = "+" if self._graph.nodes[index].op == ca.OP_ADD else "-"
        return self._made(f"{a.operand} {sign} {b.operand}", a.unit, a.magnitude + b.magnitude)

    def _negative(self, argument: int, _: int) -> _Value:
        a = self._value(argument)
        return self._made(f"-{a.operand}", a.unit, a.magnitude, atom=True)

    def _limited(self, left: int, right: int, index: int) -> _Value:
        a, b = self._value(left), self._value(right)
        name = "tdc_lesser" if self._graph.nodes[index].op == ca.OP_FMIN else "tdc_greater"
        limit = min(a.magnitude, b.magnitude) if name == "tdc_lesser" else TORQUE_LIMIT_MAX
        magnitude = limit if name == "tdc_greater" else max(a.magnitude, b.magnitude)
        return self._made(f"{name}({a.text}, {b.text})", a.unit, magnitude, atom=True)

    def _product(self, left: int, right: int, _: int) -> _Value:
        for factor, argument in ((left, right), (right, left)):
            node = self._graph.nodes[factor]
            if node.input is not None and node.input.name in _POWERS:
                return self._power(_POWERS[node.input.name], argument)
            if node.input is not None and node.input.name in _FACTORS:
                return _FACTORS[node.input.name](self, self._value(argument))
            if node.op == ca.OP_CONST and node.constant == 0.5:
                a = self._value(argument)
                text = f"tdc_shift_right({a.text}, 1u)"
                return self._made(text, a.unit, (a.magnitude + 1) // 2, atom=True)
            if node.op == ca.OP_SUB and self._is_ratio(node.arguments[1]):
                rest = f"TDC_FIXED_ONE_Q{_RATIO_BITS} - gains->low_pass_ratio_q{_RATIO_BITS}"
                return self._by_ratio(self._value(argument), rest)
        raise UnprintableError(f"{self._quantity}: a product without C in integers")

    def _is_ratio(self, index: int) -> bool:
        node = self._graph.nodes[index]
        return node.input is not None and node.input.name == "low_pass_ratio"

    def _power(self, name: str, index: int) -> _Value:
        sig = self._graph.sig(index)
        if sig is None:
            raise UnprintableError(f"{self._quantity}: a gain without its power")
        base = self._value(sig[0])
        magnitude = magnitude_bound(self.joint.powers[name], base.magnitude)
        if magnitude >= INT32_MAX:  # where the power saturates
            raise _OverflowError(self._quantity, magnitude)
        text = f"tdc_fixed_sig_pow({base.text}, gains->{name})"
        return self._made(text, _MOTION, magnitude, atom=True)

    def _by_inertia(self, a: _Value) -> _Value:
        magnitude = (a.magnitude * abs(self.joint.inertia_factor) >> _FACTOR_BITS) + 1
        text = f"tdc_fixed_product({a.text}, gains->inertia_factor)"
        return self._made(text, _TORQUE, magnitude, atom=True)

    def _by_ratio(self, a: _Value, ratio: str = f"gains->low_pass_ratio_q{_RATIO_BITS}") -> _Value:
        text = f"tdc_fixed_scale({a.text}, {ratio}, {_RATIO_BITS}u)"
        return self._made(text, a.unit, a.magnitude + 1, atom=True)

    def _in_motion(self, a: _Value) -> _Value:
        """From counts, or 1/256 counts, to the unit of motion."""
        q8 = a.unit == _POSITION
        bits = self.chosen.fraction_bits - (8 if q8 else 0)
        text = f"{a.operand} * MOTION_PER_COUNT{'_Q8' if q8 else ''}"
        return self._made(text, _MOTION, a.magnitude << bits)

    def _as_it_is(self, a: _Value) -> _Value:
        """A tick's worth of an acceleration is a velocity; a position error is in its own unit."""
        return a


_OPERATIONS: dict[int, Callable[..., _Value]] = {
    ca.OP_ADD: _FixedPrinter._sum,
    ca.OP_SUB: _FixedPrinter._sum,
    ca.OP_NEG: _FixedPrinter._negative,
    ca.OP_MUL: _FixedPrinter._product,
    ca.OP_FMIN: _FixedPrinter._limited,
    ca.OP_FMAX: _FixedPrinter._limited,
}

_FACTORS: dict[str, Callable[[_FixedPrinter, _Value], _Value]] = {
    "inertia": _FixedPrinter._by_inertia,
    "low_pass_ratio": _FixedPrinter._by_ratio,
    "position": _FixedPrinter._as_it_is,
    "velocity": _FixedPrinter._in_motion,
    "acceleration": _FixedPrinter._in_motion,
    "sample_time": _FixedPrinter._as_it_is,
}


# --- Structures ---------------------------------------------------------------------------------


def fixed_layout(controller: Controller) -> Layout:
    """The structures of a controller in fixed-point C."""
    chosen, options = formats(controller), controller.options
    motion = f"2^-{chosen.fraction_bits} count/tick"
    torque = f"2^-{chosen.torque_bits} N m"
    joints = len(controller.joints)
    return assemble(
        _joint_config(options, torque),
        _joint_state(options, motion, torque),
        _input(options, motion, torque, joints),
        Struct("scale", "Nothing: the units are those of the encoder and the clock.", ()),
        joints,
    )


def _joint_config(options: LawOptions, torque: str) -> Struct:
    power, integer = Scalar.FIXED_POWER, Scalar.INT32
    fields = [
        Field("damping", power, "KD sig(ed)^alpha (17), from motion to motion", quantity="kd"),
        Field("stiffness", power, "KP sig(e)^beta (17), from 1/256 count to motion", quantity="kp"),
        Field(
            "correction",
            power,
            "lambda sig(s)^gamma (31), from motion to motion",
            quantity="lambda",
        ),
        Field(
            "inertia_factor",
            integer,
            "Mbar (2): torque a unit of motion, times 2^32; negative where the motor turns back",
            range=Range.FACTOR,
            quantity="inertia",
        ),
        Field(
            "torque_limit_q",
            integer,
            "largest torque at the joint",
            torque,
            range=Range.TORQUE_LIMIT,
            quantity="torque_limit",
        ),
        Field(
            "max_displacement",
            integer,
            "largest plausible change of counts in a tick",
            "count",
            range=Range.FIXED_DISPLACEMENT,
        ),
        Field(
            "max_displacement_change",
            integer,
            "largest plausible change of that from tick to tick",
            "count",
            range=Range.DISPLACEMENT,
        ),
    ]
    if options.low_pass:
        fields.append(
            Field(
                f"low_pass_ratio_q{_RATIO_BITS}",
                integer,
                "w'/(1+w') of the low-pass (43), w' = w L, times 2^30",
                range=Range.FIXED_RATIO,
                quantity="low_pass_ratio",
            )
        )
    return Struct(
        "joint_config",
        "The gains of one joint; all may be tuned while the controller runs.",
        tuple(fields),
    )


def _joint_state(options: LawOptions, motion: str, torque: str) -> Struct:
    integer = Scalar.INT32
    fields = [
        Field("counts", integer, "position at the last tick", "count"),
        Field("displacement", integer, "q(t-L) - q(t-2L)", "count"),
    ]
    if options.acceleration == "delayed":
        fields.append(Field("displacement_change", integer, "last second difference", "count"))
    if options.velocity_error == "error-difference":
        fields.append(Field("error_q8", integer, "position error at t-L", "count/256"))
    if options.velocity_error == "half-sample":
        fields.append(Field("reference_velocity_q", integer, "qd_d(t-L)", motion))
    fields += [
        Field("sliding_integral_q", integer, "s - ed, integral part of (26)", motion),
        Field("applied_torque_q", integer, "tau(t-L), as applied after saturation", torque),
    ]
    return Struct("joint_state", "What one joint remembers from tick to tick.", tuple(fields))


def _input(options: LawOptions, motion: str, torque: str, joints: int) -> Struct:
    integer = Scalar.INT32
    fields = [
        Field("counts", integer, "measured position; may wrap", "count", joints),
        Field(
            "reference_position_q8",
            integer,
            "reference position in 1/256 count; wraps with the counts",
            "count/256",
            joints,
        ),
        Field("reference_velocity_q", integer, "qd_d(t) of the joint", motion, joints),
        Field(
            "reference_acceleration_q",
            integer,
            "qdd_d(t) of the joint, a tick",
            motion,
            joints,
        ),
    ]
    if options.torque_report:
        fields.append(
            Field(
                "applied_torque_q",
                integer,
                "torque that the drive reports for the last tick",
                torque,
                joints,
            )
        )
    return Struct("input", "What the controller is told at each tick.", tuple(fields))


def fixed_config_values(controller: Controller, joint: Joint) -> dict[str, FieldValue]:
    """The default configuration of a joint in fixed-point C, by field name."""
    fixed = fixed_joint(controller, joint, formats(controller))
    values: dict[str, FieldValue] = {
        **{name: (p.exponent_q31, p.scale_q24) for name, p in fixed.powers.items()},
        "inertia_factor": fixed.inertia_factor,
        "torque_limit_q": fixed.torque_limit,
        "max_displacement": fixed.max_displacement,
        "max_displacement_change": controller.max_displacement_change(joint),
    }
    if fixed.low_pass_ratio is not None:
        values[f"low_pass_ratio_q{_RATIO_BITS}"] = fixed.low_pass_ratio
    return values
