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
class Comparison:
    """Figures by plant of the procedure's gains and of the optimiser's, shape (plants,).

    Attributes:
        procedure_deg: mean of the joints' RMS errors.
        optimiser_deg: likewise.
        procedure_vibration: the largest of the joints' measures.
        optimiser_vibration: likewise.
    """

    procedure_deg: Floats
    optimiser_deg: Floats
    procedure_vibration: Floats
    optimiser_vibration: Floats

    @property
    def ratio(self) -> Floats:
        """RMS error of the optimiser's gains over that of the procedure's; 1 if both fail."""
        with np.errstate(invalid="ignore"):
            ratio: Floats = np.nan_to_num(self.optimiser_deg / self.procedure_deg, nan=1.0)
        return ratio

    @property
    def both_quiet(self) -> NDArray[np.bool_]:
        """Where neither gain set breaks the limit of vibration."""
        worst = np.maximum(self.procedure_vibration, self.optimiser_vibration)
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
            "procedure": _of(self.procedure_deg, self.procedure_vibration),
            "optimiser": _of(self.optimiser_deg, self.optimiser_vibration),
        }


def _of(error_deg: Floats, vibration: Floats) -> dict[str, Any]:
    """The figures of one gain set; None for what is not finite."""
    numbers = {
        "median_rms_deg": np.median(error_deg),
        "largest_rms_deg": error_deg.max(),
        "median_vibration": np.median(vibration),
        "largest_vibration": vibration.max(),
    }
    told: dict[str, Any] = {k: float(x) if np.isfinite(x) else None for k, x in numbers.items()}
    return told | {"quiet": int(np.count_nonzero(vibration <= VIBRATION_LIMIT))}


def _mean(ratio: Floats) -> float:
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(ratio))))


def compare(
    procedure: Gains,
    optimiser: Gains,
    fly: Fly,
    plants: Sequence[Plant],
    advance: Callable[[], None] = lambda: None,
) -> Comparison:
    """Flies both gain sets on all plants.

    Args:
        procedure: its gains.
        optimiser: its gains.
        fly: a trial on one plant.
        plants: neither was tuned on.
        advance: is called after each plant.
    """
    joints = list(range(len(procedure.inertia)))
    rows = []
    for plant in plants:
        outcomes = [fly(gains, plant) for gains in (procedure, optimiser)]
        errors = [mean_error(outcome, joints) for outcome in outcomes]
        rows.append([*errors, *(float(outcome.vibration.max()) for outcome in outcomes)])
        advance()
    return Comparison(*np.array(rows).T)
