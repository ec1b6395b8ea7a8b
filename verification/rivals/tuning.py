"""Equal effort: everyone is tuned by the same optimiser with the same number of closed loops.

What is made small is the geometric mean over the joints of the RMS error, which needs no weights:
a joint's scale moves every controller's figure by the same factor. What is held is that no joint's
torque is rough: the RMS of its change from tick to tick stays below a part of the drive's limit,
one part for all. A run that breaks that, or ends early, is worse than every run that doesn't, and
the worse the further.

The optimiser is SciPy's differential evolution (Storn and Price 1997) with one population, one
number of generations and one seed for all, whatever the number of gains: more gains are no excuse
for more runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from plant.closed_loop import ControllerError, Run
from verification.rivals.contenders import Entry, Gains
from verification.rivals.laws import Knob
from verification.rivals.model import Floats

POPULATION, GENERATIONS = 20, 20
SEED = 1
LOST_DEG = 5.0
"""A joint that is ever further off its reference has lost it."""

_ROUGH, _LOST = 100.0, 200.0
"""Beyond every logarithm of an error in degrees."""


@dataclass(frozen=True)
class Effort:
    """How much tuning everyone gets.

    Attributes:
        population: gain sets in a generation.
        generations: with the first one.
        seed: of the optimiser.
    """

    population: int = POPULATION
    generations: int = GENERATIONS
    seed: int = SEED

    @property
    def runs(self) -> int:
        """Closed loops flown for each contender."""
        return self.population * self.generations


EFFORT = Effort()


@dataclass(frozen=True, eq=False)
class Tuned:
    """The best gains that were found.

    Attributes:
        gains: by name, one a joint.
        cost: of the run that they were chosen for, see :func:`cost`.
        runs: closed loops flown.
    """

    gains: Gains
    cost: float
    runs: int


def gains_of(knobs: Sequence[Knob], vector: Floats, joints: int) -> Gains:
    """The gains at a point of the unit cube, which has an axis for each number that is tuned."""
    gains: dict[str, Floats] = {}
    left = np.asarray(vector)
    for knob in knobs:
        count = joints if knob.per_joint else 1
        own, left = left[:count], left[count:]
        if knob.logarithmic:
            values = knob.low * (knob.high / knob.low) ** own
        else:
            values = knob.low + (knob.high - knob.low) * own
        gains[knob.name] = np.broadcast_to(values, (joints,)).copy()
    return gains


def torque_step(run: Run) -> Floats:
    """RMS of the torque's change from tick to tick [N m], shape (n,)."""
    step: Floats = np.sqrt(np.mean(np.diff(run.torque_applied_Nm, axis=0) ** 2, axis=0))
    return step


def roughness(run: Run, torque_limit_Nm: Floats) -> float:
    """The RMS torque step over the drive's limit, of the roughest joint."""
    return float(np.max(torque_step(run) / torque_limit_Nm))


def lost(run: Run) -> bool:
    """Whether a joint was ever further than ``LOST_DEG`` off."""
    return bool(np.rad2deg(np.abs(run.error_rad)).max() > LOST_DEG)


def mean_error_deg(rms_deg: Floats) -> float:
    """The geometric mean over the joints, shape (n,)."""
    return float(np.exp(np.mean(np.log(rms_deg))))


def cost(entry: Entry, gains: Gains, bound: float) -> float:
    """The logarithm of the mean error, or a number beyond all of these if the run isn't allowed."""
    ticks = entry.ground.begins[0][1].script.ticks
    try:
        run = entry.fly(gains)
    except ControllerError as error:
        return _LOST + 1.0 - error.tick / ticks
    if lost(run):
        return _LOST + math.log10(mean_error_deg(run.rms_error_deg())) / 100.0
    rough = roughness(run, entry.ground.plant.drive.torque_limit_Nm)
    if rough > bound:
        return _ROUGH + math.log(rough / bound)
    return math.log(mean_error_deg(run.rms_error_deg()))


def tune(
    entry: Entry,
    bound: float,
    effort: Effort = EFFORT,
    advance: Callable[[int], None] = lambda _: None,
) -> Tuned:
    """Tunes a contender on the ground of its entry.

    Args:
        entry: who and where.
        bound: of the roughness.
        effort: the same for all who are compared.
        advance: told of each closed loop as it ends.
    """
    knobs, joints = entry.contender.knobs, entry.ground.plant.joints
    dimensions = entry.contender.parameters(joints)
    if dimensions == 0:
        return Tuned({}, cost(entry, {}, bound), 1)

    def objective(vector: Floats) -> float:
        value = cost(entry, gains_of(knobs, vector, joints), bound)
        advance(1)
        return value

    first = qmc.LatinHypercube(dimensions, seed=effort.seed).random(effort.population)
    found = differential_evolution(
        objective,
        [(0.0, 1.0)] * dimensions,
        init=first,
        # The first generation is not counted; a tolerance of 0 makes it use all of them.
        maxiter=effort.generations - 1,
        tol=0.0,
        atol=0.0,
        polish=False,
        seed=effort.seed,
    )
    return Tuned(gains_of(knobs, found.x, joints), float(found.fun), int(found.nfev))
