"""The tools that try a package: how they are called, and what it means when they refuse."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path


class CheckError(Exception):
    """A part of a package doesn't work; the message says which and what its tool said."""


def _environment() -> dict[str, str]:
    """Of the tools that are run: the pinned ones first, and no word to a network."""
    pinned = str(Path(sys.executable).parent)
    return {
        **os.environ,
        "PATH": os.pathsep.join([pinned, os.environ.get("PATH", "")]),
        "PLATFORMIO_SETTING_ENABLE_TELEMETRY": "no",
        "PLATFORMIO_SETTING_CHECK_PLATFORMIO_INTERVAL": "100000",
        "IDF_COMPONENT_CHECK_NEW_VERSION": "0",
    }


def run(command: Sequence[str | Path], directory: Path, **more: str) -> str:
    """What a tool prints.

    Raises:
        CheckError: it ends with an error.
    """
    done = tried(command, directory, **more)
    if done.returncode != 0:
        raise CheckError(f"{' '.join(map(str, command))} failed:\n{done.stdout}{done.stderr}")
    return done.stdout


def tried(
    command: Sequence[str | Path], directory: Path, **more: str
) -> subprocess.CompletedProcess[str]:
    """A tool that may end with an error.

    Raises:
        CheckError: it isn't there.
    """
    environment = {**_environment(), **more}
    program = shutil.which(str(command[0]), path=environment["PATH"])
    if program is None:
        raise CheckError(f"{command[0]} not found: run `make` once to install it")
    return subprocess.run(
        [program, *map(str, command[1:])],
        cwd=directory,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
