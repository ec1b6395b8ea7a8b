"""What the paper measured: Table II as data, with its formula and the places to cite.

The gains of the thirteen rows are law presets (``codegen.presets``) and are not repeated here.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from pathlib import Path

TABLE_II = Path(__file__).parent / "data" / "table2.csv"
REFERENCE_ROW = "Exp08"
"""The row that Table II's footnote takes as 0 %: the smallest error."""

FASTER_RMS_DEG = (0.0017, 0.0025, 0.0030)
"""RMS errors with its gains at 50 % more speed, section IV-C [deg]."""


@dataclass(frozen=True)
class Citation:
    """A published source."""

    authors: str
    title: str
    journal: str
    year: int

    def __str__(self) -> str:
        return f"{self.authors}: “{self.title}”, {self.journal}, {self.year}"


PAPER = Citation(
    "M. Jin, S. H. Kang, P. H. Chang, J. Lee",
    "Robust Control of Robot Manipulators Using Inclusive and Enhanced Time Delay Control",
    "IEEE/ASME Transactions on Mechatronics 22(5), 2141-2152",
    2017,
)


@dataclass(frozen=True)
class Row:
    """A row of Table II.

    Attributes:
        experiment: its number, which is also the name of its law preset.
        rms_deg: measured root-mean-square error of joints 1 to 3 [deg].
        printed_percent: the %RMS difference as printed; two of the 39 do not follow from
            the errors.
        remark: the formulation that the row stands for.
    """

    experiment: str
    rms_deg: tuple[float, float, float]
    printed_percent: tuple[float, float, float]
    remark: str


@cache
def table_2() -> dict[str, Row]:
    """The rows of Table II by experiment, in the order of the paper."""
    with TABLE_II.open(encoding="utf-8", newline="") as file:
        return {line["experiment"]: _row(line) for line in csv.DictReader(file)}


def _row(line: dict[str, str]) -> Row:
    def joints(column: str) -> tuple[float, float, float]:
        one, two, three = (float(line[column.format(joint)]) for joint in (1, 2, 3))
        return one, two, three

    return Row(
        line["experiment"],
        joints("rms_j{}_deg"),
        joints("printed_j{}_percent"),
        line["remark"],
    )


def rms_difference_percent(rms: float, reference_rms: float) -> float:
    """The %RMS difference of Table II's footnote, (rms - reference)/reference x 100.

    Args:
        rms: root-mean-square error of a row, in any unit.
        reference_rms: that of Exp08, in the same unit; greater than 0.

    Raises:
        ValueError: the reference is not greater than 0.
    """
    if not reference_rms > 0:
        raise ValueError(f"the reference RMS must be greater than 0, it is {reference_rms}")
    return (rms - reference_rms) / reference_rms * 100.0
