"""The bound of |e| beside the error of a flight, whose TDE error is measured.

The bound is of continuous time. A flight has samples, counts and single floats; what the C sees as
eps is mostly the encoder's grain, one count a tick a tick, so that its largest value makes a bound
that is far from the error. Its means over windows are closer to what moves the joint, and are no
bound of eps: without correction |e| has stayed below what they would give, with correction, where
that is a few counts, it has not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from codegen.controller import Controller
from verification.energy.audit import bound_of_e, tde_error, window_means
from verification.energy.recording import Recording, gains_of
from verification.evidence import Evidence


@dataclass(frozen=True)
class FlownBound:
    """A joint's error in a flight, and the bounds for the TDE error that was measured there.

    Attributes:
        joint: its name.
        largest_error_rad: largest |e|.
        tde_error: xi, largest |eps| [rad/s^2].
        bound_rad: of |e| for it; None where none is known.
        mean_tde_error: largest magnitude of means of eps over windows [rad/s^2].
        mean_bound_rad: what would bound |e| if it bounded eps.
        evidence: measured, on the simulated plant.
    """

    joint: str
    largest_error_rad: float
    tde_error: float
    bound_rad: float | None
    mean_tde_error: float
    mean_bound_rad: float | None
    evidence: Evidence = Evidence.MEASURED

    @property
    def ratio(self) -> float | None:
        """Largest |e| over the bound for the largest |eps|."""
        return self.largest_error_rad / self.bound_rad if self.bound_rad else None

    @property
    def mean_ratio(self) -> float | None:
        """Largest |e| over what means of eps would give."""
        return self.largest_error_rad / self.mean_bound_rad if self.mean_bound_rad else None


def flown_bounds(
    controller: Controller, recording: Recording, joints: Sequence[int] | None = None
) -> tuple[FlownBound, ...]:
    """Bounds of a recorded flight's joints.

    Args:
        controller: with the gains that were flown.
        recording: of the flight.
        joints: by number; all if not given.
    """
    error = tde_error(gains_of(controller), recording)
    xi, mean_xi = np.abs(error).max(axis=0), np.abs(window_means(error)).max(axis=0)
    largest = np.abs(recording.position_error).max(axis=0)

    def bound(j: int, size: float) -> float | None:
        return bound_of_e(controller.joints[j], size)

    return tuple(
        FlownBound(
            controller.joints[j].name,
            float(largest[j]),
            float(xi[j]),
            bound(j, float(xi[j])),
            float(mean_xi[j]),
            bound(j, float(mean_xi[j])),
        )
        for j in (range(len(controller.joints)) if joints is None else joints)
    )
