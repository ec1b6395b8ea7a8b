"""`python -m verification figures`: the paper's figures from the project's own data."""

from __future__ import annotations

import argparse

from verification.commands.output import Output, shown
from verification.evidence import RESULTS
from verification.figures import present
from verification.figures.catalogue import BUILDERS

add_arguments = present.add_arguments


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    names = arguments.only or list(BUILDERS)
    with output.bar("figures", len(names)) as advance:
        made = present.make(names, RESULTS / "figures", advance)
    if not output.as_json:
        output.console.print(present.table_of(made))
        output.console.print(f"page: {shown(RESULTS / 'figures' / 'index.html')}")
    output.leave(present.numbers_of(made), "figures")
    return 0
