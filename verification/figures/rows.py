"""How rows of Table II look in every figure, and how a long signal is drawn."""

from __future__ import annotations

import numpy as np

from verification.figures.chart import Floats
from verification.style import PALETTE

COLOURS = {"Exp01": PALETTE[3], "Exp02": PALETTE[1], "Exp05": PALETTE[2], "Exp08": PALETTE[0]}
LABELS = {
    "Exp01": "Exp01, Hsia",
    "Exp02": "Exp02, Jin",
    "Exp05": "Exp05, Jin TSM",
    "Exp08": "Exp08, inclusive",
}

ENVELOPE_S = 0.04
"""Errors are drawn as their largest magnitude in each such span: 12 000 ticks fit no screen."""


def envelope(time_s: Floats, signal: Floats, span_s: float = ENVELOPE_S) -> tuple[Floats, Floats]:
    """The largest magnitude in each span: times of the spans' middles, and the maxima."""
    ticks = max(1, round(span_s / (time_s[1] - time_s[0])))
    spans = len(signal) // ticks
    folded = np.abs(signal[: spans * ticks]).reshape(spans, ticks)
    return time_s[: spans * ticks : ticks] + span_s / 2, folded.max(axis=1)
