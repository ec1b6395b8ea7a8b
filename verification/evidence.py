"""The four kinds of evidence, which are never mixed, and the JSON that every check leaves."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from plant.native import BUILD, GENERATED

RESULTS = BUILD / "verification"
"""Where the commands leave their figures."""


class Evidence(Enum):
    """What a claim rests on; a claim never wears a stronger word than it earned."""

    PROVED = "proved"
    EXHAUSTIVE = "exhaustive"
    MEASURED = "measured"
    SAMPLED = "sampled"

    @property
    def meaning(self) -> str:
        """One sentence for the reader of a report."""
        return _MEANING[self]


_MEANING = {
    Evidence.PROVED: "holds for every value, by algebra or by intervals that a checker verifies",
    Evidence.EXHAUSTIVE: "every case was tried; there are no others",
    Evidence.MEASURED: "an experiment was run on the simulated plant and its result is given",
    Evidence.SAMPLED: "random cases were tried; those that were not may differ",
}


def plain(value: object) -> Any:
    """Dataclasses, enumerations, tuples and numpy values as JSON's own types."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return plain(value.value)
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # JSON has no infinities, and what is wrong must still be told
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return value


def generated_sha256() -> str:
    """The hash of all generated C: figures that name another one are of another C."""
    digest = hashlib.sha256()
    for manifest in sorted(GENERATED.glob("*/manifest.json")):
        digest.update(manifest.read_bytes())
    return digest.hexdigest()


def write_json(figures: Mapping[str, object], path: Path) -> Path:
    """Writes figures as JSON with the hash of the C that they are of.

    Keys are sorted, so that equal results are equal bytes.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    named = {"generated_sha256": generated_sha256(), **figures}
    text = json.dumps(plain(named), indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
    return path


def current_json(path: Path) -> dict[str, Any] | None:
    """What an earlier command left, or None if there is nothing, or it is of another C."""
    if not path.is_file():
        return None
    left: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return left if left.get("generated_sha256") == generated_sha256() else None
