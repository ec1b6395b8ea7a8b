"""Two gain sets on plants that neither was tuned on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plant.assembly import Floats, Plant
from plant.tuning.gains import Gains
from plant.tuning.optimiser import Fly
from plant.tuning.procedure import VIBRATION_LIMIT, mean_error


@dataclass(frozen=True, eq=False)
class Flown:
    """Figures of one gain set by plant, shape (plants,).

    Attributes:
        error_deg: mean of the joints' RMS errors.
        vibration: the largest of the joints' measures.
    """

    error_deg: Floats
    vibration: Floats

    def figures(self) -> dict[str, Any]:
        """What is told of it; None for what is not finite."""
        numbers = {
            "median_rms_deg": np.median(self.error_deg),
            "largest_rms_deg": self.error_deg.max(),
            "median_vibration": np.median(self.vibration),
            "largest_vibration": self.vibration.max(),
        }
        told: dict[str, Any] = {k: float(x) if np.isfinite(x) else None for k, x in numbers.items()}
        return told | {"quiet": int(np.count_nonzero(self.vibration <= VIBRATION_LIMIT))}


@dataclass(frozen=True, eq=False)
class Comparison:
    """The procedure's gains and the optimiser's on the same plants."""

    procedure: Flown
    optimiser: Flown

    @property
    def ratio(self) -> Floats:
        """RMS error of the optimiser's gains over that of the procedure's; 1 if both fail."""
        with np.errstate(invalid="ignore"):
            ratio: Floats = np.nan_to_num(
                self.optimiser.error_deg / self.procedure.error_deg, nan=1.0
            )
        return ratio

    @property
    def both_quiet(self) -> NDArray[np.bool_]:
        """Where neither gain set breaks the limit of vibration."""
        worst = np.maximum(self.procedure.vibration, self.optimiser.vibration)
        quiet: NDArray[np.bool_] = worst <= VIBRATION_LIMIT
        return quiet

    def figures(self) -> dict[str, Any]:
        """What is told of it; the mean ratio is geometric: 2 and 1/2 make 1.

        Those of the plants on which both are quiet are told apart: where a loop vibrates its error
        says little about tracking.
        """
        quiet = self.ratio[self.both_quiet]
        return {
            "plants": len(self.ratio),
            "share_won": float(np.mean(self.ratio < 1.0)),
            "mean_ratio": _mean(self.ratio),
            "both_quiet": len(quiet),
            "share_won_both_quiet": float(np.mean(quiet < 1.0)) if len(quiet) else None,
            "mean_ratio_both_quiet": _mean(quiet) if len(quiet) else None,
            "procedure": self.procedure.figures(),
            "optimiser": self.optimiser.figures(),
        }


def _mean(ratio: Floats) -> float:
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(ratio))))


def fly_all(
    gains: Gains, fly: Fly, plants: Sequence[Plant], advance: Callable[[], None] = lambda: None
) -> Flown:
    """Flies a gain set on all plants.

    Args:
        gains: to fly.
        fly: a trial on one plant.
        plants: that the gains were not tuned on.
        advance: is called after each plant.
    """
    joints = list(range(len(gains.inertia)))
    errors, shaking = [], []
    for plant in plants:
        outcome = fly(gains, plant)
        errors.append(mean_error(outcome, joints))
        shaking.append(float(outcome.vibration.max()))
        advance()
    return Flown(np.array(errors), np.array(shaking))
