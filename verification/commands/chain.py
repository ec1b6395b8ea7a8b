"""`python -m verification chain`: from the exact law to the C on each emulated target."""

from __future__ import annotations

import argparse

from verification.chain.links import BLOCK_STEPS, blocks_of, chain
from verification.chain.present import failures, notes, table_of
from verification.commands.arguments import NAMES, add_controllers, add_steps, controllers
from verification.commands.output import Output
from verification.evidence import plain
from verification.firmware import ToolError, board_names, load_board

ERRORS = (ToolError,)
STEPS = 1_000_000
CHAIN_NAMES = (*NAMES, "puma3_fixed")
"""In fixed-point the chain has its last link: the bits on the targets."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    says = f"random steps on each target, in blocks of {BLOCK_STEPS} (default: %(default)s)"
    add_steps(parser, STEPS, says)
    parser.add_argument(
        "--board", action="append", choices=board_names(), help="one of them; again for more"
    )
    add_controllers(parser)


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    chosen = controllers(arguments.controller or CHAIN_NAMES)
    boards = [load_board(name) for name in arguments.board or board_names()]
    blocks = blocks_of(arguments.steps)
    total = blocks.count * blocks.steps * len(boards) * len(chosen)
    with output.bar("steps on the targets", total) as advance:
        result = chain(chosen, boards, blocks, advance)
    if not output.as_json:
        output.console.print(table_of(result))
        for note in notes():
            output.console.print(note, markup=False)
        for failure in failures(result):
            output.console.print(failure, style="red", markup=False)
    output.leave({"holds": result.holds, **plain(result)}, "chain")
    return 0 if result.holds else 1
