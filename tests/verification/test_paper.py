"""Table II as data agrees with itself: its percentages follow from its errors."""

from __future__ import annotations

from dataclasses import replace

import pytest

from codegen.presets import LAW_PRESETS
from verification.paper import PAPER, Row, rms_difference_percent, table_2

# The paper prints 227 % and 1973 % there; its own formula and figures give 224 % and 20630 %.
MISPRINTS = [("Exp10", 2), ("Exp13", 1)]


def misprints(rows: dict[str, Row]) -> list[tuple[str, int]]:
    """Cells whose printed percentage isn't the footnote's formula, by row and joint."""
    reference = rows["Exp08"].rms_deg
    return [
        (name, joint)
        for name, row in rows.items()
        for joint in (1, 2, 3)
        if abs(
            rms_difference_percent(row.rms_deg[joint - 1], reference[joint - 1])
            - row.printed_percent[joint - 1]
        )
        > 1.0
    ]


def test_every_row_has_gains_and_every_preset_a_row() -> None:
    assert list(table_2()) == [name for name in LAW_PRESETS if name.startswith("Exp")]


def test_exp08_is_the_smallest() -> None:
    rows = table_2()
    for joint in range(3):
        assert min(rows.values(), key=lambda row: row.rms_deg[joint]).experiment == "Exp08"


def test_the_printed_percentages_follow_from_the_errors_but_for_two_misprints() -> None:
    assert misprints(table_2()) == MISPRINTS
    exp13, exp08 = (table_2()[name].rms_deg[0] for name in ("Exp13", "Exp08"))
    assert rms_difference_percent(exp13, exp08) == pytest.approx(20630)


def test_a_mistyped_error_would_be_noticed() -> None:
    rows = dict(table_2())
    rows["Exp03"] = replace(rows["Exp03"], rms_deg=(0.0028, 0.0065, 0.0082))
    assert ("Exp03", 1) in misprints(rows)


def test_a_reference_of_zero_is_refused() -> None:
    with pytest.raises(ValueError, match="greater than 0"):
        rms_difference_percent(0.001, 0.0)


def test_the_citation_is_complete() -> None:
    assert all(part in str(PAPER) for part in ("Jin", "Mechatronics 22(5)", "2017"))
