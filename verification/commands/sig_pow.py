"""`python -m verification sig-pow`: what is proved of the power function's error."""

from __future__ import annotations

import argparse

from rich.markup import escape

from verification.certificates.sig_pow.kernel import KernelError
from verification.certificates.sig_pow.present import Verdict, shipped, verdict
from verification.commands.output import Output

ERRORS = (KernelError,)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    parser.add_argument(
        "--exhaustive",
        action="store_true",
        help="also run the compiled integer halves at every argument",
    )


def verdicts_of(output: Output, exhaustive: bool = False) -> list[Verdict]:
    """What holds of each kernel that ships."""
    with output.status("interval arithmetic"):
        return [verdict(*kernel, exhaustive) for kernel in shipped()]


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    verdicts = verdicts_of(output, arguments.exhaustive)
    if not output.as_json:
        for found in verdicts:
            output.console.print(
                f"{found.function} of {', '.join(found.controllers)}", markup=False
            )
            for s in found.statements:
                word = s.evidence.value if s.holds else f"NOT {s.evidence.value}"
                colour = "green" if s.holds else "red"
                output.console.print(f"  [{colour}]{word:10}[/{colour}]  {escape(s.says)}")
                output.console.print(f"              {s.bound}", style="dim", markup=False)
    holds = all(found.holds for found in verdicts)
    output.leave({"holds": holds, "kernels": verdicts}, "sig_pow")
    return 0 if holds else 1
