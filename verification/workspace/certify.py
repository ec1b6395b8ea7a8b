"""Certified bounds of all eigenvalues of M(q)^-1 Mbar over the workspace of a robot.

Condition (33) of M. Jin, S. H. Kang, P. H. Chang, J. Lee, IEEE/ASME Transactions on Mechatronics
22(5), 2017, ||I - M^-1 Mbar|| < 1, is taken in the norm in which M^-1 Mbar is symmetric, since the
spectral norm can be too large for any scaling of Mbar. It then says that every eigenvalue of
M^-1 Mbar is below 2; they are always positive.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from plant.compiled.rigid_body import Joint, UnsupportedJointError, joints
from plant.model import build_model
from plant.robot import Robot
from verification.workspace.check import complaints
from verification.workspace.search import Cell, Inertia, Sampled, boxes, sample

LIMIT = 2
"""Of the eigenvalues of M^-1 Mbar in condition (33)."""
MAX_COORDINATES = 3
"""Joint positions on which M may depend; with more, the boxes would be too many."""
TOLERANCES = (2.0**-9, 2.0**-7, 2.0**-5, 2.0**-3)
"""How far a bound may be from the outermost sample, relative; the first that works is taken."""
_DIGITS = 6
_TURN_DEG = 360


class WorkspaceError(ValueError):
    """Nothing can be certified for a robot and an Mbar; the message says what to do."""


@dataclass(frozen=True)
class Certified:
    """Bounds of all eigenvalues of M(q)^-1 Mbar, at every q of the workspace.

    Attributes:
        low: rational number below all of them.
        high: rational number above all of them.
        sampled: least and largest that was found, which is how tight the bounds are.
        boxes: on how many boxes the checker proves it.
        certificate: what the checker verifies, as JSON has it.
        complaints: the checker's; none if it is proved.
    """

    low: Fraction
    high: Fraction
    sampled: Sampled
    boxes: int
    certificate: dict[str, Any]
    complaints: tuple[str, ...]

    @property
    def proved(self) -> bool:
        """Whether the independent checker agrees."""
        return not self.complaints

    @property
    def holds_33(self) -> bool:
        """Whether condition (33) is proved."""
        return self.proved and self.high <= LIMIT

    @property
    def largest_scaling(self) -> Fraction:
        """By what Mbar may be multiplied so that (33) is still certified; rounded down."""
        return _rounded(LIMIT / self.high, -1)


def certified_eigenvalues(
    robot: Robot, Mbar: Sequence[Fraction | float], *, within_ranges: bool = False
) -> Certified:
    """Finds bounds of the eigenvalues of M(q)^-1 Mbar and has them checked.

    Args:
        robot: links and motors; its friction, elasticity and encoders play no part.
        Mbar: diagonal [kg m^2], one number for each joint; taken exactly.
        within_ranges: only over the ranges of the joints in the robot's file, where it has them;
            else every joint turns all around.

    Raises:
        WorkspaceError: Mbar does not fit, a joint slides, or M depends on too many joints.
    """
    if len(Mbar) != robot.joints:
        raise WorkspaceError(
            f"Mbar has {len(Mbar)} joints, {robot.name} has {robot.joints}: give the robot of "
            "the controller, or lock the joints that it does not move"
        )
    if not all(0 < x < math.inf for x in Mbar):
        shown = ", ".join(f"{float(x):g}" for x in Mbar)
        raise WorkspaceError(f"Mbar = [{shown}]: must be > 0; give finite inertias in kg m^2")
    model = build_model(robot)
    try:
        chain = joints(model)
    except UnsupportedJointError as error:
        raise WorkspaceError(f"{robot.name}: {error}") from error
    _refuse(robot, chain)
    ranges = [_range(robot, i, within_ranges) for i, joint in enumerate(chain) if joint.parent >= 0]
    low, high = (
        np.array([2.0 * math.pi * float(r[k]) for r in ranges], dtype=np.float64) for k in (0, 1)
    )
    inertia = Inertia(model, [float(x) for x in Mbar])
    found = sample(inertia, low, high)
    sides = {
        "low": _side(inertia, low, high, found.low, -1),
        "high": _side(inertia, low, high, found.high, 1),
    }
    certificate = {
        "robot": _numbers(model, chain),
        "inertia_kgm2": [_text(x) for x in Mbar],
        "range_turns": [[str(a), str(b)] for a, b in ranges],
        **{name: {"r": str(r), "boxes": cells} for name, (r, cells) in sides.items()},
    }
    return Certified(
        low=sides["low"][0],
        high=sides["high"][0],
        sampled=found,
        boxes=sum(len(cells) for _, cells in sides.values()),
        certificate=certificate,
        complaints=tuple(complaints(certificate)),
    )


def _refuse(robot: Robot, chain: Sequence[Joint]) -> None:
    """A robot that takes too long, or whose workspace is no box of angles."""
    for name, joint in zip(robot.joint_names, chain, strict=True):
        if joint.slides:
            raise WorkspaceError(
                f"{robot.name}: joint {name} slides: lock it, only turns are known"
            )
    coordinates = sum(joint.parent >= 0 for joint in chain)
    if coordinates > MAX_COORDINATES:
        raise WorkspaceError(
            f"{robot.name}: M depends on {coordinates} joint positions, at most {MAX_COORDINATES} "
            "can be certified: lock joints in the robot's file, such as the wrist"
        )


def _range(robot: Robot, joint: int, within: bool) -> tuple[Fraction, Fraction]:
    """Of a joint's position, in turns."""
    given = robot.chain[robot.moving[joint]].range_deg if within else None
    if given is None:
        return Fraction(0), Fraction(1)
    low, high = (Fraction(x) / _TURN_DEG for x in given)
    return (low, high) if 0 < high - low < 1 else (Fraction(0), Fraction(1))


def _side(
    inertia: Inertia, low: NDArray[np.float64], high: NDArray[np.float64], sampled: float, sign: int
) -> tuple[Fraction, list[Cell]]:
    """A bound near the outermost sample, and the boxes on which it can be proved."""
    for tolerance in TOLERANCES:
        r = _rounded(sampled * (1.0 + sign * tolerance), sign)
        cells = boxes(inertia, low, high, float(r), sign)
        if cells is not None:
            return r, cells
    raise WorkspaceError(
        f"no bound within {TOLERANCES[-1]:.1%} of the sampled eigenvalue {sampled:.6g} can be "
        "certified: take smaller ranges, or check that M(q) is positive definite"
    )


def _rounded(value: Fraction | float, sign: int) -> Fraction:
    """To a few digits, away from the eigenvalues."""
    unit = Fraction(10) ** (math.floor(math.log10(value)) + 1 - _DIGITS)
    steps = Fraction(value) / unit
    return unit * (math.ceil(steps) if sign > 0 else math.floor(steps))


def _numbers(model: pin.Model, chain: Sequence[Joint]) -> list[dict[str, Any]]:
    """What the checker needs of the robot, each double exactly."""
    return [
        {
            "parent": joint.parent,
            "rotation": [[_text(x) for x in row] for row in joint.rotation],
            "offset_m": [_text(x) for x in joint.offset],
            "axis": [_text(x) for x in joint.axis],
            "mass_kg": _text(body.mass),
            "center_of_mass_m": [_text(x) for x in body.lever],
            "inertia_kgm2": [[_text(x) for x in row] for row in body.inertia],
            "armature_kgm2": _text(armature),
        }
        for joint, body, armature in zip(
            chain, list(model.inertias)[1:], model.armature, strict=True
        )
    ]


def _text(value: Fraction | float) -> str:
    return str(Fraction(value))
