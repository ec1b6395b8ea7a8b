"""What a controller costs, what limits it, and how its error settles: its package's figures.

The cost comes from the bench that makes ``docs/what-a-tick-costs.md``, run on this controller's own
C; settling times and stable intervals from the tuning check.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from dataclasses import dataclass

from codegen.controller import Controller, Joint
from plant.controller import structures
from verification.bench.recording import LED, RECORDED, recording_for
from verification.bench.rows import Result, measure_controller
from verification.tuning_check.check import TuningCheck, of_specification
from verification.tuning_check.present import headline, settling, settling_to_a_count, stable_in

_MOTIONS = {
    RECORDED: "a recorded motion",
    LED: "a motion in which the encoders show the reference itself",
}


@dataclass(frozen=True)
class JointFigures:
    """A joint's limits, and how its error ends.

    Attributes:
        name: of the joint.
        torque_limit_Nm: what a torque is cut to.
        speed_rad_per_s: beyond it, a motion is an encoder jump.
        acceleration_rad_per_s2: likewise.
        zero_after: from 1 rad at rest, enclosed.
        a_count_after: below a count of the encoder for good, enclosed.
        stable_in: for which Mbar/M the linear law is stable.
    """

    name: str
    torque_limit_Nm: float
    speed_rad_per_s: float
    acceleration_rad_per_s2: float
    zero_after: str
    a_count_after: str
    stable_in: str


@dataclass(frozen=True)
class Figures:
    """All figures of a package.

    Attributes:
        cost: from the bench, on the cores that the controller's numbers are for.
        motion: what the bench replayed.
        verdict: on the gains, in one line.
        proved: whether the stable intervals are.
        joints: limits and settling.
        state_bytes: of the controller's memory.
        config_bytes: of a configuration.
    """

    cost: Result
    motion: str
    verdict: str
    proved: bool
    joints: tuple[JointFigures, ...]
    state_bytes: int
    config_bytes: int


def figures(controller: Controller, boards: Iterable[str] | None = None) -> Figures:
    """Measures and encloses them.

    Args:
        controller: the specification.
        boards: emulated boards to measure on; all of them by default.

    Raises:
        verification.firmware.ToolError: a compiler or an emulator is missing.
        verification.bench.rows.BenchError: what was measured can't be right.
    """
    checked = of_specification(controller)
    made = structures(controller)
    return Figures(
        measure_controller(controller, boards),
        _MOTIONS[recording_for(controller).name],
        headline(checked),
        all(joint.specified.sampled.proved for joint in checked.joints),
        tuple(_joint(controller, joint, checked, i) for i, joint in enumerate(controller.joints)),
        ctypes.sizeof(made.state),
        ctypes.sizeof(made.config),
    )


def _joint(controller: Controller, joint: Joint, checked: TuningCheck, i: int) -> JointFigures:
    found = checked.joints[i]
    tick, count = float(controller.sample_time), abs(joint.rad_per_count)
    return JointFigures(
        joint.name,
        float(joint.torque_limit),
        joint.max_displacement * count / tick,
        controller.max_displacement_change(joint) * count / tick**2,
        settling(found),
        settling_to_a_count(found),
        stable_in(found.specified.sampled.intervals),
    )
