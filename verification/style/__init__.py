"""One look for all pictures, and SVG that takes its colours from the page around it."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from cycler import cycler
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure

PALETTE = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9")
"""Okabe and Ito's colours, told apart with every common kind of colour blindness."""

WIDTH_IN = 4.4
"""Pictures are drawn this wide and scaled by the page: labels stay readable on a phone."""

# Stand-ins that become the page's own colours, so that one picture serves light and dark.
INK, LINE = "#010203", "#040506"
"""The page's colours of text, for curves that must stand out on light and dark, and of grids."""

PAGE_COLOURS = {
    INK: "currentColor",
    LINE: "var(--line)",
    # The palette's blue is too dark for a dark page, which has a lighter one.
    PALETTE[0].lower(): "var(--blue)",
}
"""What the stand-ins become in a page, as CSS."""

_STYLE: Any = {
    "svg.hashsalt": "inclusive-tdc",
    "svg.fonttype": "none",
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "legend.handlelength": 1.4,
    "legend.columnspacing": 1.2,
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": LINE,
    "xtick.color": LINE,
    "ytick.color": LINE,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.prop_cycle": cycler(color=PALETTE),
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LINE,
    "grid.linewidth": 0.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.2,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
}

_PAPER_LINE = "#b0b0b0"
_PRINTED: Any = {
    **dict.fromkeys(("axes.edgecolor", "grid.color", "xtick.color", "ytick.color"), _PAPER_LINE),
    **dict.fromkeys(("figure.facecolor", "savefig.facecolor"), "white"),
    # A file of its own has the font of no page around it.
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "legend.fontsize": 7.5,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
}
"""What files for print have otherwise; their ink is all but black."""


@contextmanager
def house_style(*, printed: bool = False) -> Iterator[None]:
    """Draws with the report's style, whatever the user's own matplotlibrc says.

    Args:
        printed: whether the picture becomes a file of its own, and no part of a page.
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE | _PRINTED if printed else _STYLE)
        yield


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    # Dates and versions would make every build another file.
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def write_svg(figure: Figure, path: Path) -> Path:
    """The picture, drawn in the printed style, as a file of its own; the same bytes every time."""
    path.write_text(_svg(figure), encoding="utf-8")
    return path


_TEMPLATES = Path(__file__).parent / "templates"


def pages(folder: Path) -> Environment:
    """The environment of HTML pages: a folder's templates, and those that all pages share."""
    return Environment(
        loader=FileSystemLoader([folder, _TEMPLATES]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=True,
    )


def inline_svg(figure: Figure, name: str, label: str) -> str:
    """The picture as an SVG element for an HTML page, the same bytes every time.

    Args:
        figure: a Matplotlib figure.
        name: goes before all identifiers, which are unique in one picture only.
        label: what it shows, for those who can't see it.
    """
    text = _svg(figure)
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    # In HTML an SVG element needs no namespaces, and the page has no address in it at all.
    text = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", text)
    text = re.sub(r'(<svg[^>]*?)\s(?:width|height)="[^"]*pt"', r"\1", text)
    text = re.sub(r'(<svg[^>]*?)\s(?:width|height)="[^"]*pt"', r"\1", text)
    text = text.replace("'DejaVu Sans'", "inherit")
    text = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font-size: \1", text)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", text)
    for ours, page in PAGE_COLOURS.items():
        text = text.replace(ours, page)
    return text.replace("<svg", f'<svg role="img" aria-label="{label}"', 1).strip()
