"""The arm in MuJoCo, which shares no code with Pinocchio: for checks and for comparison.

A URDF is read by MuJoCo's own reader. Of links, the model is built by a route of its own. Pinocchio
has its frames at the joints, so ``plant.model`` moves the mass properties there. Here each body's
frame is the link's own: mass properties enter as they are written, and it is the joint's axis that
is expressed in the link's frame. A locked joint is a body without a joint.

MuJoCo is installed for tests and benches only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from plant.robot import InertiaTensor, Link, LinksTable, Robot
from plant.urdf import UrdfBody

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class _Placement:
    """A link's frame in that of the link before, at q = 0, and its joint in the link's own frame.

    Attributes:
        position_m: the frame's origin in the frame before.
        joint_axis: unit vector of the joint's axis in the link's frame.
        joint_position_m: a point of the axis in the link's frame.
    """

    position_m: tuple[float, float, float]
    joint_axis: tuple[float, float, float]
    joint_position_m: tuple[float, float, float]


def _placement(link: Link, convention: str) -> _Placement:
    """Craig's (modified) frame lies on its own joint's axis, the standard one on the next joint's.

    Both are turned by alpha about x, which the frames before and after have in common.
    """
    a, d, alpha = link.a_m, link.d_m, np.deg2rad(link.alpha_deg)
    sin, cos = float(np.sin(alpha)), float(np.cos(alpha))
    if convention == "standard-dh":
        return _Placement((a, 0.0, d), (0.0, sin, cos), (-a, -d * sin, -d * cos))
    return _Placement((a, -d * sin, d * cos), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))


def _principal(t: InertiaTensor) -> tuple[Floats, Floats]:
    """Principal moments [kg m^2] and the unit quaternion (w, x, y, z) of their axes."""
    moments, axes = np.linalg.eigh([[t.xx, t.xy, t.xz], [t.xy, t.yy, t.yz], [t.xz, t.yz, t.zz]])
    quaternion = np.zeros(4)
    # A rotation, not a reflection: eigenvectors may form a left-handed triple.
    mujoco.mju_mat2Quat(quaternion, (axes * np.linalg.det(axes)).ravel())
    return moments, quaternion


def mujoco_model(
    robot: Robot, timestep_s: float, coulomb_Nm: Floats | None = None, *, fourth_order: bool = False
) -> Any:
    """The arm in MuJoCo: hinges and armature, no geometry, so no contacts.

    Args:
        robot: its links and motors.
        timestep_s: MuJoCo's step.
        coulomb_Nm: MuJoCo's frictionloss at the moving joints, shape (n,); none if not given.
        fourth_order: Runge-Kutta of order four instead of semi-implicit Euler.

    Returns:
        A ``mujoco.MjModel``.
    """
    loss = np.zeros(robot.joints) if coulomb_Nm is None else coulomb_Nm
    motors = [*zip(robot.armature_kgm2, loss, strict=True)]
    body = robot.body
    spec = _of_links(body, robot) if isinstance(body, LinksTable) else _of_urdf(body, robot)
    for joint, (armature, frictionloss) in zip(spec.joints, motors, strict=True):
        joint.armature, joint.frictionloss = armature, frictionloss
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    spec.option.gravity = [0.0, 0.0, -body.gravity_m_per_s2]
    if fourth_order:
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.timestep = timestep_s
    model = spec.compile()
    if isinstance(body, LinksTable):
        _write_inertia(model, body)
    return model


def _of_urdf(body: UrdfBody, robot: Robot) -> Any:
    spec = mujoco.MjSpec.from_string(body.xml)
    # Joints that follow others are locked; MuJoCo has read that as constraints.
    for constraint in spec.equalities:
        spec.delete(constraint)
    for joint in spec.joints:
        if joint.name in robot.locked_names:
            spec.delete(joint)
    # Branches may stand in another order than Pinocchio's; the columns are in that one.
    assert tuple(joint.name for joint in spec.joints) == robot.joint_names
    return spec


def _of_links(links: LinksTable, robot: Robot) -> Any:
    spec = mujoco.MjSpec()
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    body = spec.worldbody
    for index, link in enumerate(links.chain):
        placement = _placement(link, links.convention)
        half = np.deg2rad(link.alpha_deg) / 2
        body = body.add_body(
            name=f"link_{index + 1}",
            pos=placement.position_m,
            quat=[np.cos(half), np.sin(half), 0.0, 0.0],
            explicitinertial=True,
            mass=1.0,
            inertia=[1.0, 1.0, 1.0],
            ipos=link.center_of_mass_m,
            iquat=_principal(link.inertia_kgm2)[1],
        )
        if index in robot.moving:
            body.add_joint(
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=placement.joint_axis,
                pos=placement.joint_position_m,
            )
    return spec


def _write_inertia(model: Any, links: LinksTable) -> None:
    """Gives a compiled model the links' mass properties.

    MuJoCo's compiler refuses the published waist, which has an inertia about one axis and no mass:
    no body is like that. What it has compiled may be given such numbers.
    """
    model.body_mass[1:] = [link.mass_kg for link in links.chain]
    model.body_inertia[1:] = [_principal(link.inertia_kgm2)[0] for link in links.chain]
    mujoco.mj_setConst(model, mujoco.MjData(model))
