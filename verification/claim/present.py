"""``python -m verification claim``: the figures of the campaigns that ``make claim`` flies."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from codegen.emit import REPOSITORY
from plant.native import BUILD
from verification.claim.figures import SafeMap, draw
from verification.claim.flown import LOST_DEG, VIBRATING, Flown, read_flown
from verification.claim.linear import joints_of, motor_bound
from verification.claim.statistics import (
    RATIO_ROWS,
    Band,
    Group,
    Share,
    Spread,
    Standing,
    bands,
    standing,
)
from verification.evidence import RESULTS, Evidence
from verification.paper import REFERENCE_ROW

SPECIFICATIONS = REPOSITORY / "plant" / "campaigns"
FOLDERS = BUILD / "plant" / "campaigns"
CAMPAIGNS = {"rigid": "claim_rigid", "flexible": "claim_flexible"}
SAFE_MAP = "safe_map"
PICTURES = RESULTS / "claim"
_JOINTS = ("joint 1", "joint 2", "joint 3")


@dataclass(frozen=True)
class LinearBound:
    """What linear theory says of a joint whose spring is soft (:mod:`verification.claim.linear`).

    Attributes:
        joint: its number, from 1.
        mbar_over_rotor: Mbar over the motor's inertia at the joint.
        torque_delay: up to which the loop is stable, as a fraction of the sample time.
    """

    joint: int
    mbar_over_rotor: float
    torque_delay: float


@dataclass(frozen=True)
class Claim:
    """What the campaigns say.

    Attributes:
        rigid: on plants with rigid joints.
        flexible: with flexible ones.
        safe_map: by row and band of stiffness.
        linear: bounds of the joints, computed and not flown.
        vibrating: share of a drive's limit, above which the RMS torque step is called vibrating.
        lost_deg: error above which a run counts as diverged.
        evidence: sampled, on simulated plants.
    """

    rigid: Standing
    flexible: Standing
    safe_map: tuple[Band, ...]
    linear: tuple[LinearBound, ...]
    vibrating: float = VIBRATING
    lost_deg: float = LOST_DEG
    evidence: Evidence = Evidence.SAMPLED


def examine(specifications: Path, folders: Path, pictures: Path) -> tuple[Claim, list[Path]]:
    """Reads the three campaigns and draws their pictures.

    Args:
        specifications: the folder with their files.
        folders: the folder with the folders of their results.
        pictures: where these go.

    Raises:
        ClaimError: a campaign isn't flown to its end, or lacks rows.
    """

    def of(name: str) -> Flown:
        return read_flown(specifications / f"{name}.toml", folders / name)

    campaigns = {kind: of(name) for kind, name in CAMPAIGNS.items()}
    standings = {kind: standing(flown) for kind, flown in campaigns.items()}
    safe = SafeMap(of(SAFE_MAP), joints_of(specifications / f"{SAFE_MAP}.toml"))
    linear = tuple(
        LinearBound(i, joint.mbar_kgm2 / joint.rotor_kgm2, motor_bound(joint))
        for i, joint in enumerate(safe.joints, start=1)
    )
    claim = Claim(standings["rigid"], standings["flexible"], bands(safe.flown), linear)
    return claim, draw(campaigns, standings, safe, pictures)


def show(claim: Claim, pictures: Sequence[Path], console: Console) -> None:
    """Prints all tables."""
    for kind, found in (("rigid", claim.rigid), ("flexible", claim.flexible)):
        for table in (_rows(kind, found), _ratios(found), _groups(found), _correlations(found)):
            console.print(table)
            console.print()
    console.print(_map([band for band in claim.safe_map if band.row == REFERENCE_ROW]))
    console.print()
    for line in (
        *(
            f"Linear theory, joint {b.joint}: Mbar is {b.mbar_over_rotor:.2f} times the motor's "
            f"inertia; behind a soft spring stable up to a delay of {b.torque_delay:.2f} L"
            for b in claim.linear
        ),
        "Sampled: random plants with numbers as the campaigns' files say; others may differ.",
        "[ ]: the Clopper-Pearson interval of 95 %, or the 5th and 95th percentile.",
        f"Vibrating: the RMS torque step of a joint is above {VIBRATING:.0%} of its drive's limit.",
        f"Diverged: the run ended early, or an error got above {LOST_DEG:g} deg.",
        f"pictures: {pictures[0].parent}",
    ):
        console.print(line, markup=False, soft_wrap=True)


def _table(title: str, *columns: str) -> Table:
    table = Table(
        title=title, title_justify="left", box=None, pad_edge=False, collapse_padding=True
    )
    for column in columns:
        table.add_column(escape(column), no_wrap=True)
    return table


def _rows(kind: str, found: Standing) -> Table:
    title = f"{kind} joints, {found.plants} plants: how often, in %"
    table = _table(title, "row", "vibrating", "diverged", "best on joints 1 2 3")
    for row in found.rows:
        table.add_row(row.row, _share(row.vibrating), _share(row.diverged), _shares(row.best))
    return table


def _ratios(found: Standing) -> Table:
    table = _table(f"RMS over {REFERENCE_ROW}'s: median, percentiles and paper", "row", *_JOINTS)
    for row in found.rows:
        if row.row in RATIO_ROWS:
            both = zip(row.ratio, row.paper_ratio, strict=True)
            table.add_row(row.row, *(f"{_spread(ours)} {paper:.3g}" for ours, paper in both))
    return table


def _groups(found: Standing) -> Table:
    title = f"{REFERENCE_ROW} by group, in %"
    columns = ("plants", "fine", "best on joints 1 2 3", "on 1 and 2")
    table = _table(title, "group", *columns)
    for group in found.groups:
        table.add_row(
            _name(group),
            str(group.plants),
            f"{100 * group.fine.share:.1f}" if group.plants else "-",
            _shares(group.best),
            _share(group.best_on_both),
        )
    return table


def _correlations(found: Standing) -> Table:
    table = _table("Spearman's rank correlation with Table II", "group", *_JOINTS)
    for group in found.groups:
        table.add_row(_name(group), *(_spread(s, ".2f") for s in group.correlation))
    return table


def _name(group: Group) -> str:
    return f"{group.by} {group.value}".removeprefix("all ").removeprefix("friction ")


def _map(bands: Sequence[Band]) -> Table:
    table = _table(
        f"{REFERENCE_ROW} with flexible joints, by stiffness: delays [L]",
        "stiffness",
        "plants",
        "fine in %",
        "last fine",
        "first not",
        "first diverged",
    )
    for band in bands:
        low, high = band.stiffness_factor
        delays = (band.last_fine, band.first_not_fine, band.first_diverged)
        table.add_row(
            f"{low:.3g} to {high:.3g}",
            str(band.plants),
            _share(band.fine),
            *("-" if x is None else f"{x:.3f}" for x in delays),
        )
    return table


def _share(share: Share) -> str:
    if not share.of:
        return "-"
    return escape(f"{100 * share.share:.1f} [{100 * share.low:.1f}, {100 * share.high:.1f}]")


def _shares(shares: Sequence[Share]) -> str:
    return " ".join(f"{100 * s.share:.1f}" if s.of else "-" for s in shares)


def _spread(spread: Spread, as_: str = ".3g") -> str:
    if not spread.plants:
        return "-"
    low, middle, high = (
        format(x, as_) for x in (spread.percentile_5, spread.median, spread.percentile_95)
    )
    return escape(f"{middle} [{low}, {high}]")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    parser.add_argument(
        "--results",
        type=Path,
        default=FOLDERS,
        metavar="FOLDER",
        help="with the folders of the campaigns' results (default: build/plant/campaigns)",
    )
