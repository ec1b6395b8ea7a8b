"""The page ``docs/what-a-tick-costs.md``, made from the bench's figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from codegen.emit import REPOSITORY
from codegen.rendering import environment
from verification.bench.parts import Part
from verification.bench.present import TITLES, thousands
from verification.bench.rows import JOINTS, Result, Row, Spread, record, row_of
from verification.bench.variants import (
    PROJECT,
    PROJECT_FIXED,
    PROJECT_FLOAT64,
    PROJECT_PRECISE,
    TEMPLATES,
    VARIANTS,
    WITH_POWERS,
    Variant,
)

PAGE = REPOSITORY / "docs" / "what-a-tick-costs.md"


def page(result: Result) -> str:
    """The page as Markdown.

    Raises:
        KeyError: the figures are not those of all cores and numbers of joints.
    """
    rows = result.rows
    cores = list(dict.fromkeys(row.core for row in rows))
    return (
        environment(TEMPLATES)
        .get_template("what-a-tick-costs.md.j2")
        .render(
            cores=cores,
            joints=JOINTS,
            conditions={each.core: each for each in result.conditions},
            costs={core: _costs([row for row in rows if row.core == core]) for core in cores},
            times={core: _times([s for s in result.spreads if s.core == core]) for core in cores},
            parts=[part.value for part in Part],
            meanings={part.value: part.meaning for part in Part},
            shares={core: _shares([row for row in rows if row.core == core]) for core in cores},
            differences=[(v.title, _difference(rows, v)) for v in WITH_POWERS],
            ratio=lambda variant, core: (
                row_of(rows, _BY_NAME[variant], core, JOINTS[0]).times_the_project
            ),
            share=lambda variant, core, part: _share(
                row_of(rows, _BY_NAME[variant], core, JOINTS[0]), part
            ),
            worst_relative=max(spread.worst_relative for spread in result.spreads),
        )
    )


_BY_NAME = {
    "float": PROJECT,
    "precise": PROJECT_PRECISE,
    "float64": PROJECT_FLOAT64,
    "fixed": PROJECT_FIXED,
}


def _costs(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """A line for each variant of a core: title, instructions, worst, cycles, flash and stack."""
    kinds: tuple[Callable[[Row], float | None], ...] = (
        lambda row: row.instructions_per_step,
        lambda row: row.worst_instructions,
        lambda row: row.estimated_cycles,
        lambda row: row.flash_bytes,
        lambda row: row.stack_bytes,
    )
    lines = []
    for variant in VARIANTS:
        own = _of(rows, variant)
        if own:
            cells = (" / ".join(_number(kind(row)) for row in own) for kind in kinds)
            lines.append((TITLES[variant.name], *cells))
    return lines


def _times(spreads: Sequence[Spread]) -> list[tuple[str, ...]]:
    """A line for each variant of a core: title, usual ticks, the worst, and how much longer."""
    lines: list[tuple[str, ...]] = []
    for title in dict.fromkeys(spread.variant for spread in spreads):
        own = [spread for spread in spreads if spread.variant == title]
        lines.append(
            (
                title,
                " / ".join(map(_usual, own)),
                " / ".join(_number(spread.worst) for spread in own),
                " / ".join(f"{spread.worst_relative:.0%}" for spread in own),
            )
        )
    return lines


def _usual(spread: Spread) -> str:
    fewest, most = _number(spread.usual_fewest), _number(spread.usual_most)
    return most if spread.is_constant else f"{fewest} to {most}"


def _shares(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """A line for each variant of a core, for the fewest joints: title and instructions by part."""
    return [
        (TITLES[row.variant], *(_number(row.parts[part.value]) for part in Part))
        for variant in WITH_POWERS
        for row in _of(rows, variant)[:1]
    ]


def _share(row: Row, part: str) -> float:
    """Of a part in a mean tick [%]."""
    return 100.0 * row.parts[part] / row.instructions_per_step


def _of(rows: Sequence[Row], variant: Variant) -> list[Row]:
    """A variant's rows of one core, by their number of joints."""
    own = [row for row in rows if row.variant == variant.name]
    return sorted(own, key=lambda row: row.joints)


def _number(value: float | None) -> str:
    return "–" if value is None else thousands(value)


def _difference(rows: Sequence[Row], variant: Variant) -> str:
    """The largest torque difference on any core, for each number of joints."""
    own = [row for row in rows if row.variant == variant.name]
    largest = [max(r.torque_difference_Nm for r in own if r.joints == n) for n in JOINTS]
    return " / ".join(f"{difference:.1e}" for difference in largest)


def write_page(result: Result, path: Path = PAGE) -> Path:
    """Writes the page, and its figures beside it."""
    record(result, path.with_suffix(".json"))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(page(result), encoding="utf-8")
    return path
