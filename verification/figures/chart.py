"""A figure as plain data: panels of lines, from which every picture of it is drawn.

Matplotlib's and Plotly's pictures of a figure can't differ in what they show, and tests read the
data instead of pixels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Dash = Literal["solid", "dashed", "dotted"]

COLUMN_IN, PAGE_IN = 3.5, 7.16
"""Widths of a column and of a page of two columns in the IEEE's journals."""

FEW_DECADES = 2.0
"""A logarithmic axis of fewer has labels between the powers of ten, too."""


@dataclass(frozen=True, eq=False)
class Line:
    """A curve, or the points of one.

    Attributes:
        x: shape (points,), in the unit of the panel's axis.
        y: shape (points,), likewise.
        label: in the legend, where lines of several panels share an entry; empty for none.
        colour: of the palette, or :data:`verification.style.INK`.
        dash: how it is drawn.
        width_pt: of the line; 0 for points alone.
        marker: diameter of the points [pt]; 0 for a line alone.
        hollow: whether the points are rings.
        spread: standard error of y, shape (points,), or None.
    """

    x: Floats
    y: Floats
    label: str
    colour: str
    dash: Dash = "solid"
    width_pt: float = 1.0
    marker: float = 0.0
    hollow: bool = False
    spread: Floats | None = None


@dataclass(frozen=True)
class Rule:
    """A thin straight line across a panel, with a word beside it.

    Attributes:
        at: its place on the axis that it crosses.
        axis: which axis that is.
        text: beside it; empty for none.
    """

    at: float
    axis: Literal["x", "y"]
    text: str = ""


@dataclass(frozen=True, eq=False)
class Panel:
    """A pair of axes.

    Attributes:
        title: over the panel.
        x_label: with the unit in brackets; empty where the panel below has the same axis.
        y_label: with the unit in brackets; empty where the panel to the left has the same axis.
        lines: drawn in this order.
        rules: drawn below the lines.
        logarithmic: whether the y axis is.
        x_range: of the axis, or None for that of the data.
        y_range: likewise.
        x_ticks: names by place on the x axis, or None for numbers.
    """

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line]
    rules: Sequence[Rule] = ()
    logarithmic: bool = False
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    x_ticks: dict[float, str] | None = None

    @property
    def decades(self) -> float:
        """How many a logarithmic y axis has."""
        values = np.concatenate([line.y for line in self.lines])
        low, high = self.y_range or (values[values > 0].min(), values.max())
        return math.log10(high / low)


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels in a grid, row by row from the top.

    Attributes:
        panels: of all rows; as many as rows times columns.
        columns: of the grid.
        width_in: of the whole in print.
        panel_in: height of a row in print.
    """

    panels: Sequence[Panel]
    columns: int
    width_in: float
    panel_in: float

    @property
    def rows(self) -> int:
        """Of the grid."""
        return len(self.panels) // self.columns

    def axis_labels(self, number: int) -> tuple[str, str]:
        """The labels of a panel's axes, which may stand at the edge of the grid only."""
        row, column = divmod(number, self.columns)
        below = [self.panels[r * self.columns + column].x_label for r in range(row, self.rows)]
        left = [self.panels[row * self.columns + c].y_label for c in range(column, -1, -1)]
        return next(filter(None, below), ""), next(filter(None, left), "")

    def legend(self) -> list[Line]:
        """One line for each label, in the order of their first use."""
        first: dict[str, Line] = {}
        for line in (line for panel in self.panels for line in panel.lines if line.label):
            first.setdefault(line.label, line)
        return list(first.values())


def extremes(signal: Floats, spans: int) -> NDArray[np.intp]:
    """Where a signal is least and largest in each of so many equal spans, in order.

    A line through these samples looks like the whole signal wherever a span is narrower than a
    pixel, and no peak is lost.

    Args:
        signal: shape (samples,).
        spans: how many; all samples are kept where there are fewer than two a span.
    """
    if len(signal) <= 2 * spans:
        return np.arange(len(signal))
    edges = np.linspace(0, len(signal), spans + 1).astype(int)
    kept = {0, len(signal) - 1}
    for first, last in pairwise(edges.tolist()):
        part = signal[first:last]
        kept |= {first + int(part.argmin()), first + int(part.argmax())}
    return np.array(sorted(kept), dtype=np.intp)
