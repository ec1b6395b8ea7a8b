"""What `make pil`, `make chain`, `make bench` and `make size` left, for the report.

The report itself needs no emulator: it shows what these commands found, if they ran on the C that
is generated today. What `make bench` found once comes with the repository.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from verification import pil, size
from verification.bench import rows as bench
from verification.bench.present import chart
from verification.bench.variants import VARIANTS
from verification.chain.links import DOUBLE_TO_HOST, EXACT_TO_DOUBLE
from verification.evidence import RESULTS, current_json
from verification.style import house_style, inline_svg

TITLES = {variant.name: variant.title for variant in VARIANTS}
LINKS = {EXACT_TO_DOUBLE: "1 exact → double", DOUBLE_TO_HOST: "2 double → C"}
MEANINGS = {variant.title: variant.meaning for variant in VARIANTS}


@dataclass(frozen=True)
class Processor:
    """Figures of the emulated processors; None where a command has not run on today's C.

    Attributes:
        flights: closed loops with the processor in them, as :class:`verification.pil.PilRun` is
            written to JSON.
        sizes: flash, RAM and stack, as :class:`verification.size.Size` is written to JSON.
        cost: instructions a step, and estimated cycles.
        chain: from the exact law to the targets, as :class:`verification.chain.links.Chain` is
            written to JSON.
    """

    flights: Sequence[dict[str, Any]] | None
    sizes: Sequence[dict[str, Any]] | None
    cost: bench.Result | None
    chain: dict[str, Any] | None

    @property
    def equal(self) -> int:
        """How many flights gave the host's bits."""
        return sum(bool(flight["equal"]) for flight in self.flights or ())

    @property
    def missing(self) -> list[str]:
        """The commands that would fill the gaps."""
        commands = {
            "make pil": self.flights,
            "make chain": self.chain,
            "make bench": self.cost,
            "make size": self.sizes,
        }
        return [command for command, found in commands.items() if found is None]

    @property
    def cheapest(self) -> list[bench.Spread]:
        """How long a tick is with the cheapest numbers of each core."""
        if self.cost is None:
            return []
        best: dict[tuple[str, int], bench.Spread] = {}
        for spread in sorted(self.cost.spreads, key=lambda s: s.mean):
            best.setdefault((spread.core, spread.joints), spread)
        return [spread for spread in self.cost.spreads if spread in best.values()]

    def cost_picture(self) -> str:
        """The bar chart of instructions a step, as an SVG element; empty without figures."""
        if self.cost is None:
            return ""
        with house_style():
            return inline_svg(
                chart(self.cost.rows), "cost", "Instructions a step of each variant on each core"
            )


def found() -> Processor:
    """What the commands left in ``build/``."""
    flights, sizes = current_json(pil.RESULT), current_json(size.RESULT)
    return Processor(
        flights["runs"] if flights else None,
        sizes["sizes"] if sizes else None,
        bench.measured_or_recorded(),
        current_json(RESULTS / "chain.json"),
    )
