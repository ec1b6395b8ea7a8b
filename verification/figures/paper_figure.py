"""A figure of the paper: its data, its pictures, and what is said of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from verification.evidence import Evidence
from verification.figures.chart import Chart
from verification.figures.drawn import draw
from verification.figures.interactive import interactive


@dataclass(frozen=True, eq=False)
class PaperFigure:
    """A figure with what is said of it.

    Attributes:
        name: of its files and of its place in a page.
        title: one line.
        caption: what it shows and how that was found.
        chart: the data.
        numbers: its key numbers, units in their names; plain data for JSON.
        evidence: what it rests on; None where nothing is claimed.
    """

    name: str
    title: str
    caption: str
    chart: Chart
    numbers: dict[str, Any]
    evidence: Evidence | None

    def draw(self) -> Figure:
        """The picture by Matplotlib; call it inside a style of ``verification.style``."""
        return draw(self.chart)

    def interactive(self) -> dict[str, Any]:
        """The picture for Plotly, as its plain data."""
        return interactive(self.chart)
