"""The figures' data against other ways to find it, and the page that needs nothing but itself."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from plotly.offline import get_plotlyjs
from scipy.integrate import solve_ivp

from codegen.controller import load
from tests.chromium import chromium
from verification.__main__ import main
from verification.evidence import Evidence
from verification.experiments import CONTROLLERS, PAPER_ROWS
from verification.figures import desired_dynamics, vibration
from verification.figures.catalogue import BUILDERS, all_figures
from verification.figures.chart import Line, Panel, extremes
from verification.figures.desired_dynamics import PORTRAITS, TWISTED
from verification.figures.flights import Flight, error_deg, flown
from verification.figures.flow import Equilibrium, ErrorDynamics, flow, half_turn
from verification.figures.page import embedded, render
from verification.figures.paper_figure import PaperFigure
from verification.figures.present import make
from verification.paper import table_2

Floats = NDArray[np.float64]
Figures = Mapping[str, PaperFigure]


@pytest.fixture(scope="session")
def figures() -> Figures:
    return {figure.name: figure for figure in all_figures()}


@pytest.fixture(scope="session")
def html(figures: Figures) -> str:
    return render(list(figures.values()))


def sig(x: float, a: float) -> float:
    """|x|^a sgn(x), in double and without the generated C."""
    return float(np.sign(x) * np.abs(x) ** a)


def exactly(
    dynamics: ErrorDynamics,
    start: tuple[float, float],
    times_s: Floats,
    tolerance: float = 1e-10,
    rest: float = 0.0,
) -> Floats:
    """A trajectory of (17) by SciPy's LSODA, shape (rows, 2), until it is at rest."""

    def slope(_: float, state: Floats) -> tuple[float, float]:
        e, ed = state
        damper = dynamics.kd * sig(ed, float(dynamics.alpha))
        return ed, -damper - dynamics.kp * sig(e, float(dynamics.beta))

    def above_rest(_: float, state: Floats) -> float:
        return float(np.hypot(*state)) - rest

    above_rest.terminal = rest > 0  # type: ignore[attr-defined]
    solved = solve_ivp(
        slope,
        (0.0, times_s[-1]),
        start,
        "LSODA",
        times_s,
        events=above_rest,
        rtol=tolerance,
        atol=1e-3 * tolerance,
    )
    assert solved.success, solved.message
    states: Floats = solved.y.T
    return states


# --- The desired error dynamics ----------------------------------------------------------------


@pytest.mark.parametrize("dynamics", [*PORTRAITS, TWISTED], ids=str)
def test_trajectories_are_those_of_exact_powers(dynamics: ErrorDynamics) -> None:
    for start in ((1.0, 0.0), (0.4, -12.0)):
        time_s, states = flow(dynamics, start, 0.5, 0.01)
        assert states == pytest.approx(exactly(dynamics, start, time_s), abs=3e-6)


@pytest.mark.parametrize("dynamics", [*PORTRAITS, TWISTED], ids=str)
def test_energy_falls_by_what_the_damper_takes(dynamics: ErrorDynamics) -> None:
    time_s, states = flow(dynamics, (1.0, -12.0), 1.0, 1e-4)
    energy = dynamics.energy(states)
    assert energy[0] == pytest.approx(72 + 100 / (float(dynamics.beta) + 1), rel=1e-12), (
        "(20) at e = 1, ed = -12"
    )
    assert (np.diff(energy) <= 1e-9).all()
    power = -20 * np.abs(states[:, 1]) ** (float(dynamics.alpha) + 1)  # (21)
    assert dynamics.power(states) == pytest.approx(power, rel=1e-12)
    lost = float(np.sum((power[1:] + power[:-1]) / 2 * np.diff(time_s)))
    assert energy[-1] - energy[0] == pytest.approx(lost, rel=2e-5)


ENCLOSED = {"98/100": 5.41124083, "95/100": 2.38598563, "4/5": 0.90733632, "1/2": 0.79009861}
"""Settling times [s] from e = 1 rad at rest, from quadratures in ball arithmetic."""


@pytest.mark.parametrize(("alpha", "settling_s"), ENCLOSED.items())
def test_half_turns_add_up_to_the_exact_settling_time(alpha: str, settling_s: float) -> None:
    exponent = Fraction(alpha)
    turn = half_turn(ErrorDynamics(20, 100, exponent, exponent / (2 - exponent)))
    assert turn.settling_time_s(exponent) == pytest.approx(settling_s, rel=1e-6)


def test_a_node_has_no_half_turn() -> None:
    with pytest.raises(ValueError, match="no focus"):
        half_turn(desired_dynamics.LINEAR)


NODE_BY_GAIN = ErrorDynamics(25, 100, Fraction(95, 100), Fraction(95, 105))


@pytest.mark.parametrize("dynamics", [*PORTRAITS, TWISTED, NODE_BY_GAIN], ids=str)
def test_foci_oscillate_and_nodes_do_not(dynamics: ErrorDynamics) -> None:
    states = exactly(dynamics, (1e-3, 0.0), np.linspace(0.0, 5.0, 10_001), 1e-9, rest=1e-8)
    turns = int(np.count_nonzero(np.diff(np.sign(states[:, 0]))))
    if dynamics.equilibrium is Equilibrium.NODE:
        assert turns == 0
    else:
        assert turns >= 2


def test_critical_damping_is_where_invariant_curves_begin() -> None:
    """k^2/(2 - alpha) - KD k^alpha + KP = 0 has a double root there."""
    k = np.linspace(0.01, 60, 2_000_000)
    for alpha in (0.5, 0.8, 0.95, 1.0):
        exponent = Fraction(alpha)
        dynamics = ErrorDynamics(20, 100, exponent, exponent / (2 - exponent))
        least = float(np.min((k**2 / (2 - alpha) + 100) / k**alpha))
        assert dynamics.critical_kd == pytest.approx(least, rel=1e-9)


def test_nine_portraits_say_what_they_are(figures: Figures) -> None:
    portraits = figures["phase-portraits"].chart
    assert len(portraits.panels) == len({panel.title for panel in portraits.panels}) == 9
    for panel, dynamics in zip(portraits.panels, PORTRAITS, strict=True):
        assert panel.title.endswith(dynamics.equilibrium.value)
    dashed = [any(line.dash == "dashed" for line in panel.lines) for panel in portraits.panels]
    assert dashed == [number == 4 for number in range(9)]
    assert figures["phase-portraits"].numbers["overshoot_of_alpha_0.95"] == pytest.approx(
        8.8e-4, rel=0.01
    )


def test_portraits_end_at_the_origin_and_stay_in_the_box(figures: Figures) -> None:
    for panel in figures["phase-portraits"].chart.panels:
        assert panel.x_range is not None
        for line in panel.lines:
            assert np.abs(line.x).max() < panel.x_range[1]
            if line.label != "start":
                assert np.hypot(line.x[-1], line.y[-1]) < 0.25, panel.title


def test_convergence_has_its_times(figures: Figures) -> None:
    figure = figures["convergence"]
    assert figure.numbers["settling_time_s"] == pytest.approx(ENCLOSED["95/100"], rel=1e-6)
    assert figure.chart.panels[1].rules[0].at == figure.numbers["settling_time_s"]
    count = 2 * np.pi / (120 * 4 * 2048)
    assert figure.numbers["count_rad"] == pytest.approx(count, rel=1e-12)
    resolved = figure.numbers["below_one_count_from_s"]
    # The double pole's (1 + 10 t) exp(-10 t) is a count at 1.4712 s.
    linear = next(t for t in np.arange(0, 3, 1e-4) if (1 + 10 * t) * np.exp(-10 * t) < count)
    assert resolved["α = β = 1"] == pytest.approx(linear, abs=1.1e-3)
    assert resolved["α = 0.95, β = 0.905"] < resolved["α = β = 1"]
    assert resolved["α = β = 1.2"] is None
    exact = exactly(TWISTED, (1.0, 0.0), np.linspace(0, 1, 11))[:, 0]
    line = figure.chart.panels[0].lines[1]
    assert np.interp(np.linspace(0, 1, 11), line.x, line.y) == pytest.approx(exact, abs=1e-5)


# --- Closed loops ------------------------------------------------------------------------------


def by_counts(flight: Flight) -> Floats:
    """Tracking error [deg] from the encoder's counts and the reference alone."""
    run = flown(flight)
    per_count = np.array([j.rad_per_count for j in load(CONTROLLERS / "puma3.toml").joints])
    # At the first tick the robot is at the reference, to a count.
    offset = np.rint(run.q_ref[0] / per_count) - run.counts[0]
    error: Floats = np.rad2deg(run.q_ref - per_count * (run.counts + offset))
    return error


def test_errors_are_those_of_the_encoders(figures: Figures) -> None:
    figure = figures["errors"]
    for row in PAPER_ROWS:
        error = by_counts(Flight(row))
        rms = np.sqrt(np.mean(error**2, axis=0))
        assert np.array(figure.numbers["rms_deg"][row]) == pytest.approx(rms, abs=4e-4)
        assert np.array(figure.numbers["rms_deg"][row]) == pytest.approx(
            flown(Flight(row)).rms_error_deg()
        )
        for joint in range(3):
            linear, logarithmic = figure.chart.panels[2 * joint : 2 * joint + 2]
            drawn = line_of(linear, row)
            ticks = np.rint(drawn.x / 1e-3).astype(int)
            measured = error_deg(flown(Flight(row)))[:, joint]
            assert (drawn.y == measured[ticks]).all()
            assert np.abs(drawn.y).max() == figure.numbers["peak_deg"][row][joint]
            assert line_of(logarithmic, row).y.max() == np.abs(measured).max()
    assert figure.numbers["paper_rms_deg"]["Exp08"] == list(table_2()["Exp08"].rms_deg)


def line_of(panel: Panel, row: str) -> Line:
    return next(line for line in panel.lines if line.label.startswith(row))


def test_rows_have_the_gains_of_their_presets() -> None:
    for row in PAPER_ROWS:
        theirs = load(CONTROLLERS / "puma3.toml", experiment=row).joints
        assert Flight(row).tuned.joints == theirs
    changed = Flight(changed=(("gamma", "0.3"),)).tuned.joints[0]
    assert (changed.gamma, changed.alpha) == (Fraction(3, 10), Fraction(95, 100))


def test_spikes_are_where_the_velocity_reverses(figures: Figures) -> None:
    figure = figures["reversals"]
    numbers = figure.numbers
    assert numbers["stops_s"] == [3.0, 6.0, 9.0]
    assert numbers["reversals_s"] == pytest.approx([3.0, 9.0], abs=0.02)
    for row in PAPER_ROWS:
        error = np.abs(error_deg(flown(Flight(row))))
        told = np.array(numbers["peak_deg"][row])
        for k, tick in enumerate((3000, 6000, 9000)):
            assert told[k] == pytest.approx(error[tick : tick + 601].max(axis=0), abs=1e-15)
            for joint in range(3):
                line = line_of(figure.chart.panels[3 * joint + k], row)
                after = line.x >= tick / 1000 - 1e-9
                assert np.abs(line.y[after]).max() == pytest.approx(told[k, joint], abs=1e-12)
    hsia, best = (np.array(numbers["peak_deg"][row]) for row in ("Exp01", "Exp08"))
    assert (hsia[[0, 2]] > 4 * hsia[1]).all(), "only a reversal has a spike"
    assert (hsia[[0, 2]] > 20 * best[[0, 2]]).all()


def test_too_small_an_alpha_vibrates_on_flexible_joints_only(figures: Figures) -> None:
    numbers = figures["vibration"].numbers
    small, usual = (np.array(numbers["rms_deg"][alpha]) for alpha in ("0.9", "0.95"))
    assert (small > 2 * usual).all()
    assert (np.array(numbers["rigid_rms_deg"]) < usual).all()
    # The frequency by another way: every period has two changes of sign.
    run = flown(Flight(changed=(("alpha", "0.9"), ("beta", "finite-time")),
                       robot="reference_flexible"))  # fmt: skip
    error = error_deg(run)[10_000:, 1]
    rate = np.count_nonzero(np.diff(np.sign(error))) / 2 / 2.0
    assert numbers["frequency_Hz"][1] == pytest.approx(rate, abs=1.0)


def test_below_gamma_of_a_third_the_torque_works_for_nothing(figures: Figures) -> None:
    numbers = figures["small-gamma"].numbers
    rms = dict(zip(vibration.GAMMAS, np.array(numbers["rms_deg"]), strict=True))
    assert (np.diff(np.array(numbers["torque_activity_Nm"]), axis=0) < 0).all()
    assert (rms["0"] > 2 * rms["0.4"]).all()
    assert (rms["0.2"] > rms["0.3"]).all()
    run = flown(Flight())
    assert rms["0.4"] == pytest.approx(run.rms_error_deg(), rel=0.05)
    applied = run.torque_applied_Nm
    activity = np.sqrt(np.mean((applied[1:] - applied[:-1]) ** 2, axis=0))
    assert np.array(numbers["torque_activity_Nm"])[4] == pytest.approx(activity, rel=0.02)


def test_more_speed_costs_about_what_it_cost_the_paper(figures: Figures) -> None:
    numbers = figures["speed"].numbers
    ours, paper = np.array(numbers["rms_deg"]), np.array((0.0017, 0.0025, 0.0030))
    assert numbers["paper_rms_deg"] == paper.tolist()
    assert (np.abs(np.log2(ours / paper)) < 1).all()
    assert len(flown(Flight(speed=1.5)).time_s) == 8000
    dots = figures["speed"].chart.panels[3].lines
    assert (dots[3].y == ours).all()
    assert (dots[2].y == paper).all()


def test_the_trajectory_is_four_quintics(figures: Figures) -> None:
    position, velocity = figures["trajectory"].chart.panels
    time = position.lines[0].x
    for line in (*position.lines, *velocity.lines):
        for k in range(4):
            inside = (time >= 3 * k) & (time < 3 * k + 3)
            fit = np.polynomial.Polynomial.fit(time[inside], line.y[inside], 5)
            assert fit(time[inside]) == pytest.approx(line.y[inside], abs=1e-6)
    assert figures["trajectory"].evidence is None


# --- Charts ------------------------------------------------------------------------------------


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=300), st.integers(1, 20))
def test_no_extreme_is_lost(values: list[float], spans: int) -> None:
    signal = np.array(values)
    kept = extremes(signal, spans)
    assert (np.diff(kept) > 0).all()
    assert len(kept) <= 2 * spans + 2
    assert {signal.min(), signal.max()} <= set(signal[kept])
    assert {0, len(signal) - 1} <= set(kept.tolist())
    if len(signal) > 2 * spans:
        edges = np.linspace(0, len(signal), spans + 1).astype(int)
        for first, last in pairwise(edges):
            inside = signal[kept[(kept >= first) & (kept < last)]]
            assert inside.min() == signal[first:last].min()


def test_every_axis_has_a_name_and_a_unit(figures: Figures) -> None:
    unit = re.compile(r".+ \[(-|rad|deg|s|rad/s|deg/s|N m)\]")
    for figure in figures.values():
        chart = figure.chart
        assert len(chart.panels) == chart.rows * chart.columns
        for number, panel in enumerate(chart.panels):
            for label in chart.axis_labels(number):
                assert unit.fullmatch(label), (figure.name, panel.title, label)
            # Only panels with the same range may leave a label to their neighbour.
            if not panel.x_label:
                assert panel.x_range == chart.panels[number + chart.columns].x_range != None  # noqa: E711
            if not panel.y_label:
                assert panel.y_range == chart.panels[number - 1].y_range != None  # noqa: E711


def test_both_pictures_show_the_same_lines(figures: Figures) -> None:
    for figure in figures.values():
        drawn = figure.draw()
        lines = [line for panel in figure.chart.panels for line in panel.lines]
        traces = figure.interactive()["data"]
        assert len(traces) == len(lines)
        for trace, line in zip(traces, lines, strict=True):
            assert np.array(trace["y"]) == pytest.approx(line.y, rel=1e-5, abs=1e-40)
        assert len(drawn.axes) == len(figure.chart.panels)
        for axes, panel in zip(drawn.axes, figure.chart.panels, strict=True):
            assert axes.get_title(loc="left") + axes.get_title() == panel.title
            shown = [np.asarray(one.get_ydata()) for one in axes.lines]
            for line in panel.lines:
                assert any(np.array_equal(y, line.y) for y in shown), (figure.name, panel.title)


def test_claims_wear_measured_and_no_stronger_word(figures: Figures) -> None:
    assert {f.name for f in figures.values()} == set(BUILDERS)
    for figure in figures.values():
        assert figure.evidence in (None, Evidence.MEASURED)
        assert not re.search(r"\b(prove[ds]?|exhaustive|guarante)", figure.caption)
        json.dumps(figure.numbers, allow_nan=False)


# --- The page ----------------------------------------------------------------------------------


def test_the_page_asks_for_nothing_from_outside(html: str) -> None:
    own = html.replace(get_plotlyjs(), "", 1)
    assert len(own) == len(html) - len(get_plotlyjs())
    assert "http" not in own.replace("http-equiv", "")
    assert not re.search(r"<(?:link|img|iframe|object|embed)\b|\bsrc=|@import|url\(", own)
    assert "default-src 'none'" in own
    assert get_plotlyjs()[:500] not in own, "once is enough"
    assert len(own) < 3_000_000


def test_every_figure_is_in_the_page_with_its_data(html: str, figures: Figures) -> None:
    for name, figure in figures.items():
        assert html.count(f'id="chart-{name}"') == 1
        found = re.search(
            rf'<script type="application/json" id="data-{name}">(.*?)</script>', html, re.DOTALL
        )
        assert found is not None
        assert json.loads(found[1]) == figure.interactive()
        for suffix in ("svg", "pdf"):
            assert f'href="{name}.{suffix}"' in html


def test_data_cannot_end_its_script() -> None:
    assert "<" not in embedded({"x": "</script><b>"})
    assert json.loads(embedded({"x": "</script>"})) == {"x": "</script>"}


def test_a_browser_draws_every_figure(html: str, figures: Figures, tmp_path: Path) -> None:
    path = tmp_path / "index.html"
    path.write_text(html, encoding="utf-8")
    with chromium(tmp_path / "profile") as page:
        page.open(path)
        for name, figure in figures.items():
            page.box(f"#chart-{name}")  # which scrolls to it
            page.until(f"document.querySelector('#chart-{name} .infolayer') !== null")
            chart = page.evaluate(f"document.querySelector('#chart-{name}').innerHTML")
            drawn = chart.count('class="trace scatter')
            assert drawn == sum(len(panel.lines) for panel in figure.chart.panels), name
            for panel in figure.chart.panels:
                assert panel.title in chart
            assert "#010203" not in chart
            assert "rgb(1, 2, 3)" not in chart
        assert page.complaints == []
        assert page.requests == []


# --- Files and the command line ----------------------------------------------------------------


def test_files_are_vectors_and_the_same_every_time(tmp_path: Path) -> None:
    for folder in ("one", "two"):
        make(["trajectory"], tmp_path / folder)
    for file in ("trajectory.svg", "trajectory.pdf", "index.html"):
        first, second = ((tmp_path / f / file).read_bytes() for f in ("one", "two"))
        assert first == second
    svg = (tmp_path / "one/trajectory.svg").read_text(encoding="utf-8")
    root = ElementTree.fromstring(svg)
    assert root.tag.endswith("svg")
    assert "<image" not in svg
    pdf = (tmp_path / "one/trajectory.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    assert b"/Subtype /Image" not in pdf


def test_one_figure_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in ("output", "figures"):
        monkeypatch.setattr(f"verification.commands.{module}.RESULTS", tmp_path)
    assert main(["figures", "--only", "convergence", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert json.loads((tmp_path / "figures.json").read_text(encoding="utf-8")) == printed
    assert [f["name"] for f in printed["figures"]] == ["convergence"]
    assert {p.name for p in (tmp_path / "figures").iterdir()} == {
        "convergence.svg",
        "convergence.pdf",
        "index.html",
    }


def test_an_unknown_figure_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["figures", "--only", "fig-7"])
    assert stop.value.code == 2
    assert "phase-portraits" in capsys.readouterr().err
