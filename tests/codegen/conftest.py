"""What the tests of the generated C share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from codegen.controller import Controller, read, resolve
from codegen.emit import generate, write

ROOT = Path(__file__).parents[2]
CONTROLLERS = ROOT / "controllers"
GENERATED = ROOT / "generated"

Variant = dict[str, Any]
"""Keys of ``[law]`` and ``[drive]`` that change the structure of the law."""

VARIANTS: dict[str, Variant] = {
    "paper": {},
    "error-difference": {"velocity_error": "error-difference"},
    "half-sample": {"velocity_error": "half-sample"},
    "delayed": {"acceleration": "delayed"},
    "low-pass": {"low_pass_rad_per_s": 300},
    "torque-report": {"reports_torque": True},
    "all": {
        "velocity_error": "half-sample",
        "acceleration": "delayed",
        "low_pass_rad_per_s": 300,
        "reports_torque": True,
    },
}


def variant(name: str) -> Controller:
    """The three-joint controller with another structure of the law."""
    data = read(CONTROLLERS / "puma3.toml")
    keys = dict(VARIANTS[name])
    data["drive"] = {"reports_torque": keys.pop("reports_torque", False)}
    data["law"] |= keys
    return resolve(data)


@pytest.fixture(scope="session")
def variant_sources(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The directory with a variant's C, generated once."""
    made: dict[str, Path] = {}

    def sources(name: str) -> Path:
        if name not in made:
            made[name] = write(generate(variant(name)), tmp_path_factory.mktemp(name))
        return made[name]

    return sources
