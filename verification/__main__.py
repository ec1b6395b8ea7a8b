"""Checks the generated C, flies the paper's experiments, and writes the report."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any, Protocol, cast

from rich.console import Console

from verification.commands.output import Output, stoppable


class Command(Protocol):
    """A command's module.

    It may also have ``add_arguments(parser)``, and ``ERRORS``, those of bad input beside the
    project's usual ones.
    """

    def run(self, arguments: argparse.Namespace, output: Output) -> int:
        """Runs it; returns 0, or 1 where a check failed."""


# Only the module of the command that is called is imported: some take long.
COMMANDS = {
    "report": "run everything and write build/report/index.html",
    "table2": "every row of the paper's Table II on four plants",
    "figures": "the paper's figures from the project's own data, for print and for a page",
    "playground": "a page with the shipped C as WebAssembly, and sliders for its gains",
    "claim": "how far Table II holds on random plants, as `make claim` flew them",
    "rivals": "PID, computed torque, sliding mode, Hsia and the inclusive law, tuned alike",
    "faults": "faults in motion, with the guards of the generated C and without",
    "experiments": "Table II and more, flown on the reference plant",
    "special-cases": "each special case of the law, written by itself, against the inclusive C",
    "error-dynamics": "class, settling time and certificate of the desired error dynamics",
    "error-bound": "how large s and e can be while the TDE error is bounded: proved, checked",
    "energy": "the energies V (20) and Vs (57) along the closed loop of the generated C",
    "tuning-check": "is a gain set safe, and how good is it: one page for each specification",
    "sampled-interval": "for which Mbar/M the sampled law is stable: exact, proved, checked",
    "workspace": "the eigenvalues of M(q)^-1 Mbar at every q, for condition (33): proved, checked",
    "equivalence": "the generated C against the law in double",
    "chain": "the exact law, CasADi in double, the C on the host and on each emulated target",
    "fuzz": "the generated C under libFuzzer, ASan and UBSan, held to its header's contract",
    "coverage": "directed tests of the generated C: every branch, and MC/DC",
    "accuracy": "Table II flown in float32, float64 and fixed-point, several times each",
    "sig-pow": "the error of sig_pow for every float and every exponent, proved and checked",
    "symbolic": "the proofs in computer algebra",
    "equations": "docs/equations.md: where each of the paper's equations is, and what checks it",
}


def _module(name: str) -> Any:
    return import_module(f"verification.commands.{name.replace('-', '_')}")


def _parser(chosen: str | None) -> argparse.ArgumentParser:
    """The command line, with the arguments of one command."""
    parser = argparse.ArgumentParser(prog="python -m verification", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for name, says in COMMANDS.items():
        added = commands.add_parser(name, help=says, description=says)
        if name != "report":
            added.add_argument("--json", action="store_true", help="print JSON instead of tables")
        if name == chosen:
            add_arguments = getattr(_module(name), "add_arguments", None)
            if add_arguments is not None:
                add_arguments(added)
    return parser


def _bad_input(command: Any) -> tuple[type[Exception], ...]:
    from codegen.literals import UnprintableError
    from codegen.problems import SpecificationError
    from codegen.source import GenerationError
    from plant.assembly import PlantError
    from plant.controller import LayoutError
    from plant.native import CompilerError
    from plant.robot import RobotError

    return (
        SpecificationError,
        GenerationError,
        UnprintableError,
        RobotError,
        PlantError,
        LayoutError,
        CompilerError,
        OSError,
        *getattr(command, "ERRORS", ()),
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; returns 0, 1 where a check failed, 2 for bad input."""
    given = sys.argv[1:] if arguments is None else arguments
    chosen = given[0] if given and given[0] in COMMANDS else None
    options = _parser(chosen).parse_args(given)
    command = _module(options.command)
    as_json = getattr(options, "json", False)
    output = Output(as_json, Console(highlight=False, soft_wrap=False), Console(stderr=True))
    try:
        return cast(Command, command).run(options, output)
    except Exception as error:
        from plant.closed_loop import ControllerError

        if isinstance(error, ControllerError):
            print(f"error: {error}", file=sys.stderr)
            return 1
        if isinstance(error, _bad_input(command)):
            print(f"error: {error}", file=sys.stderr)
            return 2
        raise


if __name__ == "__main__":
    sys.exit(stoppable(main))
