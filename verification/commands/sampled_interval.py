"""`python -m verification sampled-interval`: for which Mbar/M the sampled law is stable."""

from __future__ import annotations

import argparse

from verification.commands.output import Output
from verification.sampled_stability import command
from verification.sampled_stability.loop import LoopError

ERRORS = (LoopError,)
add_arguments = command.add_options


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    answer = command.answer(arguments)
    if not output.as_json:
        for part in answer.shown():
            output.console.print(part)
    output.leave(answer.figures(), "sampled_interval")
    return 0 if answer.verified else 1
