"""Damaged robots, scenarios and campaigns: read, or refused in words; nothing else is raised."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings

import plant
from codegen.problems import SpecificationError
from plant.campaign import specification as campaigns
from plant.robot import RobotError, read_robot_file
from plant.scenario import read_scenario
from tests.damaged_toml import UNREADABLE, damaged_files

ROOM = Path(plant.__file__).parent
FEW = settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=(HealthCheck.too_slow, HealthCheck.function_scoped_fixture),
)


def texts(folder: str) -> list[bytes]:
    return [path.read_bytes() for path in sorted((ROOM / folder).glob("*.toml"))]


def refusal(read: Callable[[Path], object], folder: Path, content: bytes) -> str | None:
    """None where the file is read, else what is said of it."""
    path = folder / "robot.toml"
    path.write_bytes(content)
    try:
        read(path)
    except (RobotError, SpecificationError) as error:
        return str(error)
    return None


@FEW
@given(content=damaged_files(texts("robots")))
def test_a_damaged_robot(tmp_path: Path, content: bytes) -> None:
    says = refusal(read_robot_file, tmp_path, content)
    assert says is None or says.startswith("robot.toml: ")


@FEW
@given(content=damaged_files(texts("scenarios")))
def test_a_damaged_scenario(tmp_path: Path, content: bytes) -> None:
    assert refusal(read_scenario, tmp_path, content) != ""


@FEW
@given(content=damaged_files(texts("campaigns")))
def test_a_damaged_campaign(tmp_path: Path, content: bytes) -> None:
    assert refusal(campaigns.read, tmp_path, content) != ""


@pytest.mark.parametrize("content", UNREADABLE.values(), ids=UNREADABLE.keys())
@pytest.mark.parametrize("read", [read_robot_file, read_scenario, campaigns.read])
def test_what_is_no_toml_is_called_so(
    tmp_path: Path, read: Callable[[Path], object], content: bytes
) -> None:
    says = refusal(read, tmp_path, content)
    assert says is not None
    assert "robot.toml" in says
    assert "valid TOML" in says
