"""A flight of the paper's robot for the page: what ``loop_run`` is given, but for the gains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from codegen.controller import Controller, load
from plant.assembly import Plant, build_plant
from plant.closed_loop import ENDED_BY, Beginning, Run, beginning
from plant.compiled import loop
from plant.controller import GeneratedController
from plant.flight import check_encoders
from plant.native import GENERATED
from plant.robot import load_robot
from verification.experiments import CONTROLLERS
from verification.figures import flow
from verification.playground.memory import array, structures, text
from verification.playground.vectors import shipped
from verification.playground.wasm import host_libm, module

CONTROLLER, ROBOT = "puma3", "reference"


@dataclass(frozen=True, eq=False)
class Flight:
    """The paper's robot with the shipped controller, ready to fly."""

    specification: Controller
    plant: Plant
    controller: GeneratedController
    begin: Beginning

    @property
    def sample_time_s(self) -> float:
        """L."""
        return float(self.specification.sample_time)


def flight() -> Flight:
    """The flight that the page flies: the twelve seconds of Fig. 4 on the reference plant."""
    specification = load(CONTROLLERS / f"{CONTROLLER}.toml")
    robot = load_robot(ROBOT)
    check_encoders(specification, robot)
    assert robot.trajectory is not None
    plant = build_plant(robot)
    begin = beginning(plant, robot.trajectory, float(specification.sample_time))
    return Flight(specification, plant, shipped(specification), begin)


def flown(of: Flight, tuned: Controller) -> Run:
    """The flight with other gains on the host, with the sines and exponentials of the page.

    Raises:
        ControllerError, PlantError: it does not come to its end.
    """
    sources = GENERATED / of.specification.name
    twin = loop.CompiledLoop(of.plant, of.specification, sources, libm=host_libm())
    controller = twin.controller()
    controller.set_gains(tuned)
    return twin.run(of.plant, controller, of.begin, of.sample_time_s)


def wasm(of: Flight) -> bytes:
    """Plant, controller and phase plane as one module."""
    powers = {name: (flow.FOLDER / name).read_bytes() for name in ("flow.c", "flow.h")}
    files = loop.loop_files(
        loop.structure_of(of.plant), of.specification, GENERATED / of.specification.name
    )
    prefix = f"tdc_{of.specification.name}"
    exports = [f"{prefix}_{name}" for name in ("init", "step", "check_config", "default_config")]
    return module("playground", files | powers, ["loop_run", "flow_run", *exports])


def layouts(of: Flight) -> dict[str, Any]:
    """The structures of that module."""
    types = of.controller.types
    return structures(
        types.config,
        types.state,
        types.input,
        loop.LoopTiming,
        loop.LoopPlant,
        loop.LoopScript,
        loop.LoopState,
        loop.LoopRecord,
        loop.LoopController,
        flow.Gains,
    )


def arguments(of: Flight) -> dict[str, Any]:
    """What ``loop_run`` is given, by the names of its structures' fields.

    All ticks of the script are alike, so that one stands for all. The controller's inputs are
    whole structures without the counts, and the record is room for one tick.
    """
    plant, begin, controller = of.plant, of.begin, of.controller
    coordinates = loop.structure_of(plant).coordinates
    script = loop.script_arrays(plant, begin.script)
    numbers = script.pop("numbers")
    assert all((rows == rows[0]).all() for rows in script.values())
    (timing,) = begin.script.timings
    parts = [
        loop.part_of_tick(plant, share, of.sample_time_s, plant.substep_s)
        for share in timing.shares
    ]
    inputs = controller.inputs(
        begin.reference.position_rad + begin.script.encoder.zero_rad,
        begin.reference.velocity_rad_per_s,
        begin.reference.acceleration_rad_per_s2,
    )
    record = loop.record_arrays(begin.reference.rows(0, 1), controller, coordinates)
    held = controller.holding_torque(begin.state.command_Nm)
    return {
        "ticks": len(inputs),
        "sample_time_s": of.sample_time_s,
        "plant": {"joints": plant.joints, "coordinates": coordinates, "read_from": 0}
        | _arrays(loop.encoder_arrays(begin.script.encoder, plant.joints)),
        "timing": {
            name: {"share": part.share, "count": part.count, "step_s": part.step_s}
            | _arrays(dict(zip(("decay", "mean", "mean_of_all"), part.lag, strict=False)))
            for name, part in zip(("late", "delayed", "prompt"), parts, strict=True)
        },
        "script": _arrays({name: rows[0] for name, rows in script.items()}),
        "numbers": array(numbers[0]),
        "state": _arrays(loop.state_arrays(plant, begin.state)),
        "holding_torque": array(np.ctypeslib.as_array(held)),
        "inputs": text(inputs.tobytes()),
        "ends": array(np.array(sorted(ENDED_BY), dtype=np.int64)),
        "record": _arrays(record),
    }


def _arrays(named: dict[str, Any]) -> dict[str, Any]:
    return {name: array(values) for name, values in named.items()}
