"""What `make table2` prints, and what fell outside."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence

from rich.table import Table

from verification.paper import REFERENCE_ROW, table_2
from verification.table2.fly import (
    COMPARED,
    FACTOR,
    PHASES,
    PLANTS,
    TableOf,
    TablePlant,
    paper_ratios,
    ratio_name,
)


def table_of(table: TableOf) -> Table:
    """One plant's rows beside the paper's."""
    made = Table(title=f"Table II on {table.plant.name}", title_justify="left")
    made.add_column("row")
    for title in ("RMS error [deg]", "paper [deg]", "times the paper's", "over Exp08 [%]"):
        made.add_column(title, justify="right")
    for row in table.rows:
        paper = table_2()[row.exp].rms_deg
        if row.rms_deg is None:
            made.add_row(row.exp, f"[red]{row.failed}[/]", _numbers(paper, "{:.4f}"), "", "")
            continue
        made.add_row(
            row.exp,
            _numbers(row.rms_deg, "{:.4f}"),
            _numbers(paper, "{:.4f}"),
            " ".join(_factor(x) for x in row.factor or ()),
            _numbers(row.difference_percent or (), "{:.0f}"),
        )
    return made


def _numbers(values: Iterable[float], form: str) -> str:
    return " ".join(form.format(x) for x in values)


def _factor(value: float) -> str:
    text = f"{value:.2f}"
    return text if max(value, 1.0 / value) <= FACTOR else f"[yellow]{text}[/]"


def summary(table: TableOf) -> tuple[str, ...]:
    """What the table of a plant comes to, one line each."""
    cells = sum(len(row.factor or ()) for row in table.rows)
    paper = {ratio_name(row): paper_ratios(row) for row in COMPARED}
    ratios = (
        f"{name} {_numbers(values[:3], '{:.3g}')} (paper {_numbers(paper[name], '{:.3g}')})"
        for name, values in table.ratios.items()
    )
    correlation = _numbers(table.spearman, "{:.3f}")
    return (
        table.plant.says,
        f"Spearman's rank correlation with the paper by joint: {correlation}",
        f"{cells - len(table.outside)} of {cells} cells within a factor {FACTOR:g} of the paper's, "
        f"the farthest {table.worst_factor:.2f}",
        f"smallest error by joint: {' '.join(table.best)}",
        f"errors over {REFERENCE_ROW}'s: " + "; ".join(ratios),
    )


def chosen(arguments: argparse.Namespace) -> Sequence[TablePlant]:
    """The plants that the command's arguments ask for."""
    return [plant for plant in PLANTS if not arguments.plant or plant.name in arguments.plant]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    parser.add_argument(
        "--plant",
        action="append",
        choices=[plant.name for plant in PLANTS],
        help="only this plant; may be repeated",
    )
    parser.add_argument(
        "--phases",
        type=_phases,
        default=PHASES,
        help="encoder phases, whose root mean square is told (default: %(default)s)",
    )


def _phases(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is not greater than 0")
    return number
