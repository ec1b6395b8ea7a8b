"""A flight of a controller: what it was given at every tick, and what its C answered.

The C flies through ctypes, as in every experiment; the FMU of the same C is held against that.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.controller import Controller
from plant.assembly import PlantError, build_plant
from plant.closed_loop import ControllerOutput, simulate
from plant.controller import GeneratedController
from plant.flight import check_encoders, default_robot
from plant.robot import Robot, load_robot
from verification.bench.recording import led

Floats = NDArray[np.float64]

AMPLITUDE_RAD = 0.3
DURATION_S = 2.0


@dataclass(frozen=True, eq=False)
class Recording:
    """A run; row k of each array belongs to tick k.

    Attributes:
        source: what was flown, for people.
        sample_time_s: L.
        holding_torque_Nm: at the start, shape (n,).
        first_counts: at the start, shape (n,).
        counts: shape (ticks, n); likewise all others but the last.
        position_rad: reference, by the counter.
        velocity_rad_per_s: reference.
        acceleration_rad_per_s2: reference.
        torque_Nm: the C's answers, in its own numbers.
        status: shape (ticks,).
    """

    source: str
    sample_time_s: float
    holding_torque_Nm: Floats
    first_counts: NDArray[np.int32]
    counts: NDArray[np.int32]
    position_rad: Floats
    velocity_rad_per_s: Floats
    acceleration_rad_per_s2: Floats
    torque_Nm: NDArray[np.floating[Any]]
    status: NDArray[np.int64]


@dataclass
class _Listener:
    """A controller that writes down what it hears and says."""

    inner: GeneratedController
    start: list[tuple[NDArray[Any], ...]] = field(default_factory=list)
    heard: list[tuple[NDArray[Any], ...]] = field(default_factory=list)
    said: list[ControllerOutput] = field(default_factory=list)

    def reset(self, counts: NDArray[np.int32], holding_torque_Nm: Floats) -> int:
        self.start.append((counts.copy(), holding_torque_Nm.copy()))
        return self.inner.reset(counts, holding_torque_Nm)

    def step(
        self,
        counts: NDArray[np.int32],
        position_rad: Floats,
        velocity_rad_per_s: Floats,
        acceleration_rad_per_s2: Floats,
    ) -> ControllerOutput:
        given = (counts, position_rad, velocity_rad_per_s, acceleration_rad_per_s2)
        self.heard.append(tuple(each.copy() for each in given))
        self.said.append(self.inner.step(*given))
        return self.said[-1]

    def recording(self, source: str) -> Recording:
        counts, position, velocity, acceleration = map(np.array, zip(*self.heard, strict=True))
        first, holding = self.start[-1]
        return Recording(
            source,
            float(self.inner.specification.sample_time),
            holding,
            first,
            counts,
            position,
            velocity,
            acceleration,
            np.array([output.torque_Nm for output in self.said]),
            np.array([output.status for output in self.said]),
        )


def record(controller: Controller, speed: float = 1.0, library: Path | None = None) -> Recording:
    """Flies the controller on the default robot for its joints, along that robot's trajectory.

    A controller that no such robot fits is led to and fro by encoders that show its own reference.

    Args:
        controller: the specification.
        speed: how many times as fast the trajectory is run.
        library: its compiled C; generated and compiled if not given.

    Raises:
        plant.native.CompilerError: the C can't be compiled.
        plant.closed_loop.ControllerError: the controller ended the run.
    """
    listener = _Listener(GeneratedController(controller, library))
    robot = _robot(controller)
    if robot is None or robot.trajectory is None:
        return _led(controller, listener)
    sample_time = float(controller.sample_time)
    trajectory = robot.trajectory.faster(speed)
    run = simulate(build_plant(robot), listener, trajectory, sample_time, progress=False)
    seconds = len(run.time_s) * sample_time
    return listener.recording(f"{seconds:g} s in closed loop with the robot {robot.name}")


def _robot(controller: Controller) -> Robot | None:
    try:
        robot = load_robot(default_robot(controller))
        check_encoders(controller, robot)
    except PlantError:
        return None
    return robot


def _led(controller: Controller, listener: _Listener) -> Recording:
    reference, counts = led(controller, AMPLITUDE_RAD, DURATION_S)
    listener.reset(counts[0], np.zeros(len(controller.joints)))
    for row in zip(
        counts,
        reference.position_rad,
        reference.velocity_rad_per_s,
        reference.acceleration_rad_per_s2,
        strict=True,
    ):
        listener.step(*row)
    return listener.recording(f"{DURATION_S:g} s along its own reference, without a robot")
