"""The interactive page: one HTML file with Plotly in it, which asks for nothing from outside."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from plotly.offline import get_plotlyjs

from verification.figures.paper_figure import PaperFigure
from verification.paper import PAPER
from verification.style import PAGE_COLOURS, pages

_TEMPLATES = Path(__file__).parent / "templates"


def render(figures: Sequence[PaperFigure]) -> str:
    """The page; the same figures give the same bytes."""
    return (
        pages(_TEMPLATES)
        .get_template("figures.html.j2")
        .render(
            figures=figures,
            kinds=list(dict.fromkeys(f.evidence for f in figures if f.evidence is not None)),
            charts={figure.name: embedded(figure.interactive()) for figure in figures},
            paper=PAPER,
            **scripts(),
        )
    )


def scripts() -> dict[str, str]:
    """What ``zoomable.html.j2`` needs in a page."""
    return {"plotly": get_plotlyjs(), "colours": embedded(PAGE_COLOURS)}


def embedded(data: object) -> str:
    """JSON that may stand in a script element."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")
