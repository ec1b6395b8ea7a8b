"""How fast the backends are: simulated seconds in a second, both measured side by side."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any

from codegen.controller import load
from codegen.emit import REPOSITORY
from plant.closed_loop import PlantError, beginning, build_plant, simulate
from plant.compiled.loop import CompiledLoop
from plant.controller import GeneratedController
from plant.flight import DEFAULT_ROBOTS
from plant.robot import load_robot

CONTROLLERS = ("puma3", "puma6")
"""Specifications of three and of six joints, each flown on the default robot."""

_RUNS_PER_THREAD = 8


@dataclass(frozen=True)
class Pace:
    """The pace of one loop: plant, generated C and their record, without compiling.

    Attributes:
        controller: the specification's name.
        robot: the robot's name.
        joints: number of joints.
        substep_s: longest step of the integrator [s].
        simulated_s: duration of one run [s].
        pinocchio_s: wall time of a run in Python, the median [s].
        compiled_s: wall time of a run in C, the median [s].
        threads: that flew together in C.
        together_s: wall time of a run while they did, all runs' time over their number [s].
    """

    controller: str
    robot: str
    joints: int
    substep_s: float
    simulated_s: float
    pinocchio_s: float
    compiled_s: float
    threads: int
    together_s: float

    def figures(self) -> dict[str, Any]:
        """Plain data: the attributes, times real time, and times the backend in Python."""
        return asdict(self) | {
            "pinocchio_times_real_time": self.simulated_s / self.pinocchio_s,
            "compiled_times_real_time": self.simulated_s / self.compiled_s,
            "together_times_real_time": self.simulated_s / self.together_s,
            "compiled_times_pinocchio": self.pinocchio_s / self.compiled_s,
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
    pinocchio, compiled = [], []
    for _ in range(rounds):
        pinocchio.append(
            _timed(lambda: simulate(plant, controller, motion, tick, substep_s, progress=False))
        )
        compiled.append(_timed(lambda: loop.run(plant, controller, begin, tick, substep_s)))
    threads = os.cpu_count() or 1
    return Pace(
        controller=specification.name,
        robot=robot.name,
        joints=plant.joints,
        substep_s=substep_s,
        simulated_s=len(begin.reference.time_s) * tick,
        pinocchio_s=_median(pinocchio),
        compiled_s=_median(compiled),
        threads=threads,
        together_s=_together(
            lambda: loop.run(
                plant, GeneratedController(specification, loop.path), begin, tick, substep_s
            ),
            threads,
        ),
    )


def _timed(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def _median(times: list[float]) -> float:
    return sorted(times)[len(times) // 2]


def _together(call: Callable[[], object], threads: int) -> float:
    """Wall time of one call where several threads call at once."""
    runs = _RUNS_PER_THREAD * threads
    with ThreadPoolExecutor(threads) as pool:
        start = time.perf_counter()
        for future in [pool.submit(call) for _ in range(runs)]:
            future.result()
        return (time.perf_counter() - start) / runs
