"""Joint friction: LuGre, Dahl and Coulomb-Stribeck, for a linearly implicit velocity step.

A step of length h with the velocity v frozen gives the new internal state, the friction torque F
at that state and the derivative D = dF/dv >= 0. The integrator then solves

    (M + h D) qdd = tau - nle - F,    v+ = v + h qdd,    q+ = q + h v+

which treats the stiff part of the friction implicitly without any iteration.

LuGre after C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, A new model for control of
systems with friction, IEEE Transactions on Automatic Control 40(3), 1995, with their g(v) written
as the torque level of the Stribeck curve (level = sigma0 g):

    dz/dt = v - sigma0 |v| z / level(v)                      their (2)
    F     = sigma0 z + sigma1 dz/dt + sigma2 v               their (3)
    level = Fc + (Fs - Fc) exp(-(v / vs)^2)                  their (4)

Without bristle damping, sigma1 = 0, and without the Stribeck effect, Fs = Fc, it is the model that
it grew from: P. R. Dahl, A solid friction model, The Aerospace Corporation,
TOR-0158(3107-18)-1, 1968, here with viscous friction beside.

The classes work on sequences of floats, one entry for each joint: for three to six joints that is
several times faster than numpy, whose cost is per call. What a joint does over a step is written
once for all kinds of numbers (:class:`Functions`): the compiled backend puts CasADi expressions
into the same lines.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

Number = Any
"""A float, or a CasADi SX expression; CasADi has no types."""


@dataclass(frozen=True)
class Functions:
    """The functions of some kind of numbers; each argument and result is one number.

    Attributes:
        exp: e^x.
        expm1: e^x - 1, precise near 0.
        sin: of an angle [rad].
        tanh: hyperbolic tangent.
        copysign: the first number's magnitude with the second's sign.
        maximum: the larger of two.
        where: the second number where the first, a condition, holds, else the third; both are
            computed, and neither may divide by 0.
        zero: whether a number is 0 for certain.
    """

    exp: Callable[[Number], Number]
    expm1: Callable[[Number], Number]
    sin: Callable[[Number], Number]
    tanh: Callable[[Number], Number]
    copysign: Callable[[Number, Number], Number]
    maximum: Callable[[Number, Number], Number]
    where: Callable[[Number, Number, Number], Number]
    zero: Callable[[Number], bool]


def _where(condition: bool, if_true: float, if_false: float) -> float:
    return if_true if condition else if_false


FLOATS = Functions(
    math.exp, math.expm1, math.sin, math.tanh, math.copysign, max, _where, operator.not_
)


@dataclass(frozen=True)
class StribeckCurve:
    """The friction level of one joint against its velocity, without the viscous part.

    Attributes:
        coulomb_positive_Nm: level in fast positive motion, >= 0.
        coulomb_negative_Nm: level in fast negative motion, >= 0.
        static_over_coulomb: level at standstill over that in fast motion, >= 1.
        velocity_rad_per_s: the Stribeck velocity vs, at the joint.
        ripple_amplitude: the level varies by this fraction with the motor's angle, in [0, 1).
        ripple_rad_per_rad: phase of that ripple per joint angle, cycles per motor turn x gear.
    """

    coulomb_positive_Nm: float
    coulomb_negative_Nm: float
    static_over_coulomb: float = 1.0
    velocity_rad_per_s: float = 1.0
    ripple_amplitude: float = 0.0
    ripple_rad_per_rad: float = 0.0

    def level(
        self, position_rad: Number, velocity_rad_per_s: Number, f: Functions = FLOATS
    ) -> Number:
        """The level [N m], always >= 0, for the direction of the velocity."""
        coulomb = f.where(
            velocity_rad_per_s < 0.0, self.coulomb_negative_Nm, self.coulomb_positive_Nm
        )
        ratio = velocity_rad_per_s / self.velocity_rad_per_s
        level = coulomb * (1.0 + (self.static_over_coulomb - 1.0) * f.exp(-ratio * ratio))
        if not f.zero(self.ripple_amplitude):
            level *= 1.0 + self.ripple_amplitude * f.sin(self.ripple_rad_per_rad * position_rad)
        return level

    @property
    def mean_static_level(self) -> float:
        """The mean of both directions' static levels, without ripple."""
        return (
            0.5 * self.static_over_coulomb * (self.coulomb_positive_Nm + self.coulomb_negative_Nm)
        )


JointFriction = tuple[Number, Number, Number]
"""State, torque and derivative of one joint as in :class:`FrictionStep`; a bare tuple is faster."""


class FrictionStep(NamedTuple):
    """Friction of all joints over one step, velocities frozen; each list has one entry per joint.

    Attributes:
        state: the internal state (LuGre's bristle deflection [rad]) at the end of the step.
        torque_Nm: F at the new state, opposing motion where positive velocity is positive F.
        derivative_Nms_per_rad: D = dF/dv, never negative.
    """

    state: list[float]
    torque_Nm: list[float]
    derivative_Nms_per_rad: list[float]


class JointModel(Protocol):
    """The friction of one joint, in any kind of numbers."""

    @property
    def curve(self) -> StribeckCurve:
        """Its level against the velocity."""

    def step(
        self,
        position_rad: Number,
        velocity_rad_per_s: Number,
        state: Number,
        step_s: Number,
        f: Functions = FLOATS,
    ) -> JointFriction:
        """Friction over one step with the velocity frozen."""


class FrictionModel(Protocol):
    """What the integrator needs of a friction model."""

    @property
    def joints(self) -> int:
        """Number of joints."""

    @property
    def parameters(self) -> Sequence[JointModel]:
        """The friction of each joint."""

    def at_rest(self) -> list[float]:
        """The internal state of a joint that no torque loads."""

    def step(
        self,
        position_rad: Sequence[float],
        velocity_rad_per_s: Sequence[float],
        state: Sequence[float],
        step_s: float,
    ) -> FrictionStep:
        """Friction over one step with the velocity frozen."""

    def steady_torque(
        self, position_rad: Sequence[float], velocity_rad_per_s: Sequence[float]
    ) -> list[float]:
        """The torque [N m] after a long time at constant velocity; 0 at standstill."""


def _all_joints(
    joints: Sequence[JointModel],
    position_rad: Sequence[float],
    velocity_rad_per_s: Sequence[float],
    state: Sequence[float],
    step_s: float,
) -> FrictionStep:
    states, torques, derivatives = [], [], []
    for joint, q, v, z in zip(joints, position_rad, velocity_rad_per_s, state, strict=True):
        z_new, torque, derivative = joint.step(q, v, z, step_s)
        states.append(z_new)
        torques.append(torque)
        derivatives.append(derivative)
    return FrictionStep(states, torques, derivatives)


def _steady_torque(
    curve: StribeckCurve, viscous: float, position_rad: float, velocity_rad_per_s: float
) -> float:
    if velocity_rad_per_s == 0.0:
        return 0.0
    level = curve.level(position_rad, velocity_rad_per_s)
    return math.copysign(level, velocity_rad_per_s) + viscous * velocity_rad_per_s


@dataclass(frozen=True)
class LuGreJoint:
    """LuGre parameters of one joint.

    Attributes:
        curve: the Stribeck curve, its level positive everywhere.
        stiffness_Nm_per_rad: sigma0 > 0.
        bristle_damping_Nms_per_rad: sigma1 >= 0.
        viscous_Nms_per_rad: sigma2 >= 0.
    """

    curve: StribeckCurve
    stiffness_Nm_per_rad: float
    bristle_damping_Nms_per_rad: float
    viscous_Nms_per_rad: float

    def step(
        self,
        position_rad: Number,
        velocity_rad_per_s: Number,
        state: Number,
        step_s: Number,
        f: Functions = FLOATS,
    ) -> JointFriction:
        """Advances the bristle [rad] by its exact solution; see :meth:`LuGre.step`."""
        v, z = velocity_rad_per_s, state
        stiffness, damping = self.stiffness_Nm_per_rad, self.bristle_damping_Nms_per_rad
        # How much of the level the bristle carries in the direction of motion, per deflection.
        saturation = f.copysign(stiffness, v) / self.curve.level(position_rad, v, f)
        x = saturation * v * step_s
        moves = x > 0.0
        decay = f.exp(-x)
        moved = z * decay - v * step_s * f.expm1(-x) / f.where(moves, x, 1.0)
        deflection = f.where(moves, moved, z)
        # d(z+)/dv = h exp(-x) (1 - sigma0 z sgn(v) / level); negative only if the bristle is
        # stretched beyond the level (which has just fallen), where no help is needed.
        slope = f.where(moves, f.maximum(0.0, step_s * decay * (1.0 - saturation * z)), step_s)
        viscous = self.viscous_Nms_per_rad
        return (
            deflection,
            stiffness * deflection + damping * (deflection - z) / step_s + viscous * v,
            (stiffness + damping / step_s) * slope + viscous,
        )


def dahl_joint(
    curve: StribeckCurve, presliding_rad: float, viscous_Nms_per_rad: float
) -> LuGreJoint:
    """Dahl's friction of one joint: dz/dt = v - sigma0 |v| z / Fc, F = sigma0 z + viscous v.

    Args:
        curve: whose level in fast motion is Fc at any speed.
        presliding_rad: Fc / sigma0 > 0, the mean of both directions.
        viscous_Nms_per_rad: viscous friction >= 0.
    """
    flat = replace(curve, static_over_coulomb=1.0)
    return LuGreJoint(flat, flat.mean_static_level / presliding_rad, 0.0, viscous_Nms_per_rad)


@dataclass(frozen=True)
class LuGre:
    """LuGre friction of all joints."""

    parameters: tuple[LuGreJoint, ...]

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.parameters)

    def at_rest(self) -> list[float]:
        """Undeflected bristles [rad]."""
        return [0.0] * len(self.parameters)

    def step(
        self,
        position_rad: Sequence[float],
        velocity_rad_per_s: Sequence[float],
        state: Sequence[float],
        step_s: float,
    ) -> FrictionStep:
        """Advances the bristles by their exact solution for frozen velocity.

        With x = sigma0 |v| h / level the solution of dz/dt over h is

            z+ = z exp(-x) + v h (1 - exp(-x)) / x

        The bristle damping acts on the mean rate (z+ - z) / h, whose impulse over the step is
        exact. The derivative holds the level fixed: the falling part of the Stribeck curve is
        slow and stays explicit, so that D cannot become negative.

        Args:
            position_rad: joint positions, n entries.
            velocity_rad_per_s: joint velocities, n entries.
            state: bristle deflections [rad], n entries.
            step_s: h > 0.

        Returns:
            The deflections after the step, F and D.
        """
        return _all_joints(self.parameters, position_rad, velocity_rad_per_s, state, step_s)

    def steady_torque(
        self, position_rad: Sequence[float], velocity_rad_per_s: Sequence[float]
    ) -> list[float]:
        """level(v) sgn(v) + sigma2 v [N m]; 0 at standstill."""
        return [
            _steady_torque(joint.curve, joint.viscous_Nms_per_rad, q, v)
            for joint, q, v in zip(self.parameters, position_rad, velocity_rad_per_s, strict=True)
        ]


@dataclass(frozen=True)
class CoulombStribeckJoint:
    """Coulomb-Stribeck parameters of one joint.

    Attributes:
        curve: the Stribeck curve.
        viscous_Nms_per_rad: viscous friction >= 0.
        width_rad_per_s: w > 0; the sign of the velocity is smoothed to tanh(v / w).
    """

    curve: StribeckCurve
    viscous_Nms_per_rad: float
    width_rad_per_s: float

    def step(
        self,
        position_rad: Number,
        velocity_rad_per_s: Number,
        state: Number,
        step_s: Number,  # noqa: ARG002 - the interface of all friction models
        f: Functions = FLOATS,
    ) -> JointFriction:
        """The torque at the frozen velocity; see :meth:`CoulombStribeck.step`."""
        v, width = velocity_rad_per_s, self.width_rad_per_s
        level, moves = self.curve.level(position_rad, v, f), v != 0.0
        mean = level * f.tanh(v / width) / f.where(moves, v, 1.0)
        derivative = f.where(moves, mean, level / width) + self.viscous_Nms_per_rad
        return state, derivative * v, derivative


@dataclass(frozen=True)
class CoulombStribeck:
    """Friction without memory: F = level(v) tanh(v / w) + viscous v."""

    parameters: tuple[CoulombStribeckJoint, ...]

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.parameters)

    def at_rest(self) -> list[float]:
        """There is no internal state; zeros stand in for it."""
        return [0.0] * len(self.parameters)

    def step(
        self,
        position_rad: Sequence[float],
        velocity_rad_per_s: Sequence[float],
        state: Sequence[float],
        step_s: float,
    ) -> FrictionStep:
        """The torque at the frozen velocity.

        D is the mean derivative of the tanh between standstill and v, level tanh(v / w) / v,
        not the tangent: the tangent vanishes for |v| > w, and a step across standstill would then
        push the joint back and forth. With the mean derivative F + D (v+ - v) = D v+ only brakes,
        whatever the length of the step.

        Args:
            position_rad: joint positions, n entries.
            velocity_rad_per_s: joint velocities, n entries.
            state: passed through.
            step_s: not used.

        Returns:
            The state as it was, F and D.
        """
        return _all_joints(self.parameters, position_rad, velocity_rad_per_s, state, step_s)

    def steady_torque(
        self, position_rad: Sequence[float], velocity_rad_per_s: Sequence[float]
    ) -> list[float]:
        """level(v) sgn(v) + viscous v [N m], the sign not smoothed; 0 at standstill."""
        return [
            _steady_torque(joint.curve, joint.viscous_Nms_per_rad, q, v)
            for joint, q, v in zip(self.parameters, position_rad, velocity_rad_per_s, strict=True)
        ]


def frictionless(joints: int) -> CoulombStribeck:
    """No friction at all in so many joints."""
    nothing = CoulombStribeckJoint(StribeckCurve(0.0, 0.0), 0.0, 1.0)
    return CoulombStribeck((nothing,) * joints)
