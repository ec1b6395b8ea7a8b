"""The campaign of faults: each does what its name says, and scores say what happened."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from codegen.emit import REPOSITORY
from codegen.status import Status
from plant.closed_loop import NOT_CALLED
from plant.script import Reading, Script
from verification import __main__ as command
from verification.faults import present
from verification.faults.campaign import Result, fly_all
from verification.faults.cases import (
    CASES,
    DEFAULT,
    GUARDS,
    NONE,
    TIGHT,
    WINDUP,
    Attempt,
    Case,
    Ground,
    controller_of,
    events_of,
    ground,
)
from verification.faults.catalogue import BY_NAME, CATALOGUE, TICK_S, Fault, Moment
from verification.faults.fly import REACTION_TICKS, Flown, fly, led_back
from verification.faults.score import nominal, score, try_fault, worst

N = 3
LUGRE, FAST = CASES[1], CASES[3]


@pytest.fixture(scope="module")
def slow() -> Ground:
    """At the paper's speed."""
    return ground(LUGRE)


@pytest.fixture(scope="module")
def fast() -> Ground:
    """Twice as fast."""
    return ground(FAST)


def _flown(there: Ground, fault: str, guard: str = "default", *, replan: bool = True) -> Flown:
    chosen = next(each for each in GUARDS if each.name == guard)
    return fly(there, BY_NAME[fault], chosen, there.attempts[0], replan=replan)


def _step(flown: Flown, there: Ground) -> float:
    limit = there.plant.drive.torque_limit_Nm
    first = there.attempts[0].moment.tick - 1
    return float((np.abs(np.diff(flown.torque_Nm[first:], axis=0)) / limit).max())


# --- The catalogue -----------------------------------------------------------------------------


def _script(there: Ground, fault: Fault, moment: Moment) -> Script:
    return events_of(fault.events(moment))(there.plant, there.trajectory.sampled(TICK_S))


@pytest.mark.parametrize("fault", CATALOGUE, ids=lambda fault: str(fault.name))
def test_a_fault_lasts_as_long_as_it_says(slow: Ground, fault: Fault) -> None:
    moment = slow.attempts[0].moment
    script, plain = _script(slow, fault, moment), _script(slow, BY_NAME["reset"], moment)
    reference = slow.trajectory.sampled(TICK_S)
    told = fault.told(reference, moment)
    other = (
        (script.reading != Reading.COUNTS).any(axis=1)
        | (script.shift_counts != 0).any(axis=1)
        | (script.external_Nm != 0.0).any(axis=1)
        | (script.torque_limit_Nm != plain.torque_limit_Nm).any(axis=1)
        | (script.torque_share != 1.0).any(axis=1)
        | (script.timing != 0)
        | ~script.called
        | (told.position_rad != reference.position_rad).any(axis=1)
        | ~np.isfinite(told.acceleration_rad_per_s2).all(axis=1)
    )
    bodies = np.flatnonzero(np.diff(script.model))
    elsewhere = (script.encoder.offset_counts != 0).any() or fault.reset or fault.whole_run
    if elsewhere:
        assert not other.any()
    elif len(bodies):
        assert bodies.tolist() == [moment.tick - 1]
    else:
        last = len(other) if fault.ticks is None else moment.tick + fault.ticks
        assert np.flatnonzero(other).tolist() == list(range(moment.tick, last))


def test_faults_begin_where_the_reference_is_fastest(fast: Ground) -> None:
    speed = fast.trajectory.sampled(TICK_S).velocity_rad_per_s
    signs = set()
    for attempt in fast.attempts:
        at = speed[attempt.moment.tick]
        np.testing.assert_allclose(np.abs(at), np.abs(speed).max(axis=0), rtol=1e-5)
        assert np.all(np.sign(at) == attempt.moment.direction)
        signs.add(attempt.moment.direction)
    assert signs == {1.0, -1.0}


def test_every_case_flies_faults_that_there_are() -> None:
    assert all(set(case.faults) <= BY_NAME.keys() for case in CASES)
    assert len(BY_NAME) == len(CATALOGUE)
    for case in CASES[:4]:
        assert case.faults == tuple(BY_NAME)


# --- Guards ------------------------------------------------------------------------------------


def test_guards_are_what_the_running_configuration_says(slow: Ground) -> None:
    configs = {guard.name: controller_of(slow, guard).config for guard in GUARDS}
    limits = {name: config.joint[0].max_displacement_change for name, config in configs.items()}
    assert limits == {NONE.name: 2**30 - 1, DEFAULT.name: 40, TIGHT.name: 32, WINDUP.name: 40}
    assert [config.anti_windup for config in configs.values()] == [0, 1, 1, 0]
    assert [config.max_lost_ticks for config in configs.values()] == [1023, 20, 20, 20]
    tripled = controller_of(slow, DEFAULT, 3.0).config.joint[0].inertia_kgm2
    assert tripled == pytest.approx(3 * configs["default"].joint[0].inertia_kgm2)


def test_nan_in_the_reference_costs_its_ticks_alone(slow: Ground) -> None:
    tick = slow.attempts[0].moment.tick
    flown = _flown(slow, "NaN 1")
    assert np.flatnonzero(flown.status).tolist() == [tick]
    assert flown.status[tick] == Status.NOT_FINITE
    np.testing.assert_array_equal(flown.torque_Nm[tick], flown.torque_Nm[tick - 1])
    there = try_fault(slow, BY_NAME["NaN 1"], DEFAULT)
    assert (there.noticed, there.lost_ticks, there.back_s) == (4, 1, 0.0)


@pytest.mark.parametrize("motion", ["slow", "fast"])
def test_a_missed_tick_kicks_only_without_the_guard(
    motion: str, request: pytest.FixtureRequest
) -> None:
    ground = request.getfixturevalue(motion)
    bare, guarded = (_flown(ground, "missed 1", name) for name in ("none", "default"))
    assert _step(bare, ground) > 6 * _step(guarded, ground)
    tick = ground.attempts[0].moment.tick
    assert guarded.status[tick] == NOT_CALLED
    assert np.flatnonzero(guarded.status == Status.ENCODER_JUMP).tolist() == [tick + 1]


def test_from_which_speed_a_missed_tick_is_noticed_is_in_the_safety_page(slow: Ground) -> None:
    joints = controller_of(slow, DEFAULT).config.joint
    counts = np.array([joint.max_displacement_change for joint in joints])
    noticed = counts / np.abs(slow.plant.encoder.counts_per_rad) / TICK_S
    page = (REPOSITORY / "docs/safety.md").read_text()
    assert f"{noticed[0]:.2f} rad/s (waist) and {noticed[1]:.2f} rad/s (shoulder, elbow)" in page
    fastest = np.abs(slow.trajectory.sampled(TICK_S).velocity_rad_per_s).max(axis=0)
    assert np.all(fastest > noticed)


def test_after_a_second_of_saturation_anti_windup_is_back_sooner(slow: Ground) -> None:
    wound, shipped = (
        try_fault(slow, BY_NAME["saturated 1 s"], guard) for guard in (WINDUP, DEFAULT)
    )
    assert shipped.saturated_ticks >= 900
    assert shipped.back_s < 0.7 * wound.back_s
    assert shipped.peak_error_deg < 0.8 * wound.peak_error_deg


# --- The supervisor ----------------------------------------------------------------------------


def test_a_long_dropout_stops_and_is_entered_again(slow: Ground) -> None:
    tick = slow.attempts[0].moment.tick
    flown = _flown(slow, "dropout 50")
    assert np.all(flown.status[tick : tick + 20] == Status.ENCODER_JUMP)
    assert np.all(flown.status[tick + 20 : tick + 52] == Status.STOPPED)
    assert not np.any(flown.torque_Nm[tick + 20 : tick + 52])
    assert flown.entry == tick + 52
    assert np.all(flown.status[tick + 52 :] >= 0)
    bound = 1.5 * np.abs(nominal(slow, slow.attempts[0]).error_rad).max()
    assert np.abs(flown.error_rad[-100:]).max() < bound


def test_a_lasting_stop_is_ended_after_the_reaction(slow: Ground) -> None:
    tick = slow.attempts[0].moment.tick
    flown = _flown(slow, "jump 100000")
    assert flown.entry == tick + 20 + REACTION_TICKS
    away = flown.seen_error_rad[-1] - flown.error_rad[-1]
    jump = 100_000 / slow.plant.encoder.counts_per_rad[1]
    np.testing.assert_allclose(away, [0.0, -jump, 0.0], atol=2e-5)
    assert np.abs(flown.seen_error_rad[-1]).max() < 1e-3


def test_led_back_from_far_away_no_second_of_saturation_is_needed(slow: Ground) -> None:
    """With the encoder's zero 37 deg off, the law alone would run there at full torque."""
    led, left = (
        try_fault(slow, BY_NAME["jump 100000"], DEFAULT, replan=replan) for replan in (True, False)
    )
    assert led.saturated_ticks < 0.3 * left.saturated_ticks


def test_a_reference_is_led_back_from_where_the_robot_is(slow: Ground) -> None:
    reference = slow.trajectory.sampled(TICK_S).rows(1000, 2000)
    rate = np.array([1.5, -0.5, 0.0])
    last = np.array([0.03, -0.2, 0.0])
    back = led_back(reference, np.array([last - rate * TICK_S, last]))
    added = back.position_rad - reference.position_rad
    # From the reading before the first tick on: where the robot is, and how it moves.
    np.testing.assert_allclose(2 * added[0] - added[1], last, atol=2e-5)
    np.testing.assert_allclose((added[1] - added[0]) / TICK_S, rate, atol=5e-3)
    ends = math.ceil(1.875 * 0.2 / TICK_S)
    assert np.abs(added[ends - 10]).max() > 0.0
    np.testing.assert_allclose(added[ends:], 0.0, atol=1e-15)
    for rates, of in (
        (back.velocity_rad_per_s, back.position_rad),
        (back.acceleration_rad_per_s2, back.velocity_rad_per_s),
    ):
        slope = (of[2:] - of[:-2]) / (2 * TICK_S)
        # Where it ends its third derivative steps.
        smooth = np.abs(np.arange(1, len(of) - 1) - ends) > 2
        np.testing.assert_allclose(rates[1:-1][smooth], slope[smooth], atol=2e-3)


def test_a_reset_that_knows_the_torque_has_no_bump(slow: Ground) -> None:
    normal = _step(nominal(slow, slow.attempts[0]), slow)
    assert _step(_flown(slow, "reset"), slow) < 1.5 * normal
    assert _step(_flown(slow, "reset from zero"), slow) > 3 * normal


# --- Scores ------------------------------------------------------------------------------------


def test_the_controllers_error_is_that_of_the_encoders(slow: Ground) -> None:
    for fault in ("NaN 1", "wrap"):
        flown = _flown(slow, fault)
        resolution = slow.plant.encoder.resolution_rad
        apart = np.abs(flown.seen_error_rad - flown.error_rad)
        assert np.all(apart <= 1.5 * resolution)


def _made(errors: list[float], status: list[int], torque: list[float]) -> Flown:
    column = np.outer(np.array(errors), [1.0, 0.0, 0.0])
    return Flown(column, column / 2, np.outer(torque, np.ones(N)), np.array(status))


def test_a_score_says_what_happened(slow: Ground) -> None:
    plain = _made([0.01] * 8, [0] * 8, [1.0] * 8)
    flown = _made(
        [9.0, 0.01, 0.02, 0.5, 0.04, 0.03, 0.015, 0.01],
        [-4, 0, NOT_CALLED, 0, -4, 1, 0, 0],
        [50.0, 1.0, 1.0, 1.0, 5.0, -15.0, 1.0, 1.0],
    )
    fault = replace(BY_NAME["missed 1"], ticks=3)
    limit = slow.plant.drive.torque_limit_Nm.min()
    got = score(slow, fault, Attempt(Moment(2, 1.0), 0.0), flown, plain)
    assert got.noticed == 1
    assert got.statuses == ("ENCODER_JUMP", "SATURATED")
    assert (got.after_ticks, got.lost_ticks, got.saturated_ticks, got.stopped) == (2, 1, 1, 0)
    assert got.peak_torque == pytest.approx(15.0 / limit)
    assert got.peak_torque_step == pytest.approx(20.0 / limit)
    assert got.peak_error_deg == pytest.approx(np.rad2deg(0.5))
    # The fault is over at tick 5; its error, and only its, is beyond 1.5 x 0.01.
    assert got.back_s == pytest.approx(1 * TICK_S)
    late = score(slow, replace(fault, ticks=1), Attempt(Moment(1, 1.0), 0.0), flown, plain)
    assert (late.noticed, late.after_ticks) == (0, 3)
    lasting = _made([0.01] * 7 + [0.02], [0] * 8, [1.0] * 8)
    never = score(slow, fault, Attempt(Moment(2, 1.0), 0.0), lasting, plain)
    assert (never.noticed, never.after_ticks, never.back_s) == (0, None, math.inf)


def test_the_worst_of_scores_is_the_worst_of_each_figure(slow: Ground) -> None:
    plain = try_fault(slow, BY_NAME["wrap"], DEFAULT)
    other = replace(plain, noticed=1, attempts=1, statuses=("STOPPED",), after_ticks=7, back_s=9.0)
    both = worst([replace(plain, attempts=1, peak_error_deg=5.0), other])
    assert (both.noticed, both.attempts, both.after_ticks) == (1, 2, 7)
    assert (both.peak_error_deg, both.back_s, both.statuses) == (5.0, 9.0, ("STOPPED",))


# --- The command -------------------------------------------------------------------------------


SMALL: Case = replace(FAST, faults=("missed 1", "jump 500", "wrap"))


@pytest.fixture(scope="module")
def result() -> Result:
    return fly_all([SMALL], processes=1)


def test_the_table_is_complete(result: Result) -> None:
    (standing,) = result.standings
    assert [line.fault for line in standing.lines] == list(SMALL.faults)
    for line in standing.lines:
        assert line.scores.keys() == {guard.name for guard in GUARDS}
        row = present.cells(line)
        assert len(row) == len(present.COLUMNS)
        assert all(len(cell.split()) == len(present.SIDE_BY_SIDE) for cell in row[3:])
    for table in present.tables_of(standing):
        assert table.row_count == len(SMALL.faults)
    cells = {line.fault: present.cells(line) for line in standing.lines}
    assert cells["wrap"][1] == "none"
    assert cells["missed 1"][1:3] == ("jump 1", "1")
    # The encoder's zero is off for good.
    assert cells["jump 500"][-1].startswith("(")


def test_sentences_tell_what_a_guard_is_worth(result: Result) -> None:
    told = present.findings(result)
    smaller = "Guards as shipped beside none: torque step so many times smaller: missed 1"
    assert any(smaller in sentence for sentence in told)
    assert "No status tells of it in every run: wrap." in told
    (standing,) = result.standings
    other = replace(
        standing,
        lines=tuple(
            replace(line, scores=dict.fromkeys(line.scores, line.scores["default"]))
            for line in standing.lines
        ),
    )
    both = present.findings(replace(result, standings=(standing, other)))
    assert any("missed 1" in sentence and "(1 of 2)" in sentence for sentence in both)


def test_the_picture_is_the_same_every_time(tmp_path: Path) -> None:
    strips = present.STRIPS[:1]
    one, other = (present.draw(tmp_path / f"{k}.svg", LUGRE, strips).read_bytes() for k in (1, 2))
    assert one == other
    assert b"missed 1" in one


def test_the_command_leaves_its_figures(
    result: Result,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("verification.commands.faults.fly_all", lambda *_, **__: result)
    monkeypatch.setattr(present, "draw", lambda: None)
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    assert command.main(["faults", "--plant", "LuGre x2"]) == 0
    assert "missed 1" in capsys.readouterr().out
    assert command.main(["faults", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "faults.json").read_text(encoding="utf-8"))
    assert printed["rows"]["LuGre x2"][0][0] == "missed 1"
    with pytest.raises(SystemExit) as left:
        command.main(["faults", "--plant", "moon"])
    assert left.value.code == 2
