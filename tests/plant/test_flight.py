"""``python -m plant simulate``: the shipped C in closed loop, and what can't be flown."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from plant.__main__ import main
from plant.assembly import PlantError
from plant.flight import fly
from plant.robot import FrictionName

CONTROLLERS = Path(__file__).parents[2] / "controllers"
PUMA3, PUMA6 = CONTROLLERS / "puma3.toml", CONTROLLERS / "puma6.toml"


def test_a_run_is_the_same_bit_for_bit_when_it_is_repeated(
    capsys: pytest.CaptureFixture[str],
) -> None:
    command = ["simulate", str(PUMA3), "--experiment", "Exp08", "--speed", "3", "--json"]
    printed = []
    for _ in range(2):
        assert main(command) == 0
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1]
    figures = json.loads(printed[0])
    assert figures["experiment"] == "Exp08"
    assert figures["robot"] == "reference"
    assert len(figures["rms_deg"]) == 3


def test_six_joints_track_on_the_published_puma() -> None:
    figures = fly(PUMA6, speed=2.0).figures()
    assert figures["robot"] == "puma560"
    assert max(figures["rms_deg"]) < 0.01
    assert figures["saturated_ticks"] == 0


def test_the_friction_model_hardly_matters_but_is_another() -> None:
    models: tuple[FrictionName, ...] = ("lugre", "coulomb-stribeck")
    errors = [fly(PUMA3, friction=model, speed=2.0).figures()["rms_deg"] for model in models]
    assert errors[0] != errors[1]
    assert errors[0] == pytest.approx(errors[1], rel=0.5)


def test_another_number_of_joints_or_another_encoder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(PlantError, match="3 joints, robot puma560 has 6"):
        fly(PUMA3, robot="puma560")
    pulses = tmp_path / "pulses.toml"
    # The trap of the paper's set-up: 2048 pulses are 8192 counts.
    pulses.write_text(PUMA3.read_text() + "\n[encoder]\ncounts_per_rev = 2048\n")
    with pytest.raises(PlantError, match=r"4 x pulses"):
        fly(pulses)


def test_the_compiled_backend_is_chosen_by_an_option(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["simulate", str(PUMA3), "--backend", "compiled", "--json"]
    printed = []
    for _ in range(2):
        assert main(command) == 0
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1]
    errors = json.loads(printed[0])["rms_deg"]
    # The run of 12 s in Python, see the README's table.
    assert errors == pytest.approx([0.0011, 0.0013, 0.0014], rel=0.08)


def test_bench_tells_how_fast_the_backends_are(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("plant.__main__.CONTROLLERS", ("puma3",))
    assert main(["bench", "--rounds", "1", "--substep", "1e-3", "--json"]) == 0
    (figures,) = json.loads(capsys.readouterr().out)
    assert figures["joints"] == 3
    assert figures["simulated_s"] == pytest.approx(12.0)
    ratio = figures["pinocchio"]["wall_s"] / figures["compiled"]["wall_s"]
    assert figures["compiled_times_pinocchio"] == pytest.approx(ratio)
    # Far less than it is, so that a busy machine doesn't fail.
    assert figures["compiled_times_pinocchio_cpu"] > 5.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere.toml"], "No such file"),
        ([str(PUMA3), "--experiment", "Exp8"], 'did you mean "Exp08"'),
        ([str(PUMA3), "--robot", "refrence"], "reference"),
    ],
)
def test_what_cannot_be_flown_exits_with_2(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", *arguments]) == 2
    assert words in capsys.readouterr().err
