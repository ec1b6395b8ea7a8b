"""tools/make_venv.sh: what is taken for finished is finished, and is not built twice.

A shell script plays Python: it answers the questions about itself, `-m venv` copies it into the
new environment, and `-m pip` does what the environment variable PIP says.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.repository.conftest import BareComputer, Outcome

PYTHON = """\
case "$*" in
    *"sys.version_info <"*) exit ${TOO_OLD:-0} ;;
    *_base_executable*) echo "$0" ;;
    *version_info*) echo "${VERSION:-3.11}" ;;
    *ensurepip*) exit ${NO_ENSUREPIP:-0} ;;
    --version) echo "Python 3.9.2" ;;
    "-m venv "*)
        echo venv >>"$HOME/calls"
        mkdir -p "$3/bin" "$3/lib/python3.11/site-packages"
        cp "$0" "$3/bin/python"
        ;;
    *" install "*)
        echo "pip $*" >>"$HOME/calls"
        case ${PIP:-ok} in
            ok) echo "Collecting alpha" ;;
            fail) echo "pip's reason"; exit 1 ;;
            hang) touch "$HOME/hanging"; exec sleep 30 ;;
        esac
        ;;
esac
"""


class Project:
    """A small project whose Python is played by a script."""

    def __init__(self, root: Path, computer: BareComputer) -> None:
        self.root = root
        self.computer = computer
        self.script = root / "tools/make_venv.sh"
        self.stamp = root / ".venv/.complete"
        computer.add("python3", PYTHON)

    def setup(self, **environment: str) -> Outcome:
        """Runs the script to its end."""
        return self.computer.run([self.script], cwd=self.root, **environment)

    def calls(self) -> list[str]:
        """Returns what Python was asked to do since the last time, and forgets it."""
        path = self.root / "calls"
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        path.unlink(missing_ok=True)
        return [line.split()[0] for line in lines]


def group_lives(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture
def project(copy_of_tools: Callable[[], Path], bare_computer: BareComputer) -> Project:
    return Project(copy_of_tools(), bare_computer)


def test_the_second_run_does_nothing(project: Project) -> None:
    first = project.setup()
    assert first.status == 0, first.output
    assert "2.7 GB" in first.output
    assert project.calls() == ["venv", "pip", "pip"]
    second = project.setup()
    assert (second.status, second.output, project.calls()) == (0, "", [])


def test_pip_installs_only_what_is_pinned(project: Project) -> None:
    project.setup()
    pins, ours = [
        line
        for line in (project.root / "calls").read_text(encoding="utf-8").splitlines()
        if line.startswith("pip")
    ]
    assert "--require-hashes" in pins
    assert "-r constraints.txt" in pins
    assert ours.endswith("--no-deps --no-build-isolation -e .")


@pytest.mark.parametrize("name", ["constraints.txt", "pyproject.toml"])
def test_a_change_updates_in_place(project: Project, name: str) -> None:
    project.setup()
    project.calls()
    with (project.root / name).open("a", encoding="utf-8") as file:
        file.write("# new\n")
    assert "Updating .venv" in project.setup().output
    assert project.calls() == ["pip", "pip"]
    assert project.setup().output == ""


def test_a_new_date_alone_changes_nothing(project: Project) -> None:
    project.setup()
    project.calls()
    (project.root / "constraints.txt").touch()
    project.setup()
    assert project.calls() == []


def test_a_failed_install_is_reported_and_started_again(project: Project) -> None:
    failed = project.setup(PIP="fail")
    assert failed.status == 1
    assert "pip's reason" in failed.output
    assert not project.stamp.exists()
    project.calls()
    assert project.setup().status == 0
    assert project.calls() == ["venv", "pip", "pip"]


def test_a_failed_update_is_not_taken_for_finished(project: Project) -> None:
    project.setup()
    (project.root / "constraints.txt").write_text("alpha==2.0\n", encoding="utf-8")
    assert project.setup(PIP="fail").status == 1
    assert not project.stamp.exists()
    # Not even where the old pins come back: pip may have been halfway.
    (project.root / "constraints.txt").write_text("alpha==1.0\n", encoding="utf-8")
    project.calls()
    project.setup()
    assert project.calls() == ["venv", "pip", "pip"]


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_an_interrupted_setup_leaves_no_stamp(project: Project, how: signal.Signals) -> None:
    process = subprocess.Popen(
        [project.script],
        cwd=project.root,
        env={"PATH": str(project.computer.bin), "HOME": str(project.root), "PIP": "hang"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        # Tests that run in the background inherit an ignored SIGINT; a terminal's set-up doesn't.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 30
    while not (project.root / "hanging").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    # As a terminal's Ctrl-C does: to every process of the session.
    os.killpg(process.pid, how)
    assert process.wait(timeout=30) != 0
    assert not project.stamp.exists()
    while group_lives(process.pid):  # pip must be gone too
        assert time.monotonic() < deadline
        time.sleep(0.05)
    project.calls()
    assert project.setup().status == 0
    assert project.calls() == ["venv", "pip", "pip"]


def test_a_moved_project_is_built_again(project: Project) -> None:
    project.setup()
    project.calls()
    moved = project.root.with_name("moved")
    shutil.move(project.root, moved)
    project = Project(moved, project.computer)
    project.setup()
    assert project.calls() == ["venv", "pip", "pip"]


def test_another_interpreter_only_when_asked_for(project: Project) -> None:
    project.setup()
    project.calls()
    newer = project.computer.add("python3.12", PYTHON.replace(":-3.11", ":-3.12"))
    project.setup(PYTHON="python3.12")
    assert project.calls() == ["venv", "pip", "pip"]
    project.setup()
    project.setup(PYTHON=str(newer))
    assert project.calls() == []


def test_an_old_python_is_refused_with_the_fix(project: Project) -> None:
    outcome = project.setup(TOO_OLD="1")
    assert outcome.status == 1
    assert "Python 3.11 or newer is needed, and python3 is Python 3.9.2" in outcome.output
    assert "make PYTHON=" in outcome.output
    assert project.calls() == []


def test_a_newer_python_beside_an_old_one_is_found(project: Project) -> None:
    project.computer.add("python3", "exit 1")
    project.computer.add("python3.12", PYTHON)
    outcome = project.setup()
    assert outcome.status == 0, outcome.output
    assert "python3.12" in outcome.output


def test_no_python_names_the_package(project: Project) -> None:
    (project.computer.bin / "python3").unlink()
    project.computer.add("apt-get", "exit 1")
    outcome = project.setup()
    assert outcome.status == 1
    assert "apt-get install --yes --no-install-recommends python3'" in outcome.output


@pytest.mark.parametrize("built", [False, True])
def test_a_wrong_name_is_refused(project: Project, built: bool) -> None:
    if built:
        project.setup()
    outcome = project.setup(PYTHON="python9")
    assert outcome.status == 1
    assert "the command 'python9' does not run" in outcome.output
    assert project.stamp.exists() == built, "what was finished stays so"


def test_an_incomplete_foreign_python_is_refused(project: Project) -> None:
    outcome = project.setup(NO_ENSUREPIP="1")
    assert outcome.status == 1
    assert "has no ensurepip" in outcome.output
    assert not project.stamp.exists()
