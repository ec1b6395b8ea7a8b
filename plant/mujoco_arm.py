"""The arm in MuJoCo, which shares no code with Pinocchio: for checks and for comparison.

The model is built from the numbers of the robot files by a route of its own. Pinocchio has its
frames at the joints, so ``plant.model`` moves the mass properties there. Here each body's frame is
the link's own: mass properties enter as they are written, and it is the joint's axis that is
expressed in the link's frame. A locked joint is a body without a joint.

MuJoCo is installed for tests and benches only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from plant.robot import InertiaTensor, Link, Robot

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
    spec = mujoco.MjSpec()
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    spec.option.gravity = [0.0, 0.0, -robot.links.gravity_m_per_s2]
    if fourth_order:
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.timestep = timestep_s
    loss = np.zeros(robot.joints) if coulomb_Nm is None else coulomb_Nm
    frictionloss = dict(zip(robot.moving, loss, strict=True))
    armature = dict(zip(robot.moving, robot.armature_kgm2, strict=True))
    principal = [_principal(link.inertia_kgm2) for link in robot.links.chain]
    body = spec.worldbody
    for index, (link, (_, axes)) in enumerate(zip(robot.links.chain, principal, strict=True)):
        placement = _placement(link, robot.links.convention)
        half = np.deg2rad(link.alpha_deg) / 2
        body = body.add_body(
            name=f"link_{index + 1}",
            pos=placement.position_m,
            quat=[np.cos(half), np.sin(half), 0.0, 0.0],
            explicitinertial=True,
            mass=1.0,
            inertia=[1.0, 1.0, 1.0],
            ipos=link.center_of_mass_m,
            iquat=axes,
        )
        if index in armature:
            body.add_joint(
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=placement.joint_axis,
                pos=placement.joint_position_m,
                armature=armature[index],
                frictionloss=frictionloss[index],
            )
    model = spec.compile()
    # MuJoCo's compiler refuses the published waist, which has an inertia about one axis and no
    # mass: no body is like that. What it has compiled may be given such numbers.
    model.body_mass[1:] = [link.mass_kg for link in robot.links.chain]
    model.body_inertia[1:] = [moments for moments, _ in principal]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model
