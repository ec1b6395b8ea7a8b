"""The chain as a table for people."""

from __future__ import annotations

from collections.abc import Iterator

from rich.table import Table

from verification.chain.links import (
    DOUBLE_TO_HOST,
    EXACT_TO_DOUBLE,
    HOST_TO_TARGET,
    WHY,
    WHY_BITS,
    BitLink,
    Chain,
    Deviation,
    NumericLink,
)

NAMES = {"limited_torque": "torque", "next_sliding_integral": "next s - ed"}


_LINKS = (EXACT_TO_DOUBLE, DOUBLE_TO_HOST)


def table_of(chain: Chain) -> Table:
    """One row for each output and controller of the links that round, one for each target."""
    table = Table(title="The equivalence chain", title_justify="left")
    for name in ("link", "compared"):
        table.add_column(name)
    for name in ("vectors", "worst deviation", "its bound", "of the bound"):
        table.add_column(name, justify="right")
    table.add_column("evidence")
    for number, name in enumerate(_LINKS, 1):
        for link in chain.numeric:
            for deviation in link.deviations if link.link == name else ():
                _add_numeric(table, f"{number} {link.link}", link, deviation)
        table.add_section()
    for bits in chain.bits:
        _add_bits(table, f"3 {HOST_TO_TARGET}{bits.core}", bits)
    return table


def notes() -> Iterator[str]:
    """Why each link's bound is what it is, and what the figures are of, one line each."""
    yield f"bound of 1: {WHY[EXACT_TO_DOUBLE]}"
    yield f"bound of 2: {WHY[DOUBLE_TO_HOST]}"
    yield f"bound of 3: {WHY_BITS}"
    yield (
        "Deviations are the largest of the vectors near what a rig sees, with the bound at that "
        "vector; the share of the bound is the largest of all vectors. Targets are emulated; they "
        "take the recorded vectors, and random steps of which each block leaves a hash. NaN "
        "payloads are compared nowhere: no output is a NaN."
    )


def _count(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def _add_numeric(table: Table, name: str, link: NumericLink, deviation: Deviation) -> None:
    share = f"{deviation.worst_share:.0%}"
    table.add_row(
        name,
        f"{link.controller}: {NAMES[deviation.quantity]}",
        _count(link.vectors),
        f"{deviation.rig_worst:.1e} {deviation.unit}",
        f"{deviation.rig_bound:.1e} {deviation.unit}",
        share if link.holds else f"[bold red]{share}[/]",
        link.evidence.value,
    )


def _add_bits(table: Table, name: str, link: BitLink) -> None:
    equal = f"{link.equal_blocks}/{link.blocks} equal"
    table.add_row(
        name,
        f"{link.controller}: all bits, {link.seconds:.1f} s",
        f"{_count(link.vectors)} + {_count(link.steps)}",
        "none" if link.holds else "[bold red]DIFFERENT[/]",
        "none",
        equal if link.holds else f"[bold red]{equal}[/]",
        link.evidence.value,
    )


def failures(chain: Chain) -> Iterator[str]:
    """Everything that does not hold, one line each."""
    for link in chain.numeric:
        for violation in link.violations:
            yield f"{link.controller}, {link.link}: {violation}"
        for deviation in link.deviations:
            if not deviation.worst_share <= 1.0:
                yield (
                    f"{link.controller}, {link.link}: {NAMES[deviation.quantity]} is off by "
                    f"{deviation.worst_share:.3g} times the bound ({deviation.worst_group})"
                )
    for bits in chain.bits:
        if not bits.holds:
            where = bits.mismatch or "the same block differs only now and then"
            yield f"{bits.controller} on {bits.board}: {where}"
