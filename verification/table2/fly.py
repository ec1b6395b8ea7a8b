"""Table II of the paper flown on several plants: every row, with nothing tuned for any of them.

All rows of a plant are flown with one controller's C, gains set at run time, along the plant's own
motion. The paper's robot is not public: the first plant has friction, motors' inertia and motion
that were chosen so that the paper's magnitudes come out; the others say how much that matters.

The loop is chaotic at the level of encoder counts. A figure here is the root mean square over runs
at several phases of the encoders, all else being equal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.stats import spearmanr

from codegen.controller import load
from codegen.emit import REPOSITORY
from plant.assembly import Plant, PlantError, build_plant
from plant.closed_loop import ControllerError, beginning
from plant.compiled.loop import CompiledLoop
from plant.flight import check_encoders
from plant.robot import load_robot
from verification.evidence import Evidence
from verification.paper import REFERENCE_ROW, rms_difference_percent, table_2

Floats = NDArray[np.float64]

CONTROLLERS = REPOSITORY / "controllers"
PHASES = 4
COMPARED = ("Exp01", "Exp02", "Exp05", "Exp13")
"""The rows whose errors are told as multiples of Exp08's."""
FACTOR = 1.5
"""A cell within this factor of the paper's counts as reproduced."""
JOINTS = 3
"""Of the paper's robot; a plant with more is compared in its first three."""


@dataclass(frozen=True)
class TablePlant:
    """A plant that the table is flown on.

    Attributes:
        name: in the figures.
        controller: file of ``controllers/`` without suffix.
        robot: robot file.
        says: what it is, and what is known of why it differs from the paper's.
    """

    name: str
    controller: str
    robot: str
    says: str


PLANTS = (
    TablePlant(
        "reference",
        "puma3",
        "reference",
        "Friction, motor inertia and motion chosen so that the paper's magnitudes come out.",
    ),
    TablePlant(
        "published-friction",
        "puma3",
        "reference_published_friction",
        "The same arm with a PUMA 560's published friction: the error of time delay estimation is "
        "in proportion to what friction changes by when it reverses, so that the first joint's "
        "errors grow with its friction.",
    ),
    TablePlant(
        "flexible",
        "puma3",
        "reference_flexible",
        "The reference plant with elastic gears: motors vibrate against their links, which raises "
        "the smallest errors; the encoders see the motors only.",
    ),
    TablePlant(
        "six-joints",
        "puma6",
        "puma560",
        "All joints of a PUMA 560 with its own gears, limits and published friction; gains of the "
        "paper's three joints on the first three.",
    ),
)


@dataclass(frozen=True)
class TableRow:
    """A row of the table on one plant.

    Attributes:
        exp: its number in the paper.
        rms_deg: by joint; None where a run did not get to its end.
        difference_percent: from Exp08 as the table's footnote defines it, by joint.
        factor: over the paper's error, for its three joints.
        failed: why a run did not get to its end.
    """

    exp: str
    rms_deg: tuple[float, ...] | None
    difference_percent: tuple[float, ...] | None = None
    factor: tuple[float, ...] | None = None
    failed: str | None = None


@dataclass(frozen=True)
class TableOf:
    """The table on one plant.

    Attributes:
        plant: which.
        rows: in the paper's order.
        spearman: rank correlation with the paper's errors over the rows that got to their end, by
            joint.
        ratios: errors over Exp08's by row, "01/08" and so on, by joint.
        phases: encoder phases that a figure is a mean of.
    """

    plant: TablePlant
    rows: tuple[TableRow, ...]
    spearman: tuple[float, ...]
    ratios: dict[str, tuple[float, ...]]
    phases: int
    evidence: Evidence = Evidence.MEASURED

    @property
    def worst_factor(self) -> float:
        """Of the cell that is farthest from the paper's, either way; infinite if a row failed."""
        cells = [f for row in self.rows for f in row.factor or (math.inf,)]
        return max(max(f, 1.0 / f) for f in cells)

    @property
    def outside(self) -> tuple[tuple[str, int, float], ...]:
        """The cells that are not within the factor: row, joint from 1, how many times as large."""
        return tuple(
            (row.exp, joint, f)
            for row in self.rows
            for joint, f in enumerate(row.factor or (), start=1)
            if max(f, 1.0 / f) > FACTOR
        )

    @property
    def best(self) -> tuple[str, ...]:
        """The row with the smallest error of each of the paper's joints."""
        there = [row for row in self.rows if row.rms_deg is not None]
        return tuple(min(there, key=lambda row: (row.rms_deg or ())[j]).exp for j in range(JOINTS))


def paper_ratios(row: str) -> tuple[float, ...]:
    """The paper's errors of a row over those of Exp08, by joint."""
    return _over(table_2()[row].rms_deg, table_2()[REFERENCE_ROW].rms_deg)


def _over(mine: Sequence[float], reference: Sequence[float]) -> tuple[float, ...]:
    return tuple(a / b for a, b in zip(mine, reference, strict=False))


def ratio_name(row: str) -> str:
    """What a row's errors over those of Exp08 are called, such as 01/08."""
    return f"{row[-2:]}/{REFERENCE_ROW[-2:]}"


def fly_row(plant: TablePlant, row: str, phases: int = PHASES) -> Floats:
    """RMS errors of a row by the encoders, root mean square over the phases [deg], shape (n,).

    Raises:
        ControllerError, PlantError: a run did not get to its end.
    """
    path = CONTROLLERS / f"{plant.controller}.toml"
    shipped, robot = load(path), load_robot(plant.robot)
    check_encoders(shipped, robot)
    assembled = build_plant(robot)
    if robot.trajectory is None:
        raise PlantError(f"robot {robot.name} has no [trajectory]: add one to its file")
    loop = CompiledLoop(assembled, shipped)
    controller = loop.controller()
    controller.set_gains(load(path, experiment=row))
    tick = float(shipped.sample_time)
    squares = []
    for k in range(phases):
        shifted = _at_phase(assembled, k / phases)
        begin = beginning(shifted, robot.trajectory, tick)
        squares.append(loop.run(shifted, controller, begin, tick).rms_error_deg() ** 2)
    rms: Floats = np.sqrt(np.mean(squares, axis=0))
    return rms


def _at_phase(plant: Plant, phase: float) -> Plant:
    encoder = replace(plant.encoder, phase=np.full(plant.joints, phase))
    return replace(plant, encoder=encoder)


def fly_table(
    plants: Sequence[TablePlant] = PLANTS,
    phases: int = PHASES,
    rows: Sequence[str] = (),
    advance: Callable[[], None] = lambda: None,
) -> tuple[TableOf, ...]:
    """Flies all rows on all plants, on all cores.

    Args:
        plants: which.
        phases: encoder phases, spread over a count.
        rows: of the table, Exp08 among them; all by default.
        advance: told of each row of a plant as it ends.
    """
    names = tuple(rows) or tuple(table_2())
    # Compiled here, so that the processes find it.
    for plant in plants:
        CompiledLoop(
            build_plant(load_robot(plant.robot)), load(CONTROLLERS / f"{plant.controller}.toml")
        )
    jobs = [(plant, row) for plant in plants for row in names]
    pool = Parallel(n_jobs=-1, return_as="generator")
    results: list[Floats | str] = []
    for outcome in pool(delayed(_outcome)(plant, row, phases) for plant, row in jobs):
        results.append(outcome)
        advance()
    found = dict(zip(jobs, results, strict=True))
    return tuple(
        _table(plant, {row: found[plant, row] for row in names}, phases) for plant in plants
    )


def _outcome(plant: TablePlant, row: str, phases: int) -> Floats | str:
    """The errors, or why there are none."""
    try:
        return fly_row(plant, row, phases)
    except (ControllerError, PlantError) as error:
        return str(error)


def _table(plant: TablePlant, found: dict[str, Floats | str], phases: int) -> TableOf:
    best = found[REFERENCE_ROW]
    rows = tuple(_row(name, rms, best) for name, rms in found.items())
    whole = [row for row in rows if row.rms_deg is not None]
    spearman = tuple(
        float(
            spearmanr(
                [(row.rms_deg or ())[j] for row in whole],
                [table_2()[row.exp].rms_deg[j] for row in whole],
            ).statistic
        )
        for j in range(JOINTS)
    )
    ratios = {
        ratio_name(row.exp): _over(row.rms_deg, best.tolist())
        for row in rows
        if row.exp in COMPARED and row.rms_deg is not None and not isinstance(best, str)
    }
    return TableOf(plant, rows, spearman, ratios, phases)


def _row(name: str, rms: Floats | str, best: Floats | str) -> TableRow:
    if isinstance(rms, str):
        return TableRow(name, None, failed=rms)
    mine = tuple(rms.tolist())
    percent = None
    if not isinstance(best, str):
        percent = tuple(
            rms_difference_percent(a, b) for a, b in zip(mine, best.tolist(), strict=True)
        )
    return TableRow(name, mine, percent, _over(mine, table_2()[name].rms_deg))


def figures(tables: Sequence[TableOf]) -> dict[str, Any]:
    """The tables as plain data, by plant."""
    return {
        "plants": {
            table.plant.name: {
                "says": table.plant.says,
                "controller": table.plant.controller,
                "robot": table.plant.robot,
                "rows": [
                    {
                        "exp": row.exp,
                        "rms_deg": row.rms_deg,
                        "difference_percent": row.difference_percent,
                        "paper_rms_deg": table_2()[row.exp].rms_deg,
                        "factor": row.factor,
                        "failed": row.failed,
                    }
                    for row in table.rows
                ],
                "spearman": table.spearman,
                "worst_factor": table.worst_factor,
                "outside_factor": [list(cell) for cell in table.outside],
                "best": table.best,
                "ratios": table.ratios,
                "paper_ratios": {ratio_name(row): paper_ratios(row) for row in COMPARED},
                "phases": table.phases,
                "evidence": table.evidence.value,
            }
            for table in tables
        }
    }
