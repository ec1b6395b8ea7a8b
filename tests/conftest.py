"""What all tests share."""

from __future__ import annotations

import pytest

TOGETHER = (
    "bench/",
    "package/",
    "repository/test_your_own_robot.py",
    "verification/test_claim.py",
    "verification/test_figures.py",
    "verification/test_playground.py",
    "verification/test_report.py",
    "verification/test_rivals.py",
    "verification/test_special_cases.py",
    "verification/test_table2.py",
)
"""Folders and files whose tests share what takes long to make: one process does all of each."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Groups the tests for ``--dist loadgroup``."""
    for item in items:
        for group in TOGETHER:
            if f"tests/{group}" in item.path.as_posix():
                item.add_marker(pytest.mark.xdist_group(group))
