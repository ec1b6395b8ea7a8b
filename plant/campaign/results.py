"""The folder of a campaign: finished batches, and in the end one table of all runs.

    campaign.json                what the campaign is, with the hashes of its inputs and its C
    plants-FIRST-LAST.parquet    all runs of some plants, one file a batch
    results.parquet              all runs, ordered by plant, seed and gain set
    summary.json                 the figures by gain set

A file is written under another name and renamed when it is whole. Whatever interrupts a campaign
leaves whole batches, which the next one of the same inputs and C does not fly again.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from plant.campaign.runs import Campaign, CampaignError, Row

_BATCH = re.compile(r"plants-(\d+)-(\d+)\.parquet")
_JOINT_FIGURES = (
    "rms_error_deg",
    "rms_true_error_deg",
    "peak_error_deg",
    "peak_torque_Nm",
    "rms_torque_step_Nm",
)
_JOINT_NUMBERS = ("friction_factor", "inertia_factor", "encoder_phase_counts")


def schema(campaign: Campaign) -> pa.Schema:
    """The columns, with the unit at the end of each name that has one.

    Figures are null where a run diverged; ``reason`` is null where it did not, and
    ``stiffness_factor`` where none was drawn. Joints count from 1; their names are in the metadata.
    """

    def by_joint(names: Sequence[str], *, nullable: bool) -> Iterator[pa.Field]:
        for name in names:
            for i in range(1, len(campaign.joint_names) + 1):
                yield pa.field(f"joint{i}_{name}", pa.float64(), nullable)

    fields = [
        pa.field("plant", pa.int32(), nullable=False),
        pa.field("seed", pa.int32(), nullable=False),
        pa.field("gain_set", pa.string(), nullable=False),
        pa.field("diverged", pa.bool_(), nullable=False),
        pa.field("reason", pa.string()),
        pa.field("ticks", pa.int64()),
        pa.field("saturated_ticks", pa.int64()),
        pa.field("lost_ticks", pa.int64()),
        *by_joint(_JOINT_FIGURES, nullable=True),
        pa.field("friction_model", pa.string(), nullable=False),
        pa.field("torque_delay_ticks", pa.float64(), nullable=False),
        pa.field("amplitude_deg", pa.float64(), nullable=False),
        pa.field("stiffness_factor", pa.float64()),
        *by_joint(_JOINT_NUMBERS, nullable=False),
    ]
    return pa.schema(fields, {"campaign": json.dumps(description(campaign))})


def description(campaign: Campaign) -> dict[str, Any]:
    """What a campaign is, as plain data; the same for any number of plants."""
    specification = campaign.specification.model_dump(mode="json", exclude={"plants": {"count"}})
    return {
        "specification": specification,
        "inputs_sha256": campaign.inputs_sha256,
        "c_sha256": campaign.c_sha256,
        "libraries": list(campaign.libraries),
        "controller": campaign.shipped.name,
        "joint_names": campaign.joint_names,
        "sample_time_s": float(campaign.shipped.sample_time),
    }


@dataclass(frozen=True)
class Folder:
    """The results of a campaign; make it with :func:`open_folder`."""

    path: Path
    campaign: Campaign

    def finished(self) -> set[int]:
        """The plants, of the specified number, whose runs are all there."""
        count = self.campaign.specification.plants.count
        return {i for _, plants in self._batches() for i in plants if i < count}

    def missing(self, batch: int) -> list[range]:
        """The plants that are still to be flown, in batches of so many neighbours at most."""
        finished, batches = self.finished(), list[range]()
        for i in range(self.campaign.specification.plants.count):
            if i in finished:
                continue
            last = batches[-1] if batches else range(0)
            if last and last.stop == i and len(last) < batch:
                batches[-1] = range(last.start, i + 1)
            else:
                batches.append(range(i, i + 1))
        return batches

    def add(self, plants: range, rows: Sequence[Row]) -> None:
        """Writes a finished batch."""
        table = pa.Table.from_pylist(list(rows), schema(self.campaign))
        name = f"plants-{plants.start:08d}-{plants.stop - 1:08d}.parquet"
        _write(self.path / name, lambda file: pq.write_table(table, file))

    def finish(self) -> pa.Table:
        """Writes the table of all runs, when no plant is missing, and returns it.

        Raises:
            CampaignError: a batch is damaged.
        """
        table = pa.concat_tables([self._read(path) for path, _ in self._batches()])
        table = table.filter(pc.less(table["plant"], self.campaign.specification.plants.count))
        table = _once(table)
        if len(table) != self.campaign.runs:
            raise CampaignError(
                f"{self.path} has {len(table)} of {self.campaign.runs} runs: remove its "
                "plants-*.parquet and start again"
            )
        _write(self.path / "results.parquet", lambda file: pq.write_table(table, file))
        summary = json.dumps(summarise(table), indent=2) + "\n"
        _write(self.path / "summary.json", lambda file: file.write_text(summary, encoding="utf-8"))
        return table

    def _batches(self) -> list[tuple[Path, range]]:
        """Files and plants, in the order of the plants."""
        found = [(path, _BATCH.fullmatch(path.name)) for path in self.path.iterdir()]
        batches = [(path, range(int(m[1]), int(m[2]) + 1)) for path, m in found if m]
        return sorted(batches, key=lambda batch: (batch[1].start, batch[1].stop))

    def _read(self, path: Path) -> pa.Table:
        try:
            table = pq.read_table(path)
        except (OSError, pa.ArrowInvalid) as error:
            raise CampaignError(f"{path} is damaged: remove it and start again") from error
        if not table.schema.equals(schema(self.campaign), check_metadata=True):
            raise CampaignError(f"{path} is of another campaign: remove it and start again")
        return table


def _once(table: pa.Table) -> pa.Table:
    """One row of each run: two campaigns at once may fly a plant twice, with the same figures."""
    keys = zip(*(table[name].to_pylist() for name in ("plant", "seed", "gain_set")), strict=True)
    rows = {key: row for row, key in enumerate(keys)}
    return table.take(list(rows.values())).combine_chunks()


def open_folder(path: Path, campaign: Campaign) -> Folder:
    """The folder of a campaign, new or with what an earlier one of the same inputs finished.

    The number of plants may differ: a larger one goes on where the smaller ended.

    Raises:
        CampaignError: it holds something else.
    """
    path.mkdir(parents=True, exist_ok=True)
    told, now = path / "campaign.json", description(campaign)
    if told.exists():
        _check_same(path, _told(told), now)
    elif any(not found.name.startswith(".") for found in path.iterdir()):
        raise CampaignError(f"{path} is not empty and holds no campaign: name another --output")
    else:
        text = json.dumps(now, indent=2) + "\n"
        _write(told, lambda file: file.write_text(text, encoding="utf-8"))
    return Folder(path, campaign)


def _told(path: Path) -> dict[str, Any]:
    try:
        told: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise CampaignError(f"{path} is damaged: remove its folder and start again") from error
    return told


def _check_same(path: Path, before: dict[str, Any], now: dict[str, Any]) -> None:
    if before == now:
        return
    changed = _differences(before.get("specification", {}), now["specification"])
    if before.get("c_sha256") != now["c_sha256"]:
        changed.append("the controller's generated C")
    elif before.get("libraries") != now["libraries"]:
        changed.append("the C of the plant, or the compiler")
    raise CampaignError(
        f"{path} holds runs of another campaign, which differs in "
        f"{', '.join(changed) or 'the files of the controller or the robot'}: "
        "name another --output for the new one, or remove that folder"
    )


def _differences(before: dict[str, Any], now: dict[str, Any], prefix: str = "") -> list[str]:
    """The dotted keys of different values."""
    found = []
    for key in sorted({*before, *now}):
        old, new = before.get(key), now.get(key)
        if isinstance(old, dict) and isinstance(new, dict):
            found += _differences(old, new, f"{prefix}{key}.")
        elif old != new:
            found.append(prefix + key)
    return found


def _write(target: Path, write: Callable[[Path], object]) -> None:
    """Writes a file whole or not at all."""
    # A name of its own: two campaigns may write the same batch at the same time.
    fresh = target.with_name(f".{target.name}.{uuid4().hex}.unfinished")
    try:
        write(fresh)
        with fresh.open("rb") as file:
            os.fsync(file.fileno())
        fresh.replace(target)
    finally:
        fresh.unlink(missing_ok=True)


def summarise(table: pa.Table) -> list[dict[str, Any]]:
    """Figures by gain set over all runs that did not diverge, of the worst joint of each run."""
    return [
        _summary(name, table.filter(pc.equal(table["gain_set"], name)))
        for name in dict.fromkeys(table["gain_set"].to_pylist())
    ]


def _summary(name: str, table: pa.Table) -> dict[str, Any]:
    flown = table.filter(pc.invert(table["diverged"]))
    told = {
        "gain_set": name,
        "runs": len(table),
        "diverged": len(table) - len(flown),
        "runs_with_saturation": int(np.count_nonzero(flown["saturated_ticks"].to_numpy())),
        "runs_with_lost_ticks": int(np.count_nonzero(flown["lost_ticks"].to_numpy())),
    }
    if not len(flown):
        return told
    for figure in ("rms_error_deg", "peak_error_deg", "rms_torque_step_Nm"):
        joints = [c for c in flown.column_names if re.fullmatch(rf"joint\d+_{figure}", c)]
        worst = np.max([flown[column].to_numpy() for column in joints], axis=0)
        for word, share in (("median", 0.5), ("95_percent", 0.95), ("largest", 1.0)):
            told[f"{word}_{figure}"] = float(np.quantile(worst, share))
    return told
