"""tools/system_tools.sh: says what is missing, installs it where it may, else how to."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.repository.conftest import ROOT, BareComputer, Outcome

SCRIPT = ROOT / "tools/system_tools.sh"
TABLE = """\
# a comment, and an empty line

test   cross-gcc         cross-package  compiles for the board
test   cross-gcc:nice.h  cross-libc     its headers
other  something         unrelated      is not asked for
"""
# Stands for apt: says that every package is known, and writes down what it is asked for.
APT_CACHE = 'echo "  Candidate: 1.0"'
APT = """\
echo "apt-get $*" >>"$HOME/asked"
case "$*" in *install*) [ -z "$INSTALLS" ] || cp "$HOME/cross-gcc" "$(dirname "$0")/" ;; esac
exit ${APT_STATUS:-0}
"""


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "table.txt"
    path.write_text(TABLE, encoding="utf-8")
    return path


def run(computer: BareComputer, table: Path, **environment: str) -> Outcome:
    return computer.run([SCRIPT, "-t", table, "test"], cwd=table.parent, **environment)


def asked(table: Path) -> list[str]:
    path = table.parent / "asked"
    return path.read_text(encoding="utf-8").splitlines() if path.exists() else []


def test_without_rights_names_the_command_and_fails(
    bare_computer: BareComputer, table: Path
) -> None:
    bare_computer.add("apt-get", APT)
    outcome = run(bare_computer, table)
    assert outcome.status == 1
    assert "cross-gcc, from the package cross-package: compiles for the board" in outcome.output
    assert (
        "su -c 'apt-get update && apt-get install --yes --no-install-recommends"
        " cross-package cross-libc'"
    ) in outcome.output
    assert "unrelated" not in outcome.output
    assert asked(table) == []


def test_sudo_that_asks_for_a_password_is_not_used(
    bare_computer: BareComputer, table: Path
) -> None:
    bare_computer.add("apt-get", APT)
    bare_computer.add("sudo", "exit 1")
    outcome = run(bare_computer, table)
    assert outcome.status == 1
    assert "takes root's rights" in outcome.output
    assert (
        "sudo apt-get update && sudo apt-get install --yes --no-install-recommends"
        " cross-package cross-libc"
    ) in outcome.output
    assert asked(table) == []


def test_without_apt_names_the_tools_and_fails(bare_computer: BareComputer, table: Path) -> None:
    outcome = run(bare_computer, table)
    assert outcome.status == 1
    assert "no apt-get here" in outcome.output
    assert "the header nice.h for cross-gcc" in outcome.output


@pytest.mark.parametrize("rights", ["root", "sudo"])
def test_with_rights_installs(bare_computer: BareComputer, table: Path, rights: str) -> None:
    if rights == "root":
        bare_computer.add("id", "echo 0")
    else:
        bare_computer.add("sudo", '[ "$1" = -n ] && shift; "$@"')
    bare_computer.add("apt-cache", APT_CACHE)
    bare_computer.add("apt-get", APT)
    (table.parent / "cross-gcc").write_text("#!/bin/sh\nexit 0\n", encoding="utf-8")
    (table.parent / "cross-gcc").chmod(0o755)

    outcome = run(bare_computer, table, INSTALLS="yes")
    assert outcome.status == 0, outcome.output
    assert "Installing now:" in outcome.output
    (call,) = asked(table)
    assert call.endswith("install --yes --no-install-recommends cross-package cross-libc")

    again = run(bare_computer, table)
    assert (again.status, again.output) == (0, "")
    assert len(asked(table)) == 1


def test_unknown_packages_fetch_the_lists_first(bare_computer: BareComputer, table: Path) -> None:
    bare_computer.add("id", "echo 0")
    bare_computer.add("apt-cache", 'echo "  Candidate: (none)"')
    bare_computer.add("apt-get", APT)
    run(bare_computer, table)
    assert [line.split()[6] for line in asked(table)] == ["update", "install"]


def test_apt_that_fails_is_tried_with_new_lists_then_reported(
    bare_computer: BareComputer, table: Path
) -> None:
    bare_computer.add("id", "echo 0")
    bare_computer.add("apt-cache", APT_CACHE)
    bare_computer.add("apt-get", "echo 'E: no such luck'\n" + APT)
    outcome = run(bare_computer, table, APT_STATUS="100")
    assert outcome.status == 1
    assert [line.split()[6] for line in asked(table)] == ["install", "update"]
    assert "E: no such luck" in outcome.output
    assert "By hand:" in outcome.output


def test_install_that_brings_nothing_is_a_failure(bare_computer: BareComputer, table: Path) -> None:
    bare_computer.add("id", "echo 0")
    bare_computer.add("apt-cache", APT_CACHE)
    bare_computer.add("apt-get", APT)
    outcome = run(bare_computer, table)
    assert outcome.status == 1
    assert "still missing after installing cross-package cross-libc" in outcome.output


def test_the_real_table_has_four_columns_and_known_groups() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for line in (ROOT / "tools/system_tools.txt").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            group, _probe, _package, purpose = line.split(maxsplit=3)
            assert re.search(rf"tools/system_tools.sh .*\b{group}\b", makefile), line
            assert purpose, line
