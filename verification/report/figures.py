"""The report's pictures, each from measured signals; every axis has its unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from verification.experiments import Beside, Outcome
from verification.report.style import INK, PALETTE, WIDTH_IN

Floats = NDArray[np.float64]

ENVELOPE_S = 0.04
"""Errors are drawn as their largest magnitude in each such span: 12 000 ticks fit no screen."""

COLOURS = {"Exp01": PALETTE[3], "Exp02": PALETTE[1], "Exp05": PALETTE[2], "Exp08": PALETTE[0]}
LABELS = {
    "Exp01": "Exp01, Hsia",
    "Exp02": "Exp02, Jin",
    "Exp05": "Exp05, Jin TSM",
    "Exp08": "Exp08, inclusive",
}


def envelope(time_s: Floats, signal: Floats, span_s: float = ENVELOPE_S) -> tuple[Floats, Floats]:
    """The largest magnitude in each span: times of the spans' middles, and the maxima."""
    ticks = max(1, round(span_s / (time_s[1] - time_s[0])))
    spans = len(signal) // ticks
    folded = np.abs(signal[: spans * ticks]).reshape(spans, ticks)
    return time_s[: spans * ticks : ticks] + span_s / 2, folded.max(axis=1)


def _panels(count: int, panel_in: float, extra_in: float = 0.9) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(WIDTH_IN, count * panel_in + extra_in), layout="constrained")
    axes = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    return figure, list(axes)


def _logarithmic(axes: Axes, steps: tuple[float, ...] = (1.0,)) -> None:
    """A logarithmic axis whose labels are plain decimals."""
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=steps))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _legend(figure: Figure, axes: Axes, columns: int) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=columns)


def trajectory(outcome: Outcome) -> Figure:
    """The desired trajectory, as in Fig. 4: position and velocity of each joint."""
    figure, (position, velocity) = _panels(2, 1.4)
    run = outcome.run
    some = slice(None, None, 20)
    for j, name in enumerate(outcome.joint_names):
        position.plot(
            run.time_s[some], np.rad2deg(run.q_ref[some, j]), color=PALETTE[j], label=name
        )
    velocities = np.rad2deg(run.qd_ref[some])
    alike = bool(np.allclose(velocities, velocities[:, :1]))
    for j in range(1 if alike else velocities.shape[1]):
        colour = INK if alike else PALETTE[j]
        velocity.plot(run.time_s[some], velocities[:, j], color=colour)
    if alike:
        velocity.set_title("all joints")
    position.set_ylabel("position [deg]")
    velocity.set_ylabel("velocity [deg/s]")
    velocity.set_xlabel("time [s]")
    _legend(figure, position, 3)
    return figure


def errors(outcomes: Sequence[Outcome], resolution_deg: Floats) -> Figure:
    """Tracking errors of the experiments, a panel a joint, as in Fig. 5 but logarithmic."""
    names = outcomes[0].joint_names
    figure, panels = _panels(len(names), 1.55)
    for j, (axes, name) in enumerate(zip(panels, names, strict=True)):
        for outcome in outcomes:
            row = outcome.experiment.row
            time, largest = envelope(outcome.run.time_s, np.rad2deg(outcome.run.error_rad[:, j]))
            axes.plot(time, largest, color=COLOURS[row], label=LABELS[row], linewidth=1.0)
        axes.axhline(resolution_deg[j], color=INK, linewidth=0.7, linestyle=":", label="1 count")
        _logarithmic(axes)
        axes.set_ylabel("|e| [deg]")
        axes.set_title(f"joint {j + 1}, {name}")
    panels[-1].set_xlabel("time [s]")
    _legend(figure, panels[0], 3)
    return figure


def table_2_dots(rows: Sequence[Beside]) -> Figure:
    """Table II: RMS errors of the paper's robot and of the simulated plant."""
    joints = len(rows[0].ours_deg)
    figure = Figure(figsize=(WIDTH_IN, 3.3), layout="constrained")
    axes = figure.subplots()
    for j in range(joints):
        # Side by side within a row of the table, one column a joint.
        x = np.arange(len(rows)) + 0.22 * (j - (joints - 1) / 2)
        ours, paper = ([r.ours_deg[j] for r in rows], [r.paper_deg[j] for r in rows])
        axes.vlines(x, ours, paper, color=PALETTE[j], linewidth=1.0)
        axes.plot(x, paper, "o", markerfacecolor="none", markersize=7, color=PALETTE[j])
        axes.plot(x, ours, "o", markersize=4.5, color=PALETTE[j], label=f"joint {j + 1}")
    axes.plot([], [], "o", markersize=4.5, color=INK, label="this report")
    axes.plot([], [], "o", markersize=7, markerfacecolor="none", color=INK, label="paper")
    _logarithmic(axes, (1.0, 2.0, 5.0))
    axes.set_xticks(range(len(rows)), [LABELS[r.experiment].replace(", ", "\n") for r in rows])
    axes.grid(visible=False, axis="x")
    axes.set_ylabel("RMS error [deg]")
    _legend(figure, axes, 5)
    return figure


def torques(outcome: Outcome) -> Figure:
    """Applied torques with the limits of the drives."""
    names = outcome.joint_names
    figure, panels = _panels(len(names), 1.3)
    run = outcome.run
    for j, (axes, name) in enumerate(zip(panels, names, strict=True)):
        some = slice(None, None, 10)
        axes.plot(
            run.time_s[some],
            run.torque_applied_Nm[some, j],
            color=PALETTE[0],
            linewidth=0.7,
            label="applied torque",
        )
        limit = outcome.torque_limit_Nm[j]
        for sign in (-1, 1):
            axes.axhline(
                sign * limit, color=PALETTE[3], linestyle="--", linewidth=1.0,
                label="limit" if sign > 0 else None,
            )  # fmt: skip
        axes.set_ylim(-1.12 * limit, 1.12 * limit)
        axes.set_ylabel("τ [N m]")
        axes.set_title(f"joint {j + 1}, {name}")
    panels[-1].set_xlabel("time [s]")
    _legend(figure, panels[0], 2)
    return figure


def reversal(outcomes: Sequence[Outcome], around_s: float, joint: int = 0) -> Figure:
    """Velocity, friction and errors of one joint where its velocity changes sign."""
    figure, (velocity, friction, error) = _panels(3, 1.35)
    best = outcomes[-1].run
    near = np.abs(best.time_s - around_s) <= 0.35
    time = best.time_s[near]
    velocity.plot(time, np.rad2deg(best.qd_ref[near, joint]), color=INK)
    velocity.set_ylabel("velocity [deg/s]")
    velocity.set_title(f"joint {joint + 1}, {outcomes[-1].joint_names[joint]}")
    for outcome in outcomes:
        row = outcome.experiment.row
        style: dict[str, Any] = {"color": COLOURS[row], "label": LABELS[row], "linewidth": 1.0}
        some = np.flatnonzero(near)[::2]
        friction.plot(outcome.run.time_s[some], outcome.run.friction_Nm[some, joint], **style)
        error.plot(
            outcome.run.time_s[some], np.rad2deg(outcome.run.error_rad[some, joint]), **style
        )
    friction.set_ylabel("friction [N m]")
    error.set_ylabel("error [deg]")
    error.set_xlabel("time [s]")
    _legend(figure, error, 2)
    return figure


def all_joints(outcome: Outcome) -> Figure:
    """Errors and torques of many joints in two panels."""
    figure, (error, torque) = _panels(2, 2.1)
    for j, name in enumerate(outcome.joint_names):
        style: dict[str, Any] = {
            "color": PALETTE[j % len(PALETTE)],
            "linewidth": 0.9,
            "label": name,
        }
        time, largest = envelope(outcome.run.time_s, np.rad2deg(outcome.run.error_rad[:, j]))
        error.plot(time, largest, **style)
        share = 100 * outcome.run.torque_applied_Nm[:, j] / outcome.torque_limit_Nm[j]
        torque.plot(outcome.run.time_s[::20], share[::20], **style)
    _logarithmic(error, (1.0, 2.0, 5.0))
    error.set_ylabel("|e| [deg]")
    torque.set_ylabel("torque [% of limit]")
    torque.set_xlabel("time [s]")
    _legend(figure, error, 3)
    return figure
