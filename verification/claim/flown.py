"""What a campaign has flown, as arrays: figures of each plant with each row of Table II."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from plant.campaign.results import open_folder
from plant.campaign.runs import CampaignError, prepare
from plant.campaign.specification import read

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

LOST_DEG = 5.0
"""A run whose error gets larger counts as diverged: the worst row of the paper, Exp13, stays within
about 1.5 deg, and what is behind it is held together by the drives' limits alone."""

VIBRATING = 0.15
"""The RMS change of a torque from tick to tick, as a share of its drive's limit, above which a
joint vibrates. Runs that don't are at about 0.03, limit cycles between both limits above 0.5."""


class ClaimError(ValueError):
    """Results that can't be told of; the message says why and what to do."""


class State(IntEnum):
    """How a run went, the best first."""

    FINE = 0
    VIBRATING = 1
    DIVERGED = 2


@dataclass(frozen=True, eq=False)
class Flown:
    """The figures of p plants with n joints, each flown with r rows of Table II.

    Figures of a run that ended early are infinite.

    Attributes:
        rows: names of the rows, r of them.
        rms_deg: RMS of the error by the encoders, as in Table II [deg], shape (p, r, n).
        peak_deg: its largest magnitude [deg], shape (p, r, n).
        torque_step: RMS change of the torque from tick to tick over the drive's limit, (p, r, n).
        friction_model: names, shape (p,).
        torque_delay: as a fraction of the sample time, shape (p,).
        inertia_factor: times the links' nominal inertia, shape (p, n).
        stiffness_factor: times the nominal stiffness, shape (p,); NaN where joints are rigid.
    """

    rows: tuple[str, ...]
    rms_deg: Floats
    peak_deg: Floats
    torque_step: Floats
    friction_model: NDArray[np.str_]
    torque_delay: Floats
    inertia_factor: Floats
    stiffness_factor: Floats

    @property
    def plants(self) -> int:
        """How many there are."""
        return len(self.rms_deg)

    @property
    def joints(self) -> int:
        """Number of joints."""
        return int(self.rms_deg.shape[2])

    @property
    def states(self) -> NDArray[np.int64]:
        """The :class:`State` of each run, shape (p, r); its worst joint counts."""
        vibrating = self.torque_step.max(axis=2) > VIBRATING
        diverged = self.peak_deg.max(axis=2) > LOST_DEG
        return np.where(diverged, State.DIVERGED, np.where(vibrating, State.VIBRATING, State.FINE))

    def index(self, row: str) -> int:
        """Where a row stands.

        Raises:
            ClaimError: it was not flown.
        """
        if row not in self.rows:
            raise ClaimError(
                f"the results hold no {row}, only {', '.join(self.rows)}: add it to the campaign's "
                "experiments and run make claim"
            )
        return self.rows.index(row)

    def where(self, chosen: Flags) -> Flown:
        """The plants of a mask, shape (p,)."""
        arrays: dict[str, Any] = {
            name: value[chosen]
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray)
        }
        return replace(self, **arrays)


def flown(table: pa.Table, torque_limit_Nm: Sequence[float]) -> Flown:
    """The arrays of a campaign's table.

    Args:
        table: all runs, ordered by plant and gain set (:func:`plant.campaign.results.schema`).
        torque_limit_Nm: of the drives, n entries.

    Raises:
        ClaimError: a plant lacks runs, or was flown more than once.
    """
    names = table["gain_set"].to_pylist()
    rows = tuple(dict.fromkeys(names))
    plants = table["plant"].to_numpy()
    shape = (len(plants) // max(1, len(rows)), len(rows))
    whole = len(plants) == shape[0] * shape[1] and names == list(rows) * shape[0]
    if not (len(plants) and whole and len(np.unique(plants[:: len(rows)])) == shape[0]):
        raise ClaimError(
            "the results are not one run of each gain set on each plant: remove their folder, "
            "leave seeds out of the campaign and run make claim"
        )

    def by_joint(figure: str) -> Floats:
        columns = [c for c in table.column_names if re.fullmatch(rf"joint\d+_{figure}", c)]
        values = np.array([table[c].to_numpy() for c in columns]).T
        return np.where(np.isnan(values), np.inf, values).reshape(*shape, len(columns))

    def of_plant(column: str) -> Floats:
        return np.asarray(table[column].to_numpy()[:: len(rows)], dtype=np.float64)

    return Flown(
        rows=rows,
        rms_deg=by_joint("rms_error_deg"),
        peak_deg=by_joint("peak_error_deg"),
        torque_step=by_joint("rms_torque_step_Nm") / np.asarray(torque_limit_Nm),
        friction_model=np.array(table["friction_model"].to_pylist()[:: len(rows)]),
        torque_delay=of_plant("torque_delay_ticks"),
        inertia_factor=by_joint("inertia_factor")[:, 0],
        stiffness_factor=of_plant("stiffness_factor"),
    )


def read_flown(specification: Path, folder: Path) -> Flown:
    """What a campaign has flown, if it is all there and of today's C.

    Args:
        specification: the campaign's file.
        folder: of its results.

    Raises:
        ClaimError: it isn't flown, or not to its end.
        CampaignError: the folder holds another campaign's results, or those of other C.
        SpecificationError, RobotError, PlantError, CompilerError: as of
            :func:`plant.campaign.runs.prepare`.
    """
    if not (folder / "campaign.json").is_file():
        raise ClaimError(f"{folder} holds no results of {specification.name}: run make claim")
    campaign = prepare(read(specification), specification.parent)
    try:
        opened = open_folder(folder, campaign)
    except CampaignError as error:
        raise ClaimError(f"{error}; make claim then flies it") from error
    finished, count = len(opened.finished()), campaign.specification.plants.count
    table = folder / "results.parquet"
    if finished < count or not table.is_file():
        raise ClaimError(
            f"{finished} of the {count} plants of {specification.name} are flown: run make claim, "
            "which goes on with the others"
        )
    drive = next(iter(campaign.robots.values())).drive
    assert drive is not None  # prepare would have told
    return flown(pq.read_table(table), drive.torque_limit_Nm.tolist())
