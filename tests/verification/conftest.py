"""What the tests of the verification share; closed loops are flown once a session."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from verification.experiments import (
    FASTER,
    FIGURE_5,
    SIX_JOINTS,
    Experiment,
    Outcome,
    conduct_all,
)


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "closed_loop: flies the generated C on the simulated plant")


@pytest.fixture(scope="session")
def outcomes() -> Mapping[Experiment, Outcome]:
    """The rows of Fig. 5, Exp08 with more speed, and six joints."""
    return conduct_all((*FIGURE_5, FASTER, SIX_JOINTS))
