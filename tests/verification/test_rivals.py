"""The rivals are what their names say, they are tuned alike, and the comparison is complete."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from plant.assembly import at_rest
from plant.closed_loop import Beginning, Run, beginning
from plant.compiled.loop import CompiledLoop
from plant.friction import frictionless
from plant.scenario import DisturbanceEvent, Scenario
from plant.trajectory import RestToRest
from verification import __main__ as command
from verification.rivals import compare, present
from verification.rivals.contenders import BY_NAME, CONTENDERS, Contender, Entry
from verification.rivals.laws import Answer, Law, computed_torque, integral_sliding_mode, pid
from verification.rivals.model import SIGN_WIDTH_RAD_PER_S, model_of, random_signs, uniform
from verification.rivals.source import Rival, write_sources
from verification.rivals.trials import HELD_OUT, TUNED_ON, Ground, ground
from verification.rivals.tuning import Effort, cost, gains_of, roughness, tune

Floats = NDArray[np.float64]

L = 0.001
N = 3


@pytest.fixture(scope="module")
def home() -> Ground:
    """The plant that all are tuned on, for half a second."""
    return ground(TUNED_ON, phases=2, seconds=0.5)


@pytest.fixture(scope="module")
def smooth(home: Ground) -> Ground:
    """The same without friction."""
    return replace(home, plant=replace(home.plant, friction=frictionless(N)))


def rival(law: Law, on: Ground) -> tuple[Rival, CompiledLoop]:
    # Tests at the same time write other laws under the same name.
    folder = f"test-{os.getpid()}"
    loop = CompiledLoop(on.plant, on.specification, write_sources(law, on.specification, folder))
    return Rival(law, loop), loop


def all_joints(**gains: float) -> dict[str, Floats]:
    return {name: np.full(N, value) for name, value in gains.items()}


# --- Each law's C beside a second implementation -----------------------------------------------


def exact(on: Ground, **parts: bool) -> Law:
    return computed_torque(model_of(on.plant, uniform(0.0)), **parts)


GAINS: dict[str, dict[str, Any]] = {
    "pid": {"damping": [90.0, 80.0, 30.0], "kp": 40.0, "ki": 300.0},
    "integral_sliding_mode": {
        "inertia": [2.0, 3.0, 0.5],
        "kd": 20.0,
        "kp": 100.0,
        "reaching": 5.0,
        "layer": 0.3,
    },
    "computed_torque": {"kd": 20.0, "kp": 100.0},
    "computed_torque_friction_integral": {"kd": 20.0, "kp": 100.0, "ki": 200.0},
}

Told = tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats]
"""q, qd, e, ed, qd_d, qdd_d and the integral of e so far."""


def pid_again(g: Mapping[str, Floats], t: Told) -> Floats:
    _, _, e, ed, _, _, integral = t
    return g["damping"] * ed + g["damping"] * g["kp"] * e + g["damping"] * g["ki"] * integral


def sliding_again(g: Mapping[str, Floats], t: Told) -> Floats:
    _, _, e, ed, _, qdd_d, integral = t
    # The integral of ed is e, but for its start: s by its parts, both integrals apart.
    s = ed + g["kd"] * sliding_again.of_rate + g["kp"] * integral  # type: ignore[attr-defined]
    switched = np.clip(s / g["layer"], -1, 1)
    out: Floats = g["inertia"] * (qdd_d + g["kd"] * ed + g["kp"] * e + g["reaching"] * switched)
    return out


def computed_again(model: pin.Model, friction: bool) -> Callable[..., Floats]:
    """By Pinocchio, whose algorithms aren't those of the law."""
    data = model.createData()

    def torque(g: Mapping[str, Floats], t: Told) -> Floats:
        q, qd, e, ed, qd_d, qdd_d, integral = t
        asked = qdd_d + g["kd"] * ed + g["kp"] * e + g.get("ki", np.zeros(N)) * integral
        level = [6.0, 12.0, 8.0] * np.tanh(qd_d / SIGN_WIDTH_RAD_PER_S) + [5.0, 5.0, 3.0] * qd_d
        out: Floats = pin.rnea(model, data, q, qd, asked) + (level if friction else 0.0)
        return out

    return torque


def worst_deviation(law: Law, on: Ground, again: Callable[..., Floats]) -> float:
    """The C told random counts and references, beside plain numpy [N m]."""
    made, _ = rival(law, on)
    gains = {name: np.broadcast_to(value, (N,)) for name, value in GAINS[law.name].items()}
    made.tune(gains)
    for joint in made.config.joint:
        joint.torque_limit_Nm = 1e9
    random = np.random.default_rng(3)
    per_rad = on.plant.encoder.counts_per_rad
    counts = on.plant.encoder.counts(on.begins[0][1].state.q)
    holding = np.array([1.0, -30.0, 4.0])
    assert made.reset(counts, holding) == 0
    rest = np.zeros(N)
    standing = again(gains, (counts / per_rad, rest, rest, rest, rest, rest, rest)) * (
        law.name.startswith("computed")
    )
    of_error, of_rate, worst = np.zeros(N), np.zeros(N), 0.0
    for _ in range(50):
        moved = random.integers(-300, 300, N)
        counts = (counts + moved).astype(np.int32)
        q, qd = counts / per_rad, moved / per_rad / L
        # References on the grid of 1/256 count, so that nothing is rounded.
        e = np.rint(random.normal(0.0, 1e4, N)) / 256.0 / per_rad
        qd_d, qdd_d = random.normal(0.0, 0.3, N), random.normal(0.0, 1.0, N)
        ed = qd_d - qd
        sliding_again.of_rate = of_rate  # type: ignore[attr-defined]
        asked = again(gains, (q, qd, e, ed, qd_d, qdd_d, of_error)) + holding - standing
        told = made.step(counts, q + e, qd_d, qdd_d)
        assert told.status == 0
        worst = max(worst, float(np.abs(told.torque_Nm - asked).max()))
        of_error, of_rate = of_error + L * e, of_rate + L * ed
    return worst


def again_of(law: Law, on: Ground) -> Callable[..., Floats]:
    if law.name == "pid":
        return pid_again
    if law.name == "integral_sliding_mode":
        return sliding_again
    return computed_again(on.plant.model, "friction" in law.name)


@pytest.mark.parametrize("name", GAINS)
def test_the_c_is_the_law(home: Ground, name: str) -> None:
    law = {
        "pid": pid(),
        "integral_sliding_mode": integral_sliding_mode(),
        "computed_torque": exact(home),
        "computed_torque_friction_integral": exact(home, friction=True, integral=True),
    }[name]
    assert law.name == name
    assert worst_deviation(law, home, again_of(law, home)) < 1e-7


def test_a_wrong_sign_is_found(home: Ground) -> None:
    right = pid()

    def answer(now: Any, gain: Any) -> Answer:
        return right.answer(replace(now, error=-now.error), gain)

    wrong = replace(right, answer=answer)
    assert worst_deviation(wrong, home, pid_again) > 1.0


# --- What theory says of the loop --------------------------------------------------------------


def flown(law: Law, gains: Mapping[str, Floats], on: Ground, begin: Beginning) -> tuple[Run, Rival]:
    made, loop = rival(law, on)
    made.tune(gains)
    return loop.run(on.plant, made, begin, L), made


def standing_still(on: Ground, seconds: float, *events: DisturbanceEvent) -> Beginning:
    start = on.begins[0][1].state.q
    still = RestToRest(np.array([start, start]), np.array([seconds]))
    return beginning(on.plant, still, L, Scenario(events=list(events)).script)


def test_computed_torque_with_the_exact_model_has_linear_error_dynamics(smooth: Ground) -> None:
    """From e(0) with kd = 2 w, kp = w^2: e = e(0) (1 + w t) exp(-w t), on a moving reference."""
    w, first = 15.0, np.array([0.02, -0.01, 0.015])
    begin = ground(TUNED_ON, seconds=0.5).begins[0][1]
    away = replace(begin, state=at_rest(smooth.plant, begin.state.q - first))
    run, _ = flown(exact(smooth), all_joints(kd=2 * w, kp=w * w), smooth, away)
    t = run.time_s[:, np.newaxis]
    expected = first * (1 + w * t) * np.exp(-w * t)
    assert np.abs(run.true_error_rad - expected).max() < 0.02 * np.abs(first).max()


@pytest.mark.parametrize("ki", [0.0, 500.0])
def test_the_integral_of_pid_removes_a_constant_disturbance(smooth: Ground, ki: float) -> None:
    """Without it the error is d/(K kp), with it nothing but the encoder's count."""
    push = DisturbanceEvent(kind="disturbance", torque_Nm=5.0)
    gains = all_joints(damping=100.0, kp=50.0, ki=ki)
    run, _ = flown(pid(), gains, smooth, standing_still(smooth, 2.0, push))
    left = np.mean(run.true_error_rad[-200:], axis=0)
    if ki:
        assert np.abs(left).max() < 2 * smooth.plant.encoder.resolution_rad[0]
    else:
        assert left == pytest.approx(np.full(N, -5.0 / (100.0 * 50.0)), rel=0.02)


def test_sliding_mode_goes_to_its_layer_and_holds_a_disturbance_there(smooth: Ground) -> None:
    """At rest J K s/phi = -d with |s| < phi, and the error is 0, because s doesn't change."""
    push = DisturbanceEvent(kind="disturbance", torque_Nm=5.0)
    gains = all_joints(inertia=3.0, kd=30.0, kp=200.0, reaching=20.0, layer=0.5)
    begin = standing_still(smooth, 3.0, push)
    run, made = flown(integral_sliding_mode(), gains, smooth, begin)
    assert np.abs(run.true_error_rad[-200:]).max() < 2 * smooth.plant.encoder.resolution_rad[0]
    s = np.array(made.state.integral)
    assert s == pytest.approx(np.full(N, -0.5 * 5.0 / (3.0 * 20.0)), rel=0.02)
    assert np.abs(s).max() < 0.5


@pytest.mark.parametrize("name", [c.name for c in CONTENDERS if c.law is not None])
def test_everyone_begins_with_the_holding_torque(home: Ground, name: str) -> None:
    contender = BY_NAME[name]
    assert contender.law is not None
    made, _ = rival(contender.law(home.plant), home)
    made.tune(gains_of(contender.knobs, np.full(contender.parameters(N), 0.5), N))
    counts = home.plant.encoder.counts(home.begins[0][1].state.q)
    holding = np.array([0.5, -33.0, -6.0])
    made.reset(counts, holding)
    still = np.zeros(N)
    told = made.step(counts, counts / home.plant.encoder.counts_per_rad, still, still)
    assert told.torque_Nm == pytest.approx(holding, abs=1e-9)


def test_an_integral_stops_at_the_limit_and_comes_back(home: Ground) -> None:
    made, _ = rival(pid(), home)
    made.tune(all_joints(damping=100.0, kp=50.0, ki=1000.0))
    counts, still = np.zeros(N, dtype=np.int32), np.zeros(N)
    limit = np.array([float(j.torque_limit) for j in home.specification.joints])
    made.reset(counts, still)
    for _ in range(100):
        told = made.step(counts, np.full(N, 0.1), still, still)
    assert told.torque_Nm == pytest.approx(limit)
    assert told.status == 1
    assert list(made.state.integral) == [0.0] * N
    told = made.step(counts, np.full(N, -1e-4), still, still)
    assert told.status == 0
    assert all(x < 0.0 for x in made.state.integral)


# --- The model and its errors ------------------------------------------------------------------


def test_every_number_of_the_model_is_20_percent_off(home: Ground) -> None:
    def numbers(factors: Any) -> Floats:
        model = model_of(home.plant, factors)
        bodies = [
            np.array(ca.evalf(ca.SX(part))).ravel()
            for mass in model.masses
            for part in (mass.mass, mass.first_moment, mass.inertia)
        ]
        f = model.friction
        levels = (f.positive_Nm, f.negative_Nm, f.viscous_Nms_per_rad)
        return np.concatenate([*bodies, model.armature, *levels])

    right = numbers(uniform(0.0))
    there = right != 0.0
    assert numbers(uniform(0.2))[there] / right[there] == pytest.approx(1.2)
    mixed = numbers(random_signs(0.2, 1))[there] / right[there]
    assert np.abs(mixed - 1.0) == pytest.approx(np.full(len(mixed), 0.2))
    assert 0.2 < np.mean(mixed > 1.0) < 0.8


# --- Tuning ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["pid", "hsia", "inclusive"])
def test_effort_is_equal_and_the_bound_is_kept(home: Ground, name: str) -> None:
    entry, bound, effort = Entry(BY_NAME[name], home), 1 / 8, Effort(8, 5)
    seen: list[int] = []
    found = tune(entry, bound, effort, seen.append)
    assert found.runs == len(seen) == effort.runs
    run = entry.fly(found.gains)
    assert np.log(np.exp(np.mean(np.log(run.rms_error_deg())))) == pytest.approx(found.cost)
    assert roughness(run, home.plant.drive.torque_limit_Nm) <= bound


def test_a_rough_run_is_worse_than_a_bad_one_and_a_lost_one_worse_than_both(home: Ground) -> None:
    entry = Entry(BY_NAME["pid"], home)
    soft, hard = all_joints(damping=5.0, kp=5.0, ki=1.0), all_joints(damping=900.0, kp=90.0, ki=1.0)
    bad, rough = cost(entry, soft, 1 / 32), cost(entry, hard, 1 / 256)
    # Positive feedback leaves any posture.
    gone = cost(entry, all_joints(damping=-500.0, kp=50.0, ki=0.0), 1 / 32)
    assert bad < 100.0 < rough < 200.0 < gone


def test_gains_span_their_boxes() -> None:
    knobs = BY_NAME["inclusive"].knobs
    count = BY_NAME["inclusive"].parameters(N)
    for end, at in (("low", 0.0), ("high", 1.0)):
        gains = gains_of(knobs, np.full(count, at), N)
        assert all(gains[k.name] == pytest.approx(np.full(N, getattr(k, end))) for k in knobs)
    middle = gains_of(knobs, np.full(count, 0.5), N)
    assert middle["inertia"] == pytest.approx(np.full(N, np.sqrt(0.02 * 20.0)))
    assert middle["alpha"] == pytest.approx(np.full(N, 0.9))


def test_the_shipped_c_flies_with_the_gains_of_the_special_case(home: Ground) -> None:
    gains = all_joints(inertia=0.3, kd=20.0, kp=100.0)
    joint = Entry(BY_NAME["hsia"], home)._tuned(gains).joints[1]
    assert [float(x) for x in (joint.inertia, joint.kd, joint.kp)] == [0.3, 20.0, 100.0]
    assert [float(x) for x in (joint.lambda_, joint.alpha, joint.beta)] == [0.0, 1.0, 1.0]
    ours = {**gains, **all_joints(alpha=0.8, gamma=0.4)} | {"lambda": np.full(N, 7.0)}
    joint = Entry(BY_NAME["inclusive"], home)._tuned(ours).joints[0]
    assert float(joint.beta) == pytest.approx(0.8 / 1.2)
    assert [float(x) for x in (joint.lambda_, joint.gamma)] == [7.0, 0.4]


# --- The comparison ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def result() -> compare.Result:
    rules = compare.Rules(
        trials=(TUNED_ON, HELD_OUT[0]), effort=Effort(6, 2), phases=2, seconds=0.3
    )
    return compare.compare(rules, ("pid", "inclusive_exp08", "inclusive"), processes=1)


def test_the_comparison_is_complete(result: compare.Result) -> None:
    data = json.loads(json.dumps(present.figures(result)))
    assert data["evidence"] == "measured"
    assert [s["contest"]["name"] for s in data["standings"]] == ["rough", "quiet"]
    for standing in data["standings"]:
        assert [line["name"] for line in standing["lines"]] == [
            "pid",
            "inclusive_exp08",
            "inclusive",
        ]
        assert [line["parameters"] for line in standing["lines"]] == [5, 0, 8]
        for line in standing["lines"]:
            assert [score["trial"] for score in line["scores"]] == ["tuned on", "+50 %"]
            assert all(len(score["rms_deg"]) == N for score in line["scores"])
            assert line["runs"] in (0, 12)


def test_every_contender_and_trial_that_was_asked_for_takes_part() -> None:
    assert [c.name for c in CONTENDERS] == list(present._MARKS)
    assert [c.parameters(N) for c in CONTENDERS] == [5, 7, 2, 2, 3, 3, 5, 0, 8]
    changed = {t.name: (t.robot, t.speed, t.delay, len(t.events)) for t in compare.TRIALS}
    assert changed == {
        "tuned on": ("reference", 1.0, 0.0, 0),
        "+50 %": ("reference", 1.5, 0.0, 0),
        "1 kg": ("reference", 1.0, 0.0, 1),
        "noise": ("reference", 1.0, 0.0, 1),
        "0.3 L": ("reference", 1.0, 0.3, 0),
        "flexible": ("reference_flexible", 1.0, 0.0, 0),
        "PUMA 560": ("puma560", 1.0, 0.0, 0),
    }


def test_sentences_tell_who_wins_and_who_is_lost(result: compare.Result) -> None:
    def line(name: str, error: float, lost: int = 0) -> compare.Line:
        rms = (error,) * N
        score = compare.Score("tuned on", lost, rms, error, rms, rms, 0.01)
        contender: Contender = BY_NAME[name]
        return compare.Line(name, contender.label, "none", 5, 1, {}, (score,), True)

    def told(*lines: compare.Line) -> str:
        standing = compare.Standing(compare.CONTESTS[0], lines)
        return " ".join(present.findings(replace(result, standings=(standing,))))

    assert "loses to 1 of 2; PID is best, ours has 2.00" in told(
        line("pid", 1.0), line("hsia", 3.0), line("inclusive", 2.0)
    )
    assert "is best; next is Hsia's TDC with 1.50" in told(
        line("hsia", 3.0), line("inclusive", 2.0)
    )
    assert "PID is lost on tuned on" in told(line("pid", 9.0, 1), line("inclusive", 2.0))
    assert "ours, tuned is lost; others that are not: 1." in told(
        line("pid", 9.0), line("inclusive", 2.0, 3)
    )


def test_the_picture_is_the_same_every_time(result: compare.Result, tmp_path: Path) -> None:
    one, other = (present.draw(result, tmp_path / f"{k}.svg").read_bytes() for k in (1, 2))
    assert one == other
    assert b"PID" in one


def test_the_command_leaves_its_figures(
    result: compare.Result,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(present, "compare", lambda *_, **__: result)
    monkeypatch.setattr(present, "PICTURE", tmp_path / "rivals.svg")
    monkeypatch.setattr(present, "draw", lambda _: None)
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    assert command.main(["rivals"]) == 0
    assert "ours, tuned" in capsys.readouterr().out
    assert command.main(["rivals", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "rivals.json").read_text(encoding="utf-8"))
    assert printed["findings"]


def test_a_bad_number_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        command.main(["rivals", "--generations", "none"])
    assert left.value.code == 2
    assert "a number from 1 to 10^6, not 'none'" in capsys.readouterr().err
