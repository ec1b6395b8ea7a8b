"""Where gains are tried: the generated C on a plant, one closed loop a trial."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from codegen.controller import Controller, load
from plant.assembly import Floats, Plant, PlantError, build_plant
from plant.campaign.plants import draw, encoder_phase, with_draw, with_phase
from plant.campaign.specification import PlantsTable
from plant.closed_loop import ControllerError, beginning
from plant.compiled.loop import CompiledLoop
from plant.flight import check_encoders, default_robot
from plant.robot import load_robot
from plant.trajectory import RestToRest
from plant.tuning.gains import Gains, TuningError
from plant.tuning.vibration import vibration

SATURATED_SHARE = 0.01
"""Of the ticks: beyond it a drive's limit, not the law, makes the torque."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a trial showed; infinite where the run did not get to its end.

    Attributes:
        rms_deg: of the error by the encoders, shape (n,).
        vibration: see :mod:`plant.tuning.vibration`, shape (n,).
        saturated: share of the ticks at the torque limit, shape (n,).
        failure: why the run ended early, or None.
    """

    rms_deg: Floats
    vibration: Floats
    saturated: Floats
    failure: str | None = None

    def plain(self) -> dict[str, Any]:
        """As plain data; None for what is not finite."""
        columns = {key: getattr(self, key) for key in ("rms_deg", "vibration", "saturated")}
        return {
            key: [x if np.isfinite(x) else None for x in column.tolist()]
            for key, column in columns.items()
        } | {"failure": self.failure}


Evaluate = Callable[[Gains], Outcome]
"""A trial of some gains."""


class Rig:
    """A controller's C on a plant, tried with any gains. Its methods change nothing.

    Args:
        controller: the specification; its C is flown, its gains are set at run time.
        plant: the nominal plant.
        motion: that each trial follows.

    Attributes:
        controller: as given.
        plant: as given.

    Raises:
        PlantError: the plant doesn't fit the controller, or the compiled backend.
        CompilerError: the C can't be compiled.
    """

    def __init__(self, controller: Controller, plant: Plant, motion: RestToRest) -> None:
        self.controller, self.plant = controller, plant
        self._motion = motion
        self._tick_s = float(controller.sample_time)
        self._loop = CompiledLoop(plant, controller)
        ratio = controller.low_pass_ratio
        self._low_pass = 1.0 if ratio is None else float(ratio)

    def fly(self, gains: Gains, plant: Plant | None = None) -> Outcome:
        """One closed loop over the whole motion.

        Args:
            gains: to try.
            plant: the nominal one by default, or another of its structure.
        """
        body = self.plant if plant is None else plant
        controller = self._loop.controller()
        controller.set_gains(gains.of(self.controller))
        begin = beginning(body, self._motion, self._tick_s)
        try:
            run = self._loop.run(body, controller, begin, self._tick_s)
        except (ControllerError, PlantError) as error:
            infinite = np.full(body.joints, np.inf)
            return Outcome(infinite, infinite, np.ones(body.joints), str(error))
        torque = np.asarray(run.torque_commanded_Nm, dtype=np.float64)
        inertia = self._low_pass * np.array([float(x) for x in gains.inertia])
        limit = np.array([float(joint.torque_limit) for joint in self.controller.joints])
        return Outcome(
            rms_deg=run.rms_error_deg(),
            vibration=vibration(torque, inertia, body.encoder.resolution_rad, self._tick_s),
            saturated=np.mean(np.abs(torque) >= 0.999 * limit, axis=0),
        )

    def relatives(self, seed: int, count: int) -> list[Plant]:
        """Random plants of the nominal one's structure, see :data:`RELATIVES`.

        Args:
            seed: other plants for another.
            count: how many.
        """
        table = RELATIVES.model_copy(update={"root_seed": seed, "count": count})
        joints = self.plant.joints
        # The names are for a campaign: the friction model here is the plant's own.
        draws = [draw(table, ("lugre",), joints, index) for index in range(count)]
        return [
            with_phase(with_draw(self.plant, drawn), encoder_phase(table, joints, index, 0))
            for index, drawn in enumerate(draws)
        ]


RELATIVES = PlantsTable.model_validate(
    {
        "count": 1,
        "friction_factor": [0.5, 1.5],
        "inertia_factor": [0.7, 1.15],
        "torque_delay": [0.0, 0.5],
        "encoder_phase": [0.0, 1.0],
    }
)
"""What a robot may differ in from its model: each joint's friction, each link's mass and inertia,
the drives' delay as a fraction of the sample time, and where the encoders stand. Chosen, up to
where the reference plant's shoulder drive carries the arm."""


def open_rig(path: Path, robot: str | None = None, speed: float = 1.0) -> Rig:
    """The rig of a specification and a robot, along the robot's own trajectory.

    Args:
        path: the specification.
        robot: its name or file; by the number of joints if not given.
        speed: how many times as fast the trajectory is run.

    Raises:
        SpecificationError: the specification can't be used.
        RobotError, PlantError: the robot can't be used, or doesn't fit the specification.
        CompilerError: the C can't be compiled.
        TuningError: the robot has no encoder, or the C is fixed-point.
    """
    controller = load(path)
    if controller.arithmetic.kind == "fixed-point":
        raise TuningError(
            f"{path}: fixed-point C has the number formats of its own gains and no room for all "
            "that are tried: tune it with floating-point arithmetic, and write the gains into it"
        )
    body = load_robot(robot if robot is not None else default_robot(controller))
    if body.trajectory is None:
        raise PlantError(f"robot {body.name} has no [trajectory]: add one to its file")
    if body.encoder is None:
        raise TuningError(f"robot {body.name} has no [encoder]: add one to its file")
    check_encoders(controller, body)
    return Rig(controller, build_plant(body), body.trajectory.faster(speed))
