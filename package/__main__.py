"""``python -m package``: a controller's package in build/package/NAME."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.status import Status

from codegen.controller import load
from codegen.emit import REPOSITORY
from codegen.literals import UnprintableError
from codegen.problems import SpecificationError
from codegen.source import GenerationError
from package.checks import Label
from package.making import PACKAGES, Made, make
from package.tools import CheckError
from plant.assembly import PlantError
from plant.closed_loop import ControllerError
from plant.native import CompilerError
from verification.bench.rows import BenchError
from verification.commands.output import shown, stoppable
from verification.firmware import ToolError

_TROUBLE = (
    *(SpecificationError, UnprintableError, GenerationError, PlantError, CompilerError),
    *(ToolError, OSError),
)
_WRONG = (CheckError, BenchError, ControllerError)
_COLOURS = {Label.BUILT: "green", Label.MANIFEST: "yellow"}


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
    console.print(f"[bold]{shown(made.folder)}/[/bold]")
    console.print("  any project: copy src/, include, call; README.md has it in ten lines")
    for part in made.parts:
        label = f"[{_COLOURS[part.label]}]{part.label.value}[/]"
        console.print(f"  {part.title} ({part.files}): {label}", soft_wrap=True)
        console.print(f"      {part.use}", soft_wrap=True)


if __name__ == "__main__":
    sys.exit(stoppable(main))
