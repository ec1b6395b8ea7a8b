"""What a fault did to a run, beside the same run without it, and the worst of several runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from codegen.status import LOST, Status
from plant.assembly import Floats, PlantError
from plant.closed_loop import NOT_CALLED
from verification.faults.cases import DEFAULT, Attempt, Ground, Guard
from verification.faults.catalogue import TICK_S, Fault
from verification.faults.fly import Flown, fly

_NAMES = {int(status): status.name for status in Status}

NOMINAL = 1.5
"""An error is nominal up to this many times the largest of the run without a fault."""


@dataclass(frozen=True)
class Score:
    """What a fault did; of several attempts, the worst of each.

    Attributes:
        noticed: attempts in which some status told of the fault while it lasted, or in the two
            ticks after.
        attempts: of how many.
        statuses: that there were from the fault on, beside TDC_OK, in the order of their first.
        after_ticks: from the beginning of the fault to the first of them; None where all was OK.
        lost_ticks: how many.
        saturated_ticks: how many.
        stopped: attempts in which the controller stopped, and was reset.
        diverged: attempts in which the motion became non-finite.
        peak_torque: largest torque, over the drive's limit, of the joint where that is most.
        peak_torque_step: largest change of a torque from tick to tick, likewise.
        peak_error_deg: largest error of a joint itself, not by its encoder.
        back_s: from the end of the fault, or the beginning of a lasting one, until the error of
            every joint is nominal for good; infinite where it never is within ``HORIZON_S``.
        back_seen_s: the same by the encoders.
    """

    noticed: int
    attempts: int
    statuses: tuple[str, ...]
    after_ticks: int | None
    lost_ticks: int
    saturated_ticks: int
    stopped: int
    diverged: int
    peak_torque: float
    peak_torque_step: float
    peak_error_deg: float
    back_s: float
    back_seen_s: float


_DIVERGED = Score(0, 1, (), None, 0, 0, 0, 1, 1.0, 2.0, math.inf, math.inf, math.inf)


def score(ground: Ground, fault: Fault, attempt: Attempt, flown: Flown, nominal: Flown) -> Score:
    """What a fault did in one run, beside the same run without it."""
    begin = 0 if fault.whole_run else attempt.moment.tick
    over = begin + (fault.ticks or 0)
    after = flown.status[begin:]
    telling = np.flatnonzero((after != Status.OK) & (after != NOT_CALLED))
    within = len(after) if fault.ticks is None else fault.ticks + 2
    limit = ground.plant.drive.torque_limit_Nm
    torque = np.abs(flown.torque_Nm[begin:]) / limit
    step = np.abs(np.diff(flown.torque_Nm[max(begin - 1, 0) :], axis=0)) / limit
    return Score(
        noticed=int(bool(len(telling)) and bool(telling[0] < within)),
        attempts=1,
        statuses=tuple(dict.fromkeys(_NAMES[int(after[k])] for k in telling)),
        after_ticks=int(telling[0]) if len(telling) else None,
        lost_ticks=int(np.count_nonzero(np.isin(after, list(LOST)))),
        saturated_ticks=int(np.count_nonzero(after == Status.SATURATED)),
        stopped=int(np.any(after == Status.STOPPED)),
        diverged=0,
        peak_torque=float(torque.max()),
        peak_torque_step=float(step.max()),
        peak_error_deg=float(np.rad2deg(np.abs(flown.error_rad[begin:]).max())),
        back_s=_back_s(flown.error_rad[over:], nominal.error_rad),
        back_seen_s=_back_s(flown.seen_error_rad[over:], nominal.seen_error_rad),
    )


def _back_s(error_rad: Floats, nominal_rad: Floats) -> float:
    """Until errors are for good within those of the run without a fault, times ``NOMINAL``."""
    bound = NOMINAL * np.abs(nominal_rad).max(axis=0)
    beyond = np.flatnonzero(np.any(np.abs(error_rad) > bound, axis=1))
    if not len(beyond):
        return 0.0
    return math.inf if beyond[-1] == len(error_rad) - 1 else float((beyond[-1] + 1) * TICK_S)


def worst(scores: Sequence[Score]) -> Score:
    """The worst of each figure."""

    def most(name: str) -> Any:
        return max(getattr(each, name) for each in scores)

    def total(name: str) -> int:
        return sum(getattr(each, name) for each in scores)

    late = [each.after_ticks for each in scores if each.after_ticks is not None]
    return Score(
        noticed=total("noticed"),
        attempts=total("attempts"),
        statuses=tuple(dict.fromkeys(s for each in scores for s in each.statuses)),
        after_ticks=max(late, default=None),
        lost_ticks=most("lost_ticks"),
        saturated_ticks=most("saturated_ticks"),
        stopped=total("stopped"),
        diverged=total("diverged"),
        peak_torque=most("peak_torque"),
        peak_torque_step=most("peak_torque_step"),
        peak_error_deg=most("peak_error_deg"),
        back_s=most("back_s"),
        back_seen_s=most("back_seen_s"),
    )


def try_fault(ground: Ground, fault: Fault, guard: Guard, *, replan: bool = True) -> Score:
    """The worst of a fault's attempts."""
    scores = []
    for attempt in ground.attempts:
        try:
            flown = fly(ground, fault, guard, attempt, replan=replan)
        except PlantError:
            scores.append(_DIVERGED)
            continue
        scores.append(score(ground, fault, attempt, flown, nominal(ground, attempt)))
    return worst(scores)


@cache
def nominal(ground: Ground, attempt: Attempt) -> Flown:
    """The run of an attempt without a fault."""
    return fly(ground, None, DEFAULT, attempt)


def nominal_peaks_deg(ground: Ground) -> tuple[float, ...]:
    """The largest errors without a fault, by joint, of all attempts."""
    errors = [np.abs(nominal(ground, each).error_rad).max(axis=0) for each in ground.attempts]
    return tuple(np.rad2deg(np.max(errors, axis=0)).tolist())
