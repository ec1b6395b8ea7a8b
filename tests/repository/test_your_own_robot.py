"""docs/your-own-robot.md: its commands run as they stand, and print the figures of its text."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from codegen.controller import load

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "03_your_own_urdf"
TEXT = (ROOT / "docs" / "your-own-robot.md").read_text(encoding="utf-8")
# What is written for `build/my_ur5` there is done elsewhere.
FOLDER = "build/my_ur5"
# The figures are printed to two or three digits; the last bits of libm may differ.
TOLERANCE = 0.03


@dataclass(frozen=True)
class Walk:
    """What came of the document's commands."""

    folder: Path
    flights: list[dict[str, Any]]


def _commands() -> list[str]:
    blocks = re.findall(r"^```sh\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
    return [line for block in blocks for line in block.splitlines()]


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Walk:
    """All commands, in order; those of `simulate` answer in JSON."""
    folder = tmp_path_factory.mktemp("robots") / "my_ur5"
    flights = []
    for command in _commands():
        words = shlex.split(command.replace(FOLDER, str(folder)))
        if words[0] == ".venv/bin/python":
            words[0] = sys.executable
        flies = words[1:4] == ["-m", "plant", "simulate"]
        done = subprocess.run(
            [*words, *(["--json"] if flies else [])],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stderr}"
        if flies:
            flights.append(json.loads(done.stdout))
    return Walk(folder, flights)


def test_each_row_of_the_table_is_what_simulate_prints(walk: Walk) -> None:
    rows = re.findall(r"^\| \w+ \| ((?:0\.\d+ ?){6}) \| ([\d.]+) \|$", TEXT, re.MULTILINE)
    assert len(rows) == len(walk.flights) == 5
    for (errors, step), flight in zip(rows, walk.flights, strict=True):
        written = [float(error) for error in errors.split()]
        assert written == pytest.approx(flight["rms_deg"], rel=TOLERANCE, abs=5e-5)
        assert float(step) == pytest.approx(flight["rms_torque_step_Nm"][1], rel=TOLERANCE)
        assert flight["saturated_ticks"] == 0


def test_the_text_says_what_the_steps_do(walk: Walk) -> None:
    start, mbar, *_ = walk.flights
    for before, after in zip(start["rms_deg"], mbar["rms_deg"], strict=True):
        assert 0.4 < after / before < 0.5, "doubling Mbar halves the error"
    for before, after in zip(walk.flights, walk.flights[1:], strict=False):
        assert max(after["rms_deg"]) < max(before["rms_deg"])


def test_the_finished_files_are_those_of_the_example(walk: Walk) -> None:
    assert load(walk.folder / "controller.toml") == load(EXAMPLE / "controller.toml")


def test_the_generated_c_is_where_the_text_says(walk: Walk) -> None:
    generated = {path.name for path in (walk.folder / "my_ur5").iterdir()}
    assert {"tdc_my_ur5.c", "tdc_my_ur5.h", "manifest.json"} <= generated


@pytest.mark.parametrize("link", re.findall(r"\]\((?!https?:)([^)#]+)", TEXT))
def test_every_file_that_it_points_to_is_there(link: str) -> None:
    assert (ROOT / "docs" / link).exists()
