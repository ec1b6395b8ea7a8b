"""All that is known of a gain set, as one record."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from codegen.controller import Controller
from plant.assembly import build_plant
from plant.flight import check_encoders
from plant.robot import Robot
from verification.error_bound import ErrorBound, error_bound
from verification.error_dynamics.analysis import RESOLUTION_RAD
from verification.error_dynamics.model import ErrorDynamicsError
from verification.tuning_check.change import mbar_factor, rounded
from verification.tuning_check.flight import Course, Flight, JointFlown, scaled
from verification.tuning_check.joint import Specified, Timing, specified
from verification.tuning_check.remedy import Remedy, remedy
from verification.tuning_check.robot import Eigenvalues, eigenvalues
from verification.tuning_check.verdict import (
    LEAST_MARGIN,
    Finding,
    Severity,
    by_severity,
    of_gains,
    of_joint,
    of_margin,
    sentence,
    worst,
)

_DIGITS = 4
"""Of a measured TDE error, rounded up."""


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
        flexible: whether the plant's joints are; the intervals are of rigid ones.
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


def same_gains(joints: Sequence[Specified]) -> bool:
    """Whether all joints have the same KD, KP and lambda, as the intervals need."""
    return len({joint.sampled.loop for joint in joints}) == 1


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
        tuple(JointCheck(j, None, None, by_severity(of_gains(j, None))) for j in joints),
        gaps=(
            "no plant: neither the inertias that Mbar must suit, nor vibration, nor the TDE error",
        ),
    )


def on_plant(controller: Controller, robot: Robot, *, compute_delay: int = 0) -> TuningCheck:
    """All of it, with a run on a plant.

    Args:
        controller: the specification.
        robot: the plant.
        compute_delay: whole samples from reading the encoders to commanding the torques, 0 or 1.

    Raises:
        PlantError: controller and robot don't fit, or the robot can't be held or delayed like that.
        CompilerError: the C can't be compiled.
    """
    if robot.encoder is not None or robot.joints != len(controller.joints):
        check_encoders(controller, robot)
    delay = Fraction(0) if robot.drive is None else Fraction(repr(robot.drive.delay))
    timing = Timing(compute_delay, delay)
    joints = specified(controller, timing)
    found = eigenvalues(robot, joints)
    inside = found if isinstance(found, Eigenvalues) else None
    course = _course(controller, robot, compute_delay)
    flights = _fly(controller, course, inside, joints)
    return TuningCheck(
        controller,
        timing,
        _joints(joints, inside, flights),
        robot.name,
        robot.flexibility is not None,
        inside,
        flights.own if flights else None,
        flights.remedy if flights else None,
        tuple(_gaps(controller, robot, found, course, flights)),
    )


@dataclass(frozen=True)
class _Flights:
    """What was flown: these gains, others near, and what cures them."""

    own: Flight
    nearby: Mapping[Fraction, Flight]
    remedy: Remedy | None


def _fly(
    controller: Controller,
    course: Course | str,
    found: Eigenvalues | None,
    joints: Sequence[Specified],
) -> _Flights | None:
    if isinstance(course, str):
        return None
    own = course.fly(controller)
    if is_fixed_point(controller):
        return _Flights(own, {}, None)
    factors = Fraction(LEAST_MARGIN), 1 / Fraction(LEAST_MARGIN)
    nearby = {factor: course.fly(scaled(controller, factor)) for factor in factors}
    return _Flights(own, nearby, remedy(controller, course, own, _factor(found, joints)))


def _factor(found: Eigenvalues | None, joints: Sequence[Specified]) -> float:
    """By what Mbar must change for all joints' intervals; 1 where it need not or can't help."""
    if found is None:
        return 1.0
    factors = [
        mbar_factor(joint.sampled, float(found.low), float(found.high), LEAST_MARGIN) or 1.0
        for joint in joints
    ]
    return rounded(max(factors, key=lambda factor: abs(math.log(factor))))


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
    joints: Sequence[Specified], found: Eigenvalues | None, flights: _Flights | None
) -> tuple[JointCheck, ...]:
    same = same_gains(joints)

    def check(index: int, joint: Specified) -> JointCheck:
        against = list(of_gains(joint, found, same_gains=same))
        if flights is None:
            return JointCheck(joint, None, None, by_severity(against))
        shown = tuple(of_joint(flights.own, index))
        if worst(shown) is not Severity.UNSAFE:
            for factor, near in flights.nearby.items():
                against += of_margin(factor, of_joint(near, index))
        flown = flights.own.joints[index] if flights.own.joints else None
        return JointCheck(joint, flown, _bound(joint, flown), by_severity((*against, *shown)))

    return tuple(check(i, joint) for i, joint in enumerate(joints))


def _bound(joint: Specified, flown: JointFlown | None) -> ErrorBound | None:
    if flown is None or not flown.tde_error or flown.saturated or joint.dynamics is None:
        return None
    gains = joint.joint
    numbers = gains.kd, gains.kp, gains.alpha, gains.beta, gains.lambda_, gains.gamma
    try:
        return error_bound(*numbers, tde_error=rounded_up(flown.tde_error))
    except ErrorDynamicsError:
        return None


def rounded_up(x: float) -> Fraction:
    """A short decimal not below a number > 0."""
    unit = Fraction(10) ** (math.floor(math.log10(x)) + 1 - _DIGITS)
    return unit * math.ceil(Fraction(x) / unit)


def _gaps(
    controller: Controller,
    robot: Robot,
    found: Eigenvalues | str,
    course: Course | str,
    flights: _Flights | None,
) -> Iterator[str]:
    remark = found if isinstance(found, str) else found.remark
    if remark:
        yield remark
    if isinstance(course, str):
        yield course
    if robot.flexibility is not None:
        yield (
            f"{robot.name} has flexible joints, the intervals are of rigid ones: outside of them "
            "springs don't help, inside of them the run decides"
        )
    slowest = math.inf if robot.drive is None else float(np.min(robot.drive.bandwidth_Hz))
    if math.isfinite(slowest):
        yield f"the intervals leave the drives' lag out ({slowest:g} Hz)"
    if flights is None:
        return
    if flights.own.no_tde_error:
        yield f"no bound of |e|: {flights.own.no_tde_error}"
    if any(joint.saturated for joint in flights.own.joints):
        yield "no bound of |e| for joints that reach their torque limit: (32) does not hold there"
    if is_fixed_point(controller):
        yield (
            "fixed-point C has the number formats of its own gains: no others were flown for their "
            "margins or for what to change"
        )
