"""Drives: the torque limit of the motors and the time until a command acts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Drive:
    """Torque-controlled drives of n joints.

    Attributes:
        torque_limit_Nm: largest torque at the joint, shape (n,).
        delay: the time until a new command acts, as a fraction of the sample time, in [0, 1].
    """

    torque_limit_Nm: NDArray[np.float64]
    delay: float = 0.0

    def __post_init__(self) -> None:
        if not (np.all(self.torque_limit_Nm > 0.0) and 0.0 <= self.delay <= 1.0):
            raise ValueError("a drive needs torque limits > 0 and a delay within [0, 1]")

    def limited(self, torque_Nm: NDArray[np.float64]) -> NDArray[np.float64]:
        """The torque that the drive applies for a commanded one, shape (n,)."""
        return np.clip(torque_Nm, -self.torque_limit_Nm, self.torque_limit_Nm)
