"""The command `figures`: the files that it writes, and how a person and a script read them."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from verification.evidence import plain
from verification.figures.catalogue import BUILDERS
from verification.figures.page import render
from verification.figures.paper_figure import PaperFigure
from verification.style import house_style


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    parser.add_argument(
        "--only", action="append", choices=list(BUILDERS), help="one figure; again for more"
    )


def make(
    names: Sequence[str], directory: Path, advance: Callable[[int], None] = lambda _: None
) -> list[PaperFigure]:
    """Makes figures and writes NAME.svg and NAME.pdf of each, and index.html with all of them.

    Args:
        names: of the figures.
        directory: of the files.
        advance: told of each figure when it is done.

    Raises:
        SpecificationError, PlantError, CompilerError, ControllerError: as of ``plant.flight.fly``.
    """
    figures = []
    for name in names:
        figures.append(BUILDERS[name]())
        advance(1)
    page = render(figures)
    directory.mkdir(parents=True, exist_ok=True)
    for figure in figures:
        _print(figure, directory)
    (directory / "index.html").write_text(page, encoding="utf-8")
    return figures


def _print(figure: PaperFigure, directory: Path) -> None:
    """The picture as vector graphics, the same bytes every time."""
    with house_style(printed=True):
        drawn = figure.draw()
        # Dates and versions would make every build another file.
        drawn.savefig(directory / f"{figure.name}.svg", metadata={"Date": None, "Creator": None})
        drawn.savefig(
            directory / f"{figure.name}.pdf",
            metadata={"CreationDate": None, "Creator": None, "Producer": None},
        )


def table_of(figures: Sequence[PaperFigure]) -> Table:
    """A row for each figure."""
    table = Table("figure", "evidence", "shows")
    for figure in figures:
        word = "" if figure.evidence is None else figure.evidence.value
        table.add_row(figure.name, word, figure.title)
    return table


def numbers_of(figures: Sequence[PaperFigure]) -> dict[str, Any]:
    """The key numbers as plain data."""
    return {
        "figures": [
            {
                "name": figure.name,
                "title": figure.title,
                "evidence": plain(figure.evidence),
                "numbers": plain(figure.numbers),
            }
            for figure in figures
        ]
    }
