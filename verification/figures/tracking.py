"""Fig. 4 and Fig. 5, the spikes where the motion stops, and Fig. 5's best law at more speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from plant.closed_loop import Run
from verification.evidence import Evidence
from verification.experiments import (
    PAPER_ROWS,
    PEAK_WINDOW_S,
    reversal_peaks_deg,
    reversal_times_s,
)
from verification.figures.chart import (
    COLUMN_IN,
    PAGE_IN,
    Chart,
    Floats,
    Line,
    Panel,
    Rule,
    extremes,
)
from verification.figures.flights import Flight, bench, error_deg, flown, joint_names
from verification.figures.paper_figure import PaperFigure
from verification.figures.rows import COLOURS, ENVELOPE_S, LABELS, envelope
from verification.paper import FASTER_RMS_DEG, REFERENCE_ROW, table_2
from verification.style import INK, PALETTE

SPANS = 600
"""Twice as many points draw a signal of any length."""

TIME = "time [s]"
ERROR = "e [deg]"
PLANT = (
    "Measured in simulation: the generated C on the reference plant, whose friction and amplitude "
    "were chosen."
)


def titles() -> list[str]:
    """Of the panels of the joints."""
    return [f"joint {number}, {name}" for number, name in enumerate(joint_names(), 1)]


def signal(time_s: Floats, values: Floats, label: str, colour: str, width_pt: float = 0.6) -> Line:
    """A line through the extremes of a long signal."""
    kept = extremes(values, SPANS)
    return Line(time_s[kept], values[kept], label, colour, width_pt=width_pt)


# --- Fig. 4 ------------------------------------------------------------------------------------


def trajectory() -> PaperFigure:
    """Fig. 4: desired position and velocity of each joint."""
    on = bench("reference")
    reference = on.trajectory.sampled(on.sample_time_s)
    time = reference.time_s[::20]
    position = np.rad2deg(reference.position_rad[::20])
    velocity = np.rad2deg(reference.velocity_rad_per_s[::20])
    names = titles()
    alike = bool(np.allclose(velocity, velocity[:, :1]))
    amplitude = float(np.ptp(position[:, 0])) / 2
    return PaperFigure(
        "trajectory",
        "Fig. 4: desired trajectory",
        f"Four fifth-order polynomials from rest to rest in {on.trajectory.duration_s:g} s. The "
        f"amplitude of {amplitude:.0f}° and the posture at the start are chosen.",
        Chart(
            [
                Panel(
                    "",
                    "",
                    "position [deg]",
                    [
                        Line(time, position[:, j], name, PALETTE[j], width_pt=1.2)
                        for j, name in enumerate(names)
                    ],
                    x_range=(0, on.trajectory.duration_s),
                ),
                Panel(
                    "all joints" if alike else "",
                    TIME,
                    "velocity [deg/s]",
                    [Line(time, velocity[:, 0], "", INK, width_pt=1.2)]
                    if alike
                    else [
                        Line(time, velocity[:, j], name, PALETTE[j], width_pt=1.2)
                        for j, name in enumerate(names)
                    ],
                    x_range=(0, on.trajectory.duration_s),
                ),
            ],
            1,
            COLUMN_IN,
            1.3,
        ),
        {
            "duration_s": on.trajectory.duration_s,
            "amplitude_deg": amplitude,
            "largest_velocity_deg_per_s": np.abs(velocity).max(axis=0).tolist(),
        },
        None,
    )


# --- Fig. 5 ------------------------------------------------------------------------------------


def _rows() -> dict[str, Run]:
    return {row: flown(Flight(row)) for row in PAPER_ROWS}


def errors() -> PaperFigure:
    """Fig. 5: tracking errors of four rows of Table II, linear and logarithmic."""
    runs = _rows()
    count_deg = np.rad2deg(1 / np.abs(bench("reference").plant.encoder.counts_per_rad))
    panels = []
    last = len(joint_names()) - 1
    for j, title in enumerate(titles()):
        lines, envelopes = [], []
        for row, run in runs.items():
            error = error_deg(run)[:, j]
            lines.append(signal(run.time_s, error, LABELS[row], COLOURS[row]))
            envelopes.append(
                Line(*envelope(run.time_s, error), LABELS[row], COLOURS[row], width_pt=0.8)
            )
        duration = (0.0, float(runs[REFERENCE_ROW].time_s[-1]))
        below = TIME if j == last else ""
        panels += [
            Panel(title, below, ERROR, lines, x_range=duration),
            Panel(
                f"{title}: largest in {1000 * ENVELOPE_S:.0f} ms",
                below,
                "|e| [deg]",
                envelopes,
                (Rule(count_deg[j], "y", "1 count"),),
                logarithmic=True,
                x_range=duration,
            ),
        ]
    return PaperFigure(
        "errors",
        "Fig. 5: tracking errors with four gain sets",
        "Hsia's law, two of Jin's, and the whole law; left as they are, right their largest "
        f"magnitudes on a logarithmic scale. {PLANT}",
        Chart(panels, 2, PAGE_IN, 1.35),
        {
            "rms_deg": {row: run.rms_error_deg().tolist() for row, run in runs.items()},
            "paper_rms_deg": {row: list(table_2()[row].rms_deg) for row in runs},
            "peak_deg": {
                row: np.abs(error_deg(run)).max(axis=0).tolist() for row, run in runs.items()
            },
        },
        Evidence.MEASURED,
    )


_BEFORE_S, _AFTER_S = 0.15, 0.6


def reversals() -> PaperFigure:
    """Fig. 5 enlarged where the desired velocity is zero: the spikes of friction."""
    runs = _rows()
    stops = np.cumsum(bench("reference").trajectory.segment_s)[:-1].tolist()
    turns = reversal_times_s(runs[REFERENCE_ROW])
    panels = []
    last = len(joint_names()) - 1
    for j in range(last + 1):
        largest = 1.08 * max(float(np.abs(error_deg(run)[:, j]).max()) for run in runs.values())
        for column, stop in enumerate(stops):
            turning = any(abs(turn - stop) < 0.1 for turn in turns)
            panels.append(
                Panel(
                    f"joint {j + 1}, {stop:g} s: {'reversal' if turning else 'stop'}",
                    TIME if j == last else "",
                    ERROR if column == 0 else "",
                    [_part(run, j, stop, LABELS[row], COLOURS[row]) for row, run in runs.items()],
                    (Rule(stop, "x"),),
                    x_range=(stop - _BEFORE_S, stop + _AFTER_S),
                    y_range=(-largest, largest),
                )
            )
    return PaperFigure(
        "reversals",
        "Fig. 5, enlarged: errors where the motion stops",
        "At a reversal the friction changes its sign within milliseconds, and the estimate of a "
        "sample ago is wrong by as much; at 6 s the velocity is zero and goes on in the same "
        f"direction. {PLANT}",
        Chart(panels, len(stops), PAGE_IN, 1.35),
        {
            "stops_s": stops,
            "reversals_s": list(turns),
            "window_s": PEAK_WINDOW_S,
            "peak_deg": {row: reversal_peaks_deg(run, stops).tolist() for row, run in runs.items()},
        },
        Evidence.MEASURED,
    )


def _part(run: Run, joint: int, around_s: float, label: str, colour: str) -> Line:
    time = run.time_s - around_s
    near = (time >= -_BEFORE_S) & (time <= _AFTER_S)
    values = error_deg(run)[near, joint]
    kept = extremes(values, 200)
    return Line(run.time_s[near][kept], values[kept], label, colour, width_pt=0.9)


# --- More speed --------------------------------------------------------------------------------

SPEED = 1.5


def speed() -> PaperFigure:
    """Section IV-C: Exp08's gains at 50 % more speed."""
    usual, faster = flown(Flight()), flown(Flight(speed=SPEED))
    labels = (REFERENCE_ROW, f"{REFERENCE_ROW}, +{100 * (SPEED - 1):.0f} % speed")
    colours = (PALETTE[0], PALETTE[3])
    runs = dict(zip(labels, (usual, faster), strict=True))
    panels = [
        Panel(
            title,
            TIME,
            ERROR,
            [
                signal(run.time_s, error_deg(run)[:, j], label, colour)
                for (label, run), colour in zip(reversed(runs.items()), colours[::-1], strict=True)
            ],
            x_range=(0.0, float(usual.time_s[-1])),
        )
        for j, title in enumerate(titles())
    ]
    paper = (table_2()[REFERENCE_ROW].rms_deg, FASTER_RMS_DEG)
    panels.append(_rms_panel([run.rms_error_deg() for run in runs.values()], paper, colours))
    return PaperFigure(
        "speed",
        "Section IV-C: 50 % more speed with the gains of Exp08",
        "No gain was tuned for the faster motion. Filled: this project; rings: the paper's robot. "
        + PLANT,
        Chart(panels, 2, PAGE_IN, 1.6),
        {
            "speed": SPEED,
            "rms_deg": faster.rms_error_deg().tolist(),
            "usual_rms_deg": usual.rms_error_deg().tolist(),
            "paper_rms_deg": list(FASTER_RMS_DEG),
            "peak_deg": np.abs(error_deg(faster)).max(axis=0).tolist(),
        },
        Evidence.MEASURED,
    )


def _rms_panel(
    ours: Sequence[Floats], paper: Sequence[Sequence[float]], colours: Sequence[str]
) -> Panel:
    """RMS errors of both speeds by joint, beside the paper's."""
    joints = np.arange(1.0, len(ours[0]) + 1)
    lines = []
    for mine, theirs, colour, aside in zip(ours, paper, colours, (-0.08, 0.08), strict=True):
        at = joints + aside
        lines.append(Line(at, np.array(theirs), "", colour, width_pt=0, marker=6, hollow=True))
        lines.append(Line(at, mine, "", colour, width_pt=0, marker=3.5))
    return Panel(
        "RMS error",
        "joint [-]",
        "RMS error [deg]",
        lines,
        x_range=(0.5, len(joints) + 0.5),
        y_range=(0.0, 1.15 * max(np.max(ours), np.max(paper))),
        x_ticks={joint: f"{joint:.0f}" for joint in joints.tolist()},
    )
