"""The examples: what their pages say to type is typed, and does what they say."""

from __future__ import annotations

import csv
import subprocess
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image

from codegen.controller import load
from plant.controller import GeneratedController
from plant.native import shared_library
from tests.repository.conftest import ROOT
from tests.repository.markdown import parse

FOLDERS = sorted((ROOT / "examples").glob("0*"))
STEP_IN_C = "01_generate_and_step_in_c"
CLOSED_LOOP = "02_closed_loop_of_exp08"
OWN_URDF = "03_your_own_urdf"
TUNE = "04_tune"
CERTIFY = "05_certify_a_gain_set"
CMAKE = "06_embed_in_a_cmake_project"


def page(name: str) -> str:
    return (ROOT / "examples" / name / "README.md").read_text(encoding="utf-8")


def run(name: str, root: Path) -> str:
    """Runs the page's commands in a copy of the repository; gives what they print."""
    (script,) = (
        block.text
        for block in parse(Path(f"examples/{name}/README.md"), page(name)).blocks
        if block.language == "sh"
    )
    (root / "examples" / name / "picture.png").unlink()
    done = subprocess.run(
        ["sh", "-eu", "-c", script], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done.stdout


def same_picture(name: str, root: Path) -> bool:
    """Whether the example has drawn the committed picture, but for the edges of letters."""
    here, there = (
        image.imread(folder / "examples" / name / "picture.png")[:, :, :3]
        for folder in (root, ROOT)
    )
    return here.shape == there.shape and float(np.abs(here - there).mean()) < 0.02


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_an_example_is_short_and_has_its_page_and_picture(folder: Path) -> None:
    text = page(folder.name)
    assert text.startswith(f"# {folder.name[:2]}: ")
    assert text.count("\n") <= 40
    assert "](picture.png)" in text
    assert (folder / "picture.png").stat().st_size < 120_000


def test_they_are_numbered_without_a_gap() -> None:
    assert [folder.name[:2] for folder in FOLDERS] == [f"0{i}" for i in range(1, 7)]


def test_the_torques_of_c_are_those_of_the_binding_bit_for_bit(copy: Path) -> None:
    run(STEP_IN_C, copy)
    printed = rows(copy / "build" / "example_01" / "step.csv")
    controller = GeneratedController(
        load(copy / "examples" / STEP_IN_C / "axis.toml"),
        shared_library(copy / "build" / "example_01" / "axis"),
    )
    assert controller.reset(np.zeros(1, np.int32), np.zeros(1)) == 0
    for row in printed:
        controller.input.counts[0] = int(row["counts"])
        controller.input.reference_position_q8[0] = int(row["reference_q8"])
        controller.input.reference_velocity_rad_per_s[0] = float(row["velocity_rad_per_s"])
        controller.input.reference_acceleration_rad_per_s2[0] = float(
            row["acceleration_rad_per_s2"]
        )
        assert controller._step(*controller._pointers) == int(row["status"]) == 0
        assert controller.torque[0] == np.float32(row["torque_Nm"])
    error = [int(row["reference_q8"]) / 256 - int(row["counts"]) - 0.5 for row in printed]
    assert 10 < max(map(abs, error)) < 18
    assert max(map(abs, error[-100:])) < 4
    assert same_picture(STEP_IN_C, copy)


def test_the_closed_loops_have_the_errors_of_the_page(copy: Path) -> None:
    printed = run(CLOSED_LOOP, copy)
    for line in printed.splitlines():
        assert line in page(CLOSED_LOOP)
    errors = {line.split()[0]: float(line.split()[1]) for line in printed.splitlines()[1:]}
    assert errors["Exp08"] < errors["Exp05"] < errors["Exp01"]
    assert same_picture(CLOSED_LOOP, copy)


def test_the_urdf_flies(copy: Path) -> None:
    proposed, tuned = (
        [float(error) for error in line.split(":")[1].split()]
        for line in run(OWN_URDF, copy).splitlines()
    )
    assert len(tuned) == 6
    assert max(tuned) < 0.004
    assert all(after < before / 5 for before, after in zip(proposed, tuned, strict=True))
    assert same_picture(OWN_URDF, copy)


def test_tuning_takes_the_error_down(copy: Path) -> None:
    printed = run(TUNE, copy).splitlines()[-2:]
    before, after = (np.array(line.split("[")[2].rstrip("]").split(), float) for line in printed)
    assert after[0] < before[0] / 4
    assert (after < before).all()
    assert same_picture(TUNE, copy)


def test_unsafe_gains_are_refused_with_exit_code_1(copy: Path) -> None:
    printed = run(CERTIFY, copy).splitlines()
    assert [line.split(";")[0] for line in printed] == [
        "paper: safe",
        "too_much_mbar: UNSAFE",
    ]
    for line in printed:
        assert line in page(CERTIFY)
    assert same_picture(CERTIFY, copy)


def test_the_cmake_project_rides_through_a_dropout(copy: Path) -> None:
    run(CMAKE, copy)
    printed = rows(copy / "build" / "example_06" / "torque.csv")
    lost = [int(row["tick"]) for row in printed if int(row["status"]) < 0]
    assert lost == list(range(40, 51))
    held = {row["waist_Nm"] for row in printed[39:51]}
    assert len(held) == 1, "the torque of the last good tick"
    assert float(printed[51]["waist_Nm"]) > float(held.pop())
    assert {(row["shoulder_Nm"], row["elbow_Nm"]) for row in printed} == {("-20", "5")}
    assert same_picture(CMAKE, copy)


def test_a_controller_that_is_not_there_is_told_by_cmake(tmp_path: Path) -> None:
    done = subprocess.run(
        ["cmake", "-S", ROOT / "examples" / CMAKE, "-B", tmp_path / "build",
         f"-DTDC_DIRECTORY={tmp_path}"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode != 0
    # CMake breaks its lines after so many letters, those of the path included.
    assert "no generated C: run `make codegen`" in " ".join(done.stderr.split())
