"""Charts drawn by Matplotlib."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from verification.figures.chart import COLUMN_IN, FEW_DECADES, PAGE_IN, Chart, Line, Panel
from verification.style import INK

_HEAD_IN = 0.55
"""For the legend and the lowest axis' labels."""

_DASHES = {"solid": "-", "dashed": "--", "dotted": ":"}
_DECADES = 6
"""As many labels fit a logarithmic axis."""


def draw(chart: Chart) -> Figure:
    """The chart; colours and letters are those of the style in force."""
    figure = Figure(
        figsize=(chart.width_in, chart.rows * chart.panel_in + _HEAD_IN), layout="constrained"
    )
    grid = figure.subplots(chart.rows, chart.columns, squeeze=False)
    for axes, panel in zip(grid.flat, chart.panels, strict=True):
        _fill(axes, panel)
    legend = chart.legend()
    if legend:
        # Proxies: the lines of a panel may be points in another.
        handles = [_drawn(grid.flat[0], line, proxy=True) for line in legend]
        figure.legend(
            handles,
            [line.label for line in legend],
            loc="outside upper center",
            ncols=min(
                len(legend),
                2 if chart.width_in <= COLUMN_IN else 3 if chart.width_in < PAGE_IN else 5,
            ),
        )
    return figure


def _fill(axes: Axes, panel: Panel) -> None:
    axes.set_title(panel.title)
    for rule in panel.rules:
        across = axes.axvline if rule.axis == "x" else axes.axhline
        across(rule.at, color=INK, linewidth=0.7, linestyle=":")
    for line in panel.lines:
        _drawn(axes, line)
    if panel.logarithmic:
        axes.set_yscale("log")
        if panel.decades < FEW_DECADES:
            axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        else:
            axes.yaxis.set_major_locator(LogLocator(numticks=_DECADES))
        axes.yaxis.set_minor_locator(NullLocator())
    if panel.x_range is not None:
        axes.set_xlim(*panel.x_range)
    if panel.y_range is not None:
        axes.set_ylim(*panel.y_range)
    if panel.x_ticks is not None:
        axes.set_xticks(list(panel.x_ticks), list(panel.x_ticks.values()))
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    axes.tick_params(labelbottom=bool(panel.x_label), labelleft=bool(panel.y_label))
    for rule in panel.rules:
        _name(axes, rule.text, rule.at, vertical=rule.axis == "x")


def _drawn(axes: Axes, line: Line, *, proxy: bool = False) -> Line2D:
    shown = slice(0) if proxy else slice(None)
    drawn = axes.plot(
        line.x[shown],
        line.y[shown],
        color=line.colour,
        linewidth=line.width_pt,
        linestyle=_DASHES[line.dash] if line.width_pt else "none",
        marker="o" if line.marker else "",
        markersize=line.marker,
        markerfacecolor="none" if line.hollow else line.colour,
    )[0]
    if line.spread is not None and not proxy:
        axes.errorbar(
            line.x, line.y, line.spread, fmt="none", ecolor=line.colour, elinewidth=0.8, capsize=2
        )
    return drawn


def _name(axes: Axes, text: str, at: float, *, vertical: bool) -> None:
    """The word beside a rule, within the panel."""
    if vertical:
        axes.annotate(
            text, (at, 1), (2, -2), xycoords=("data", "axes fraction"),
            textcoords="offset points", ha="left", va="top", size="small",
        )  # fmt: skip
    else:
        axes.annotate(
            text, (0, at), (2, 1), xycoords=("axes fraction", "data"),
            textcoords="offset points", ha="left", va="bottom", size="small",
        )  # fmt: skip
