"""``python -m package``: a controller's package in build/package/NAME."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.status import Status
from rich.table import Table

from codegen.controller import load
from codegen.emit import REPOSITORY
from codegen.literals import UnprintableError
from codegen.problems import SpecificationError
from codegen.source import GenerationError
from package.making import PACKAGES, Made, make
from package.tools import CheckError
from plant.assembly import PlantError
from plant.closed_loop import ControllerError
from plant.native import CompilerError
from verification.bench.rows import BenchError
from verification.commands.output import shown
from verification.firmware import ToolError

_TROUBLE = (
    *(SpecificationError, UnprintableError, GenerationError, PlantError, CompilerError),
    *(ToolError, OSError),
)
_WRONG = (CheckError, BenchError, ControllerError)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; returns 0, 1 where a check failed, 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m package", description=__doc__)
    parser.add_argument(
        "specification",
        nargs="*",
        type=Path,
        metavar="FILE",
        help="a specification, controllers/NAME.toml; all of controllers/ by default",
    )
    parser.add_argument(
        "--output", type=Path, default=PACKAGES, help="folder of packages (default: build/package)"
    )
    options = parser.parse_args(arguments)
    console, progress = Console(highlight=False), Console(stderr=True)
    paths = options.specification or sorted((REPOSITORY / "controllers").glob("*.toml"))
    try:
        for controller in [load(path) for path in paths]:
            with progress.status(controller.name) as status:
                made = make(controller, options.output, says=partial(_say, status, controller.name))
            _show(made, console)
    except _WRONG as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except _TROUBLE as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def _say(status: Status, name: str, what: str) -> None:
    status.update(f"{name}: {what}")


def _show(made: Made, console: Console) -> None:
    table = Table(title=f"{shown(made.folder)}/", title_justify="left")
    for column in ("for", "files", "", "how to use it"):
        table.add_column(column)
    table.add_row("any project", "src/", "", "copy, include, call: README.md")
    for part in made.parts:
        table.add_row(part.title, part.files, part.label.value, part.use)
    console.print(table)


if __name__ == "__main__":
    sys.exit(main())
