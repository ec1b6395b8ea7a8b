"""What the accuracy of the powers is worth in closed loop: Table II flown in every arithmetic.

The same rows fly on the same plant with the C in float32 (standard and precise powers), float64
and fixed-point. The loop is chaotic at the level of encoder counts: a torque that differs in its
last bit moves an edge of the encoder by a tick, and from then on two runs differ by counts. A
single run therefore tells no difference below a few per cent. Every cell is the mean over several
phases of the encoders, the same for all, and stands beside the standard error of that mean.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codegen.controller import load
from codegen.emit import REPOSITORY
from plant.closed_loop import build_plant, simulate
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
PHASES = 8


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


def fly_at_phase(row: str, name: str, phase: float) -> tuple[float, ...]:
    """RMS error by joint [deg] of a row of Table II with the encoders at a phase [count].

    Integers may be too small for another row's gains; then the C is made for that row.
    """
    shipped, tuned = (load(CONTROLLERS / f"{name}.toml", experiment=e) for e in (None, row))
    controller = GeneratedController(shipped)
    controller.set_gains(tuned)
    if controller.check_config() != 0:
        controller = GeneratedController(tuned)
    body = load_robot(ROBOT)
    assert body.trajectory is not None
    plant = build_plant(body)
    encoder = replace(plant.encoder, phase=np.full(plant.joints, phase))
    run = simulate(
        replace(plant, encoder=encoder),
        controller,
        body.trajectory,
        float(shipped.sample_time),
        progress=False,
    )
    return tuple(run.rms_error_deg().tolist())


def measure(
    rows: Sequence[str] = (),
    phases: int = PHASES,
    advance: Callable[[int], None] = lambda _: None,
) -> Accuracy:
    """Flies every row in every arithmetic at every phase, on all cores.

    Args:
        rows: of Table II, all by default.
        phases: encoder phases, spread over a count.
        advance: told of each run as it ends.
    """
    chosen = tuple(rows) or tuple(table_2())
    jobs = [(r, n, k) for r in chosen for n in ARITHMETICS for k in range(phases)]
    for name in ARITHMETICS:  # compiled once, before the processes look for it
        GeneratedController(load(CONTROLLERS / f"{name}.toml"))
    flown: dict[tuple[str, str, int], tuple[float, ...]] = {}
    with ProcessPoolExecutor() as pool:
        waiting = {pool.submit(fly_at_phase, r, n, k / phases): (r, n, k) for r, n, k in jobs}
        for future in as_completed(waiting):
            flown[waiting[future]] = future.result()
            advance(1)
    rms = {
        (r, n): np.array([flown[r, n, k] for k in range(phases)])
        for r in chosen
        for n in ARITHMETICS
    }
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


def _cell(row: str, name: str, rms: NDArray[np.float64], reference: NDArray[np.float64]) -> Cell:
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
