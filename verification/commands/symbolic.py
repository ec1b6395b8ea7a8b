"""`python -m verification symbolic`: the proofs in computer algebra."""

from __future__ import annotations

import argparse

from rich.markup import escape

from verification.commands.output import Output
from verification.symbolic import Proof, all_proofs


def proofs_of(output: Output) -> tuple[Proof, ...]:
    """All proofs."""
    with output.status("computer algebra"):
        return all_proofs()


def run(_: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    proofs = proofs_of(output)
    if not output.as_json:
        for proof in proofs:
            verdict = "[green]proved[/green]" if proof.holds else "[red]NOT proved[/red]"
            output.console.print(f"{verdict}  {proof.equation:10} {escape(proof.statement)}")
            if not proof.holds:
                output.console.print(f"  residual: {proof.residual}", style="red", markup=False)
    output.leave({"proofs": list(proofs)}, "symbolic")
    return 0 if all(proof.holds for proof in proofs) else 1
