"""The inclusive time delay control law, one function per equation of the paper.

Jin, Kang, Chang, Lee: "Robust Control of Robot Manipulators Using Inclusive and Enhanced Time
Delay Control", IEEE/ASME Transactions on Mechatronics 22(5), 2017. Numbers in brackets are the
paper's. The joints are decoupled (Mbar, KD, KP and lambda are diagonal), so that the law is
written once, for one joint, in CasADi SX; the generated C runs it in a loop over the joints.

This module knows nothing of C. It names every intermediate quantity of the law, with its unit
and its equation; the printer (``codegen.c99``), the manifest and the table of equations all
take these names from here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal, TypeAlias

import casadi as ca

SX: TypeAlias = Any
"""A scalar ``casadi.SX`` expression (CasADi ships no type stubs)."""

VelocityError: TypeAlias = Literal["reference-rate", "error-difference", "half-sample"]
AccelerationEstimate: TypeAlias = Literal["current", "delayed"]


@dataclass(frozen=True)
class LawOptions:
    """What changes the structure of the law, and not only its numbers.

    Attributes:
        velocity_error: how the velocity error is formed. ``reference-rate`` is the paper's:
            reference velocity minus backward difference of the position, which lags by half a
            sample. ``error-difference`` is the backward difference of the position error.
            ``half-sample`` takes the reference velocity at t - L/2, where the backward
            difference of the position lives.
        acceleration: which second difference estimates qdd(t-L): the ``current`` one, which
            ends at q(t), or the ``delayed`` one, which ends at q(t-L).
        low_pass: whether the first-order low-pass (43) filters the torque.
        torque_report: whether the drive reports the torque that it applied, as tau(t-L).
    """

    velocity_error: VelocityError = "reference-rate"
    acceleration: AccelerationEstimate = "current"
    low_pass: bool = False
    torque_report: bool = False


class Home(Enum):
    """Where the value of an input of the law comes from."""

    GAIN = "a gain of the configuration, tunable on the rig"
    SCALE = "a conversion factor, fixed by the encoder and the sample time"
    SIGNAL = "a signal of this tick"
    CONSTANT = "a constant of the specification"


@dataclass(frozen=True)
class Input:
    """A scalar input of the law: its name, unit, meaning, and where its value comes from."""

    name: str
    home: Home
    unit: str
    meaning: str

    @property
    def symbol(self) -> SX:
        """The CasADi symbol of this input."""
        return _symbol(self.name)


@dataclass(frozen=True)
class Quantity:
    """A named quantity of the law with its equation in the paper."""

    name: str
    equation: str
    unit: str
    meaning: str
    expression: SX


@dataclass(frozen=True)
class LawFunction:
    """A part of the law as a function: named inputs in, named quantities out, all scalar."""

    name: str
    meaning: str
    inputs: tuple[Input, ...]
    quantities: tuple[Quantity, ...]

    def casadi_function(self) -> Any:
        """The ``casadi.Function`` with one scalar output per quantity, in their order."""
        return ca.Function(
            self.name,
            [i.symbol for i in self.inputs],
            [q.expression for q in self.quantities],
            [i.name for i in self.inputs],
            [q.name for q in self.quantities],
        )


_SYMBOLS: dict[str, SX] = {}


def _symbol(name: str) -> SX:
    # CasADi symbols are equal only to themselves: one symbol a name, wherever it is used.
    return _SYMBOLS.setdefault(name, ca.SX.sym(name))


GAINS: dict[str, Input] = {
    i.name: i
    for i in (
        Input("inertia", Home.GAIN, "kg m^2", "Mbar, the law's constant inertia (2)"),
        Input("kd", Home.GAIN, "rad^(1-alpha) s^(alpha-2)", "KD, damping of the error dynamics"),
        Input("kp", Home.GAIN, "rad^(1-beta) s^-2", "KP, stiffness of the error dynamics"),
        Input("lambda", Home.GAIN, "rad^(1-gamma) s^(gamma-2)", "lambda, TDE error correction"),
        Input("alpha", Home.GAIN, "", "exponent of the velocity error (17)"),
        Input("beta", Home.GAIN, "", "exponent of the position error (17)"),
        Input("gamma", Home.GAIN, "", "exponent of the sliding variable (31)"),
        Input("torque_limit", Home.GAIN, "N m", "largest torque at the joint"),
        Input("low_pass_ratio", Home.GAIN, "", "w'/(1+w') of the low-pass (43), w' = w L"),
    )
}

SCALES: dict[str, Input] = {
    i.name: i
    for i in (
        Input("position", Home.SCALE, "rad", "position error of 1/256 count"),
        Input("velocity", Home.SCALE, "rad/s", "velocity of one difference unit a tick"),
        Input("acceleration", Home.SCALE, "rad/s^2", "acceleration of one count a tick a tick"),
    )
}

SIGNALS: dict[str, Input] = {
    i.name: i
    for i in (
        Input("error_q8", Home.SIGNAL, "count/256", "reference minus measured position"),
        Input("error_change_q8", Home.SIGNAL, "count/256", "change of that error in a tick"),
        Input("displacement", Home.SIGNAL, "count", "q(t) - q(t-L)"),
        Input("displacement_change", Home.SIGNAL, "count", "second difference of the position"),
        Input("reference_velocity", Home.SIGNAL, "rad/s", "qd_d(t)"),
        Input("last_reference_velocity", Home.SIGNAL, "rad/s", "qd_d(t-L)"),
        Input("reference_acceleration", Home.SIGNAL, "rad/s^2", "qdd_d(t)"),
        Input("last_torque", Home.SIGNAL, "N m", "tau(t-L), as applied"),
        Input("sliding_integral", Home.SIGNAL, "rad/s", "s - ed, the integral part of (26)"),
        Input("position_error", Home.SIGNAL, "rad", "e"),
        Input("velocity_error", Home.SIGNAL, "rad/s", "ed"),
        Input("last_acceleration", Home.SIGNAL, "rad/s^2", "qdd(t-L)"),
    )
}

SAMPLE_TIME = Input("sample_time", Home.CONSTANT, "s", "L, sample time and time delay")


# --- The equations ---------------------------------------------------------------------------


def sig(x: SX, exponent: SX) -> SX:
    """sig(x)^a = |x|^a sgn(x), defined below (17)."""
    return ca.sign(x) * ca.power(ca.fabs(x), exponent)


def damping_term(kd: SX, velocity_error: SX, alpha: SX) -> SX:
    """Nonlinear damper of the desired error dynamics (17), KD sig(ed)^alpha [rad/s^2]."""
    return kd * sig(velocity_error, alpha)


def stiffness_term(kp: SX, position_error: SX, beta: SX) -> SX:
    """Nonlinear spring of the desired error dynamics (17), KP sig(e)^beta [rad/s^2]."""
    return kp * sig(position_error, beta)


def restoring_acceleration(damping: SX, stiffness: SX) -> SX:
    """Damper and spring of the desired error dynamics (17) together [rad/s^2]."""
    return damping + stiffness


def nonlinear_input(reference_acceleration: SX, restoring: SX) -> SX:
    """u_n of (23), qdd_d + KD sig(ed)^alpha + KP sig(e)^beta [rad/s^2]."""
    return reference_acceleration + restoring


def sliding_variable(velocity_error: SX, sliding_integral: SX) -> SX:
    """s of (26) in samples: ed(t) - ed(0) plus the integral of damper and spring [rad/s]."""
    return velocity_error + sliding_integral


def initial_sliding_integral(velocity_error: SX) -> SX:
    """The integral part of (26) at switch-on, which makes s(0) = 0 [rad/s]."""
    return -velocity_error


def next_sliding_integral(sliding_integral: SX, restoring: SX, sample_time: SX) -> SX:
    """The integral part of (26) one sample later [rad/s].

    The rectangle rule on the sample that begins here: with it the sampled closed loop gives
    s(t+L) - s(t) = L (eps + rho - lambda sig(s)^gamma), which is (32) sample by sample while no
    joint saturates; rho is what the sampled reference lacks of qdd_d = d/dt qd_d, and depends on
    the reference alone (proved in ``verification.symbolic``).
    """
    return sliding_integral + sample_time * restoring


def tde_correction(lambda_: SX, sliding: SX, gamma: SX) -> SX:
    """The correction of the time delay estimation error in (31), lambda sig(s)^gamma."""
    return lambda_ * sig(sliding, gamma)


def time_delay_estimate(last_torque: SX, inertia: SX, last_acceleration: SX) -> SX:
    """N of (6) estimated from one sample ago, tau(t-L) - Mbar qdd(t-L) [N m]."""
    return last_torque - inertia * last_acceleration


def control_torque(inertia: SX, u_n: SX, correction: SX, estimate: SX) -> SX:
    """tau of (31), Mbar (u_n + correction) + N(t-L) [N m]."""
    return inertia * (u_n + correction) + estimate


def low_pass(torque: SX, last_torque: SX, ratio: SX) -> SX:
    """The first-order low-pass (43) on the torque, ratio = w'/(1+w') with w' = w L [N m]."""
    return ratio * torque + (1 - ratio) * last_torque


def saturate(torque: SX, limit: SX) -> SX:
    """The torque that the drive can apply, within plus and minus the limit [N m]."""
    return ca.fmax(-limit, ca.fmin(limit, torque))


# --- The law of one joint --------------------------------------------------------------------


def _inputs_of(quantities: Sequence[Quantity]) -> tuple[Input, ...]:
    """The inputs that the expressions depend on, in the order of the declarations above."""
    used = {s.name() for s in ca.symvar(ca.vertcat(*(q.expression for q in quantities)))}
    declared = (*GAINS.values(), *SCALES.values(), *SIGNALS.values(), SAMPLE_TIME)
    return tuple(i for i in declared if i.name in used)


def _velocity_error(mode: VelocityError) -> SX:
    scale = SCALES["velocity"].symbol
    if mode == "error-difference":
        return SIGNALS["error_change_q8"].symbol * scale
    reference = SIGNALS["reference_velocity"].symbol
    if mode == "half-sample":
        reference = 0.5 * (reference + SIGNALS["last_reference_velocity"].symbol)
    return reference - SIGNALS["displacement"].symbol * scale


def measurement(options: LawOptions) -> LawFunction:
    """From counts to the errors e, ed and the delayed acceleration, in SI units."""
    position_error = SIGNALS["error_q8"].symbol * SCALES["position"].symbol
    acceleration = SIGNALS["displacement_change"].symbol * SCALES["acceleration"].symbol
    quantities = (
        Quantity("position_error", "(7)", "rad", "e = q_d - q", position_error),
        Quantity("velocity_error", "(7)", "rad/s", "ed", _velocity_error(options.velocity_error)),
        Quantity("last_acceleration", "(6)", "rad/s^2", "qdd(t-L)", acceleration),
    )
    return LawFunction(
        "measurement", "Counts to errors in SI units.", _inputs_of(quantities), quantities
    )


def switch_on() -> LawFunction:
    """The integral part of the sliding variable at the first tick, so that s(0) = 0."""
    value = initial_sliding_integral(SIGNALS["velocity_error"].symbol)
    quantities = (Quantity("sliding_integral", "(26)", "rad/s", "-ed(0): makes s(0) = 0", value),)
    return LawFunction(
        "switch_on", "s starts from zero, here only.", _inputs_of(quantities), quantities
    )


def torque_law(options: LawOptions) -> LawFunction:
    """The inclusive law (31) with (17), (26) and, if asked for, the low-pass (43)."""
    g = {name: i.symbol for name, i in GAINS.items()}
    x = {name: i.symbol for name, i in SIGNALS.items()}

    damping = damping_term(g["kd"], x["velocity_error"], g["alpha"])
    stiffness = stiffness_term(g["kp"], x["position_error"], g["beta"])
    restoring = restoring_acceleration(damping, stiffness)
    u_n = nonlinear_input(x["reference_acceleration"], restoring)
    sliding = sliding_variable(x["velocity_error"], x["sliding_integral"])
    correction = tde_correction(g["lambda"], sliding, g["gamma"])
    estimate = time_delay_estimate(x["last_torque"], g["inertia"], x["last_acceleration"])
    torque = control_torque(g["inertia"], u_n, correction, estimate)
    filtered = low_pass(torque, x["last_torque"], g["low_pass_ratio"])
    demanded = filtered if options.low_pass else torque
    limited = saturate(demanded, g["torque_limit"])
    integral = next_sliding_integral(x["sliding_integral"], restoring, SAMPLE_TIME.symbol)

    quantities = [
        Quantity("damping", "(17)", "rad/s^2", "KD sig(ed)^alpha", damping),
        Quantity("stiffness", "(17)", "rad/s^2", "KP sig(e)^beta", stiffness),
        Quantity("restoring", "(17)", "rad/s^2", "damping + stiffness", restoring),
        Quantity("nonlinear_input", "(23)", "rad/s^2", "u_n", u_n),
        Quantity("sliding_variable", "(26)", "rad/s", "s", sliding),
        Quantity("correction", "(31)", "rad/s^2", "lambda sig(s)^gamma", correction),
        Quantity("time_delay_estimate", "(6)", "N m", "N(t-L)", estimate),
        Quantity("control_torque", "(31)", "N m", "tau", torque),
    ]
    if options.low_pass:
        quantities.append(Quantity("filtered_torque", "(43)", "N m", "tau, low-pass", filtered))
    quantities += [
        Quantity("limited_torque", "", "N m", "what the drive can apply", limited),
        Quantity("next_sliding_integral", "(26)", "rad/s", "s - ed at t+L", integral),
    ]
    return LawFunction(
        "torque_law",
        "The inclusive time delay control law of one joint.",
        _inputs_of(quantities),
        tuple(quantities),
    )
