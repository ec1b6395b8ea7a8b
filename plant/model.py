"""Rigid-body dynamics: a Pinocchio model of a URDF or of Denavit-Hartenberg links.

Pinocchio reads a URDF itself; of links, its model is built here. Pinocchio's frames stand at the
joints. One link transform of either convention is therefore split at the joint's rotation into what
comes before it and what comes after it:

    standard DH:   Rz(q) Tz(d) Tx(a) Rx(alpha)    nothing before,        Tz(d) Tx(a) Rx(alpha) after
    modified DH:   Rx(alpha) Tx(a) Rz(q) Tz(d)    Rx(alpha) Tx(a) before, Tz(d) after

A link's mass properties are given in its own frame, which is the one after both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from plant.robot import Link, LinksTable, Robot, RobotError
from plant.urdf import UrdfBody


@dataclass(frozen=True, eq=False)
class Dynamics:
    """The terms of M(q) qdd + C(q, qd) qd + g(q) = tau for one state of n joints.

    Attributes:
        M: inertia matrix, motor inertia included [kg m^2], shape (n, n).
        C: Coriolis matrix in Christoffel form [N m s], shape (n, n).
        g: gravity torque [N m], shape (n,).
        tau: torque for the given acceleration without friction [N m], shape (n,).
    """

    M: NDArray[np.float64]
    C: NDArray[np.float64]
    g: NDArray[np.float64]
    tau: NDArray[np.float64]


def _around_joint(link: Link, convention: str) -> tuple[pin.SE3, pin.SE3]:
    """The parts of the link transform before and after the joint's rotation."""
    twist = pin.SE3(pin.utils.rotate("x", np.deg2rad(link.alpha_deg)), np.array([link.a_m, 0, 0]))
    offset = pin.SE3(np.eye(3), np.array([0, 0, link.d_m]))
    if convention == "standard-dh":
        return pin.SE3.Identity(), offset * twist
    return twist, offset


def build_model(robot: Robot) -> pin.Model:
    """The Pinocchio model of a robot; its configuration holds the moving joints only.

    A locked joint's link becomes a part of the body that carries it. Its motor's inertia then acts
    on nothing: armature is what the joint's own rotation feels.

    Args:
        robot: from :func:`plant.robot.load_robot`.

    Returns:
        A model with ``armature`` set, gravity along -z of the base and a frame ``link_K`` for the
        link that joint K = 1, 2, ... moves; locked joints count.

    Raises:
        RobotError: Pinocchio can't read the robot's URDF.
    """
    body = robot.body
    model = _of_links(body, robot) if isinstance(body, LinksTable) else _of_urdf(body, robot)
    model.name = robot.name
    model.gravity.linear = np.array([0.0, 0.0, -body.gravity_m_per_s2])
    # rotorInertia and rotorGearRatio are stored by Pinocchio but enter neither rnea nor aba.
    model.armature = robot.armature_kgm2
    return model


def _of_links(links: LinksTable, robot: Robot) -> pin.Model:
    model = pin.Model()
    parent, placement = 0, pin.SE3.Identity()
    for index, link in enumerate(links.chain):
        before, after = _around_joint(link, links.convention)
        placement = placement * before
        if index in robot.moving:
            parent = model.addJoint(parent, pin.JointModelRZ(), placement, link.name)
            placement = pin.SE3.Identity()
        placement = placement * after
        inertia = pin.Inertia(
            link.mass_kg, np.array(link.center_of_mass_m), link.inertia_kgm2.matrix()
        )
        model.appendBodyToJoint(parent, inertia, placement)
        model.addFrame(pin.Frame(f"link_{index + 1}", parent, placement, pin.FrameType.BODY))
    return model


def _of_urdf(body: UrdfBody, robot: Robot) -> pin.Model:
    try:
        model = pin.buildModelFromXML(body.with_fixed(robot.moving))
    except ValueError as error:
        raise RobotError(f"{robot.name}: Pinocchio can't read its URDF: {error}") from error
    # Columns of the robot file belong to the joints in the order of the chain.
    assert tuple(model.names)[1:] == robot.joint_names
    for index, joint in enumerate(body.chain):
        frame = model.frames[model.getBodyId(joint.link)]
        model.addFrame(
            pin.Frame(f"link_{index + 1}", frame.parentJoint, frame.placement, pin.FrameType.BODY)
        )
    return model


def dynamics(
    model: pin.Model,
    q: NDArray[np.float64],
    qd: NDArray[np.float64],
    qdd: NDArray[np.float64],
) -> Dynamics:
    """All terms of the equation of motion, eq. (1) of Jin et al. 2017 without friction.

    Args:
        model: from :func:`build_model`.
        q: joint positions [rad], shape (n,).
        qd: joint velocities [rad/s], shape (n,).
        qdd: joint accelerations [rad/s^2], shape (n,).
    """
    data = model.createData()
    return Dynamics(
        M=pin.crba(model, data, q).copy(),
        C=pin.computeCoriolisMatrix(model, data, q, qd).copy(),
        g=pin.computeGeneralizedGravity(model, data, q).copy(),
        tau=pin.rnea(model, data, q, qd, qdd).copy(),
    )


def gravity_torque(model: pin.Model, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """The torque [N m] that holds the posture q [rad], both of shape (n,)."""
    torque: NDArray[np.float64] = pin.computeGeneralizedGravity(model, model.createData(), q)
    return torque.copy()


def energy(model: pin.Model, q: NDArray[np.float64], qd: NDArray[np.float64]) -> float:
    """Kinetic energy, that of the motors included, plus potential energy [J]; q, qd shape (n,)."""
    return float(pin.computeMechanicalEnergy(model, model.createData(), q, qd))


def link_placement(model: pin.Model, q: NDArray[np.float64], link: int) -> NDArray[np.float64]:
    """The homogeneous transform, shape (4, 4), from a link's frame to the base.

    Args:
        model: from :func:`build_model`.
        q: joint positions [rad], shape (n,).
        link: number of the link from 1, that of the joint that moves it; locked joints count.
    """
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    transform: NDArray[np.float64] = data.oMf[model.getFrameId(f"link_{link}")].homogeneous
    return transform
