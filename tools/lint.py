"""`make lint`: every style, type and C check, all of them run before the verdict.

Generated C is judged by all of the C tools; handwritten C by the formatter and clang-tidy. What a
tool printed is shown only where it objects. The summary stands in build/lint.json as well.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

TOOLS = Path(__file__).resolve().parent
VENV_BIN = Path(sys.executable).parent

HANDWRITTEN = ("examples", "firmware_stub", "plant", "verification", "tests")
# Read by host tools only: a board's start-up code needs a target compiler's headers.
ANALYSED_ON_HOST = ("plant", "verification", "tests")
C_SUFFIXES = (".c", ".h")
NOT_OURS = {"build", "__pycache__", "node_modules"}

# -Wconversion and -Wfloat-conversion are what sees a float silently computed in double;
# -Wdouble-promotion alone does not (https://github.com/casadi/casadi/issues/3796).
GCC_FLAGS = (
    *("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror"),
    *("-Wconversion", "-Wfloat-conversion", "-Wdouble-promotion"),
    *("-Wshadow", "-Wstrict-prototypes", "-Wmissing-prototypes", "-Wcast-qual"),
    *("-Wundef", "-Wvla"),
)

CPPCHECK_FLAGS = (
    *("--std=c99", "--quiet", "--addon=misra", "--check-level=exhaustive"),
    "--enable=warning,style,performance,portability",
)
# Each place where a rule is broken says why, there or here.
DEVIATIONS = TOOLS / "cppcheck_suppressions.txt"


@dataclass(frozen=True)
class Check:
    """One tool and its runs: the name as printed, and the command lines."""

    name: str
    commands: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Verdict:
    """What a check said: exit status 0 means that it found nothing."""

    check: Check
    status: int
    output: str
    seconds: float


def c_files(root: Path, folder: str) -> list[Path]:
    """Lists the C sources and headers below root/folder, relative to root, in a fixed order."""
    found = (p.relative_to(root) for p in (root / folder).rglob("*") if p.suffix in C_SUFFIXES)
    return sorted(p for p in found if not NOT_OURS.intersection(p.parts))


def include_flags(root: Path, generated: Sequence[Path]) -> tuple[str, ...]:
    """Returns -I for the root and each folder of generated C, as handwritten C includes them."""
    folders = sorted({p.parent for p in generated})
    return ("-I", str(root), *(word for f in folders for word in ("-I", str(root / f))))


def gcc_checks(generated: Sequence[Path], scratch: Path) -> list[Check]:
    """Compiles each generated source, and includes each generated header on its own.

    Some warnings come only from the optimiser, hence -O2 and real objects.
    """
    sources = [p for p in generated if p.suffix == ".c"]
    headers = [p for p in generated if p.suffix == ".h"]
    compile_all = tuple(
        ("gcc", *GCC_FLAGS, "-O2", "-c", str(p), "-o", str(scratch / f"{i}.o"))
        for i, p in enumerate(sources)
    )
    # Slower, and another kind of judge: it follows every path through a function.
    analyse_all = tuple(
        ("gcc", *GCC_FLAGS, "-O2", "-fanalyzer", "-S", str(p), "-o", os.devnull) for p in sources
    )
    checks = []
    if sources:
        checks += [Check("gcc warnings", compile_all), Check("gcc -fanalyzer", analyse_all)]
    if headers:
        # Twice, so that a missing include guard shows.
        alone = tuple(
            ("gcc", *GCC_FLAGS, "-fsyntax-only", "-x", "c", str(_includer(p, scratch, i)))
            for i, p in enumerate(headers)
        )
        checks.append(Check("headers alone", alone))
    return checks


def _includer(header: Path, scratch: Path, number: int) -> Path:
    text = f'#include "{header.resolve()}"\n' * 2 + "typedef int translation_unit_not_empty;\n"
    path = scratch / f"includes_{number}.c"
    path.write_text(text, encoding="utf-8")
    return path


def cppcheck_checks(generated: Sequence[Path]) -> list[Check]:
    """One run for each generated folder: MISRA has rules about a whole program."""
    folders = sorted({p.parent for p in generated if p.suffix == ".c"})
    runs = tuple(
        (
            "cppcheck",
            *CPPCHECK_FLAGS,
            *("--error-exitcode=1", "--inline-suppr", f"--suppressions-list={DEVIATIONS}"),
            *(str(p) for p in generated if p.parent == folder and p.suffix == ".c"),
        )
        for folder in folders
    )
    return [Check("cppcheck + MISRA", runs)] if runs else []


def clang_checks(root: Path, generated: Sequence[Path], handwritten: Sequence[Path]) -> list[Check]:
    """Formatting of all C, and clang-tidy over what the host's headers suffice for."""
    every = [*generated, *handwritten]
    analysed = [
        p for p in every if p.suffix == ".c" and p.parts[0] in ("generated", *ANALYSED_ON_HOST)
    ]
    checks = []
    if every:
        command = ("clang-format", "--dry-run", "-Werror", *(str(p) for p in every))
        checks.append(Check("clang-format", (command,)))
    if analysed:
        flags = ("--", "-std=c99", *include_flags(root, generated))
        runs = tuple(("clang-tidy", "--quiet", str(p), *flags) for p in analysed)
        checks.append(Check("clang-tidy", runs))
    return checks


def page_checks(root: Path) -> list[Check]:
    """Whether docs/misra.md is what the checker says today."""
    command = (sys.executable, "-m", "tools.misra", "--check")
    return [Check("docs/misra.md", (command,))] if (root / "docs/misra.md").is_file() else []


def python_checks() -> list[Check]:
    """Formatting, rules and types of all Python."""
    return [
        Check("ruff check", (("ruff", "check", "."),)),
        Check("ruff format", (("ruff", "format", "--check", "."),)),
        Check("mypy --strict", (("mypy",),)),
    ]


def run_check(check: Check, root: Path) -> Verdict:
    """Runs a check's commands from root, all of them, with our environment's tools first."""
    # cppcheck starts its addon with `python3`, clang-tidy its own helper: ours for both.
    environment = os.environ | {"PATH": f"{VENV_BIN}{os.pathsep}{os.environ.get('PATH', '')}"}
    start = time.monotonic()
    status, output = 0, []
    for command in check.commands:
        try:
            done = subprocess.run(
                command,
                cwd=root,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                check=False,
            )
        except FileNotFoundError:
            return Verdict(check, 127, f"{command[0]}: not found\n", time.monotonic() - start)
        status = status or done.returncode
        if done.returncode:
            output.append(done.stdout)
    return Verdict(check, status, "".join(output), time.monotonic() - start)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the checks and returns the exit status: 1 if any of them objects."""
    parser = argparse.ArgumentParser(prog="tools/lint.py", description=__doc__)
    parser.add_argument("--root", type=Path, default=TOOLS.parent, help="the tree to judge")
    parser.add_argument("--c-only", action="store_true", help="leave out the Python checks")
    options = parser.parse_args(arguments)
    root: Path = options.root.resolve()

    generated = c_files(root, "generated")
    handwritten = [p for folder in HANDWRITTEN for p in c_files(root, folder)]
    with tempfile.TemporaryDirectory() as scratch_name:
        checks = [] if options.c_only else python_checks()
        checks += clang_checks(root, generated, handwritten)
        checks += cppcheck_checks(generated)
        checks += page_checks(root)
        checks += gcc_checks([root / p for p in generated], Path(scratch_name))
        with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
            verdicts = []
            for verdict in pool.map(lambda check: run_check(check, root), checks):
                verdicts.append(verdict)
                if verdict.status:
                    print(f"-- {verdict.check.name}\n{verdict.output.rstrip()}\n")
                mark = "FAIL" if verdict.status else "ok"
                print(f"{mark:>4}  {verdict.check.name:<18}{verdict.seconds:6.1f} s", flush=True)
    if not generated:
        print("      (no generated C yet: its checks had nothing to read)")

    summary = [
        {
            "check": v.check.name,
            "ok": v.status == 0,
            "runs": len(v.check.commands),
            "seconds": round(v.seconds, 2),
        }
        for v in verdicts
    ]
    out = root / "build" / "lint.json"
    out.parent.mkdir(exist_ok=True)
    out.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    bad = [v.check.name for v in verdicts if v.status]
    print(f"lint: {len(verdicts) - len(bad)} checks passed, {len(bad)} failed")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
