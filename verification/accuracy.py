"""What the accuracy of the powers is worth in closed loop: Table II flown in every arithmetic.

The same rows fly on the same plant with the C in float32 (standard and precise powers), float64
and fixed-point. The loop is chaotic at the level of encoder counts: a torque that differs in its
last bit moves an edge of the encoder by a tick, and from then on two runs differ by counts. A
single run therefore tells no difference below a few per cent. Every cell is the mean over several
phases of the encoders, the same for all, and stands beside the standard error of that mean. All
fly on the compiled backend of the plant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from itertools import product
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from codegen.controller import load
from codegen.emit import REPOSITORY
from plant.assembly import build_plant
from plant.compiled.loop import simulate
from plant.controller import GeneratedController
from plant.robot import load_robot
from verification.evidence import Evidence
from verification.paper import table_2

CONTROLLERS = REPOSITORY / "controllers"
REFERENCE = "puma3_float64"
ARITHMETICS = {
    "puma3": "float32, standard",
    "puma3_precise": "float32, precise",
    REFERENCE: "float64",
    "puma3_fixed": "fixed-point",
}
ROBOT = "reference"
PHASES = 16

Floats: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Cell:
    """One row of Table II in one arithmetic.

    Attributes:
        row: of Table II.
        controller: file of ``controllers/`` without suffix.
        rms_deg: mean over the encoder phases of the RMS error, by joint [deg].
        standard_error: of that mean, relative, by joint.
        difference: from the mean in float64, relative, by joint.
        difference_error: standard error of that difference, by joint.
    """

    row: str
    controller: str
    rms_deg: tuple[float, ...]
    standard_error: tuple[float, ...]
    difference: tuple[float, ...]
    difference_error: tuple[float, ...]


@dataclass(frozen=True)
class Accuracy:
    """All cells, and the largest difference of each arithmetic.

    Attributes:
        cells: by row and arithmetic.
        phases: encoder phases that a mean is taken over.
        mean_difference: from float64, the mean over all rows and joints, by controller.
        largest_difference: the largest magnitude of a cell's, by controller.
        evidence: measured, on the simulated plant.
    """

    cells: tuple[Cell, ...]
    phases: int
    mean_difference: dict[str, float]
    largest_difference: dict[str, float]
    evidence: Evidence = Evidence.MEASURED


def fly_at_phases(row: str, name: str, phases: int) -> Floats:
    """RMS errors [deg] of a row of Table II with the encoders at several phases.

    Integers may be too small for another row's gains; then the C is made for that row.

    Args:
        row: of Table II.
        name: file of ``controllers/`` without suffix.
        phases: how many, spread over a count.

    Returns:
        Shape (phases, n).
    """
    shipped, tuned = (load(CONTROLLERS / f"{name}.toml", experiment=e) for e in (None, row))
    controller = GeneratedController(shipped)
    controller.set_gains(tuned)
    if controller.check_config() != 0:
        controller = GeneratedController(tuned)
    body = load_robot(ROBOT)
    assert body.trajectory is not None
    plant = build_plant(body)
    encoders = (
        replace(plant.encoder, phase=np.full(plant.joints, k / phases)) for k in range(phases)
    )
    runs = (
        simulate(
            replace(plant, encoder=encoder),
            controller,
            body.trajectory,
            float(shipped.sample_time),
        )
        for encoder in encoders
    )
    return np.array([run.rms_error_deg() for run in runs])


def measure(
    rows: Sequence[str] = (),
    phases: int = PHASES,
    advance: Callable[[int], None] = lambda _: None,
) -> Accuracy:
    """Flies every row in every arithmetic at every phase, on all cores.

    Args:
        rows: of Table II, all by default.
        phases: encoder phases, spread over a count.
        advance: told of each row in an arithmetic as it ends.
    """
    chosen = tuple(rows) or tuple(table_2())
    jobs = list(product(chosen, ARITHMETICS))
    for name in ARITHMETICS:  # compiled once, before the processes look for it
        fly_at_phases(chosen[0], name, 1)
    rms: dict[tuple[str, str], Floats] = {}
    with ProcessPoolExecutor() as pool:
        waiting = {pool.submit(fly_at_phases, r, n, phases): (r, n) for r, n in jobs}
        for future in as_completed(waiting):
            rms[waiting[future]] = future.result()
            advance(1)
    cells = tuple(_cell(r, n, rms[r, n], rms[r, REFERENCE]) for r in chosen for n in ARITHMETICS)
    by_name = {
        n: [d for c in cells if c.controller == n for d in c.difference] for n in ARITHMETICS
    }
    return Accuracy(
        cells,
        phases,
        {n: float(np.mean(d)) for n, d in by_name.items()},
        {n: float(np.max(np.abs(d))) for n, d in by_name.items()},
    )


def _cell(row: str, name: str, rms: Floats, reference: Floats) -> Cell:
    """The mean over phases, shape (phases, n), beside that in float64."""
    mean, theirs = rms.mean(axis=0), reference.mean(axis=0)
    many = math.sqrt(len(rms))
    error = rms.std(axis=0, ddof=1) / many if len(rms) > 1 else np.full_like(mean, np.nan)
    other = reference.std(axis=0, ddof=1) / many if len(rms) > 1 else np.full_like(mean, np.nan)
    return Cell(
        row,
        name,
        tuple(mean.tolist()),
        tuple((error / mean).tolist()),
        tuple((mean / theirs - 1.0).tolist()),
        tuple((np.hypot(error, other) / theirs).tolist()),
    )
