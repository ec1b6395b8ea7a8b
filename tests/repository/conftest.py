"""What the repository's own tests share: its root, its files, and a computer without tools."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PYTHON = ".venv/bin/python"
"""How the pages call it, from the root."""
# Written by the targets or by git; everything else in the tree is ours.
NOT_SOURCE = {".git", ".venv", "build", "__pycache__", ".hypothesis"}
# What the set-up scripts call besides the tools that they look for.
PLAIN_COMMANDS = (
    "awk basename cat chmod cp cut date dirname env find flock grep head kill ls mkdir mktemp mv"
    " printf pwd rm sed sh sha256sum sleep sort tail touch tr uname wc"
)


def source_files(root: Path = ROOT) -> list[Path]:
    """Lists the files that belong to the repository, with git where it is there, else by walking.

    A release tarball has no .git, and its tests must pass too.
    """
    try:
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=root,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            check=True,
        )
        # Inside another repository git answers too, but about that one's tree.
        names = listed.stdout.decode().split("\0") if (root / ".git").exists() else None
    except (OSError, subprocess.CalledProcessError):
        names = None
    if names is not None:
        paths = [root / name for name in names if name]
    else:
        paths = [
            path
            for path in root.rglob("*")
            if not any(
                part in NOT_SOURCE or part.endswith((".egg-info", "_cache"))
                for part in path.relative_to(root).parts
            )
        ]
    return sorted(path for path in paths if path.is_file())


@dataclass(frozen=True)
class Outcome:
    """What a script did: exit status and everything it printed."""

    status: int
    output: str


@dataclass(frozen=True)
class BareComputer:
    """A PATH on which only the listed plain commands stand, to which a test adds its own."""

    bin: Path

    def add(self, name: str, script: str) -> Path:
        """Puts a shell script on the PATH as the command `name`."""
        path = self.bin / name
        path.unlink(missing_ok=True)
        path.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        path.chmod(0o755)
        return path

    def run(self, command: Sequence[str | Path], cwd: Path, **environment: str) -> Outcome:
        """Runs a command to its end with this PATH and without standard input."""
        done = subprocess.run(
            [str(word) for word in command],
            cwd=cwd,
            env={"PATH": str(self.bin), "HOME": str(cwd), **environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=60,
            check=False,
        )
        return Outcome(done.returncode, done.stdout)


@pytest.fixture
def bare_computer(tmp_path: Path) -> BareComputer:
    """A computer with a shell and the plain commands, an ordinary user, and no tools."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in PLAIN_COMMANDS.split():
        found = shutil.which(name)
        if found:
            (folder / name).symlink_to(found)
    computer = BareComputer(folder)
    computer.add("id", "echo 1000")
    return computer


@pytest.fixture
def copy_of_tools(tmp_path: Path) -> Callable[[], Path]:
    """Copies the set-up scripts into a small project of their own and returns its root."""

    def copy() -> Path:
        root = tmp_path / "project"
        shutil.copytree(ROOT / "tools", root / "tools", ignore=shutil.ignore_patterns("__pyc*"))
        (root / "constraints.txt").write_text("alpha==1.0\n", encoding="utf-8")
        (root / "pyproject.toml").write_text("[project]\n", encoding="utf-8")
        return root

    return copy


@pytest.fixture(scope="session")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The repository once more, to run commands in; what was compiled before serves there, too."""
    root = tmp_path_factory.mktemp("copy") / "project"
    for file in source_files():
        target = root / file.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(file, target)
    (ROOT / "build" / "host").mkdir(parents=True, exist_ok=True)
    (root / "build").mkdir()
    (root / "build" / "host").symlink_to(ROOT / "build" / "host")
    (root / ".venv" / "bin").mkdir(parents=True)
    (root / PYTHON).write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n', encoding="utf-8")
    (root / PYTHON).chmod(0o755)
    return root
