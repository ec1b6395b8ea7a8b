"""What the report says: every figure and sentence that depends on a result, as plain data."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from codegen.controller import Controller, load
from codegen.emit import generate
from plant.robot import load_robot
from verification.accuracy import ARITHMETICS, REFERENCE
from verification.bench import cycles
from verification.certificates.sig_pow.present import Verdict
from verification.chain.present import NAMES, notes
from verification.energy.present import chart as energy_chart
from verification.equivalence import Equivalence, Summary, summary
from verification.evidence import Evidence, plain
from verification.experiments import (
    CONTROLLERS,
    FASTER,
    FIGURE_5,
    PEAK_WINDOW_S,
    SIX_JOINTS,
    Beside,
    Experiment,
    Gain,
    Outcome,
    beside_the_paper,
    improvements,
    rank_correlation,
    reversal_peaks_deg,
    reversal_times_s,
)
from verification.figures.chart import Chart
from verification.figures.drawn import draw
from verification.figures.interactive import interactive
from verification.figures.page import embedded
from verification.figures.paper_figure import PaperFigure
from verification.figures.rows import ENVELOPE_S, LABELS
from verification.paper import FASTER_RMS_DEG, PAPER
from verification.report import certificates as proved
from verification.report import charts
from verification.report.answers import Found, answers
from verification.report.certificates import Certificates
from verification.report.processor import LINKS, MEANINGS, TITLES, Processor
from verification.report.studies import Studies
from verification.style import house_style, inline_svg
from verification.symbolic import Proof
from verification.table2.fly import COMPARED, FACTOR, TableOf, paper_ratios, ratio_name
from verification.table2.fly import figures as figures_of_tables
from verification.tuning_check.pictures import intervals
from verification.tuning_check.present import (
    headline,
)


@dataclass(frozen=True)
class Results:
    """What was checked, from which the report is made.

    Attributes:
        outcomes: the outcomes; the rows of Fig. 5, the faster one and the six joints at least.
        equivalence: by controller, a result a variant.
        proofs: the symbolic proofs.
        steps: random steps for each variant.
        processor: what was found on the emulated processors.
        kernels: what is proved of the powers.
        accuracy: what `make accuracy` left, None if it has not run on today's C.
        tables: Table II, by plant.
        studies: what longer commands left.
        paper_figures: the paper's figures.
        certificates: what is proved of gains.
    """

    outcomes: Mapping[Experiment, Outcome]
    equivalence: Mapping[str, Sequence[Equivalence]]
    proofs: Sequence[Proof]
    steps: int
    processor: Processor
    kernels: Sequence[Verdict]
    accuracy: dict[str, Any] | None
    tables: Sequence[TableOf]
    studies: Studies
    paper_figures: Sequence[PaperFigure]
    certificates: Certificates


@dataclass(frozen=True)
class Zoomable:
    """A picture for Plotly.

    Attributes:
        json: its data and layout, fit for a script element.
        height_px: of the layout.
        wide: whether it has more than one column.
    """

    json: str
    height_px: int
    wide: bool


@dataclass(frozen=True)
class Picture:
    """A picture with its caption.

    Attributes:
        name: of its place in the page.
        svg: the element, which is what paper, phones and a browser without scripts show.
        caption: what it shows.
        evidence: what it rests on; None where nothing is claimed.
        zoomable: the same to point at with a mouse, or None.
    """

    name: str
    svg: str
    caption: str
    evidence: Evidence | None
    zoomable: Zoomable | None = None


@dataclass(frozen=True)
class CodeLine:
    """A line of the generated C; ``defines`` where it is part of a quantity's definition."""

    number: int
    text: str
    equation: str
    defines: bool


@dataclass(frozen=True)
class Command:
    """How to get a figure again."""

    figure: str
    command: str
    leaves: str


def scientific(value: float) -> str:
    """A small positive number for a reader, such as 1.3·10⁻⁷."""
    if value == 0.0:
        return "0"
    if not math.isfinite(value):
        return str(value)
    mantissa, exponent = f"{value:.1e}".split("e")
    if -3 <= int(exponent) <= 3:
        return f"{value:.2g}"
    superscript = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa}·10{superscript}"


def law_block(controller: Controller) -> tuple[list[dict[str, Any]], list[CodeLine]]:
    """The quantities of the manifest, and the lines of C from the first to the last of them."""
    files = generate(controller).files
    quantities: list[dict[str, Any]] = json.loads(files["manifest.json"])["quantities"]
    equation = {q["line"]: q["equation"] for q in quantities}
    text = files[quantities[0]["file"]].splitlines()
    first, last = min(equation) - 1, max(equation)
    lines: list[CodeLine] = []
    number, inside = first, False
    # A definition may run over several lines, the last one too; it ends with its semicolon.
    while number <= last or inside:
        line = text[number - 1]
        inside = inside or number in equation
        lines.append(CodeLine(number, line.removeprefix("    "), equation.get(number, ""), inside))
        inside = inside and ";" not in line
        number += 1
    return quantities, lines


def pictures(results: Results) -> dict[str, Picture]:
    """All pictures by name."""
    outcomes = results.outcomes
    four = [outcomes[experiment] for experiment in FIGURE_5]
    best, six = outcomes[FIGURE_5[-1]], outcomes[SIX_JOINTS]
    rows = [r for r in beside_the_paper(outcomes) if r.experiment in LABELS]
    resolution = np.rad2deg([abs(j.rad_per_count) for j in load(CONTROLLERS / "puma3.toml").joints])
    turn = reversal_times_s(best.run)[0]
    span_ms = f"{1000 * ENVELOPE_S:.0f} ms"
    with house_style():
        drawn = [
            # No evidence: it is what was asked for.
            _picture(
                "trajectory",
                charts.trajectory(best),
                "Desired trajectory: four fifth-order polynomials in 12 s. All joints move alike "
                "from different postures.",
                None,
            ),
            _picture(
                "errors",
                charts.errors(four, resolution),
                f"Tracking error: the largest in each {span_ms}, on a logarithmic scale. One "
                "encoder count is the dotted line.",
            ),
            _picture(
                "table-2",
                charts.table_2(rows),
                "RMS errors on the simulated plant (filled) and on the paper's robot (open).",
            ),
            _picture(
                "torques",
                charts.torques(best),
                "Torques that the drives applied in Exp08, and their limits.",
            ),
            _picture(
                "reversal",
                charts.reversal(four, turn),
                f"Joint 1 around t = {turn:.1f} s, where the velocity changes its sign and the "
                "friction with it.",
            ),
            _picture(
                "six-joints",
                charts.all_joints(six),
                "The same law on all six joints of a PUMA 560, gains of Exp08: errors (largest in "
                f"each {span_ms}) and torques.",
            ),
            _picture(
                "energy",
                energy_chart(results.certificates.energy),
                "Energy of the desired error dynamics, and of the sliding variable, along the "
                "closed loop of the generated C.",
            ),
            Picture(
                "intervals",
                intervals(results.certificates.checks[0]),
                "For which Mbar/M the sampled law is stable, and where the reference arm's "
                "eigenvalues of M(q)^-1 Mbar lie.",
                Evidence.PROVED,
            ),
            *(_of_paper(figure) for figure in results.paper_figures),
        ]
    return {picture.name: picture for picture in drawn}


def _picture(
    name: str,
    chart: Chart,
    caption: str,
    evidence: Evidence | None = Evidence.MEASURED,
    label: str = "",
) -> Picture:
    plotly = interactive(chart)
    return Picture(
        name,
        inline_svg(draw(chart), name, label or caption),
        caption,
        evidence,
        Zoomable(embedded(plotly), plotly["layout"]["height"], chart.columns > 1),
    )


def _of_paper(figure: PaperFigure) -> Picture:
    return _picture(figure.name, figure.chart, figure.caption, figure.evidence, figure.title)


COMMANDS = (
    Command(
        "everything in this report",
        "python -m verification report",
        "build/report/index.html, build/report/report.json",
    ),
    Command(
        "tracking, Table II, torques, reversal, six joints",
        "python -m verification experiments",
        "build/verification/experiments.json",
    ),
    Command("Table II on other plants", "make table2", "build/verification/table2.json"),
    Command("the paper's figures", "make figures", "build/verification/figures/"),
    Command("the same C to play with", "make playground", "build/playground/index.html"),
    Command("the claim on random plants", "make claim", "build/verification/claim.json"),
    Command("special cases", "make special-cases", "build/verification/special_cases.json"),
    Command("rivals", "make rivals", "build/verification/rivals.json"),
    Command("faults in motion", "make faults", "build/verification/faults.json"),
    Command("the tuning procedure", "make tune", "build/plant/tuning/"),
    Command(
        "the generated C against the law",
        "python -m verification equivalence --steps {steps}",
        "build/verification/equivalence.json",
    ),
    Command(
        "the error of the powers",
        "python -m verification sig-pow",
        "build/verification/sig_pow.json",
    ),
    Command(
        "closed loops in every arithmetic", "make accuracy", "build/verification/accuracy.json"
    ),
    Command("processor in the loop", "make pil", "build/pil/pil.json"),
    Command("from the exact law to the processor", "make chain", "build/verification/chain.json"),
    Command("instructions a tick", "make bench", "build/bench/step.json"),
    Command("flash, RAM and stack", "make size", "build/firmware/size.json"),
    Command(
        "whether gains are safe",
        "make tuning-check",
        "build/verification/tuning_check/NAME.html",
    ),
    Command("the energy", "python -m verification energy", "build/verification/energy.json"),
    Command("the proofs", "python -m verification symbolic", "build/verification/symbolic.json"),
    Command("the generated C itself", "python -m codegen generate", "generated/"),
)


@dataclass(frozen=True)
class _Tables:
    rows: tuple[Beside, ...]
    gains: tuple[Gain, ...]
    summaries: tuple[Summary, ...]


def _tables(results: Results) -> _Tables:
    rows = beside_the_paper(results.outcomes)
    summaries = tuple(
        summary(load(CONTROLLERS / f"{name}.toml"), each)
        for name, each in results.equivalence.items()
    )
    return _Tables(rows, improvements(rows), summaries)


def _found(results: Results, tables: _Tables) -> Found:
    return Found(
        tables.rows,
        tables.gains,
        results.tables,
        tables.summaries,
        results.proofs,
        results.certificates,
        results.processor,
        results.studies.faults,
    )


def as_json(results: Results) -> dict[str, Any]:
    """The report's figures as plain data."""
    tables = _tables(results)
    return {
        "paper": str(PAPER),
        "answers": plain(answers(_found(results, tables))),
        "experiments": [plain(outcome.summary()) for outcome in results.outcomes.values()],
        "table_2": [
            {**plain(row), "ratio": plain(row.ratio), "evidence": Evidence.MEASURED.value}
            for row in tables.rows
        ],
        "rms_over_exp08": [plain(gain) for gain in tables.gains],
        "rank_correlation": plain(rank_correlation(tables.rows)),
        "equivalence": {
            "steps_each": results.steps,
            "summaries": plain(tables.summaries),
            "variants": {name: plain(each) for name, each in results.equivalence.items()},
        },
        "proofs": plain(list(results.proofs)),
        "kernels": plain(list(results.kernels)),
        "accuracy": results.accuracy,
        "table_2_by_plant": plain(figures_of_tables(results.tables)["plants"]),
        "certificates": plain(proved.as_json(results.certificates)),
    }


def _accuracy(found: dict[str, Any] | None) -> dict[str, Any]:
    """The closed loops in every arithmetic, by row and controller."""
    rows: dict[str, dict[str, Any]] = {}
    for cell in found["cells"] if found else ():
        rows.setdefault(cell["row"], {})[cell["controller"]] = cell
    return {
        "accuracy": found,
        "accuracy_rows": rows,
        "accuracy_reference": REFERENCE,
        "arithmetics": ARITHMETICS,
    }


def context(results: Results) -> dict[str, Any]:
    """What the page's template is given."""
    tables = _tables(results)
    controller = load(CONTROLLERS / "puma3.toml")
    quantities, lines = law_block(controller)
    best = results.outcomes[FIGURE_5[-1]]
    turns = reversal_times_s(best.run)
    peaks = {
        experiment.row: reversal_peaks_deg(results.outcomes[experiment].run, turns)
        for experiment in FIGURE_5
    }
    faster = results.outcomes[FASTER]
    return {
        "paper": PAPER,
        "answers": answers(_found(results, tables)),
        "kinds": list(Evidence),
        "pictures": pictures(results),
        "rows": tables.rows,
        "gains": tables.gains,
        "ranks": rank_correlation(tables.rows),
        "tables_2": results.tables,
        "studies": results.studies,
        "paper_figures": [figure.name for figure in results.paper_figures],
        "certificates": results.certificates,
        "verdict": headline,
        "kd": proved.KD,
        "kp": proved.KP,
        "factor": FACTOR,
        "paper_ratios": {ratio_name(row): paper_ratios(row) for row in COMPARED},
        "faster": Beside("Exp08", "", faster.rms_deg, FASTER_RMS_DEG),
        "best": best,
        "turns": turns,
        "peaks": peaks,
        "window": PEAK_WINDOW_S,
        "six": results.outcomes[SIX_JOINTS],
        "sources": load_robot(best.experiment.robot).sources,
        "six_sources": load_robot(SIX_JOINTS.robot).sources,
        "steps": results.steps,
        "summaries": tables.summaries,
        "variants": results.equivalence,
        "proofs": results.proofs,
        "controller": controller,
        "quantities": quantities,
        "lines": lines,
        "commands": [
            Command(c.figure, c.command.format(steps=results.steps), c.leaves) for c in COMMANDS
        ],
        "scientific": scientific,
        "processor": results.processor,
        "kernels": results.kernels,
        **_accuracy(results.accuracy),
        "titles": TITLES,
        "meanings": MEANINGS,
        "cycles_note": cycles.NOTE,
        "chain_bounds": list(notes()),
        "chain_links": LINKS,
        "chain_quantities": NAMES,
    }
