"""What to change so that a sampled loop gets stable, from its intervals alone."""

from __future__ import annotations

import math
from dataclasses import replace

from verification.sampled_stability.intervals import stable_intervals
from verification.sampled_stability.loop import Loop
from verification.tuning_check.joint import Sampled

_HALVINGS = 10
"""So often is the sample time halved in search of a stable loop."""


def mbar_factor(sampled: Sampled, low: float, high: float, margin: float) -> float | None:
    """By what to multiply Mbar so that the eigenvalues lie in the interval with a margin.

    Args:
        sampled: with its intervals.
        low: least eigenvalue of M^-1 Mbar.
        high: largest.
        margin: factor that is to be left to both ends.

    Returns:
        The factor nearest to 1, in the middle where there is no room for the margin; None where
        not even all eigenvalues have room.
    """
    if not sampled.intervals:
        return None
    widest = max(sampled.intervals, key=lambda i: float(i.high) / max(float(i.low), math.ulp(0.0)))
    least, most = float(widest.low) / low, float(widest.high) / high
    if least >= most:
        return None
    if least * margin > most / margin:
        return math.sqrt(least * most)
    return min(max(1.0, least * margin), most / margin)


def words(factor: float | None) -> str:
    """The change in plain words."""
    if factor is None:
        return (
            "no factor of Mbar brings all postures inside: lower KP/KD and lambda, or shorten the "
            "sample time"
        )
    return f"multiply Mbar by {rounded(factor):g}" if factor != 1.0 else ""


def rounded(factor: float) -> float:
    """To two digits, to the side of more change."""
    unit = 10.0 ** (math.floor(math.log10(factor)) - 1)
    steps = math.floor(factor / unit) if factor < 1.0 else math.ceil(factor / unit)
    return float(f"{steps * unit:.2g}")


def shorter_sample_time(loop: Loop) -> str:
    """The longest of the halved sample times for which there is a stable Mbar, in words."""
    for halvings in range(1, _HALVINGS + 1):
        sample_time = loop.sample_time_s / 2**halvings
        if stable_intervals(replace(loop, sample_time_s=sample_time)):
            return (
                f"shorten the sample time to {1e3 * float(sample_time):.3g} ms, or lower KD, KP "
                "and lambda"
            )
    return "give KD > 0 and KP > 0, or lower lambda"
