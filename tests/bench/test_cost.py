"""What the step costs, as ratios: absolute counts belong to compilers and change with them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from verification.bench.present import cases, chart, tables
from verification.bench.rows import Result, load, row_of, save
from verification.bench.variants import (
    CASADI_POWF,
    LINEAR_FLOOR,
    NAIVE_DOUBLE,
    NAIVE_FLOAT,
    PROJECT,
    PROJECT_LINEAR,
    VARIANTS,
    Variant,
)
from verification.firmware import board_names, load_board

JOINTS = 3
BOARDS = [load_board(name) for name in board_names()]
CORES = [board.core for board in BOARDS]
WITH_FPU = [board.core for board in BOARDS if "-mfloat-abi=soft" not in board.cpu_flags]

SPREAD = 0.03
"""With an FPU, the longest tick that gives a torque is at most so much longer than the shortest."""


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
    for variant in (NAIVE_DOUBLE, NAIVE_FLOAT, CASADI_POWF):
        other = row_of(result.rows, variant, core, JOINTS)
        assert project.worst_instructions < other.instructions_per_step
        assert project.flash_bytes < other.flash_bytes


@pytest.mark.parametrize("core", CORES)
def test_nothing_is_cheaper_than_the_floor(result: Result, core: str) -> None:
    floor = row_of(result.rows, LINEAR_FLOOR, core, JOINTS)
    for variant in VARIANTS:
        row = row_of(result.rows, variant, core, JOINTS)
        assert row.instructions_per_step >= floor.instructions_per_step
        assert row.flash_bytes >= floor.flash_bytes > 0


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


def test_time_hardly_depends_on_the_data(result: Result) -> None:
    assert {s.core for s in result.spreads} == set(CORES)
    for spread in result.spreads:
        # Additions of the compiler's library are quick where an operand is zero, for example.
        assert (spread.relative <= SPREAD) == (spread.core in WITH_FPU), spread.statement
        assert spread.error_most <= spread.most, spread.statement
        assert spread.random_bits_most <= spread.most, spread.statement


def test_statement_covers_every_tick(result: Result) -> None:
    for spread in result.spreads:
        row = row_of(result.rows, PROJECT, spread.core, spread.joints)
        good = [c.instructions for c in row.special_cases if not c.fails]
        good += [row.instructions_min, row.instructions_max]
        assert (min(good), max(good)) == (spread.fewest, spread.most)
        assert row.worst_instructions <= spread.most
        for number in (spread.fewest, spread.most, spread.error_most, spread.random_bits_most):
            assert str(number) in spread.statement


def test_plugin_and_timer_agree_in_every_tick(result: Result) -> None:
    for row in result.rows:
        assert row.cross_checked_ticks > 256
        assert row.disagreements == 0


@pytest.mark.parametrize("core", CORES)
def test_cycles_are_estimated_where_there_is_a_table(result: Result, core: str) -> None:
    for variant in VARIANTS:
        row = row_of(result.rows, variant, core, JOINTS)
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
        (variant.name, core, JOINTS) for variant in VARIANTS for core in CORES
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
    bars = [bar for axes in figure.axes for bar in axes.patches]
    assert len(bars) == len(result.rows)
    assert all(axes.get_xscale() == "log" for axes in figure.axes)
    labels = {text.get_text() for text in figure.axes[0].get_yticklabels()}
    assert labels == {variant.title for variant in VARIANTS}


def test_tables_show_every_row(result: Result) -> None:
    assert sum(table.row_count for table in tables(result.rows)) == len(result.rows)
    special = result.rows[0].special_cases
    assert cases(result.rows, JOINTS).row_count == len(special) + 3
