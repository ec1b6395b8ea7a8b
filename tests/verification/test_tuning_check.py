"""Verdicts on gain sets whose truth is known, and the page that tells them."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codegen.controller import Controller, load, read, resolve
from codegen.emit import REPOSITORY
from plant.assembly import PlantError, build_plant
from plant.closed_loop import beginning
from plant.compiled.loop import CompiledLoop
from plant.model import build_model
from plant.robot import Robot, load_robot
from verification.__main__ import main
from verification.energy.audit import audit
from verification.energy.recording import gains_of, record
from verification.error_bound import error_bound
from verification.evidence import Evidence
from verification.sampled_stability.loop import Loop
from verification.tuning_check import check as checking
from verification.tuning_check import joint as of_joints
from verification.tuning_check.change import mbar_factor
from verification.tuning_check.check import TuningCheck, of_specification, on_plant
from verification.tuning_check.flight import Course
from verification.tuning_check.joint import Floats, Noise, Timing, specified
from verification.tuning_check.page import render
from verification.tuning_check.present import figures, headline, summary
from verification.tuning_check.robot import Eigenvalues, eigenvalues
from verification.tuning_check.verdict import LEAST_MARGIN, Severity, of_gains, worst
from verification.workspace.certify import WorkspaceError

CONTROLLERS = REPOSITORY / "controllers"
PUMA3 = CONTROLLERS / "puma3.toml"
MBAR = (0.3818, 0.30545, 0.15296)


def gain_set(*, mbar: float = 1.0, sample_time_s: str | None = None, **law: Any) -> Controller:
    """puma3 with other gains; ``lambda_`` is lambda, ``mbar`` multiplies its Mbar."""
    data = read(PUMA3)
    linear = law.pop("linear", False)
    gains: dict[str, Any] = {"kd": 20, "kp": 100, "lambda": 20}
    gains |= {"alpha": 1, "beta": 1, "gamma": 1} if linear else {"gamma": "0.4", "alpha": "0.95"}
    gains.setdefault("beta", "finite-time")
    gains["inertia_kgm2"] = [f"{mbar * x:.6f}" for x in MBAR]
    gains |= {"lambda" if key == "lambda_" else key: value for key, value in law.items()}
    data["law"] = gains
    if sample_time_s is not None:
        data["sample_time_s"] = sample_time_s
    return resolve(data)


@pytest.fixture(scope="module")
def rigid() -> Robot:
    return load_robot("reference")


@pytest.fixture
def no_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bounds of |e| take seconds and no part in a verdict."""
    monkeypatch.setattr(checking, "error_bound", lambda *_, **__: None)


def what(checked: TuningCheck) -> set[str]:
    return {finding.what for joint in checked.joints for finding in joint.findings}


# --- The specification alone -------------------------------------------------------------------


@pytest.mark.parametrize("path", sorted(CONTROLLERS.glob("*.toml")), ids=lambda path: path.stem)
def test_the_shipped_gain_sets_are_safe_by_themselves(path: Path) -> None:
    checked = of_specification(load(path), own_resolution=False)
    assert headline(checked) == "safe, as far as the specification alone says"
    for joint in checked.joints:
        dynamics = joint.specified.dynamics
        assert dynamics is not None
        assert dynamics.settling_time_s is not None
        # The quadrature of another program, in the notes on the method.
        assert dynamics.settling_time_s[0] == pytest.approx(2.38598563, abs=1e-8)


def test_kd_25_is_a_node_that_is_at_zero_after_3_7373_s() -> None:
    dynamics = of_specification(gain_set(kd=25)).joints[0].specified.dynamics
    assert dynamics is not None
    assert dynamics.equilibrium is not None
    assert dynamics.settling_time_s is not None
    assert dynamics.equilibrium.value == "node"
    assert dynamics.settling_time_s == pytest.approx((3.7373, 3.7373), abs=5e-5)


@pytest.mark.parametrize(
    ("law", "kind", "severity", "reason"),
    [
        ({}, "finite-time", Severity.SAFE, None),
        ({"beta": "0.95"}, "exponential", Severity.RESERVATION, "not finite-time"),
        ({"linear": True}, "exponential", Severity.SAFE, None),
        ({"linear": True, "lambda_": 0}, "exponential", Severity.SAFE, None),
        (
            {"alpha": "1.2", "beta": "1.2", "gamma": 1},
            "asymptotic",
            Severity.RESERVATION,
            "small errors fade slowly",
        ),
        ({"alpha": "0.9", "beta": "0.3"}, "finite-time", Severity.RESERVATION, "may chatter"),
        ({"kd": 2}, "finite-time", Severity.RESERVATION, "rings"),
        ({"gamma": 0}, "finite-time", Severity.RESERVATION, "may chatter"),
        ({"kp": 0}, None, Severity.UNSAFE, "the error is not brought to zero"),
        ({"kd": 0}, None, Severity.UNSAFE, "the error is not brought to zero"),
        ({"lambda_": 3000}, "finite-time", Severity.UNSAFE, "no Mbar is stable in samples"),
        ({"sample_time_s": "0.0001"}, "finite-time", Severity.UNSAFE, "encoder noise"),
        ({"mbar": 4.0}, "finite-time", Severity.RESERVATION, "encoder noise"),
    ],
)
def test_class_and_verdict_of_a_specification(
    law: dict[str, Any], kind: str | None, severity: Severity, reason: str | None
) -> None:
    checked = of_specification(gain_set(**law), own_resolution=False)
    joint = checked.joints[0]
    assert (joint.specified.dynamics and joint.specified.dynamics.kind.value) == kind
    assert joint.severity is severity
    assert reason in what(checked) if reason else not what(checked)
    assert all(finding.says for finding in joint.findings)


def test_no_mbar_is_stable_at_10_ms_with_a_sample_more() -> None:
    slow = gain_set(sample_time_s="0.01")
    late, prompt = (of_specification(slow, compute_delay=delay) for delay in (1, 0))
    assert what(late) >= {"no Mbar is stable in samples"}
    assert "no Mbar is stable in samples" not in what(prompt)
    (fix,) = {f.fix for j in late.joints for f in j.findings if "no Mbar" in f.what}
    assert fix.startswith("shorten the sample time to 5 ms")
    shorter = of_specification(gain_set(sample_time_s="0.005"), compute_delay=1)
    assert shorter.joints[0].specified.sampled.intervals


def grows(r: float, kd: float, kp: float, lambda_: float, L: float) -> bool:
    """Whether a double integrator under the sampled law swings up, stepped in plain numbers."""
    q, qd, last, before, torque, integral = 1.0, 0.0, 1.0, 1.0, 0.0, 0.0
    largest = []
    for _ in range(8000):
        ed, e = -(q - last) / L, -q
        s = ed + integral
        u = kd * ed + kp * e + lambda_ * s - (q - 2 * last + before) / L**2
        torque += r * u
        integral += L * (kd * ed + kp * e)
        before, last = last, q
        q, qd = q + L * qd + L**2 * torque / 2, qd + L * torque
        largest.append(abs(q))
    return max(largest[-500:]) > max(largest[:500])


@pytest.mark.parametrize("steep", [False, True])
def test_the_interval_ends_where_a_loop_of_its_own_swings_up(steep: bool) -> None:
    joint = of_specification(gain_set()).joints[0].specified
    delta, L = 2 * math.pi / (4 * 2048 * 120), 1e-3
    kd, kp, lambda_ = 20.0, 100.0, 20.0
    intervals = joint.sampled.at_one_count if steep else joint.sampled.intervals
    if steep:
        # Chords of sig at one count, by hand.
        kd *= (delta / L) ** (0.95 - 1)
        kp *= delta ** (0.95 / 1.05 - 1)
        lambda_ *= (delta / L) ** (0.4 - 1)
    (interval,) = intervals
    gains = kd, kp, lambda_, L
    assert not grows(0.99 * float(interval.high), *gains)
    assert grows(1.01 * float(interval.high), *gains)
    assert not grows(1.1 * float(interval.low), *gains)
    assert grows(0.9 * float(interval.low), *gains)


def test_noise_is_what_a_quantised_ramp_adds_up_to() -> None:
    joint = of_specification(gain_set()).joints[0].specified
    L, count = 1e-3, joint.resolution_rad
    way = 0.123 + 7.0 * np.cumsum(np.random.default_rng(1).uniform(0.5, 1.5, 200_000))
    error = count * (np.floor(way) - way)
    torque = np.cumsum(MBAR[0] * np.diff(error, n=2) / L**2)
    torque -= torque.mean()
    steps = np.diff(torque)
    noise = joint.noise
    assert np.abs(torque).max() == pytest.approx(noise.worst_Nm, rel=0.02)
    assert torque.std() == pytest.approx(noise.rms_Nm, rel=0.02)
    assert np.abs(steps).max() <= noise.worst_step_Nm
    assert np.abs(steps).max() > 0.9 * noise.worst_step_Nm
    assert steps.std() == pytest.approx(noise.rms_step_Nm, rel=0.02)
    assert Noise(7.644, 76.44).share == pytest.approx(0.1)


def test_a_low_pass_lessens_the_noise() -> None:
    plain, filtered = (
        specified(controller, Timing())[0].noise.worst_Nm
        for controller in (gain_set(), gain_set(low_pass_rad_per_s=1000))
    )
    assert filtered == pytest.approx(plain / 2)


def test_equal_gains_are_analysed_once() -> None:
    of_joints._dynamics.cache_clear()
    of_joints._sampled.cache_clear()
    of_joints._analysis.cache_clear()
    for path in sorted(CONTROLLERS.glob("*.toml")):
        of_specification(load(path), own_resolution=False)
    assert of_joints._dynamics.cache_info().misses == 1
    # The linear loop of all, and one for each of the seven resolutions.
    assert of_joints._analysis.cache_info().misses == 8


# --- Margins -----------------------------------------------------------------------------------


def eigenvalues_at(robot: Robot, q: Floats) -> Floats:
    """Of M(q)^-1 Mbar with puma3's Mbar, by M itself, in a posture of shape (n,)."""
    model = build_model(robot)
    mass = pin.crba(model, model.createData(), q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    found: Floats = np.linalg.eigvals(np.linalg.solve(mass, np.diag(MBAR))).real
    return found


def test_all_eigenvalues_that_are_found_lie_within_the_certified(rigid: Robot) -> None:
    joints = specified(gain_set(), Timing())
    found = eigenvalues(rigid, joints)
    assert isinstance(found, Eigenvalues)
    assert found.evidence is Evidence.PROVED
    for q in np.random.default_rng(7).uniform(-math.pi, math.pi, (200, 3)):
        values = eigenvalues_at(rigid, q)
        assert float(found.low) < values.min() <= values.max() < float(found.high)
    assert found.margin_33 == pytest.approx(2 / float(found.high))


def test_a_robot_that_can_not_be_certified_is_sampled_on_its_way(
    rigid: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    joints = specified(gain_set(), Timing())
    certified = eigenvalues(rigid, joints)

    def refuses(*_: object, **__: object) -> None:
        raise WorkspaceError("M depends on too many joints")

    monkeypatch.setattr("verification.tuning_check.robot.certified_eigenvalues", refuses)
    sampled = eigenvalues(rigid, joints)
    assert isinstance(certified, Eigenvalues)
    assert isinstance(sampled, Eigenvalues)
    assert sampled.evidence is Evidence.SAMPLED
    assert sampled.remark is not None
    assert "M depends on too many joints" in sampled.remark
    assert certified.low < sampled.low < sampled.high < certified.high
    assert rigid.trajectory is not None
    way = rigid.trajectory.at(np.linspace(0.0, rigid.trajectory.duration_s, 2000)).position_rad
    found = [eigenvalues_at(rigid, q) for q in way]
    assert sampled.sampled == pytest.approx((np.min(found), np.max(found)), rel=1e-3)
    still = eigenvalues(replace(rigid, trajectory=None), joints)
    assert still == "M depends on too many joints"


@given(
    low=st.floats(0.001, 1.0),
    ratio=st.floats(1.0, 30.0),
)
def test_mbar_times_the_factor_has_the_margin(low: float, ratio: float) -> None:
    sampled = specified(gain_set(), Timing())[0].sampled
    (interval,) = sampled.intervals
    factor = mbar_factor(sampled, low, ratio * low, LEAST_MARGIN)
    assert factor is not None
    room = min(factor * low / float(interval.low), float(interval.high) / (factor * ratio * low))
    assert room >= LEAST_MARGIN * (1 - 1e-12)
    least, most = float(interval.low) / low, float(interval.high) / (ratio * low)
    if least * LEAST_MARGIN <= 1.0 <= most / LEAST_MARGIN:
        assert factor == 1.0


def test_eigenvalues_without_room_have_no_factor() -> None:
    sampled = specified(gain_set(), Timing())[0].sampled
    (interval,) = sampled.intervals
    spread = float(interval.high) / float(interval.low)
    assert mbar_factor(sampled, 1.0, 1.01 * spread, LEAST_MARGIN) is None
    middle = mbar_factor(sampled, 1.0, 0.99 * spread, LEAST_MARGIN)
    assert middle == pytest.approx(
        math.sqrt(float(interval.low) * float(interval.high) / (0.99 * spread))
    )


@pytest.mark.parametrize(
    ("low", "high", "reason", "severity"),
    [
        (0.08, 0.7, None, Severity.SAFE),
        (0.08, 1.2, None, Severity.SAFE),
        (0.08, 1.4, "near an end of the stable interval", Severity.RESERVATION),
        (0.08, 1.93, "unstable in samples", Severity.UNSAFE),
        (0.013, 0.7, "unstable in samples", Severity.UNSAFE),
        (0.016, 0.7, "near an end of the stable interval", Severity.RESERVATION),
    ],
)
@pytest.mark.parametrize("same_gains", [True, False])
def test_verdict_of_eigenvalues(
    low: float, high: float, reason: str | None, severity: Severity, same_gains: bool
) -> None:
    joint = specified(gain_set(linear=True), Timing())[0]
    known = Eigenvalues(Fraction(low), Fraction(high), (low, high), Evidence.PROVED)
    found = list(of_gains(joint, known, same_gains=same_gains))
    if severity is Severity.UNSAFE and not same_gains:
        severity, reason = Severity.RESERVATION, "maybe unstable in samples"
    assert worst(found) is severity
    assert [f.what for f in found] == ([] if reason is None else [reason])


def test_bounds_that_cross_an_end_are_not_called_proved() -> None:
    joint = specified(gain_set(linear=True), Timing())[0]
    known = Eigenvalues(Fraction(1, 10), Fraction(2), (0.1, 1.9), Evidence.PROVED)
    assert [f.what for f in of_gains(joint, known)] == ["not proved in every posture"]


# --- On a plant --------------------------------------------------------------------------------

HELD_OUT = [
    ({}, Severity.SAFE, set()),
    ({"beta": "0.95"}, Severity.RESERVATION, {"not finite-time"}),
    ({"linear": True, "lambda_": 0}, Severity.SAFE, set()),
    ({"mbar": 3.0}, Severity.UNSAFE, {"unstable in samples", "vibrates hard"}),
    ({"mbar": 0.1}, Severity.UNSAFE, {"unstable in samples", "loses the reference"}),
    ({"lambda_": 200}, Severity.UNSAFE, {"vibrates hard"}),
]


@pytest.mark.usefixtures("no_bounds")
@pytest.mark.closed_loop
@pytest.mark.parametrize(("law", "severity", "reasons"), HELD_OUT)
def test_verdict_on_the_rigid_reference(
    law: dict[str, Any], severity: Severity, reasons: set[str], rigid: Robot
) -> None:
    checked = on_plant(gain_set(**law), rigid)
    assert checked.severity is severity
    assert reasons <= what(checked)
    if severity is not Severity.UNSAFE:
        assert reasons == what(checked)
    cured = checked.remedy
    assert (cured is not None) == (severity is Severity.UNSAFE)
    if cured is not None:
        # The gains that it says are what it says.
        assert cured.changes is not None
        names = {"inertia_kgm2": "inertia", "gamma": "gamma", "lambda": "lambda_"}
        joints = list(gain_set(**law).joints)
        for key, values in cured.changes.items():
            changes: list[dict[str, Any]] = [{names[key]: value} for value in values]
            joints = [replace(j, **change) for j, change in zip(joints, changes, strict=True)]
        again = on_plant(replace(gain_set(**law), joints=tuple(joints)), rigid)
        assert again.severity is not Severity.UNSAFE


@pytest.mark.usefixtures("no_bounds")
@pytest.mark.closed_loop
def test_on_flexible_joints_the_paper_s_gains_vibrate_and_have_no_margin() -> None:
    checked = on_plant(load(PUMA3), load_robot("reference_flexible"))
    assert checked.flexible
    assert checked.severity is Severity.RESERVATION
    assert what(checked) == {"vibrates", "near too large an Mbar"}
    assert any("flexible joints" in gap for gap in checked.gaps)
    assert checked.remedy is not None
    assert checked.remedy.changes is not None
    lower = checked.remedy.changes["inertia_kgm2"]
    assert all(float(x) <= y for x, y in zip(lower, MBAR, strict=True))


@pytest.mark.closed_loop
def test_the_tde_error_is_that_of_the_energy_audit_and_bounds_the_error(rigid: Robot) -> None:
    controller = gain_set(linear=True, lambda_=0)
    checked = on_plant(controller, rigid)
    plant = build_plant(rigid)
    assert rigid.trajectory is not None
    begin = beginning(plant, rigid.trajectory, 1e-3)
    loop = CompiledLoop(plant, controller)
    stepped = loop.controller()
    run = loop.run(plant, stepped, begin, 1e-3)
    names = [joint.name for joint in controller.joints]
    truth = audit("", names, gains_of(controller), record(stepped, begin, run))
    for joint, told in zip(checked.joints, truth.joints, strict=True):
        assert joint.flown is not None
        assert joint.bound is not None
        assert joint.bound.error_bound_rad is not None
        assert joint.flown.tde_error == pytest.approx(told.largest_tde_error)
        assert joint.flown.mean_tde_error == pytest.approx(told.largest_mean_tde_error)
        # By hand, of the critically damped pair: the impulse response t exp(-10 t) has the
        # integral 1/KP, and a bounded input no more effect than that.
        assert joint.bound.error_bound_rad >= told.largest_tde_error / 100
        assert joint.bound.error_bound_rad == pytest.approx(told.largest_tde_error / 100, rel=0.02)
        assert math.radians(joint.flown.peak_deg) < joint.bound.error_bound_rad


@pytest.mark.usefixtures("no_bounds")
@pytest.mark.closed_loop
@pytest.mark.parametrize("acceleration", ["current", "delayed"])
def test_the_tde_error_is_what_the_demanded_acceleration_lacks(
    acceleration: str, rigid: Robot
) -> None:
    """By (9), tau - tau(t-L) + Mbar qdd(t-L) = Mbar u: eps = u - qdd needs no torque."""
    checked = on_plant(gain_set(linear=True, lambda_=0, acceleration=acceleration), rigid)
    assert checked.flight is not None
    run = checked.flight.run
    assert run is not None
    rate = np.diff(run.q_encoder, axis=0)[:-1] / run.sample_time_s
    demanded = run.qdd_ref[1:-1] + 20 * (run.qd_ref[1:-1] - rate) + 100 * run.error_rad[1:-1]
    lacks = demanded - np.diff(run.q_encoder, n=2, axis=0) / run.sample_time_s**2
    for joint, largest in zip(checked.joints, np.abs(lacks).max(axis=0), strict=True):
        assert joint.flown is not None
        assert joint.flown.tde_error == pytest.approx(largest, rel=1e-4)


@pytest.mark.closed_loop
def test_a_run_that_ends_early_is_a_verdict(monkeypatch: pytest.MonkeyPatch, rigid: Robot) -> None:
    def diverges(*_: object) -> None:
        raise PlantError("the motion of reference became non-finite in tick 7")

    controller = load(PUMA3)
    monkeypatch.setattr(CompiledLoop, "run", diverges)
    checked = on_plant(controller, rigid)
    assert checked.severity is Severity.UNSAFE
    assert what(checked) == {"does not fly"}
    assert figures(checked)["failure"].endswith("tick 7")
    assert "tick 7" in render(checked)
    assert checked.remedy is not None
    assert checked.remedy.changes is None


@pytest.mark.usefixtures("no_bounds")
def test_what_can_be_said_of_a_plant_without_trajectory_is_said(rigid: Robot) -> None:
    checked = on_plant(load(PUMA3), replace(rigid, trajectory=None))
    assert checked.eigenvalues is not None
    assert checked.flight is None
    assert any("no trajectory" in gap for gap in checked.gaps)
    assert checked.severity is Severity.SAFE
    assert headline(checked) == "safe"
    assert "reference" in render(checked)
    unknown = replace(checked, eigenvalues=None)
    assert headline(unknown) == "safe, as far as could be looked at"
    assert checked.eigenvalues is not None
    on_its_way = replace(checked.eigenvalues, evidence=Evidence.SAMPLED)
    assert headline(replace(checked, eigenvalues=on_its_way)) == "safe, as sampled"


def test_a_plant_that_is_late_has_no_sample_more(rigid: Robot) -> None:
    assert rigid.drive is not None
    late = replace(rigid, drive=replace(rigid.drive, delay=0.5))
    assert rigid.trajectory is not None
    with pytest.raises(PlantError, match="--compute-delay 0"):
        Course(load(PUMA3), build_plant(late), rigid.trajectory, 1)


@pytest.mark.usefixtures("no_bounds")
@pytest.mark.closed_loop
def test_the_plant_s_delay_is_in_the_interval(rigid: Robot) -> None:
    assert rigid.drive is not None
    late = replace(rigid, drive=replace(rigid.drive, delay=0.25), trajectory=None)
    loop: Loop = on_plant(load(PUMA3), late).joints[0].specified.sampled.loop
    assert loop.torque_delay == Fraction(1, 4)


# --- The command -------------------------------------------------------------------------------


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    monkeypatch.setattr("verification.commands.tuning_check.RESULTS", tmp_path)
    return tmp_path


def specification(path: Path, **changes: str) -> Path:
    """puma3 with lines of its [law] replaced."""
    text = PUMA3.read_text(encoding="utf-8")
    for key, value in changes.items():
        text, count = re.subn(rf"^{key} = .*$", f"{key} = {value}", text, flags=re.MULTILINE)
        if not count:
            text = text.replace("[law]\n", f"[law]\n{key} = {value}\n")
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.usefixtures("no_bounds")
@pytest.mark.closed_loop
def test_the_command_leaves_json_and_a_page_that_needs_nothing(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["tuning-check", str(PUMA3), "--plant", "reference", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((results / "tuning_check" / "puma3.json").read_text("utf-8"))
    assert told["verdict"] == "safe"
    assert told["safe"] is True
    assert told["eigenvalues"]["evidence"] == "proved"
    for joint in told["joints"]:
        assert joint["class"] == "finite-time"
        assert joint["settling_time_s"][0] == pytest.approx(2.38598563)
        assert joint["margin"]["down"] < 1 < joint["margin"]["up"]
        assert joint["noise"]["share"] == pytest.approx(
            joint["noise"]["worst_Nm"] / joint["noise"]["limit_Nm"]
        )
        assert joint["flown"]["vibration"] < 5
        assert joint["verdict"] == "safe"
    page = (results / "tuning_check" / "puma3.html").read_text(encoding="utf-8")
    for joint in told["joints"]:
        assert f"<th>{joint['joint']}</th>" in page
    for elsewhere in ("http:", "https:", "src=", "url(http", "@import", "<script"):
        assert elsewhere not in page
    assert page.count("<svg") == 3


@pytest.mark.usefixtures("no_bounds")
@pytest.mark.closed_loop
def test_unsafe_gains_are_exit_code_1(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = specification(results / "big.toml", inertia_kgm2="[1.15, 0.92, 0.46]")
    assert main(["tuning-check", str(path), "--plant", "reference"]) == 1
    told = capsys.readouterr().out
    assert "unsafe: " in told
    assert "multiply Mbar by 0.62" in told
    page = (results / "tuning_check" / "puma3.html").read_text(encoding="utf-8")
    assert 'class="verdict bad"' in page


def test_without_a_plant_nothing_is_flown(
    results: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(checking, "Course", None)
    page = results / "here.html"
    assert main(["tuning-check", str(PUMA3), "--page", str(page)]) == 0
    assert "as far as the specification alone says" in capsys.readouterr().out
    assert page.is_file()
    no_error = specification(results / "none.toml", kp="0")
    assert main(["tuning-check", str(no_error), "--page", str(page)]) == 1


def test_the_summary_warns_and_succeeds(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tuning-check", "--summary"]) == 0
    told = capsys.readouterr().out
    names = [path.stem for path in CONTROLLERS.glob("*.toml")]
    assert all(f"{name}: finite-time" in told for name in names)
    assert "unsafe" not in told
    path = results / "fast.toml"
    path.write_text("sample_time_s = 0.0001\n" + PUMA3.read_text(encoding="utf-8"))
    assert main(["tuning-check", "--summary", str(path)]) == 0
    assert "unsafe gains were generated" in capsys.readouterr().out
    assert not list(results.glob("tuning_check/*"))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "give one specification"),
        ([str(PUMA3), str(PUMA3)], "give one specification"),
        ([str(PUMA3), "--plant", "ur5"], "has 3 joints, robot ur5 has 6"),
        ([str(PUMA3), "--plant", "nowhere"], "nowhere"),
        (["nowhere.toml"], "nowhere.toml"),
        ([str(CONTROLLERS / "puma6.toml"), "--plant", "ur5"], "counts for a radian"),
        (["--summary", "--plant", "reference"], "leave --plant"),
        ([str(PUMA3), "--page", "/dev/null/x.html"], "can't be written"),
    ],
)
@pytest.mark.usefixtures("results")
def test_bad_input_is_named(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["tuning-check", *arguments]) == 2
    told = capsys.readouterr().err
    assert "error: " in told
    assert says in told


def test_a_summary_names_what_is_wrong_once() -> None:
    lines = list(summary(of_specification(gain_set(beta="0.95"), own_resolution=False)))
    assert len(lines) == 2
    assert "19/21" in lines[1]


def test_error_bound_is_given_the_measured_error_rounded_up() -> None:
    assert checking.rounded_up(10.48721) == Fraction("10.49")
    assert checking.rounded_up(0.5) == Fraction(1, 2)
    assert error_bound(20, 100, 1, 1, 0, 1, tde_error=Fraction(0)).error_bound_rad == 0
