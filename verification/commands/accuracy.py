"""`python -m verification accuracy`: Table II flown in every arithmetic."""

from __future__ import annotations

import argparse

from rich.table import Table

from verification.accuracy import ARITHMETICS, PHASES, measure
from verification.commands.output import Output
from verification.evidence import plain
from verification.paper import table_2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    parser.add_argument(
        "--phases", type=int, default=PHASES, help="encoder phases (default: %(default)s)"
    )


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    total = len(table_2()) * len(ARITHMETICS)
    with output.bar("rows of Table II", total) as advance:
        result = measure(phases=arguments.phases, advance=advance)
    if not output.as_json:
        table = Table("row", *ARITHMETICS.values())
        table.caption = (
            f"RMS in deg, joints 1 2 3; mean over {result.phases} encoder phases; difference from "
            "float64 in per cent"
        )
        for row in table_2():
            cells = [cell for cell in result.cells if cell.row == row]
            table.add_row(
                row,
                *(
                    "\n".join(
                        f"{rms:.5f} {100 * off:+.1f}"
                        for rms, off in zip(cell.rms_deg, cell.difference, strict=True)
                    )
                    for cell in cells
                ),
            )
        output.console.print(table)
        for name, says in ARITHMETICS.items():
            output.console.print(
                f"{says}: {result.mean_difference[name]:+.2%} from float64 over all cells, at most "
                f"{result.largest_difference[name]:.2%} in one"
            )
    output.leave(plain(result), "accuracy")
    return 0
