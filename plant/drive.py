"""Drives: the motors' torque limit, the time until a command acts, and the current loop's lag."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Lag(NamedTuple):
    """A current loop of first order over equal steps, u being the torque that it is told.

    Attributes:
        decay: the part of torque - u that is left after a step, shape (n,).
        mean: the same part in the mean over a step, shape (n,).
        mean_of_all: in the mean over all steps, shape (n,).
    """

    decay: Floats
    mean: Floats
    mean_of_all: Floats


@dataclass(frozen=True, eq=False)
class Drive:
    """Torque-controlled drives of n joints.

    Attributes:
        torque_limit_Nm: largest torque at the joint, shape (n,).
        delay: the time until a new command acts, as a fraction of the sample time, in [0, 1].
        bandwidth_Hz: of the current loop, w_c/(2 pi) of dtau/dt = w_c (u - tau), shape (n,) or
            one for all; infinite: the torque is the command.
    """

    torque_limit_Nm: Floats
    delay: float = 0.0
    bandwidth_Hz: Floats | float = math.inf

    def __post_init__(self) -> None:
        if not (np.all(self.torque_limit_Nm > 0.0) and 0.0 <= self.delay <= 1.0):
            raise ValueError("a drive needs torque limits > 0 and a delay within [0, 1]")
        if not np.all(np.asarray(self.bandwidth_Hz) > 0.0):
            raise ValueError("a drive's current loop needs a bandwidth > 0")

    def limited(self, torque_Nm: Floats) -> Floats:
        """The torque that the current loop is told for a commanded one, shape (n,)."""
        return np.clip(torque_Nm, -self.torque_limit_Nm, self.torque_limit_Nm)

    def lag(self, step_s: float, steps: int) -> Lag:
        """The current loop's exact solution over so many steps of h > 0.

        A deviation from u decays by exp(-x) in a time t with x = w_c t, and its mean over that
        time is the part (1 - exp(-x))/x of it.
        """
        rate = np.broadcast_to(2.0 * math.pi * self.bandwidth_Hz, self.torque_limit_Nm.shape)
        return Lag(np.exp(-rate * step_s), _mean(rate * step_s), _mean(rate * (steps * step_s)))


def _mean(x: Floats) -> Floats:
    """The mean of exp(-t) over 0 <= t <= x, x > 0."""
    mean: Floats = -np.expm1(-x) / x
    return mean
