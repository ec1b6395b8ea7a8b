"""Builds the fuzzer of a controller, runs it, and reads what it did.

The generated C alone is watched for coverage and undefined behaviour; AddressSanitizer watches all.
"""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from codegen.controller import Controller
from codegen.emit import REPOSITORY
from plant.native import BUILD, sources_of
from verification.firmware import ToolError, tool
from verification.fuzz.tables import STATUS_NAME, tables

TARGET = Path(__file__).parent / "target"
CORPUS = Path(__file__).parent / "corpus"
"""Inputs that reach every edge of the C known so far; the same for all controllers."""
FUZZ_BUILD = BUILD / "fuzz"

CLANG = "clang-19"
ROUND_S = 20.0
LONGEST_INPUT = 1024
"""[bytes]; one takes up to some thousand steps."""

_FLAGS = (
    *("-std=c99", "-O2", "-g", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"),
    *("-fsanitize=address", "-fno-sanitize-recover=all"),
)
_UNDEFINED = (
    "undefined",
    "float-cast-overflow",
    "float-divide-by-zero",
    "implicit-conversion",
    "local-bounds",
)
_WATCHED = (f"-fsanitize=fuzzer-no-link,address,{','.join(_UNDEFINED)}",)
_SAYS = re.compile(
    r"^(?:CONTRACT BROKEN: |.*: runtime error: |==\d+== ?ERROR: )(.*)$", re.MULTILINE
)
_EXECUTIONS = re.compile(r"^stat::number_of_executed_units:\s*(\d+)", re.MULTILINE)


@dataclass(frozen=True)
class Finding:
    """What broke.

    Attributes:
        says: the sanitizer's or the contract's sentence.
        input: the file that breaks it again.
        command: how.
    """

    says: str
    input: Path
    command: str


@dataclass(frozen=True)
class Fuzzed:
    """What a controller's fuzzer did.

    Attributes:
        controller: its name.
        seconds: for how long.
        inputs: how many were run.
        steps: how many ticks ended with each status, by its name in C.
        good: how many of them had a torque to apply.
        starts: how many calls of init did.
        refused: configurations that check_config refused.
        taken: those that it took.
        finding: the first thing that broke, which ends it.
    """

    controller: str
    seconds: float
    inputs: int
    steps: dict[str, int]
    good: int
    starts: dict[str, int]
    refused: int
    taken: int
    finding: Finding | None

    @property
    def steps_taken(self) -> int:
        """All ticks together."""
        return sum(self.steps.values())


@dataclass(frozen=True)
class Fuzzer:
    """A controller's compiled fuzzer."""

    controller: str
    program: Path
    statuses: dict[int, str]

    @property
    def corpus(self) -> Path:
        """What it has found out so far; it goes on from there."""
        return self.program.parent / "corpus"

    def nothing(self) -> Fuzzed:
        """Before it ran."""
        none = dict.fromkeys(self.statuses.values(), 0)
        return Fuzzed(self.controller, 0.0, 0, none, 0, dict(none), 0, 0, None)


def build(controller: Controller, into: Path = FUZZ_BUILD, sources: Path | None = None) -> Fuzzer:
    """Compiles the fuzzer of a controller.

    Args:
        controller: whose tables.
        into: where a folder of its own is for program, corpus and findings.
        sources: a folder with its C in place of the generated one.

    Raises:
        ToolError: the compiler is missing, or refused the C.
    """
    clang = tool(CLANG, CLANG)
    folder = into / controller.name
    sources = sources_of(controller) if sources is None else sources
    folder.mkdir(parents=True, exist_ok=True)
    header = (sources / "tdc.h").read_text(encoding="utf-8")
    written = folder / "tables.c"
    written.write_text(tables(controller, header), encoding="utf-8")
    flags = (
        *_FLAGS,
        *("-I", str(REPOSITORY), "-I", str(sources)),
        f"-DCONTROLLER={controller.name}",
        f"-DCONTROLLER_UPPER={controller.name.upper()}",
    )
    objects = []
    for source in (TARGET / "fuzz.c", TARGET / "scalars.c", written, *sorted(sources.glob("*.c"))):
        watched = _WATCHED if source.parent == sources else ()
        objects.append(str(folder / f"{source.stem}.o"))
        _compile(clang, *flags, *watched, "-c", str(source), "-o", objects[-1])
    program = folder / "fuzz"
    _compile(clang, "-fsanitize=fuzzer,address,undefined", *objects, "-o", str(program))
    return Fuzzer(controller.name, program, {int(v): k for k, v in STATUS_NAME.findall(header)})


def _compile(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ToolError(
            f"{command[0]} failed: {done.stderr.strip().splitlines()[-1]}\n"
            "Its runtime is the package libclang-rt-19-dev; `make fuzz` installs it"
            if "libclang_rt" in done.stderr
            else f"{command[0]} failed:\n{done.stderr}"
        )


def run(fuzzer: Fuzzer, seconds: float) -> Fuzzed:
    """Fuzzes for some seconds, starting from the kept corpus and from its own.

    Raises:
        ToolError: it ended without having run.
    """
    fuzzer.corpus.mkdir(exist_ok=True)
    with tempfile.NamedTemporaryFile(mode="r", encoding="utf-8") as counts:
        done = subprocess.run(
            [
                *(str(fuzzer.program), f"-max_total_time={max(1, round(seconds))}"),
                *(f"-max_len={LONGEST_INPUT}", "-print_final_stats=1"),
                f"-artifact_prefix={fuzzer.program.parent}/",
                *(str(fuzzer.corpus), *([str(CORPUS)] if CORPUS.is_dir() else [])),
            ],
            env=os.environ | {"FUZZ_COUNTS": counts.name, "UBSAN_OPTIONS": "print_stacktrace=1"},
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
        return _read(fuzzer, seconds, done, counts.read())


def _read(
    fuzzer: Fuzzer, seconds: float, done: subprocess.CompletedProcess[str], counts: str
) -> Fuzzed:
    log = fuzzer.program.parent / "log.txt"
    log.write_text(done.stderr, encoding="utf-8")
    result = replace(fuzzer.nothing(), seconds=seconds)
    if done.returncode != 0:
        return replace(result, finding=_finding(fuzzer, done.stderr, log))
    executions = _EXECUTIONS.search(done.stderr)
    rows = [line.split() for line in counts.splitlines()]
    if not rows or executions is None:
        raise ToolError(f"the fuzzer of {fuzzer.controller} told nothing: see {log}")
    by_status = {fuzzer.statuses[int(row[0])]: row for row in rows[:-1]}
    return replace(
        result,
        inputs=int(executions[1]),
        steps={name: int(row[1]) for name, row in by_status.items()},
        good=sum(int(row[1]) for row in rows[:-1] if int(row[0]) >= 0),
        starts={name: int(row[2]) for name, row in by_status.items()},
        refused=int(rows[-1][1]),
        taken=int(rows[-1][2]),
    )


def _finding(fuzzer: Fuzzer, log: str, path: Path) -> Finding:
    says, written = _SAYS.search(log), re.search(r"Test unit written to (\S+)", log)
    if written is None:
        raise ToolError(f"the fuzzer of {fuzzer.controller} ended by itself: see {path}")
    found = Path(written[1])
    return Finding(
        says[1] if says is not None else "see the log", found, f"{fuzzer.program} {found}"
    )


def both(first: Fuzzed, second: Fuzzed) -> Fuzzed:
    """Two rounds of the same fuzzer."""
    return Fuzzed(
        first.controller,
        first.seconds + second.seconds,
        first.inputs + second.inputs,
        {name: n + second.steps[name] for name, n in first.steps.items()},
        first.good + second.good,
        {name: n + second.starts[name] for name, n in first.starts.items()},
        first.refused + second.refused,
        first.taken + second.taken,
        first.finding or second.finding,
    )


def fuzz(
    fuzzer: Fuzzer,
    seconds: float,
    least_steps: int = 0,
    advance: Callable[[Fuzzed], None] = lambda _: None,
) -> Fuzzed:
    """Fuzzes in rounds, until the time is over and enough steps are taken, or something broke."""
    result = fuzzer.nothing()
    while result.finding is None and (result.seconds < seconds or result.steps_taken < least_steps):
        left = seconds - result.seconds
        taken = run(fuzzer, min(ROUND_S, left) if left > 0 else ROUND_S)
        result = both(result, taken)
        advance(taken)
    return result


def keep(fuzzers: Sequence[Fuzzer], corpus: Path = CORPUS) -> int:
    """Replaces the kept corpus by a small one that reaches all edges; returns how many inputs."""
    with tempfile.TemporaryDirectory() as scratch:
        small = Path(scratch)
        for fuzzer in fuzzers:
            # Edges, not how often each is taken: the working corpora hold those.
            merge = ("-set_cover_merge=1", "-use_counters=0", f"-max_len={LONGEST_INPUT}")
            sources = [str(p) for p in (corpus, fuzzer.corpus) if p.is_dir()]
            done = subprocess.run(
                [str(fuzzer.program), *merge, scratch, *sources],
                capture_output=True,
                text=True,
                errors="replace",
                check=False,
            )
            if done.returncode != 0:
                raise ToolError(f"merging the corpora failed:\n{done.stderr[-2000:]}")
        kept = {path.name: path.read_bytes() for path in sorted(small.iterdir())}
    corpus.mkdir(exist_ok=True)
    for old in corpus.iterdir():
        old.unlink()
    for name, content in kept.items():
        (corpus / name).write_bytes(content)
    return len(kept)
