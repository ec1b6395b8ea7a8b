"""Pictures of a tuning: each step of the procedure, and the optimiser's held-out plants."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from plant.tuning.comparison import Comparison
from plant.tuning.procedure import VIBRATION_LIMIT, Chosen, Trial

# Okabe and Ito's colours, told apart with every common kind of colour blindness.
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9")

_STYLE: Any = {
    "svg.hashsalt": "inclusive-tdc",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.linewidth": 0.5,
    "grid.alpha": 0.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}
_AXES = {
    "inertia": "Mbar [kg m²]",
    "lambda_": "lambda (0 stands at the left edge)",
    "gamma": "gamma",
    "alpha": "alpha",
}
_STEPS: tuple[float, ...] = (1.0, 2.0, 5.0)
"""Labels of a decade of a logarithmic axis."""
_LAMBDA_ZERO = 1.0
"""Where 0 is drawn on lambda's logarithmic axis."""


@contextmanager
def _style() -> Iterator[None]:
    """Draws the same picture whatever the user's own matplotlibrc says."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def _svg(figure: Figure) -> str:
    """The picture as a file, the same bytes every time."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def step_picture(
    chosen: Chosen, before: Chosen | None, trials: Sequence[Trial], joint_names: Sequence[str]
) -> str:
    """Error and vibration of each joint against the quantity of a step, as SVG.

    Dots are good values, crosses bad ones; a ring marks what was chosen.

    Args:
        chosen: what the step ended with.
        before: what the one before ended with, with which this one began.
        trials: of the step.
        joint_names: from the base.
    """
    step = chosen.step
    with _style():
        figure = Figure(figsize=(7.0, 5.0), layout="constrained")
        error, shaking = figure.subplots(2, 1, sharex=True)
        for joint, name in enumerate(joint_names):
            colour = PALETTE[joint % len(PALETTE)]
            mine = [(trial, _verdict(trial, joint)) for trial in trials]
            for good, marker in ((True, "o"), (False, "x")):
                tried: list[Trial | Chosen] = [
                    t for t, verdict in mine if verdict == good and t.stage != "confirm"
                ]
                tried += [before] if good and before is not None else []
                x = [_value(trial, joint, step.quantity) for trial in tried]
                look: Any = {"color": colour, "marker": marker, "ls": "none", "ms": 4}
                error.plot(x, [t.outcome.rms_deg[joint] for t in tried], **look)
                shaking.plot(x, [t.outcome.vibration[joint] for t in tried], **look)
            final = _value(chosen, joint, step.quantity)
            ring: Any = {"color": colour, "marker": "o", "mfc": "none", "ms": 9, "mew": 1.5}
            ring["ls"] = "none"
            error.plot([final], [chosen.outcome.rms_deg[joint]], label=name, **ring)
            shaking.plot([final], [chosen.outcome.vibration[joint]], **ring)
            for axes in (error, shaking):
                axes.axvline(final, color=colour, lw=0.8, alpha=0.6)
        shaking.axhline(step.vibration_limit, color="black", lw=1.0, ls="--")
        error.set_title(f"step {step.number}: {step.symbol}")
        error.set_ylabel("RMS error [deg]")
        shaking.set_ylabel("vibration, 1 for counts alone")
        shaking.set_xlabel(_AXES[step.quantity])
        _scales(error, shaking, step.quantity, step.vibration_limit)
        _legend(figure, error)
        return _svg(figure)


def _legend(figure: Figure, error: Axes) -> None:
    handles, labels = error.get_legend_handles_labels()
    plain: Any = {"color": "gray", "ls": "none"}
    handles += [
        Line2D([], [], marker="o", ms=4, **plain),
        Line2D([], [], marker="x", ms=4, **plain),
        Line2D([], [], color="black", lw=1.0, ls="--"),
    ]
    labels = [f"{label}, chosen" for label in labels] + ["good", "bad", "limit"]
    figure.legend(handles, labels, loc="outside lower center", ncols=3)


def _scales(error: Axes, shaking: Axes, quantity: str, limit: float) -> None:
    for axes in (error, shaking):
        axes.set_yscale("log")
        _plain(axes.yaxis, _STEPS)
    # A trial beyond all bounds must not squeeze the others together.
    shaking.set_ylim(0.8, min(20 * limit, 1.3 * max(shaking.get_ylim()[1], limit)))
    if quantity in ("inertia", "lambda_"):
        shaking.set_xscale("log")
        _plain(shaking.xaxis, _STEPS)
    else:
        # From 1 downwards, as the procedure goes.
        shaking.invert_xaxis()


def _plain(axis: Axis, steps: tuple[float, ...]) -> None:
    """A logarithmic axis whose labels are plain decimals."""
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _verdict(trial: Trial, joint: int) -> bool | None:
    """Whether a joint's value was good; None where it was not at stake."""
    of_joint = trial.verdicts[joint if len(trial.verdicts) > 1 else 0]
    return None if of_joint is None else of_joint.good


def _value(of: Trial | Chosen, joint: int, quantity: str) -> float:
    value = getattr(of.gains, quantity)
    if quantity == "inertia":
        return float(value[joint])
    return float(value) or (_LAMBDA_ZERO if quantity == "lambda_" else 0.0)


def comparison_picture(held_out: Comparison, tuned_on: str) -> str:
    """Both gain sets on the held-out plants, error and vibration, as SVG.

    Args:
        held_out: both gain sets on the same plants.
        tuned_on: the plant of the procedure's gains, in words.
    """
    with _style():
        figure = Figure(figsize=(7.0, 4.0), layout="constrained")
        error, shaking = figure.subplots(1, 2)
        pairs = (
            (error, held_out.procedure.error_deg, held_out.optimiser.error_deg, "RMS error [deg]"),
            (shaking, held_out.procedure.vibration, held_out.optimiser.vibration, "vibration"),
        )
        for axes, of_procedure, of_optimiser, title in pairs:
            finite = np.isfinite(of_procedure) & np.isfinite(of_optimiser)
            axes.loglog(of_procedure[finite], of_optimiser[finite], "o", ms=4, color=PALETTE[0])
            low, high = (
                min(axes.get_xlim()[0], axes.get_ylim()[0]),
                max(axes.get_xlim()[1], axes.get_ylim()[1]),
            )
            axes.plot([low, high], [low, high], color="gray", lw=0.8)
            steps = (1.0,) if high > 300.0 * low else (1.0, 3.0) if high > 30.0 * low else _STEPS
            for axis in (axes.xaxis, axes.yaxis):
                _plain(axis, steps)
            axes.set(xlim=(low, high), ylim=(low, high), title=title, aspect="equal")
            axes.set_xlabel(f"III-E on {tuned_on}")
            axes.set_ylabel("optimiser")
        for line in (shaking.axhline, shaking.axvline):
            line(VIBRATION_LIMIT, color="black", lw=1.0, ls="--")
        figure.suptitle(
            f"{len(held_out.ratio)} plants that neither was tuned on; better below the diagonal",
            fontsize=9,
        )
        return _svg(figure)
