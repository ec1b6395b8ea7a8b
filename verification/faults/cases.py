"""What is flown: plants, motions and controllers, and what the controllers guard themselves with.

A guard is nothing but what `[safety]` of a specification says, set in the running configuration of
the shipped C.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from codegen.controller import Controller, read, resolve
from codegen.exact import LOST_TICKS_MAX
from codegen.status import Status
from plant.assembly import Plant, PlantError, build_plant
from plant.closed_loop import Events
from plant.compiled.loop import CompiledLoop
from plant.controller import GeneratedController
from plant.robot import FrictionName, load_robot
from plant.scenario import Event, Scenario
from plant.trajectory import RestToRest
from verification.experiments import CONTROLLERS
from verification.faults.catalogue import CATALOGUE, TICK_S, Moment


@dataclass(frozen=True, eq=False)
class Guard:
    """What the controller guards itself with.

    Attributes:
        name: one or two words.
        meaning: beside what is shipped.
        safety: keys of ``[safety]`` that are other than shipped.
    """

    name: str
    meaning: str
    safety: Mapping[str, Any] = field(default_factory=dict)


NONE = Guard(
    "none",
    "no plausibility limit, no stop, no anti-windup",
    {
        "max_speed_rad_per_s": 6_000_000,
        "max_acceleration_rad_per_s2": 10**12,
        "max_lost_ticks": LOST_TICKS_MAX,
        "anti_windup": False,
    },
)
DEFAULT = Guard("default", "as shipped")
TIGHT = Guard(
    "tight",
    "max_acceleration_rad_per_s2 = 150: the largest change of speed that passes makes the law ask "
    "for 0.8 to 1 of the torque limit; as shipped for 1.2 to 1.3 of it",
    {"max_acceleration_rad_per_s2": 150},
)
WINDUP = Guard("windup", "as shipped, but anti_windup = false", {"anti_windup": False})
GUARDS = (NONE, DEFAULT, TIGHT, WINDUP)


@dataclass(frozen=True)
class Case:
    """A plant, a motion and a controller that all faults are flown with.

    Attributes:
        name: one or two words.
        meaning: for a person.
        robot: file of the robot.
        friction: its model, by default the file's own.
        speed: factor on the robot's trajectory.
        controller: file of the specification.
        faults: names of those that are flown.
    """

    name: str
    meaning: str
    robot: str = "reference"
    friction: FrictionName | None = None
    speed: float = 1.0
    controller: str = "puma3"
    faults: tuple[str, ...] = tuple(fault.name for fault in CATALOGUE)


_FEW = (
    "dropout 5",
    "dropout 50",
    "stuck 5",
    "jump 500",
    "missed 1",
    "missed 5",
    "saturated 1 s",
    "reset",
)
CASES = (
    Case(
        "tanh", "Coulomb friction, smoothed by tanh; the paper's speed", friction="coulomb-stribeck"
    ),
    Case("LuGre", "LuGre friction; the paper's speed"),
    Case("tanh x2", "as tanh, twice as fast", friction="coulomb-stribeck", speed=2.0),
    Case("LuGre x2", "as LuGre, twice as fast", speed=2.0),
    Case(
        "flexible x2",
        "flexible joints, twice as fast",
        robot="reference_flexible",
        speed=2.0,
        faults=_FEW,
    ),
    Case(
        "fixed-point x2",
        "as LuGre x2, in fixed-point",
        speed=2.0,
        controller="puma3_fixed",
        faults=_FEW,
    ),
)


@dataclass(frozen=True)
class Attempt:
    """One of the runs of which the worst counts.

    Attributes:
        moment: of the fault.
        phase: of the encoders, in counts.
    """

    moment: Moment
    phase: float


SEGMENTS_AND_PHASES = ((0, 0.0), (0, 0.5), (1, 0.25), (1, 0.75))
"""Faults begin in the middle of a segment, where the reference is fastest; the first goes up, the
second down."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A case, ready to fly.

    Attributes:
        case: which.
        plant: of it.
        trajectory: of it.
        loop: the compiled plant and controller.
        attempts: in each of which every fault is flown.
    """

    case: Case
    plant: Plant
    trajectory: RestToRest
    loop: CompiledLoop
    attempts: tuple[Attempt, ...]


@cache
def ground(case: Case) -> Ground:
    """Builds and compiles a case.

    Raises:
        PlantError, RobotError, CompilerError, SpecificationError: it can't be made.
    """
    robot = load_robot(case.robot, friction=case.friction)
    if robot.trajectory is None:
        raise PlantError(f"robot {robot.name} has no [trajectory]: add one to its file")
    plant, trajectory = build_plant(robot), robot.trajectory.faster(case.speed)
    attempts = tuple(
        Attempt(_fastest(trajectory, segment), phase) for segment, phase in SEGMENTS_AND_PHASES
    )
    reference = trajectory.sampled(TICK_S)
    # All rigid bodies that any fault makes, for one library.
    models = [
        model
        for fault in CATALOGUE
        for model in events_of(fault.events(attempts[0].moment))(plant, reference).models
    ]
    loop = CompiledLoop(plant, specification(case.controller, DEFAULT), models=models)
    return Ground(case, plant, trajectory, loop, attempts)


def _fastest(trajectory: RestToRest, segment: int) -> Moment:
    """The middle of a segment."""
    at_s = float(np.sum(trajectory.segment_s[:segment]) + trajectory.segment_s[segment] / 2)
    stroke = np.diff(trajectory.postures_rad, axis=0)[segment]
    return Moment(round(at_s / TICK_S), float(np.sign(stroke[0])))


def events_of(events: Sequence[Event]) -> Events:
    """Events as a run takes them."""
    return Scenario(events=list(events)).script


@cache
def specification(name: str, guard: Guard, inertia: float = 1.0) -> Controller:
    """A shipped specification with a guard, and another Mbar.

    The numbers of fixed-point have no room for other speeds than the specification's own.
    """
    data = read(CONTROLLERS / f"{name}.toml")
    kept = {"max_speed_rad_per_s"} if data.get("arithmetic") == "fixed-point" else set()
    other = {key: value for key, value in guard.safety.items() if key not in kept}
    guarded = resolve({**data, "safety": {**data["safety"], **other}})
    factor = Fraction(inertia).limit_denominator(1000)
    joints = tuple(replace(j, inertia=factor * j.inertia) for j in guarded.joints)
    return replace(guarded, joints=joints)


def controller_of(ground: Ground, guard: Guard, inertia: float = 1.0) -> GeneratedController:
    """The shipped C, its running configuration set as the guard's specification says.

    Raises:
        PlantError: the C refuses the configuration.
    """
    told = specification(ground.case.controller, guard, inertia)
    controller = ground.loop.controller()
    controller.set_gains(told)
    controller.config.max_lost_ticks = told.max_lost_ticks
    controller.config.anti_windup = int(told.anti_windup)
    if controller.check_config() != Status.OK:
        raise PlantError(f"the configuration of guard {guard.name} is refused")
    return controller
