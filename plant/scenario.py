"""Scenarios: the faults, disturbances and payloads of a run as people write them, in TOML.

A scenario is a list of events, each with the time when it begins and how long it lasts::

    [[events]]
    kind = "payload"
    at_s = 4.0
    mass_kg = 2.0
    center_of_mass_m = [0.0, 0.0, 0.1]

Where ``joints`` are not given an event concerns all of them; without ``duration_s`` it lasts to the
end. Amounts of several events add up. An encoder has one fault at a time, a tick one lateness: the
event that stands later in the file counts.
"""

from __future__ import annotations

import tomllib
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from codegen.problems import Problem, SpecificationError, show
from plant.assembly import Plant, PlantError
from plant.robot import InertiaTensor
from plant.script import Reading, Script, Timing, uneventful
from plant.trajectory import Reference

SCENARIOS = Path(__file__).parent / "scenarios"

NotNegative = Annotated[FiniteFloat, Field(ge=0)]
Positive = Annotated[FiniteFloat, Field(gt=0)]
Vector = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
JointNumbers = Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)]

# A time this close to a tick's is meant to be it: 300 times 0.001 is not 0.3.
_ROUNDING_S = 1e-9


class _Load(NamedTuple):
    """A payload on its joint during some ticks."""

    ticks: slice
    joint: int
    inertia: pin.Inertia


@dataclass
class _Stage:
    """A script in the making; its arrays may be written."""

    plant: Plant
    reference: Reference
    script: Script
    loads: list[_Load] = field(default_factory=list)
    timings: list[Timing] = field(default_factory=list)

    def time(self, timing: Timing, ticks: slice | int) -> None:
        """Gives ticks another timing."""
        self.script.timing[ticks] = len(self.timings)
        self.timings.append(timing)


class _Event(BaseModel, ABC):
    """What all events have."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    at_s: NotNegative = 0.0
    duration_s: Positive | None = None

    def ticks(self, stage: _Stage) -> slice:
        """The ticks at or after the beginning and before the end."""
        time = stage.reference.time_s + _ROUNDING_S
        end = None if self.duration_s is None else self.at_s + self.duration_s
        first, last = np.searchsorted(time, [self.at_s, np.inf if end is None else end])
        return slice(int(first), int(last))

    @abstractmethod
    def act(self, stage: _Stage) -> None:
        """Writes the event into the script."""


class _JointEvent(_Event):
    """An event of some joints."""

    joints: JointNumbers | None = None

    def where(self, stage: _Stage) -> tuple[slice, list[int]]:
        """The rows and columns of the script's arrays that it concerns.

        Raises:
            PlantError: there is no such joint.
        """
        n = stage.plant.joints
        if self.joints is None:
            return self.ticks(stage), list(range(n))
        if max(self.joints) > n:
            raise PlantError(
                f"scenario: {stage.plant.name} has {n} joints, not a joint {max(self.joints)}"
            )
        return self.ticks(stage), [joint - 1 for joint in self.joints]


class PayloadEvent(_Event):
    """Another mass on a link, by default the last: an object that the robot takes or drops.

    It takes part in the motion from one tick to the next, without an impact: as if it had been
    moving along before.
    """

    kind: Literal["payload"]
    mass_kg: Positive
    center_of_mass_m: Vector = [0.0, 0.0, 0.0]
    inertia_kgm2: InertiaTensor | None = None
    frame: str | None = None

    def act(self, stage: _Stage) -> None:  # noqa: D102 - as the base class
        model = stage.plant.model
        name = self.frame or _last_body(model)
        if not model.existFrame(name):
            raise PlantError(f"scenario: {stage.plant.name} has no frame {name!r}")
        frame = model.frames[model.getFrameId(name)]
        tensor = np.zeros((3, 3)) if self.inertia_kgm2 is None else self.inertia_kgm2.matrix()
        inertia = pin.Inertia(self.mass_kg, np.array(self.center_of_mass_m), tensor)
        placed = frame.placement.act(inertia)
        stage.loads.append(_Load(self.ticks(stage), frame.parentJoint, placed))


def _last_body(model: pin.Model) -> str:
    """The name of the last joint's last body."""
    bodies = [
        frame.name
        for frame in model.frames
        if frame.type == pin.FrameType.BODY and frame.parentJoint == model.njoints - 1
    ]
    return str(bodies[-1])


class DisturbanceEvent(_JointEvent):
    """A torque on the joints' links from outside; held over each tick.

    With a frequency it is a sine that begins with the event.
    """

    kind: Literal["disturbance"]
    torque_Nm: FiniteFloat
    frequency_Hz: NotNegative = 0.0

    def act(self, stage: _Stage) -> None:  # noqa: D102
        ticks, joints = self.where(stage)
        torque = np.full(len(stage.reference.time_s[ticks]), self.torque_Nm)
        if self.frequency_Hz > 0.0:
            phase = 2.0 * np.pi * self.frequency_Hz * (stage.reference.time_s[ticks] - self.at_s)
            torque *= np.sin(phase)
        stage.script.external_Nm[ticks, joints] += torque[:, np.newaxis]


class TorqueLimitEvent(_JointEvent):
    """Drives that give only a fraction of their largest torque; none with a factor of 0."""

    kind: Literal["torque-limit"]
    factor: NotNegative

    def act(self, stage: _Stage) -> None:  # noqa: D102
        ticks, joints = self.where(stage)
        stage.script.torque_limit_Nm[ticks, joints] *= self.factor


class TorqueShareEvent(_JointEvent):
    """Drives that give another torque than they are told: this share of it."""

    kind: Literal["torque-share"]
    share: FiniteFloat

    def act(self, stage: _Stage) -> None:  # noqa: D102
        ticks, joints = self.where(stage)
        stage.script.torque_share[ticks, joints] *= self.share


class EncoderNoiseEvent(_JointEvent):
    """Jitter of the encoders' edges beside the robot's own: normal, independent from tick to tick.

    ``sigma_counts`` is its standard deviation.
    """

    kind: Literal["encoder-noise"]
    sigma_counts: Positive
    seed: int = 0

    def act(self, stage: _Stage) -> None:  # noqa: D102
        ticks, joints = self.where(stage)
        noise = _random(self.seed).standard_normal(stage.script.noise_counts.shape)
        stage.script.noise_counts[ticks, joints] += self.sigma_counts * noise[ticks, joints]


_FAULTS = {
    "encoder-dropout": Reading.ZERO,
    "encoder-stuck": Reading.STUCK,
    "encoder-lost-pulses": Reading.LOST,
}


class EncoderFaultEvent(_JointEvent):
    """Encoders that read 0 or the same value again; see :class:`plant.script.Reading`."""

    kind: Literal["encoder-dropout", "encoder-stuck", "encoder-lost-pulses"]

    def act(self, stage: _Stage) -> None:  # noqa: D102
        ticks, joints = self.where(stage)
        stage.script.reading[ticks, joints] = _FAULTS[self.kind]


class EncoderJumpEvent(_JointEvent):
    """Counters that hold so many counts too much."""

    kind: Literal["encoder-jump"]
    counts: int

    def act(self, stage: _Stage) -> None:  # noqa: D102
        ticks, joints = self.where(stage)
        stage.script.shift_counts[ticks, joints] += self.counts


class EncoderGarbageEvent(_JointEvent):
    """Readings that are any number of 32 bits, each as likely, another in each tick."""

    kind: Literal["encoder-garbage"]
    seed: int = 0

    def act(self, stage: _Stage) -> None:  # noqa: D102
        ticks, joints = self.where(stage)
        shift = stage.script.shift_counts
        # A counter that holds so much too much may hold anything.
        shift[ticks, joints] += _random(self.seed).integers(0, 2**32, shift.shape)[ticks, joints]


class EncoderWrapEvent(_JointEvent):
    """Counters that overflow where the reference is at the event's time.

    They hold another value from the start on, in which the reference is given, too.
    """

    kind: Literal["encoder-wrap"]

    def act(self, stage: _Stage) -> None:  # noqa: D102
        _, joints = self.where(stage)
        encoder, reference = stage.script.encoder, stage.reference
        tick = min(self.ticks(stage).start, len(reference.time_s) - 1)
        offset = encoder.offset_counts.copy()
        offset[joints] += 2**31 - encoder.exact_counts(reference.position_rad[tick])[joints]
        stage.script = replace(stage.script, encoder=replace(encoder, offset_counts=offset))


class MissedTicksEvent(_Event):
    """Ticks at which the controller is not called; the drives keep their last command."""

    kind: Literal["missed-ticks"]

    def act(self, stage: _Stage) -> None:  # noqa: D102
        stage.script.called[self.ticks(stage)] = False


class LateTicksEvent(_Event):
    """Ticks that come late by a fraction of the sample time, or by a random one up to it."""

    kind: Literal["late-ticks"]
    late: Annotated[FiniteFloat, Field(gt=0, le=1)]
    random: bool = False
    seed: int = 0

    def act(self, stage: _Stage) -> None:  # noqa: D102
        ticks, delay = self.ticks(stage), stage.plant.drive.delay
        if self.late + delay > 1.0:
            raise PlantError(
                f"scenario: ticks {self.late:g} of a sample late and a drive that takes {delay:g} "
                "of it: together they must not take longer than the sample"
            )
        if not self.random:
            stage.time(Timing(self.late, delay), ticks)
            return
        fractions = _random(self.seed).random(stage.script.ticks)
        for tick in range(*ticks.indices(stage.script.ticks)):
            stage.time(Timing(float(self.late * fractions[tick]), delay), tick)


Event = Annotated[
    PayloadEvent
    | DisturbanceEvent
    | TorqueLimitEvent
    | TorqueShareEvent
    | EncoderNoiseEvent
    | EncoderFaultEvent
    | EncoderJumpEvent
    | EncoderGarbageEvent
    | EncoderWrapEvent
    | MissedTicksEvent
    | LateTicksEvent,
    Field(discriminator="kind"),
]


class Scenario(BaseModel):
    """A scenario as it is written."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    description: str = ""
    events: list[Event]

    def script(self, plant: Plant, reference: Reference) -> Script:
        """The script of a run.

        Args:
            plant: whose run it is.
            reference: of the run.

        Raises:
            PlantError: the plant has no such joint or frame, or an event doesn't fit it.
        """
        stage = _Stage(plant, reference, uneventful(plant, reference))
        stage.timings.extend(stage.script.timings)
        for event in self.events:
            event.act(stage)
        models, model = _loaded(plant.model, stage.loads, stage.script.ticks)
        return replace(stage.script, timings=tuple(stage.timings), models=models, model=model)


def _loaded(
    model: pin.Model, loads: Sequence[_Load], ticks: int
) -> tuple[tuple[pin.Model, ...], NDArray[np.int64]]:
    """The different rigid bodies of a run, the bare ones first, and those of each tick."""
    if not loads:
        return (model,), np.zeros(ticks, dtype=np.int64)
    carried = np.zeros((ticks, len(loads)), dtype=np.bool_)
    for column, load in enumerate(loads):
        carried[load.ticks, column] = True
    different, index = np.unique(
        np.vstack((np.zeros((1, len(loads)), dtype=np.bool_), carried)), axis=0, return_inverse=True
    )
    models = tuple(
        reduce(_with_load, (load for load, there in zip(loads, row, strict=True) if there), model)
        for row in different
    )
    return models, index.reshape(-1)[1:].astype(np.int64)


def _with_load(model: pin.Model, load: _Load) -> pin.Model:
    loaded = pin.Model(model)
    loaded.inertias[load.joint] = loaded.inertias[load.joint] + load.inertia
    return loaded


def _random(seed: int) -> np.random.Generator:
    # Named, because numpy may change its default.
    return np.random.Generator(np.random.PCG64(seed))


def scenario_names() -> list[str]:
    """Names of the scenarios that come along, sorted."""
    return sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def read_scenario(scenario: str | Path) -> Scenario:
    """Reads a scenario.

    Args:
        scenario: a name of :func:`scenario_names`, or the path of a ``.toml`` file.

    Raises:
        SpecificationError: there is no such file, it is no TOML or breaks a rule.
    """
    path = Path(scenario)
    if path.suffix != ".toml":
        path = SCENARIOS / f"{scenario}.toml"
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        known = f"write the path of a .toml file, or one of {', '.join(scenario_names())}"
        problem = Problem("scenario", show(str(scenario)), "a file that is there", known)
        raise SpecificationError(str(scenario), [problem]) from error
    except (ValueError, RecursionError) as error:
        # Also bytes that aren't UTF-8, numbers of too many digits, and nests that are too deep.
        problem = Problem("scenario", path.name, "valid TOML", str(error))
        raise SpecificationError(path.name, [problem]) from error
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        raise SpecificationError(path.name, [_problem(x) for x in error.errors()]) from error


def _problem(found: Any) -> Problem:
    """One of pydantic's complaints in the words of the file, events counted from 1."""
    where = [part + 1 if isinstance(part, int) else part for part in found["loc"]]
    fix = "see plant/scenario.py for the kinds of events and their keys"
    return Problem(".".join(map(str, where)), show(found["input"]), found["msg"], fix)
