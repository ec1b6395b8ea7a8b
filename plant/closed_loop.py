"""The closed loop: a sampled controller drives a robot with friction, drives and encoders.

At tick k (time k L) the encoders are read and the controller is called once; its torque acts over
[k L, (k + 1) L), or from ``delay`` L later on. Between, the equation of motion is integrated by
semi-implicit Euler steps with friction linearly implicit (see :mod:`plant.integrator`). What else
happens - faults, disturbances, other masses - stands in the run's script.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from codegen.status import LOST, Status
from plant.assembly import Floats, Plant, PlantError, PlantState, at_rest
from plant.integrator import Integrator
from plant.script import Counters, Script, uneventful
from plant.trajectory import Reference, RestToRest

NOT_CALLED = 1 << 16
"""Stands for the status of a tick at which the controller is not called."""

ENDED_BY = frozenset(status for status in Status if status < 0) - LOST
"""What ends a run: after a lost tick it goes on, with the torque that the controller wrote."""

Events = Callable[[Plant, Reference], Script]
"""What happens to a plant along a reference."""


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


@dataclass(frozen=True, eq=False)
class Run:
    """What happened; row k of each array belongs to tick k at time k L.

    Attributes:
        sample_time_s: L.
        time_s: shape (ticks,).
        q: true joint positions [rad], shape (ticks, n); likewise all others.
        qd: true joint velocities [rad/s].
        q_motor: the motors' positions as joint angles [rad]; q itself where joints are rigid.
        q_ref: reference positions [rad].
        qd_ref: reference velocities [rad/s].
        qdd_ref: reference accelerations [rad/s^2].
        counts: encoder counts.
        q_encoder: joint positions by the encoder counts [rad].
        torque_commanded_Nm: the controller's answer; 0 where it was not called.
        torque_applied_Nm: mean over the tick of what the drives applied.
        friction_Nm: friction torque at the beginning of the tick, opposing motion.
        status: the controller's status, shape (ticks,); ``NOT_CALLED`` where it was not called.
        end: the state of the plant after the last tick.
    """

    sample_time_s: float
    time_s: Floats
    q: Floats
    qd: Floats
    q_motor: Floats
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

    @property
    def saturated_ticks(self) -> int:
        """At how many ticks a joint was at its torque limit."""
        return int(np.count_nonzero(self.status == Status.SATURATED))

    @property
    def lost_ticks(self) -> int:
        """At how many ticks the torque was not the law's."""
        return int(np.count_nonzero(np.isin(self.status, list(LOST))))

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
    substep_s: float | None = None,
    progress: bool | None = None,
    events: Events = uneventful,
) -> Run:
    """Runs a controller on a plant along a trajectory.

    The robot starts at rest at the trajectory's first posture, held by its drives against gravity
    with the bristles of its friction undeflected.

    Args:
        plant: from :func:`plant.assembly.build_plant`.
        controller: is reset first.
        trajectory: the reference motion; the run is as long as it.
        sample_time_s: L.
        substep_s: longest step of the integrator; the plant's own by default.
        progress: shows a progress bar; by default on a terminal only.
        events: what happens beside, such as :meth:`plant.scenario.Scenario.script`.

    Raises:
        ControllerError: the controller reported an error that only a reset helps.
        PlantError: the numbers of joints differ, the drives cannot hold the start posture, or the
            motion became non-finite.
    """
    begin = beginning(plant, trajectory, sample_time_s, events)
    switch_on(controller, begin)
    return run_from(plant, controller, begin, sample_time_s, substep_s, progress)


@dataclass(frozen=True, eq=False)
class Beginning:
    """How a run begins, and what it goes through.

    Attributes:
        reference: of the whole run.
        state: of the plant.
        script: of the whole run.
    """

    reference: Reference
    state: PlantState
    script: Script

    def part(self, first: int, ticks: int, state: PlantState) -> Beginning:
        """The beginning of a part of the run, at most so many ticks from one of them on."""
        return Beginning(self.reference.rows(first, ticks), state, self.script.rows(first, ticks))


def beginning(
    plant: Plant, trajectory: RestToRest, sample_time_s: float, events: Events = uneventful
) -> Beginning:
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
    state = at_rest(plant, trajectory.start_rad)
    return Beginning(reference, state, events(plant, reference))


def switch_on(controller: Controller, begin: Beginning) -> None:
    """Resets the controller at the beginning of a run.

    Raises:
        ControllerError: the controller reported an error.
    """
    counts = Counters(begin.script, begin.state).first
    status = controller.reset(counts, begin.state.command_Nm)
    if status < 0:
        raise ControllerError(-1, status)


def run_from(
    plant: Plant,
    controller: Controller,
    begin: Beginning,
    sample_time_s: float,
    substep_s: float | None = None,
    progress: bool | None = None,
    ended_by: Collection[int] = ENDED_BY,
) -> Run:
    """Runs a controller that is already switched on, from any state of the plant.

    Args:
        plant: from :func:`plant.assembly.build_plant`.
        controller: goes on from its own state.
        begin: the first state, the reference and the script; the run is as long as they are.
        sample_time_s: L.
        substep_s: longest step of the integrator; the plant's own by default.
        progress: shows a progress bar; by default on a terminal only.
        ended_by: the controller's statuses that end the run.

    Raises:
        ControllerError: the controller reported one of them.
        PlantError: the motion became non-finite.
    """
    reference, state, script = begin.reference, begin.state, begin.script
    substep = plant.substep_s if substep_s is None else substep_s
    integrators = [Integrator(plant, model) for model in script.models]
    counters = Counters(script, state)
    shape = reference.position_rad.shape
    q, qd, q_motor, applied, friction = (np.empty(shape) for _ in range(5))
    counts = np.empty(shape, dtype=np.int32)
    commanded: dict[int, NDArray[np.floating[Any]]] = {}
    statuses = np.full(shape[0], NOT_CALLED, dtype=np.int64)
    by_counter = reference.position_rad + script.encoder.zero_rad
    for k in _ticks(shape[0], progress, plant.name):
        q[k], qd[k], q_motor[k] = state.q, state.qd, state.q_motor
        tick = _Tick(
            integrators[script.model[k]], script.external_Nm[k], sample_time_s, substep, state
        )
        late, delayed, prompt = script.timings[script.timing[k]].shares
        tick.hold(state.command_Nm, late)
        counts[k] = counters.read(k, tick.state)
        command = state.command_Nm
        if script.called[k]:
            commanded[k], statuses[k] = controller.step(
                counts[k],
                by_counter[k],
                reference.velocity_rad_per_s[k],
                reference.acceleration_rad_per_s2[k],
            )
            if statuses[k] in ended_by:
                raise ControllerError(k, int(statuses[k]))
            command = commanded[k].astype(np.float64)
        tick.hold(state.command_Nm, delayed)
        limit = script.torque_limit_Nm[k]
        tick.hold(np.clip(command, -limit, limit), prompt)
        applied[k], friction[k], state = tick.torque_Nm, tick.friction_Nm, tick.state
        if not np.all(np.isfinite(state.q)):
            raise diverged(plant, k)
    return Run(
        sample_time_s=sample_time_s,
        time_s=reference.time_s,
        q=q,
        qd=qd,
        q_motor=q_motor,
        q_ref=reference.position_rad,
        qd_ref=reference.velocity_rad_per_s,
        qdd_ref=reference.acceleration_rad_per_s2,
        counts=counts,
        q_encoder=script.encoder.positions_rad(counts),
        torque_commanded_Nm=_rows(commanded, shape),
        torque_applied_Nm=applied,
        friction_Nm=friction,
        status=statuses,
        end=state,
    )


def _rows(
    answers: dict[int, NDArray[np.floating[Any]]], shape: tuple[int, ...]
) -> NDArray[np.floating[Any]]:
    """Answers by tick as an array of their own type; rows without one are 0."""
    kind = next(iter(answers.values())).dtype if answers else np.dtype(np.float64)
    rows: NDArray[np.floating[Any]] = np.zeros(shape, dtype=kind)
    for tick, answer in answers.items():
        rows[tick] = answer
    return rows


class _Tick:
    """One tick of the plant, part by part.

    Attributes:
        state: at the end of the parts so far.
        torque_Nm: what they add to the tick's mean torque of the drives, shape (n,).
        friction_Nm: at the beginning of the tick, shape (n,).
    """

    def __init__(
        self,
        integrator: Integrator,
        external_Nm: Floats,
        sample_time_s: float,
        substep_s: float,
        state: PlantState,
    ) -> None:
        self._integrator, self._external_Nm = integrator, external_Nm
        self._sample_time_s, self._substep_s = sample_time_s, substep_s
        self.state, self.torque_Nm = state, np.zeros_like(state.q)
        self.friction_Nm: Floats | None = None

    def hold(self, command_Nm: Floats, share: float) -> None:
        """Holds a command for a fraction of the tick; one of no length still is the last."""
        part = self._integrator.advance(
            self.state,
            command_Nm,
            share * self._sample_time_s,
            self._substep_s,
            self._external_Nm,
        )
        self.state = part.state
        self.torque_Nm = self.torque_Nm + share * part.torque_Nm
        if self.friction_Nm is None and share > 0.0:
            self.friction_Nm = part.friction_Nm


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
