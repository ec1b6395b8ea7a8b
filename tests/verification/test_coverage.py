"""Directed tests cover every branch and condition of the generated C, or say what they miss."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from codegen.controller import load
from codegen.emit import REPOSITORY
from verification.commands.coverage import missed
from verification.coverage.program import TARGET, Coverage, measure

CONTROLLERS = sorted(path.stem for path in (REPOSITORY / "controllers").glob("*.toml"))
GENERATED = REPOSITORY / "generated"


def measured(name: str, build: Path, tests: Path = TARGET / "directed.c") -> Coverage:
    return measure(load(REPOSITORY / f"controllers/{name}.toml"), tests, build)


def operators(folder: Path) -> int:
    """How many && and || the C of a folder has, outside comments and preprocessor lines."""
    text = "".join(path.read_text(encoding="utf-8") for path in folder.glob("*.[ch]"))
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    text = re.sub(r"^#(?:.*\\\n)*.*$", "", text, flags=re.MULTILINE)
    return len(re.findall(r"&&|\|\|", text))


@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_branch_is_taken_and_every_condition_decides(tmp_path: Path, name: str) -> None:
    result = measured(name, tmp_path)
    assert missed(result) == []
    assert result.whole
    # The compiler saw every decision that the text has: n operators join n + 1 conditions.
    assert result.conditions.total - result.decisions == operators(GENERATED / name)


@pytest.mark.parametrize("left_out", ["starts", "steps_without_arguments", "shared_functions"])
def test_what_a_case_alone_covers_is_missed_without_it(tmp_path: Path, left_out: str) -> None:
    text = (TARGET / "directed.c").read_text(encoding="utf-8")
    assert f"{left_out}();" in text
    tests = tmp_path / "directed.c"
    tests.write_text(text.replace(f"{left_out}();", f"(void){left_out};"), encoding="utf-8")
    result = measured("puma3", tmp_path, tests)
    assert result.passed
    assert not result.branches.whole
    assert not result.conditions.whole
    assert all(
        re.search(r"puma3: a (branch|condition) not covered at \w+\.[ch]:\d+", line)
        for line in missed(result)
    )


def test_a_case_that_fails_is_told(tmp_path: Path) -> None:
    text = (TARGET / "directed.c").read_text(encoding="utf-8")
    tests = tmp_path / "directed.c"
    tests.write_text(text.replace("== TDC_ENCODER_JUMP", "== TDC_OK"), encoding="utf-8")
    result = measured("puma3", tmp_path, tests)
    assert not result.passed
    assert "tick(&b) == TDC_OK" in missed(result)[0]
