"""Contests: everyone tuned on one plant within one bound of roughness, then flown on all plants."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass

import numpy as np

from plant.closed_loop import ControllerError, Run
from verification.evidence import Evidence
from verification.rivals.contenders import BY_NAME, Entry, Gains
from verification.rivals.model import Floats
from verification.rivals.trials import HELD_OUT, TUNED_ON, Trial, ground
from verification.rivals.tuning import (
    EFFORT,
    Effort,
    lost,
    mean_error_deg,
    torque_step,
    tune,
)

TRIALS = (TUNED_ON, *HELD_OUT)
PHASES = 8
MARGIN = 1.1
"""What a mean over encoder phases may be beyond a bound that was kept at one of them."""


@dataclass(frozen=True)
class Contest:
    """What all are tuned within.

    Attributes:
        name: for a person.
        bound: of each joint's RMS torque step, as a part of its drive's limit.
    """

    name: str
    bound: float


CONTESTS = (Contest("rough", 1 / 32), Contest("quiet", 1 / 128))
"""The first is about what the paper's Exp08 makes on this plant, the second a quarter of it."""


@dataclass(frozen=True)
class Score:
    """A contender on a trial: means over the encoder phases at which it didn't lose a joint.

    Attributes:
        trial: its name.
        lost: number of phases at which a joint was lost or the controller gave up.
        rms_deg: RMS error by the encoders, by joint; infinite where all are lost, like all others.
        mean_error_deg: the geometric mean of these over the joints.
        peak_deg: largest error, by joint.
        rms_torque_step_Nm: RMS of the torque's change from tick to tick, by joint.
        roughness: the same over the drive's limit, of the roughest joint.
    """

    trial: str
    lost: int
    rms_deg: tuple[float, ...]
    mean_error_deg: float
    peak_deg: tuple[float, ...]
    rms_torque_step_Nm: tuple[float, ...]
    roughness: float


@dataclass(frozen=True, eq=False)
class Line:
    """A contender in a contest.

    Attributes:
        name: of the contender.
        label: of the contender.
        model: what it must know of the robot.
        parameters: how many numbers were tuned.
        runs: closed loops flown to tune it.
        gains: that it flew with, by name, one a joint; none where they are the specification's.
        scores: one a trial.
        within: whether it keeps the bound on the plant that it was tuned on, within ``MARGIN``.
    """

    name: str
    label: str
    model: str
    parameters: int
    runs: int
    gains: Mapping[str, tuple[float, ...]]
    scores: tuple[Score, ...]
    within: bool


@dataclass(frozen=True, eq=False)
class Standing:
    """A contest and how it ended."""

    contest: Contest
    lines: tuple[Line, ...]


@dataclass(frozen=True, eq=False)
class Result:
    """All contests.

    Attributes:
        effort: of each tuning.
        phases: of the encoders, that a score is the mean over.
        standings: one a contest.
        evidence: measured, on the simulated plants.
    """

    effort: Effort
    phases: int
    standings: tuple[Standing, ...]
    evidence: Evidence = Evidence.MEASURED


def score(entry: Entry, gains: Gains) -> Score:
    """Flies a contender at every encoder phase of its ground."""
    runs = [_flown(entry, gains, phase) for phase in range(len(entry.ground.begins))]
    kept = [run for run in runs if run is not None]

    def mean(figure: Callable[[Run], Floats]) -> Floats:
        if not kept:
            return np.full(entry.ground.plant.joints, np.inf)
        found: Floats = np.mean([figure(run) for run in kept], axis=0)
        return found

    rms, step = mean(Run.rms_error_deg), mean(torque_step)
    peak = mean(lambda run: np.rad2deg(np.abs(run.error_rad).max(axis=0)))
    return Score(
        trial=entry.ground.trial.name,
        lost=len(runs) - len(kept),
        rms_deg=tuple(rms.tolist()),
        mean_error_deg=mean_error_deg(rms),
        peak_deg=tuple(peak.tolist()),
        rms_torque_step_Nm=tuple(step.tolist()),
        roughness=float(np.max(step / entry.ground.plant.drive.torque_limit_Nm)),
    )


def _flown(entry: Entry, gains: Gains, phase: int) -> Run | None:
    """A run, or None if it ended early or a joint was lost."""
    try:
        run = entry.fly(gains, phase)
    except ControllerError:
        return None
    return None if lost(run) else run


@dataclass(frozen=True)
class Rules:
    """How contests are held.

    Attributes:
        contests: which.
        trials: the plant that all are tuned on, then all others.
        effort: of each tuning.
        phases: of the encoders in the scores; tuning is at the first.
        seconds: only so much of each motion; all of it by default.
    """

    contests: tuple[Contest, ...] = CONTESTS
    trials: tuple[Trial, ...] = TRIALS
    effort: Effort = EFFORT
    phases: int = PHASES
    seconds: float | None = None


RULES = Rules()


def take_part(name: str, rules: Rules) -> tuple[Line, ...]:
    """Tunes a contender for each contest, and flies it on all plants."""
    contender = BY_NAME[name]
    entries = [
        Entry(contender, ground(trial, rules.phases, rules.seconds)) for trial in rules.trials
    ]
    return tuple(_line(contest, entries, rules.effort) for contest in rules.contests)


def _line(contest: Contest, entries: Sequence[Entry], effort: Effort) -> Line:
    contender, home = entries[0].contender, entries[0].ground
    tuned = tune(entries[0], contest.bound, effort)
    scores = tuple(score(entry, tuned.gains) for entry in entries)
    return Line(
        name=contender.name,
        label=contender.label,
        model=contender.model,
        parameters=contender.parameters(home.plant.joints),
        runs=tuned.runs if contender.knobs else 0,
        gains={name: tuple(values.tolist()) for name, values in tuned.gains.items()},
        scores=scores,
        within=scores[0].lost == 0 and scores[0].roughness <= MARGIN * contest.bound,
    )


def compare(
    rules: Rules = RULES,
    contenders: Sequence[str] = tuple(BY_NAME),
    advance: Callable[[int], None] = lambda _: None,
    processes: int | None = None,
) -> Result:
    """Holds all contests.

    Args:
        rules: of all of them.
        contenders: who, by name.
        advance: told of each contender as it ends.
        processes: contenders at a time; one for each core by default.

    Raises:
        PlantError, CompilerError, GenerationError: a plant or its C can't be made.
    """
    with ProcessPoolExecutor(processes) as pool:
        waiting = {pool.submit(take_part, name, rules): name for name in contenders}
        done = {}
        for future in as_completed(waiting):
            done[waiting[future]] = future.result()
            advance(1)
    return Result(
        rules.effort,
        rules.phases,
        tuple(
            Standing(contest, tuple(done[name][k] for name in contenders))
            for k, contest in enumerate(rules.contests)
        ),
    )
