"""`python -m verification rivals`: what a user would pick instead, tuned alike and flown."""

from __future__ import annotations

import argparse

from verification.commands.output import Output
from verification.rivals import present
from verification.rivals.contenders import BY_NAME

add_arguments = present.add_arguments


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    with output.bar("controllers tuned", len(BY_NAME)) as advance:
        result = present.conduct(arguments, advance)
    if not output.as_json:
        present.show(result, output.console)
    output.leave(present.figures(result), "rivals")
    return 0
