"""A run to look at: tracking error and torque of each joint, with a scenario's events marked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from plant.closed_loop import Run
from plant.flight import Flight
from plant.scenario import Scenario

Floats = NDArray[np.float64]

_INCHES = (8.0, 2.1)
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#5a5a5a")
"""After M. Okabe and K. Ito: distinct for colour-blind readers, too."""
_EVENT = "#999999"

# More points than an axis has pixels hide the extremes; so do fewer that are picked evenly.
_SPANS = 1500


def draw(flight: Flight, scenario: Scenario | None = None) -> Figure:
    """The picture of a flight.

    Args:
        flight: what was flown.
        scenario: what happened beside.
    """
    run, names = flight.run, flight.figures()["joint_names"]
    figure = Figure(figsize=(_INCHES[0], 3 * _INCHES[1] + 0.5), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    signals = {
        "reference [deg]": np.rad2deg(run.q_ref),
        "error by the encoder [deg]": np.rad2deg(_shown(run)),
        "applied torque [N m]": run.torque_applied_Nm,
    }
    for axes, (label, signal) in zip(panels, signals.items(), strict=True):
        for joint, name in enumerate(names):
            time, values = _extremes(run.time_s, signal[:, joint])
            axes.plot(time, values, color=_COLOURS[joint % len(_COLOURS)], lw=0.8, label=name)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
        axes.margins(x=0)
    panels[-1].set_xlabel("time [s]")
    if scenario is not None:
        _mark(panels, scenario, float(run.time_s[-1]))
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=len(names)
    )
    return figure


def _shown(run: Run) -> Floats:
    """The error; where the encoder jumps by more than the whole motion, nothing is to be seen."""
    error = run.error_rad.copy()
    error[np.abs(error) > 2.0 * np.ptp(run.q_ref) + 0.1] = np.nan
    return error


def _extremes(time_s: Floats, signal: Floats) -> tuple[Floats, Floats]:
    """The least and the largest value of each of many equal spans, in turn."""
    ticks = max(1, len(time_s) // _SPANS)
    count = len(time_s) // ticks
    if ticks == 1:
        return time_s, signal
    folded = signal[: count * ticks].reshape(count, ticks)
    # A span in which all is hidden stays hidden.
    lowest = np.where(np.isnan(folded).any(axis=1), np.nan, folded.min(axis=1))
    ends = np.column_stack((lowest, folded.max(axis=1)))
    return np.repeat(time_s[: count * ticks : ticks], 2), ends.ravel()


def _mark(panels: NDArray[np.object_], scenario: Scenario, end_s: float) -> None:
    """Marks when events begin and how long they last, but for those of the whole run."""
    for event in scenario.events:
        if (event.at_s, event.duration_s) == (0.0, None):
            continue
        for axes in panels:
            axes.axvline(event.at_s, color=_EVENT, lw=0.8, ls=":")
            if event.duration_s is not None:
                axes.axvspan(
                    event.at_s, event.at_s + event.duration_s, color=_EVENT, alpha=0.2, lw=0
                )
        _name(panels[0], event.kind, event.at_s / end_s)


def _name(axes: Axes, kind: str, place: float) -> None:
    axes.text(
        place,
        0.02,
        f" {kind}",
        transform=axes.transAxes,
        rotation=90,
        va="bottom",
        fontsize=7,
        bbox={"facecolor": "white", "alpha": 0.7, "lw": 0, "pad": 0.5},
    )


class PictureError(ValueError):
    """A picture that can't be written; the message says why."""


def save(figure: Figure, path: Path) -> None:
    """Writes a picture; the end of its name says what kind, such as .svg, .pdf or .png.

    Raises:
        PictureError: there is no such folder, or no such kind.
    """
    try:
        figure.savefig(path, dpi=150, metadata={"Date": None} if path.suffix == ".svg" else None)
    except (OSError, ValueError) as error:
        raise PictureError(f"picture {path}: {error}") from error
