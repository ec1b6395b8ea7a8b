"""Writes the report: one HTML page that needs nothing else, and its figures as JSON."""

from __future__ import annotations

from pathlib import Path

from verification.evidence import write_json
from verification.figures.page import scripts
from verification.report.content import Results, as_json, context
from verification.style import pages

_TEMPLATES = Path(__file__).parent / "templates"


def render(results: Results) -> str:
    """The page as HTML; the same results give the same bytes."""
    return pages(_TEMPLATES).get_template("index.html.j2").render(context(results) | scripts())


def write(results: Results, directory: Path) -> Path:
    """Writes ``index.html`` and ``report.json``; returns the path of the page."""
    # The page is rendered before anything is written.
    text = render(results)
    write_json(as_json(results), directory / "report.json")
    page = directory / "index.html"
    page.write_text(text, encoding="utf-8")
    return page
