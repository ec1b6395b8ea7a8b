"""Energy along the closed loop, against what is worked out here from counts and reference alone."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from codegen.controller import Controller, load
from plant.assembly import build_plant
from plant.closed_loop import Beginning, Run, beginning
from plant.compiled.loop import CompiledLoop
from plant.controller import GeneratedController
from plant.robot import load_robot
from verification.__main__ import main
from verification.energy import present
from verification.energy.audit import (
    CONTROLLER,
    ROBOT,
    RowEnergy,
    audit,
    bound_of_s,
    energy,
    tde_error,
    tde_error_of_s,
    window_means,
)
from verification.energy.recording import EnergyError, Gains, Recording, _wrapped, gains_of, record

L = 0.001
ROW = "Exp08"
TICKS = 1500

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Flown:
    """A run of the compiled C, and what it recorded when it was stepped again."""

    specification: Controller
    controller: GeneratedController
    begin: Beginning
    run: Run
    recording: Recording

    def audit(self, **changes: Any) -> RowEnergy:
        """The audit of the recording, with signals changed."""
        names = [joint.name for joint in self.specification.joints]
        return audit(ROW, names, gains_of(self.specification), replace(self.recording, **changes))


def fly(first: int, ticks: int) -> Flown:
    shipped, tuned = load(CONTROLLER), load(CONTROLLER, experiment=ROW)
    robot = load_robot(ROBOT)
    plant = build_plant(robot)
    assert robot.trajectory is not None
    whole = beginning(plant, robot.trajectory, L)
    begin = whole.part(first, ticks, whole.state)
    loop = CompiledLoop(plant, shipped)
    controller = loop.controller()
    controller.set_gains(tuned)
    run = loop.run(plant, controller, begin, L)
    return Flown(tuned, controller, begin, run, record(controller, begin, run))


@pytest.fixture(scope="module")
def flown() -> Flown:
    return fly(0, TICKS)


def power(x: float, exponent: float) -> float:
    """sig, one number at a time."""
    return float(np.sign(x) * abs(x) ** exponent)


@dataclass(frozen=True)
class Own:
    """The signals of one joint, from counts, reference and torque in double, tick by tick."""

    e: list[float]
    ed: list[float]
    s: list[float]
    eps: list[float]


def own(flown: Flown, j: int) -> Own:
    joint, run = flown.specification.joints[j], flown.run
    count, mbar = 2 * np.pi / float(joint.counts_per_joint_rev), float(joint.inertia)
    kd, kp, alpha, beta = (float(x) for x in (joint.kd, joint.kp, joint.alpha, joint.beta))
    n = [int(x) for x in run.counts[:, j]]
    before = [n[0], n[0], *n]
    e = [
        count * (round(float(r) / count * 256) / 256 - x)
        for r, x in zip(run.q_ref[:, j] + flown.begin.script.encoder.zero_rad[j], n, strict=True)
    ]
    rate = [count * (now - last) / L for last, now in zip(before[1:], n, strict=False)]
    ed = [float(r) - v for r, v in zip(run.qd_ref[:, j], rate, strict=True)]
    s, integral = [], -ed[0]
    for position, velocity in zip(e, ed, strict=True):
        s.append(velocity + integral)
        integral += L * (kd * power(velocity, alpha) + kp * power(position, beta))
    tau = [float(x) for x in run.torque_commanded_Nm[:, j]]
    a = [
        count * (now - 2 * last + older) / L**2
        for older, last, now in zip(before, before[1:], n, strict=False)
    ]
    eps = [
        ((tau[k] - mbar * a[k + 1]) - (tau[k - 1] - mbar * a[k])) / mbar
        for k in range(1, len(n) - 1)
    ]
    return Own(e, ed, s, eps)


@pytest.mark.closed_loop
@pytest.mark.parametrize("j", range(3))
def test_the_c_has_the_signals_that_counts_and_reference_give(flown: Flown, j: int) -> None:
    ours, recording = own(flown, j), flown.recording
    assert recording.position_error[:, j] == pytest.approx(ours.e, abs=1e-12)
    # Single floats: 2^-24 of velocities below 5 rad/s, and of an integral of 1500 sums.
    assert recording.velocity_error[:, j] == pytest.approx(ours.ed, abs=1e-6)
    assert recording.sliding[:, j] == pytest.approx(ours.s, abs=1e-5)
    assert recording.sliding[0, j] == 0.0
    found = tde_error(gains_of(flown.specification), recording)[:, j]
    assert found == pytest.approx(ours.eps, rel=1e-9, abs=1e-9)


@pytest.mark.closed_loop
@pytest.mark.parametrize("j", range(3))
def test_shares_and_bound_are_what_a_loop_over_the_ticks_counts(flown: Flown, j: int) -> None:
    ours, joint = own(flown, j), flown.specification.joints[j]
    told = flown.audit().joints[j]
    kd, kp, alpha, beta = (float(x) for x in (joint.kd, joint.kp, joint.alpha, joint.beta))
    lambda_, gamma = float(joint.lambda_), float(joint.gamma)
    v = [
        ed**2 / 2 + kp * abs(e) ** (beta + 1) / (beta + 1)
        for e, ed in zip(ours.e, ours.ed, strict=True)
    ]
    ticks = range(1, len(v) - 1)
    falls = [v[k + 1] < v[k] for k in ticks]
    slow = [min(abs(ours.ed[k]), abs(ours.ed[k + 1])) for k in ticks]
    as_21 = [
        v[k + 1] < v[k] and v[k + 1] - v[k] <= -L * kd * x ** (alpha + 1)
        for k, x in zip(ticks, slow, strict=True)
    ]
    vs_falls = [ours.s[k + 1] ** 2 < ours.s[k] ** 2 for k in ticks]
    broken = [
        abs(x) >= lambda_ * abs(ours.s[k]) ** gamma for k, x in zip(ticks, ours.eps, strict=True)
    ]
    # Rounding may decide a tick or two of some 1500 otherwise.
    close = 3 / len(ticks)
    assert told.energy_falls == pytest.approx(np.mean(falls), abs=close)
    assert told.energy_falls_as_21 == pytest.approx(np.mean(as_21), abs=close)
    assert told.sliding_falls == pytest.approx(np.mean(vs_falls), abs=close)
    assert told.broken == pytest.approx(np.mean(broken), abs=close)
    unbroken = [f for f, b in zip(vs_falls, broken, strict=True) if not b]
    assert told.falls_where_unbroken == pytest.approx(np.mean(unbroken), abs=3 / len(unbroken))
    xi, largest = max(map(abs, ours.eps)), max(map(abs, ours.s))
    assert told.over_bound == pytest.approx(largest / (xi / lambda_) ** (1 / gamma), rel=1e-3)


@pytest.mark.closed_loop
def test_s_begins_at_0_with_a_reference_that_moves_already() -> None:
    recording = fly(40, 20).recording
    assert np.abs(recording.velocity_error[0]).min() > 1e-5
    assert recording.sliding[0].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.closed_loop
def test_what_is_promised_of_the_closed_loop(flown: Flown) -> None:
    told = flown.audit()
    assert told.saturated_ticks == 0
    for joint in told.joints:
        # (32) in samples, by the shipped floats.
        assert joint.identity_error < 1e-3
        assert joint.over_bound is not None
        assert joint.over_bound <= 1.0
        assert joint.falls_where_unbroken is not None
        assert joint.falls_where_unbroken > 0.9


@pytest.mark.closed_loop
@pytest.mark.parametrize("name", ["sliding", "torque_Nm", "acceleration", "reference_acceleration"])
def test_a_broken_sign_of_a_signal_breaks_the_identity(flown: Flown, name: str) -> None:
    wrong = flown.audit(**{name: -getattr(flown.recording, name)})
    assert min(joint.identity_error for joint in wrong.joints) > 0.1


@pytest.mark.closed_loop
def test_a_broken_sign_of_the_correction_breaks_the_identity(flown: Flown) -> None:
    gains = gains_of(flown.specification)
    wrong = replace(gains, lambda_=-gains.lambda_)
    difference = tde_error_of_s(wrong, flown.recording) - tde_error(gains, flown.recording)
    assert np.abs(difference).max() > 1.0


@pytest.mark.closed_loop
def test_the_c_with_other_gains_is_not_taken_for_the_run(flown: Flown) -> None:
    flown.controller.set_gains(load(CONTROLLER, experiment="Exp07"))
    try:
        with pytest.raises(EnergyError, match="torque at tick"):
            record(flown.controller, flown.begin, flown.run)
    finally:
        flown.controller.set_gains(flown.specification)


def test_errors_of_position_wrap_with_the_counter() -> None:
    numbers = np.array([0, 2**31 - 1, 2**31, -(2**31) - 1, 2**32 + 5])
    assert _wrapped(numbers).tolist() == [0, 2**31 - 1, -(2**31), 2**31 - 1, 5]


# --- Motions that are known ----------------------------------------------------------------------


def one(value: float) -> Floats:
    return np.array([value])


def gains(kd: float = 20.0, lambda_: float = 20.0, gamma: float = 0.4) -> Gains:
    return Gains(one(1.0), one(kd), one(100.0), one(lambda_), one(1.0), one(1.0), one(gamma))


def recorded(e: Floats, ed: Floats, s: Floats) -> Recording:
    nothing = np.zeros((len(s), 1))
    return Recording(
        sample_time_s=L,
        time_s=np.arange(len(s), dtype=np.float64),
        position_error=e[:, None],
        velocity_error=ed[:, None],
        sliding=s[:, None],
        acceleration=nothing,
        torque_Nm=nothing,
        reference_velocity=nothing,
        reference_acceleration=nothing,
        count_acceleration=one(1.0),
        saturated_ticks=0,
    )


def decay() -> tuple[Floats, Floats]:
    """e and ed of e'' + 20 e' + 100 e = 0 from e = 1 at rest, in closed form."""
    t = L * np.arange(600)
    return (1 + 10 * t) * np.exp(-10 * t), -100 * t * np.exp(-10 * t)


def test_energy_falls_as_21_along_the_desired_error_dynamics() -> None:
    e, ed = decay()
    s = np.linspace(1.0, 0.5, len(e))
    told = audit("", ["joint"], gains(), recorded(e, ed, s)).joints[0]
    assert told.energy_falls_as_21 == 1.0
    # Twice the damper would take more than the motion loses, but in the first ticks.
    told = audit("", ["joint"], gains(kd=40.0), recorded(e, ed, s)).joints[0]
    assert told.energy_falls == 1.0
    assert told.energy_falls_as_21 < 0.01
    # The same motion backwards in time gains energy.
    told = audit("", ["joint"], gains(), recorded(e[::-1], -ed[::-1], s)).joints[0]
    assert told.energy_falls == 0.0


@pytest.mark.parametrize(("sign", "share"), [(-1.0, 1.0), (1.0, 0.0)])
def test_vs_falls_without_tde_error_unless_the_correction_has_the_wrong_sign(
    sign: float, share: float
) -> None:
    s = [1.0]
    while len(s) < 20:
        s.append(s[-1] + sign * L * 20.0 * s[-1] ** 0.4)
    told = audit("", ["joint"], gains(), recorded(np.zeros(20), np.zeros(20), np.array(s))).joints[
        0
    ]
    assert told.broken == 0.0
    assert told.sliding_falls == share
    assert told.falls_where_broken is None


def test_energy_is_that_of_20() -> None:
    g = replace(gains(), beta=one(0.5))
    assert energy(g, one(-0.04), one(-3.0)) == pytest.approx([4.5 + 100 * 0.04**1.5 / 1.5])
    assert energy(g, one(0.0), one(0.0)) == [0.0]


def test_the_bound_is_38_where_there_is_one() -> None:
    assert bound_of_s(10.0, 20.0, 0.5) == pytest.approx(0.25)
    assert bound_of_s(10.0, 0.0, 0.5) is None
    assert bound_of_s(10.0, 20.0, 0.0) is None


def test_a_variable_that_jumps_is_pulled_less_than_at_its_mean() -> None:
    s = np.tile([-0.4, 0.6], 26)
    nothing = np.zeros(len(s))
    # The mean of -0.4^0.5 and 0.6^0.5 over 0.1^0.5, by hand.
    told = audit("", ["joint"], gains(gamma=0.5), recorded(nothing, nothing, s)).joints[0]
    assert told.mean_pull is None  # there is no TDE error, and with it no bound
    moved = replace(recorded(nothing, nothing, s), torque_Nm=np.arange(52.0)[:, None] % 3)
    told = audit("", ["joint"], gains(gamma=0.5), moved).joints[0]
    assert told.mean_pull == pytest.approx((0.6**0.5 - 0.4**0.5) / 2 / 0.1**0.5)


def test_means_are_of_whole_windows() -> None:
    assert window_means(np.arange(120.0)).tolist() == [24.5, 74.5]
    assert window_means(np.ones((3, 2))).tolist() == [[1.0, 1.0]]


# --- The command ---------------------------------------------------------------------------------


@pytest.fixture
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    monkeypatch.setattr(present, "PICTURE", tmp_path / "energy.svg")
    return tmp_path


@pytest.mark.closed_loop
def test_the_command_leaves_figures_and_picture(
    scratch: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["energy", "--row", "Exp08", "--row", "Exp01", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [row["exp"] for row in found["rows"]] == ["Exp01", "Exp08"]
    assert {row["evidence"] for row in found["rows"]} == {"measured"}
    assert found["rows"][0]["joints"][0]["bound"] is None
    assert all(0.0 < joint["over_bound"] <= 1.0 for joint in found["rows"][1]["joints"])
    for joint in (joint for row in found["rows"] for joint in row["joints"]):
        assert 0.0 < joint["largest_error"] < joint["error_bound"]
    # Hsia's law is linear and critically damped: the bound is hardly more than xi/KP.
    for joint in found["rows"][0]["joints"]:
        least = joint["largest_tde_error"] / 100
        assert least < joint["error_bound"] < 1.003 * least
    picture = (scratch / "energy.svg").read_bytes()
    assert main(["energy", "--row", "Exp01", "--row", "Exp08"]) == 0
    assert (scratch / "energy.svg").read_bytes() == picture
    told = capsys.readouterr().out
    assert "waist" in told
    assert "[rad/s²]" in told
    assert "Largest |s| over the bound (38)" in told
    assert "its certified bound" in told


def test_a_row_that_is_not_in_the_table_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["energy", "--row", "Exp99"])
    assert stopped.value.code == 2
    assert "Exp99" in capsys.readouterr().err
