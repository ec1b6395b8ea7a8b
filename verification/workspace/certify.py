"""Certified bounds of all eigenvalues of M(q)^-1 Mbar over the workspace of a robot.

Condition (33) of M. Jin, S. H. Kang, P. H. Chang, J. Lee, IEEE/ASME Transactions on Mechatronics
22(5), 2017, ||I - M^-1 Mbar|| < 1, is taken in the norm in which M^-1 Mbar is symmetric, since the
spectral norm can be too large for any scaling of Mbar. It then says that every eigenvalue of
M^-1 Mbar is below 2; they are always positive.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import pinocchio as pin

from plant.compiled.rigid_body import Joint, UnsupportedJointError, joints
from plant.model import build_model
from plant.robot import Robot
from verification.workspace.check import complaints
from verification.workspace.search import Cell, Inertia, Refinement, Sampled, sample

LIMIT = 2
"""Of the eigenvalues of M^-1 Mbar in condition (33)."""
MAX_COORDINATES = 6
"""Joint positions on which M may depend; with more, the checker's sums would be too long."""
TOLERANCES = tuple(2.0**-k for k in range(-2, 10))
"""How far a bound may be from the outermost sample, relative; each builds on the one before."""
TIGHT = 1.01 * TOLERANCES[-1]
"""What bounds are called tight: the finest of the tolerances was reached, and then rounded."""
STAGES = 2 * len(TOLERANCES) + 1
"""How often progress is told: of each tolerance on both sides, and of the check."""
_WORK = 2**24
"""Control matrices on each side, a quarter of a minute; then the bounds stay coarser."""
_FEWER = 16
"""By so much fewer with the most coordinates, whose control matrices take longer."""
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
    def pessimism(self) -> tuple[float, float]:
        """How far the outermost eigenvalues may at most be inside the low and the high bound.

        Relative, and known from the samples: 0.1 says that an eigenvalue was found for which the
        bound is 10 % too cautious; the truth is between them.
        """
        return self.sampled.low / float(self.low) - 1.0, float(self.high) / self.sampled.high - 1.0

    @property
    def tight(self) -> bool:
        """Whether both bounds are as near to the samples as was tried; else they are coarser."""
        return max(self.pessimism) < TIGHT

    @property
    def holds_33(self) -> bool:
        """Whether condition (33) is proved."""
        return self.proved and self.high <= LIMIT

    @property
    def largest_scaling(self) -> Fraction:
        """By what Mbar may be multiplied so that (33) is still certified; rounded down."""
        return _rounded(LIMIT / self.high, -1)


def certified_eigenvalues(
    robot: Robot,
    Mbar: Sequence[Fraction | float],
    *,
    within_ranges: bool = False,
    advance: Callable[[int], None] | None = None,
) -> Certified:
    """Finds bounds of the eigenvalues of M(q)^-1 Mbar and has them checked.

    The bounds are tight where that takes less than about a minute. They are coarser, and proved
    just as well, for an arm whose many joints all matter: see :attr:`Certified.pessimism`.

    Args:
        robot: links and motors; its friction, elasticity and encoders play no part.
        Mbar: diagonal [kg m^2], one number for each joint; taken exactly.
        within_ranges: only over the ranges of the joints in the robot's file, where it has them;
            else every joint turns all around.
        advance: is told of each of the STAGES, or of several.

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
    tell = advance or (lambda _: None)
    inertia = Inertia(model, [float(x) for x in Mbar])
    found = sample(inertia, low, high)
    rotors = max(
        Fraction(x) / Fraction(a) if a > 0 else math.inf
        for x, a in zip(Mbar, model.armature.tolist(), strict=True)
    )
    sides = {
        "low": _side(Refinement(inertia, low, high, -1), found.low, -1, tell),
        "high": _side(Refinement(inertia, low, high, 1), found.high, 1, tell, rotors),
    }
    certificate = {
        "robot": _numbers(model, chain),
        "inertia_kgm2": [_text(x) for x in Mbar],
        "range_turns": [[str(a), str(b)] for a, b in ranges],
        **{name: {"r": str(r), "boxes": cells} for name, (r, cells) in sides.items()},
    }
    complained = tuple(complaints(certificate))
    tell(1)
    return Certified(
        low=sides["low"][0],
        high=sides["high"][0],
        sampled=found,
        boxes=sum(len(cells) for _, cells in sides.values()),
        certificate=certificate,
        complaints=complained,
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
    boxes: Refinement,
    sampled: float,
    sign: int,
    advance: Callable[[int], None],
    rotors: Fraction | float = math.inf,
) -> tuple[Fraction, list[Cell]]:
    """A bound near the outermost sample, and the boxes on which it can be proved.

    Args:
        boxes: begun with all of the workspace.
        sampled: the outermost eigenvalue that was found.
        sign: 1 for a bound above, -1 for one below.
        advance: is told of each tolerance.
        rotors: a bound above for which the rotors' inertia is enough, with no boxes.
    """
    left = _WORK // (_FEWER if boxes.coordinates == MAX_COORDINATES else 1)
    reached: tuple[Fraction, list[Cell]] | None = None
    for done, tolerance in enumerate(TOLERANCES):
        r = _rounded(sampled * (1.0 + tolerance) ** sign, sign)
        spent = boxes.reach(float(r), left)
        if spent is None:
            advance(len(TOLERANCES) - done)
            break
        left, reached = left - spent, (r, boxes.cells)
        advance(1)
    if rotors < math.inf and (reached is None or rotors < reached[0]):
        return _rounded(rotors * (1 + Fraction(1, 10**_DIGITS)), sign), []
    if reached is None:
        raise WorkspaceError(
            f"no bound within {TOLERANCES[0]:.0%} of the sampled eigenvalue {sampled:.6g} can be "
            "certified: take smaller ranges, lock joints in the robot's file, or check that M(q) "
            "is positive definite"
        )
    return reached


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
