"""What longer commands left, for the report: the claim, rivals, special cases, faults.

Each takes minutes to half an hour and is shown where it has run on today's C; else the report says
which command is missing.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from verification.evidence import RESULTS, current_json

CLAIM_PICTURES = {
    "best": "How often Exp08 has the smallest error of all rows, by joint, with 95 % intervals.",
    "safe_map": "Exp08 on the flexible plant, by torque delay and stiffness of the gears: where "
    "the paper's gains are fine, where they vibrate, where they diverge. Lines: linear theory.",
    "safe_map_rows": "The same for four rows of Table II.",
    "ratios_rigid": "Errors over Exp08's on rigid plants; dotted: the paper's own ratios.",
    "rank_correlation": "Rank correlation with Table II: the share of plants below a value.",
}
_COMMANDS = {
    "claim": "make claim",
    "rivals": "make rivals",
    "special_cases": "make special-cases",
    "faults": "make faults",
}


@dataclass(frozen=True)
class Study:
    """A picture as an image that needs no other file."""

    name: str
    source: str
    caption: str


@dataclass(frozen=True)
class Studies:
    """What was found; None where a command has not run on today's C.

    Attributes:
        claim: of :mod:`verification.claim`.
        claim_pictures: of the same.
        rivals: of :mod:`verification.rivals`.
        rivals_picture: of the same.
        special_cases: of :mod:`verification.special_cases`.
        faults: of :mod:`verification.faults`.
        faults_picture: of the same.
    """

    claim: dict[str, Any] | None
    claim_pictures: tuple[Study, ...]
    rivals: dict[str, Any] | None
    rivals_picture: Study | None
    special_cases: dict[str, Any] | None
    faults: dict[str, Any] | None
    faults_picture: Study | None

    @property
    def missing(self) -> tuple[str, ...]:
        """The commands that have not run on today's C."""
        return tuple(c for name, c in _COMMANDS.items() if getattr(self, name) is None)


NOTHING = Studies(None, (), None, None, None, None, None)


def found(folder: Path = RESULTS) -> Studies:
    """What there is in a folder of results."""
    claim, rivals, special, faults = (current_json(folder / f"{name}.json") for name in _COMMANDS)
    pictures = [
        _study(folder / "claim" / f"{name}.svg", caption)
        for name, caption in CLAIM_PICTURES.items()
    ]
    caption = "Mean RMS error on plants that none of them was tuned on; smaller is better."
    around = (
        "A joint's error and torque around a fault, at the paper's speed with LuGre friction: "
        "without guards, as shipped, with a tight limit. Grey: while the fault lasts."
    )
    return Studies(
        claim,
        tuple(picture for picture in pictures if claim and picture),
        rivals,
        _study(folder / "rivals.svg", caption) if rivals else None,
        special,
        faults,
        _study(folder / "faults.svg", around) if faults else None,
    )


def _study(path: Path, caption: str) -> Study | None:
    """A picture as a data address."""
    if not path.is_file():
        return None
    encoded = base64.b64encode(path.read_bytes()).decode("ascii")
    return Study(path.stem.replace("_", "-"), f"data:image/svg+xml;base64,{encoded}", caption)
