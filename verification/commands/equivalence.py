"""`python -m verification equivalence`: the generated C against the law in double."""

from __future__ import annotations

import argparse

from rich.table import Table

from verification.commands.arguments import NAMES, add_controllers, add_steps, controllers
from verification.commands.output import Output
from verification.equivalence import check_all, summary, variants

DEFAULT_STEPS = 100_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    says = "random steps for each structure of the law (default: %(default)s)"
    add_steps(parser, DEFAULT_STEPS, says)
    add_controllers(parser)


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    chosen = controllers(arguments.controller or NAMES)
    total = sum(len(variants(c)) for c in chosen) * arguments.steps
    with output.bar("steps of the C", total) as advance:
        results = check_all(chosen, arguments.steps, advance)
    summaries = [summary(c, results[c.name]) for c in chosen]
    if not output.as_json:
        table = Table(
            "controller", "laws", "steps", "violations", "torque in N m", "s - ed in rad/s"
        )
        table.caption = "worst deviation near a rig's signals; worst share of the bound, all steps"
        for s in summaries:
            table.add_row(
                s.controller,
                str(s.variants),
                f"{s.tally.steps:,}".replace(",", " "),
                str(s.violations),
                *(
                    f"{d.worst:.1e} {d.worst_share:.1%}"
                    for d in (s.torque_Nm, s.sliding_integral_rad_per_s)
                ),
            )
        output.console.print(table)
        for each in results.values():
            for result in each:
                for violation in result.violations:
                    output.console.print(
                        f"{result.controller}: {violation.steps} steps: {violation.example}",
                        style="red",
                        markup=False,
                    )
    output.leave({"summaries": summaries, "variants": results}, "equivalence")
    return 0 if all(s.violations == 0 for s in summaries) else 1
