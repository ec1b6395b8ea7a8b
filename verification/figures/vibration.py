"""Fig. 6 and the remark on gamma below 0.4: exponents that are too small make the robot vibrate."""

from __future__ import annotations

import numpy as np

from plant.closed_loop import Run
from verification.evidence import Evidence
from verification.figures.chart import PAGE_IN, Chart, Floats, Line, Panel, extremes
from verification.figures.flights import (
    Flight,
    error_deg,
    flown,
    joint_names,
    torque_activity,
)
from verification.figures.paper_figure import PaperFigure
from verification.figures.tracking import ERROR, PLANT, TIME, signal, titles
from verification.style import PALETTE

# --- Fig. 6 ------------------------------------------------------------------------------------

ALPHAS = ("0.9", "0.95")
"""Too small, and that of Exp08."""

_COLOURS = dict(zip(ALPHAS, (PALETTE[3], PALETTE[0]), strict=True))
NEAR_S = (10.5, 11.1)
"""What is enlarged: some periods, long after the vibration has grown."""

_SETTLED_S = 6.0


def _flexible(alpha: str) -> Run:
    return flown(Flight(changed=_changed(alpha), robot="reference_flexible"))


def _changed(alpha: str) -> tuple[tuple[str, str], ...]:
    return (("alpha", alpha), ("beta", "finite-time"))


def vibration_frequency(run: Run, lowest_Hz: float = 3.0) -> Floats:
    """The strongest frequency of each joint's error above the motion's own, shape (n,)."""
    error = error_deg(run)[run.time_s >= _SETTLED_S]
    window = np.hanning(len(error))[:, np.newaxis]
    spectrum = np.abs(np.fft.rfft((error - error.mean(axis=0)) * window, axis=0))
    frequencies = np.fft.rfftfreq(len(error), run.sample_time_s)
    above = frequencies >= lowest_Hz
    strongest: Floats = frequencies[above][spectrum[above].argmax(axis=0)]
    return strongest


def vibration() -> PaperFigure:
    """Fig. 6: error and torque with too small an alpha, on flexible joints."""
    runs = {alpha: _flexible(alpha) for alpha in ALPHAS}
    errors, near, torques = [], [], []
    for j, title in enumerate(titles()):
        of_joint = {
            _label(alpha): (run, error_deg(run)[:, j], run.torque_applied_Nm[:, j], _COLOURS[alpha])
            for alpha, run in runs.items()
        }
        items = of_joint.items()
        errors.append(
            Panel(
                title,
                TIME,
                ERROR,
                [signal(run.time_s, e, label, c, 0.5) for label, (run, e, _, c) in items],
                x_range=(0.0, 12.0),
            )
        )
        near.append(
            Panel(
                "enlarged",
                "",
                ERROR,
                [_near(run.time_s, e, label, c) for label, (run, e, _, c) in items],
                x_range=NEAR_S,
            )
        )
        torques.append(
            Panel(
                "applied torque, enlarged",
                TIME,
                "τ [N m]",
                [_near(run.time_s, t, label, c) for label, (run, _, t, c) in items],
                x_range=NEAR_S,
            )
        )
    rates = vibration_frequency(runs[ALPHAS[0]])
    stiff = flown(Flight(changed=_changed(ALPHAS[0])))
    return PaperFigure(
        "vibration",
        "Fig. 6: vibration with too small an alpha",
        f"Exp08 and the same with α = {ALPHAS[0]}, β = α/(2 - α), with flexible joints of "
        f"chosen stiffness. They vibrate at {rates.mean():.0f} Hz. With "
        f"rigid joints the same gains give at most {stiff.rms_error_deg().max():.4f}° RMS. {PLANT}",
        Chart([*errors, *near, *torques], len(joint_names()), PAGE_IN, 1.3),
        {
            "rms_deg": {alpha: run.rms_error_deg().tolist() for alpha, run in runs.items()},
            "peak_deg": {
                alpha: np.abs(error_deg(run)).max(axis=0).tolist() for alpha, run in runs.items()
            },
            "torque_activity_Nm": {
                alpha: torque_activity(run).tolist() for alpha, run in runs.items()
            },
            "frequency_Hz": rates.tolist(),
            "rigid_rms_deg": stiff.rms_error_deg().tolist(),
        },
        Evidence.MEASURED,
    )


def _label(alpha: str) -> str:
    return f"α = {alpha}"


def _near(time_s: Floats, values: Floats, label: str, colour: str) -> Line:
    near = (time_s >= NEAR_S[0]) & (time_s <= NEAR_S[1])
    kept = extremes(values[near], 300)
    return Line(time_s[near][kept], values[near][kept], label, colour, width_pt=0.7)


# --- Small gamma -------------------------------------------------------------------------------

GAMMAS = ("0", "0.1", "0.2", "0.3", "0.4", "0.5", "0.6")
PHASES = 8
"""Encoder phases, spread over a count, that a figure is the mean of."""


def small_gamma() -> PaperFigure:
    """RMS error and torque activity as gamma goes to zero, the other gains being Exp08's."""
    rms, activity = (np.empty((len(GAMMAS), PHASES, len(joint_names()))) for _ in range(2))
    for i, gamma in enumerate(GAMMAS):
        for k in range(PHASES):
            run = flown(Flight(changed=(("gamma", gamma),), phase=k / PHASES))
            rms[i, k], activity[i, k] = run.rms_error_deg(), torque_activity(run)
    x = np.array([float(gamma) for gamma in GAMMAS])
    best = x[rms.mean(axis=1).argmin(axis=0)]
    return PaperFigure(
        "small-gamma",
        "Section IV-B: gamma below 0.4",
        "Exp08 with other γ: RMS error, and RMS of the torque's change Δτ from tick to tick, means "
        f"over {PHASES} encoder phases with their standard errors. The error is least at "
        f"γ = {', '.join(f'{gamma:g}' for gamma in best)} (joints 1 to {len(best)}); below, "
        f"the torque works harder for nothing. {PLANT}",
        Chart(
            [
                Panel("tracking", "γ [-]", "RMS error [deg]", _means(x, rms)),
                Panel("torque activity", "γ [-]", "rms Δτ [N m]", _means(x, activity)),
            ],
            2,
            PAGE_IN,
            2.0,
        ),
        {
            "gamma": x.tolist(),
            "phases": PHASES,
            "least_error_at": best.tolist(),
            "rms_deg": rms.mean(axis=1).tolist(),
            "torque_activity_Nm": activity.mean(axis=1).tolist(),
        },
        Evidence.MEASURED,
    )


def _means(x: Floats, values: Floats) -> list[Line]:
    """A line for each joint; values of shape (x, phases, n)."""
    mean = values.mean(axis=1)
    spread = values.std(axis=1, ddof=1) / np.sqrt(values.shape[1])
    return [
        Line(x, mean[:, j], name, PALETTE[j], marker=3.5, spread=spread[:, j])
        for j, name in enumerate(titles())
    ]
