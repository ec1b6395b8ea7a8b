"""All figures by name."""

from __future__ import annotations

from collections.abc import Callable

from verification.figures.desired_dynamics import convergence, phase_portraits
from verification.figures.paper_figure import PaperFigure
from verification.figures.tracking import errors, reversals, speed, trajectory
from verification.figures.vibration import small_gamma, vibration

BUILDERS: dict[str, Callable[[], PaperFigure]] = {
    "phase-portraits": phase_portraits,
    "convergence": convergence,
    "trajectory": trajectory,
    "errors": errors,
    "reversals": reversals,
    "vibration": vibration,
    "small-gamma": small_gamma,
    "speed": speed,
}


def all_figures() -> list[PaperFigure]:
    """Every figure, in the order of the paper.

    Raises:
        SpecificationError, PlantError, CompilerError, ControllerError: as of ``plant.flight.fly``.
    """
    return [build() for build in BUILDERS.values()]
