"""A run of a controller's C along a plant's own trajectory, and what it shows of the gains."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from codegen.controller import Controller
from plant.assembly import Plant, PlantError
from plant.closed_loop import Beginning, ControllerError, Run, beginning
from plant.compiled.loop import CompiledLoop
from plant.trajectory import RestToRest
from plant.tuning.vibration import vibration
from verification.energy.audit import tde_error_of, window_means
from verification.energy.recording import gains_of
from verification.tuning_check.joint import Floats

_AT_LIMIT = 0.999
"""Of the limit: a torque from here on is one that the limit has made."""


@dataclass(frozen=True)
class JointFlown:
    """What a run showed of a joint.

    Attributes:
        rms_deg: of the error by the encoder.
        peak_deg: its largest magnitude.
        peak_torque_Nm: as commanded.
        torque_step: RMS change of the torque from tick to tick, over the limit.
        vibration: 1 for the encoder's counts alone, see :mod:`plant.tuning.vibration`.
        saturated: share of the ticks at the limit.
        tde_error: xi, largest |eps| of (11) by torques and counts [rad/s^2]; None where not told.
        mean_tde_error: the same of means over windows, in which the counts' grain all but cancels.
    """

    rms_deg: float
    peak_deg: float
    peak_torque_Nm: float
    torque_step: float
    vibration: float
    saturated: float
    tde_error: float | None
    mean_tde_error: float | None


@dataclass(frozen=True, eq=False)
class Flight:
    """A run.

    Attributes:
        joints: what it showed of each; none where it failed.
        run: what happened; None where it failed.
        failure: why the run ended early; None where it did not.
        no_tde_error: why the TDE error is not told; None where it is.
    """

    joints: tuple[JointFlown, ...]
    run: Run | None
    failure: str | None = None
    no_tde_error: str | None = None


class Course:
    """A plant and its trajectory, on which gains of one specification are flown.

    Args:
        controller: its C is flown; other gains are set at run time.
        plant: any.
        trajectory: its own.
        compute_delay: whole samples more until a command acts, 0 or 1.

    Raises:
        PlantError: the plant doesn't fit, can't hold its start posture, or is later than a sample.
        CompilerError: the C can't be compiled.
    """

    def __init__(
        self, controller: Controller, plant: Plant, trajectory: RestToRest, compute_delay: int = 0
    ) -> None:
        if compute_delay and plant.drive.delay:
            raise PlantError(
                f"the drives of {plant.name} are late by {plant.drive.delay:g} of a sample, and a "
                "run can't have a whole sample more: take --compute-delay 0, or a plant without"
            )
        if compute_delay:
            plant = replace(plant, drive=replace(plant.drive, delay=1.0))
        self._plant = plant
        self._tick_s = float(controller.sample_time)
        self._begin: Beginning = beginning(plant, trajectory, self._tick_s)
        self._loop = CompiledLoop(plant, controller)

    def fly(self, tuned: Controller) -> Flight:
        """A run with some gains, over the whole trajectory.

        Args:
            tuned: the course's specification, or one that differs in gains only.
        """
        controller = self._loop.controller()
        controller.set_gains(tuned)
        try:
            run = self._loop.run(self._plant, controller, self._begin, self._tick_s)
        except (ControllerError, PlantError) as error:
            return Flight((), None, failure=str(error))
        return _told(tuned, run, self._plant)


def _told(tuned: Controller, run: Run, plant: Plant) -> Flight:
    limit = np.array([float(joint.torque_limit) for joint in tuned.joints])
    torque = np.asarray(run.torque_commanded_Nm, dtype=np.float64)
    low_pass = 1.0 if tuned.low_pass_ratio is None else float(tuned.low_pass_ratio)
    inertia = gains_of(tuned).inertia_kgm2
    shaking = vibration(torque, low_pass * inertia, plant.encoder.resolution_rad, run.sample_time_s)
    step = np.sqrt(np.mean(np.diff(torque, axis=0) ** 2, axis=0)) / limit
    saturated = np.mean(np.abs(torque) >= _AT_LIMIT * limit, axis=0)
    error_deg = np.abs(np.rad2deg(run.error_rad)).max(axis=0)
    why_not = _no_tde_error(tuned)
    xi = None if why_not else _tde_errors(tuned, run)
    return Flight(
        tuple(
            JointFlown(
                rms_deg=float(run.rms_error_deg()[j]),
                peak_deg=float(error_deg[j]),
                peak_torque_Nm=float(np.abs(torque[:, j]).max()),
                torque_step=float(step[j]),
                vibration=float(shaking[j]),
                saturated=float(saturated[j]),
                tde_error=None if xi is None else float(xi[0][j]),
                mean_tde_error=None if xi is None else float(xi[1][j]),
            )
            for j in range(len(tuned.joints))
        ),
        run,
        no_tde_error=why_not,
    )


def _no_tde_error(controller: Controller) -> str | None:
    if controller.low_pass_ratio is not None:
        return "the low-pass (43) stands between the law and the torque, which (32) leaves out"
    if controller.options.torque_report:
        return "tau(t-L) is what the drive reports, which a run does not record"
    return None


def _tde_errors(tuned: Controller, run: Run) -> tuple[Floats, Floats]:
    """Largest |eps| by ticks, and by means of windows; each of shape (n,)."""
    # The C is switched on at rest: before the first reading it knows the same count.
    start = run.q_encoder[:1]
    readings = np.concatenate((start, start, run.q_encoder))
    acceleration = np.diff(readings, n=2, axis=0) / run.sample_time_s**2
    error = tde_error_of(
        gains_of(tuned).inertia_kgm2,
        np.asarray(run.torque_commanded_Nm, dtype=np.float64),
        acceleration,
        late=1 if tuned.options.acceleration == "delayed" else 0,
    )
    return np.abs(error).max(axis=0), np.abs(window_means(error)).max(axis=0)


def scaled(controller: Controller, factor: Fraction) -> Controller:
    """The controller with all joints' Mbar multiplied."""
    joints = (replace(joint, inertia=joint.inertia * factor) for joint in controller.joints)
    return replace(controller, joints=tuple(joints))
