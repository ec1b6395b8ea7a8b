"""Recorded ticks of a controller, and what the host's C answered: the page repeats them.

Each controller flies its robot's own trajectory, faster than it was made for, so that torques reach
their limits; what its C was told at each tick is recorded, and what the host's shared library says
to it, in the C's own bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.arithmetic import Arithmetic
from codegen.controller import Controller
from plant.assembly import at_rest, build_plant
from plant.closed_loop import simulate
from plant.controller import GeneratedController
from plant.flight import default_robot
from plant.native import GENERATED, c_files, shared_library
from plant.robot import load_robot
from verification.playground.memory import array, structures, text
from verification.playground.wasm import module

SPEED = 10.0
"""Times the trajectory's own; the fastest joint stays below the largest plausible speed."""


@dataclass(frozen=True, eq=False)
class Recording:
    """What a controller was told from its switching on, and what the host answered.

    Attributes:
        controller: of the host, with the configuration that it had.
        counts: of the switching on, shape (n,).
        holding_torque: of the switching on, in the C's numbers, shape (n,).
        inputs: the C's structures, shape (ticks,).
        torque: in the C's numbers, shape (ticks, n).
        status: shape (ticks,).
    """

    controller: GeneratedController
    counts: NDArray[np.int32]
    holding_torque: NDArray[Any]
    inputs: NDArray[Any]
    torque: NDArray[Any]
    status: NDArray[np.int64]


def record(specification: Controller, tuned: Controller, speed: float = SPEED) -> Recording:
    """Flies a controller and repeats what it was told on the host's own shared library.

    Args:
        specification: of the C.
        tuned: the gains to set.
        speed: factor on the robot's trajectory.
    """
    robot = load_robot(default_robot(specification))
    assert robot.trajectory is not None
    plant = build_plant(robot)
    trajectory = robot.trajectory.faster(speed)
    host = shipped(specification)
    host.set_gains(tuned)
    run = simulate(plant, host, trajectory, float(specification.sample_time), progress=False)
    inputs = host.inputs(run.q_ref, run.qd_ref, run.qdd_ref)
    inputs["counts"] = run.counts
    return repeated(host, run.counts[0], at_rest(plant, trajectory.start_rad).command_Nm, inputs)


def repeated(
    host: GeneratedController,
    counts: NDArray[np.int32],
    holding_Nm: NDArray[np.float64],
    inputs: NDArray[Any],
) -> Recording:
    """What the host's C answers to inputs, from its switching on."""
    answers = []
    status = host.reset(counts, holding_Nm)
    assert status == 0, status
    for given in inputs:
        told = host.step_raw(given.tobytes())
        answers.append((host.torque, told))
    return Recording(
        host,
        counts,
        np.ctypeslib.as_array(host.holding_torque(holding_Nm)),
        inputs,
        np.array([torque for torque, _ in answers]),
        np.array([told for _, told in answers], dtype=np.int64),
    )


def shipped(specification: Controller) -> GeneratedController:
    """The host's compiled C of ``generated/NAME/``, as it was committed."""
    return GeneratedController(specification, shared_library(GENERATED / specification.name))


def wasm(specification: Controller) -> bytes:
    """A controller's C alone."""
    prefix = f"tdc_{specification.name}"
    exports = [f"{prefix}_{name}" for name in ("init", "step", "default_config")]
    return module(specification.name, c_files(GENERATED / specification.name), exports)


def for_page(recording: Recording) -> dict[str, Any]:
    """A recording with the controller's WebAssembly, for the page."""
    host = recording.controller
    types, specification = host.types, host.specification
    return {
        "name": specification.name,
        "says": numbers_of(specification.arithmetic),
        "joints": host.joints,
        "wasm": text(wasm(specification)),
        "structures": structures(types.config, types.state, types.input),
        "config": text(bytes(host.config)),
        "counts": text(recording.counts.tobytes()),
        "holding_torque": text(recording.holding_torque.tobytes()),
        "inputs": text(recording.inputs.tobytes()),
        "torque_type": array(recording.torque)["type"],
        "torque": text(recording.torque.tobytes()),
        "status": recording.status.tolist(),
    }


def numbers_of(arithmetic: Arithmetic) -> str:
    """What a controller computes in, in words."""
    if arithmetic.kind == "fixed-point":
        return "integers (fixed-point)"
    precise = ", precise powers" if arithmetic.accuracy == "precise" else ""
    return f"{arithmetic.precision}{precise}"
