"""How fast the backends are: simulated seconds in a second, both measured side by side."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import numpy as np

from codegen.controller import load
from codegen.emit import REPOSITORY
from plant.assembly import PlantError, build_plant
from plant.closed_loop import beginning, simulate
from plant.compiled.loop import CompiledLoop
from plant.controller import GeneratedController
from plant.flight import DEFAULT_ROBOTS
from plant.robot import Robot, load_robot

CONTROLLERS = ("puma3", "puma6")
"""Specifications of three and of six joints, each flown on the default robot."""

_RUNS_PER_THREAD = 8


@dataclass(frozen=True)
class Cost:
    """What a run takes, a median over some runs.

    Attributes:
        wall_s: by the clock [s].
        cpu_s: of this process [s]; what else the machine does counts less here.
    """

    wall_s: float
    cpu_s: float


@dataclass(frozen=True)
class Pace:
    """The pace of one loop: plant, generated C and their record, without compiling.

    Attributes:
        controller: the specification's name.
        robot: the robot's name.
        joints: number of joints.
        substep_s: longest step of the integrator [s].
        simulated_s: duration of one run [s].
        pinocchio: a run in Python.
        compiled: a run in C.
        mujoco: MuJoCo's bare stepping of the same arm at the same step and as long: no controller,
            no encoder, Coulomb friction only; None where MuJoCo isn't installed.
        threads: that flew together in C.
        together: a run while they did, all runs' time over their number.
    """

    controller: str
    robot: str
    joints: int
    substep_s: float
    simulated_s: float
    pinocchio: Cost
    compiled: Cost
    mujoco: Cost | None
    threads: int
    together: Cost

    def figures(self) -> dict[str, Any]:
        """Plain data: the attributes, and how they compare."""
        bare = self.mujoco
        return asdict(self) | {
            "compiled_times_mujoco": bare.wall_s / self.compiled.wall_s if bare else None,
            "pinocchio_times_real_time": self.simulated_s / self.pinocchio.wall_s,
            "compiled_times_real_time": self.simulated_s / self.compiled.wall_s,
            "together_times_real_time": self.simulated_s / self.together.wall_s,
            "compiled_times_pinocchio": self.pinocchio.wall_s / self.compiled.wall_s,
            "compiled_times_pinocchio_cpu": self.pinocchio.cpu_s / self.compiled.cpu_s,
        }


def measure(name: str, substep_s: float = 1e-4, rounds: int = 5) -> Pace:
    """Measures both backends in turns, so that whatever else runs slows both.

    Args:
        name: one of the repository's specifications.
        substep_s: longest step of the integrator.
        rounds: how often each of them is measured.

    Raises:
        PlantError, CompilerError: see :func:`plant.flight.fly`.
    """
    specification = load(REPOSITORY / "controllers" / f"{name}.toml")
    robot = load_robot(DEFAULT_ROBOTS[len(specification.joints)])
    plant, tick = build_plant(robot), float(specification.sample_time)
    if robot.trajectory is None:
        raise PlantError(f"robot {robot.name} has no [trajectory]: add one to its file")
    motion, controller = robot.trajectory, GeneratedController(specification)
    loop, begin = CompiledLoop(plant, specification), beginning(plant, motion, tick)
    ticks = len(begin.reference.time_s)
    stepping = _mujoco_stepping(robot, substep_s, round(ticks * tick / substep_s))
    pinocchio, compiled, bare = [], [], []
    for _ in range(rounds):
        if stepping is not None:
            bare.append(_cost(stepping))
        pinocchio.append(
            _cost(lambda: simulate(plant, controller, motion, tick, substep_s, progress=False))
        )
        compiled.append(_cost(lambda: loop.run(plant, controller, begin, tick, substep_s)))
    threads = os.cpu_count() or 1
    return Pace(
        controller=specification.name,
        robot=robot.name,
        joints=plant.joints,
        substep_s=substep_s,
        simulated_s=ticks * tick,
        pinocchio=_median(pinocchio),
        compiled=_median(compiled),
        mujoco=_median(bare) if bare else None,
        threads=threads,
        together=_together(
            lambda: loop.run(plant, loop.controller(), begin, tick, substep_s), threads
        ),
    )


def _mujoco_stepping(robot: Robot, step_s: float, steps: int) -> Callable[[], object] | None:
    """MuJoCo's own rollout of the arm from its start posture; None without MuJoCo.

    Its model of friction is Coulomb's alone (frictionloss), at the level of the robot's file.
    """
    try:
        from mujoco import MjData, mj_getState, mj_stateSize, mjtState, rollout

        from plant.mujoco_arm import mujoco_model
    except ImportError:
        return None
    assert robot.trajectory is not None
    assert robot.friction is not None
    level = np.array([joint.curve.coulomb_positive_Nm for joint in robot.friction.parameters])
    model = mujoco_model(robot, step_s, level)
    data = MjData(model)
    data.qpos[:] = robot.trajectory.start_rad
    state = np.empty(mj_stateSize(model, mjtState.mjSTATE_FULLPHYSICS))
    mj_getState(model, data, state, mjtState.mjSTATE_FULLPHYSICS)
    return lambda: rollout.rollout(model, [data], initial_state=state, nstep=steps)


def _cost(call: Callable[[], object], runs: int = 1) -> Cost:
    """The cost of one of so many runs, which the call does."""
    wall, cpu = time.perf_counter(), time.process_time()
    call()
    return Cost((time.perf_counter() - wall) / runs, (time.process_time() - cpu) / runs)


def _median(costs: Sequence[Cost]) -> Cost:
    return Cost(median(cost.wall_s for cost in costs), median(cost.cpu_s for cost in costs))


def _together(call: Callable[[], object], threads: int) -> Cost:
    """The cost of one call where several threads call at once."""
    runs = _RUNS_PER_THREAD * threads

    def all_of_them() -> None:
        with ThreadPoolExecutor(threads) as pool:
            for future in [pool.submit(call) for _ in range(runs)]:
                future.result()

    return _cost(all_of_them, runs)
