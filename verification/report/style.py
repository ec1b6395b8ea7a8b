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
from matplotlib.figure import Figure

PALETTE = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9")
"""Okabe and Ito's colours, told apart with every common kind of colour blindness."""

WIDTH_IN = 4.4
"""Pictures are drawn this wide and scaled by the page: labels stay readable on a phone."""

# Stand-ins that become the page's own colours, so that one picture serves light and dark.
_INK, _LINE = "#010203", "#040506"
_PAGE_COLOURS = {
    _INK: "currentColor",
    _LINE: "var(--line)",
    # The palette's blue is too dark for a dark page, which has a lighter one.
    PALETTE[0].lower(): "var(--blue)",
}

_LINE_ON_WHITE = "#c4c8cc"

INK = _INK
"""The page's text colour, for lines that must stand out on light and dark."""

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
    "text.color": _INK,
    "axes.labelcolor": _INK,
    "axes.edgecolor": _LINE,
    "xtick.color": _LINE,
    "ytick.color": _LINE,
    "xtick.labelcolor": _INK,
    "ytick.labelcolor": _INK,
    "axes.prop_cycle": cycler(color=PALETTE),
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": _LINE,
    "grid.linewidth": 0.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.2,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
}


@contextmanager
def house_style() -> Iterator[None]:
    """Draws with the report's style, whatever the user's own matplotlibrc says."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    # Dates and versions would make every build another file.
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def write_svg(figure: Figure, path: Path) -> Path:
    """The picture as a file of its own, on white, the same bytes every time."""
    figure.set_facecolor("white")
    text = _svg(figure).replace(_LINE, _LINE_ON_WHITE)
    path.write_text(text, encoding="utf-8")
    return path


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
    for ours, page in _PAGE_COLOURS.items():
        text = text.replace(ours, page)
    return text.replace("<svg", f'<svg role="img" aria-label="{label}"', 1).strip()
