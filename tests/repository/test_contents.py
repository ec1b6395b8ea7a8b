"""What the repository holds: its help, its pins, and nothing of the machine it was made on."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from tests.repository.conftest import ROOT, source_files

MAKEFILE = ROOT / "Makefile"


def targets_of(makefile: str) -> set[str]:
    names = re.findall(r"^([A-Za-z0-9_./%-]+)\s*:(?![=:])", makefile, flags=re.MULTILINE)
    return {name for name in names if not name.startswith(".") and not (ROOT / name).is_file()}


def normalised(package: str) -> str:
    return re.sub(r"[-_.]+", "-", package).lower()


def pins() -> dict[str, list[str]]:
    """Reads constraints.txt: each requirement line with the lines that continue it."""
    text = (ROOT / "constraints.txt").read_text(encoding="utf-8")
    entries: dict[str, list[str]] = {}
    for entry in text.replace("\\\n", " ").splitlines():
        if entry.strip() and not entry.startswith("#"):
            requirement, *hashes = entry.split("--hash=")
            entries[requirement.strip()] = [value.strip() for value in hashes]
    return entries


def test_help_lists_every_target() -> None:
    shown = subprocess.run(
        ["make", "--no-print-directory", "help"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    listed = {line.split()[0] for line in shown.splitlines() if line.startswith("  ")}
    assert listed == targets_of(MAKEFILE.read_text(encoding="utf-8"))
    assert "\x1b" not in shown, "colours are for terminals"


def test_help_reads_comments_above_and_beside(tmp_path: Path) -> None:
    makefile = tmp_path / "Makefile"
    makefile.write_text(
        "variable := 1\n## Above\n.PHONY: one\none:\n\ttrue\n\ntwo: one ## Beside\n\nthree:\n",
        encoding="utf-8",
    )
    shown = subprocess.run(
        [ROOT / "tools/help.sh", makefile], capture_output=True, text=True, check=True
    ).stdout
    rows = [line.split() for line in shown.splitlines() if line.startswith("  ")]
    assert rows == [["one", "Above"], ["two", "Beside"]]


def test_every_target_is_phony() -> None:
    makefile = MAKEFILE.read_text(encoding="utf-8")
    phony = set(re.findall(r"^\.PHONY: (\S+)$", makefile, flags=re.MULTILINE))
    assert phony == targets_of(makefile)


def test_each_pin_is_exact_and_hashed() -> None:
    entries = pins()
    assert len(entries) > 20
    for requirement, hashes in entries.items():
        assert re.match(r"^[A-Za-z0-9._-]+==[^ ;]+( ; .+)?$", requirement), requirement
        assert hashes, f"{requirement} has no hash"
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", value) for value in hashes), requirement


def test_pins_carry_no_address() -> None:
    text = (ROOT / "constraints.txt").read_text(encoding="utf-8")
    assert "://" not in text
    assert not re.search(r"^\s*-(i|f|-index|-extra|-find|-trusted)", text, flags=re.MULTILINE)


def test_every_dependency_is_pinned() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"]]
    for extra in project["optional-dependencies"].values():
        wanted += extra
    names = {normalised(re.split(r"[^A-Za-z0-9._-]", word, maxsplit=1)[0]) for word in wanted}
    pinned = {normalised(requirement.split("==")[0]) for requirement in pins()}
    assert names - pinned == set(), "run `make lock`"


# A home or work folder of whoever wrote the file, or the address of a package index. Spelled so
# that this file does not match itself.
FORBIDDEN = {
    "a path of one machine": re.compile(r"(?<![\w.:/})~-])/(?:work|root|home)/\w"),
    "a package index": re.compile(
        r"https?://[^\s\"'<>]+/simple\b|files\.python[h]osted|/artifact[s]?-?registry"
    ),
    "an option for a package index": re.compile(r"(?:index-url|find-links)[ =]+\S*:/[/]"),
}


def findings(text: str) -> list[str]:
    return [
        f"line {number}: {what}: {line.strip()[:120]}"
        for number, line in enumerate(text.splitlines(), start=1)
        for what, pattern in FORBIDDEN.items()
        if pattern.search(line)
    ]


def test_no_file_carries_a_machine_path_or_an_index_address() -> None:
    files = source_files()
    assert MAKEFILE in files
    found = {}
    for path in files:
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # pictures and archives
        if bad := findings(text):
            found[str(path.relative_to(ROOT))] = bad
    assert found == {}


@pytest.mark.parametrize(
    "text",
    [
        "include = '/" + "work/main/plant'",
        '#line 3 "/' + 'home/me/project/a.c"',
        "https:/" + "/mirror.example/pypi/simple",
        "--index-url=https:/" + "/mirror.example",
    ],
)
def test_findings_finds(text: str) -> None:
    assert findings(text)


@pytest.mark.parametrize(
    "text", ["https://example.org/work/paper", "build/report", "$HOME/project", "./work/x"]
)
def test_findings_leaves_the_rest_alone(text: str) -> None:
    assert findings(text) == []


def test_source_files_without_git_finds_the_same(tmp_path: Path) -> None:
    (tmp_path / "plant").mkdir()
    (tmp_path / "plant/model.py").touch()
    (tmp_path / "build").mkdir()
    (tmp_path / "build/out.json").touch()
    assert source_files(tmp_path) == [tmp_path / "plant/model.py"]


def test_ci_runs_the_three_gates() -> None:
    script = (ROOT / ".ci/run").read_text(encoding="utf-8")
    assert "set -euo pipefail" in script
    for target in ("test", "lint", "check-generated"):
        assert re.search(rf"\b{target}\b", script), target
