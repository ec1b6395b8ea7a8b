"""The eigenvalues of M(q)^-1 Mbar of a plant: certified everywhere, or sampled on its way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from plant.model import build_model
from plant.robot import Robot
from verification.evidence import Evidence
from verification.tuning_check.joint import Specified
from verification.workspace.certify import LIMIT, WorkspaceError, certified_eigenvalues

_SAMPLES = 400
"""Postures along a trajectory."""


@dataclass(frozen=True)
class Eigenvalues:
    """Where the eigenvalues of M(q)^-1 Mbar lie; M with the motors, joints taken as rigid.

    Attributes:
        low: below all of them; of a sampled range the least.
        high: above all of them; of a sampled range the largest.
        sampled: least and largest that was found at a posture.
        evidence: proved for every posture within the joints' ranges, or sampled.
        remark: why it is sampled only; None if it is proved.
    """

    low: Fraction
    high: Fraction
    sampled: tuple[float, float]
    evidence: Evidence
    remark: str | None = None

    @property
    def margin_33(self) -> float:
        """By what Mbar may be multiplied until (33), all eigenvalues below 2, breaks."""
        return LIMIT / float(self.high)


def eigenvalues(robot: Robot, joints: Sequence[Specified]) -> Eigenvalues | str:
    """The eigenvalues for a controller's Mbar, or why nothing is known of them.

    Args:
        robot: the plant.
        joints: of the controller, as many as the robot's.
    """
    Mbar = [each.joint.inertia for each in joints]
    try:
        found = certified_eigenvalues(robot, Mbar, within_ranges=True)
    except WorkspaceError as error:
        remark = str(error)
    else:
        sampled = found.sampled.low, found.sampled.high
        if found.proved:
            return Eigenvalues(found.low, found.high, sampled, Evidence.PROVED)
        remark = "; ".join(found.complaints)
    if robot.trajectory is None:
        return remark
    duration = robot.trajectory.duration_s
    way = robot.trajectory.at(np.linspace(0.0, duration, _SAMPLES)).position_rad
    low, high = _along(build_model(robot), Mbar, way)
    remark = f"sampled along the trajectory only, since not certified ({remark})"
    return Eigenvalues(Fraction(low), Fraction(high), (low, high), Evidence.SAMPLED, remark)


def _along(
    model: pin.Model, Mbar: Sequence[Fraction], way: NDArray[np.float64]
) -> tuple[float, float]:
    """Least and largest eigenvalue at postures, shape (m, n)."""
    data = model.createData()
    root = np.sqrt(np.array(Mbar, dtype=np.float64))
    found = []
    for q in way:
        inverse = pin.computeMinverse(model, data, q)
        upper = np.triu(inverse)
        inverse = upper + np.triu(upper, 1).T
        # Similar to M^-1 Mbar, and symmetric.
        found.append(np.linalg.eigvalsh(root[:, np.newaxis] * inverse * root))
    return float(np.min(found)), float(np.max(found))
