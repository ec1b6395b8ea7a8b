"""The bench's figures as a table for a terminal and as a picture for the report."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from rich import box
from rich.table import Table

from verification.bench.recording import Outcome
from verification.bench.rows import Row
from verification.bench.variants import LINEAR_FLOOR, PROJECT, PROJECT_LINEAR, VARIANTS, WITH_POWERS
from verification.style import INK, PALETTE, WIDTH_IN

TITLES = {variant.name: variant.title for variant in VARIANTS}
# Ours, the floor, and all others: told apart by lightness as well as by hue.
_COLOURS = {
    **{variant.name: PALETTE[0] for variant in (*WITH_POWERS, PROJECT_LINEAR)},
    LINEAR_FLOOR.name: PALETTE[2],
}
_OTHERS = PALETTE[1]
_BAR = 0.38
_LIGHT = 0.55
"""Opacity of the bars for more than the fewest joints."""


def thousands(value: float) -> str:
    """A number in groups of three digits, with thin spaces as SI writes them."""
    return f"{value:,.0f}".replace(",", "\N{NARROW NO-BREAK SPACE}")


def _estimate(cycles: float | None) -> str:
    return "-" if cycles is None else thousands(cycles)


def _cores(rows: Iterable[Row]) -> list[str]:
    return list(dict.fromkeys(row.core for row in rows))


def tables(rows: Sequence[Row]) -> list[Table]:
    """A table of all variants for each core and number of joints."""
    places = dict.fromkeys((row.core, row.joints) for row in rows)
    return [
        _table(core, joints, [r for r in rows if (r.core, r.joints) == (core, joints)])
        for core, joints in places
    ]


def _narrow(title: str) -> Table:
    """A table that keeps within a terminal of 80 columns."""
    return Table(
        title=title,
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        collapse_padding=True,
    )


def _table(core: str, joints: int, rows: Sequence[Row]) -> Table:
    made = _narrow(f"{core}, n = {joints}")
    made.add_column("variant", no_wrap=True)
    for heading in ("mean", "worst", "ratio", "estimated\ncycles", "flash", "stack"):
        made.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        made.add_row(
            TITLES[row.variant],
            thousands(row.instructions_per_step),
            thousands(row.worst_instructions),
            f"{row.times_the_project:.3g}",
            _estimate(row.estimated_cycles),
            thousands(row.flash_bytes),
            thousands(row.stack_bytes),
            style="bold" if row.variant == PROJECT.name else "",
        )
    return made


def cases(rows: Sequence[Row], joints: int) -> Table:
    """What each special tick costs this project's step, a column a core."""
    chosen = [row for row in rows if row.variant == PROJECT.name and row.joints == joints]
    made = _narrow(f"this project, n = {joints}")
    made.add_column("tick")
    for row in chosen:
        made.add_column(row.core, justify="right", no_wrap=True)
    made.add_row("recorded motion, mean", *(thousands(r.instructions_per_step) for r in chosen))
    made.add_row("recorded motion, most", *(thousands(r.instructions_max) for r in chosen))
    for same in zip(*(row.special_cases for row in chosen), strict=True):
        name = same[0].name + (" (error)" if same[0].outcome is Outcome.ERROR else "")
        made.add_row(name, *(thousands(case.instructions) for case in same))
    made.add_row("random bits, most", *(thousands(r.random_bits_instructions) for r in chosen))
    return made


def chart(rows: Sequence[Row]) -> Figure:
    """Instructions per step as bars, logarithmic: a panel a core, a bar for each number of joints.

    The thin line on a bar goes from the shortest usual tick to the longest of all: where it is
    long, the step's time depends on the data.
    """
    cores = _cores(rows)
    shown = [_shown([row for row in rows if row.core == core]) for core in cores]
    height = 0.8 + sum(0.45 + 0.29 * len(variants) for variants in shown)
    figure = Figure(figsize=(WIDTH_IN, height), layout="constrained")
    ratios = [1.25 + len(variants) for variants in shown]
    panels = figure.subplots(
        len(cores), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": ratios}
    )[:, 0]
    for axes, core, variants in zip(panels, cores, shown, strict=True):
        _panel(axes, [row for row in rows if row.core == core], variants)
        axes.set_title(core)
    panels[-1].set_xlabel("instructions per step")
    panels[0].legend(
        handles=_legend(rows), loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False
    )
    least = min(row.usual_fewest for row in rows)
    most = max(row.worst_instructions for row in rows)
    # A logarithmic axis has no zero; on the right, room for the numbers behind the longest bars.
    panels[-1].set_xlim(left=10.0 ** math.floor(math.log10(least)), right=most * 8)
    return figure


def _legend(rows: Sequence[Row]) -> list[Patch]:
    """What dark and light bars stand for."""
    joints = sorted({row.joints for row in rows})
    return [
        Patch(color=PALETTE[0], alpha=1.0 if n == joints[0] else _LIGHT, label=f"n = {n}")
        for n in joints
    ]


def _shown(rows: Sequence[Row]) -> list[str]:
    """The variants that a core has rows for, in their order."""
    return [v.name for v in VARIANTS if any(row.variant == v.name for row in rows)]


def _panel(axes: Axes, rows: Sequence[Row], variants: Sequence[str]) -> None:
    joints = sorted({row.joints for row in rows})
    for row in rows:
        place = variants.index(row.variant) + (joints.index(row.joints) - 0.5) * _BAR
        colour = _COLOURS.get(row.variant, _OTHERS)
        light = 1.0 if row.joints == joints[0] else _LIGHT
        axes.barh(place, row.instructions_per_step, _BAR, color=colour, alpha=light)
        ends = [row.usual_fewest, row.worst_instructions]
        axes.plot(ends, [place, place], color=INK, linewidth=0.8)
        axes.annotate(
            thousands(row.instructions_per_step),
            (max(row.instructions_per_step, row.worst_instructions), place),
            xytext=(4, 0),
            textcoords="offset points",
            verticalalignment="center",
            fontsize=7.5,
            # The grid's lines would cross the numbers.
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.2},
        )
    axes.set_xscale("log")
    axes.set_yticks(range(len(variants)), [TITLES[name] for name in variants])
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)
