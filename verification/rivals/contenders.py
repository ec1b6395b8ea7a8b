"""Everyone who takes part: the rivals by their own C, Hsia and the inclusive law by the shipped C.

That the shipped C with Hsia's gains has the bits of Hsia's law written by itself is what
``verification special-cases`` measures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from codegen.controller import Controller
from plant.assembly import Plant
from plant.closed_loop import Run
from plant.compiled.loop import CompiledLoop
from plant.controller import GeneratedController
from verification.rivals.laws import (
    INERTIA,
    KD,
    KI,
    KP,
    Knob,
    Law,
    computed_torque,
    integral_sliding_mode,
    pid,
)
from verification.rivals.model import Factors, Floats, model_of, random_signs, uniform
from verification.rivals.source import Rival, write_shipped, write_sources
from verification.rivals.trials import Ground, tuned

NO_MODEL = "none"
MODEL_ERROR = 0.2
COIN_SEED = 1
"""Of the signs of the model's errors."""

Gains = Mapping[str, Floats]
"""Each gain by its name, shape (n,)."""

LAMBDA = Knob("lambda", "rad^(1-gamma) s^(gamma-2)", 1.0, 1e3)
ALPHA = Knob("alpha", "1", 0.8, 1.0, logarithmic=False)
GAMMA = Knob("gamma", "1", 0.2, 1.0, logarithmic=False)


@dataclass(frozen=True, eq=False)
class Contender:
    """A controller that takes part.

    Attributes:
        name: an identifier.
        label: for a person.
        knobs: what is tuned; nothing where the gains are the specification's own.
        model: what it must know of the robot, in words.
        law: of a rival, for a plant; None for the shipped C.
        fixed: gains of the shipped C that make the special case.
        derived: gains of the shipped C that follow from those that are tuned.
    """

    name: str
    label: str
    knobs: tuple[Knob, ...]
    model: str = NO_MODEL
    law: Callable[[Plant], Law] | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)
    derived: Callable[[Gains], Gains] = lambda _: {}

    def parameters(self, joints: int) -> int:
        """How many numbers are tuned."""
        return sum(joints if knob.per_joint else 1 for knob in self.knobs)


def _without_model(label: str, law: Law) -> Contender:
    return Contender(law.name, label, law.knobs, law=lambda _: law)


def _modelled(
    name: str, label: str, factors: Callable[[], Factors], off: str, **parts: bool
) -> Contender:
    """Computed torque: its model is of each robot that it flies, with the same factors."""

    def law(plant: Plant) -> Law:
        return computed_torque(model_of(plant, factors()), **parts)

    knows = "rigid bodies, friction" if parts.get("friction") else "rigid bodies"
    knobs = (KD, KP, KI) if parts.get("integral") else (KD, KP)
    return Contender(name, label, knobs, f"{knows}: {off}", law)


def _coin() -> Factors:
    return random_signs(MODEL_ERROR, COIN_SEED)


def _finite_time(gains: Gains) -> Gains:
    """beta = alpha/(2 - alpha)."""
    return {"beta": gains["alpha"] / (2.0 - gains["alpha"])}


_MIXED, _ALL = f"each ±{MODEL_ERROR:.0%}", f"all +{MODEL_ERROR:.0%}"
OURS, PAPER = "inclusive", "inclusive_exp08"

CONTENDERS = (
    _without_model("PID", pid()),
    _without_model("sliding mode", integral_sliding_mode()),
    _modelled("ct", "CT", _coin, _MIXED),
    _modelled("ct_f", "CT friction", _coin, _MIXED, friction=True),
    _modelled("ct_fi", "CT friction KI", _coin, _MIXED, friction=True, integral=True),
    _modelled(
        "ct_fi_high",
        "CT friction KI +",
        lambda: uniform(MODEL_ERROR),
        _ALL,
        friction=True,
        integral=True,
    ),
    Contender(
        "hsia",
        "Hsia's TDC",
        (INERTIA, KD, KP),
        fixed={"lambda": 0.0, "alpha": 1.0, "beta": 1.0, "gamma": 1.0},
    ),
    Contender(PAPER, "ours, Exp08", ()),
    Contender(
        OURS,
        "ours, tuned",
        (INERTIA, KD, KP, LAMBDA, ALPHA, GAMMA),
        derived=_finite_time,
    ),
)
BY_NAME = {contender.name: contender for contender in CONTENDERS}


class Entry:
    """A contender on the ground of a trial.

    Args:
        contender: who.
        ground: where.

    Raises:
        PlantError, CompilerError, GenerationError: the C can't be made.
    """

    def __init__(self, contender: Contender, ground: Ground) -> None:
        self.contender, self.ground = contender, ground
        law = None if contender.law is None else contender.law(ground.plant)
        specification = ground.specification
        # A folder of its own: others may be compiled at the same time.
        folder = f"{contender.name}-{ground.plant.name}"
        sources = (
            write_shipped(specification, folder)
            if law is None
            else write_sources(law, specification, folder)
        )
        models = ground.begins[0][1].script.models
        self._law = law
        self._loop = CompiledLoop(ground.plant, specification, sources, models)

    def controller(self, gains: Gains) -> GeneratedController:
        """The contender's C with these gains."""
        if self._law is not None:
            rival = Rival(self._law, self._loop)
            rival.tune(gains)
            return rival
        shipped = self._loop.controller()
        shipped.set_gains(self._tuned(gains))
        return shipped

    def _tuned(self, gains: Gains) -> Controller:
        own, specification = self.contender, self.ground.specification
        columns = {**gains, **own.derived(gains)} if own.knobs else {}
        return tuned(
            specification,
            [
                {**{name: float(column[i]) for name, column in columns.items()}, **own.fixed}
                for i in range(len(specification.joints))
            ],
        )

    def fly(self, gains: Gains, phase: int = 0) -> Run:
        """One run at one of the ground's encoder phases.

        Raises:
            ControllerError: the controller gave up: some joint moved at an impossible speed.
            PlantError: the motion became non-finite.
        """
        plant, begin = self.ground.begins[phase]
        sample_time_s = float(self.ground.specification.sample_time)
        return self._loop.run(plant, self.controller(gains), begin, sample_time_s)
