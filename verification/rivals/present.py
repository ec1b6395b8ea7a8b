"""The comparison as a person and a script read it: tables, sentences, figures and a picture."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter
from rich.console import Console
from rich.table import Table

from verification.evidence import RESULTS, plain
from verification.rivals.compare import (
    PHASES,
    TRIALS,
    Line,
    Result,
    Rules,
    Score,
    Standing,
    compare,
)
from verification.rivals.contenders import MODEL_ERROR, NO_MODEL, OURS
from verification.rivals.model import SIGN_WIDTH_RAD_PER_S
from verification.rivals.tuning import EFFORT, LOST_DEG, SEED, Effort
from verification.style import INK, PALETTE, WIDTH_IN, house_style

PICTURE = RESULTS / "rivals.svg"
MILLI = 1e3

_BLUE, _ORANGE, _GREEN, _RED, _PINK, _SKY = PALETTE
_MARKS = {
    "pid": (_ORANGE, "s"),
    "integral_sliding_mode": (_RED, "v"),
    "ct": (_PINK, "<"),
    "ct_f": (_PINK, ">"),
    "ct_fi": (_PINK, "D"),
    "ct_fi_high": (_SKY, "d"),
    "hsia": (_GREEN, "^"),
    "inclusive_exp08": (INK, "o"),
    "inclusive": (_BLUE, "o"),
}


# --- Tables ------------------------------------------------------------------------------------


def tables_of(result: Result) -> tuple[Table, ...]:
    """Two tables for each contest: the plant that all were tuned on, and all plants."""
    return tuple(
        table
        for standing in result.standings
        for table in (_training_table(standing), _trials_table(standing, result.phases))
    )


def _training_table(standing: Standing) -> Table:
    bound = standing.contest.bound
    table = _table("", "tuned", "model", "RMS, joints 1 2 3", "peak", "step")
    table.title = f"{standing.contest.name}: on the plant that all are tuned on"
    table.caption = (
        "errors in 0.001 deg; peak of the worst joint; torque step: RMS, over "
        f"the drive's limit, of the roughest joint, bound {bound:.2%}; dim: beyond it"
    )
    for line in standing.lines:
        score = line.scores[0]
        table.add_row(
            line.label,
            str(line.parameters),
            "none" if line.model == NO_MODEL else "needed",
            *(("lost", "", "") if score.lost else _figures(score)),
            style=None if line.within else "dim",
        )
    return table


def _figures(score: Score) -> tuple[str, str, str]:
    rms = " ".join(f"{MILLI * value:.2f}" for value in score.rms_deg)
    return rms, f"{MILLI * max(score.peak_deg):.1f}", f"{score.roughness:.2%}"


def _trials_table(standing: Standing, phases: int) -> Table:
    table = _table("", *(score.trial for score in standing.lines[0].scores))
    table.title = f"{standing.contest.name}: on all plants"
    table.caption = (
        "geometric mean over the joints of the RMS error, in 0.001 deg; lost: a joint was more "
        f"than {LOST_DEG:g} deg off, or the controller gave up, at so many of {phases} encoder "
        "phases"
    )
    for line in standing.lines:
        cells = (
            f"lost {score.lost}" if score.lost else f"{MILLI * score.mean_error_deg:.2f}"
            for score in line.scores
        )
        table.add_row(line.label, *cells, style=None if line.within else "dim")
    return table


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False, title_justify="left", caption_justify="left")
    for column in columns:
        table.add_column(column, no_wrap=True)
    return table


# --- Sentences ---------------------------------------------------------------------------------


def notes(result: Result) -> tuple[str, ...]:
    """How the figures were made."""
    return (
        "Measured on simulated plants.",
        f"Equal effort: {result.effort.runs} closed loops for each, differential evolution, one "
        f"seed ({result.effort.seed}), one box for gains of one meaning; more gains, no more runs.",
        "Same sensors for all: encoder counts, velocity by backward difference, the reference with "
        "its rates; same limits; all begin with the torque that held the robot.",
        "PID and sliding mode have no model, of gravity neither; computed torque (CT) has each "
        f"robot's own, every number {MODEL_ERROR:.0%} off, up or down by chance, or all up (+). "
        f"Its friction, where it has one, is Coulomb (over {SIGN_WIDTH_RAD_PER_S:g} rad/s) and "
        "viscous. A payload is in no one's model.",
        f"All are tuned at one encoder phase; scores are means over {result.phases} phases.",
        "Hsia's law is ours with lambda = 0 and alpha = beta = 1: where ours loses to it, the same "
        "effort found less among 8 numbers than among 5.",
        *(f"{trial.name}: {trial.meaning}." for trial in TRIALS),
    )


def findings(result: Result) -> tuple[str, ...]:
    """What the figures show, in sentences made from them: wins and losses of the inclusive law."""
    return tuple(
        sentence
        for standing in result.standings
        for sentence in (*_of_trials(standing), *_of_losses(standing))
    )


def _of_trials(standing: Standing) -> tuple[str, ...]:
    ours = next(line for line in standing.lines if line.name == OURS)
    return tuple(_of_trial(standing, ours, k) for k in range(len(ours.scores)))


def _of_trial(standing: Standing, ours: Line, trial: int) -> str:
    where = f"{standing.contest.name}, {ours.scores[trial].trial}"
    mine = ours.scores[trial]
    others = [
        line
        for line in standing.lines
        if line is not ours and line.within and not line.scores[trial].lost
    ]
    if not ours.within:
        return f"{where}: {ours.label} breaks the bound; others that do not: {len(others)}."
    if mine.lost:
        return f"{where}: {ours.label} is lost; others that are not: {len(others)}."
    if not others:
        return f"{where}: {ours.label} is the only one that isn't lost."
    best = min(others, key=lambda line: line.scores[trial].mean_error_deg)
    theirs = best.scores[trial].mean_error_deg
    ratio = mine.mean_error_deg / theirs
    better = sum(line.scores[trial].mean_error_deg < mine.mean_error_deg for line in others)
    if better == 0:
        return f"{where}: {ours.label} is best; next is {best.label} with {1 / ratio:.2f} times it."
    return (
        f"{where}: {ours.label} loses to {better} of {len(others)}; {best.label} is best, ours has "
        f"{ratio:.2f} times its error."
    )


def _of_losses(standing: Standing) -> tuple[str, ...]:
    return tuple(
        f"{standing.contest.name}: {line.label} is lost on {', '.join(trials)}."
        for line in standing.lines
        if (trials := [score.trial for score in line.scores if score.lost])
    )


# --- Figures and picture -----------------------------------------------------------------------


def figures(result: Result) -> dict[str, Any]:
    """The result as plain data, the sentences with it."""
    return {**plain(result), "notes": list(notes(result)), "findings": list(findings(result))}


def picture(result: Result) -> Figure:
    """A panel a contest: the mean error of each contender on each plant; lost ones on the right."""
    count = len(result.standings)
    figure = Figure(figsize=(1.5 * WIDTH_IN, 2.6 * count + 1.1), layout="constrained")
    panels = figure.subplots(count, 1, squeeze=False)[:, 0]
    for axes, standing in zip(panels, result.standings, strict=True):
        trials = [score.trial for score in standing.lines[0].scores]
        values = [
            MILLI * score.mean_error_deg
            for line in standing.lines
            for score in line.scores
            if not score.lost
        ]
        edge = 2.0 * max(values, default=1.0)
        spread = 0.6 / max(1, len(standing.lines) - 1)
        for number, line in enumerate(standing.lines):
            colour, marker = _MARKS[line.name]
            for row, score in enumerate(line.scores):
                height = row - 0.3 + spread * number
                there = edge if score.lost else MILLI * score.mean_error_deg
                axes.plot(
                    there,
                    height,
                    marker="x" if score.lost else marker,
                    color=colour,
                    markersize=5,
                    linestyle="none",
                    fillstyle="full" if line.within else "none",
                )
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_yticks(range(len(trials)), trials)
        axes.set_ylim(len(trials) - 0.5, -0.5)
        axes.grid(visible=False, axis="y")
        axes.grid(axis="x", alpha=0.3)
        for row in range(1, len(trials)):
            axes.axhline(row - 0.5, color=INK, linewidth=0.3, alpha=0.4)
        axes.set_title(
            f"{standing.contest.name}: torque steps below {standing.contest.bound:.2%} of the limit"
        )
    panels[-1].set_xlabel(
        "RMS error, geometric mean of the joints [0.001 deg]\nhollow: beyond the bound; x: lost"
    )
    handles = [
        Line2D(
            [],
            [],
            color=_MARKS[line.name][0],
            marker=_MARKS[line.name][1],
            linestyle="none",
            markersize=5,
            label=line.label,
        )
        for line in result.standings[0].lines
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=2)
    return figure


def draw(result: Result, path: Path = PICTURE) -> Path:
    """Writes the picture as SVG, the same bytes for the same figures."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with house_style():
        picture(result).savefig(
            path, format="svg", facecolor="white", metadata={"Date": None, "Creator": None}
        )
    return path


# --- Command -----------------------------------------------------------------------------------


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    parser.add_argument(
        "--generations",
        type=_count,
        default=EFFORT.generations,
        help=f"of {EFFORT.population} closed loops, for each contender (default: %(default)s)",
    )
    parser.add_argument(
        "--phases", type=_count, default=PHASES, help="encoder phases (default: %(default)s)"
    )
    parser.add_argument(
        "--seed", type=_count, default=SEED, help="of the optimiser (default: %(default)s)"
    )


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 10**6:
        raise argparse.ArgumentTypeError(f"a number from 1 to 10^6, not {text!r}")
    return int(text)


def conduct(arguments: argparse.Namespace, advance: Callable[[int], None]) -> Result:
    """Holds the contests that the command line asks for, and draws them."""
    effort = Effort(generations=arguments.generations, seed=arguments.seed)
    result = compare(Rules(effort=effort, phases=arguments.phases), advance=advance)
    draw(result)
    return result


def show(result: Result, console: Console) -> None:
    """Prints everything for a person."""
    for table in tables_of(result):
        console.print(table)
        console.print()
    for sentence in (*notes(result), *findings(result)):
        console.print(sentence, markup=False)
    console.print(f"picture: {PICTURE}", markup=False)
