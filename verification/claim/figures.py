"""Pictures of the claim's campaigns; every point, step and bar is of runs of the generated C."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter, PercentFormatter

from verification.claim.flown import Floats, Flown, State
from verification.claim.linear import Joint, radius
from verification.claim.statistics import (
    RATIO_ROWS,
    Group,
    Share,
    Standing,
    paper_rms_deg,
    rank_correlations,
    ratios,
)
from verification.figures.rows import LABELS
from verification.paper import REFERENCE_ROW
from verification.style import INK, PALETTE, WIDTH_IN, house_style, write_svg

_STATES = {
    State.FINE: ("fine", "o", PALETTE[2]),
    State.VIBRATING: ("vibrating", "^", PALETTE[1]),
    State.DIVERGED: ("diverged", "x", PALETTE[3]),
}
_DELAY = "torque delay [sample times]"
_LINES = ("--", ":", "-")


def correlations(campaigns: Mapping[str, Flown]) -> Figure:
    """The share of plants whose rank correlation with Table II is at most so large.

    Most of it is at 1; the logarithmic share shows the few that are not.
    """
    figure, panels = _panels(len(campaigns), 1.75)
    for axes, (name, flown) in zip(panels, campaigns.items(), strict=True):
        for j, values in enumerate(rank_correlations(flown).T):
            axes.ecdf(values[np.isfinite(values)], color=PALETTE[j], label=f"joint {j + 1}")
        axes.set_title(f"{name} joints, {flown.plants} plants")
        axes.set_yscale("log")
        axes.set_ylim(0.5 / flown.plants, 1.3)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100 * share:g}%"))
        axes.set_ylabel("plants")
    panels[-1].set_xlabel("Spearman's rank correlation with Table II")
    _legend(figure, panels[0], 3)
    return figure


def ratio_spreads(flown: Flown) -> Figure:
    """The share of plants on which a row's error is at most so many times Exp08's.

    Dotted lines are Table II's own ratios.
    """
    figure, panels = _panels(flown.joints, 1.55)
    paper = paper_rms_deg(flown)
    for j, axes in enumerate(panels):
        for colour, row in zip(PALETTE, RATIO_ROWS, strict=False):
            values = ratios(flown, row)[:, j]
            axes.ecdf(values[np.isfinite(values)], color=colour, label=f"{row} / {REFERENCE_ROW}")
            ratio = paper[flown.index(row), j] / paper[flown.index(REFERENCE_ROW), j]
            axes.axvline(ratio, color=colour, linestyle=":")
        axes.axvline(1.0, color=INK, linewidth=0.7)
        axes.set_title(f"joint {j + 1}")
        _shares(axes)
    panels[-1].set_xscale("log")
    panels[-1].xaxis.set_major_formatter(_PLAIN)
    panels[-1].set_xlabel("ratio of RMS errors")
    _legend(figure, panels[0], 2)
    return figure


def best_shares(standings: Mapping[str, Standing]) -> Figure:
    """On how many plants Exp08 is the best row, of all and of those where it is fine."""
    figure = Figure(figsize=(WIDTH_IN, 2.6), layout="constrained")
    axes = figure.subplots()
    bars = [
        (f"{name}, {says}", group)
        for name, standing in standings.items()
        for says, group in (("all plants", standing.whole), ("where it is fine", _fine(standing)))
    ]
    width = 0.8 / len(bars)
    for k, (label, group) in enumerate(bars):
        shares = (*group.best, group.best_on_both)
        x = np.arange(len(shares)) + width * (k - (len(bars) - 1) / 2)
        heights = np.nan_to_num([share.share for share in shares])
        axes.bar(x, heights, width, color=PALETTE[k], label=label)
        axes.errorbar(x, heights, _whiskers(shares), fmt="none", ecolor=INK, elinewidth=0.8)
    joints = len(bars[0][1].best)
    axes.set_xticks(range(joints + 1), [*(f"joint {j + 1}" for j in range(joints)), "1 and 2"])
    axes.grid(visible=False, axis="x")
    _shares(axes)
    axes.set_ylabel(f"{REFERENCE_ROW} is best")
    _legend(figure, axes, 2)
    return figure


def _fine(standing: Standing) -> Group:
    """The plants where Exp08 is."""
    fine = (REFERENCE_ROW, State.FINE.name.lower())
    return next(group for group in standing.groups if (group.by, group.value) == fine)


def _whiskers(shares: Sequence[Share]) -> Floats:
    """How far the intervals reach below and above, shape (2, number of shares)."""
    return np.array([(s.share - s.low, s.high - s.share) if s.of else (0.0, 0.0) for s in shares]).T


@dataclass(frozen=True, eq=False)
class SafeMap:
    """The campaign of the map, and the joints of its nominal plant."""

    flown: Flown
    joints: tuple[Joint, ...]


def safe_map(of: SafeMap, row: str = REFERENCE_ROW) -> Figure:
    """How a row went against the delay of the torque and the stiffness of the joints.

    Lines are the bounds of linear theory (:mod:`verification.claim.linear`), one a joint.
    """
    figure = Figure(figsize=(WIDTH_IN, 3.9), layout="constrained")
    axes = figure.subplots()
    flown = of.flown
    _points(axes, flown, row, flown.stiffness_factor, 13.0)
    _logarithmic(axes)
    # As far as the points reach.
    delays, factors = np.linspace(*axes.get_xlim(), 41), np.geomspace(*axes.get_ylim(), 41)
    delays = delays[(delays >= 0.0) & (delays <= 1.0)]
    for j, (joint, style) in enumerate(zip(of.joints, _LINES, strict=False)):
        radii = [[radius(joint.stiffer(factor), d) for d in delays] for factor in factors]
        axes.contour(delays, factors, radii, [1.0], colors=INK, linestyles=style, linewidths=1.2)
        axes.plot([], [], color=INK, linestyle=style, label=f"joint {j + 1}, linear")
    axes.set_xlabel(_DELAY)
    axes.set_ylabel("stiffness [times the reference's]")
    _legend(figure, axes, 2)
    return figure


def safe_maps(flown: Flown) -> Figure:
    """The map of each row."""
    figure = Figure(figsize=(WIDTH_IN, 4.4), layout="constrained")
    panels = figure.subplots(2, -(-len(flown.rows) // 2), sharex=True, sharey=True, squeeze=False)
    for axes, row in zip(panels.flat, flown.rows, strict=False):
        _points(axes, flown, row, flown.stiffness_factor, 5.0, counted=False)
        _logarithmic(axes)
        axes.set_title(LABELS.get(row, row))
    figure.supxlabel(_DELAY, fontsize=9.5)
    figure.supylabel("stiffness [times the reference's]", fontsize=9.5)
    _legend(figure, panels[0, 0], 3)
    return figure


def rigid_map(flown: Flown, row: str = REFERENCE_ROW) -> Figure:
    """How a row went on rigid joints: against the delay and the inertia of the last link."""
    figure = Figure(figsize=(WIDTH_IN, 3.2), layout="constrained")
    axes = figure.subplots()
    _points(axes, flown, row, flown.inertia_factor[:, -1], 11.0)
    axes.set_xlabel(_DELAY)
    axes.set_ylabel("last link's inertia [relative]")
    _legend(figure, axes, 3)
    return figure


def _points(
    axes: Axes, flown: Flown, row: str, height: Floats, size: float, *, counted: bool = True
) -> None:
    states = flown.states[:, flown.index(row)]
    for state, (label, marker, colour) in _STATES.items():
        there = states == state
        axes.scatter(
            flown.torque_delay[there],
            height[there],
            s=size,
            marker=marker,
            color=colour,
            linewidths=0.8 if marker == "x" else 0.0,
            label=f"{label}: {np.count_nonzero(there)}" if counted else label,
        )


def _panels(count: int, panel_in: float) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(WIDTH_IN, count * panel_in + 0.9), layout="constrained")
    return figure, list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])


_PLAIN = FuncFormatter(lambda value, _: f"{value:g}")


def _logarithmic(axes: Axes) -> None:
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(_PLAIN)
    axes.yaxis.set_minor_formatter(NullFormatter())


def _shares(axes: Axes) -> None:
    axes.set_ylim(0.0, 1.02)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_ylabel("plants")


def _legend(figure: Figure, axes: Axes, columns: int) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=columns)


def draw(
    campaigns: Mapping[str, Flown], standings: Mapping[str, Standing], safe: SafeMap, folder: Path
) -> list[Path]:
    """Writes all pictures as SVG, the same bytes for the same figures.

    Args:
        campaigns: by the kind of their joints, ``rigid`` among them.
        standings: of the same campaigns.
        safe: of the safe map.
        folder: where to; made if it is not there.
    """
    with house_style(printed=True):
        figures = {
            "rank_correlation": correlations(campaigns),
            **{f"ratios_{name}": ratio_spreads(flown) for name, flown in campaigns.items()},
            "best": best_shares(standings),
            "safe_map": safe_map(safe),
            "safe_map_rows": safe_maps(safe.flown),
            "safe_map_rigid": rigid_map(campaigns["rigid"]),
        }
        folder.mkdir(parents=True, exist_ok=True)
        return [write_svg(figure, folder / f"{name}.svg") for name, figure in figures.items()]
