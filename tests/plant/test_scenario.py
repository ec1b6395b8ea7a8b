"""Scenarios: what each event does to a run, by mechanics and by counting."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from codegen.problems import SpecificationError
from plant.assembly import Plant, PlantError, PlantState, at_rest, build_plant
from plant.closed_loop import NOT_CALLED, ControllerOutput, Run, simulate
from plant.encoder import Encoder
from plant.friction import frictionless
from plant.model import gravity_torque
from plant.robot import load_robot
from plant.scenario import Scenario, read_scenario, scenario_names
from plant.script import Counters, Reading, uneventful
from plant.trajectory import Reference, RestToRest

Floats = NDArray[np.float64]
TICK = 1e-3
START = np.deg2rad([0.0, -45.0, 90.0])
NAN = float("nan")


@dataclass
class Constant:
    """Commands the same torque at each call, and remembers the counts."""

    torque: Floats
    seen: list[list[int]] = field(default_factory=list)

    def reset(self, counts: NDArray[np.int32], _: Floats, /) -> int:
        """Remembers the counts, too."""
        self.seen = [counts.tolist()]
        return 0

    def step(self, counts: NDArray[np.int32], *_: Floats) -> ControllerOutput:
        """The torque."""
        self.seen.append(counts.tolist())
        return ControllerOutput(self.torque, 0)


@pytest.fixture(scope="module")
def plant() -> Plant:
    """Without friction, so that what moves it can be counted."""
    return replace(build_plant(load_robot("reference")), friction=frictionless(3))


def _scenario(*events: dict[str, Any]) -> Scenario:
    return Scenario.model_validate({"events": list(events)})


def _run(plant: Plant, ticks: int, *events: dict[str, Any], torque: Floats | None = None) -> Run:
    """So many ticks from rest under the holding torque, or another one."""
    rest = RestToRest(np.array([START, START]), np.array([ticks * TICK]))
    held = gravity_torque(plant.model, START) if torque is None else torque
    return simulate(
        plant, Constant(held), rest, TICK, progress=False, events=_scenario(*events).script
    )


def _reference(positions: Floats) -> Reference:
    time = TICK * np.arange(len(positions), dtype=np.float64)
    return Reference(time, positions, positions, positions)


# --- Bodies ------------------------------------------------------------------------------------


def test_a_payload_pulls_from_its_tick_to_its_end(plant: Plant) -> None:
    load = {"kind": "payload", "at_s": 0.003, "duration_s": 0.002, "mass_kg": 2.0}
    run = _run(plant, 8, load | {"center_of_mass_m": [0.1, 0.0, 0.2]})
    still = plant.model.createData()
    frame = plant.model.getFrameId("link_6")
    pin.framesForwardKinematics(plant.model, still, START)
    pin.computeJointJacobians(plant.model, still, START)
    placed = still.oMf[frame]
    point = placed.act(np.array([0.1, 0.0, 0.2]))
    jacobian = pin.getFrameJacobian(plant.model, still, frame, pin.LOCAL_WORLD_ALIGNED)
    lever = point - placed.translation
    velocity = jacobian[:3] - pin.skew(lever) @ jacobian[3:]
    weight = velocity.T @ np.array([0.0, 0.0, -2.0 * 9.81])
    inertia = pin.crba(plant.model, still, START) + 2.0 * velocity.T @ velocity
    assert np.abs(run.qd[:4]).max() < 1e-12
    falls = np.linalg.solve(inertia, weight)
    np.testing.assert_allclose(run.qd[4], falls * TICK, rtol=1e-3, atol=1e-7)
    np.testing.assert_allclose(run.qd[5], 2 * falls * TICK, rtol=1e-3, atol=1e-7)
    # Without its weight the arm goes on as it moves, held by the same torque.
    np.testing.assert_allclose(run.qd[7], run.qd[5], rtol=2e-3, atol=1e-6)


def test_two_payloads_overlap_and_leave_the_plant_as_it_was(plant: Plant) -> None:
    first = {"kind": "payload", "at_s": 0.0, "duration_s": 0.004, "mass_kg": 1.0}
    second = {"kind": "payload", "at_s": 0.002, "mass_kg": 0.5}
    reference = _reference(np.tile(START, (6, 1)))
    script = _scenario(first, second).script(plant, reference)
    bare = sum(inertia.mass for inertia in plant.model.inertias)
    masses = [sum(x.mass for x in script.models[k].inertias) - bare for k in script.model]
    np.testing.assert_allclose(masses, [1.0, 1.0, 1.5, 1.5, 0.5, 0.5])


def test_a_disturbance_accelerates_as_newton_says(plant: Plant) -> None:
    push = {"kind": "disturbance", "at_s": 0.002, "duration_s": 0.003, "torque_Nm": 4.0}
    run = _run(plant, 8, push | {"joints": [2]})
    data = plant.model.createData()
    acceleration = np.linalg.solve(pin.crba(plant.model, data, START), [0.0, 4.0, 0.0])
    assert np.abs(run.qd[2]).max() < 1e-12
    np.testing.assert_allclose(run.qd[5], 3 * TICK * acceleration, rtol=1e-3, atol=1e-7)
    np.testing.assert_allclose(run.qd[7], run.qd[5], rtol=1e-2, atol=1e-5)


def test_a_sine_begins_with_its_event(plant: Plant) -> None:
    hum = {"kind": "disturbance", "at_s": 0.005, "torque_Nm": 2.0, "frequency_Hz": 50.0}
    script = _scenario(hum, {"kind": "disturbance", "torque_Nm": 1.0}).script(
        plant, _reference(np.tile(START, (40, 1)))
    )
    time = TICK * np.arange(40)
    expected = np.where(time < 0.0049, 0.0, 2.0 * np.sin(2 * np.pi * 50 * (time - 0.005))) + 1.0
    np.testing.assert_allclose(script.external_Nm, np.tile(expected, (3, 1)).T, atol=1e-12)


# --- Drives and timing -------------------------------------------------------------------------


def test_a_weak_drive_gives_its_fraction_and_a_dead_one_nothing(plant: Plant) -> None:
    weak = {"kind": "torque-limit", "at_s": 0.001, "duration_s": 0.001, "factor": 0.25}
    dead = {"kind": "torque-limit", "at_s": 0.002, "duration_s": 0.001, "factor": 0.0}
    run = _run(plant, 4, weak, dead, torque=np.full(3, 1000.0))
    limit = plant.drive.torque_limit_Nm
    np.testing.assert_array_equal(run.torque_applied_Nm, np.outer([1.0, 0.25, 0.0, 1.0], limit))


def test_a_drive_gives_a_share_of_what_it_is_told(plant: Plant) -> None:
    half = {"kind": "torque-share", "at_s": 0.001, "duration_s": 0.002, "share": 0.5}
    again = {"kind": "torque-share", "at_s": 0.002, "share": 0.5, "joints": [2]}
    torque = np.array([1.0, -20.0, 3.0])
    run = _run(plant, 4, half, again, torque=torque)
    share = [[1.0, 1.0, 1.0], [0.5, 0.5, 0.5], [0.5, 0.25, 0.5], [1.0, 0.5, 1.0]]
    np.testing.assert_array_equal(run.torque_applied_Nm, np.array(share) * torque)
    # What is beyond the limit is cut after that.
    limit = plant.drive.torque_limit_Nm
    cut = _run(plant, 2, half, torque=3.0 * limit)
    np.testing.assert_array_equal(cut.torque_applied_Nm, [limit, limit])


def test_a_missed_tick_keeps_the_command(plant: Plant) -> None:
    missed = {"kind": "missed-ticks", "at_s": 0.002, "duration_s": 0.002}
    torque = np.array([1.0, -2.0, 3.0])
    run = _run(plant, 6, missed, torque=torque)
    assert run.status.tolist() == [0, 0, NOT_CALLED, NOT_CALLED, 0, 0]
    np.testing.assert_array_equal(run.torque_applied_Nm, np.tile(torque, (6, 1)))
    assert not run.torque_commanded_Nm[2:4].any()


def test_a_first_tick_that_is_missed_keeps_the_holding_torque(plant: Plant) -> None:
    run = _run(plant, 2, {"kind": "missed-ticks", "duration_s": 0.001}, torque=np.ones(3))
    held = gravity_torque(plant.model, START)
    np.testing.assert_array_equal(run.torque_applied_Nm, [held, np.ones(3)])


def test_a_late_tick_reads_late_and_acts_late(plant: Plant) -> None:
    late = {"kind": "late-ticks", "at_s": 0.002, "duration_s": 0.001, "late": 0.25}
    slow = replace(plant, drive=replace(plant.drive, delay=0.5))
    torque, held = np.array([9.0, -20.0, 3.0]), gravity_torque(plant.model, START)
    run = _run(slow, 4, late, torque=torque)
    np.testing.assert_allclose(run.torque_applied_Nm[0], 0.5 * held + 0.5 * torque)
    np.testing.assert_allclose(run.torque_applied_Nm[2], torque)
    # The reading is that of a quarter of a tick later; the next one is in time.
    fine = _run(replace(plant, encoder=_fine(plant.encoder)), 4, late, torque=torque)
    later = 0.25 * TICK * (fine.qd[2] + fine.qd[3]) / 2
    assert np.abs(later).max() > 1e-5
    seen = fine.q_encoder - fine.q
    np.testing.assert_allclose(seen[2], later, rtol=0.2, atol=1e-7)
    np.testing.assert_allclose(seen[3], 0.0, atol=1e-7)


def _fine(encoder: Encoder) -> Encoder:
    return replace(encoder, counts_per_rad=1e2 * encoder.counts_per_rad)


def test_random_lateness_stays_below_its_bound(plant: Plant) -> None:
    jitter = {"kind": "late-ticks", "late": 0.4, "random": True}
    script = _scenario(jitter).script(plant, _reference(np.tile(START, (500, 1))))
    late = np.array([script.timings[k].late for k in script.timing])
    assert 0.0 <= late.min() < 0.01
    assert 0.39 < late.max() < 0.4
    slow = replace(plant, drive=replace(plant.drive, delay=0.7))
    with pytest.raises(PlantError, match="together they must not take longer"):
        _scenario(jitter).script(slow, _reference(np.tile(START, (5, 1))))


# --- Encoders ----------------------------------------------------------------------------------


def _counted(plant: Plant, counts: list[int], *events: dict[str, Any]) -> list[int]:
    """What the first joint's encoder reads at switch-on, and while it passes through counts."""
    q = np.zeros((len(counts), 3))
    q[:, 0] = (np.array(counts) + 0.5) / plant.encoder.counts_per_rad[0]
    states = [PlantState.as_one(row, np.zeros(3), [0.0] * 3, np.zeros(3)) for row in q]
    counters = Counters(_scenario(*events).script(plant, _reference(q)), states[0])
    readings = [counters.first, *(counters.read(k, state) for k, state in enumerate(states))]
    return [int(reading[0]) for reading in readings]


def _fault(kind: str, **keys: Any) -> dict[str, Any]:
    return {"kind": kind, "at_s": 0.002, "duration_s": 0.002} | keys


COUNTS = [10, 11, 13, 16, 20, 25]


def test_each_fault_of_an_encoder_reads_as_told(plant: Plant) -> None:
    assert _counted(plant, COUNTS) == [10, *COUNTS]
    assert _counted(plant, COUNTS, _fault("encoder-dropout")) == [10, 10, 11, 0, 0, 20, 25]
    assert _counted(plant, COUNTS, _fault("encoder-stuck")) == [10, 10, 11, 11, 11, 20, 25]
    lost = _fault("encoder-lost-pulses")
    assert _counted(plant, COUNTS, lost) == [10, 10, 11, 11, 11, 15, 20]
    jump = _fault("encoder-jump", counts=100)
    assert _counted(plant, COUNTS, jump) == [10, 10, 11, 113, 116, 20, 25]
    garbage = _counted(plant, COUNTS, _fault("encoder-garbage"))
    assert [garbage[k] for k in (0, 1, 2, 5, 6)] == [10, 10, 11, 20, 25]
    assert min(map(abs, garbage[3:5])) > 1e6
    elsewhere = _fault("encoder-stuck", joints=[2, 3])
    assert _counted(plant, COUNTS, elsewhere) == [10, *COUNTS]
    assert _counted(plant, COUNTS, _fault("encoder-stuck", at_s=0.0)) == [
        10,
        10,
        10,
        13,
        16,
        20,
        25,
    ]


def test_a_counter_wraps_where_the_reference_is(plant: Plant) -> None:
    # The reference stands half a count before the encoder's edges, on which it would be undecided.
    readings = _counted(plant, COUNTS, {"kind": "encoder-wrap", "at_s": 0.003, "joints": [1]})
    assert readings[1:] == [2**31 - 6, 2**31 - 5, 2**31 - 3, -(2**31), -(2**31) + 4, -(2**31) + 9]
    negative = _counted(plant, [-x for x in COUNTS], {"kind": "encoder-wrap", "at_s": 0.003})
    assert negative[1:5] == [-(2**31) + 6, -(2**31) + 5, -(2**31) + 3, -(2**31)]


def test_the_loop_does_not_feel_where_its_counter_wraps(plant: Plant) -> None:
    there = [{"kind": "encoder-wrap", "at_s": 0.01}]
    push = {"kind": "disturbance", "torque_Nm": 4.0}
    wrapped, plain = _run(plant, 20, push, *there), _run(plant, 20, push)
    assert np.abs(np.diff(wrapped.counts.astype(np.int64), axis=0)).max() > 2**31
    np.testing.assert_allclose(wrapped.error_rad, plain.error_rad, atol=1e-12)


def test_noise_is_normal_and_its_own_at_each_joint(plant: Plant) -> None:
    noise = {"kind": "encoder-noise", "sigma_counts": 3.0, "seed": 4, "joints": [1, 3]}
    reference = _reference(np.tile(START, (20_000, 1)))
    script = _scenario(noise).script(plant, reference)
    np.testing.assert_allclose(script.noise_counts.std(axis=0), [3.0, 0.0, 3.0], rtol=0.02)
    np.testing.assert_allclose(script.noise_counts.mean(axis=0), 0.0, atol=0.1)
    assert abs(np.mean(script.noise_counts[:, 0] * script.noise_counts[:, 2])) < 0.03 * 9.0
    own = replace(plant, encoder=replace(plant.encoder, noise_counts=np.array([0.5, 0.0, 0.0])))
    script = uneventful(own, reference)
    np.testing.assert_allclose(script.noise_counts.std(axis=0), [0.5, 0.0, 0.0], rtol=0.02)
    counters = Counters(script, at_rest(own, START))
    read = np.array([counters.read(k, at_rest(own, START)) for k in range(200)])
    assert np.ptp(read, axis=0).tolist()[1:] == [0, 0]
    assert np.ptp(read[:, 0]) >= 1


# --- Files -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", scenario_names())
def test_the_scenarios_that_come_along_can_be_read(name: str) -> None:
    assert read_scenario(name).events


def test_events_of_another_time_do_nothing(plant: Plant) -> None:
    late = {"kind": "encoder-stuck", "at_s": 100.0}
    script = _scenario(late).script(plant, _reference(np.tile(START, (5, 1))))
    assert np.all(script.reading == Reading.COUNTS)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("events = 3", "events = 3"),
        ("[[events]]\nkind = 'earthquake'", "events.1"),
        ("[[events]]\nkind = 'payload'", "mass_kg"),
        ("[[events]]\nkind = 'payload'\nmass_kg = -1.0", "mass_kg = -1.0"),
        ("[[events]]\nkind = 'missed-ticks'\njoints = [1]", "joints"),
        ("[[events]]\nkind = 'late-ticks'\nlate = 1.5", "late = 1.5"),
        ("[[events", "valid TOML"),
    ],
)
def test_bad_scenarios_say_what_is_wrong(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpecificationError, match=r"bad\.toml") as error:
        read_scenario(path)
    assert says in str(error.value)


def test_scenarios_that_do_not_fit_say_why(plant: Plant) -> None:
    with pytest.raises(SpecificationError, match="one of bad_day"):
        read_scenario("good_day")
    reference = _reference(np.tile(START, (5, 1)))
    with pytest.raises(PlantError, match="not a joint 4"):
        _scenario({"kind": "encoder-stuck", "joints": [4]}).script(plant, reference)
    with pytest.raises(PlantError, match="no frame 'hand'"):
        _scenario({"kind": "payload", "mass_kg": 1.0, "frame": "hand"}).script(plant, reference)
