"""Counts what a control step costs, in every variant on every core."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from codegen.emit import REPOSITORY
from codegen.problems import SpecificationError
from codegen.source import GenerationError
from plant.assembly import PlantError
from plant.closed_loop import ControllerError
from plant.native import CompilerError
from plant.robot import RobotError
from verification.bench.page import PAGE, write_page
from verification.bench.present import cases, tables
from verification.bench.rows import JOINTS, RESULT, BenchError, Result, load, measure, save
from verification.bench.variants import VARIANTS
from verification.commands.output import stoppable
from verification.firmware import ToolError, board_names

_TROUBLE = (
    ToolError,
    CompilerError,
    SpecificationError,
    GenerationError,
    RobotError,
    PlantError,
    ControllerError,
    OSError,
)


def _measure(progress: Console) -> Result:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=progress, transient=True) as bar:
        total = len(board_names()) * len(JOINTS) * len(VARIANTS)
        task = bar.add_task("programs on emulated boards", total=total)
        return measure(advance=lambda: bar.advance(task))


def _print(result: Result, console: Console) -> None:
    for each in (*tables(result.rows), *(cases(result.rows, n) for n in JOINTS)):
        console.print(each)
        console.print()
    console.print("""mean: instructions per step over a recorded motion, call and return included
worst: the longest of all ticks: the first, at a limit, an error, or random bits
ratio: mean over that of this project's step
estimated cycles: mean, by Arm's tables of cycles and memory without wait states; not measured
flash: bytes that a program grows by, what it needs of the C library included
stack: bytes down to the deepest word that any tick wrote""")
    ticks = sum(row.cross_checked_ticks for row in result.rows)
    wrong = sum(row.disagreements for row in result.rows)
    console.print(f"counted by a TCG plugin and by -icount: {ticks} ticks, {wrong} disagreements")
    console.print("\nHow far the time of this project's step depends on the data:")
    for spread in result.spreads:
        console.print(f"  {spread.statement}")
    for core in result.conditions:
        console.print(f"\n{core.core}: {core.compiler}, {core.library}, {core.emulator}")
        console.print(f"  {core.flags}", soft_wrap=True)


def _write_docs() -> int:
    """Makes the page of the figures that are there; 2 where there are none of today's C."""
    result = load()
    if result is None:
        print("error: no figures of today's C: run `make bench` first", file=sys.stderr)
        return 2
    print(write_page(result).relative_to(REPOSITORY))
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; returns 0, 1 for figures that can't be right, 2 without a tool."""
    parser = argparse.ArgumentParser(prog="python -m verification.bench", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument(
        "--docs",
        action="store_true",
        help=f"write {PAGE.relative_to(REPOSITORY)} from the last figures, measure nothing",
    )
    options = parser.parse_args(arguments)
    if options.docs:
        return _write_docs()
    try:
        result = _measure(Console(stderr=True))
    except BenchError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except _TROUBLE as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    path = save(result)
    if options.json:
        print(path.read_text(encoding="utf-8"), end="")
    else:
        console = Console(highlight=False)
        _print(result, console)
        console.print(f"\nfigures: {RESULT.relative_to(RESULT.parents[2])}")
    return 0


if __name__ == "__main__":
    sys.exit(stoppable(main))
