"""All that is known of a gain set, as one record."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from codegen.controller import Controller
from plant.assembly import build_plant
from plant.flight import check_encoders
from plant.robot import Robot
from verification.error_bound import ErrorBound, error_bound
from verification.error_dynamics.analysis import RESOLUTION_RAD
from verification.tuning_check.flight import Course, Flight, JointFlown
from verification.tuning_check.joint import Specified, Timing, specified
from verification.tuning_check.remedy import Remedy, remedy
from verification.tuning_check.robot import Eigenvalues, eigenvalues
from verification.tuning_check.verdict import (
    Finding,
    Severity,
    findings,
    of_flight,
    sentence,
    worst,
)

_DIGITS = 4
"""Of a measured TDE error, rounded up."""

Report = Callable[[str], object]
"""Is told what is being done."""


@dataclass(frozen=True)
class JointCheck:
    """All that is known of a joint's gains.

    Attributes:
        specified: what its specification alone says.
        flown: what a run showed; None without one.
        bound: of |e| and |s| for the run's TDE error; None where that is not known.
        findings: what speaks against the gains, the worst first.
    """

    specified: Specified
    flown: JointFlown | None
    bound: ErrorBound | None
    findings: tuple[Finding, ...]

    @property
    def name(self) -> str:
        """Of the joint."""
        return self.specified.joint.name

    @property
    def severity(self) -> Severity:
        """Of the worst finding."""
        return worst(self.findings)

    @property
    def verdict(self) -> str:
        """In plain words, with the reasons of the worst kind."""
        what = dict.fromkeys(f.what for f in self.findings if f.severity is self.severity)
        return sentence(self.severity, tuple(what))


@dataclass(frozen=True, eq=False)
class TuningCheck:
    """All that is known of a gain set.

    Attributes:
        controller: with the gains.
        timing: how late torques act.
        joints: one record each.
        plant: its name; None where the specification alone was looked at.
        flexible: whether the plant's joints are, so that the intervals of rigid ones judge nothing.
        eigenvalues: of M^-1 Mbar; None where they are not known.
        flight: a run; None where there is none.
        remedy: what was found to cure what the run showed; None where nothing was looked for.
        gaps: what could not be said, or is said of less than everything, and why.
    """

    controller: Controller
    timing: Timing
    joints: tuple[JointCheck, ...]
    plant: str | None = None
    flexible: bool = False
    eigenvalues: Eigenvalues | None = None
    flight: Flight | None = None
    remedy: Remedy | None = None
    gaps: tuple[str, ...] = ()

    @property
    def severity(self) -> Severity:
        """Of the worst joint."""
        return max(joint.severity for joint in self.joints)

    @property
    def same_gains(self) -> bool:
        """Whether all joints have the same KD, KP and lambda, as the intervals need."""
        return len({j.specified.sampled.loop for j in self.joints}) == 1


def of_specification(
    controller: Controller, *, compute_delay: int = 0, own_resolution: bool = True
) -> TuningCheck:
    """As far as the specification alone allows: quick, and exact.

    Args:
        controller: the specification.
        compute_delay: whole samples from reading the encoders to commanding the torques, 0 or 1.
        own_resolution: whether settling times are told to each joint's own encoder's resolution;
            else to that of the paper's, which is quicker for joints of equal gains.
    """
    timing = Timing(compute_delay)
    resolution = None if own_resolution else RESOLUTION_RAD
    joints = specified(controller, timing, resolution_rad=resolution)
    return TuningCheck(
        controller,
        timing,
        tuple(JointCheck(j, None, None, findings(j, None, None, flexible=False)) for j in joints),
        gaps=(
            "no plant: neither the inertias that Mbar must suit, nor vibration, nor the TDE error",
        ),
    )


def on_plant(
    controller: Controller,
    robot: Robot,
    *,
    compute_delay: int = 0,
    report: Report = lambda _: None,
) -> TuningCheck:
    """All of it, with a run on a plant.

    Args:
        controller: the specification.
        robot: the plant.
        compute_delay: whole samples from reading the encoders to commanding the torques, 0 or 1.
        report: is told what is being done.

    Raises:
        PlantError: controller and robot don't fit, or the robot can't be held or delayed like that.
        CompilerError: the C can't be compiled.
    """
    if robot.encoder is not None or robot.joints != len(controller.joints):
        check_encoders(controller, robot)
    delay = Fraction(0) if robot.drive is None else Fraction(repr(robot.drive.delay))
    timing = Timing(compute_delay, delay)
    report("error dynamics and intervals")
    joints = specified(controller, timing)
    report("eigenvalues of M^-1 Mbar over the workspace")
    found = eigenvalues(robot, joints)
    inside = found if isinstance(found, Eigenvalues) else None
    flexible = robot.flexibility is not None
    report("flying")
    course = _course(controller, robot, compute_delay)
    flight = course.fly(controller) if isinstance(course, Course) else None
    checked = TuningCheck(
        controller,
        timing,
        _joints(joints, inside, flight, flexible),
        robot.name,
        flexible,
        inside,
        flight,
        gaps=tuple(_gaps(robot, found, course, flight)),
    )
    report("looking for what to change")
    if flight is None or not isinstance(course, Course) or is_fixed_point(controller):
        return checked
    return replace(checked, remedy=remedy(controller, course, flight))


def is_fixed_point(controller: Controller) -> bool:
    """Whether the C's number formats are made for its own gains and no others."""
    return controller.arithmetic.kind == "fixed-point"


def _course(controller: Controller, robot: Robot, compute_delay: int) -> Course | str:
    """Where the gains are flown, or why they can't be."""
    missing = [
        part
        for part in ("friction", "drive", "encoder", "trajectory")
        if getattr(robot, part) is None
    ]
    if missing or robot.trajectory is None:
        return f"{robot.name} has no {', '.join(missing)}: nothing was flown"
    return Course(controller, build_plant(robot), robot.trajectory, compute_delay)


def _joints(
    joints: Sequence[Specified],
    found: Eigenvalues | None,
    flight: Flight | None,
    flexible: bool,
) -> tuple[JointCheck, ...]:
    ended = of_flight(flight) if flight else ()

    def check(index: int, joint: Specified) -> JointCheck:
        flown = flight.joints[index] if flight and flight.joints else None
        return JointCheck(
            joint,
            flown,
            _bound(joint, flown),
            ended + findings(joint, found, flown, flexible=flexible),
        )

    return tuple(check(i, joint) for i, joint in enumerate(joints))


def _bound(joint: Specified, flown: JointFlown | None) -> ErrorBound | None:
    if flown is None or not flown.tde_error or joint.dynamics is None:
        return None
    gains = joint.joint
    return error_bound(
        gains.kd,
        gains.kp,
        gains.alpha,
        gains.beta,
        gains.lambda_,
        gains.gamma,
        tde_error=rounded_up(flown.tde_error),
    )


def rounded_up(x: float) -> Fraction:
    """A short decimal not below a number > 0."""
    unit = Fraction(10) ** (math.floor(math.log10(x)) + 1 - _DIGITS)
    return unit * math.ceil(Fraction(x) / unit)


def _gaps(
    robot: Robot, found: Eigenvalues | str, course: Course | str, flight: Flight | None
) -> Sequence[str]:
    gaps = [found] if isinstance(found, str) else [found.remark] if found.remark else []
    if isinstance(course, str):
        gaps.append(course)
    if robot.flexibility is not None:
        gaps.append(
            f"{robot.name} has flexible joints and the intervals are of rigid ones: they are told, "
            "and the verdict rests on the run"
        )
    slowest = math.inf if robot.drive is None else float(np.min(robot.drive.bandwidth_Hz))
    if math.isfinite(slowest):
        gaps.append(f"the intervals leave the drives' lag out ({slowest:g} Hz)")
    if flight is not None and flight.no_tde_error:
        gaps.append(f"no bound of |e|: {flight.no_tde_error}")
    return gaps
