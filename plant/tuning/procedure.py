"""The paper's tuning procedure, section III-E, carried out trial by trial.

1. alpha = beta = gamma = 1 and lambda = 0; each joint's Mbar is raised from a small value.
2. lambda is raised from 0.
3. gamma is lowered from 1.
4. alpha is lowered from 1, with beta = alpha/(2 - alpha).

In each step the quantity goes on as long as the RMS error falls and nothing vibrates; between the
last good value and the first bad one it is then bisected. All joints move at once. In step 1 each
joint keeps its own Mbar and is judged by its own error and vibration, and by that of the joints
which already stopped: they are not to be shaken through the arm. In the other steps, as in the
paper, all have one value, which is good if the mean of their RMS errors falls and none vibrates.

A step may use up as much vibration as the encoder's counts make by themselves
(:mod:`plant.tuning.vibration`): the measure may reach 2 in step 1, and 3, 4, 5 in the following
ones. Were it one limit for all, step 1 would leave no room for the others, which also raise it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Literal

import numpy as np

from plant.assembly import Floats
from plant.tuning.gains import Gains, TuningError, rounded
from plant.tuning.rig import SATURATED_SHARE, Evaluate, Outcome

START = 8
"""Step 1 begins with the specification's Mbar divided by this."""
FALLS = 0.98
"""An error falls that is less than this times the one before: two encoder phases may differ by as
much with the same gains."""

Stage = Literal["begin", "advance", "bisect", "confirm"]
Quantity = Literal["inertia", "lambda_", "gamma", "alpha"]


@dataclass(frozen=True)
class Step:
    """One of the four steps.

    Attributes:
        number: in the paper's list, from 1.
        quantity: the field of :class:`Gains` that is tuned.
        symbol: its name for people.
        advance: the next value; None at the end of the range.
        between: a value between the last good and the first bad one; None where they are close.
        retreat: a little less than a value, for one that turns out bad beside the others.
    """

    number: int
    quantity: Quantity
    symbol: str
    advance: Callable[[Fraction], Fraction | None]
    between: Callable[[Fraction, Fraction], Fraction | None]
    retreat: Callable[[Fraction], Fraction]

    @property
    def vibration_limit(self) -> float:
        """The counts' own, and as much for each step so far."""
        return 1.0 + self.number

    @property
    def by_joint(self) -> bool:
        """Whether each joint has its own value."""
        return self.quantity == "inertia"


def _times(factor: float, most: float = np.inf) -> Callable[[Fraction], Fraction | None]:
    return lambda value: rounded(value * factor) if value * factor <= most else None


def _minus(difference: Fraction, least: Fraction) -> Callable[[Fraction], Fraction | None]:
    return lambda value: value - difference if value - difference >= least else None


def _geometric(good: Fraction, bad: Fraction) -> Fraction | None:
    return rounded(float(good * bad) ** 0.5) if bad > 1.05 * good > 0 else None


def _arithmetic(resolution: Fraction) -> Callable[[Fraction, Fraction], Fraction | None]:
    return lambda good, bad: (good + bad) / 2 if abs(good - bad) > resolution else None


_LEAST_LAMBDA, _MOST_LAMBDA = Fraction(2), 2000.0


def _raise_lambda(value: Fraction) -> Fraction | None:
    return _times(1.5, _MOST_LAMBDA)(value) if value else _LEAST_LAMBDA


STEPS = (
    Step(1, "inertia", "Mbar", _times(1.25), _geometric, lambda x: rounded(x / 1.05)),
    Step(2, "lambda_", "lambda", _raise_lambda, _geometric, lambda x: rounded(x / 1.05)),
    Step(
        3,
        "gamma",
        "gamma",
        _minus(Fraction(1, 10), Fraction(1, 10)),
        _arithmetic(Fraction(1, 40)),
        lambda x: min(x + Fraction(1, 40), Fraction(1)),
    ),
    Step(
        4,
        "alpha",
        "alpha",
        _minus(Fraction(2, 100), Fraction(1, 2)),
        _arithmetic(Fraction(5, 1000)),
        lambda x: min(x + Fraction(5, 1000), Fraction(1)),
    ),
)
VIBRATION_LIMIT = STEPS[-1].vibration_limit
"""What the last step allows, and so the whole procedure."""


@dataclass(frozen=True)
class Verdict:
    """What is said of a value: whether it is good, and why."""

    good: bool
    reason: str


@dataclass(frozen=True)
class Trial:
    """One closed loop.

    Attributes:
        step: number of the step.
        stage: what for.
        gains: tried.
        outcome: shown.
        verdicts: one a joint in step 1, else one; None where a value was not at stake.
    """

    step: int
    stage: Stage
    gains: Gains
    outcome: Outcome
    verdicts: tuple[Verdict | None, ...]

    def plain(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "step": self.step,
            "stage": self.stage,
            "gains": self.gains.plain(),
            **self.outcome.plain(),
            "verdicts": [v and {"good": v.good, "reason": v.reason} for v in self.verdicts],
        }


@dataclass(frozen=True)
class Chosen:
    """What a step ended with."""

    step: Step
    gains: Gains
    outcome: Outcome


Watch = Callable[[Trial], None]
"""Is told of each trial."""


def tune(inertia: Sequence[Fraction], evaluate: Evaluate, watch: Watch) -> list[Chosen]:
    """The procedure from its beginning.

    Args:
        inertia: Mbar of the specification [kg m^2]; step 1 begins with the :data:`START`-th part.
        evaluate: flies a trial.
        watch: is told of each.

    Returns:
        What each step ended with; the last holds the tuned gains.

    Raises:
        TuningError: already the smallest Mbar vibrates or fails.
    """
    gains = Gains(tuple(rounded(x / START) for x in inertia))
    outcome: Outcome | None = None
    chosen: list[Chosen] = []
    for step in STEPS:
        search = _Search(step, gains, evaluate, watch)
        gains, outcome = search.run(outcome)
        chosen.append(Chosen(step, gains, outcome))
    return chosen


class _Search:
    """The trials of a step. A group is what has a common value: a joint, or all of them."""

    def __init__(self, step: Step, gains: Gains, evaluate: Evaluate, watch: Watch) -> None:
        self._step, self._gains, self._evaluate, self._watch = step, gains, evaluate, watch
        joints = range(len(gains.inertia))
        self._groups = [[joint] for joint in joints] if step.by_joint else [list(joints)]
        self._values = list(gains.inertia) if step.by_joint else [getattr(gains, step.quantity)]
        self._all = range(len(self._groups))
        self._errors = [np.inf for _ in self._groups]

    def run(self, before: Outcome | None) -> tuple[Gains, Outcome]:
        """The gains that the step ends with, and what they showed.

        Args:
            before: what the gains showed with which it begins, if they were tried.
        """
        outcome = self._begin() if before is None else before
        self._errors = [mean_error(outcome, group) for group in self._groups]
        self._bisect(self._advance())
        return self._confirm()

    def _begin(self) -> Outcome:
        outcome, verdicts = self._try("begin", self._values, set(self._all), np.inf)
        reasons = dict.fromkeys(v.reason for v in verdicts if v and not v.good)
        if reasons:
            raise TuningError(
                f"{'; '.join(reasons)} with 1/{START} of the specification's Mbar, lambda = 0 and "
                "alpha = beta = gamma = 1: write a smaller inertia_kgm2, or a slower trajectory"
            )
        return outcome

    def _advance(self) -> dict[int, Fraction]:
        """Moves each group to its last good value; gives the first bad ones.

        A group that reaches the end of its range has none.
        """
        bad: dict[int, Fraction] = {}
        on = set(self._all)
        while on:
            nexts = {g: self._step.advance(self._values[g]) for g in on}
            moves = {g: value for g, value in nexts.items() if value is not None}
            stopped = self._move("advance", moves, FALLS) if moves else []
            bad |= {g: moves[g] for g in stopped}
            on = set(moves) - set(stopped)
        return bad

    def _bisect(self, bad: dict[int, Fraction]) -> None:
        """Moves each group between its last good and its first bad value until they are close."""
        while True:
            halves = {g: self._step.between(self._values[g], value) for g, value in bad.items()}
            moves = {g: value for g, value in halves.items() if value is not None}
            if not moves:
                return
            for g in self._move("bisect", moves, 1.0):
                bad[g] = moves[g]

    def _confirm(self) -> tuple[Gains, Outcome]:
        """Goes back with all, a little at a time, while they shake together."""
        while True:
            outcome, verdicts = self._try("confirm", self._values, set(self._all), np.inf)
            back = [self._step.retreat(value) for value in self._values]
            if all(v is None or v.good for v in verdicts) or back == self._values:
                return self._with(self._values), outcome
            self._values = back

    def _move(self, stage: Stage, to: dict[int, Fraction], falls: float) -> list[int]:
        """Tries values of some groups and keeps the good ones; gives the groups that were bad."""
        tried = [to.get(g, value) for g, value in enumerate(self._values)]
        outcome, verdicts = self._try(stage, tried, set(to), falls)
        bad = []
        for g in to:
            verdict = verdicts[g]
            if verdict is not None and verdict.good:
                self._values[g] = tried[g]
                self._errors[g] = mean_error(outcome, self._groups[g])
            else:
                bad.append(g)
        return bad

    def _try(
        self, stage: Stage, values: list[Fraction], moved: set[int], falls: float
    ) -> tuple[Outcome, tuple[Verdict | None, ...]]:
        gains = self._with(values)
        outcome = self._evaluate(gains)
        limit = self._step.vibration_limit
        stopped = [j for g in self._all if g not in moved for j in self._groups[g]]
        verdicts = tuple(
            judge(outcome, self._groups[g], stopped, limit, falls * self._errors[g])
            if g in moved
            else None
            for g in self._all
        )
        self._watch(Trial(self._step.number, stage, gains, outcome, verdicts))
        return outcome, verdicts

    def _with(self, values: list[Fraction]) -> Gains:
        value = tuple(values) if self._step.by_joint else values[0]
        changed: dict[str, Any] = {self._step.quantity: value}
        return replace(self._gains, **changed)


def judge(
    outcome: Outcome, joints: list[int], stopped: list[int], limit: float, error_deg: float
) -> Verdict:
    """Whether a trial is good for some joints.

    Args:
        outcome: of the trial.
        joints: whose value was changed, from 0.
        stopped: joints whose value was not, and which must not begin to vibrate.
        limit: of the vibration measure.
        error_deg: below which the mean of the joints' RMS errors must be.
    """
    if outcome.failure is not None:
        return Verdict(False, outcome.failure)
    own = float(outcome.vibration[joints].max())
    if not own <= limit:
        return Verdict(False, f"vibrates: {own:.3g} > {limit:g}")
    if outcome.saturated[joints].max() > SATURATED_SHARE:
        return Verdict(False, "at the torque limit")
    if not mean_error(outcome, joints) < error_deg:
        return Verdict(False, "the error no longer falls")
    for joint in stopped:
        if not outcome.vibration[joint] <= limit:
            shaken = f"joint {joint + 1}: {outcome.vibration[joint]:.3g} > {limit:g}"
            return Verdict(False, f"shakes {shaken}")
    return Verdict(True, "quiet" if np.isinf(error_deg) else "falls, quiet")


def mean_error(outcome: Outcome, joints: list[int]) -> float:
    """The mean of some joints' RMS errors [deg]."""
    rms: Floats = outcome.rms_deg[joints]
    return float(np.mean(rms))
