"""The rival laws, each written once as CasADi expressions of n joints.

A law answers a torque and the rate of its integral. What all have in common is not in here but in
``rival.c.j2``: velocities by backward differences of counts, the limit of the drive, an integral
that stops where it would push a joint further into its limit (clamping), and a start without a
bump: the difference between the torque that held the robot and the law's own `standing` torque
stays as a constant. To laws without a model that constant is all they know of gravity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import casadi as ca

from plant.compiled.rigid_body import SX, bias_torque, inertia_matrix, tree
from verification.rivals.model import Model

Symbols: TypeAlias = Mapping[str, SX]
"""Gains by name, each of shape (n,)."""


@dataclass(frozen=True)
class Knob:
    """A gain that is tuned, and the box in which it is looked for.

    Attributes:
        name: as the law spells it.
        unit: of it.
        low: end of the box.
        high: end of the box.
        per_joint: whether each joint has its own, or all have one.
        logarithmic: whether the box is searched by ratios, or by differences.
    """

    name: str
    unit: str
    low: float
    high: float
    per_joint: bool = False
    logarithmic: bool = True


@dataclass(frozen=True, eq=False)
class Signals:
    """What a law is told at a tick; each has shape (n,).

    Attributes:
        position: q by the encoders [rad].
        velocity: its backward difference [rad/s].
        error: e = q_d - q [rad].
        error_rate: ed = qd_d - velocity [rad/s].
        reference_velocity: qd_d [rad/s].
        reference_acceleration: qdd_d [rad/s^2].
        integral: of the law's own rate since its start.
    """

    position: SX
    velocity: SX
    error: SX
    error_rate: SX
    reference_velocity: SX
    reference_acceleration: SX
    integral: SX


class Answer(NamedTuple):
    """A torque before the limit of the drive [N m], and the rate of the integral; shape (n,)."""

    torque: SX
    rate: SX


@dataclass(frozen=True, eq=False)
class Law:
    """A rival law.

    Attributes:
        name: an identifier.
        source: who published it, and as which equation it stands here.
        knobs: its gains, all of them tuned.
        answer: the law.
        standing: its torque at rest at a position, without error.
    """

    name: str
    source: str
    knobs: tuple[Knob, ...]
    answer: Callable[[Signals, Symbols], Answer]
    standing: Callable[[SX], SX]


# One box for gains of one meaning, whoever's they are.
INERTIA = Knob("inertia", "kg m^2", 0.02, 20.0, per_joint=True)
KD = Knob("kd", "1/s", 2.0, 2e3)
KP = Knob("kp", "1/s^2", 10.0, 1e6)
KI = Knob("ki", "1/s^3", 10.0, 1e8)


def _nothing(position: SX) -> SX:
    return ca.SX.zeros(*position.shape)


def pid() -> Law:
    """tau = K (ed + kp e + ki integral of e), one joint at a time, no gravity in it."""

    def answer(now: Signals, gain: Symbols) -> Answer:
        corrected = now.error_rate + gain["kp"] * now.error + gain["ki"] * now.integral
        return Answer(gain["damping"] * corrected, now.error)

    knobs = (
        Knob("damping", "N m s/rad", 1.0, 3e3, per_joint=True),
        Knob("kp", "1/s", 1.0, 1e3),
        Knob("ki", "1/s^2", 1.0, 1e5),
    )
    return Law("pid", "PID of each joint by itself", knobs, answer, _nothing)


def computed_torque(model: Model, *, friction: bool = False, integral: bool = False) -> Law:
    """tau = M(q) (qdd_d + KD ed + KP e + KI integral of e) + C(q, qd) qd + g(q) + f(qd_d).

    Args:
        model: what the law takes for the robot.
        friction: whether f, the model's friction at the reference velocity, is in it.
        integral: whether KI is in it.
    """

    def answer(now: Signals, gain: Symbols) -> Answer:
        asked = now.reference_acceleration + gain["kd"] * now.error_rate + gain["kp"] * now.error
        if integral:
            asked = asked + gain["ki"] * now.integral
        robot = tree(model.joints, model.masses, now.position)
        M = inertia_matrix(robot, model.armature)
        torque = M @ asked + bias_torque(robot, now.velocity, model.gravity)
        if friction:
            torque = torque + model.friction_torque(now.reference_velocity)
        return Answer(torque, now.error)

    def standing(position: SX) -> SX:
        robot = tree(model.joints, model.masses, position)
        return bias_torque(robot, ca.SX.zeros(*position.shape), model.gravity)

    parts = ("friction" if friction else "", "integral" if integral else "")
    name = "_".join(("computed_torque", *filter(None, parts)))
    knobs = (KD, KP, KI) if integral else (KD, KP)
    source = "computed torque, Luh, Walker and Paul 1980"
    return Law(name, source, knobs, answer, standing)


def integral_sliding_mode() -> Law:
    """tau = J (qdd_d + kd ed + kp e + K sat(s/phi)), s = ed + integral of (kd ed + kp e).

    J is one constant a joint, and s is 0 at the start. The boundary layer phi takes the place of
    the sign, which would chatter at every tick.
    """

    def answer(now: Signals, gain: Symbols) -> Answer:
        linear = gain["kd"] * now.error_rate + gain["kp"] * now.error
        s = now.error_rate + now.integral
        reaching = gain["reaching"] * ca.fmax(-1.0, ca.fmin(1.0, s / gain["layer"]))
        asked = now.reference_acceleration + linear + reaching
        return Answer(gain["inertia"] * asked, linear)

    knobs = (
        INERTIA,
        KD,
        KP,
        Knob("reaching", "rad/s^2", 1.0, 1e5),
        Knob("layer", "rad/s", 1e-4, 10.0),
    )
    source = "integral sliding mode, Utkin and Shi 1996, with a boundary layer, Slotine 1984"
    return Law("integral_sliding_mode", source, knobs, answer, _nothing)
