"""The paper's experiments flown again: the compiled C on the simulated plant, beside Table II.

One compiled controller flies every row of Table II: the rows differ only in gains, which are set
in its configuration at run time. The plant is a stand-in whose friction and amplitude were chosen
(``plant/robots/reference.toml`` says which), so that magnitudes are to be read within a factor,
and ratios between rows are the stronger evidence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.controller import load
from codegen.emit import REPOSITORY
from plant.closed_loop import Run
from plant.controller import GeneratedController
from plant.flight import fly
from verification.evidence import Evidence
from verification.paper import REFERENCE_ROW, table_2

Floats = NDArray[np.float64]

CONTROLLERS = REPOSITORY / "controllers"
PAPER_ROWS = ("Exp01", "Exp02", "Exp05", "Exp08")
"""The rows that Fig. 5 of the paper compares."""

PEAK_WINDOW_S = 0.6
"""How long after a velocity reversal its spike of error is looked for."""


@dataclass(frozen=True)
class Experiment:
    """What to fly.

    Attributes:
        controller: file of ``controllers/`` without suffix.
        robot: robot file of the plant.
        row: the row of Table II whose gains are set.
        speed: factor on the speed of the robot's trajectory.
    """

    controller: str
    robot: str
    row: str
    speed: float = 1.0


@dataclass(frozen=True, eq=False)
class Outcome:
    """An experiment and what came of it.

    Attributes:
        experiment: what was flown.
        figures: the figures of merit, lists with one entry a joint
            (``plant.flight.Flight.figures``).
        torque_limit_Nm: of the controller [N m], shape (n,).
        run: all signals.
        evidence: always measured, on the simulated plant.
    """

    experiment: Experiment
    figures: dict[str, Any]
    torque_limit_Nm: Floats
    run: Run
    evidence: Evidence = Evidence.MEASURED

    @property
    def joint_names(self) -> tuple[str, ...]:
        """In the order of all arrays."""
        return tuple(self.figures["joint_names"])

    @property
    def rms_deg(self) -> tuple[float, ...]:
        """RMS of the error by the encoders, as in Table II [deg]."""
        return tuple(self.figures["rms_deg"])

    def summary(self) -> dict[str, Any]:
        """The figures without the signals."""
        return {
            **self.figures,
            "speed": self.experiment.speed,
            "torque_limit_Nm": self.torque_limit_Nm.tolist(),
            "evidence": self.evidence.value,
        }


TABLE = tuple(Experiment("puma3", "reference", row) for row in table_2())
FIGURE_5 = tuple(experiment for experiment in TABLE if experiment.row in PAPER_ROWS)
FASTER = Experiment("puma3", "reference", REFERENCE_ROW, 1.5)
"""Section IV-C: 50 % more speed with the gains of Exp08."""
SIX_JOINTS = Experiment("puma6", "puma560", REFERENCE_ROW)
ALL = (*TABLE, FASTER, SIX_JOINTS)


def conduct(experiment: Experiment) -> Outcome:
    """Flies one experiment with the generated C; errors as of ``plant.flight.fly``."""
    flight = fly(
        CONTROLLERS / f"{experiment.controller}.toml",
        experiment=experiment.row,
        robot=experiment.robot,
        speed=experiment.speed,
        progress=False,
        backend="compiled",
    )
    limits = np.array([float(joint.torque_limit) for joint in flight.specification.joints])
    return Outcome(experiment, flight.figures(), limits, flight.run)


def conduct_all(
    experiments: Sequence[Experiment] = ALL,
    advance: Callable[[Experiment], None] = lambda _: None,
    processes: int | None = None,
) -> dict[Experiment, Outcome]:
    """Flies experiments in parallel processes.

    Args:
        experiments: what to fly.
        advance: told of each experiment as it ends.
        processes: how many at a time; one for each core by default.
    """
    # Compiled here once; the processes then find the library.
    for name in dict.fromkeys(e.controller for e in experiments):
        GeneratedController(load(CONTROLLERS / f"{name}.toml"))
    with ProcessPoolExecutor(processes) as pool:
        waiting = {pool.submit(conduct, e): e for e in experiments}
        done = {}
        for future in as_completed(waiting):
            done[waiting[future]] = future.result()
            advance(waiting[future])
    return {e: done[e] for e in experiments}


# --- Beside the paper --------------------------------------------------------------------------


@dataclass(frozen=True)
class Beside:
    """A row of Table II: ours, the paper's, and their ratio, by joint."""

    experiment: str
    remark: str
    ours_deg: tuple[float, ...]
    paper_deg: tuple[float, ...]

    @property
    def ratio(self) -> tuple[float, ...]:
        """Ours over the paper's."""
        return tuple(a / b for a, b in zip(self.ours_deg, self.paper_deg, strict=True))


@dataclass(frozen=True)
class Gain:
    """How much better Exp08 is than another row, by joint: ours and the paper's."""

    experiment: str
    ours: tuple[float, ...]
    paper: tuple[float, ...]


def beside_the_paper(done: Mapping[Experiment, Outcome]) -> tuple[Beside, ...]:
    """The flown rows of Table II with the paper's figures."""
    return tuple(
        Beside(
            experiment.row,
            table_2()[experiment.row].remark,
            done[experiment].rms_deg,
            table_2()[experiment.row].rms_deg,
        )
        for experiment in TABLE
        if experiment in done
    )


def improvements(rows: Sequence[Beside]) -> tuple[Gain, ...]:
    """RMS of each row over that of Exp08."""
    best = next(row for row in rows if row.experiment == REFERENCE_ROW)

    def over(mine: Sequence[float], reference: Sequence[float]) -> tuple[float, ...]:
        return tuple(a / b for a, b in zip(mine, reference, strict=True))

    return tuple(
        Gain(row.experiment, over(row.ours_deg, best.ours_deg), over(row.paper_deg, best.paper_deg))
        for row in rows
        if row is not best
    )


def rank_correlation(rows: Sequence[Beside]) -> tuple[float, ...]:
    """Spearman's rank correlation of ours with the paper's, by joint.

    It says whether the rows come in the same order; it is no strong evidence by itself, since
    even a plant without friction keeps most of the order.
    """
    # Half a second to import, which every other command would wait for.
    from scipy.stats import spearmanr

    joints = range(len(rows[0].ours_deg))
    return tuple(
        float(spearmanr([r.ours_deg[j] for r in rows], [r.paper_deg[j] for r in rows]).statistic)
        for j in joints
    )


def reversal_times_s(run: Run, joint: int = 0) -> tuple[float, ...]:
    """When the reference velocity of a joint changes its sign [s]."""
    velocity = run.qd_ref[:, joint]
    moving = np.flatnonzero(np.abs(velocity) > 1e-9)
    turns = np.flatnonzero(np.diff(np.sign(velocity[moving])))
    middle = (run.time_s[moving[turns]] + run.time_s[moving[turns + 1]]) / 2
    return tuple(middle.tolist())


def reversal_peaks_deg(run: Run, times_s: Sequence[float]) -> Floats:
    """Largest error within ``PEAK_WINDOW_S`` after given times [deg], shape (times, n).

    Friction changes its sign where the velocity does; the paper's Fig. 5 shows its spikes there.
    """
    error = np.rad2deg(np.abs(run.error_rad))
    time = run.time_s
    return np.array([error[(time >= t) & (time <= t + PEAK_WINDOW_S)].max(axis=0) for t in times_s])
