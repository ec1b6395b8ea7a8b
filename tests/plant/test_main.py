"""The command line: what it prints, and what it says to mistakes."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from plant.__main__ import main
from plant.robot import load_robot, robot_names

QR3 = "--q=0,1.5707963267948966,-1.5707963267948966"


def _csv(values: Any) -> str:
    return ",".join(repr(float(v)) for v in values)


@pytest.mark.parametrize(
    ("key", "robot"),
    [
        ("configs_6dof", "puma560"),
        ("configs_3dof_wrist_locked_at_zero", "puma560"),
        ("akb_variant", "puma560_akb"),
    ],
)
def test_json_has_the_published_dynamics(
    published: dict[str, Any], capsys: pytest.CaptureFixture[str], key: str, robot: str
) -> None:
    configurations = published[key].get("configs", published[key])
    for expected in configurations.values():
        n = len(expected["q"])
        qd, qdd = published["qd"][:n], published["qdd"][:n]
        state = [f"--q={_csv(expected['q'])}", f"--qd={_csv(qd)}", f"--qdd={_csv(qdd)}"]
        assert main(["dynamics", "--robot", robot, *state, "--json"]) == 0
        answer = json.loads(capsys.readouterr().out)
        assert list(answer) == ["robot", "q", "qd", "qdd", "M", "C", "g", "tau"]
        assert answer["robot"] == robot
        for name in ("q", "M", "g", "tau"):
            np.testing.assert_allclose(answer[name], expected[name], rtol=0, atol=1e-9)
        np.testing.assert_allclose(np.array(answer["C"]) @ qd, expected["Cqd"], rtol=0, atol=1e-9)


def test_rates_are_zero_unless_given(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dynamics", "--robot", "puma560", QR3, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["qd"] == answer["qdd"] == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(answer["tau"], answer["g"], rtol=0, atol=1e-12)


def test_tables_are_for_people(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    assert main(["dynamics", "--robot", "puma560", QR3]) == 0
    out = capsys.readouterr().out
    for text in ("locked at zero: wrist roll, wrist bend, flange", "-0.775235", "M [kg m²]"):
        assert text in out


def test_robots_lists_joints_and_sources(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    assert main(["robots"]) == 0
    out = capsys.readouterr().out
    for name in robot_names():
        robot = load_robot(name)
        assert ", ".join(robot.joint_names) in out
        for _, source in robot.sources:
            assert source in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--robot", "puma56", "--q=0"], "did you mean 'puma560'?"),
        (["--robot", "puma560", "--q=0,0"], "puma560 needs 6 numbers, or 3 for a wrist locked"),
        (["--robot", "reference", "--q=0"], "reference needs 3 numbers, not 1"),
        (["--robot", "puma560", "--q=0,a,0"], "--q: 'a' is not a finite number"),
        (["--robot", "puma560", "--q=0,nan,0"], "--q: 'nan' is not a finite number"),
        (["--robot", "puma560", "--q="], "--q: '' is not a finite number"),
        (["--robot", "puma560", "--q=0,0,0", "--qd=1"], "--qd: has 1 numbers, --q has 3"),
        (["--robot", "puma560", "--q=0,0,0", "--qdd=x,0,0"], "--qdd: 'x' is not a finite"),
    ],
)
def test_mistakes_get_a_plain_answer(
    capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(["dynamics", *arguments]) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.startswith("error: ")
    assert captured.out == ""


@pytest.mark.parametrize("arguments", [[], ["dynamics"], ["nothing"]])
def test_bad_usage_ends_with_two(capsys: pytest.CaptureFixture[str], arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert "usage: python -m plant" in capsys.readouterr().err


def test_help_names_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert end.value.code == 0
    out = capsys.readouterr().out
    assert "dynamics" in out
    assert "robots" in out
