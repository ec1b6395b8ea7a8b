"""`python -m verification experiments`: Table II and more, flown on the plant."""

from __future__ import annotations

import argparse

from rich.table import Table

from verification.commands.output import Output
from verification.evidence import plain
from verification.experiments import (
    ALL,
    beside_the_paper,
    conduct_all,
    improvements,
    rank_correlation,
)


def run(_: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    with output.bar("closed loops", len(ALL)) as advance:
        outcomes = conduct_all(advance=lambda _: advance(1))
    rows = beside_the_paper(outcomes)
    if not output.as_json:
        table = Table("row", "RMS in deg, joints 1 2 3", "paper in deg", "ratio")
        for row in rows:
            table.add_row(
                row.experiment,
                " ".join(f"{v:.4f}" for v in row.ours_deg),
                " ".join(f"{v:.4f}" for v in row.paper_deg),
                " ".join(f"{v:.2f}" for v in row.ratio),
            )
        output.console.print(table)
    data = {
        "experiments": [outcome.summary() for outcome in outcomes.values()],
        "table_2": [{**plain(row), "ratio": row.ratio} for row in rows],
        "rms_over_exp08": improvements(rows),
        "rank_correlation": rank_correlation(rows),
    }
    output.leave(data, "experiments")
    return 0
