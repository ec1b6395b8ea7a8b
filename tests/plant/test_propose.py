"""``python -m plant propose``, and robot files that are flown by themselves."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from codegen.controller import Controller, load
from plant.__main__ import main
from plant.flight import fly
from plant.model import build_model
from plant.propose import LARGEST_EIGENVALUE, starting_inertia
from plant.robot import ROBOTS, load_robot
from plant.urdf import package_file

UR5_URDF = package_file("example-robot-data", "ur_description/urdf/ur5_robot.urdf")
SIMULATED = ["ur5", "panda", "z1", "puma560", "reference"]
MINE = 'description = "mine"\nbased_on = "ur5"\n'


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(MINE, encoding="utf-8")
    return path


def _proposed(robot: str, folder: Path) -> Controller:
    output = folder / f"{robot}_start.toml"
    assert main(["propose", robot, "--output", str(output)]) == 0
    return load(output)


@pytest.mark.parametrize("name", SIMULATED)
def test_the_proposal_fits_the_robot(tmp_path: Path, name: str) -> None:
    controller, robot = _proposed(name, tmp_path), load_robot(name)
    assert robot.encoder is not None
    assert robot.drive is not None
    assert controller.name == name
    counts = [1.0 / joint.rad_per_count for joint in controller.joints]
    np.testing.assert_allclose(counts, robot.encoder.counts_per_rad, rtol=1e-9)
    limits = [float(joint.torque_limit) for joint in controller.joints]
    np.testing.assert_allclose(limits, robot.drive.torque_limit_Nm, rtol=1e-9)
    for joint in controller.joints:
        gains = (joint.kd, joint.kp, joint.lambda_, joint.alpha, joint.beta)
        assert [int(gain) for gain in gains] == [20, 100, 0, 1, 1]


@pytest.mark.parametrize("name", SIMULATED)
def test_mbar_keeps_the_stability_condition_all_along_the_trajectory(name: str) -> None:
    """The spectral radius of I - M^-1 Mbar, at other postures than the rule looked at."""
    robot = load_robot(name)
    assert robot.trajectory is not None
    mbar = np.diag(starting_inertia(robot, robot.trajectory))
    model = build_model(robot)
    times = np.linspace(0.0, robot.trajectory.duration_s, 233)
    largest = 0.0
    for q in robot.trajectory.at(times).position_rad:
        values = np.linalg.eigvals(np.linalg.solve(pin.crba(model, model.createData(), q), mbar))
        assert np.max(np.abs(1.0 - values)) < 1.0
        largest = max(largest, float(np.max(values.real)))
    assert 0.97 * LARGEST_EIGENVALUE < largest < 1.001 * LARGEST_EIGENVALUE


@pytest.mark.parametrize("name", ["ur5", "panda", "z1"])
def test_the_proposal_flies_within_limits(name: str) -> None:
    figures = fly(ROBOTS / f"{name}.toml", backend="compiled", progress=False).figures()
    assert figures["robot"] == name
    assert figures["saturated_ticks"] == 0
    assert max(figures["rms_deg"]) < 0.1


def test_it_is_printed_and_no_file_is_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "start.toml"
    assert main(["propose", "z1"]) == 0
    printed = capsys.readouterr().out
    assert main(["propose", "z1", "--output", str(output)]) == 0
    capsys.readouterr()
    assert output.read_text(encoding="utf-8") == printed
    output.write_text("mine", encoding="utf-8")
    assert main(["propose", "z1", "--output", str(output)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert output.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["ur55"], "did you mean 'ur5'?"),
        (["puma560_akb"], "robot puma560_akb has no encoder, drive, trajectory: add it"),
        (["ur5", "--urdf", "nowhere.urdf"], "no URDF nowhere.urdf"),
        (["ur5", "--output", "nowhere/x.toml"], "nowhere/x.toml can't be written: No such file"),
        (["reference", "--urdf", "x.urdf"], "has [links]"),
    ],
)
def test_mistakes_get_a_plain_answer(
    capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(["propose", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert message in error


def _simulated(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    command = ["simulate", *arguments, "--backend", "compiled", "--speed", "4", "--json"]
    assert main(command) == 0
    figures: dict[str, Any] = json.loads(capsys.readouterr().out)
    return figures


def test_a_robot_file_is_flown_with_its_proposal(
    mine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start = mine.parent / "start.toml"
    assert main(["propose", str(mine), "--output", str(start)]) == 0
    capsys.readouterr()
    by_itself = _simulated(capsys, str(mine))
    assert by_itself == _simulated(capsys, str(start), "--robot", str(mine))
    command = ["simulate", str(mine), "--backend", "compiled", "--speed", "4"]
    assert main(command) == 0
    assert f"python -m plant propose {mine}" in capsys.readouterr().out


def test_a_robot_file_may_name_its_controller(
    mine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = mine.parent / "controllers"
    folder.mkdir()
    own = folder / "own.toml"
    assert main(["propose", str(mine), "--output", str(own)]) == 0
    own.write_text(own.read_text().replace('name = "mine"', 'name = "own"'), encoding="utf-8")
    mine.write_text('controller = "controllers/own.toml"\n' + MINE, encoding="utf-8")
    capsys.readouterr()
    assert _simulated(capsys, str(mine))["controller"] == "own"
    own.unlink()
    assert main(["simulate", str(mine)]) == 2
    assert "own.toml" in capsys.readouterr().err


def test_the_urdf_of_a_run_can_be_replaced(mine: Path, capsys: pytest.CaptureFixture[str]) -> None:
    heavy, same = mine.parent / "heavy.urdf", mine.parent / "same.urdf"
    text = UR5_URDF.read_text(encoding="utf-8")
    same.write_text(text, encoding="utf-8")
    heavy.write_text(text.replace('<mass value="2.275"/>', '<mass value="9"/>'), encoding="utf-8")
    start = mine.parent / "start.toml"
    assert main(["propose", str(mine), "--output", str(start)]) == 0
    capsys.readouterr()
    for subject in ([str(mine)], [str(start), "--robot", str(mine)]):
        peak = {
            urdf: _simulated(capsys, *subject, "--urdf", str(urdf))["peak_torque_Nm"][1]
            for urdf in (same, heavy)
        }
        assert peak[same] == _simulated(capsys, *subject)["peak_torque_Nm"][1]
        assert peak[heavy] > peak[same] + 20


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--robot", "ur5"], "is a robot file: give a specification with --robot, or leave it"),
        (["--urdf", "nowhere.urdf"], "no URDF nowhere.urdf"),
    ],
)
def test_a_robot_file_that_cannot_be_flown_is_refused(
    mine: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(["simulate", str(mine), *arguments]) == 2
    assert message in capsys.readouterr().err
