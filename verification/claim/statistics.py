"""The figures of a campaign: how often which row is best, and how far all is from Table II.

Plants are independent and equally distributed, so that a count of them is binomial: each share
stands with its interval of C. J. Clopper, E. S. Pearson, The use of confidence or fiducial limits
illustrated in the case of the binomial, Biometrika 26(4), 1934, of 95 %. The intervals are of one
share at a time, and of plants drawn as the campaign draws them; they say nothing of others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import binomtest, rankdata

from verification.claim.flown import Flags, Floats, Flown, State
from verification.paper import REFERENCE_ROW, table_2

CONFIDENCE = 0.95
RATIO_ROWS = ("Exp01", "Exp02", "Exp05", "Exp13")
"""The rows whose errors are told as multiples of Exp08's."""
DELAY_ENDS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
"""Ends of the groups by delay, as fractions of the sample time."""
STIFFNESS_ENDS = tuple(np.geomspace(0.1, 10.0, 7).tolist())
"""Ends of the bands of the safe map."""


@dataclass(frozen=True)
class Share:
    """How many of how many, with the ends of the Clopper-Pearson interval."""

    count: int
    of: int
    share: float
    low: float
    high: float

    @classmethod
    def among(cls, flags: Flags) -> Share:
        """The share of those that are true; without any, all is possible."""
        count, of = int(np.count_nonzero(flags)), len(flags)
        if of == 0:
            return cls(0, 0, float("nan"), 0.0, 1.0)
        ends = binomtest(count, of).proportion_ci(CONFIDENCE, method="exact")
        return cls(count, of, count / of, float(ends.low), float(ends.high))


@dataclass(frozen=True)
class Spread:
    """A distribution over plants: how many had a value, and its quantiles."""

    plants: int
    percentile_5: float
    median: float
    percentile_95: float

    @classmethod
    def of(cls, values: Floats) -> Spread:
        """Of the finite ones among some values."""
        finite = values[np.isfinite(values)]
        if not len(finite):
            return cls(0, *[float("nan")] * 3)
        low, middle, high = np.quantile(finite, (0.05, 0.5, 0.95)).tolist()
        return cls(len(finite), low, middle, high)


@dataclass(frozen=True)
class RowFigures:
    """A row of Table II over all plants.

    Attributes:
        row: its name.
        best: where its RMS error is the smallest of all rows', by joint.
        vibrating: and not diverged.
        diverged: see ``State``.
        ratio: its RMS error over that of Exp08 where both runs got to their ends, by joint.
        paper_ratio: the same in Table II.
    """

    row: str
    best: tuple[Share, ...]
    vibrating: Share
    diverged: Share
    ratio: tuple[Spread, ...]
    paper_ratio: tuple[float, ...]


@dataclass(frozen=True)
class Group:
    """Some of the plants, and Exp08 on them.

    Attributes:
        by: what they have in common.
        value: of it.
        plants: how many.
        fine: where Exp08 neither vibrates nor diverges.
        best: where it is the best row, by joint.
        best_on_both: where it is the best on joints 1 and 2.
        correlation: Spearman's with Table II, by joint.
    """

    by: str
    value: str
    plants: int
    fine: Share
    best: tuple[Share, ...]
    best_on_both: Share
    correlation: tuple[Spread, ...]


@dataclass(frozen=True)
class Standing:
    """A campaign: all rows over all plants, and Exp08 over groups of them, first of all of them."""

    plants: int
    rows: tuple[RowFigures, ...]
    groups: tuple[Group, ...]

    @property
    def whole(self) -> Group:
        """All plants."""
        return self.groups[0]


@dataclass(frozen=True)
class Band:
    """A row on the plants of a band of stiffness.

    Attributes:
        row: its name.
        stiffness_factor: both ends.
        plants: how many.
        fine: where it neither vibrates nor diverges.
        first_not_fine: the smallest delay at which it is not fine; None: it is wherever tried.
        last_fine: the largest delay at which it is fine; None: it is nowhere.
        first_diverged: the smallest delay at which it diverges; None: it doesn't.
    """

    row: str
    stiffness_factor: tuple[float, float]
    plants: int
    fine: Share
    first_not_fine: float | None
    last_fine: float | None
    first_diverged: float | None


def best(flown: Flown) -> Flags:
    """Which row has the smallest error, shape (p, r, n); none where all runs ended early."""
    least = flown.rms_deg.min(axis=1, keepdims=True)
    wins: Flags = (flown.rms_deg == least) & np.isfinite(least)
    return wins


def paper_rms_deg(flown: Flown) -> Floats:
    """Table II's errors of the flown rows [deg], shape (r, n)."""
    return np.array([table_2()[row].rms_deg for row in flown.rows])


def rank_correlations(flown: Flown) -> Floats:
    """Spearman's rank correlation of each plant's errors with Table II's, shape (p, n).

    Runs that ended early share the last rank; NaN where all did.
    """
    ours = rankdata(flown.rms_deg, axis=1)
    theirs = rankdata(paper_rms_deg(flown), axis=0)
    ours -= ours.mean(axis=1, keepdims=True)
    theirs = theirs - theirs.mean(axis=0)
    with np.errstate(invalid="ignore"):
        product = (ours * theirs).sum(axis=1)
        correlations: Floats = product / np.sqrt((ours**2).sum(axis=1) * (theirs**2).sum(axis=0))
    return correlations


def ratios(flown: Flown, row: str) -> Floats:
    """A row's errors over Exp08's, shape (p, n); NaN where a run ended early."""
    mine = flown.rms_deg[:, flown.index(row)]
    reference = flown.rms_deg[:, flown.index(REFERENCE_ROW)]
    there = np.isfinite(mine) & np.isfinite(reference)
    return np.divide(mine, reference, out=np.full_like(mine, np.nan), where=there)


def standing(flown: Flown) -> Standing:
    """The figures of a campaign.

    Raises:
        ClaimError: a row of Table II was not flown.
    """
    for row in table_2():
        flown.index(row)
    wins, states, paper = best(flown), flown.states, paper_rms_deg(flown)
    reference = paper[flown.index(REFERENCE_ROW)]
    rows = tuple(
        RowFigures(
            row,
            tuple(Share.among(wins[:, i, j]) for j in range(flown.joints)),
            Share.among(states[:, i] == State.VIBRATING),
            Share.among(states[:, i] == State.DIVERGED),
            tuple(map(Spread.of, ratios(flown, row).T)),
            tuple((paper[i] / reference).tolist()),
        )
        for i, row in enumerate(flown.rows)
    )
    return Standing(flown.plants, rows, tuple(_groups(flown)))


def _groups(flown: Flown) -> Iterator[Group]:
    yield _group(flown, "all", "all plants")
    state = flown.states[:, flown.index(REFERENCE_ROW)]
    for found in State:
        yield _group(flown.where(state == found), REFERENCE_ROW, found.name.lower())
    for name in np.unique(flown.friction_model).tolist():
        yield _group(flown.where(flown.friction_model == name), "friction", name)
    for low, high in pairwise(DELAY_ENDS):
        within = (flown.torque_delay >= low) & (flown.torque_delay < high)
        yield _group(flown.where(within), "delay", f"{low:g} to {high:g} L")


def _group(flown: Flown, by: str, value: str) -> Group:
    mine = flown.index(REFERENCE_ROW)
    wins = best(flown)[:, mine]
    return Group(
        by,
        value,
        flown.plants,
        Share.among(flown.states[:, mine] == State.FINE),
        tuple(map(Share.among, wins.T)),
        Share.among(wins[:, 0] & wins[:, 1]),
        tuple(map(Spread.of, rank_correlations(flown).T)),
    )


def bands(flown: Flown) -> tuple[Band, ...]:
    """The safe map by row and band of stiffness."""
    return tuple(
        _band(flown, i, ends) for i in range(len(flown.rows)) for ends in pairwise(STIFFNESS_ENDS)
    )


def _band(flown: Flown, row: int, ends: tuple[float, float]) -> Band:
    within = (flown.stiffness_factor >= ends[0]) & (flown.stiffness_factor <= ends[1])
    delay, state = flown.torque_delay[within], flown.states[within, row]
    fine = state == State.FINE
    return Band(
        flown.rows[row],
        ends,
        int(np.count_nonzero(within)),
        Share.among(fine),
        _least(delay[~fine]),
        float(delay[fine].max()) if fine.any() else None,
        _least(delay[state == State.DIVERGED]),
    )


def _least(delays: Floats) -> float | None:
    return float(delays.min()) if len(delays) else None
