"""Compilers and their flags, for every test that compiles C."""

from __future__ import annotations

import subprocess
from pathlib import Path

WARNINGS = (
    *("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion"),
    *("-Wfloat-conversion", "-Wdouble-promotion", "-Wshadow", "-Wstrict-prototypes"),
    *("-Wcast-qual", "-Wundef", "-Werror"),
)
CORTEX_M4F = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")


def run(*command: str | Path) -> str:
    """What the command prints; fails the test with its error output."""
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
