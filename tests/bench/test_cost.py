"""What the step costs, as ratios: absolute counts belong to compilers and change with them."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from plant.native import GENERATED
from verification.bench.page import PAGE, page
from verification.bench.parts import Part
from verification.bench.present import cases, chart, tables
from verification.bench.recording import ROBOTS, Outcome
from verification.bench.rows import RECORD, Result, load, row_of, save
from verification.bench.variants import (
    CASADI_POWF,
    LINEAR_FLOOR,
    NAIVE_DOUBLE,
    NAIVE_FLOAT,
    PROJECT,
    PROJECT_FIXED,
    PROJECT_FLOAT64,
    PROJECT_LINEAR,
    PROJECT_PRECISE,
    VARIANTS,
    WITH_POWERS,
    Variant,
)
from verification.firmware import board_names, load_board

JOINTS = 3
BOARDS = [load_board(name) for name in board_names()]
CORES = [board.core for board in BOARDS]
WITH_FPU = [board.core for board in BOARDS if "-mfloat-abi=soft" not in board.cpu_flags]

WORST = 0.55
"""On every core, the worst tick is at most so much longer than the mean one."""


@pytest.mark.parametrize(
    ("core", "variant", "at_least"),
    [
        ("Cortex-M4F", NAIVE_DOUBLE, 100),
        ("Cortex-M4F", CASADI_POWF, 4),
        ("Cortex-M3", NAIVE_DOUBLE, 15),
        ("Cortex-M3", CASADI_POWF, 10),
        ("Cortex-M0+", NAIVE_DOUBLE, 15),
        ("Cortex-M0+", CASADI_POWF, 8),
    ],
)
def test_step_costs_a_fraction_of_casadi(
    result: Result, core: str, variant: Variant, at_least: float
) -> None:
    project = row_of(result.rows, PROJECT, core, JOINTS).instructions_per_step
    other = row_of(result.rows, variant, core, JOINTS).instructions_per_step
    assert other / project >= at_least


@pytest.mark.parametrize("core", CORES)
def test_every_core_gains_over_every_casadi_variant(result: Result, core: str) -> None:
    project = row_of(result.rows, PROJECT, core, JOINTS)
    for variant in (NAIVE_DOUBLE, NAIVE_FLOAT, CASADI_POWF):  # in the default numbers
        other = row_of(result.rows, variant, core, JOINTS)
        assert project.worst_instructions < other.instructions_per_step
        assert project.flash_bytes < other.flash_bytes


@pytest.mark.parametrize("core", CORES)
def test_nothing_is_cheaper_than_the_floor(result: Result, core: str) -> None:
    floor = row_of(result.rows, LINEAR_FLOOR, core, JOINTS)
    for variant in set(VARIANTS) - {PROJECT_FIXED}:  # which has no float to compute with
        if (variant.name, core) in measured(result):
            row = row_of(result.rows, variant, core, JOINTS)
            assert row.instructions_per_step >= floor.instructions_per_step
            assert row.flash_bytes >= floor.flash_bytes > 0


def measured(result: Result) -> set[tuple[str, str]]:
    """Variants and the cores that they were measured on."""
    return {(row.variant, row.core) for row in result.rows}


def test_every_variant_is_on_the_cores_that_it_is_for(result: Result) -> None:
    on = {
        variant.name: [core for core in CORES if (variant.name, core) in measured(result)]
        for variant in VARIANTS
    }
    assert on.pop(PROJECT_PRECISE.name) == WITH_FPU
    assert on.pop(PROJECT_FLOAT64.name) == ["Cortex-M7"]
    assert all(cores == CORES for cores in on.values())


@pytest.mark.parametrize("core", CORES)
def test_the_cheapest_numbers_depend_on_the_fpu(result: Result, core: str) -> None:
    fixed = row_of(result.rows, PROJECT_FIXED, core, JOINTS).times_the_project
    if core in WITH_FPU:
        assert 1.3 < fixed < 2.5
    else:
        assert fixed < 0.35
        # Integers pay for all powers and checks less than a linear law in float costs.
        floor = row_of(result.rows, LINEAR_FLOOR, core, JOINTS).times_the_project
        assert fixed < floor


def test_other_numbers_compute_the_same_law(result: Result) -> None:
    """Over a replay, in which differences add up; the unit of fixed-point is 2^-16 N m."""
    bounds = {PROJECT.name: 1e-3, PROJECT_PRECISE.name: 1e-3, PROJECT_FIXED.name: 1e-2}
    # What is left is the float in which the reference gives its torque.
    bounds[PROJECT_FLOAT64.name] = 5e-6
    for row in result.rows:
        if row.variant in bounds:
            assert 0.0 < row.torque_difference_Nm < bounds[row.variant], row


@pytest.mark.parametrize("core", CORES)
def test_exponents_do_not_change_the_cost(result: Result, core: str) -> None:
    """The kernel has no branch for an exponent: linear gains take as long as the paper's.

    Without an FPU the compiler's library takes a little longer or less for other numbers.
    """
    paper = row_of(result.rows, PROJECT, core, JOINTS)
    linear = row_of(result.rows, PROJECT_LINEAR, core, JOINTS)
    close = 0.001 if core in WITH_FPU else 0.05
    assert linear.instructions_per_step == pytest.approx(paper.instructions_per_step, rel=close)
    assert linear.flash_bytes == paper.flash_bytes


def test_usual_ticks_are_equally_long_with_an_fpu(result: Result) -> None:
    floats = {PROJECT.title, PROJECT_PRECISE.title, PROJECT_FLOAT64.title}
    chosen = [s for s in result.spreads if s.core in WITH_FPU and s.variant in floats]
    assert {s.core for s in chosen} == set(WITH_FPU)
    for spread in chosen:
        assert spread.usual_fewest == spread.usual_most, spread.statement
        assert "every usual tick takes" in spread.statement


def test_usual_ticks_in_integers_hardly_depend_on_the_data(result: Result) -> None:
    for spread in (s for s in result.spreads if s.variant == PROJECT_FIXED.title):
        assert spread.usual_most <= 1.01 * spread.usual_fewest, spread.statement


def test_worst_tick_is_bounded(result: Result) -> None:
    assert {(s.core, s.joints) for s in result.spreads} == {(c, n) for c in CORES for n in ROBOTS}
    for spread in result.spreads:
        assert 0.0 < spread.worst_relative <= WORST, spread.statement


def test_statement_covers_every_tick(result: Result) -> None:
    for spread in result.spreads:
        variant = next(v for v in WITH_POWERS if v.title == spread.variant)
        row = row_of(result.rows, variant, spread.core, spread.joints)
        usual = [c.instructions for c in row.special_cases if c.outcome is Outcome.USUAL]
        others = [c.instructions for c in row.special_cases if c.outcome is not Outcome.USUAL]
        assert spread.usual_fewest <= min(usual, default=spread.usual_fewest)
        assert max(usual) <= spread.usual_most
        assert max(*usual, *others, row.random_bits_instructions) <= spread.worst
        assert row.instructions_max <= spread.worst == row.worst_instructions
        for number in (spread.usual_most, spread.worst):
            assert str(number) in spread.statement
        assert spread.worst_case in spread.statement


def test_parts_are_all_of_a_step(result: Result) -> None:
    for row in result.rows:
        if row.variant in {variant.name for variant in WITH_POWERS}:
            assert math.fsum(row.parts.values()) == pytest.approx(row.instructions_per_step)
            assert min(row.parts[p.value] for p in Part if p is not Part.LIBRARY) > 0
            in_library = row.parts[Part.LIBRARY.value] / row.instructions_per_step
            soft_float = row.core not in WITH_FPU and row.variant == PROJECT.name
            assert in_library > 0.7 if soft_float else in_library < 0.01, row
        else:
            assert not row.parts


def test_plugin_and_timer_agree_in_every_tick(result: Result) -> None:
    for row in result.rows:
        assert row.cross_checked_ticks > 256
        assert row.disagreements == 0


@pytest.mark.parametrize("core", CORES)
def test_cycles_are_estimated_where_there_is_a_table(result: Result, core: str) -> None:
    for row in (row for row in result.rows if row.core == core):
        if core in ("Cortex-M7", "RV32IMAFC"):
            assert row.estimated_cycles is None
        else:
            assert row.estimated_cycles is not None
            assert 1.05 < row.estimated_cycles / row.instructions_per_step < 2.0


def test_json_without_estimates_is_still_read(result: Result, tmp_path: Path) -> None:
    path = save(result, tmp_path / "step.json")
    assert load(path) == result
    left = json.loads(path.read_text(encoding="utf-8"))
    for row in left["rows"]:
        del row["estimated_cycles"]
    path.write_text(json.dumps(left), encoding="utf-8")
    old = load(path)
    assert old is not None
    assert old.rows == tuple(replace(row, estimated_cycles=None) for row in result.rows)


def test_json_has_the_rows(result: Result, tmp_path: Path) -> None:
    data = json.loads(save(result, tmp_path / "step.json").read_text(encoding="utf-8"))
    assert {(r["variant"], r["core"], r["joints"]) for r in data["rows"]} == {
        (variant.name, board.core, joints)
        for variant in VARIANTS
        for board in BOARDS
        for joints in ROBOTS
        if variant.fits(board)
    }
    for row in data["rows"]:
        for key in ("instructions_per_step", "flash_bytes", "stack_bytes"):
            assert isinstance(row[key], int | float)
        assert row["instructions_per_step"] <= row["worst_instructions"]
        assert {case["name"] for case in row["special_cases"]} >= {"first tick", "saturated"}
    assert [c["core"] for c in data["conditions"]] == CORES
    assert all("-O2" in c["flags"] for c in data["conditions"])
    assert set(data["variants"]) == {variant.name for variant in VARIANTS}
    assert data["evidence"] == "measured"
    assert "Nothing of it was measured" in data["estimated_cycles"]


def test_chart_shows_every_row(result: Result) -> None:
    figure = chart(result.rows)
    assert [axes.get_title() for axes in figure.axes] == CORES
    shown = {
        core: [v.title for v in VARIANTS if (v.name, core) in measured(result)] for core in CORES
    }
    bars = [bar for axes in figure.axes for bar in axes.patches]
    assert len(bars) == len(result.rows)
    assert all(axes.get_xscale() == "log" for axes in figure.axes)
    for axes in figure.axes:
        labels = [text.get_text() for text in axes.get_yticklabels()]
        assert labels == shown[axes.get_title()], "a core has no row for what it was not given"


def test_tables_show_every_row(result: Result) -> None:
    assert sum(table.row_count for table in tables(result.rows)) == len(result.rows)
    special = result.rows[0].special_cases
    assert cases(result.rows, JOINTS).row_count == len(special) + 3


# --- The page ------------------------------------------------------------------------------------

NUMBER = re.compile(r"\d+(?:\N{NARROW NO-BREAK SPACE}\d{3})*(?:\.\d+)?(?:e[+-]\d+)?")
CLOSE = 0.03
"""How far a figure of the page may be from a fresh one, besides one unit of its last digit."""


def figures(text: str) -> tuple[list[str], list[str]]:
    """The numbers of a text, and what is between them."""
    return NUMBER.findall(text), NUMBER.split(text)


def agrees(old: str, new: str) -> bool:
    """Whether two printed numbers are as close as the page promises."""
    a, b = (float(text.replace("\N{NARROW NO-BREAK SPACE}", "")) for text in (old, new))
    mantissa, _, exponent = old.partition("e")
    digit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(a - b) <= max(CLOSE * abs(a), 1.001 * digit)


def test_the_page_is_made_from_the_figures_beside_it() -> None:
    recorded = load(RECORD)
    assert recorded is not None, (
        "docs/what-a-tick-costs.json is of another C: run `make bench` and "
        "`.venv/bin/python -m verification.bench --docs`"
    )
    assert page(recorded) == PAGE.read_text(encoding="utf-8")


def test_the_page_agrees_with_a_fresh_measurement(result: Result) -> None:
    old, new = PAGE.read_text(encoding="utf-8"), page(result)
    for each in result.conditions:
        line = f"{each.compiler}, {each.library}, "
        if line not in old:
            pytest.skip(
                f"the page is of another compiler or library than {line}whose figures differ"
            )
    old_numbers, old_text = figures(old)
    new_numbers, new_text = figures(new)
    hint = "run `make bench` and `.venv/bin/python -m verification.bench --docs`"
    assert old_text == new_text, hint
    wrong = [pair for pair in zip(old_numbers, new_numbers, strict=True) if not agrees(*pair)]
    assert not wrong, hint


@pytest.mark.parametrize(
    ("label", "header"),
    [
        ("float", "puma3/tdc_sig_pow.h"),
        ("float, precise", "puma3_precise/tdc_sig_pow_precise.h"),
        ("float64", "puma3_float64/tdc_sig_pow64.h"),
        ("fixed-point", "puma3_fixed/tdc_fixed.h"),
    ],
)
def test_bounds_on_the_page_are_those_of_the_headers(label: str, header: str) -> None:
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    cell = next(line for line in lines if line.startswith(f"| {label} |")).split("|")[2]
    text = (GENERATED / header).read_text(encoding="utf-8")
    bounds = re.findall(r"[\d.]+ ulp|2\^-[\d.]+|half a unit", cell)
    assert bounds
    assert all(bound in text for bound in bounds), cell


@pytest.mark.parametrize(
    ("old", "new", "close"),
    [("436", "449", True), ("436", "450", False), ("1\N{NARROW NO-BREAK SPACE}000", "1031", False),
     ("34", "35", True), ("3.6", "3.7", True), ("3.6", "3.8", False),
     ("2.3e-04", "2.4e-04", True), ("2.3e-04", "2.5e-04", False)],
)  # fmt: skip
def test_stale_figures_are_noticed(old: str, new: str, close: bool) -> None:
    assert NUMBER.fullmatch(old)
    assert agrees(old, new) == close


# --- The README ----------------------------------------------------------------------------------

README_ROWS = {
    "CasADi's own C": NAIVE_DOUBLE,
    "the same in float with `powf`": CASADI_POWF,
    "this project, float": PROJECT,
    'this project, `accuracy = "precise"`': PROJECT_PRECISE,
    'this project, `precision = "float64"`': PROJECT_FLOAT64,
    'this project, `arithmetic = "fixed-point"`': PROJECT_FIXED,
    "a linear law in float, by hand": LINEAR_FLOOR,
}


def test_the_readme_agrees_with_a_fresh_measurement(result: Result) -> None:
    text = (PAGE.parents[1] / "README.md").read_text(encoding="utf-8")
    if not all("gcc 12.2" in each.compiler for each in result.conditions):
        pytest.skip("the README's figures are of GCC 12.2")
    table = [line.strip("|") for line in text.splitlines() if line.startswith("| ")]
    lines = [[cell.strip() for cell in line.split("|")] for line in table]
    heads = next(cells for cells in lines if cells[0].startswith("instructions a tick"))
    shown = {cells[0]: cells for cells in lines if cells[0] in README_ROWS}
    assert set(shown) == set(README_ROWS)
    for label, variant in README_ROWS.items():
        for core, cell in zip(heads[1:], shown[label][1:], strict=True):
            if cell:
                number = float(re.sub(r"[ *]|\(.*", "", cell))
                row = row_of(result.rows, variant, core, JOINTS)
                assert number == pytest.approx(row.instructions_per_step, rel=CLOSE), (label, core)
