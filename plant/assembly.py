"""The plant: everything between a torque command and an encoder count, and its state."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from plant.drive import Drive
from plant.encoder import Encoder
from plant.flexibility import Flexibility
from plant.friction import FrictionModel
from plant.model import build_model, gravity_torque
from plant.robot import Robot

Floats = NDArray[np.float64]

RIGID_SUBSTEP_S, FLEXIBLE_SUBSTEP_S = 1e-4, 2e-5
"""The longest steps of the integrator where none is given. A spring vibrates faster than a rigid
arm moves, and the step damps it (see :mod:`plant.flexibility`)."""

# A posture at rest on its springs: each turn of the iteration gains the ratio of gravity's own
# stiffness to the springs', a few percent at most for an arm that can work.
_TURNS = 60
_TWIST_TOLERANCE_RAD = 1e-14


class PlantError(ValueError):
    """A plant that cannot run; the message says why."""


@dataclass(frozen=True, eq=False)
class Plant:
    """Everything between a torque command and an encoder count.

    Attributes:
        name: of the robot.
        model: Pinocchio model with ``armature`` set; never changed here.
        friction: of the joints, motors and gears together.
        drive: of the joints.
        encoder: of the joints.
        flexibility: of the joints; None where motors and links move as one.
    """

    name: str
    model: pin.Model
    friction: FrictionModel
    drive: Drive
    encoder: Encoder
    flexibility: Flexibility | None = None

    @property
    def joints(self) -> int:
        """Number of joints."""
        return int(self.model.nv)

    @property
    def substep_s(self) -> float:
        """The longest step of the integrator where none is given."""
        return RIGID_SUBSTEP_S if self.flexibility is None else FLEXIBLE_SUBSTEP_S


@dataclass(frozen=True, eq=False)
class PlantState:
    """The state of a plant with n joints.

    Attributes:
        q: joint positions, those of the links [rad], shape (n,); likewise the following.
        qd: joint velocities [rad/s].
        q_motor: the motors' positions as joint angles, that is, over the gear ratio [rad]; those
            of the links where joints are rigid.
        qd_motor: the motors' velocities likewise [rad/s].
        friction: internal state of the friction, n entries.
        command_Nm: the torque that the drives are told, at the joints.
        torque_Nm: the torque that they give, at the joints.
    """

    q: Floats
    qd: Floats
    q_motor: Floats
    qd_motor: Floats
    friction: list[float]
    command_Nm: Floats
    torque_Nm: Floats

    @classmethod
    def as_one(cls, q: Floats, qd: Floats, friction: list[float], torque_Nm: Floats) -> PlantState:
        """The state in which motors and links move as one, under a torque that doesn't change."""
        return cls(q, qd, q.copy(), qd.copy(), friction, torque_Nm, torque_Nm)


def build_plant(robot: Robot) -> Plant:
    """The plant of a robot.

    Raises:
        PlantError: the robot's file lacks a part.
    """
    if robot.friction is None or robot.drive is None or robot.encoder is None:
        missing = [p for p in ("friction", "drive", "encoder") if getattr(robot, p) is None]
        raise PlantError(f"robot {robot.name} has no {', '.join(missing)}: it cannot be simulated")
    return Plant(
        robot.name,
        build_model(robot),
        robot.friction,
        robot.drive,
        robot.encoder,
        robot.flexibility,
    )


def at_rest(plant: Plant, position_rad: Floats) -> PlantState:
    """At rest, held by the drives against gravity, with the friction's bristles undeflected.

    Args:
        plant: the plant.
        position_rad: what the encoders are to see, shape (n,): with flexible joints and encoders
            on the motors, the links hang lower.

    Raises:
        PlantError: the drives cannot hold the posture, or the springs cannot.
    """
    links = _links_at_rest(plant, position_rad)
    held = gravity_torque(plant.model, links)
    if np.any(np.abs(held) > plant.drive.torque_limit_Nm):
        raise PlantError(f"the drives of {plant.name} cannot hold its start posture")
    state = PlantState.as_one(links, np.zeros(plant.joints), plant.friction.at_rest(), held)
    if plant.flexibility is None:
        return state
    return replace(state, q_motor=links + plant.flexibility.twist(held))


def _links_at_rest(plant: Plant, position_rad: Floats) -> Floats:
    """q of q + twist(g(q)) = position where the encoders are on the motors, else the position."""
    links: Floats = position_rad.copy()
    if plant.flexibility is None or plant.encoder.mounted == "joint":
        return links
    for _ in range(_TURNS):
        before = links
        links = position_rad - plant.flexibility.twist(gravity_torque(plant.model, before))
        if np.all(np.abs(links - before) <= _TWIST_TOLERANCE_RAD):
            return links
    raise PlantError(f"the joints of {plant.name} are too soft to hold its start posture")
