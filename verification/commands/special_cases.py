"""`python -m verification special-cases`: each special case of the law, bit for bit."""

from __future__ import annotations

import argparse

from verification.commands.output import Output
from verification.special_cases import present as special
from verification.special_cases.laws import CASES

add_arguments = special.add_arguments


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    names = arguments.controller or special.NAMES
    with output.bar("special cases", len(names) * len(CASES)) as advance:
        result = special.examine(names, arguments.ticks, advance=advance)
    if not output.as_json:
        output.console.print(special.table_of(result))
        output.console.print()
        output.console.print(special.roundings_of(result))
        for note in special.notes(result):
            output.console.print(note, markup=False)
        for failure in special.failures(result):
            output.console.print(failure, style="red", markup=False)
    output.leave(special.figures(result), "special_cases")
    return 0 if result.holds else 1
