"""Fixtures of the plant's tests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

REFERENCE = Path(__file__).parents[1] / "data" / "puma560_reference.json"


@pytest.fixture(scope="session")
def published() -> dict[str, Any]:
    """Published PUMA 560 parameters with M, C, g and tau of an independent library."""
    data: dict[str, Any] = json.loads(REFERENCE.read_text(encoding="utf-8"))
    return data
