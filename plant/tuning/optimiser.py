"""An optimiser over the same gains, under the same limit of vibration, on many plants at once.

    minimise    mean over training plants and joints of the RMS error
    subject to  the vibration measure of every joint on every training plant <= its limit, and no
                drive at its torque limit

by scipy's differential evolution over log Mbar_i, log lambda, gamma and alpha. Gains that break the
constraint are worse than any that keep it, and better the less they break it; so the search first
finds its way to where the loop is quiet. One of its first candidates is the procedure's result.

The training plants are drawn at random (:data:`plant.tuning.rig.RELATIVES`), so the gains are good
on a family of robots, not on one. The procedure has only the one plant in front of it, as an
engineer has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from plant.assembly import Floats, Plant
from plant.tuning.gains import Gains, rounded
from plant.tuning.procedure import VIBRATION_LIMIT, mean_error
from plant.tuning.rig import SATURATED_SHARE, Outcome

Fly = Callable[[Gains, Plant], Outcome]
"""A trial on one plant."""

INERTIA_FACTOR = 8.0
"""Mbar is searched between the procedure's divided by this and times this."""
_LAMBDA, _GAMMA, _ALPHA = (1.0, 1000.0), (0.05, 1.0), (0.5, 1.0)
_CANDIDATES = 20
# Larger than any RMS error [deg] that keeps the constraint.
_BROKEN = 1e3


@dataclass(frozen=True)
class Score:
    """How good gains are on several plants.

    Attributes:
        error_deg: mean of the RMS errors, infinite where a run ended early.
        vibration: the largest measure.
        saturated: the largest share of ticks at the torque limit.
    """

    error_deg: float
    vibration: float
    saturated: float

    @property
    def excess(self) -> float:
        """By what factor the constraint is broken; at most 1 if it is kept."""
        return max(self.vibration / VIBRATION_LIMIT, self.saturated / SATURATED_SHARE)

    @property
    def cost(self) -> float:
        """What is minimised: the error, or more than any error where the constraint is broken."""
        if self.excess <= 1.0:
            return self.error_deg
        return _BROKEN + min(math.log(self.excess), _BROKEN)

    def plain(self) -> dict[str, Any]:
        """As plain data; None for what is not finite."""
        return {key: x if math.isfinite(x) else None for key, x in vars(self).items()}


def score(gains: Gains, fly: Fly, plants: Sequence[Plant]) -> Score:
    """Flies gains on plants one after the other, until one breaks the constraint.

    The error is then unknown, infinite. With the hardest plant first most bad gains cost one run.
    """
    joints = list(range(len(gains.inertia)))
    errors: list[float] = []
    vibration = saturated = 0.0
    for plant in plants:
        outcome = fly(gains, plant)
        errors.append(mean_error(outcome, joints))
        vibration = max(vibration, float(outcome.vibration.max()))
        saturated = max(saturated, float(outcome.saturated.max()))
        if Score(errors[-1], vibration, saturated).excess > 1.0:
            return Score(math.inf, vibration, saturated)
    return Score(float(np.mean(errors)), vibration, saturated)


def training(gains: Gains, fly: Fly, drawn: Sequence[Plant], count: int) -> list[Plant]:
    """Some of many random plants that stand for all, from the hardest to the easiest.

    They are evenly spaced in the order of how much they vibrate with some gains, both ends among
    them: few plants drawn at random would miss the corner that the constraint is about.

    Args:
        gains: to fly them all with.
        fly: a trial on one plant.
        drawn: at least so many plants as are wanted.
        count: how many are wanted, at least 2.
    """
    shaking = [float(fly(gains, plant).vibration.max()) for plant in drawn]
    order = np.argsort(shaking, kind="stable")[::-1]
    ranks = np.rint(np.linspace(0, len(order) - 1, count)).astype(int)
    return [drawn[i] for i in order[ranks]]


@dataclass(frozen=True)
class Attempt:
    """Gains that the optimiser tried."""

    gains: Gains
    score: Score

    def plain(self) -> dict[str, Any]:
        """As plain data."""
        return {"gains": self.gains.plain()} | self.score.plain()


def optimise(
    begin: Gains,
    evaluate: Callable[[Gains], Score],
    evaluations: int,
    seed: int,
    watch: Callable[[Attempt], None],
) -> Attempt:
    """The best gains of a search.

    Args:
        begin: one of the first candidates, and the middle of Mbar's range.
        evaluate: scores gains.
        evaluations: about how many; whole generations of :data:`_CANDIDATES` are made.
        seed: of the search; the same one gives the same result.
        watch: is told of each attempt.
    """
    middle = np.log([float(x) for x in begin.inertia])
    span = math.log(INERTIA_FACTOR)
    logs = (math.log(_LAMBDA[0]), math.log(_LAMBDA[1]))
    bounds = np.array([*((m - span, m + span) for m in middle), logs, _GAMMA, _ALPHA])
    attempts: list[Attempt] = []

    def cost(x: Floats) -> float:
        gains = _gains(x)
        attempts.append(Attempt(gains, evaluate(gains)))
        watch(attempts[-1])
        return attempts[-1].score.cost

    differential_evolution(
        cost,
        bounds,
        x0=np.clip(_vector(begin), *bounds.T),
        init=_first(bounds, seed),
        maxiter=max(1, evaluations // _CANDIDATES - 1),
        tol=0.0,
        polish=False,
        rng=np.random.Generator(np.random.PCG64(seed)),
    )
    return min(attempts, key=lambda attempt: attempt.score.cost)


def attempts_of(evaluations: int) -> int:
    """How many attempts :func:`optimise` makes of so many that are asked for."""
    return _CANDIDATES * max(2, evaluations // _CANDIDATES)


def _first(bounds: NDArray[np.float64], seed: int) -> Floats:
    """The first candidates, spread evenly: a Latin hypercube, shape (candidates, dimensions)."""
    rng = np.random.Generator(np.random.PCG64(seed))
    cells = [rng.permutation(_CANDIDATES) for _ in bounds]
    fractions = (np.array(cells).T + rng.random((_CANDIDATES, len(bounds)))) / _CANDIDATES
    low, high = bounds.T
    spread: Floats = low + (high - low) * fractions
    return spread


def _vector(gains: Gains) -> Floats:
    return np.array(
        [
            *(math.log(x) for x in gains.inertia),
            math.log(max(float(gains.lambda_), _LAMBDA[0])),
            float(gains.gamma),
            float(gains.alpha),
        ]
    )


def _gains(x: Floats) -> Gains:
    """The vector's gains, to the digits that a file is given."""
    *inertia, lambda_, gamma, alpha = x.tolist()
    return Gains(
        inertia=tuple(rounded(math.exp(value)) for value in inertia),
        lambda_=rounded(math.exp(lambda_)),
        gamma=rounded(gamma, 3),
        alpha=rounded(alpha, 3),
    )
