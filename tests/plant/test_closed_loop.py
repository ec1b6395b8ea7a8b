"""The loop itself: integration, sampling, drives, errors; controllers are made up here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from plant.assembly import Plant, PlantError, PlantState, at_rest, build_plant
from plant.closed_loop import ControllerError, ControllerOutput, simulate
from plant.drive import Drive
from plant.encoder import Encoder
from plant.friction import frictionless
from plant.integrator import Integrator, substeps
from plant.model import dynamics, energy, gravity_torque
from plant.robot import load_robot
from plant.trajectory import RestToRest

Floats = NDArray[np.float64]
TICK = 1e-3
START = np.deg2rad([0.0, -45.0, 90.0])


@dataclass
class PD:
    """Proportional-derivative control on counts, on top of the torque that held the start."""

    counts_per_rad: Floats
    held: Floats = field(default_factory=lambda: np.zeros(3))
    error: Floats = field(default_factory=lambda: np.zeros(3))

    def reset(self, _: NDArray[np.int32], held: Floats, /) -> int:
        """Remembers the holding torque."""
        self.held, self.error = held.copy(), np.zeros_like(held)
        return 0

    def step(self, counts: NDArray[np.int32], position_rad: Floats, *_: Floats) -> ControllerOutput:
        """A torque for the position error in counts and its backward difference."""
        reference = np.rint(position_rad * self.counts_per_rad).astype(np.int64)
        # The difference of two wrapped counters is right as long as it is taken in 32 bits.
        difference = (reference - counts).astype(np.uint32).view(np.int32)
        error = difference / self.counts_per_rad
        rate, self.error = (error - self.error) / TICK, error
        torque = self.held + 3000.0 * error + 100.0 * rate
        return ControllerOutput(torque.astype(np.float32), 0)


@dataclass
class Scripted:
    """Answers with a prepared torque and status."""

    torque: Callable[[int], Floats]
    status: Callable[[int], int] = lambda _: 0
    reset_status: int = 0
    tick: int = 0

    def reset(self, *_: object) -> int:
        """Begins with tick 0."""
        self.tick = 0
        return self.reset_status

    def step(self, *_: object) -> ControllerOutput:
        """The next of the prepared answers."""
        self.tick += 1
        torque = self.torque(self.tick - 1).astype(np.float32)
        return ControllerOutput(torque, self.status(self.tick - 1))


@pytest.fixture(scope="module")
def plant() -> Plant:
    return build_plant(load_robot("reference"))


@pytest.fixture(scope="module")
def smooth(plant: Plant) -> Plant:
    return replace(plant, friction=frictionless(3))


def _rest(ticks: int) -> RestToRest:
    return RestToRest(np.array([START, START]), np.array([ticks * TICK]))


def _move(duration_s: float = 0.5) -> RestToRest:
    return RestToRest(np.array([START, START + 0.2]), np.array([duration_s]))


def _swing(plant: Plant, substep: float) -> PlantState:
    """Half a second of free fall from the start posture."""
    state = PlantState.as_one(
        START.copy(), np.array([1.0, 0.0, -1.0]), plant.friction.at_rest(), np.zeros(3)
    )
    return Integrator(plant).advance(state, np.zeros(3), 0.5, substep).state


def test_free_swing_converges_to_an_independent_solution_with_order_one(smooth: Plant) -> None:
    """Semi-implicit Euler is of first order here, since the Coriolis terms depend on velocity."""

    def rates(_: float, y: Floats) -> Floats:
        zero = np.zeros(3)
        terms = dynamics(smooth.model, y[:3], y[3:], zero)
        return np.concatenate((y[3:], np.linalg.solve(terms.M, -terms.tau)))

    start = np.concatenate((START, [1.0, 0.0, -1.0]))
    exact = solve_ivp(rates, (0.0, 0.5), start, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    errors = []
    for substep in (1e-3, 5e-4, 2.5e-4):
        state = _swing(smooth, substep)
        errors.append(np.linalg.norm(np.concatenate((state.q, state.qd)) - exact))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.1)
    assert errors[-1] < 5e-3


def test_energy_of_a_frictionless_swing_is_kept_with_order_one(smooth: Plant) -> None:
    before = energy(smooth.model, START, np.array([1.0, 0.0, -1.0]))
    drifts = []
    for substep in (1e-3, 5e-4, 2.5e-4):
        state = _swing(smooth, substep)
        drifts.append(abs(energy(smooth.model, state.q, state.qd) - before))
    orders = np.log2(np.array(drifts[:-1]) / drifts[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.2)


def test_friction_takes_energy_away(plant: Plant) -> None:
    before = energy(plant.model, START, np.array([1.0, 0.0, -1.0]))
    state = _swing(plant, 1e-4)
    assert energy(plant.model, state.q, state.qd) < before - 1.0


def test_holding_torque_holds(plant: Plant) -> None:
    held = gravity_torque(plant.model, START)
    run = simulate(plant, Scripted(lambda _: held), _rest(200), TICK, progress=False)
    # The command has float32 resolution; static friction takes up what is missing.
    np.testing.assert_allclose(run.q, np.tile(START, (200, 1)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.qd, 0.0, atol=1e-6)


def test_a_run_tracks_and_reports_consistently(plant: Plant) -> None:
    motion = _move()
    controller = PD(plant.encoder.counts_per_rad)
    run = simulate(plant, controller, motion, TICK, progress=False)
    ticks = 500
    for name in ("q", "qd", "q_ref", "qd_ref", "qdd_ref", "counts", "friction_Nm", "q_encoder"):
        assert getattr(run, name).shape == (ticks, 3)
    assert run.time_s.shape == run.status.shape == (ticks,)
    assert run.counts.dtype == np.int32
    assert run.torque_commanded_Nm.dtype == np.float32
    np.testing.assert_array_equal(run.q[0], START)
    np.testing.assert_array_equal(run.counts, plant.encoder.counts(run.q))
    np.testing.assert_array_equal(run.q_ref, motion.sampled(TICK).position_rad)
    # floor(): the encoder reads up to one count low.
    lag = run.q - run.q_encoder
    assert np.all((lag >= -1e-12) & (lag <= plant.encoder.resolution_rad + 1e-12))
    assert 0.0 < run.rms_error_deg().max() < 0.5
    np.testing.assert_allclose(
        run.rms_error_deg(), np.sqrt(np.mean(np.rad2deg(run.q_ref - run.q_encoder) ** 2, axis=0))
    )
    np.testing.assert_allclose(
        run.rms_true_error_deg(), np.sqrt(np.mean(np.rad2deg(run.q_ref - run.q) ** 2, axis=0))
    )
    assert np.any(run.rms_error_deg() != run.rms_true_error_deg())


def test_friction_is_recorded_at_the_tick(plant: Plant) -> None:
    run = simulate(plant, PD(plant.encoder.counts_per_rad), _move(), TICK, progress=False)
    moving = np.abs(run.qd) > 0.1
    steady = np.array(
        [
            plant.friction.steady_torque(q, qd)
            for q, qd in zip(run.q.tolist(), run.qd.tolist(), strict=True)
        ]
    )
    # While the joint slides, LuGre follows the curve but for the ripple's change along the bristle.
    np.testing.assert_allclose(run.friction_Nm[moving], steady[moving], atol=1.5)


def test_the_plant_is_left_as_it_was(plant: Plant) -> None:
    armature = plant.model.armature.copy()
    controller = PD(plant.encoder.counts_per_rad)
    first = simulate(plant, controller, _move(0.1), TICK, progress=False)
    np.testing.assert_array_equal(plant.model.armature, armature)
    again = simulate(plant, controller, _move(0.1), TICK, progress=False)
    np.testing.assert_array_equal(first.q, again.q)


@pytest.mark.parametrize(
    ("start_count", "wraps"), [(2**31 - 100, True), (2**31 - 5000, True), (10**10, False)]
)
def test_a_wrapping_counter_changes_nothing(plant: Plant, start_count: int, wraps: bool) -> None:
    offset = start_count - plant.encoder.counts(START).astype(np.int64)
    shifted = replace(plant, encoder=replace(plant.encoder, offset_counts=offset))
    plain, other = (
        simulate(p, PD(p.encoder.counts_per_rad), _move(), TICK, progress=False)
        for p in (plant, shifted)
    )
    jumps = np.abs(np.diff(other.counts.astype(np.int64), axis=0)) > 2**31
    assert np.all(jumps.any(axis=0)) == wraps
    resolution = plant.encoder.resolution_rad
    assert np.all(np.abs(other.q - plain.q) < 2 * resolution)
    assert np.all(np.abs(other.q_encoder - plain.q_encoder) < 3 * resolution)


def test_drive_limits_the_torque(plant: Plant) -> None:
    limit = plant.drive.torque_limit_Nm
    run = simulate(
        plant,
        Scripted(lambda k: np.array([1e6, -1e6, 1.0]) * (1 if k < 5 else -1)),
        _rest(10),
        TICK,
        progress=False,
    )
    expected = np.array([limit[0], -limit[1], 1.0])
    np.testing.assert_array_equal(run.torque_applied_Nm[:5], np.tile(expected, (5, 1)))
    np.testing.assert_array_equal(run.torque_applied_Nm[5:], np.tile(-expected, (5, 1)))
    assert run.torque_commanded_Nm[0, 0] == 1e6


def test_drive_refuses_nonsense() -> None:
    for limit, delay in ((0.0, 0.0), (1.0, -0.1), (1.0, 1.1), (float("nan"), 0.0)):
        with pytest.raises(ValueError, match="a drive needs"):
            Drive(np.array([limit]), delay)


def test_a_current_loop_answers_a_step_as_a_first_order_lag(smooth: Plant) -> None:
    """The applied torque is the mean over each tick, whatever the substeps and the delay."""
    bandwidth, delay, ticks = np.array([50.0, 200.0, 1000.0]), 0.37, 6
    drive = replace(smooth.drive, bandwidth_Hz=bandwidth, delay=delay)
    held, step = gravity_torque(smooth.model, START), np.array([4.0, -30.0, 10.0])
    for substep in (1e-4, 3e-4):
        run = simulate(
            replace(smooth, drive=drive),
            Scripted(lambda _: step),
            _rest(ticks),
            TICK,
            substep,
            progress=False,
        )
        rate = 2.0 * np.pi * bandwidth

        def left(time_s: float, rate: Floats = rate) -> Floats:
            """The integral of what is left of the step, from its beginning on."""
            return -np.expm1(-rate * max(time_s, 0.0)) / rate + min(time_s, 0.0)

        for k in range(ticks):
            ends = [left((k + end - delay) * TICK) for end in (0, 1)]
            expected = step + (held - step) * (ends[1] - ends[0]) / TICK
            np.testing.assert_allclose(run.torque_applied_Nm[k], expected, rtol=1e-6)
        remaining = (held - step) * np.exp(-rate * (ticks - delay) * TICK)
        np.testing.assert_allclose(run.end.torque_Nm, step + remaining, rtol=1e-6)


def test_a_whole_tick_of_delay_is_the_command_one_tick_later(plant: Plant) -> None:
    commands = np.random.default_rng(3).uniform(-20.0, 20.0, (50, 3)).astype(np.float32)
    held = gravity_torque(plant.model, START)
    late = replace(plant, drive=replace(plant.drive, delay=1.0))
    delayed = simulate(late, Scripted(lambda k: commands[k]), _rest(50), TICK, progress=False)
    # The first tick still applies the holding torque, which float32 would round.
    assert delayed.torque_applied_Nm[0].tolist() == held.tolist()
    np.testing.assert_array_equal(delayed.torque_applied_Nm[1:], commands[:-1])
    state = at_rest(plant, START)
    integrator = Integrator(plant)
    for k in range(50):
        np.testing.assert_array_equal(delayed.q[k], state.q)
        torque = held if k == 0 else commands[k - 1].astype(np.float64)
        state = integrator.advance(state, torque, TICK, 1e-4).state


def test_a_fraction_of_delay_is_exact_off_the_substep_grid(smooth: Plant) -> None:
    """A torque step that acts delay L later moves a joint of constant inertia as mechanics says."""
    weightless = replace(smooth, model=smooth.model.copy())
    weightless.model.gravity.linear = np.zeros(3)
    delay, torque, ticks = 0.37, 5.0, 4
    late = replace(weightless, drive=replace(smooth.drive, delay=delay))
    run = simulate(
        late,
        Scripted(lambda _: np.array([0.0, 0.0, torque])),
        _rest(ticks),
        TICK,
        substep_s=1e-5,
        progress=False,
    )
    inverse = np.linalg.inv(dynamics(smooth.model, START, np.zeros(3), np.zeros(3)).M)
    for k in range(1, ticks):
        acting = (k - delay) * TICK
        np.testing.assert_allclose(run.qd[k], inverse[:, 2] * torque * acting, rtol=1e-3)
        np.testing.assert_allclose(
            run.q[k] - START, inverse[:, 2] * torque * acting**2 / 2, rtol=0.02
        )
    np.testing.assert_allclose(
        run.torque_applied_Nm[:, 2], [(1 - delay) * torque] + [torque] * (ticks - 1)
    )


def test_substeps_fill_the_tick_evenly() -> None:
    assert substeps(1e-3, 1e-4) == 10
    assert substeps(1e-3, 3e-4) == 4
    assert substeps(1e-3, 1.0) == 1
    assert substeps(0.0, 1e-4) == 0
    # 13 * 1e-4 / 1e-4 is a little more than 13; that must not cost a step.
    assert substeps(13 * 1e-4, 1e-4) == 13


def test_a_progress_bar_changes_nothing(plant: Plant) -> None:
    held = gravity_torque(plant.model, START)
    silent, shown = (
        simulate(plant, Scripted(lambda _: held), _rest(5), TICK, progress=progress)
        for progress in (False, True)
    )
    np.testing.assert_array_equal(silent.q, shown.q)


def test_controller_errors_name_tick_and_status(plant: Plant) -> None:
    held = gravity_torque(plant.model, START)
    failing = Scripted(lambda _: held, status=lambda k: -3 if k == 7 else 1)
    with pytest.raises(ControllerError, match="status -3 at tick 7") as raised:
        simulate(plant, failing, _rest(20), TICK, progress=False)
    assert (raised.value.tick, raised.value.status) == (7, -3)
    refusing = Scripted(lambda _: held, reset_status=-2)
    with pytest.raises(ControllerError, match="status -2 at its reset"):
        simulate(plant, refusing, _rest(20), TICK, progress=False)


def test_non_negative_status_is_recorded(plant: Plant) -> None:
    held = gravity_torque(plant.model, START)
    run = simulate(
        plant, Scripted(lambda _: held, status=lambda k: k % 2), _rest(6), TICK, progress=False
    )
    assert run.status.tolist() == [0, 1, 0, 1, 0, 1]


def test_non_finite_motion_stops_the_run(plant: Plant) -> None:
    held = gravity_torque(plant.model, START)
    broken = Scripted(lambda k: held * (np.nan if k == 4 else 1.0))
    with pytest.raises(PlantError, match="non-finite in tick 4"):
        simulate(plant, broken, _rest(20), TICK, progress=False)


def test_plants_that_cannot_run_say_why(plant: Plant) -> None:
    with pytest.raises(PlantError, match="puma560_akb has no friction, drive, encoder"):
        build_plant(load_robot("puma560_akb"))
    six = RestToRest(np.zeros((2, 6)), np.array([0.1]))
    with pytest.raises(PlantError, match="3 joints, the trajectory 6"):
        simulate(plant, Scripted(lambda _: np.zeros(3)), six, TICK, progress=False)
    weak = replace(plant, drive=Drive(np.ones(3)))
    with pytest.raises(PlantError, match="cannot hold"):
        simulate(weak, Scripted(lambda _: np.zeros(3)), _rest(5), TICK, progress=False)


@pytest.mark.parametrize("lock_wrist", [False, True])
def test_the_puma560_runs_with_and_without_its_wrist(lock_wrist: bool) -> None:
    robot = load_robot("puma560", lock_wrist=lock_wrist)
    assert robot.trajectory is not None
    plant = build_plant(robot)
    motion = RestToRest(robot.trajectory.postures_rad[:2], np.array([0.5]))
    run = simulate(plant, PD(plant.encoder.counts_per_rad), motion, TICK, progress=False)
    assert run.q.shape == (500, 3 if lock_wrist else 6)
    assert run.rms_error_deg().max() < 2.0


def test_encoder_without_gear_or_phase_is_the_default() -> None:
    encoder = Encoder.on_shaft(np.ones(2), np.full(2, 1000.0))
    assert encoder.counts(np.array([np.pi, -np.pi])).tolist() == [500, -500]
