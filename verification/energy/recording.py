"""What a controller's C saw and kept at every tick of a run.

A compiled run records counts and torques, but not the controller's memory. The same C, stepped
again along the recorded counts, has that memory at every tick; its torques being those of the run,
bit by bit, says that it is the same memory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codegen.controller import Controller
from plant.closed_loop import Beginning, Run, switch_on
from plant.controller import GeneratedController

Floats = NDArray[np.float64]


class EnergyError(Exception):
    """A run whose energy can't be told; the message says why."""


@dataclass(frozen=True)
class Gains:
    """The gains of the joints as they were flown, each of shape (n,)."""

    inertia_kgm2: Floats
    kd: Floats
    kp: Floats
    lambda_: Floats
    alpha: Floats
    beta: Floats
    gamma: Floats


def gains_of(specification: Controller) -> Gains:
    """The gains of a specification as numbers."""

    def column(name: str) -> Floats:
        return np.array([float(getattr(joint, name)) for joint in specification.joints])

    return Gains(
        *(column(name) for name in ("inertia", "kd", "kp", "lambda_", "alpha", "beta", "gamma"))
    )


@dataclass(frozen=True, eq=False)
class Recording:
    """The signals of the law by tick, of shape (ticks, n) unless said otherwise.

    Attributes:
        sample_time_s: L.
        time_s: shape (ticks,).
        position_error: e of (7) [rad].
        velocity_error: ed of (7), reference velocity minus backward difference [rad/s].
        sliding: s of (26), the velocity error plus the integral in the C's memory [rad/s].
        acceleration: backward second difference of the counts, qdd(t-L) of (6) [rad/s^2].
        torque_Nm: as the C applied it.
        reference_velocity: as the C was told [rad/s].
        reference_acceleration: as the C was told [rad/s^2].
        count_acceleration: of one count a tick a tick [rad/s^2], shape (n,).
        saturated_ticks: at which a joint was at its limit.
    """

    sample_time_s: float
    time_s: Floats
    position_error: Floats
    velocity_error: Floats
    sliding: Floats
    acceleration: Floats
    torque_Nm: Floats
    reference_velocity: Floats
    reference_acceleration: Floats
    count_acceleration: Floats
    saturated_ticks: int


def record(controller: GeneratedController, begin: Beginning, run: Run) -> Recording:
    """Steps a controller's C again along a run.

    Args:
        controller: with the gains of the run; is switched on here. Its velocity error is
            ``reference-rate`` and its arithmetic float.
        begin: the run's beginning.
        run: recorded with the same C.

    Raises:
        EnergyError: the C answers another torque than in the run.
        ControllerError: the controller reports an error at its reset.
    """
    shape = run.counts.shape
    integral = np.empty(shape, dtype=np.float32)
    displacement = np.empty(shape, dtype=np.int64)
    change = np.empty(shape, dtype=np.int64)
    error_q8 = np.empty(shape, dtype=np.int64)
    velocity = np.empty(shape, dtype=np.float32)
    acceleration = np.empty(shape, dtype=np.float32)
    position = run.q_ref + begin.script.encoder.zero_rad
    switch_on(controller, begin)
    for k, counts in enumerate(run.counts):
        before = [memory.sliding_integral_rad_per_s for memory in controller.last_memory]
        moved = [memory.displacement for memory in controller.last_memory]
        torque, _ = controller.step(counts, position[k], run.qd_ref[k], run.qdd_ref[k])
        if not np.array_equal(torque, run.torque_commanded_Nm[k]):
            raise EnergyError(f"the C's torque at tick {k} is not the run's: not the same gains")
        given, memory = controller.input, controller.last_memory
        integral[k] = before
        displacement[k] = [joint.displacement for joint in memory]
        change[k] = displacement[k] - moved
        error_q8[k] = np.array(given.reference_position_q8) - 256 * counts.astype(np.int64)
        velocity[k] = given.reference_velocity_rad_per_s
        acceleration[k] = given.reference_acceleration_rad_per_s2
    count = np.array([joint.rad_per_count for joint in controller.specification.joints], float)
    step = run.sample_time_s
    # As the C measures: single products and differences of floats.
    velocity_error = velocity - displacement.astype(np.float32) * (count / step).astype(np.float32)
    # The C sets the integral of the first tick within it, so that s(0) = 0 (26), and forgets the
    # change of displacement there.
    integral[0] = -velocity_error[0]
    change[0] = 0
    return Recording(
        sample_time_s=step,
        time_s=run.time_s,
        position_error=_wrapped(error_q8) * count / 256,
        velocity_error=velocity_error.astype(np.float64),
        sliding=(velocity_error + integral).astype(np.float64),
        acceleration=change * count / step**2,
        torque_Nm=run.torque_commanded_Nm.astype(np.float64),
        reference_velocity=velocity.astype(np.float64),
        reference_acceleration=acceleration.astype(np.float64),
        count_acceleration=np.abs(count) / step**2,
        saturated_ticks=int(np.count_nonzero(run.status > 0)),
    )


def _wrapped(numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    """Modulo 2^32 as an int32_t: positions wrap, and the C's errors of position with them."""
    wrapped: NDArray[np.int64] = (numbers + 2**31) % 2**32 - 2**31
    return wrapped
