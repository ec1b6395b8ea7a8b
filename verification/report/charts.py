"""The report's own charts, each from measured signals; every axis has its unit.

They are one column wide, so that their letters can be read on a phone.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from verification.experiments import Beside, Outcome
from verification.figures.chart import Chart, Floats, Line, Panel, Rule, extremes
from verification.figures.rows import COLOURS, LABELS, envelope
from verification.style import INK, PALETTE, WIDTH_IN

TIME = "time [s]"
SPANS = 600
"""Twice as many points draw a torque."""
AROUND_S = 0.35
"""Drawn before and after a reversal."""

_column = partial(Chart, columns=1, width_in=WIDTH_IN)


def _duration(outcome: Outcome) -> tuple[float, float]:
    return 0.0, float(outcome.run.time_s[-1])


def _titles(outcome: Outcome) -> list[str]:
    return [f"joint {j}, {name}" for j, name in enumerate(outcome.joint_names, 1)]


def trajectory(outcome: Outcome) -> Chart:
    """The desired trajectory, as in Fig. 4: position and velocity of each joint."""
    run = outcome.run
    some = slice(None, None, 20)
    time = run.time_s[some]
    position, velocity = np.rad2deg(run.q_ref[some]), np.rad2deg(run.qd_ref[some])
    alike = bool(np.allclose(velocity, velocity[:, :1]))
    names = outcome.joint_names

    def lines(values: Floats) -> list[Line]:
        return [Line(time, values[:, j], name, PALETTE[j]) for j, name in enumerate(names)]

    moving = [Line(time, velocity[:, 0], "", INK)] if alike else lines(velocity)
    span = _duration(outcome)
    return _column(
        [
            Panel("", "", "position [deg]", lines(position), x_range=span),
            Panel("all joints" if alike else "", TIME, "velocity [deg/s]", moving, x_range=span),
        ],
        panel_in=1.4,
    )


def errors(outcomes: Sequence[Outcome], resolution_deg: Floats) -> Chart:
    """Tracking errors of the experiments, a panel a joint, as in Fig. 5 but logarithmic."""
    titles = _titles(outcomes[0])
    return _column(
        [
            Panel(
                title,
                TIME if j == len(titles) - 1 else "",
                "|e| [deg]",
                [_envelope_of(outcome, j) for outcome in outcomes],
                (Rule(float(resolution_deg[j]), "y", "1 count"),),
                logarithmic=True,
                x_range=_duration(outcomes[0]),
            )
            for j, title in enumerate(titles)
        ],
        panel_in=1.55,
    )


def _envelope_of(outcome: Outcome, joint: int) -> Line:
    row = outcome.experiment.row
    error = np.rad2deg(outcome.run.error_rad[:, joint])
    return Line(*envelope(outcome.run.time_s, error), LABELS[row], COLOURS[row])


def table_2(rows: Sequence[Beside]) -> Chart:
    """Table II: RMS errors of the simulated plant and of the paper's robot."""
    joints = len(rows[0].ours_deg)
    lines = []
    for j in range(joints):
        # Side by side within a row of the table, one column a joint.
        x = np.arange(float(len(rows))) + 0.22 * (j - (joints - 1) / 2)
        ours, paper = np.array([(r.ours_deg[j], r.paper_deg[j]) for r in rows]).T
        colour = PALETTE[j]
        lines += [Line(x[[i, i]], np.array(ends), "", colour)
                  for i, ends in enumerate(zip(ours, paper, strict=True))]  # fmt: skip
        lines += [
            Line(x, ours, f"joint {j + 1}", colour, width_pt=0, marker=4.5),
            Line(x, paper, f"paper, joint {j + 1}", colour, width_pt=0, marker=7, hollow=True),
        ]
    names = {float(i): LABELS[r.experiment].split(", ")[1] for i, r in enumerate(rows)}
    half = 0.5
    return _column(
        [
            Panel(
                "",
                "law [-]",
                "RMS error [deg]",
                lines,
                logarithmic=True,
                x_range=(-half, len(rows) - half),
                x_ticks=names,
            )
        ],
        panel_in=2.6,
    )


def torques(outcome: Outcome) -> Chart:
    """Applied torques with the limits of the drives."""
    run, titles = outcome.run, _titles(outcome)
    panels = []
    for j, title in enumerate(titles):
        kept = extremes(run.torque_applied_Nm[:, j], SPANS)
        torque = Line(
            run.time_s[kept], run.torque_applied_Nm[kept, j], "", PALETTE[0], width_pt=0.7
        )
        limit = float(outcome.torque_limit_Nm[j])
        panels.append(
            Panel(
                title,
                TIME if j == len(titles) - 1 else "",
                "τ [N m]",
                [torque],
                (Rule(limit, "y"), Rule(-limit, "y", "limit")),
                x_range=_duration(outcome),
                y_range=(-1.15 * limit, 1.15 * limit),
            )
        )
    return _column(panels, panel_in=1.3)


def reversal(outcomes: Sequence[Outcome], around_s: float, joint: int = 0) -> Chart:
    """Velocity, friction and errors of one joint where its velocity changes sign."""
    best = outcomes[-1].run
    near = np.flatnonzero(np.abs(best.time_s - around_s) <= AROUND_S)
    span = float(best.time_s[near[0]]), float(best.time_s[near[-1]])

    def lines(values: Sequence[Floats]) -> list[Line]:
        return [
            Line(o.run.time_s[near[::2]], v, LABELS[o.experiment.row], COLOURS[o.experiment.row])
            for o, v in zip(outcomes, values, strict=True)
        ]

    velocity = np.rad2deg(best.qd_ref[near, joint])
    friction = [o.run.friction_Nm[near[::2], joint] for o in outcomes]
    error = [np.rad2deg(o.run.error_rad[near[::2], joint]) for o in outcomes]
    return _column(
        [
            Panel(
                _titles(outcomes[-1])[joint],
                "",
                "velocity [deg/s]",
                [Line(best.time_s[near], velocity, "", INK)],
                x_range=span,
            ),
            Panel("", "", "friction [N m]", lines(friction), x_range=span),
            Panel("", TIME, "error [deg]", lines(error), x_range=span),
        ],
        panel_in=1.35,
    )


def all_joints(outcome: Outcome) -> Chart:
    """Errors and torques of many joints in two panels."""
    run = outcome.run
    errors, torques = [], []
    for j, name in enumerate(outcome.joint_names):
        colour = PALETTE[j % len(PALETTE)]
        error = envelope(run.time_s, np.rad2deg(run.error_rad[:, j]))
        errors.append(Line(*error, name, colour, width_pt=0.9))
        share = 100 * run.torque_applied_Nm[::20, j] / outcome.torque_limit_Nm[j]
        torques.append(Line(run.time_s[::20], share, name, colour, width_pt=0.9))
    span = _duration(outcome)
    return _column(
        [
            Panel("", "", "|e| [deg]", errors, logarithmic=True, x_range=span),
            Panel("", TIME, "torque [% of limit]", torques, x_range=span),
        ],
        panel_in=2.1,
    )
