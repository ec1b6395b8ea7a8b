"""Closed loops for the figures: the shipped C with any gains on the compiled plant, flown once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from codegen.controller import Controller, read, resolve
from codegen.presets import LAW_PRESETS
from plant.assembly import Plant, build_plant
from plant.closed_loop import Run, beginning
from plant.compiled.loop import CompiledLoop
from plant.robot import load_robot
from plant.trajectory import RestToRest
from verification.experiments import CONTROLLERS
from verification.figures.chart import Floats
from verification.paper import REFERENCE_ROW

CONTROLLER = CONTROLLERS / "puma3.toml"


@dataclass(frozen=True)
class Flight:
    """What to fly.

    Attributes:
        row: of Table II, whose gains are set.
        changed: gains that differ from the row's, as a specification writes them.
        robot: file of the plant.
        speed: factor on the speed of the robot's trajectory.
        phase: of all encoders, as a share of a count; None for the robot's own.
    """

    row: str = REFERENCE_ROW
    changed: tuple[tuple[str, str], ...] = ()
    robot: str = "reference"
    speed: float = 1.0
    phase: float | None = None

    @property
    def tuned(self) -> Controller:
        """The specification with these gains."""
        law = {**LAW_PRESETS[self.row].fixed, **dict(self.changed)}
        return resolve({**read(CONTROLLER), "law": law}, str(CONTROLLER))


@dataclass(frozen=True, eq=False)
class Bench:
    """A robot with the shipped C linked in."""

    plant: Plant
    trajectory: RestToRest
    loop: CompiledLoop

    @property
    def sample_time_s(self) -> float:
        """L."""
        return float(self.loop.specification.sample_time)


@cache
def bench(robot: str) -> Bench:
    """The bench of a robot file; errors as of ``plant.flight.fly``."""
    body = load_robot(robot)
    assert body.trajectory is not None, "the paper's arm has one"
    plant = build_plant(body)
    return Bench(plant, body.trajectory, CompiledLoop(plant, resolve(read(CONTROLLER))))


@cache
def flown(flight: Flight) -> Run:
    """The run of a flight.

    Raises:
        SpecificationError: the gains can't be used.
        ControllerError: the controller reported an error during the run.
        CompilerError: the C can't be compiled.
    """
    on = bench(flight.robot)
    controller = on.loop.controller()
    controller.set_gains(flight.tuned)
    plant = on.plant
    if flight.phase is not None:
        phases = np.full(plant.joints, flight.phase)
        plant = replace(plant, encoder=replace(plant.encoder, phase=phases))
    begin = beginning(plant, on.trajectory.faster(flight.speed), on.sample_time_s)
    return on.loop.run(plant, controller, begin, on.sample_time_s)


def joint_names() -> tuple[str, ...]:
    """Of the paper's robot."""
    return tuple(joint.name for joint in resolve(read(CONTROLLER)).joints)


def error_deg(run: Run) -> Floats:
    """Tracking error by the encoders [deg], shape (ticks, n)."""
    return np.rad2deg(run.error_rad)


def torque_activity(run: Run) -> Floats:
    """RMS of the applied torque's change from tick to tick [N m], shape (n,)."""
    steps = np.diff(run.torque_applied_Nm, axis=0)
    activity: Floats = np.sqrt(np.mean(steps**2, axis=0))
    return activity
