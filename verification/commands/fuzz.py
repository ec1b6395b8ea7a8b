"""`python -m verification fuzz`: the generated C under libFuzzer and its sanitizers."""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ThreadPoolExecutor

from rich.table import Table

from codegen.controller import Controller
from verification.commands.arguments import add_controllers, controllers
from verification.commands.output import Output
from verification.equivalence import variants
from verification.evidence import Evidence, plain
from verification.experiments import CONTROLLERS
from verification.firmware import ToolError
from verification.fuzz.program import Fuzzed, Fuzzer, build, fuzz, keep

ERRORS = (ToolError,)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    parser.add_argument(
        "--minutes", type=_positive, default=1.0, help="in all (default: %(default)s)"
    )
    parser.add_argument(
        "--steps", type=_steps, default=0, help="goes on until each controller took so many"
    )
    parser.add_argument(
        "--structures", action="store_true", help="every structure of the law of each controller"
    )
    parser.add_argument(
        "--keep", action="store_true", help="keep the inputs that reach something new"
    )
    add_controllers(parser)


def _positive(text: str) -> float:
    try:
        minutes = float(text)
    except ValueError:
        minutes = 0.0
    if not 0.0 < minutes <= 10000.0:
        raise argparse.ArgumentTypeError(f"minutes, more than 0, at most 10000; not {text!r}")
    return minutes


def _steps(text: str) -> int:
    try:
        steps = float(text)
    except ValueError:
        steps = -1.0
    if not 0.0 <= steps <= 1e12:
        raise argparse.ArgumentTypeError(f"a number of steps up to 1e12, such as 1e8; not {text!r}")
    return int(steps)


def _chosen(arguments: argparse.Namespace) -> list[Controller]:
    names = arguments.controller or sorted(p.stem for p in CONTROLLERS.glob("*.toml"))
    chosen = controllers(names)
    if arguments.structures:
        chosen = [each for controller in chosen for each in variants(controller)]
    return chosen


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    jobs = os.cpu_count() or 1
    with output.status("compiling the fuzzers"), ThreadPoolExecutor(jobs) as pool:
        fuzzers = list(pool.map(build, _chosen(arguments)))
    seconds = max(1.0, 60.0 * arguments.minutes * min(jobs, len(fuzzers)) / len(fuzzers))

    with output.bar("steps", None) as advance, ThreadPoolExecutor(jobs) as pool:

        def one(fuzzer: Fuzzer) -> Fuzzed:
            return fuzz(fuzzer, seconds, arguments.steps, lambda done: advance(done.steps_taken))

        results = list(pool.map(one, fuzzers))
    if arguments.keep:
        with output.status("merging the corpora"):
            kept = keep(fuzzers)
        output.progress.print(f"kept: {kept} inputs")
    findings = [result for result in results if result.finding is not None]
    if not output.as_json:
        output.console.print(table_of(results))
        for result in findings:
            assert result.finding is not None
            output.console.print(f"{result.controller}: {result.finding.says}", style="red")
            output.console.print(f"  again with: {result.finding.command}", markup=False)
    total = sum(result.steps_taken for result in results)
    output.leave(
        {
            "evidence": Evidence.SAMPLED,
            "holds": not findings,
            "steps": total,
            "controllers": plain(results),
        },
        "fuzz",
    )
    return 1 if findings else 0


def table_of(results: list[Fuzzed]) -> Table:
    """Each controller's steps, by what came of them."""
    table = Table("controller")
    for name in ("steps", "good", "errors", "inits", "configs"):
        table.add_column(name, justify="right")
    table.add_column("found")
    for result in results:
        table.add_row(
            result.controller,
            f"{result.steps_taken:,}",
            f"{result.good:,}",
            f"{result.steps_taken - result.good:,}",
            f"{sum(result.starts.values()):,}",
            f"{result.taken + result.refused:,}",
            "nothing" if result.finding is None else "see below",
        )
    table.caption = f"{sum(r.steps_taken for r in results):,} steps; sampled, not proved"
    return table
