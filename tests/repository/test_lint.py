"""tools/lint.py: each C check objects to C that breaks its rule, and to nothing in good C."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.repository.conftest import ROOT, Outcome

HEADER = """\
#ifndef TDC_DEMO_H
#define TDC_DEMO_H

#include <stdint.h>

float tdc_demo_step(float gain, int32_t counts);

#endif
"""
SOURCE = """\
#include "demo.h"

#include <string.h>

static uint32_t bits_of(float value)
{
    uint32_t bits = 0U;
    (void)memcpy(&bits, &value, sizeof(bits));
    return bits;
}

float tdc_demo_step(float gain, int32_t counts)
{
    const float product = gain * (float)counts; /* (26) */
    return (bits_of(product) > 0x7F000000U) ? 0.0f : product;
}
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    folder = tmp_path / "generated/demo"
    folder.mkdir(parents=True)
    (folder / "demo.h").write_text(HEADER, encoding="utf-8")
    (folder / "demo.c").write_text(SOURCE, encoding="utf-8")
    for name in (".clang-format", ".clang-tidy"):
        shutil.copy(ROOT / name, tmp_path)
    return tmp_path


def lint(tree: Path) -> tuple[Outcome, set[str]]:
    """Returns what lint said and the names of the checks that failed."""
    done = subprocess.run(
        [sys.executable, ROOT / "tools/lint.py", "--c-only", "--root", tree],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    summary = json.loads((tree / "build/lint.json").read_text(encoding="utf-8"))
    return Outcome(done.returncode, done.stdout), {v["check"] for v in summary if not v["ok"]}


def test_good_c_passes_every_check(tree: Path) -> None:
    outcome, failed = lint(tree)
    assert (outcome.status, failed) == (0, set()), outcome.output
    assert "lint: 6 checks passed, 0 failed" in outcome.output


@pytest.mark.parametrize(
    ("old", "new", "check", "words"),
    [
        ("    return bits;", "  return bits;", "clang-format", "clang-formatted"),
        ("gain * (float)counts", "(gain * (float)counts) * 1.0", "gcc warnings", "double"),
        ("gain * (float)counts", "gain * counts", "gcc warnings", "conversion"),
        (
            "    return bits;",
            "    const uint32_t *const nowhere = NULL;\n    if (bits > 7U) {\n"
            "        bits = *nowhere;\n    }\n    return bits;",
            "gcc -fanalyzer",
            "dereference of NULL",
        ),
        # One exit only: a rule that none of the other tools has.
        (
            "    return bits;",
            "    if (bits == 1U) {\n        return 0U;\n    }\n    return bits;",
            "cppcheck + MISRA",
            "misra-c2012-15.5",
        ),
        (
            "    return bits;",
            "    if (bits > 1U);\n    return bits;",
            "clang-tidy",
            "bugprone-suspicious-semicolon",
        ),
    ],
)
def test_bad_source_fails(tree: Path, old: str, new: str, check: str, words: str) -> None:
    source = tree / "generated/demo/demo.c"
    text = source.read_text(encoding="utf-8")
    assert old in text
    source.write_text(text.replace(old, new), encoding="utf-8")
    outcome, failed = lint(tree)
    assert outcome.status == 1
    assert check in failed
    assert words in outcome.output


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("#include <stdint.h>\n", "", "int32_t"),
        ("#ifndef TDC_DEMO_H\n#define TDC_DEMO_H\n", "#if 1\ntypedef struct { int a; } t;\n", "t"),
    ],
    ids=["needs another header", "no include guard"],
)
def test_a_header_that_cannot_stand_alone_fails(tree: Path, old: str, new: str, words: str) -> None:
    header = tree / "generated/demo/demo.h"
    header.write_text(header.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    outcome, failed = lint(tree)
    assert "headers alone" in failed
    assert words in outcome.output


def test_handwritten_c_is_formatted_and_analysed(tree: Path) -> None:
    folder = tree / "plant/compiled"
    folder.mkdir(parents=True)
    (folder / "plant.c").write_text(
        '#include "generated/demo/demo.h"\nint  loop(int n);\n'
        "int loop(int n)\n{\n    if (n > 1)\n        ;\n    return n;\n}\n",
        encoding="utf-8",
    )
    _, failed = lint(tree)
    assert failed == {"clang-format", "clang-tidy"}
