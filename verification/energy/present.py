"""The energies as a person and a script read them: a table, sentences, a picture."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from verification.energy.audit import ROBOT, JointEnergy, RowEnergy
from verification.energy.recording import Floats
from verification.evidence import RESULTS, plain
from verification.paper import table_2
from verification.report.style import PALETTE, WIDTH_IN, house_style, write_svg

PICTURE = RESULTS / "energy.svg"
PICTURED = ("Exp01", "Exp08")
"""Hsia's law and the paper's best, if both were flown."""
TRACES = ("time_s", "energy", "sliding_energy")
"""The signals of a row, which are drawn and not told."""
WINDOW_TICKS = 50


def table_of(rows: Sequence[RowEnergy]) -> Table:
    """Shares and bounds, a line for each joint of each row."""
    table = Table(
        title=f"Energy along the closed loop, {ROBOT} plant: share of ticks in %",
        title_justify="left",
        box=None,
        pad_edge=False,
    )
    table.add_column("row")
    table.add_column("joint")
    for title in (
        "V falls",
        "as (21)",
        "Vs falls",
        "broken",
        "Vs falls,\nunbroken",
        "Vs falls,\nbroken",
        "ξ\n[rad/s²]",
        "max |s|\n[rad/s]",
        "|s| over\n(38)",
    ):
        table.add_column(title, justify="right")
    for row in rows:
        for number, joint in enumerate(row.joints):
            table.add_row("" if number else row.exp, joint.joint, *_cells(joint))
    return table


def _cells(joint: JointEnergy) -> Iterable[str]:
    for share in (
        joint.energy_falls,
        joint.energy_falls_as_21,
        joint.sliding_falls,
        joint.broken,
        joint.falls_where_unbroken,
        joint.falls_where_broken,
    ):
        yield "-" if share is None else f"{100 * share:.1f}"
    yield f"{joint.largest_tde_error:.1f}"
    yield f"{joint.largest_sliding:.4f}"
    yield "-" if joint.over_bound is None else f"{joint.over_bound:.2g}"


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
    yield "as (21): V falls by L KD |ed|^(alpha+1) or more; broken: |eps| >= lambda |s|^gamma (58)."
    yield (
        f"One count a tick a tick is {grain:.2f} rad/s^2: encoder resolution alone makes eps that "
        "large, and a single tick of V or Vs says little."
    )
    yield (
        "eps from torques and counts and eps from s by the sampled (32) differ by at most "
        f"{max(joint.identity_error for joint in joints):.1e} of xi."
    )
    if over:
        yield f"Largest |s| over the bound (38) with xi = max |eps|: {max(over):.3g}."
    saturated = [row.exp for row in rows if row.saturated_ticks]
    if saturated:
        yield f"Joints at their torque limit, where (32) does not hold: {', '.join(saturated)}."


def show(rows: Sequence[RowEnergy], picture: Path, console: Console) -> None:
    """Prints everything for a person."""
    console.print(table_of(rows))
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


def _smooth(trace: Floats, window: int = WINDOW_TICKS) -> Floats:
    """Means of whole windows, one after the other."""
    whole = len(trace) // window * window
    means: Floats = trace[:whole].reshape(-1, window).mean(axis=1)
    return means


def picture(rows: Sequence[RowEnergy]) -> Figure:
    """V and Vs of two rows over time."""
    drawn = [row for row in rows if row.exp in PICTURED] or rows[: len(PICTURED)]
    figure = Figure(figsize=(1.5 * WIDTH_IN, 4.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for row, colour in zip(drawn, (PALETTE[1], PALETTE[0]), strict=False):
        time = _smooth(row.time_s)
        for axes, trace in ((above, row.energy), (below, row.sliding_energy)):
            means = _smooth(trace)
            # At rest an energy may be 0, which a log axis can't show.
            axes.semilogy(time, np.where(means > 0.0, means, np.nan), color=colour, label=row.exp)
    window_ms = 1e3 * WINDOW_TICKS * float(drawn[0].time_s[1] - drawn[0].time_s[0])
    above.set_title(f"energy of the desired error dynamics V (20), means of {window_ms:g} ms")
    below.set_title("energy of the sliding variable $V_s$ = s²/2 (57)")
    for axes in (above, below):
        axes.set_ylabel("all joints [rad²/s²]")
    below.set_xlabel("time [s]")
    above.legend(loc="lower right", ncols=2)
    return figure


def draw(rows: Sequence[RowEnergy], path: Path) -> Path:
    """Writes the picture as SVG, the same bytes for the same figures."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with house_style(printed=True):
        return write_svg(picture(rows), path)


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
