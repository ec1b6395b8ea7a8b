"""Energy (20) and Vs (57) along a recorded run, and what the TDE error does to them.

V changes as (21) says only where the desired error dynamics is met; the closed loop meets it up to
sdot (25)(32). Vs falls where |eps| < lambda |s|^gamma, so that the error of time delay estimation
is told beside it. All of it is as the controller sees it: one encoder count a tick a tick is an
acceleration of several rad/s^2, and is part of eps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codegen.controller import Controller, Joint, load
from codegen.emit import REPOSITORY
from plant.assembly import PlantError, build_plant
from plant.closed_loop import beginning
from plant.compiled.loop import CompiledLoop
from plant.flight import check_encoders
from plant.robot import load_robot
from verification.energy.recording import Floats, Gains, Recording, gains_of, record
from verification.error_bound import error_bound
from verification.evidence import Evidence

CONTROLLER = REPOSITORY / "controllers" / "puma3.toml"
ROBOT = "reference"
WINDOW_TICKS = 50
"""Over which means are taken: the encoder's grain in eps all but cancels from tick to tick."""


def magnitude(x: Floats, exponent: Floats) -> Floats:
    """|x|^a, 0 to the power of 0 being 0: what sgn(x) is multiplied by in sig(x)^a."""
    return np.where(x == 0.0, 0.0, np.abs(x) ** exponent)


def sig(x: Floats, exponent: Floats) -> Floats:
    """sig(x)^a = |x|^a sgn(x), defined below (17)."""
    return np.sign(x) * magnitude(x, exponent)


def energy(gains: Gains, position_error: Floats, velocity_error: Floats) -> Floats:
    """V of (20) of each joint [rad^2/s^2], of the shape of the errors."""
    power = gains.beta + 1.0
    return 0.5 * velocity_error**2 + gains.kp * magnitude(position_error, power) / power


def sliding_energy(sliding: Floats) -> Floats:
    """Vs of appendix B of each joint, s^2/2 [rad^2/s^2]."""
    return 0.5 * sliding**2


def tde_error(gains: Gains, recording: Recording) -> Floats:
    """eps of (11) along a recording, as of :func:`tde_error_of`."""
    return tde_error_of(gains.inertia_kgm2, recording.torque_Nm, recording.acceleration)


def tde_error_of(
    inertia_kgm2: Floats, torque_Nm: Floats, acceleration: Floats, *, late: int = 0
) -> Floats:
    """eps of (11) from torques and counts [rad/s^2], shape (ticks - 2, n).

    Mbar^-1 (N - N(t-L)), where N of a tick is its torque minus Mbar times the second difference
    that ends one tick later (``verification.symbolic.sampled_closed_loop``). The first row is of
    tick 1, which has a torque of the law before it, the last of the last tick but one.

    Args:
        inertia_kgm2: Mbar, shape (n,).
        torque_Nm: of each tick, shape (ticks, n).
        acceleration: second difference of the counts that ends at a tick, shape (ticks, n).
        late: 1 where the law estimates N(t-L) by the second difference of one tick before.
    """
    torque = np.diff(torque_Nm, axis=0)[:-1] / inertia_kgm2
    estimate = acceleration[1 - late : len(acceleration) - 1 - late]
    return torque - (acceleration[2:] - estimate)


def reference_mismatch(recording: Recording) -> Floats:
    """rho: what the sampled reference lacks of qdd_d [rad/s^2], of the ticks of `tde_error`."""
    rate = np.diff(recording.reference_velocity, axis=0) / recording.sample_time_s
    return (rate - recording.reference_acceleration[:-1])[1:]


def tde_error_of_s(gains: Gains, recording: Recording) -> Floats:
    """eps by what it does to s, (32) in samples, of the ticks of `tde_error` [rad/s^2].

    s(t+L) - s(t) = L (eps + rho - lambda sig(s)^gamma), proved in ``verification.symbolic`` of
    exact numbers without saturation: how far the C is from it is the C's rounding.
    """
    rate = np.diff(recording.sliding, axis=0)[1:] / recording.sample_time_s
    correction = gains.lambda_ * sig(recording.sliding[1:-1], gains.gamma)
    return rate + correction - reference_mismatch(recording)


@dataclass(frozen=True)
class JointEnergy:
    """What the energies of a joint did along a run; shares are of ticks.

    Attributes:
        joint: its name.
        energy_falls: V is less one tick later.
        energy_falls_as_21: and at least by L KD |ed|^(alpha+1), as (21) has it, with the smaller
            |ed| of both ends of the tick.
        sliding_falls: Vs is less one tick later.
        broken: the TDE error breaks (58), |eps| >= lambda |s|^gamma.
        falls_where_unbroken: of the other ticks those where Vs falls; None if there are none.
        falls_where_broken: of those where it is broken; None if there are none.
        largest_tde_error: xi, largest |eps| [rad/s^2].
        count_acceleration: of one encoder count a tick a tick [rad/s^2], the grain of eps.
        largest_sliding: largest |s| [rad/s].
        bound: (xi/lambda)^(1/gamma) (38) [rad/s]; None without correction.
        over_bound: largest |s| over the bound; None without correction.
        largest_mean_tde_error: largest magnitude of eps as means of windows [rad/s^2].
        mean_over_bound: largest |s|, as means too, over (38) with that; None without correction.
            (38) promises no 1 at most here: for gamma < 1 the mean of sig(s)^gamma, which pulls
            s back, is less than sig(mean s)^gamma where s jumps to and fro by counts.
        mean_pull: mean of sig(s)^gamma in a window over sig(mean s)^gamma, median magnitude; None
            without correction.
        identity_error: largest difference of the two ways to eps [rad/s^2].
        largest_error: largest |e| [rad].
        error_bound: of |e|, certified for this xi (:mod:`verification.error_bound`) [rad]; None
            where none is known, or the gains were not given exactly.
    """

    joint: str
    energy_falls: float
    energy_falls_as_21: float
    sliding_falls: float
    broken: float
    falls_where_unbroken: float | None
    falls_where_broken: float | None
    largest_tde_error: float
    count_acceleration: float
    largest_sliding: float
    bound: float | None
    over_bound: float | None
    largest_mean_tde_error: float
    mean_over_bound: float | None
    mean_pull: float | None
    identity_error: float
    largest_error: float
    error_bound: float | None = None

    @property
    def over_error_bound(self) -> float | None:
        """Largest |e| over its bound."""
        return self.largest_error / self.error_bound if self.error_bound else None


@dataclass(frozen=True, eq=False)
class RowEnergy:
    """A row of Table II.

    Attributes:
        exp: its number in the paper.
        saturated_ticks: at which a joint was at its torque limit.
        joints: in order.
        time_s: of the traces, shape (ticks,).
        energy: V of all joints together, as (20) has it [rad^2/s^2], shape (ticks,).
        sliding_energy: Vs likewise.
        evidence: measured, on the simulated plant.
    """

    exp: str
    saturated_ticks: int
    joints: tuple[JointEnergy, ...]
    time_s: Floats
    energy: Floats
    sliding_energy: Floats
    evidence: Evidence = Evidence.MEASURED


def bound_of_s(largest_tde_error: float, lambda_: float, gamma: float) -> float | None:
    """The bound (38) of |s| [rad/s]; None where lambda or gamma is 0 and there is none."""
    if lambda_ == 0.0 or gamma == 0.0:
        return None
    return float((largest_tde_error / lambda_) ** (1.0 / gamma))


def audit(exp: str, names: Sequence[str], gains: Gains, recording: Recording) -> RowEnergy:
    """Tells what V and Vs do from tick to tick of a recording of 3 ticks or more.

    Args:
        exp: the row's name.
        names: of the joints.
        gains: that were flown.
        recording: of the run.
    """
    # The ticks that have a TDE error: the first has no law before it, the last no tick behind.
    s, ed = recording.sliding[1:-1], recording.velocity_error[1:-1]
    v = energy(gains, recording.position_error, recording.velocity_error)
    vs = sliding_energy(recording.sliding)
    v_step, vs_step = np.diff(v, axis=0)[1:], np.diff(vs, axis=0)[1:]
    # While |ed| grows or shrinks all through a tick, the integral of (21) is at least this.
    slower = np.minimum(np.abs(ed), np.abs(recording.velocity_error[2:]))
    dissipated = recording.sample_time_s * gains.kd * magnitude(slower, gains.alpha + 1.0)
    error = tde_error(gains, recording)
    xi = np.abs(error).max(axis=0)
    broken = np.abs(error) >= gains.lambda_ * magnitude(s, gains.gamma)
    difference = np.abs(tde_error_of_s(gains, recording) - error).max(axis=0)
    largest = np.abs(recording.sliding).max(axis=0)
    mean_xi, mean_largest = (np.abs(window_means(x)).max(axis=0) for x in (error, s))
    pull, pull_at_mean = window_means(sig(s, gains.gamma)), sig(window_means(s), gains.gamma)

    def joint(j: int) -> JointEnergy:
        bound = bound_of_s(xi[j], gains.lambda_[j], gains.gamma[j])
        mean_bound = bound_of_s(mean_xi[j], gains.lambda_[j], gains.gamma[j])
        falls, breaks = vs_step[:, j] < 0.0, broken[:, j]
        return JointEnergy(
            joint=names[j],
            energy_falls=_share(v_step[:, j] < 0.0),
            energy_falls_as_21=_share((v_step < 0.0)[:, j] & (v_step <= -dissipated)[:, j]),
            sliding_falls=_share(falls),
            broken=_share(breaks),
            falls_where_unbroken=_share(falls[~breaks]) if not breaks.all() else None,
            falls_where_broken=_share(falls[breaks]) if breaks.any() else None,
            largest_tde_error=float(xi[j]),
            count_acceleration=float(recording.count_acceleration[j]),
            largest_sliding=float(largest[j]),
            bound=bound,
            over_bound=float(largest[j] / bound) if bound else None,
            largest_mean_tde_error=float(mean_xi[j]),
            mean_over_bound=float(mean_largest[j] / mean_bound) if mean_bound else None,
            mean_pull=_median_ratio(pull[:, j], pull_at_mean[:, j]) if mean_bound else None,
            identity_error=float(difference[j]),
            largest_error=float(np.abs(recording.position_error[:, j]).max()),
        )

    return RowEnergy(
        exp,
        recording.saturated_ticks,
        tuple(joint(j) for j in range(len(names))),
        recording.time_s,
        v.sum(axis=1),
        vs.sum(axis=1),
    )


def bound_of_e(joint: Joint, largest_tde_error: float) -> float | None:
    """The certified bound of |e| [rad] of a joint with these exact gains; None without one."""
    gains = (joint.kd, joint.kp, joint.alpha, joint.beta, joint.lambda_, joint.gamma)
    # Six digits, upwards: exact powers of a double's digits would take long.
    xi = f"{largest_tde_error * (1 + 1e-5):.5e}"
    return error_bound(*gains, tde_error=xi).error_bound_rad


def with_bounds_of_e(row: RowEnergy, flown: Controller) -> RowEnergy:
    """The row with bounds of |e| for the gains that were flown."""
    bounded = (
        replace(told, error_bound=bound_of_e(joint, told.largest_tde_error))
        for told, joint in zip(row.joints, flown.joints, strict=True)
    )
    return replace(row, joints=tuple(bounded))


def window_means(signal: Floats) -> Floats:
    """Means of whole windows one after the other, along the first axis; the rest is left out.

    A signal shorter than a window is one window.
    """
    window = min(WINDOW_TICKS, len(signal))
    whole = len(signal) // window * window
    means: Floats = signal[:whole].reshape(-1, window, *signal.shape[1:]).mean(axis=1)
    return means


def _median_ratio(numerator: Floats, denominator: Floats) -> float:
    there = denominator != 0.0
    return float(np.median(np.abs(numerator[there] / denominator[there])))


def _share(ticks: NDArray[np.bool_]) -> float:
    return float(np.mean(ticks))


def fly_rows(
    names: Sequence[str], advance: Callable[[], None] = lambda: None
) -> tuple[RowEnergy, ...]:
    """Flies rows of Table II on the reference plant and audits their energy.

    Args:
        names: of rows.
        advance: called after each.

    Raises:
        ControllerError, PlantError: a run did not get to its end.
        EnergyError: the C, stepped again, did not answer as in the run.
    """
    shipped, robot = load(CONTROLLER), load_robot(ROBOT)
    check_encoders(shipped, robot)
    plant = build_plant(robot)
    if robot.trajectory is None:
        raise PlantError(f"robot {robot.name} has no [trajectory]: add one to its file")
    tick = float(shipped.sample_time)
    begin = beginning(plant, robot.trajectory, tick)
    loop = CompiledLoop(plant, shipped)
    controller = loop.controller()
    rows = []
    for name in names:
        tuned = load(CONTROLLER, experiment=name)
        controller.set_gains(tuned)
        run = loop.run(plant, controller, begin, tick)
        joints = [joint.name for joint in tuned.joints]
        row = audit(name, joints, gains_of(tuned), record(controller, begin, run))
        rows.append(with_bounds_of_e(row, tuned))
        advance()
    return tuple(rows)
