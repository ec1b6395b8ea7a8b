"""Fig. 1 and Fig. 2: the desired error dynamics by itself, with the generated powers in it."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np

from codegen.controller import load
from verification.evidence import Evidence
from verification.experiments import CONTROLLERS
from verification.figures.chart import (
    PAGE_IN,
    Chart,
    Dash,
    Floats,
    Line,
    Panel,
    Rule,
)
from verification.figures.flow import CONTROLLER, Equilibrium, ErrorDynamics, flow, half_turn
from verification.figures.paper_figure import PaperFigure
from verification.style import INK, PALETTE

KD, KP = 20.0, 100.0
"""Of section III-E: a double pole at -10 1/s where alpha = beta = 1."""

TWISTED = ErrorDynamics(KD, KP, Fraction(95, 100), Fraction(95, 105))
LINEAR = ErrorDynamics(KD, KP, Fraction(1), Fraction(1))
SLOW = ErrorDynamics(KD, KP, Fraction(6, 5), Fraction(6, 5))
"""The exponents of Exp11 and Exp12."""

# --- Fig. 1 ------------------------------------------------------------------------------------

EXPONENTS = (Fraction(1, 2), Fraction(1), Fraction(3, 2))
"""Below, at and above 1, for alpha from left to right and for beta from top to bottom. Chosen."""

PORTRAITS = tuple(
    ErrorDynamics(KD, KP, alpha, beta) for beta, alpha in product(EXPONENTS, repeat=2)
)

BOX = (1.0, 12.0)
"""What a portrait shows: |e| in rad and |ed| in rad/s."""

STARTS = tuple(
    (sign * e, sign * ed)
    for sign in (1, -1)
    for e, ed in ((1.0, 0.0), (1.0, -12.0), (0.4, -12.0), (-0.2, -12.0), (-0.7, -12.0))
)
"""Where the trajectories of a portrait begin, on the edge of the box."""

_PORTRAIT_S, _ROW_S, _STEP_S = 4.0, 1e-3, 1e-4
_COLOURS = {Equilibrium.NODE: PALETTE[0], Equilibrium.FOCUS: PALETTE[3]}


def spaced(states: Floats, least: float = 0.012) -> Floats:
    """States of a trajectory that are some share of the box apart, and the last one."""
    kept = [states[0]]
    for state in states[1:]:
        if np.hypot(*((state - kept[-1]) / BOX)) >= least:
            kept.append(state)
    return np.array([*kept, states[-1]])


def _portrait(dynamics: ErrorDynamics) -> list[Line]:
    kind = dynamics.equilibrium
    return _trajectories(dynamics, kind.value, _COLOURS[kind], "solid")


def _trajectories(dynamics: ErrorDynamics, label: str, colour: str, dash: Dash) -> list[Line]:
    flows = (flow(dynamics, start, _PORTRAIT_S, _ROW_S, _STEP_S) for start in STARTS)
    return [_in_phase_plane(spaced(states), label, colour, dash) for _, states in flows]


def _in_phase_plane(states: Floats, label: str, colour: str, dash: Dash) -> Line:
    return Line(states[:, 0], states[:, 1], label, colour, dash, 0.8)


def phase_portraits() -> PaperFigure:
    """Fig. 1: trajectories in the phase plane for nine pairs of exponents."""
    starts = np.array(STARTS)
    turn = half_turn(TWISTED)
    panels = []
    for number, dynamics in enumerate(PORTRAITS):
        lines = _portrait(dynamics)
        if dynamics == LINEAR:
            name = f"α = 0.95, β = 0.905: {TWISTED.equilibrium.value}"
            lines += _trajectories(TWISTED, name, INK, "dashed")
        lines.append(Line(starts[:, 0], starts[:, 1], "start", INK, width_pt=0.0, marker=2.5))
        row, column = divmod(number, len(EXPONENTS))
        panels.append(
            Panel(
                f"α = {float(dynamics.alpha):g}, β = {float(dynamics.beta):g}: "
                f"{dynamics.equilibrium.value}",
                "e [rad]" if row == len(EXPONENTS) - 1 else "",
                "ė [rad/s]" if column == 0 else "",
                lines,
                x_range=(-1.35, 1.35),
                y_range=(-13.5, 13.5),
            )
        )
    return PaperFigure(
        "phase-portraits",
        "Fig. 1: phase portraits of the desired error dynamics",
        f"ë + {KD:g} sig(ė)^α + {KP:g} sig(e)^β = 0 for exponents below, at and above 1 (chosen), "
        "integrated with the generated C's powers. All turn clockwise. Node or focus is that of "
        "the origin, by the terms that lead there: a focus oscillates without end, however little; "
        "with α = β = 0.5 the error winds at this scale and creeps near the origin only. "
        f"With α = 0.95 and β = 95/105 (dashed) each half-turn overshoots by "
        f"{100 * turn.overshoot:.3f} % only: it looks like a node.",
        Chart(panels, len(EXPONENTS), PAGE_IN, 1.75),
        {
            "kd": KD,
            "kp": KP,
            "portraits": [
                {
                    "alpha": float(d.alpha),
                    "beta": float(d.beta),
                    "equilibrium": d.equilibrium.value,
                }
                for d in (*PORTRAITS, TWISTED)
            ],
            "overshoot_of_alpha_0.95": turn.overshoot,
        },
        Evidence.MEASURED,
    )


# --- Fig. 2 ------------------------------------------------------------------------------------

CONVERGENCE_S = 3.0
_LEAST_RAD = 1e-30
_CASES: dict[str, tuple[ErrorDynamics, str, Dash]] = {
    "α = β = 1": (LINEAR, PALETTE[1], "dashed"),
    "α = 0.95, β = 0.905": (TWISTED, PALETTE[0], "solid"),
    "α = β = 1.2": (SLOW, PALETTE[3], "dotted"),
}


def resolved_s(time_s: Floats, error_rad: Floats, count_rad: float) -> float | None:
    """When an error is below an encoder count for good; None if it isn't by the end."""
    above = np.flatnonzero(np.abs(error_rad) >= count_rad)
    if not len(above):
        return float(time_s[0])
    return float(time_s[above[-1] + 1]) if above[-1] + 1 < len(time_s) else None


def convergence() -> PaperFigure:
    """Fig. 2: the error from 1 rad at rest, on a linear and on a logarithmic scale."""
    settling_s = half_turn(TWISTED).settling_time_s(TWISTED.alpha)
    count_rad = abs(load(CONTROLLERS / f"{CONTROLLER}.toml").joints[0].rad_per_count)
    linear, logarithmic = [], []
    resolved = {}
    for label, (dynamics, colour, dash) in _CASES.items():
        time_s, states = flow(dynamics, (1.0, 0.0), CONVERGENCE_S, 1e-3)
        error = states[:, 0]
        resolved[label] = resolved_s(time_s, error, count_rad)
        first = time_s <= 1.0
        linear.append(Line(time_s[first][::5], error[first][::5], label, colour, dash, 1.2))
        shown = np.abs(error) > _LEAST_RAD / 10
        logarithmic.append(
            Line(time_s[shown][::5], np.abs(error[shown][::5]), label, colour, dash, 1.2)
        )
    return PaperFigure(
        "convergence",
        "Fig. 2: convergence of the desired error dynamics",
        f"The error from 1 rad at rest, KD = {KD:g}, KP = {KP:g}, integrated with the generated "
        f"C's powers. With α = 0.95 and β = 95/105 it is zero from t = {settling_s:.4f} s on, with "
        "the two others never; each dip is a change of sign. T follows from the first half-turn "
        "by homogeneity.",
        Chart(
            [
                Panel("linear scale", "time [s]", "e [rad]", linear, x_range=(0, 1)),
                Panel(
                    "logarithmic scale",
                    "time [s]",
                    "|e| [rad]",
                    logarithmic,
                    (Rule(settling_s, "x", "T"), Rule(count_rad, "y", "1 count")),
                    logarithmic=True,
                    x_range=(0, CONVERGENCE_S),
                    y_range=(_LEAST_RAD, 2.0),
                ),
            ],
            2,
            PAGE_IN,
            2.2,
        ),
        {
            "settling_time_s": settling_s,
            "count_rad": count_rad,
            "below_one_count_from_s": resolved,
        },
        Evidence.MEASURED,
    )
