"""The campaign as a person and a script read it: tables, sentences, figures and a picture."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from codegen.status import Status
from verification.evidence import RESULTS, plain
from verification.faults.campaign import Line, Result, Standing
from verification.faults.cases import (
    CASES,
    DEFAULT,
    GUARDS,
    NONE,
    TIGHT,
    WINDUP,
    Case,
    Guard,
    ground,
)
from verification.faults.catalogue import BY_NAME, TICK_S
from verification.faults.fly import HORIZON_S, REACTION_TICKS, REPLAN_S, fly
from verification.faults.score import NOMINAL, Score
from verification.style import INK, PALETTE, WIDTH_IN, house_style

PICTURE = RESULTS / "faults.svg"
SIDE_BY_SIDE = (NONE, DEFAULT, TIGHT)
"""The guards of the tables; what anti-windup is worth stands in a sentence."""

TINY = 1e-3
"""Stands for the ratio to a run that diverged."""

BETTER = 1.25
"""Figures that differ by less than this factor are told apart by chance as well."""


# --- Tables ------------------------------------------------------------------------------------


COLUMNS = (
    "fault",
    "status, after ticks",
    "lost",
    "torque %",
    "step %",
    "error deg",
    "back s",
)


def tables_of(standing: Standing) -> tuple[Table, Table]:
    """One plant's faults: how the shipped C took them, and the same with each guard."""
    peaks = " ".join(f"{peak:.4f}" for peak in standing.nominal_peak_error_deg)
    case = standing.case
    shipped = _table(f"{case.name}: {case.meaning}", COLUMNS)
    shipped.caption = f"peak errors without a fault, by joint: {peaks} deg"
    beside = _table(
        f"{case.name}: {', '.join(guard.name for guard in SIDE_BY_SIDE)}",
        (COLUMNS[0], *COLUMNS[4:]),
    )
    for line in standing.lines:
        shipped.add_row(*cells(line, (DEFAULT,)))
        compared = cells(line)
        beside.add_row(compared[0], *compared[4:])
    return shipped, beside


def _table(title: str, columns: Sequence[str]) -> Table:
    table = Table(
        box=None, pad_edge=False, title=title, title_justify="left", caption_justify="left"
    )
    for column in columns:
        if column == COLUMNS[1]:
            table.add_column(column, overflow="fold", min_width=18)
        else:
            justify: Literal["left", "right"] = "left" if column == COLUMNS[0] else "right"
            table.add_column(column, no_wrap=True, justify=justify)
    return table


def cells(line: Line, guards: Sequence[Guard] = SIDE_BY_SIDE) -> tuple[str, ...]:
    """A fault's row: how the shipped C took it, then the figures with each guard side by side."""
    shipped = line.scores[DEFAULT.name]
    scores = [line.scores[guard.name] for guard in guards]
    return (
        line.fault,
        _told(shipped),
        f"{shipped.lost_ticks}",
        " ".join(f"{100 * score.peak_torque:.0f}" for score in scores),
        " ".join(f"{100 * score.peak_torque_step:.0f}" for score in scores),
        " ".join(_short(score.peak_error_deg) for score in scores),
        " ".join(map(_back, scores)),
    )


_WORDS = {
    Status.ENCODER_JUMP: "jump",
    Status.NOT_FINITE: "nan",
    Status.OUT_OF_RANGE: "range",
    Status.SATURATED: "sat",
    Status.STOPPED: "stop",
}
_OF_NAMES = {status.name: word for status, word in _WORDS.items()}


def _told(score: Score) -> str:
    """The statuses, after how many ticks, and in how many runs if not in all."""
    if not score.statuses:
        return "none"
    told = f"{', '.join(_OF_NAMES[name] for name in score.statuses)} {score.after_ticks}"
    if score.noticed == score.attempts:
        return told
    return f"{told} ({score.noticed} of {score.attempts})" if score.noticed else f"{told} (late)"


def _short(value: float) -> str:
    """Two figures, but no power of ten."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def _back(score: Score) -> str:
    """A time after which only the encoders see no error any more stands in brackets."""
    if math.isfinite(score.back_s):
        return f"{score.back_s:.2f}"
    return f"({score.back_seen_s:.2f})" if math.isfinite(score.back_seen_s) else "-"


# --- Sentences ---------------------------------------------------------------------------------


def notes() -> tuple[str, ...]:
    """How the figures were made."""
    return (
        "Measured on simulated plants; each figure is the worst of four runs: faults that begin "
        "where the reference is fastest, once up and once down, at two encoder phases each.",
        "Guards: "
        + "; ".join(f"{guard.name}: {guard.meaning}" for guard in GUARDS)
        + ". Of three figures the first is without guards, the second as shipped, the third tight. "
        "In fixed-point the speed limit stays: its numbers have no room for other speeds.",
        ", ".join(f"{word}: TDC_{status.name}" for status, word in _WORDS.items())
        + ": the shipped controller's, with the ticks from the beginning of the fault to "
        "the first that is not TDC_OK; (late): not until the fault was over.",
        "Torque and torque step: the largest, over the drive's limit; a step is from one tick to "
        f"the next. The error is that of the joints themselves, until {HORIZON_S:g} s after the "
        "fault began.",
        "Sentences: least to most over all plants that flew a fault, (2 of 6) where it holds on so "
        "many of them only.",
        "Back: from the end of the fault, of a lasting one from its beginning, until every error "
        f"stays within {NOMINAL:g} times the largest without a fault; in brackets by the encoders "
        "only, whose zero stays off.",
        "A controller that stopped, with zero torque, is reset by a supervisor "
        f"{REACTION_TICKS} ticks later, but not before the fault is over; its reference leads from "
        f"where the robot is back to the old one within at least {REPLAN_S:g} s.",
    )


@dataclass(frozen=True)
class Comparison:
    """What one guard is beside another.

    Attributes:
        guard: the one.
        beside: the other.
        says: what makes the difference.
    """

    guard: Guard
    beside: Guard
    says: str


COMPARISONS = (
    Comparison(DEFAULT, NONE, "Guards as shipped beside none"),
    Comparison(TIGHT, DEFAULT, "A tight limit beside the shipped one"),
    Comparison(DEFAULT, WINDUP, "Anti-windup beside the same without"),
)
_FIGURES: dict[str, Callable[[Score], float]] = {
    "peak error": lambda score: score.peak_error_deg,
    "torque step": lambda score: score.peak_torque_step,
}


LARGE_DEG = 1.0


def findings(result: Result) -> tuple[str, ...]:
    """What the figures show, in sentences made from them: over all plants, least to most."""
    compared = (
        sentence
        for comparison in COMPARISONS
        for what, figure in _FIGURES.items()
        for sentence in _compared(result, comparison, what, figure)
    )
    large = _everywhere(result, lambda line: line.scores[DEFAULT.name].peak_error_deg, LARGE_DEG)
    silent = _everywhere(result, _silent, 0.0, spread=False)
    return (
        *compared,
        f"More than {LARGE_DEG:g} deg off with the guards as shipped: {large or 'none'}.",
        f"No status tells of it in every run: {silent or 'none'}.",
    )


def _compared(
    result: Result, comparison: Comparison, what: str, figure: Callable[[Score], float]
) -> tuple[str, ...]:
    """Where the guard makes a figure smaller or larger, and how many times."""

    def ratio(line: Line) -> float:
        mine, other = (figure(line.scores[g.name]) for g in (comparison.guard, comparison.beside))
        if math.isfinite(mine) and math.isfinite(other):
            return mine / other
        return 1.0 if mine == other else math.inf if math.isinf(mine) else 0.0

    smaller = _everywhere(result, lambda line: 1.0 / max(ratio(line), TINY), BETTER)
    larger = _everywhere(result, ratio, BETTER)
    return tuple(
        f"{comparison.says}: {what} so many times {how}: {names}."
        for how, names in (("smaller", smaller), ("larger", larger))
        if names
    )


def _silent(line: Line) -> float:
    """Runs in which no status told of the fault while it lasted."""
    score = line.scores[DEFAULT.name]
    return float(score.attempts - score.noticed)


def _everywhere(
    result: Result, figure: Callable[[Line], float], beyond: float, *, spread: bool = True
) -> str:
    """The faults that have a figure beyond a bound, its spread, and on how many plants."""
    values: dict[str, list[float]] = {}
    for standing in result.standings:
        for line in standing.lines:
            values.setdefault(line.fault, []).append(figure(line))
    told = []
    for name, all_of_them in values.items():
        there = [value for value in all_of_them if value > beyond]
        if there:
            least, most = map(_short, (min(there), max(there)))
            span = "" if not spread else f" {least}" if least == most else f" {least} to {most}"
            few = len(there) < len(all_of_them)
            told.append(f"{name}{span}" + (f" ({len(there)} of {len(all_of_them)})" if few else ""))
    return ", ".join(told)


# --- Figures and picture -----------------------------------------------------------------------


def figures(result: Result) -> dict[str, Any]:
    """The result as plain data, with tables as rows of text and the sentences."""
    rows = {
        standing.case.name: [list(cells(line)) for line in standing.lines]
        for standing in result.standings
    }
    return {
        **plain(result),
        "rows": rows,
        "guards": plain(GUARDS),
        "notes": list(notes()),
        "findings": list(findings(result)),
    }


@dataclass(frozen=True)
class Strip:
    """A fault in the picture.

    Attributes:
        fault: its name.
        joint: which one is shown, from 0.
        before_s: time that is shown before the fault.
        after_s: and after.
    """

    fault: str
    joint: int
    before_s: float
    after_s: float


STRIPS = (
    Strip("missed 1", 0, 0.01, 0.05),
    Strip("late 1", 0, 0.01, 0.05),
    Strip("dropout 5", 1, 0.01, 0.05),
    Strip("jump 50", 1, 0.01, 0.05),
    Strip("stuck 50", 1, 0.02, 0.4),
    Strip("saturated 1 s", 0, 0.2, 2.5),
)
"""Those that tell the most: of the joint that they hit, or the first."""

DRAWN = CASES[1]
_COLOURS = {NONE.name: PALETTE[3], DEFAULT.name: PALETTE[0], TIGHT.name: PALETTE[2]}
_WIDTHS = {NONE.name: 1.0, DEFAULT.name: 1.6, TIGHT.name: 0.9}


def picture(case: Case = DRAWN, strips: Sequence[Strip] = STRIPS) -> Figure:
    """Error and torque of a joint around each fault, with each guard."""
    figure = Figure(figsize=(1.6 * WIDTH_IN, 1.35 * len(strips) + 0.9), layout="constrained")
    panels = figure.subplots(len(strips), 2, squeeze=False)
    for row, strip in zip(panels, strips, strict=True):
        _draw_strip(row, case, strip)
    panels[-1][0].set_xlabel("time since the fault [ms]")
    panels[-1][1].set_xlabel("time since the fault [ms]")
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=len(SIDE_BY_SIDE))
    return figure


def _draw_strip(row: Sequence[Axes], case: Case, strip: Strip) -> None:
    there, fault = ground(case), BY_NAME[strip.fault]
    attempt = there.attempts[0]
    first = attempt.moment.tick - round(strip.before_s / TICK_S)
    last = attempt.moment.tick + round(strip.after_s / TICK_S)
    time_ms = np.arange(first, last) - attempt.moment.tick
    for guard in SIDE_BY_SIDE:
        flown = fly(there, fault, guard, attempt)
        signals = np.rad2deg(flown.error_rad), flown.torque_Nm
        for axes, signal in zip(row, signals, strict=True):
            axes.plot(
                time_ms,
                signal[first:last, strip.joint],
                color=_COLOURS[guard.name],
                linewidth=_WIDTHS[guard.name],
                label=guard.name,
            )
    for axes in row:
        axes.axvspan(0, min(fault.ticks or time_ms[-1], time_ms[-1]), color=INK, alpha=0.07, lw=0)
        axes.margins(x=0)
        axes.grid(alpha=0.3)
    row[0].set_title(f"{strip.fault}, joint {strip.joint + 1}")
    row[0].set_ylabel("error [deg]")
    row[1].set_ylabel("torque [N m]")


def draw(path: Path = PICTURE, case: Case = DRAWN, strips: Sequence[Strip] = STRIPS) -> Path:
    """Writes the picture as SVG, the same bytes for the same figures."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with house_style():
        picture(case, strips).savefig(
            path, format="svg", facecolor="white", metadata={"Date": None, "Creator": None}
        )
    return path


# --- Command -----------------------------------------------------------------------------------


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    parser.add_argument(
        "--plant",
        action="append",
        choices=[case.name for case in CASES],
        help="only this plant; may be repeated",
    )


def chosen(arguments: argparse.Namespace) -> Sequence[Case]:
    """The plants that the command's arguments ask for."""
    return [case for case in CASES if not arguments.plant or case.name in arguments.plant]


def show(result: Result, console: Console) -> None:
    """Prints everything for a person."""
    for standing in result.standings:
        for table in tables_of(standing):
            console.print(table)
            console.print()
    for sentence in (*notes(), *findings(result)):
        console.print(sentence, markup=False)
    console.print(f"picture: {PICTURE}", markup=False)
