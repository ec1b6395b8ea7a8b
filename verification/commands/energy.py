"""`python -m verification energy`: V (20) and Vs (57) along the closed loop of the generated C."""

from __future__ import annotations

import argparse

from verification.commands.output import Output
from verification.energy import present
from verification.energy.audit import fly_rows
from verification.energy.recording import EnergyError

ERRORS = (EnergyError,)
add_arguments = present.add_arguments


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    names = present.chosen(arguments)
    with output.bar("rows of Table II", len(names)) as advance:
        rows = fly_rows(names, advance=lambda: advance(1))
    picture = present.draw(rows, present.PICTURE)
    if not output.as_json:
        present.show(rows, picture, output.console)
    output.leave(present.figures(rows), "energy")
    return 0
