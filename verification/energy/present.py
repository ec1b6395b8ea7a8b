"""The energies as a person and a script read them: a table, sentences, a picture."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from verification.energy.audit import ROBOT, WINDOW_TICKS, JointEnergy, RowEnergy, window_means
from verification.evidence import RESULTS, plain
from verification.figures.chart import Chart, Floats, Line, Panel, Rule
from verification.figures.drawn import draw as draw_chart
from verification.paper import table_2
from verification.style import PALETTE, WIDTH_IN, house_style, write_svg

PICTURE = RESULTS / "energy.svg"
PICTURED = ("Exp01", "Exp08")
"""Hsia's law and the paper's best, if both were flown."""
TRACES = ("time_s", "energy", "sliding_energy")
"""The signals of a row, which are drawn and not told."""


def tables_of(rows: Sequence[RowEnergy]) -> tuple[Table, ...]:
    """Shares, and bounds of s and of e, a line for each joint of each row."""
    shares = _table(
        rows,
        f"Energy along the closed loop, {ROBOT} plant: share of ticks in %",
        ("V falls", "as (21)", "Vs falls", "broken", "Vs falls,\nunbroken", "Vs falls,\nbroken"),
        _shares,
    )
    bounds = _table(
        rows,
        "ξ, largest |ε| [rad/s²], and |s| [rad/s] over its bound (38)",
        ("ξ", "max |s|", "over (38)", "means: ξ", "over (38)", "pull"),
        _bounds,
    )
    errors = _table(
        rows,
        "Largest |e| [mrad], and its certified bound for ξ",
        ("ξ", "max |e|", "bound", "of it"),
        _errors,
    )
    return shares, bounds, errors


def _table(
    rows: Sequence[RowEnergy],
    title: str,
    columns: Sequence[str],
    cells: Callable[[JointEnergy], Iterable[str]],
) -> Table:
    table = Table(title=escape(title), title_justify="left", box=None, pad_edge=False)
    table.add_column("row")
    table.add_column("joint")
    for column in columns:
        table.add_column(column, justify="right", no_wrap=True)
    for row in rows:
        for number, joint in enumerate(row.joints):
            table.add_row("" if number else row.exp, joint.joint, *cells(joint))
    return table


def _shares(joint: JointEnergy) -> Iterable[str]:
    for share in (
        joint.energy_falls,
        joint.energy_falls_as_21,
        joint.sliding_falls,
        joint.broken,
        joint.falls_where_unbroken,
        joint.falls_where_broken,
    ):
        yield "-" if share is None else f"{100 * share:.1f}"


def _bounds(joint: JointEnergy) -> Iterable[str]:
    yield f"{joint.largest_tde_error:.1f}"
    yield f"{joint.largest_sliding:.4f}"
    yield _ratio(joint.over_bound)
    yield f"{joint.largest_mean_tde_error:.2f}"
    yield _ratio(joint.mean_over_bound)
    yield _ratio(joint.mean_pull)


def _errors(joint: JointEnergy) -> Iterable[str]:
    yield f"{joint.largest_tde_error:.1f}"
    yield f"{1e3 * joint.largest_error:.3g}"
    yield "-" if joint.error_bound is None else f"{1e3 * joint.error_bound:.3g}"
    yield _ratio(joint.over_error_bound)


def _ratio(value: float | None) -> str:
    return "-" if value is None else f"{value:.2g}"


def notes(rows: Sequence[RowEnergy]) -> Iterable[str]:
    """What the figures mean, with figures from them."""
    joints = [joint for row in rows for joint in row.joints]
    over = [joint.over_bound for joint in joints if joint.over_bound is not None]
    grain = max(joint.count_acceleration for joint in joints)
    yield "Measured on the simulated plant, as the controller sees it: counts, backward difference."
    yield (
        "The C, stepped again along the recorded counts, answers the same torques bit by bit; s is "
        "the velocity error plus the integral in its memory."
    )
    yield (
        "as (21): V falls by L KD |ed|^(alpha+1) or more; broken: |eps| >= lambda |s|^gamma (58)."
    )
    yield (
        f"means: of {WINDOW_TICKS} ticks each, for which (38) is no promise: where s jumps by "
        "counts, a correction with gamma < 1 pulls less at its mean than (38) takes it to."
    )
    yield (
        "pull: what is left of it, mean of sig(s)^gamma over sig(mean s)^gamma, median of windows."
    )
    yield (
        "What neither grows nor vanishes in the long run falls in about half of the ticks, "
        "whatever moves it: the share where V or Vs falls says little about the law by itself."
    )
    yield (
        f"One count a tick a tick is {grain:.2f} rad/s^2: encoder resolution alone makes eps that "
        "large from tick to tick."
    )
    yield (
        "eps from torques and counts and eps from s by the sampled (32) differ by at most "
        f"{max(joint.identity_error for joint in joints):.1e} rad/s^2."
    )
    if over:
        yield f"Largest |s| over the bound (38) with xi = max |eps|: {max(over):.3g}."
    of_e = [joint.over_error_bound for joint in joints if joint.over_error_bound is not None]
    if of_e:
        yield (
            f"Largest |e| over its bound with xi = max |eps|: {max(of_e):.3g}. The bound is proved "
            "of (32) in continuous time; no encoder, no saturation (error-bound)."
        )
    saturated = [row.exp for row in rows if row.saturated_ticks]
    if saturated:
        yield f"Joints at their torque limit, where (32) does not hold: {', '.join(saturated)}."


def show(rows: Sequence[RowEnergy], picture: Path, console: Console) -> None:
    """Prints everything for a person."""
    for table in tables_of(rows):
        console.print(table)
        console.print()
    for sentence in notes(rows):
        console.print(sentence, markup=False, soft_wrap=True)
    console.print(f"picture: {picture}", markup=False, soft_wrap=True)


def figures(rows: Sequence[RowEnergy]) -> dict[str, Any]:
    """The rows as plain data, without their traces."""
    told = [
        {f.name: plain(getattr(row, f.name)) for f in fields(row) if f.name not in TRACES}
        for row in rows
    ]
    return {"plant": ROBOT, "rows": told, "notes": list(notes(rows))}


def chart(rows: Sequence[RowEnergy]) -> Chart:
    """V and Vs of two rows over time."""
    drawn = [row for row in rows if row.exp in PICTURED] or rows[: len(PICTURED)]
    tick_s = float(drawn[0].time_s[1] - drawn[0].time_s[0])
    one_count = drawn[0].joints[0].count_acceleration * tick_s
    resolution = Rule(0.5 * one_count**2, "y", "one joint, one count a tick")
    window_ms = 1e3 * WINDOW_TICKS * tick_s

    def panel(title: str, trace: Callable[[RowEnergy], Floats], x_label: str) -> Panel:
        lines = [
            _positive(row, trace(row), colour)
            for row, colour in zip(drawn, (PALETTE[1], PALETTE[0]), strict=False)
        ]
        return Panel(title, x_label, "all joints [rad²/s²]", lines, (resolution,), logarithmic=True)

    return Chart(
        [
            panel(f"V (20), means of {window_ms:g} ms", lambda row: row.energy, ""),
            panel("Vs = s²/2 (57), likewise", lambda row: row.sliding_energy, "time [s]"),
        ],
        1,
        WIDTH_IN,
        2.0,
    )


def _positive(row: RowEnergy, trace: Floats, colour: str) -> Line:
    """Means of a trace where they are above 0, which a logarithmic axis can't show."""
    time, means = window_means(row.time_s), window_means(trace)
    some = means > 0.0
    return Line(time[some], means[some], row.exp, colour)


def draw(rows: Sequence[RowEnergy], path: Path) -> Path:
    """Writes the picture as SVG, the same bytes for the same figures."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with house_style(printed=True):
        return write_svg(draw_chart(chart(rows)), path)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    parser.add_argument(
        "--row",
        action="append",
        choices=list(table_2()),
        help="only this row of Table II; may be repeated",
    )


def chosen(arguments: argparse.Namespace) -> Sequence[str]:
    """The rows that the command's arguments ask for, in the paper's order."""
    return [row for row in table_2() if not arguments.row or row in arguments.row]
