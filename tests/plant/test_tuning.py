"""The tuning procedure III-E, the measure of vibration, the optimiser, and what they write."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codegen.controller import load
from plant.__main__ import main
from plant.assembly import build_plant
from plant.campaign.plants import scaled
from plant.robot import load_robot
from plant.tuning import command
from plant.tuning.comparison import Comparison, Flown
from plant.tuning.gains import Gains, TuningError, decimal, rounded
from plant.tuning.optimiser import Score, optimise, score, training
from plant.tuning.procedure import STEPS, VIBRATION_LIMIT, Chosen, Trial, tune
from plant.tuning.rig import Outcome, Rig
from plant.tuning.vibration import vibration
from plant.tuning.writing import tuned_text, write_new

CONTROLLERS = Path(__file__).parents[2] / "controllers"
PUMA3 = CONTROLLERS / "puma3.toml"
PAPER_INERTIA = (0.3818, 0.30545, 0.15296)

TICK_S = 1e-3
COUNT_RAD = 6.4e-6
TIME_S = TICK_S * np.arange(4000)


# --- The measure on synthetic torque ------------------------------------------------------------


def torque_of(position_rad: Any, inertia: float) -> Any:
    """A law that adds Mbar times minus the second difference of the counted position a tick."""
    counted = COUNT_RAD * np.floor(position_rad / COUNT_RAD)
    return np.cumsum(-inertia * np.diff(counted, 2, prepend=[0.0, 0.0]) / TICK_S**2)


def measured(torque_Nm: Any, inertia: float) -> float:
    found = vibration(torque_Nm[:, np.newaxis], np.array([inertia]), np.array([COUNT_RAD]), TICK_S)
    return float(found[0])


# A smooth motion over thousands of counts.
MOTION_RAD = 0.2 * (1.0 - np.cos(2.0 * np.pi * TIME_S / TIME_S[-1]))
# What carries an arm: far more torque than the counts make, far below what can be heard.
TRACKING_NM = 40.0 * np.sin(2.0 * np.pi * 1.0 * TIME_S)


@pytest.mark.parametrize("inertia", [0.02, 0.4, 5.0])
def test_counts_alone_measure_one_at_any_inertia(inertia: float) -> None:
    torque = torque_of(MOTION_RAD, inertia)
    assert measured(torque, inertia) == pytest.approx(1.0, rel=0.1)


def test_torque_that_carries_the_arm_is_no_vibration() -> None:
    # With an Mbar so small that the counts make less of the increments than the motion does.
    assert measured(TRACKING_NM + torque_of(MOTION_RAD, 0.02), 0.02) == pytest.approx(1.0, rel=0.1)


def test_an_oscillation_adds_its_own_power() -> None:
    amplitude, frequency = 5.0, 100.0
    torque = torque_of(MOTION_RAD, 0.4) + amplitude * np.sin(2 * np.pi * frequency * TIME_S)
    # The increments of a sine are one with the amplitude 2 A sin(pi f L).
    power = (2.0 * amplitude * np.sin(np.pi * frequency * TICK_S)) ** 2 / 2.0
    by_counts = (0.4 * COUNT_RAD / TICK_S**2) ** 2 / 2.0
    assert measured(torque, 0.4) == pytest.approx(1.0 + power / by_counts, rel=0.1)
    assert measured(torque, 0.4) > STEPS[0].vibration_limit


# --- The measure in closed loops ----------------------------------------------------------------


@pytest.fixture(scope="module")
def rig() -> Rig:
    """The paper's robot on the reference plant, in a motion of 3 s."""
    robot = load_robot("reference")
    assert robot.trajectory is not None
    return Rig(load(PUMA3), build_plant(robot), scaled(robot.trajectory, 10.0).faster(4.0))


def paper(factor: Fraction = Fraction(1)) -> Gains:
    """The gains of Exp08, with Mbar times a factor."""
    inertia = tuple(factor * rounded(x, 6) for x in PAPER_INERTIA)
    return Gains(inertia, Fraction(20), Fraction(4, 10), Fraction(95, 100))


def test_the_papers_best_gains_are_quiet_and_far_larger_inertia_is_not(rig: Rig) -> None:
    quiet, loud = rig.fly(paper()), rig.fly(paper(Fraction(20)))
    assert quiet.failure is None
    assert quiet.vibration.max() < VIBRATION_LIMIT
    assert loud.vibration.max() > VIBRATION_LIMIT


def test_the_c_is_flown_with_the_gains_that_are_tried(rig: Rig) -> None:
    hsia = rig.fly(Gains(paper().inertia))
    # Table II: 0.0139/0.0377/0.0478 deg against 0.0010/0.0017/0.0017 deg; here a shorter motion.
    assert np.all(hsia.rms_deg > 4.0 * rig.fly(paper()).rms_deg)


def test_relatives_are_other_plants_for_another_seed(rig: Rig) -> None:
    one, again, other = (rig.relatives(seed, 2) for seed in (1, 1, 2))
    outcomes = [rig.fly(paper(), plants[1]).rms_deg for plants in (one, again, other)]
    assert np.array_equal(outcomes[0], outcomes[1])
    assert not np.array_equal(outcomes[0], outcomes[2])
    assert not np.array_equal(outcomes[0], rig.fly(paper(), one[0]).rms_deg)


# --- The procedure on plants that are formulas --------------------------------------------------


def outcome(rms_deg: Any, shaking: Any, failure: str | None = None) -> Outcome:
    return Outcome(np.array(rms_deg), np.array(shaking), np.zeros(len(rms_deg)), failure)


def ideal(gains: Gains) -> Outcome:
    """Two joints: vibration begins at Mbar = 1 and 3, lambda = 50, gamma = 0.44, alpha = 0.853."""
    inertia = np.array([float(x) for x in gains.inertia])
    lambda_, gamma, alpha = float(gains.lambda_), float(gains.gamma), float(gains.alpha)
    error = (1.0 + 1.0 / (1.0 + lambda_)) * (1.0 + gamma) * alpha**5 / inertia
    vibrates = (
        (inertia > np.array([1.0, 3.0])) | (lambda_ > 50.0) | (gamma < 0.44) | (alpha < 0.853)
    )
    return outcome(error, np.where(vibrates, 1e3, 1.0))


def tuned_on(evaluate: Callable[[Gains], Outcome]) -> tuple[list[Chosen], list[Trial]]:
    trials: list[Trial] = []
    return tune([Fraction(1), Fraction(1)], evaluate, trials.append), trials


def test_each_step_ends_where_vibration_begins() -> None:
    chosen, trials = tuned_on(ideal)
    gains = chosen[-1].gains
    first, second = (float(x) for x in gains.inertia)
    assert 0.95 < first <= 1.0
    assert 2.85 < second <= 3.0
    assert float(gains.gamma) == pytest.approx(0.45, abs=0.0125)
    assert float(gains.alpha) == pytest.approx(0.855, abs=0.0025)
    # lambda's error falls by less than 2 % a step long before it vibrates.
    assert 10.0 < gains.lambda_ < 50.0
    assert trials[-1].gains == gains
    assert trials[-1].outcome.vibration.max() == 1.0


def test_steps_come_in_the_papers_order_and_leave_the_others_gains_alone() -> None:
    _, trials = tuned_on(ideal)
    assert sorted({t.step for t in trials}) == [1, 2, 3, 4]
    assert [t.step for t in trials] == sorted(t.step for t in trials)
    for trial in trials:
        gains = trial.gains
        assert trial.step >= 2 or gains.lambda_ == 0
        assert trial.step >= 3 or gains.gamma == 1
        assert trial.step >= 4 or gains.alpha == 1
    assert len({t.gains.inertia for t in trials if t.step > 1}) == 1


def test_a_step_stops_where_the_error_no_longer_falls() -> None:
    def bottom(gains: Gains) -> Outcome:
        inertia = np.array([float(x) for x in gains.inertia])
        return outcome(np.abs(np.log(inertia / [0.5, 2.0])) + 0.1, [1.0, 1.0])

    chosen, trials = tuned_on(bottom)
    assert [float(x) for x in chosen[0].gains.inertia] == pytest.approx([0.5, 2.0], rel=0.1)
    reasons = {v.reason for t in trials for v in t.verdicts if v and not v.good}
    assert reasons == {"the error no longer falls"}
    # Nothing else helps on this plant, so nothing else is changed.
    assert chosen[-1].gains == chosen[0].gains


def test_a_joint_is_not_raised_to_the_cost_of_one_that_has_stopped() -> None:
    def coupled(gains: Gains) -> Outcome:
        first, second = (float(x) for x in gains.inertia)
        # The second joint shakes the first one.
        return outcome([1.0 / first, 1.0 / second], [1.0 + first + 0.2 * second, 1.0])

    chosen, trials = tuned_on(coupled)
    assert chosen[0].outcome.vibration.max() <= STEPS[0].vibration_limit
    first, second = (float(x) for x in chosen[0].gains.inertia)
    assert first + 0.2 * second == pytest.approx(1.0, abs=0.2)
    assert any(v and v.reason.startswith("shakes joint 1") for t in trials for v in t.verdicts)


def test_a_run_that_fails_is_a_bad_value() -> None:
    def fragile(gains: Gains) -> Outcome:
        if max(gains.inertia) > 1:
            return outcome([np.inf, np.inf], [np.inf, np.inf], "the motion became non-finite")
        return ideal(gains)

    chosen, trials = tuned_on(fragile)
    assert 0.9 < float(max(chosen[0].gains.inertia)) <= 1.0
    reasons = {v.reason for t in trials for v in t.verdicts if v and t.outcome.failure}
    assert reasons == {"the motion became non-finite"}


def test_a_plant_that_vibrates_from_the_beginning_is_refused() -> None:
    with pytest.raises(TuningError, match=r"vibrates: 9 > 2 .* smaller inertia_kgm2"):
        tuned_on(lambda _: outcome([1.0, 1.0], [9.0, 1.0]))


# --- The optimiser ------------------------------------------------------------------------------


def smooth(gains: Gains) -> Score:
    """Best where the sum of Mbar is largest, which vibrates from 2 on."""
    total = float(sum(gains.inertia))
    error = (1.0 + (float(gains.gamma) - 0.5) ** 2) / total
    return Score(error, VIBRATION_LIMIT * total / 2.0, 0.0)


def test_the_optimiser_keeps_the_constraint_and_gets_near_the_best() -> None:
    begin = Gains((Fraction(3), Fraction(3)), Fraction(20))
    seen: list[Any] = []
    best = optimise(begin, smooth, 200, 0, seen.append)
    assert len(seen) == 200
    assert best.score.vibration <= VIBRATION_LIMIT
    # Mbar of 2 together and gamma of 0.5 give 1/2.
    assert best.score.error_deg == pytest.approx(0.5, rel=0.02)
    assert best == optimise(begin, smooth, 200, 0, lambda _: None)


def test_the_optimiser_tells_that_nothing_is_quiet() -> None:
    begin = Gains((Fraction(1),), Fraction(20))
    with pytest.raises(TuningError, match="nothing to optimise"):
        optimise(begin, lambda _: Score(1.0, np.inf, 0.0), 100, 0, lambda _: None)


def test_a_score_ends_at_the_first_plant_that_breaks_the_constraint() -> None:
    flown: list[int] = []

    def fly(_: Gains, plant: Any) -> Outcome:
        flown.append(plant)
        return outcome([1.0, 3.0], [plant, 1.0])

    gains = Gains((Fraction(1), Fraction(1)))
    plants: list[Any] = [5.0, 4.0]
    assert score(gains, fly, plants) == Score(2.0, 5.0, 0.0)
    plants = [4.0, 6.0, 1.0]
    flown.clear()
    assert score(gains, fly, plants) == Score(np.inf, 6.0, 0.0)
    assert flown == [4.0, 6.0]
    plants = [3.0, 1.0, 5.0, 2.0, 4.0]
    stand_for_all: list[Any] = [*training(gains, fly, plants, 3)]
    assert stand_for_all == [5.0, 3.0, 1.0]


def test_the_comparison_counts_what_it_says() -> None:
    # The last plant is a tie: it is won by none.
    errors = [[1.0, 2.0, np.inf, 3.0], [2.0, 1.0, 5.0, 3.0]]
    shaking = [[1.0, 4.0, 9.0, 1.0], [1.0, 1.0, 1.0, 6.0]]
    flown = [Flown(*map(np.array, pair)) for pair in zip(errors, shaking, strict=True)]
    figures = Comparison(*flown).figures()
    assert figures["share_won"] == pytest.approx(2 / 4)
    assert figures["both_quiet"] == 2
    assert figures["share_won_both_quiet"] == pytest.approx(1 / 2)
    assert figures["mean_ratio_both_quiet"] == pytest.approx(1.0)
    assert (figures["procedure"]["quiet"], figures["optimiser"]["quiet"]) == (3, 3)
    assert figures["procedure"]["largest_rms_deg"] is None


# --- What is written ----------------------------------------------------------------------------

TUNED = Gains(
    (Fraction(1, 2), Fraction("0.25"), Fraction("0.125")),
    Fraction(180),
    Fraction("0.9"),
    Fraction("0.97"),
)
LINEAR = replace(TUNED, lambda_=Fraction(0), gamma=Fraction(1), alpha=Fraction(1))


@pytest.mark.parametrize("gains", [TUNED, LINEAR])
@pytest.mark.parametrize("name", ["puma3", "puma3_fixed", "puma3_float64", "puma3_precise"])
def test_the_written_specification_is_the_old_one_with_other_gains(
    name: str, gains: Gains, tmp_path: Path
) -> None:
    path = CONTROLLERS / f"{name}.toml"
    before = path.read_text(encoding="utf-8")
    written = tmp_path / "tuned.toml"
    write_new(written, tuned_text(before, gains, load(path), "by a test"))
    assert load(written) == gains.of(load(path))
    after = written.read_text(encoding="utf-8")
    comments = [line.partition("#")[2].strip() for line in before.splitlines() if "#" in line]
    assert [comment for comment in comments if comment not in after] == []
    section = after.index("[safety]")
    assert after[section:] == before[before.index("[safety]") :]


def test_lists_over_lines_and_comments_with_signs_are_changed_alone() -> None:
    text = PUMA3.read_text(encoding="utf-8").replace(
        'preset = "enhanced" #',
        'inertia_kgm2 = [\n  0.4, # "first" = 1\n  0.3,\n  0.2,\n]\npreset = "enhanced" # = #',
    )
    written = tuned_text(text, TUNED, load(PUMA3), "by a test")
    assert "inertia_kgm2 = [0.5, 0.25, 0.125] # tuned\n" in written
    assert 'preset = "enhanced" # = # KD = 20, KP = 100, lambda = 20\n' in written
    assert 'alpha = 0.97 # tuned, was "95/100"\n' in written


def test_a_law_in_one_line_is_refused() -> None:
    with pytest.raises(TuningError, match=r"without a table \[law\]"):
        tuned_text('law = { preset = "enhanced" }\n', TUNED, load(PUMA3), "by a test")


def test_no_file_is_overwritten(tmp_path: Path) -> None:
    there = tmp_path / "mine.toml"
    there.write_text("mine", encoding="utf-8")
    with pytest.raises(TuningError, match="is there already"):
        write_new(there, "other")
    assert there.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(("value", "text"), [("0.3818", "0.3818"), ("1/3", '"1/3"'), ("20", "20")])
def test_numbers_are_written_exactly(value: str, text: str) -> None:
    assert decimal(Fraction(value)) == text


# --- The commands -------------------------------------------------------------------------------


def test_tune_writes_a_specification_that_flies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "FOLDER", tmp_path / "tuning")
    output = tmp_path / "tuned.toml"
    words = ["tune", str(PUMA3), "--robot", "reference", "--speed", "1.5", "--json"]
    assert main([*words, "--output", str(output)]) == 0
    figures = json.loads(capsys.readouterr().out)
    last = figures["steps"][-1]
    assert max(last["vibration"]) <= last["vibration_limit"] == 5.0
    assert figures["trials"][-1]["gains"] == figures["tuned"]
    files = {path.name for path in (tmp_path / "tuning" / "puma3_on_reference").iterdir()}
    pictures = {f"tune-step-{s.number}-{s.symbol}.svg" for s in STEPS}
    assert files == pictures | {"tune.json", "tune.log"}
    fly = ["simulate", str(output), "--speed", "1.5", "--backend", "compiled", "--json"]
    assert main(fly) == 0
    assert json.loads(capsys.readouterr().out)["rms_deg"] == pytest.approx(last["rms_deg"])
    # It isn't overwritten, and that is told before anything is flown.
    assert main([*words, "--output", str(output)]) == 2
    assert "is there already" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words", [["puma3_fixed"], ["puma3", "--output", "controllers/puma3.toml"]]
)
def test_what_cannot_be_tuned_is_refused_in_a_line(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(CONTROLLERS.parent)
    assert main(["tune", str(CONTROLLERS / f"{words[0]}.toml"), *words[1:]]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ")
    assert told.count("\n") == 1


def test_autotune_compares_on_other_plants(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "FOLDER", tmp_path)
    monkeypatch.setattr(command, "DRAWN", 4)
    words = ["autotune", str(PUMA3), "--robot", "reference", "--speed", "1.5", "--plants", "2"]
    words += ["--held-out", "2", "--evaluations", "30", "--json"]
    assert main(words) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["training"]["vibration"] <= VIBRATION_LIMIT
    assert figures["held_out"]["hardest"]["plants"] == 2
    written = load(Path(figures["output"]))
    tuned = figures["gains"]["optimiser"]["inertia_kgm2"]
    assert [float(joint.inertia) for joint in written.joints] == tuned


def test_an_interruption_writes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*_: object) -> Outcome:
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "FOLDER", tmp_path / "tuning")
    monkeypatch.setattr(Rig, "fly", interrupt)
    output = tmp_path / "tuned.toml"
    with pytest.raises(SystemExit) as left:
        main(["tune", str(PUMA3), "--robot", "reference", "--output", str(output)])
    assert left.value.code == 130
    assert "no specification was written" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
