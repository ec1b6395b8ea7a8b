"""`python -m verification coverage`: branches and conditions of the generated C."""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ThreadPoolExecutor

from rich.table import Table

from verification.commands.arguments import add_controllers, controllers
from verification.commands.output import Output, shown
from verification.coverage.program import COVERAGE_BUILD, Counted, Coverage, measure
from verification.evidence import plain
from verification.experiments import CONTROLLERS
from verification.firmware import ToolError

ERRORS = (ToolError,)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    add_controllers(parser)


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    names = arguments.controller or sorted(p.stem for p in CONTROLLERS.glob("*.toml"))
    with output.status("directed tests"), ThreadPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(measure, controllers(names)))
    if not output.as_json:
        output.console.print(table_of(results))
        for result in results:
            for line in missed(result):
                output.console.print(line, style="red", markup=False)
        output.console.print(f"line by line: {shown(COVERAGE_BUILD)}/NAME/page/index.html")
    whole = all(result.whole for result in results)
    output.leave({"holds": whole, "controllers": plain(results)}, "coverage")
    return 0 if whole else 1


def table_of(results: list[Coverage]) -> Table:
    """Each controller's counts."""
    table = Table("controller", "directed tests", "branches (gcovr)", "conditions (MC/DC, clang)")
    for result in results:
        table.add_row(
            result.controller,
            "passed" if result.passed else "failed",
            _of(result.branches),
            _of(result.conditions),
        )
    table.caption = "a decision of one condition has its MC/DC by its two branches"
    return table


def _of(counted: Counted) -> str:
    return f"{counted.covered} of {counted.total}"


def missed(result: Coverage) -> list[str]:
    """What a controller lacks, a line each."""
    lines = [f"{result.controller}: {says}" for says in result.says if not result.passed]
    for what, counted in (("branch", result.branches), ("condition", result.conditions)):
        lines += [f"{result.controller}: a {what} not covered at {at}" for at in counted.missed]
    return lines
