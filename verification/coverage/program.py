"""Builds the directed tests with counters, runs them, and reads what they took.

Headers are counted once for a controller, however many files include them.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from codegen.controller import Controller
from codegen.emit import REPOSITORY
from plant.native import BUILD, sources_of
from verification.firmware import ToolError, tool
from verification.fuzz.program import CLANG
from verification.fuzz.tables import tables

TARGET = Path(__file__).parent / "target"
SCALARS = TARGET.parents[1] / "fuzz/target/scalars.c"
COVERAGE_BUILD = BUILD / "coverage"

_FLAGS = ("-std=c99", "-O0", "-g", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror")
_MCDC = ("-fprofile-instr-generate", "-fcoverage-mapping", "-fcoverage-mcdc")
# A fixed-point controller has other C for cores without a long multiplication.
_WAYS: dict[str, tuple[tuple[str, ...], ...]] = {
    "floating-point": ((),),
    "fixed-point": ((), ("-DTDC_NO_LONG_MULTIPLY",)),
}


Place = tuple[str, int, int, int]
"""A branch or a condition: file, line, column, and its number there."""


@dataclass(frozen=True)
class Counted:
    """How many of some things were covered.

    Attributes:
        covered: those that were.
        total: all.
        missed: where the others are, as FILE:LINE.
    """

    covered: int
    total: int
    missed: tuple[str, ...]

    @property
    def whole(self) -> bool:
        """Whether there is something, and all of it was covered."""
        return self.covered == self.total > 0


@dataclass(frozen=True)
class Coverage:
    """What the directed tests covered of a controller's C.

    Attributes:
        controller: its name.
        says: the last line of each run: how many checks, how many failures.
        passed: whether no check failed.
        branches: outcomes of conditions, counted by GCC and gcovr.
        conditions: those that alone changed their decision's outcome (MC/DC), counted by clang, of
            decisions with more than one.
        decisions: how many decisions these are.
    """

    controller: str
    says: tuple[str, ...]
    passed: bool
    branches: Counted
    conditions: Counted
    decisions: int

    @property
    def whole(self) -> bool:
        """Whether every check passed, every branch was taken, and every condition decided."""
        return self.passed and self.branches.whole and self.conditions.whole


def measure(
    controller: Controller, tests: Path = TARGET / "directed.c", build: Path = COVERAGE_BUILD
) -> Coverage:
    """Runs the directed tests on a controller's C, once with each compiler's counters.

    Args:
        controller: whose generated C.
        tests: the C file with the tests.
        build: where a folder of its own is for what is made meanwhile.

    Raises:
        ToolError: a tool is missing, or refused its input.
    """
    sources = sources_of(controller)
    folder = build / controller.name
    folder.mkdir(parents=True, exist_ok=True)
    written = folder / "tables.c"
    header = (sources / "tdc.h").read_text(encoding="utf-8")
    written.write_text(tables(controller, header), encoding="utf-8")
    files = [tests, written, SCALARS, *sorted(sources.glob("*.c"))]
    names = (
        *("-I", str(REPOSITORY), "-I", str(sources)),
        *(f"-DCONTROLLER={controller.name}", f"-DCONTROLLER_UPPER={controller.name.upper()}"),
    )
    ways = _WAYS[controller.arithmetic.kind]
    runs, profiles = [], []
    for number, way in enumerate(ways):
        place = folder / str(number)
        flags = (*_FLAGS, *names, *way)
        runs.append(_run_for_gcc(files, flags, place / "gcc"))
        done, profile = _run_for_clang(files, flags, place / "clang", sources)
        runs.append(done)
        profiles.append(profile)
    decided = _conditions(profiles, sources)
    return Coverage(
        controller.name,
        tuple((run.stdout + run.stderr).strip() for run in runs),
        all(run.returncode == 0 for run in runs),
        _branches(sources, folder),
        _counted(decided),
        len({place[:3] for place in decided}),
    )


def _call(*command: str, cwd: Path) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ToolError(f"{command[0]} failed:\n{done.stderr}")
    return done.stdout


def _run(program: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(program)], cwd=program.parent, capture_output=True, text=True, check=False
    )


# --- Branches: GCC and gcovr --------------------------------------------------------------------


def _run_for_gcc(
    files: Iterable[Path], flags: Iterable[str], place: Path
) -> subprocess.CompletedProcess[str]:
    place.mkdir(parents=True, exist_ok=True)
    for old in place.glob("*.gc*"):
        old.unlink()  # counts of another program would be added to this one's
    _call(tool("gcc", "gcc"), *flags, "--coverage", *map(str, files), "-o", "tests", cwd=place)
    return _run(place / "tests")


def _branches(sources: Path, folder: Path) -> Counted:
    """Counts branches, and leaves a page that shows them line by line."""
    data, page = folder / "gcovr.json", folder / "page"
    page.mkdir(exist_ok=True)
    gcovr = (sys.executable, "-m", "gcovr", "--root", str(sources), "--filter", f"{sources}/")
    outputs = ("--json", str(data), "--html-nested", str(page / "index.html"))
    _call(*gcovr, *outputs, *map(str, sorted(folder.glob("*/gcc"))), cwd=folder)
    taken: dict[Place, bool] = {}
    for file in json.loads(data.read_text(encoding="utf-8"))["files"]:
        for line in file["lines"]:
            for number, branch in enumerate(line["branches"]):
                place = (Path(file["file"]).name, line["line_number"], 0, number)
                taken[place] = taken.get(place, False) or branch["count"] > 0
    return _counted(taken)


# --- Conditions: clang --------------------------------------------------------------------------


def _run_for_clang(
    files: Iterable[Path], flags: Iterable[str], place: Path, sources: Path
) -> tuple[subprocess.CompletedProcess[str], dict[str, Any]]:
    place.mkdir(parents=True, exist_ok=True)
    version = CLANG.removeprefix("clang-")
    profdata, cov = (
        tool(f"{name}-{version}", f"llvm-{version}") for name in ("llvm-profdata", "llvm-cov")
    )
    _call(tool(CLANG, CLANG), *flags, *_MCDC, *map(str, files), "-o", "tests", cwd=place)
    done = _run(place / "tests")
    _call(profdata, "merge", "default.profraw", "-o", "profile", cwd=place)
    generated = map(str, sorted(sources.glob("*.[ch]")))
    text = _call(cov, "export", "tests", "-instr-profile", "profile", *generated, cwd=place)
    data: dict[str, Any] = json.loads(text)["data"][0]
    return done, data


def _conditions(profiles: Iterable[Mapping[str, Any]], sources: Path) -> dict[Place, bool]:
    """Which conditions decide alone."""
    decided: dict[Place, bool] = {}
    for profile in profiles:
        for file in profile["files"]:
            path = Path(file["filename"])
            for record in file["mcdc_records"] if path.parent == sources else []:
                line, column, *_, conditions = record
                for number, decides in enumerate(conditions):
                    place = (path.name, line, column, number)
                    decided[place] = decided.get(place, False) or decides
    return decided


def _counted(covered: Mapping[Place, bool]) -> Counted:
    missed = sorted({place[:2] for place, is_covered in covered.items() if not is_covered})
    return Counted(
        sum(covered.values()), len(covered), tuple(f"{name}:{line}" for name, line in missed)
    )
