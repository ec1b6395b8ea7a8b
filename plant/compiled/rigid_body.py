"""Rigid-body dynamics as CasADi expressions, over the joints and inertias of a Pinocchio model.

The ``pin`` package comes without ``pinocchio.casadi``, so that the two algorithms stand here once:

    bias torques C(q, qd) qd + g(q)   recursive Newton-Euler algorithm with qdd = 0
    inertia matrix M(q)               composite-rigid-body algorithm

after R. Featherstone, Rigid Body Dynamics Algorithms, Springer 2008, tables 5.1 and 6.2, written
with 3-vectors in each joint's own frame. Joints turn about or slide along any fixed axis and form
any tree. Exact zeros and ones of the placements vanish from the expressions.
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


@dataclass(frozen=True, eq=False)
class Body:
    """A joint and the body that it carries, in the joint's own frame.

    Attributes:
        parent: index of the parent's body, -1 for the base.
        rotation: placement in the parent's frame at joint position 0, shape (3, 3).
        offset: the same, position of the origin [m], shape (3,).
        axis: of the joint, shape (3,).
        slides: whether it slides along the axis instead of turning about it.
        mass: [kg].
        first_moment: mass times centre of mass [kg m], shape (3,).
        inertia: about the origin of the frame [kg m^2], shape (3, 3).
    """

    parent: int
    rotation: NDArray[np.float64]
    offset: NDArray[np.float64]
    axis: NDArray[np.float64]
    slides: bool
    mass: float
    first_moment: NDArray[np.float64]
    inertia: NDArray[np.float64]


def bodies(model: pin.Model) -> tuple[Body, ...]:
    """The moving bodies of a Pinocchio model, parents before children.

    Raises:
        UnsupportedJointError: a joint has more than one degree of freedom, or is a screw.
    """
    return tuple(_body(model, i) for i in range(1, model.njoints))


def _body(model: pin.Model, index: int) -> Body:
    axis, slides = _axis(model, index)
    placement, inertia = model.jointPlacements[index], model.inertias[index]
    mass, center = float(inertia.mass), np.array(inertia.lever)
    shift = np.dot(center, center) * np.eye(3) - np.outer(center, center)
    return Body(
        parent=int(model.parents[index]) - 1,
        rotation=_snapped(placement.rotation),
        offset=_snapped(placement.translation),
        axis=axis,
        slides=slides,
        mass=mass,
        first_moment=mass * center,
        inertia=np.array(inertia.inertia) + mass * shift,
    )


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


def _placed(body: Body, position: SX) -> Placed:
    rotation, offset = ca.SX(body.rotation), ca.SX(body.offset)
    if body.slides:
        return Placed(rotation, offset + (rotation @ ca.SX(body.axis)) * position)
    return Placed(rotation @ _turn(body.axis, position), offset)


def _turn(axis: NDArray[np.float64], angle: SX) -> SX:
    """Rotation about an axis, after Rodrigues: a a^T + (1 - a a^T) cos + [a]x sin."""
    along = np.outer(axis, axis)
    skew = np.cross(np.eye(3), axis)  # [a]x
    return ca.SX(along) + ca.SX(np.eye(3) - along) * ca.cos(angle) + ca.SX(skew) * ca.sin(angle)


def placements(chain: Sequence[Body], q: SX) -> tuple[Placed, ...]:
    """All joint frames in their parents' at joint positions q [rad or m], shape (n,)."""
    return tuple(_placed(body, q[i]) for i, body in enumerate(chain))


def bias_torque(
    chain: Sequence[Body], frames: Sequence[Placed], qd: SX, gravity: NDArray[np.float64]
) -> SX:
    """C(q, qd) qd + g(q) [N m or N], shape (n,), by the recursive Newton-Euler algorithm.

    Args:
        chain: from :func:`bodies`.
        frames: from :func:`placements`.
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
    for i, (body, frame) in enumerate(zip(chain, frames, strict=True)):
        root = body.parent < 0
        spin, turn = (zero, zero) if root else (spins[body.parent], turns[body.parent])
        # A base that accelerates upwards stands in for gravity.
        lift = ca.SX(-gravity) if root else lifts[body.parent]
        back = frame.rotation.T
        inward = ca.cross(spin, ca.cross(spin, frame.offset))
        at_origin = lift + ca.cross(turn, frame.offset) + inward
        spin, turn, lift = back @ spin, back @ turn, back @ at_origin
        rate = ca.SX(body.axis) * qd[i]
        if body.slides:
            lift = lift + 2.0 * ca.cross(spin, rate)
        else:
            turn = turn + ca.cross(spin, rate)
            spin = spin + rate
        spins.append(spin)
        turns.append(turn)
        lifts.append(lift)
        moment_of_mass, inertia = ca.SX(body.first_moment), ca.SX(body.inertia)
        forces.append(
            body.mass * lift
            + ca.cross(turn, moment_of_mass)
            + ca.cross(spin, ca.cross(spin, moment_of_mass))
        )
        moments.append(
            inertia @ turn + ca.cross(spin, inertia @ spin) + ca.cross(moment_of_mass, lift)
        )
    torques: list[SX] = [None] * len(chain)
    for i in reversed(range(len(chain))):
        body = chain[i]
        torques[i] = ca.dot(ca.SX(body.axis), forces[i] if body.slides else moments[i])
        if body.parent >= 0:
            force, moment = frames[i].force_to_parent(forces[i], moments[i])
            forces[body.parent] += force
            moments[body.parent] += moment
    return ca.vertcat(*torques)


def inertia_matrix(
    chain: Sequence[Body], frames: Sequence[Placed], armature: NDArray[np.float64]
) -> SX:
    """M(q), shape (n, n), by the composite-rigid-body algorithm; the armature is on its diagonal.

    Args:
        chain: from :func:`bodies`.
        frames: from :func:`placements`.
        armature: motor inertia at the joint [kg m^2 or kg], shape (n,).
    """
    n = len(chain)
    masses: list[SX] = [body.mass for body in chain]
    firsts = [ca.SX(body.first_moment) for body in chain]
    inertias = [ca.SX(body.inertia) for body in chain]
    M = ca.SX.zeros(n, n)
    for i in reversed(range(n)):
        body, frame = chain[i], frames[i]
        axis = ca.SX(body.axis)
        # What the bodies beyond the joint need for a unit acceleration of it.
        if body.slides:
            force, moment = masses[i] * axis, ca.cross(firsts[i], axis)
        else:
            force, moment = ca.cross(axis, firsts[i]), inertias[i] @ axis
        M[i, i] = ca.dot(axis, force if body.slides else moment) + armature[i]
        j = i
        while chain[j].parent >= 0:
            force, moment = frames[j].force_to_parent(force, moment)
            j = chain[j].parent
            M[i, j] = M[j, i] = ca.dot(ca.SX(chain[j].axis), force if chain[j].slides else moment)
        if body.parent >= 0:
            first, inertia = _in_parent(frame, masses[i], firsts[i], inertias[i])
            masses[body.parent] += masses[i]
            firsts[body.parent] += first
            inertias[body.parent] += inertia
    return M


def _in_parent(frame: Placed, mass: SX, first: SX, inertia: SX) -> tuple[SX, SX]:
    """First moment and inertia in the parent's frame and about its origin."""
    p, turned = frame.offset, frame.rotation @ first
    # The parallel-axis theorem about a point that isn't the centre of mass.
    both = p @ turned.T
    shift = mass * (ca.dot(p, p) * ca.SX.eye(3) - p @ p.T)
    shift += 2.0 * ca.dot(p, turned) * ca.SX.eye(3) - both - both.T
    full = frame.rotation @ inertia @ frame.rotation.T + shift
    # Both triangles from one, so that the same value isn't computed twice.
    return turned + mass * p, ca.tril2symm(ca.tril(full))


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
