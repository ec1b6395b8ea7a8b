"""All special cases of all controllers, and how a person and a script read them."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rich.table import Table

from verification.evidence import Evidence, plain
from verification.special_cases.compare import Comparison, bench, compare
from verification.special_cases.laws import CASES, Case
from verification.special_cases.proofs import proofs_of, proofs_of_the_low_pass
from verification.symbolic import Proof

NAMES = ("puma3", "puma3_precise", "puma3_float64")
"""The shipped controllers of the paper's robot in floating-point."""


@dataclass(frozen=True)
class CaseResult:
    """A special case: what was measured of its bits, and what is proved of its algebra.

    Attributes:
        case: its name.
        equation: the paper's.
        preset: whose gains the inclusive C flew with.
        remark: what its bits mean, where that isn't plain.
        proofs: in algebra, over the real numbers.
        comparisons: of bits, one a controller.
    """

    case: str
    equation: str
    preset: str
    remark: str
    proofs: tuple[Proof, ...]
    comparisons: tuple[Comparison, ...]

    @property
    def proved(self) -> bool:
        """Whether every identity is proved."""
        return all(proof.holds for proof in self.proofs)

    @property
    def holds(self) -> bool:
        """Whether it is proved and all bits are equal."""
        return self.proved and all(comparison.equal for comparison in self.comparisons)


@dataclass(frozen=True)
class SpecialCases:
    """Everything; the low-pass has proofs only, for no bits are claimed of it."""

    cases: tuple[CaseResult, ...]
    low_pass: tuple[Proof, ...]

    @property
    def holds(self) -> bool:
        """Whether every case and every proof does."""
        return all(case.holds for case in self.cases) and all(p.holds for p in self.low_pass)


def examine(
    controllers: Sequence[str] = NAMES,
    ticks: int | None = None,
    cases: Sequence[Case] = CASES,
    advance: Callable[[int], None] = lambda _: None,
) -> SpecialCases:
    """Compares and proves all cases.

    Args:
        controllers: of ``controllers/``, in floating-point and of the paper's structure.
        ticks: of each closed loop; the robot's whole trajectory by default.
        cases: what to compare.
        advance: told of each comparison as it ends.

    Raises:
        ControllerError, SpecificationError, PlantError, CompilerError: as of ``compare``.
    """
    found: dict[str, list[Comparison]] = {case.name: [] for case in cases}
    for name in controllers:
        flown = bench(name, ticks)
        for case in cases:
            found[case.name].append(compare(flown, case))
            advance(1)
    return SpecialCases(
        tuple(
            CaseResult(
                c.name,
                c.equation,
                c.preset.name,
                c.remark,
                proofs_of(c),
                tuple(found[c.name]),
            )
            for c in cases
        ),
        proofs_of_the_low_pass(),
    )


def table_of(result: SpecialCases) -> Table:
    """A row for each case and controller."""
    table = _table("case", "equation", "preset", "controller", "ticks", "bits", "algebra")
    for case in result.cases:
        for c in case.comparisons:
            table.add_row(
                case.case,
                case.equation,
                case.preset,
                c.controller,
                str(c.ticks),
                "[green]equal[/]" if c.equal else "[red]DIFFERENT[/]",
                _word(case.proved),
            )
    proved = all(proof.holds for proof in result.low_pass)
    table.add_row("low-pass", "(42)-(44)", *([""] * 4), _word(proved))
    return table


def roundings_of(result: SpecialCases) -> Table:
    """The same laws in other roundings, one step at a time from the inclusive C's memory."""
    table = _table("case", "in other floats", "controller", "torques", "differ", "at most \\[N m]")
    for case in result.cases:
        for c in case.comparisons:
            for r in c.roundings:
                numbers = (str(r.torques), str(r.different), f"{r.largest_Nm:.1e}")
                table.add_row(case.case, r.name, c.controller, *numbers)
    return table


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for column in columns:
        table.add_column(column, no_wrap=True)
    return table


def notes(result: SpecialCases) -> tuple[str, ...]:
    """What the tables mean."""
    return (
        "Bits are measured: torques on the same counts, and all signals of each one's own loop.",
        "Algebra is over the real numbers. Low-passes have no bits to compare: (44) rounds.",
        *(f"{case.case}: {case.remark}" for case in result.cases if case.remark),
    )


def _word(proved: bool) -> str:
    return "[green]proved[/]" if proved else "[red]NOT proved[/]"


def failures(result: SpecialCases) -> tuple[str, ...]:
    """A line for everything that doesn't hold."""
    different = (
        f"{case.case}, {c.controller}, {where}: {difference}"
        for case in result.cases
        for c in case.comparisons
        for where, difference in (("lock-step", c.lock_step), ("own loop", c.own_loop))
        if difference is not None
    )
    proofs = (p for group in (*(c.proofs for c in result.cases), result.low_pass) for p in group)
    unproved = (f"{p.name}: not proved, {p.residual} remains" for p in proofs if not p.holds)
    return (*different, *unproved)


def figures(result: SpecialCases) -> dict[str, Any]:
    """The result as plain data."""
    return {
        "holds": result.holds,
        "cases": [
            {
                **plain(case),
                "holds": case.holds,
                "proved": case.proved,
                "comparisons": [{**plain(c), "equal": c.equal} for c in case.comparisons],
            }
            for case in result.cases
        ],
        "low_pass": plain(result.low_pass),
        "proofs_evidence": Evidence.PROVED.value,
    }


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    parser.add_argument(
        "--controller",
        action="append",
        metavar="NAME",
        help=f"of controllers/; again for more (default: {', '.join(NAMES)})",
    )
    parser.add_argument("--ticks", type=_ticks, help="of each run (default: the whole trajectory)")


def _ticks(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"a number of ticks above 0, not {text!r}")
    return int(text)
