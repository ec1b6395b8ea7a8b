"""`python -m verification report`: everything, and build/report/index.html."""

from __future__ import annotations

import argparse
from pathlib import Path

from plant.native import BUILD
from verification.commands.arguments import NAMES, add_steps, controllers
from verification.commands.faults import flown
from verification.commands.output import Output, shown
from verification.commands.sig_pow import verdicts_of
from verification.commands.symbolic import proofs_of
from verification.equivalence import check_all, variants
from verification.evidence import RESULTS, current_json, write_json
from verification.experiments import ALL, conduct_all
from verification.faults import present as faults
from verification.faults.cases import CASES
from verification.figures.catalogue import BUILDERS
from verification.paper import table_2
from verification.report import certificates, studies
from verification.report.content import Results
from verification.report.page import write
from verification.report.processor import found
from verification.table2.fly import PLANTS, fly_table

FIGURES = ("phase-portraits", "convergence", "vibration", "small-gamma")
"""Of the paper: those that the report has not drawn itself."""
STEPS = 20_000
"""48 structures make about a million steps, in half a minute."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    add_steps(parser, STEPS, "random steps for each structure of the law (default: %(default)s)")
    parser.add_argument("--output", type=Path, default=BUILD / "report", help="of the report")


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    chosen = controllers(NAMES)
    proofs = proofs_of(output)
    kernels = verdicts_of(output)
    with output.bar("closed loops", len(ALL)) as advance:
        outcomes = conduct_all(advance=lambda _: advance(1))
    with output.bar("rows of Table II", len(PLANTS) * len(table_2())) as advance:
        tables = fly_table(advance=lambda: advance(1))
    total = sum(len(variants(c)) for c in chosen) * arguments.steps
    with output.bar("steps of the C", total) as advance:
        equivalence = check_all(chosen, arguments.steps, advance)
    with output.bar("the paper's figures", len(FIGURES)) as advance:
        figures = []
        for name in FIGURES:
            figures.append(BUILDERS[name]())
            advance(1)
    with output.bar("certificates", certificates.STEPS) as advance:
        proved = certificates.found(lambda: advance(1))
    if studies.found().faults is None:
        write_json(faults.figures(flown(CASES, output)), RESULTS / "faults.json")
    with output.status("pictures"):
        page = write(
            Results(
                outcomes,
                equivalence,
                proofs,
                arguments.steps,
                found(),
                kernels,
                current_json(RESULTS / "accuracy.json"),
                tables,
                studies.found(),
                figures,
                proved,
            ),
            arguments.output,
        )
    output.console.print(f"report: {shown(page)}")
    good = (
        all(p.holds for p in proofs)
        and all(k.holds for k in kernels)
        and proved.hold
        and all(r.holds for e in equivalence.values() for r in e)
    )
    if not good:
        output.console.print("Some checks failed; the report says which.", style="red")
    return 0 if good else 1
