"""The closed loop: a sampled controller drives a robot with friction, drives and encoders.

At tick k (time k L) the encoders are read and the controller is called once; its torque acts over
[k L, (k + 1) L), or from ``delay`` L later on. Between, the equation of motion is integrated by
semi-implicit Euler steps with friction linearly implicit (see :mod:`plant.friction`).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from plant.drive import Drive
from plant.encoder import Encoder
from plant.friction import FrictionModel
from plant.model import build_model, gravity_torque
from plant.robot import Robot
from plant.trajectory import Reference, RestToRest

Floats = NDArray[np.float64]


class ControllerOutput(NamedTuple):
    """What a controller answers at a tick.

    Attributes:
        torque_Nm: commanded torque at the joints, shape (n,), in the controller's own numbers.
        status: negative for an error, otherwise the controller's own information.
    """

    torque_Nm: NDArray[np.floating[Any]]
    status: int


class Controller(Protocol):
    """A controller as the loop sees it."""

    def reset(
        self,
        counts: NDArray[np.int32],
        holding_torque_Nm: Floats,
        /,
    ) -> int:
        """Switches on at standstill.

        Args:
            counts: encoder counts, shape (n,).
            holding_torque_Nm: the torque that the drives apply at that moment, shape (n,).

        Returns:
            A status, negative for an error.
        """

    def step(
        self,
        counts: NDArray[np.int32],
        position_rad: Floats,
        velocity_rad_per_s: Floats,
        acceleration_rad_per_s2: Floats,
        /,
    ) -> ControllerOutput:
        """One tick.

        Args:
            counts: encoder counts, shape (n,).
            position_rad: reference, as an angle of the counter: count 0 is position 0.
            velocity_rad_per_s: reference, shape (n,).
            acceleration_rad_per_s2: reference, shape (n,).
        """


class ControllerError(Exception):
    """The controller reported an error.

    Attributes:
        tick: the tick of the error, -1 for the reset.
        status: the controller's status.
    """

    def __init__(self, tick: int, status: int) -> None:
        self.tick, self.status = tick, status
        when = f"at tick {tick}" if tick >= 0 else "at its reset"
        super().__init__(f"the controller reported status {status} {when}")


class PlantError(ValueError):
    """A plant that cannot run; the message says why."""


@dataclass(frozen=True, eq=False)
class Plant:
    """Everything between a torque command and an encoder count.

    Attributes:
        name: of the robot.
        model: Pinocchio model with ``armature`` set; never changed here.
        friction: of the joints.
        drive: of the joints.
        encoder: of the joints.
    """

    name: str
    model: pin.Model
    friction: FrictionModel
    drive: Drive
    encoder: Encoder

    @property
    def joints(self) -> int:
        """Number of joints."""
        return int(self.model.nv)


def build_plant(robot: Robot) -> Plant:
    """The plant of a robot.

    Raises:
        PlantError: the robot's file lacks a part.
    """
    if robot.friction is None or robot.drive is None or robot.encoder is None:
        missing = [p for p in ("friction", "drive", "encoder") if getattr(robot, p) is None]
        raise PlantError(f"robot {robot.name} has no {', '.join(missing)}: it cannot be simulated")
    return Plant(robot.name, build_model(robot), robot.friction, robot.drive, robot.encoder)


@dataclass(frozen=True, eq=False)
class PlantState:
    """The state of a plant with n joints.

    Attributes:
        q: joint positions [rad], shape (n,).
        qd: joint velocities [rad/s], shape (n,).
        friction: internal state of the friction, n entries.
    """

    q: Floats
    qd: Floats
    friction: list[float]


class Integrator:
    """Integrates the equation of motion of one plant; owns the working memory for it."""

    def __init__(self, plant: Plant) -> None:
        self._friction = plant.friction
        # A copy, because the friction's derivative is added to its armature for each step.
        self._model = pin.Model(plant.model)
        self._data = self._model.createData()
        self._armature = plant.model.armature.copy()

    def advance(
        self, state: PlantState, torque_Nm: Floats, duration_s: float, substep_s: float
    ) -> tuple[PlantState, Floats]:
        """The state after holding a torque for some time.

        Each of the equal substeps of h <= ``substep_s`` solves
        (M + h D) qdd = torque - nle - F by the articulated-body algorithm: h D is diagonal and
        adds to the armature.

        Args:
            state: at the beginning; left as it is.
            torque_Nm: at the joints, shape (n,).
            duration_s: >= 0.
            substep_s: longest substep > 0.

        Returns:
            The state at the end, and the friction torque [N m] of the first substep, shape (n,).
        """
        steps = substeps(duration_s, substep_s)
        q, qd, friction = state.q.copy(), state.qd.copy(), state.friction
        first = np.zeros_like(q)
        if steps == 0:
            return PlantState(q, qd, friction), first
        h = duration_s / steps
        model, data, step, aba = self._model, self._data, self._friction.step, pin.aba
        for k in range(steps):
            friction, force, derivative = step(q.tolist(), qd.tolist(), friction, h)
            implicit = h * np.array(derivative)
            model.armature = self._armature + implicit
            qdd = aba(model, data, q, qd, torque_Nm - force)
            if k == 0:
                first = force + implicit * qdd
            qd += h * qdd
            q += h * qd
        return PlantState(q, qd, friction), first


def substeps(duration_s: float, substep_s: float) -> int:
    """The least number of equal steps of at most ``substep_s``; rounding errors don't add one."""
    return math.ceil(duration_s / substep_s * (1.0 - 1e-9))


@dataclass(frozen=True, eq=False)
class Run:
    """What happened; row k of each array belongs to tick k at time k L.

    Attributes:
        sample_time_s: L.
        time_s: shape (ticks,).
        q: true joint positions [rad], shape (ticks, n); likewise all others.
        qd: true joint velocities [rad/s].
        q_ref: reference positions [rad].
        qd_ref: reference velocities [rad/s].
        qdd_ref: reference accelerations [rad/s^2].
        counts: encoder counts.
        q_encoder: joint positions by the encoder counts [rad].
        torque_commanded_Nm: the controller's answer.
        torque_applied_Nm: mean over the tick of what the drives applied.
        friction_Nm: friction torque at the beginning of the tick, opposing motion.
        status: the controller's status, shape (ticks,).
        end: the state of the plant after the last tick.
    """

    sample_time_s: float
    time_s: Floats
    q: Floats
    qd: Floats
    q_ref: Floats
    qd_ref: Floats
    qdd_ref: Floats
    counts: NDArray[np.int32]
    q_encoder: Floats
    torque_commanded_Nm: NDArray[np.floating[Any]]
    torque_applied_Nm: Floats
    friction_Nm: Floats
    status: NDArray[np.int64]
    end: PlantState

    @property
    def error_rad(self) -> Floats:
        """Tracking error as the encoders see it, q_ref - q_encoder, shape (ticks, n)."""
        return self.q_ref - self.q_encoder

    @property
    def true_error_rad(self) -> Floats:
        """Tracking error of the joint itself, q_ref - q, shape (ticks, n)."""
        return self.q_ref - self.q

    def rms_error_deg(self) -> Floats:
        """RMS of the error by the encoders, as in Table II, shape (n,)."""
        return _rms_deg(self.error_rad)

    def rms_true_error_deg(self) -> Floats:
        """RMS of the error of the joint itself, shape (n,)."""
        return _rms_deg(self.true_error_rad)


def _rms_deg(error_rad: Floats) -> Floats:
    rms: Floats = np.rad2deg(np.sqrt(np.mean(error_rad**2, axis=0)))
    return rms


def simulate(
    plant: Plant,
    controller: Controller,
    trajectory: RestToRest,
    sample_time_s: float,
    substep_s: float = 1e-4,
    progress: bool | None = None,
) -> Run:
    """Runs a controller on a plant along a trajectory.

    The robot starts at rest at the trajectory's first posture, held by its drives against gravity
    with the bristles of its friction undeflected.

    Args:
        plant: from :func:`build_plant`.
        controller: is reset first.
        trajectory: the reference motion; the run is as long as it.
        sample_time_s: L.
        substep_s: longest step of the integrator.
        progress: shows a progress bar; by default on a terminal only.

    Raises:
        ControllerError: the controller reported an error.
        PlantError: the numbers of joints differ, the drives cannot hold the start posture, or the
            motion became non-finite.
    """
    begin = beginning(plant, trajectory, sample_time_s)
    status = controller.reset(plant.encoder.counts(begin.state.q), begin.torque_Nm)
    if status < 0:
        raise ControllerError(-1, status)
    return run_from(plant, controller, begin, sample_time_s, substep_s, progress)


@dataclass(frozen=True, eq=False)
class Beginning:
    """How a run begins.

    Attributes:
        reference: of the whole run.
        state: of the plant.
        torque_Nm: that the drives apply, shape (n,).
    """

    reference: Reference
    state: PlantState
    torque_Nm: Floats


def beginning(plant: Plant, trajectory: RestToRest, sample_time_s: float) -> Beginning:
    """At rest at the trajectory's first posture, held against gravity, bristles undeflected.

    Raises:
        PlantError: the numbers of joints differ, or the drives cannot hold the start posture.
    """
    reference = trajectory.sampled(sample_time_s)
    if reference.position_rad.shape[1] != plant.joints:
        raise PlantError(
            f"{plant.name} has {plant.joints} joints, "
            f"the trajectory {reference.position_rad.shape[1]}"
        )
    start = trajectory.start_rad
    held = gravity_torque(plant.model, start)
    if np.any(np.abs(held) > plant.drive.torque_limit_Nm):
        raise PlantError(f"the drives of {plant.name} cannot hold its start posture")
    state = PlantState(start.copy(), np.zeros(plant.joints), plant.friction.at_rest())
    return Beginning(reference, state, held)


def run_from(
    plant: Plant,
    controller: Controller,
    begin: Beginning,
    sample_time_s: float,
    substep_s: float = 1e-4,
    progress: bool | None = None,
) -> Run:
    """Runs a controller that is already switched on, from any state of the plant.

    Args:
        plant: from :func:`build_plant`.
        controller: goes on from its own state.
        begin: the first state, and the reference; the run is as long as it.
        sample_time_s: L.
        substep_s: longest step of the integrator.
        progress: shows a progress bar; by default on a terminal only.

    Raises:
        ControllerError: the controller reported an error.
        PlantError: the motion became non-finite.
    """
    reference, state, torque_Nm = begin.reference, begin.state, begin.torque_Nm
    encoder, drive, integrator = plant.encoder, plant.drive, Integrator(plant)
    shape = reference.position_rad.shape
    q, qd, applied, friction = (np.empty(shape) for _ in range(4))
    counts = np.empty(shape, dtype=np.int32)
    commanded: list[NDArray[np.floating[Any]]] = []
    statuses = np.empty(shape[0], dtype=np.int64)
    by_counter = reference.position_rad + encoder.zero_rad
    before, after = drive.delay * sample_time_s, (1.0 - drive.delay) * sample_time_s
    for k in _ticks(shape[0], progress, plant.name):
        q[k], qd[k] = state.q, state.qd
        counts[k] = encoder.counts(state.q)
        torque, statuses[k] = controller.step(
            counts[k],
            by_counter[k],
            reference.velocity_rad_per_s[k],
            reference.acceleration_rad_per_s2[k],
        )
        if statuses[k] < 0:
            raise ControllerError(k, int(statuses[k]))
        commanded.append(torque)
        old, torque_Nm = torque_Nm, drive.limited(torque.astype(np.float64))
        if before > 0.0:
            state, friction[k] = integrator.advance(state, old, before, substep_s)
        if after > 0.0:
            state, first = integrator.advance(state, torque_Nm, after, substep_s)
            if before == 0.0:
                friction[k] = first
        applied[k] = drive.delay * old + (1.0 - drive.delay) * torque_Nm
        if not np.all(np.isfinite(state.q)):
            raise diverged(plant, k)
    return Run(
        sample_time_s=sample_time_s,
        time_s=reference.time_s,
        q=q,
        qd=qd,
        q_ref=reference.position_rad,
        qd_ref=reference.velocity_rad_per_s,
        qdd_ref=reference.acceleration_rad_per_s2,
        counts=counts,
        q_encoder=encoder.positions_rad(counts),
        torque_commanded_Nm=np.array(commanded),
        torque_applied_Nm=applied,
        friction_Nm=friction,
        status=statuses,
        end=state,
    )


def diverged(plant: Plant, tick: int) -> PlantError:
    """The error of a motion that became non-finite."""
    return PlantError(f"the motion of {plant.name} became non-finite in tick {tick}")


def _ticks(count: int, progress: bool | None, name: str) -> Iterable[int]:
    if progress is None:
        progress = sys.stderr.isatty()
    if not progress:
        return range(count)
    console = Console(stderr=True)
    return track(range(count), f"simulating {name}", console=console, transient=True)
