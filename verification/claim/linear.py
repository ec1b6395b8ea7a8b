"""Why late torques and flexible joints vibrate: time delay control of one joint, without friction.

A motor of inertia J drives a link of inertia M through a spring K and a damper D
(:mod:`plant.flexibility`); the controller sees the motor and is Hsia's, the linear one of Table II
(Exp01), with reference 0 and the sample time L:

    u(k) = u(k-1) - Mbar (KD (theta(k) - theta(k-1))/L + KP theta(k)
                          + (theta(k) - 2 theta(k-1) + theta(k-2))/L^2)

The plant feels u(k-1) until the delay d L and u(k) from then on, and moves exactly as it should
meanwhile. The loop is stable where all eigenvalues of a tick are within the unit circle.

Without a link and for KD = KP = 0 the torque's part of it is

    z^3 - (1 - r c0) z^2 + r c1 z + r c2 = 0,    r = Mbar/J,
    c0 = (1 - d)^2/2,    c2 = d^2/2,    c1 = 1 - c0 - c2

of which d = 0 gives r < 2. Above the resonance a spring leaves the motor alone: it is then J, not
the inertia of the whole joint, that Mbar has to suit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

from codegen.controller import Controller, load
from plant.assembly import Plant, PlantError, build_plant
from plant.campaign.specification import read
from plant.flexibility import Flexibility
from plant.flight import default_robot
from plant.robot import load_robot

Floats = NDArray[np.float64]

_SCANNED = np.linspace(0.0, 1.0, 201)


@dataclass(frozen=True)
class Joint:
    """One joint and its controller.

    Attributes:
        rotor_kgm2: J > 0, at the joint.
        link_kgm2: M > 0.
        stiffness_Nm_per_rad: K >= 0.
        damping_Nms_per_rad: D >= 0.
        mbar_kgm2: Mbar.
        kd_per_s: KD.
        kp_per_s2: KP.
        sample_time_s: L.
    """

    rotor_kgm2: float
    link_kgm2: float
    stiffness_Nm_per_rad: float
    damping_Nms_per_rad: float
    mbar_kgm2: float
    kd_per_s: float
    kp_per_s2: float
    sample_time_s: float

    def stiffer(self, factor: float) -> Joint:
        """With so many times the stiffness and the same damping ratio."""
        return replace(
            self,
            stiffness_Nm_per_rad=factor * self.stiffness_Nm_per_rad,
            damping_Nms_per_rad=float(np.sqrt(factor)) * self.damping_Nms_per_rad,
        )


def joints_of(specification: Path) -> tuple[Joint, ...]:
    """The joints of a campaign's nominal plant in its first posture, with Hsia's controller.

    Raises:
        SpecificationError, RobotError, PlantError: they can't be used.
    """
    campaign = read(specification)
    controller = load(specification.parent / campaign.controller, experiment="Exp01")
    robot = load_robot(campaign.robot or default_robot(controller))
    plant = build_plant(robot)
    if plant.flexibility is None or robot.trajectory is None:
        raise PlantError(f"robot {robot.name} needs [flexibility] and [trajectory]: add them")
    start = robot.trajectory.start_rad
    return tuple(
        _joint(plant, plant.flexibility, controller, j, start) for j in range(plant.joints)
    )


def _joint(
    plant: Plant, springs: Flexibility, controller: Controller, index: int, position_rad: Floats
) -> Joint:
    """A joint of a robot in a posture, shape (n,), all other joints free."""
    model = pin.Model(plant.model)
    model.armature = np.zeros(model.nv)
    inverse = pin.computeMinverse(model, model.createData(), position_rad)
    joint = controller.joints[index]
    return Joint(
        rotor_kgm2=float(plant.model.armature[index]),
        link_kgm2=1.0 / float(inverse[index, index]),
        stiffness_Nm_per_rad=float(springs.stiffness_Nm_per_rad[index]),
        damping_Nms_per_rad=float(springs.damping_Nms_per_rad[index]),
        mbar_kgm2=float(joint.inertia),
        kd_per_s=float(joint.kd),
        kp_per_s2=float(joint.kp),
        sample_time_s=float(controller.sample_time),
    )


def tick(joint: Joint, delay: float) -> Floats:
    """The matrix of a tick.

    Args:
        joint: the joint.
        delay: d, from 0 to 1.

    Returns:
        Shape (7, 7), for (theta, thetad, q, qd, u(k-1), theta(k-1), theta(k-2)).
    """
    K, D = joint.stiffness_Nm_per_rad, joint.damping_Nms_per_rad
    motion = np.zeros((5, 5))  # theta, thetad, q, qd and the torque
    spring = np.array([-K, -D, K, D])
    motion[0, 1] = motion[2, 3] = 1.0
    motion[1, :4] = spring / joint.rotor_kgm2
    motion[3, :4] = -spring / joint.link_kgm2
    motion[1, 4] = 1.0 / joint.rotor_kgm2
    L = joint.sample_time_s
    before, after = (expm(motion * share * L)[:4] for share in (delay, 1.0 - delay))
    law = np.zeros(7)
    law[0] = -joint.mbar_kgm2 * (joint.kd_per_s / L + joint.kp_per_s2 + 1.0 / L**2)
    law[5] = joint.mbar_kgm2 * (joint.kd_per_s / L + 2.0 / L**2)
    law[6] = -joint.mbar_kgm2 / L**2
    law[4] = 1.0
    matrix = np.zeros((7, 7))
    matrix[:4, :5] = after[:, :4] @ before
    matrix[:4] += np.outer(after[:, 4], law)
    matrix[4] = law
    matrix[5, 0] = matrix[6, 5] = 1.0
    return matrix


def radius(joint: Joint, delay: float) -> float:
    """The largest magnitude of the loop's eigenvalues; stable below 1."""
    return float(np.abs(np.linalg.eigvals(tick(joint, delay))).max())


def motor_bound(joint: Joint) -> float:
    """The delay up to which Mbar suits the motor alone, as a fraction of L; at most 1."""
    ratio = joint.mbar_kgm2 / joint.rotor_kgm2
    excess = [_torque_radius(ratio, d) - 1.0 for d in _SCANNED]
    beyond = np.flatnonzero(np.array(excess) >= 0.0)
    if not len(beyond):
        return 1.0
    first = int(beyond[0])
    if first == 0:
        return 0.0
    ends = _SCANNED[first - 1], _SCANNED[first]
    return float(brentq(lambda d: _torque_radius(ratio, d) - 1.0, *ends))


def _torque_radius(ratio: float, delay: float) -> float:
    """The largest root of the cubic above."""
    c0, c2 = (1.0 - delay) ** 2 / 2.0, delay**2 / 2.0
    roots = np.roots([1.0, ratio * c0 - 1.0, ratio * (1.0 - c0 - c2), ratio * c2])
    return float(np.abs(roots).max())
