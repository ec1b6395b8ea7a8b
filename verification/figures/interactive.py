"""Charts as Plotly takes them: plain data, whose colours the page puts in.

Nothing here needs Plotly itself; its JavaScript comes with :mod:`verification.figures.page`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from verification.figures.chart import FEW_DECADES, Chart, Floats, Line, Panel, Rule
from verification.style import INK, LINE

DIGITS = 6
"""Significant digits of the points: finer than any screen, even with some zoom."""

_ROW_PX, _GAP_PX, _HEAD_PX, _FOOT_PX = 190, 76, 64, 52
_GAP = {1: 0.0, 2: 0.11, 3: 0.075}
"""Between columns, as a share of the width."""

_DASHES = {"solid": "solid", "dashed": "dash", "dotted": "dot"}
_PX_PER_PT = 1.7


def interactive(chart: Chart) -> dict[str, Any]:
    """The chart as ``data`` and ``layout``; colours are the stand-ins of the house style."""
    height = chart.rows * _ROW_PX + (chart.rows - 1) * _GAP_PX
    layout: dict[str, Any] = {
        "height": height + _HEAD_PX + _FOOT_PX,
        "margin": {"l": 64, "r": 16, "t": _HEAD_PX, "b": _FOOT_PX},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"color": INK, "family": "system-ui, sans-serif", "size": 12},
        "hovermode": "closest",
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": LINE, "activecolor": INK},
        "legend": {"orientation": "h", "x": 0, "y": 1, "yref": "container", "yanchor": "top"},
        "shapes": [],
        "annotations": [],
    }
    data: list[dict[str, Any]] = []
    named: set[str] = set()
    for number, panel in enumerate(chart.panels):
        row, column = divmod(number, chart.columns)
        layout |= _axes(chart, number, _span(column, chart.columns), _band(row, height))
        layout["annotations"].append(_title(panel, number))
        for rule in panel.rules:
            layout["shapes"].append(_shape(rule, number))
            layout["annotations"] += _word(rule, number, panel.logarithmic)
        for line in panel.lines:
            data.append(_trace(chart, number, line, first=line.label not in named))
            named.add(line.label)
    return {"data": data, "layout": layout}


def _suffix(number: int) -> str:
    """Of a panel's axes: x, x2, x3."""
    return str(number + 1) if number else ""


def _span(column: int, columns: int) -> list[float]:
    gap = _GAP[columns]
    width = (1 - (columns - 1) * gap) / columns
    left = column * (width + gap)
    return [left, min(1.0, left + width)]


def _band(row: int, height: int) -> list[float]:
    top = 1 - row * (_ROW_PX + _GAP_PX) / height
    return [max(0.0, top - _ROW_PX / height), top]


def _axes(chart: Chart, number: int, span: list[float], band: list[float]) -> dict[str, Any]:
    panel, suffix = chart.panels[number], _suffix(number)
    common = {
        "gridcolor": LINE,
        "linecolor": LINE,
        "zeroline": False,
        "showline": True,
        "ticks": "outside",
        "tickcolor": LINE,
        "exponentformat": "power",
        "title_standoff": 6,
    }
    x = common | {"domain": span, "anchor": f"y{suffix}", **_title_of(panel.x_label)}
    y = common | {"domain": band, "anchor": f"x{suffix}", **_title_of(panel.y_label)}
    if panel.x_range is not None:
        x["range"] = list(panel.x_range)
    if panel.logarithmic:
        y |= {"type": "log", "dtick": _decades_a_tick(panel)}
    if panel.y_range is not None:
        y["range"] = [math.log10(v) if panel.logarithmic else v for v in panel.y_range]
    if panel.x_ticks is not None:
        x |= {"tickvals": list(panel.x_ticks), "ticktext": list(panel.x_ticks.values())}
    # A zoom goes with all panels that share the axis.
    below = _same_axis(chart, number)
    if below != number:
        x["matches"] = f"x{_suffix(below)}"
    return {f"xaxis{suffix}": x, f"yaxis{suffix}": y}


def _decades_a_tick(panel: Panel) -> int | str:
    """So many that about five labels stand beside a logarithmic axis; D2 for 1, 2, 5."""
    return "D2" if panel.decades < FEW_DECADES else max(1, round(panel.decades / 5))


def _title_of(label: str) -> dict[str, Any]:
    return {"title": {"text": label}} if label else {}


def _same_axis(chart: Chart, number: int) -> int:
    """The first panel at or below one in its column that has a label for the x axis."""
    while not chart.panels[number].x_label:
        number += chart.columns
    return number


def _title(panel: Panel, number: int) -> dict[str, Any]:
    suffix = _suffix(number)
    return {
        "text": panel.title,
        "xref": f"x{suffix} domain",
        "yref": f"y{suffix} domain",
        **{"x": 0, "y": 1, "xanchor": "left", "yanchor": "bottom", "showarrow": False},
    }


def _shape(rule: Rule, number: int) -> dict[str, Any]:
    x, y = f"x{_suffix(number)}", f"y{_suffix(number)}"
    across = {"x0": rule.at, "x1": rule.at, "y0": 0, "y1": 1, "xref": x, "yref": f"{y} domain"}
    if rule.axis == "y":
        across = {"x0": 0, "x1": 1, "y0": rule.at, "y1": rule.at, "xref": f"{x} domain", "yref": y}
    return {
        "type": "line",
        "layer": "below",
        "line": {"color": INK, "width": 1, "dash": "dot"},
        **across,
    }


def _word(rule: Rule, number: int, logarithmic: bool) -> Sequence[dict[str, Any]]:
    if not rule.text:
        return ()
    x, y = f"x{_suffix(number)}", f"y{_suffix(number)}"
    place: dict[str, Any] = {
        **{"x": rule.at, "y": 1, "xref": x, "yref": f"{y} domain"},
        **{"xanchor": "left", "yanchor": "top"},
    }
    if rule.axis == "y":
        # Annotations, unlike shapes, count decades on a logarithmic axis.
        place = {
            **{"x": 0, "y": math.log10(rule.at) if logarithmic else rule.at},
            **{"xref": f"{x} domain", "yref": y, "xanchor": "left", "yanchor": "bottom"},
        }
    return ({"text": rule.text, "showarrow": False, "font": {"size": 11}, **place},)


def _trace(chart: Chart, number: int, line: Line, *, first: bool) -> dict[str, Any]:
    suffix = _suffix(number)
    x_label, y_label = chart.axis_labels(number)
    trace: dict[str, Any] = {
        "type": "scatter",
        "x": rounded(line.x),
        "y": rounded(line.y),
        "xaxis": f"x{suffix}",
        "yaxis": f"y{suffix}",
        "name": line.label,
        "showlegend": bool(line.label) and first,
        "mode": "+".join(
            word for word, size in (("lines", line.width_pt), ("markers", line.marker)) if size
        ),
        "line": {
            "color": line.colour,
            "width": _PX_PER_PT * line.width_pt,
            "dash": _DASHES[line.dash],
            # Plotly would leave out points until a curve is a polygon.
            "simplify": False,
        },
        "hovertemplate": f"{_reading('x', x_label)}<br>{_reading('y', y_label)}"
        f"<extra>{line.label}</extra>",
    }
    if line.label:
        trace["legendgroup"] = line.label
    if line.marker:
        trace["marker"] = {
            "color": line.colour,
            "size": _PX_PER_PT * line.marker,
            "symbol": "circle-open" if line.hollow else "circle",
        }
    if line.spread is not None:
        trace["error_y"] = {"array": rounded(line.spread), "color": line.colour, "thickness": 1}
    return trace


def _reading(axis: str, label: str) -> str:
    """A coordinate with its name and unit; a unit of - is none."""
    name, _, unit = label.partition(" [")
    unit = unit.removesuffix("]")
    return f"{name} %{{{axis}:.5g}}" + (f" {unit}" if unit != "-" else "")


def rounded(values: Floats) -> list[float]:
    """Numbers as a page needs them."""
    return [float(f"{value:.{DIGITS}g}") for value in values.tolist()]
