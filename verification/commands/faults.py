"""`python -m verification faults`: faults in motion, with the generated C's guards and without."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from verification.commands.output import Output
from verification.faults import present
from verification.faults.campaign import Result, fly_all
from verification.faults.cases import Case

add_arguments = present.add_arguments


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    result = flown(present.chosen(arguments), output)
    if not output.as_json:
        present.show(result, output.console)
    output.leave(present.figures(result), "faults")
    return 0


def flown(cases: Sequence[Case], output: Output) -> Result:
    """Flies the faults of some cases, and draws the picture."""
    with output.bar("faults flown", sum(len(case.faults) for case in cases)) as advance:
        result = fly_all(cases, advance=lambda: advance(1))
    present.draw()
    return result
