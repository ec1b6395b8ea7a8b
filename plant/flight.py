"""A specification flown on a robot: the shipped C, tuned at run time, in the closed loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from codegen.controller import Controller, read, resolve
from plant.assembly import PlantError, build_plant
from plant.closed_loop import Events, Run, simulate
from plant.compiled import loop as compiled
from plant.controller import GeneratedController
from plant.propose import data_of, proposal
from plant.robot import FrictionName, Robot, RobotError, load_robot, read_robot_file
from plant.script import uneventful

DEFAULT_ROBOTS = {3: "reference", 6: "puma560"}
"""The robot for a number of joints, where none is named."""

Backend = Literal["pinocchio", "compiled"]
BACKENDS: dict[Backend, Callable[..., Run]] = {
    "pinocchio": simulate,
    "compiled": compiled.simulate,
}
"""The closed loop in Python over Pinocchio, the reference, and the same loop in C."""


@dataclass(frozen=True, eq=False)
class Flight:
    """One run of a specification on a robot.

    Attributes:
        specification: with the gains that were flown.
        experiment: the law preset whose gains replaced the specification's, or None.
        robot: what was flown.
        run: what happened.
        proposed: whether the specification is the robot's proposal, for want of its own.
    """

    specification: Controller
    experiment: str | None
    robot: Robot
    run: Run
    proposed: bool = False

    def figures(self) -> dict[str, Any]:
        """The figures of merit as plain data; lists have one entry a joint."""
        run = self.run
        torque_step = np.diff(run.torque_applied_Nm, axis=0)
        return {
            "controller": self.specification.name,
            "experiment": self.experiment,
            "robot": self.robot.name,
            "joint_names": [joint.name for joint in self.specification.joints],
            "ticks": len(run.time_s),
            "sample_time_s": run.sample_time_s,
            "rms_deg": run.rms_error_deg().tolist(),
            "rms_true_deg": run.rms_true_error_deg().tolist(),
            "peak_error_deg": np.rad2deg(np.abs(run.error_rad).max(axis=0)).tolist(),
            "peak_torque_Nm": np.abs(run.torque_applied_Nm).max(axis=0).tolist(),
            "rms_torque_step_Nm": np.sqrt(np.mean(torque_step**2, axis=0)).tolist(),
            "saturated_ticks": run.saturated_ticks,
            "lost_ticks": run.lost_ticks,
        }


def fly(
    path: Path,
    *,
    experiment: str | None = None,
    robot: str | None = None,
    urdf: Path | None = None,
    friction: FrictionName | None = None,
    speed: float = 1.0,
    substep_s: float | None = None,
    progress: bool | None = None,
    backend: Backend = "pinocchio",
    events: Events = uneventful,
) -> Flight:
    """Flies the C of a specification along the robot's own trajectory.

    The C is that of the file as it stands; an experiment only tunes its configuration, as an
    engineer would on the rig.

    Args:
        path: the specification, or a robot file: the specification is then the one that it names as
            its controller, or :func:`plant.propose.proposal`.
        experiment: a law preset such as ``Exp08`` whose gains are set, or None.
        robot: a robot file's name or path; by default the one for this number of joints.
        urdf: another URDF than that of the robot's file.
        friction: another friction model than the robot file's, with the file's parameters.
        speed: how many times as fast the trajectory is run.
        substep_s: longest step of the plant's integration [s]; the plant's own by default.
        progress: whether to show a progress bar; by default on a terminal only.
        backend: ``pinocchio``, the reference, or ``compiled``, the same loop in C.
        events: what happens beside, such as :meth:`plant.scenario.Scenario.script`.

    Raises:
        SpecificationError: the specification or the experiment can't be used.
        RobotError, PlantError: the robot can't be used, or doesn't fit the specification.
        CompilerError: the C can't be compiled.
        ControllerError: the controller reported an error during the run.
    """
    specified, body = _subjects(path, robot, urdf, friction)
    shipped, tuned = specified.controller(), specified.controller(experiment)
    plant = build_plant(body)
    if body.trajectory is None:
        raise PlantError(f"robot {body.name} has no [trajectory]: add one to its file")
    check_encoders(shipped, body)
    controller = GeneratedController(shipped)
    controller.set_gains(tuned)
    run = BACKENDS[backend](
        plant,
        controller,
        body.trajectory.faster(speed),
        float(shipped.sample_time),
        substep_s,
        progress,
        events,
    )
    return Flight(tuned, experiment, body, run, specified.proposed)


@dataclass(frozen=True)
class _Specified:
    """A specification that may be tuned to an experiment."""

    data: dict[str, Any]
    source: str
    proposed: bool = False

    def controller(self, experiment: str | None = None) -> Controller:
        return resolve(self.data, self.source, experiment=experiment)


ROBOT_KEYS = {"links", "urdf", "transmission", "based_on"}
"""What a file has that describes a robot, and no specification has."""


def _subjects(
    path: Path, robot: str | None, urdf: Path | None, friction: FrictionName | None
) -> tuple[_Specified, Robot]:
    """The specification and the robot, one of which a file may leave open."""
    data = read(path)
    if not data.keys() & ROBOT_KEYS:
        specified = _Specified(data, str(path))
        name = robot if robot is not None else default_robot(specified.controller())
        return specified, load_robot(name, friction=friction, urdf=urdf)
    if robot is not None:
        raise RobotError(f"{path} is a robot file: give a specification with --robot, or leave it")
    body = load_robot(path, friction=friction, urdf=urdf)
    own = read_robot_file(path).controller
    if own is not None:
        return _Specified(read(Path(own)), own), body
    return _Specified(data_of(proposal(body)), f"the proposal for {body.name}", True), body


def default_robot(controller: Controller) -> str:
    """The name of the robot for a controller's number of joints.

    Raises:
        PlantError: there is none.
    """
    joints = len(controller.joints)
    if joints not in DEFAULT_ROBOTS:
        raise PlantError(f"no robot is the default for {joints} joints: name one with --robot")
    return DEFAULT_ROBOTS[joints]


def check_encoders(controller: Controller, robot: Robot) -> None:
    """A controller that reads counts in another unit than the encoder's isn't worth flying.

    Raises:
        PlantError: the numbers of joints or the encoders differ, or the robot has none.
    """
    if robot.encoder is None:
        raise PlantError(f"robot {robot.name} has no [encoder]: add one to its file")
    if robot.joints != len(controller.joints):
        raise PlantError(
            f"controller {controller.name} has {len(controller.joints)} joints, "
            f"robot {robot.name} has {robot.joints}: name another with --robot"
        )
    for joint, of_robot in zip(controller.joints, robot.encoder.counts_per_rad, strict=True):
        of_controller = 1.0 / joint.rad_per_count
        if abs(of_controller - of_robot) > 1e-9 * abs(of_robot):
            raise PlantError(
                f"joint {joint.name}: the controller takes {of_controller:.6g} counts for a "
                f"radian, robot {robot.name} gives {of_robot:.6g}: check counts_per_rev (4 x "
                "pulses) and gear_ratio"
            )
