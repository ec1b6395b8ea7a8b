"""The pictures of a gain set's page: intervals, phase portraits, and the error of the run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from verification.energy.audit import sig
from verification.error_dynamics.analysis import ErrorDynamics
from verification.sampled_stability.intervals import Interval
from verification.style import INK, PALETTE, WIDTH_IN, house_style, inline_svg
from verification.tuning_check.check import TuningCheck
from verification.tuning_check.joint import Floats, Sampled
from verification.workspace.certify import LIMIT

_STARTS = 12
_STEPS = 3000
_STEPS_PER_TIME_CONSTANT = 60
_STABLE, _STEEP, _RANGE = PALETTE[2], PALETTE[5], PALETTE[1]


def intervals(checked: TuningCheck) -> str:
    """The stable intervals as bars, with the eigenvalues of M^-1 Mbar in them."""
    groups = _by_sampled(checked)
    bars = [x for sampled, _ in groups for x in (*sampled.intervals, *sampled.at_one_count)]
    found = checked.eigenvalues
    numbers = [float(LIMIT), *(float(i.high) for i in bars)]
    numbers += [float(i.low) for i in bars if float(i.low) > 0.0]
    numbers += [] if found is None else [float(found.low), float(found.high)]
    least, most = min(numbers) / 2.0, 2.0 * max(numbers)
    with house_style():
        figure = Figure(figsize=(WIDTH_IN, 0.9 + 0.62 * len(groups)), layout="constrained")
        axes = figure.subplots()
        for row, (sampled, _) in enumerate(groups):
            _bars(axes, sampled.intervals, row - 0.17, _STABLE, least, "stable (linear law)")
            if sampled.at_one_count != sampled.intervals:
                says = "as steep as at one count"
                _bars(axes, sampled.at_one_count, row + 0.17, _STEEP, least, says)
        if found is not None:
            axes.axvspan(float(found.low), float(found.high), color=_RANGE, alpha=0.3, zorder=0)
            for end in (found.low, found.high):
                axes.axvline(float(end), color=_RANGE, label="eigenvalues of $M^{-1}\\bar{M}$")
        axes.axvline(float(LIMIT), color=INK, linestyle=":", label="limit of (33)")
        axes.set_xscale("log")
        axes.set_xlim(least, most)
        axes.set_ylim(len(groups) - 0.5, -0.5)
        axes.set_yticks(range(len(groups)), [names for _, names in groups])
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("$\\bar{M}/M$")
        _legend(figure, axes)
        return inline_svg(figure, "intervals", "Stable intervals and eigenvalues of M^-1 Mbar")


def _by_sampled(checked: TuningCheck) -> list[tuple[Sampled, str]]:
    """Each different loop with the names of its joints."""
    names: dict[int, tuple[Sampled, list[str]]] = {}
    for joint in checked.joints:
        sampled = joint.specified.sampled
        names.setdefault(id(sampled), (sampled, []))[1].append(joint.name)
    everyone = len(names) == 1
    return [(s, "all joints" if everyone else ", ".join(who)) for s, who in names.values()]


def _bars(
    axes: Axes, found: Sequence[Interval], at: float, colour: str, least: float, label: str
) -> None:
    for interval in found:
        low = max(float(interval.low), least)
        width = float(interval.high) - low
        axes.barh(at, width, left=low, height=0.3, color=colour, label=label)


def _legend(figure: Figure, axes: Axes, ncols: int = 2) -> None:
    """Each entry once."""
    by_label = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    figure.legend(by_label.values(), by_label.keys(), loc="outside upper left", ncols=ncols)


def portraits(checked: TuningCheck) -> str | None:
    """Motions of the desired error dynamics, one picture for each different set of gains."""
    different: dict[tuple[object, ...], tuple[ErrorDynamics, list[str]]] = {}
    for joint in checked.joints:
        dynamics = joint.specified.dynamics
        if dynamics is not None:
            p = dynamics.parameters
            key = p.KD, p.KP, p.alpha, p.beta
            different.setdefault(key, (dynamics, []))[1].append(joint.name)
    if not different:
        return None
    with house_style():
        figure = Figure(figsize=(WIDTH_IN, 2.3 * ((len(different) + 1) // 2)), layout="constrained")
        shape = ((len(different) + 1) // 2, min(2, len(different)))
        for axes, (dynamics, names) in zip(
            figure.subplots(*shape, squeeze=False).flat, different.values(), strict=False
        ):
            for e, ed in zip(*motions(dynamics), strict=True):
                axes.plot(e, ed, color=PALETTE[0], linewidth=0.8)
            axes.plot(0.0, 0.0, "o", color=INK, markersize=3)
            everyone = len(names) == len(checked.joints)
            axes.set_title("all joints" if everyone else ", ".join(names))
            axes.set_xlabel("e [rad]")
            axes.set_ylabel("ė [rad/s]")
        return inline_svg(figure, "portraits", "Phase portraits of the desired error dynamics")


def motions(dynamics: ErrorDynamics) -> tuple[Floats, Floats]:
    """e and ed along motions from a ring of starts, each of shape (starts, steps).

    Steps of the classical Runge-Kutta method, short against both gains; for a picture.
    """
    p = dynamics.parameters
    KD, KP, alpha, beta = (np.array(float(x)) for x in (p.KD, p.KP, p.alpha, p.beta))
    fastest = float(max(KD, np.sqrt(KP)))
    step = 1.0 / (_STEPS_PER_TIME_CONSTANT * fastest)
    angle = np.linspace(0.0, 2.0 * np.pi, _STARTS, endpoint=False)
    state = np.array([np.cos(angle), np.sqrt(KP) * np.sin(angle)])

    def rate(x: Floats) -> Floats:
        return np.array([x[1], -KD * sig(x[1], alpha) - KP * sig(x[0], beta)])

    way = np.empty((_STEPS, *state.shape))
    for k in range(_STEPS):
        way[k] = state
        a = rate(state)
        b = rate(state + 0.5 * step * a)
        c = rate(state + 0.5 * step * b)
        d = rate(state + step * c)
        state = state + step / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return way[:, 0].T, way[:, 1].T


def errors(checked: TuningCheck) -> str | None:
    """The error of each joint along the run, as the encoders see it."""
    if checked.flight is None or checked.flight.run is None:
        return None
    run = checked.flight.run
    with house_style():
        figure = Figure(figsize=(2.0 * WIDTH_IN, 2.4), layout="constrained")
        axes = figure.subplots()
        error = 1e3 * np.rad2deg(run.error_rad)
        for j, joint in enumerate(checked.joints):
            colour = PALETTE[j % len(PALETTE)]
            axes.plot(run.time_s, error[:, j], color=colour, linewidth=0.6, label=joint.name)
        axes.set_xlabel("time [s]")
        axes.set_ylabel("error [0.001 deg]")
        _legend(figure, axes, ncols=6)
        return inline_svg(figure, "errors", "Tracking error along the run")
