"""An optimiser over the same gains, under the same limit of vibration, on many plants at once.

    minimise    mean over training plants and joints of the RMS error
    subject to  the vibration measure of every joint on every training plant <= its limit, and no
                drive at its torque limit

over log Mbar_i, log lambda, gamma and alpha, by a mesh adaptive direct search (C. Audet, J. E.
Dennis Jr., Mesh adaptive direct search algorithms for constrained optimization, SIAM Journal on
Optimization 17(1), 2006): it polls both ways along orthogonal directions, goes farther after a
success, closer after none, and takes what breaks the constraint for infinitely bad. It starts from
the best of a small grid: the procedure's gains, with Mbar and lambda lowered.

Differential evolution was tried first. From as many trials it found larger errors: little of the
space is quiet, and less of it near the limit, where the best gains are.

The training plants are drawn at random (:data:`plant.tuning.rig.RELATIVES`), so the gains are good
on a family of robots, not on one. The procedure has only the one plant in front of it, as an
engineer has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from plant.assembly import Floats, Plant
from plant.tuning.gains import Gains, TuningError, rounded
from plant.tuning.procedure import VIBRATION_LIMIT, mean_error
from plant.tuning.rig import SATURATED_SHARE, Outcome

Fly = Callable[[Gains, Plant], Outcome]
"""A trial on one plant."""

INERTIA_FACTORS = tuple(0.8**k for k in range(8))
"""Times the procedure's Mbar, which is too large for some of the relatives."""
LAMBDA_FACTORS = (1.0, 0.25, 0.0625)
"""Times its lambda, which a small Mbar doesn't go with: s then swings slowly and wide."""

# One unit of the search: a factor of e of Mbar, e^2 of lambda, and differences of the exponents.
_LAMBDA_UNIT, _GAMMA_UNIT, _ALPHA_UNIT = 2.0, 0.4, 0.2
_GAMMA, _ALPHA = (0.05, 1.0), (0.5, 1.0)
_LEAST_LAMBDA = 0.1
_FIRST_STEP, _LAST_STEP = 0.25, 0.01


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
        """What is minimised: the error, infinite where the constraint is broken."""
        return self.error_deg if self.excess <= 1.0 else math.inf

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
        begin: the procedure's gains.
        evaluate: scores gains.
        evaluations: how many gain sets are tried, more than the grid has.
        seed: of the directions; the same one gives the same result.
        watch: is told of each attempt.

    Raises:
        TuningError: all gains of the grid break the constraint.
    """
    left = evaluations

    def attempt(gains: Gains) -> Attempt:
        nonlocal left
        left -= 1
        made = Attempt(gains, evaluate(gains))
        watch(made)
        return made

    best = min(map(attempt, _grid(begin)), key=lambda tried: tried.score.cost)
    if math.isinf(best.score.cost):
        raise TuningError(
            "some relatives of the plant vibrate with far lower gains than the procedure's, too: "
            "there is nothing to optimise"
        )
    rng = np.random.Generator(np.random.PCG64(seed))
    directions, step = np.eye(len(_vector(begin))), _FIRST_STEP
    while left > 0:
        for direction in (*directions, *-directions):
            gains = _gains(_vector(best.gains) + step * direction)
            found = attempt(gains) if left > 0 and gains != best.gains else best
            if found.score.cost < best.score.cost:
                best, step = found, min(2.0 * step, _FIRST_STEP)
                break
        else:
            # The scatter of chaotic loops ends no search: it goes on in other directions.
            step = step / 2.0 if step > _LAST_STEP else _FIRST_STEP
        directions = _orthogonal(rng, len(directions))
    return best


def _grid(begin: Gains) -> list[Gains]:
    """What the search may start from."""
    return [
        replace(
            begin,
            inertia=tuple(rounded(float(x) * inertia) for x in begin.inertia),
            lambda_=rounded(float(begin.lambda_) * lambda_),
        )
        for lambda_ in LAMBDA_FACTORS
        for inertia in INERTIA_FACTORS
    ]


def _orthogonal(rng: np.random.Generator, size: int) -> Floats:
    """A random orthogonal matrix, of the uniform distribution but for signs."""
    directions: Floats = np.linalg.qr(rng.standard_normal((size, size)))[0]
    return directions


def _vector(gains: Gains) -> Floats:
    """Where gains are in the search's space."""
    return np.array(
        [
            *(math.log(x) for x in gains.inertia),
            math.log(max(float(gains.lambda_), _LEAST_LAMBDA)) / _LAMBDA_UNIT,
            float(gains.gamma) / _GAMMA_UNIT,
            float(gains.alpha) / _ALPHA_UNIT,
        ]
    )


def _gains(x: Floats) -> Gains:
    """The gains at a place, or at the nearest one within bounds, to the digits of a file."""
    *inertia, lambda_, gamma, alpha = x.tolist()
    return Gains(
        inertia=tuple(rounded(math.exp(value)) for value in inertia),
        lambda_=rounded(max(math.exp(_LAMBDA_UNIT * lambda_), _LEAST_LAMBDA)),
        gamma=rounded(float(np.clip(_GAMMA_UNIT * gamma, *_GAMMA)), 3),
        alpha=rounded(float(np.clip(_ALPHA_UNIT * alpha, *_ALPHA)), 3),
    )
