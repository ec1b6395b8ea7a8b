"""`python -m verification table2`: every row of the paper's Table II on four plants."""

from __future__ import annotations

import argparse

from verification.commands.output import Output
from verification.paper import table_2
from verification.table2 import present
from verification.table2.fly import figures, fly_table

add_arguments = present.add_arguments


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Flies the table and tells it."""
    plants = present.chosen(arguments)
    with output.bar("rows of Table II", len(plants) * len(table_2())) as advance:
        tables = fly_table(plants, arguments.phases, advance=lambda: advance(1))
    if not output.as_json:
        for table in tables:
            output.console.print(present.table_of(table))
            for line in present.summary(table):
                output.console.print(line)
            output.console.print()
    output.leave(figures(tables), "table2")
    return 0
