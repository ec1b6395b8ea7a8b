"""Rigid-body dynamics as CasADi expressions, over the joints and inertias of a Pinocchio model.

The ``pin`` package comes without ``pinocchio.casadi``, so that the two algorithms stand here once:

    bias torques C(q, qd) qd + g(q)   recursive Newton-Euler algorithm with qdd = 0
    inertia matrix M(q)               composite-rigid-body algorithm

after R. Featherstone, Rigid Body Dynamics Algorithms, Springer 2008, tables 5.1 and 6.2, written
with 3-vectors in each joint's own frame. Joints turn about or slide along any fixed axis and form
any tree. Exact zeros and ones of placements and axes vanish from the expressions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

SX = Any
"""A CasADi SX expression; CasADi has no types."""

# Placements are products of sines and cosines: what is this close to 0, 1 or -1 is meant as that.
_ROUNDING = 1e-15


class UnsupportedJointError(ValueError):
    """A joint that neither turns about nor slides along one fixed axis."""


Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Joint:
    """Where a joint stands on its parent, and how it moves.

    Attributes:
        parent: index of the parent, -1 for the base.
        rotation: placement in the parent's frame at joint position 0, by rows.
        offset: the same, position of the origin [m].
        axis: of the joint, in its own frame.
        slides: whether it slides along the axis instead of turning about it.
    """

    parent: int
    rotation: tuple[Vector, Vector, Vector]
    offset: Vector
    axis: Vector
    slides: bool


@dataclass(frozen=True, eq=False)
class Mass:
    """Mass properties of what a joint carries, in its frame.

    Attributes:
        mass: [kg].
        first_moment: mass times centre of mass [kg m], shape (3,).
        inertia: about the origin of the frame [kg m^2], shape (3, 3).
    """

    mass: SX
    first_moment: SX
    inertia: SX

    @classmethod
    def of_numbers(cls, numbers: Sequence[SX]) -> Mass:
        """From the ten numbers of :func:`mass_numbers`, or symbols for them."""
        mass, x, y, z, xx, xy, yy, xz, yz, zz = numbers
        rows = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        inertia = ca.vertcat(*(ca.horzcat(*row) for row in rows))
        return cls(ca.SX(mass), ca.SX(ca.vertcat(x, y, z)), ca.SX(inertia))


def joints(model: pin.Model) -> tuple[Joint, ...]:
    """The joints of a Pinocchio model, parents before children.

    Raises:
        UnsupportedJointError: a joint has more than one degree of freedom, or is a screw.
    """
    return tuple(_joint(model, i) for i in range(1, model.njoints))


def _joint(model: pin.Model, index: int) -> Joint:
    axis, slides = _axis(model, index)
    placement = model.jointPlacements[index]
    first, second, third = (_vector(_snapped(row)) for row in placement.rotation)
    return Joint(
        parent=int(model.parents[index]) - 1,
        rotation=(first, second, third),
        offset=_vector(_snapped(placement.translation)),
        axis=_vector(axis),
        slides=slides,
    )


def _vector(values: NDArray[np.float64]) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def mass_numbers(inertia: pin.Inertia) -> tuple[float, ...]:
    """m, m c_x, m c_y, m c_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz about the frame's origin."""
    return tuple(map(float, inertia.toDynamicParameters()))


def _axis(model: pin.Model, index: int) -> tuple[NDArray[np.float64], bool]:
    """The axis of a joint from its motion subspace, and whether the joint slides along it."""
    joint = model.joints[index]
    if (joint.nq, joint.nv) == (1, 1):
        data = joint.createData()
        joint.calc(data, np.zeros(model.nq), np.zeros(model.nv))
        linear, angular = np.split(np.array(data.S).reshape(6), 2)
        if not np.any(linear):
            return _snapped(angular), False
        if not np.any(angular):
            return _snapped(linear), True
    raise UnsupportedJointError(
        f"joint {model.names[index]} ({joint.shortname()}): the compiled backend knows joints "
        "that turn about or slide along one fixed axis"
    )


def _snapped(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values with the rounding errors of 0, 1 and -1 taken out."""
    nearest = np.rint(values)
    exact = (np.abs(values - nearest) < _ROUNDING) & (np.abs(nearest) <= 1.0)
    return np.where(exact, nearest, values)


@dataclass(frozen=True, eq=False)
class Placed:
    """Where a joint's frame stands in its parent's at some joint position, as expressions."""

    rotation: SX
    offset: SX

    def force_to_parent(self, force: SX, moment: SX) -> tuple[SX, SX]:
        """A force at the frame's origin and a moment, as the parent's origin feels them."""
        turned = self.rotation @ force
        return turned, self.rotation @ moment + ca.cross(self.offset, turned)


def _placed(joint: Joint, position: SX) -> Placed:
    rotation, offset = _constant(joint.rotation), _constant(joint.offset)
    if joint.slides:
        return Placed(rotation, offset + (rotation @ _constant(joint.axis)) * position)
    return Placed(rotation @ _turn(joint.axis, position), offset)


def _constant(numbers: Sequence[Any]) -> SX:
    return ca.SX(ca.DM(np.array(numbers)))


def _turn(axis: Vector, angle: SX) -> SX:
    """Rotation about an axis, after Rodrigues: a a^T + (1 - a a^T) cos + [a]x sin."""
    along = np.outer(axis, axis)
    skew = np.cross(np.eye(3), axis)  # [a]x
    return ca.SX(along) + ca.SX(np.eye(3) - along) * ca.cos(angle) + ca.SX(skew) * ca.sin(angle)


@dataclass(frozen=True, eq=False)
class Tree:
    """A robot in some posture, as expressions; each sequence has one entry a joint.

    Attributes:
        joints: parents before children.
        masses: what they carry.
        frames: where their frames stand in their parents'.
    """

    joints: Sequence[Joint]
    masses: Sequence[Mass]
    frames: Sequence[Placed]


def tree(joints: Sequence[Joint], masses: Sequence[Mass], q: SX) -> Tree:
    """The robot at joint positions q [rad or m], shape (n,)."""
    return Tree(joints, masses, [_placed(joint, q[i]) for i, joint in enumerate(joints)])


def bias_torque(robot: Tree, qd: SX, gravity: SX) -> SX:
    """C(q, qd) qd + g(q) [N m or N], shape (n,), by the recursive Newton-Euler algorithm.

    Args:
        robot: from :func:`tree`.
        qd: joint velocities, shape (n,).
        gravity: its acceleration in the base's frame [m/s^2], shape (3,).
    """
    zero = ca.SX.zeros(3)
    # Angular velocity, angular and linear acceleration, and what they take, of each body.
    spins: list[SX] = []
    turns: list[SX] = []
    lifts: list[SX] = []
    forces: list[SX] = []
    moments: list[SX] = []
    for i, (joint, mass, frame) in enumerate(
        zip(robot.joints, robot.masses, robot.frames, strict=True)
    ):
        root = joint.parent < 0
        spin, turn = (zero, zero) if root else (spins[joint.parent], turns[joint.parent])
        # A base that accelerates upwards stands in for gravity.
        lift = -gravity if root else lifts[joint.parent]
        back = frame.rotation.T
        inward = ca.cross(spin, ca.cross(spin, frame.offset))
        at_origin = lift + ca.cross(turn, frame.offset) + inward
        spin, turn, lift = back @ spin, back @ turn, back @ at_origin
        rate = _constant(joint.axis) * qd[i]
        if joint.slides:
            lift = lift + 2.0 * ca.cross(spin, rate)
        else:
            turn = turn + ca.cross(spin, rate)
            spin = spin + rate
        spins.append(spin)
        turns.append(turn)
        lifts.append(lift)
        first, inertia = mass.first_moment, mass.inertia
        forces.append(
            mass.mass * lift + ca.cross(turn, first) + ca.cross(spin, ca.cross(spin, first))
        )
        moments.append(inertia @ turn + ca.cross(spin, inertia @ spin) + ca.cross(first, lift))
    return _projected(robot, forces, moments)


def _projected(robot: Tree, forces: list[SX], moments: list[SX]) -> SX:
    """What the joints feel of the forces and moments on their bodies; the lists are used up."""
    torques: list[SX] = []
    for joint, frame in reversed([*zip(robot.joints, robot.frames, strict=True)]):
        force, moment = forces.pop(), moments.pop()
        torques.append(_along(joint, force, moment))
        if joint.parent >= 0:
            force, moment = frame.force_to_parent(force, moment)
            forces[joint.parent] += force
            moments[joint.parent] += moment
    return ca.vertcat(*reversed(torques))


def _along(joint: Joint, force: SX, moment: SX) -> SX:
    """The part of a force or a moment that the joint's drive feels."""
    return ca.dot(_constant(joint.axis), force if joint.slides else moment)


def inertia_matrix(robot: Tree, armature: Sequence[SX]) -> SX:
    """M(q), shape (n, n), by the composite-rigid-body algorithm; the armature is on its diagonal.

    Args:
        robot: from :func:`tree`.
        armature: motor inertia at the joint [kg m^2 or kg], n entries.
    """
    n, masses = len(robot.joints), list(robot.masses)
    M = ca.SX.zeros(n, n)
    for i in reversed(range(n)):
        joint, axis = robot.joints[i], _constant(robot.joints[i].axis)
        # What the bodies beyond the joint need for a unit acceleration of it.
        if joint.slides:
            force, moment = masses[i].mass * axis, ca.cross(masses[i].first_moment, axis)
        else:
            force, moment = ca.cross(axis, masses[i].first_moment), masses[i].inertia @ axis
        M[i, i] = _along(joint, force, moment) + armature[i]
        j = i
        while robot.joints[j].parent >= 0:
            force, moment = robot.frames[j].force_to_parent(force, moment)
            j = robot.joints[j].parent
            M[i, j] = M[j, i] = _along(robot.joints[j], force, moment)
        if joint.parent >= 0:
            carried = _in_parent(robot.frames[i], masses[i])
            masses[joint.parent] = _together(masses[joint.parent], carried)
    return M


def _together(one: Mass, other: Mass) -> Mass:
    return Mass(
        one.mass + other.mass,
        one.first_moment + other.first_moment,
        one.inertia + other.inertia,
    )


def _in_parent(frame: Placed, carried: Mass) -> Mass:
    """Mass properties in the parent's frame and about its origin."""
    p, turned = frame.offset, frame.rotation @ carried.first_moment
    # The parallel-axis theorem about a point that isn't the centre of mass.
    both = p @ turned.T
    shift = carried.mass * (ca.dot(p, p) * ca.SX.eye(3) - p @ p.T)
    shift += 2.0 * ca.dot(p, turned) * ca.SX.eye(3) - both - both.T
    full = frame.rotation @ carried.inertia @ frame.rotation.T + shift
    # Both triangles from one, so that the same value isn't computed twice.
    return Mass(carried.mass, turned + carried.mass * p, ca.tril2symm(ca.tril(full)))


def solve_symmetric(M: SX, right: SX) -> SX:
    """x of M x = right for a symmetric positive definite M, by M = L D L^T without pivoting."""
    n = M.shape[0]
    L, D = ca.SX.eye(n), [ca.SX(0)] * n
    for j in range(n):
        D[j] = M[j, j] - sum(L[j, k] ** 2 * D[k] for k in range(j))
        for i in range(j + 1, n):
            L[i, j] = (M[i, j] - sum(L[i, k] * L[j, k] * D[k] for k in range(j))) / D[j]
    x = [right[i] for i in range(n)]
    for i in range(n):
        x[i] = x[i] - sum(L[i, k] * x[k] for k in range(i))
    x = [value / D[i] for i, value in enumerate(x)]
    for i in reversed(range(n)):
        x[i] = x[i] - sum(L[k, i] * x[k] for k in range(i + 1, n))
    return ca.vertcat(*x)
