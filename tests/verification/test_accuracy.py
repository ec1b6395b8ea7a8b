"""Table II in every arithmetic: the figures are means over runs that differ in the encoders."""

from __future__ import annotations

import numpy as np
import pytest

from verification.accuracy import ARITHMETICS, REFERENCE, Accuracy, fly_at_phases, measure


@pytest.fixture(scope="module")
def result() -> Accuracy:
    return measure(rows=("Exp08", "Exp13"), phases=2)


def test_the_choice_of_numbers_hardly_shows(result: Accuracy) -> None:
    """Two phases: chaos at the level of counts leaves about a per cent."""
    assert [(c.row, c.controller) for c in result.cells] == [
        (row, name) for row in ("Exp08", "Exp13") for name in ARITHMETICS
    ]
    assert set(result.largest_difference) == set(ARITHMETICS)
    assert result.largest_difference[REFERENCE] == 0.0
    assert 0.0 < max(result.largest_difference.values()) < 0.03


def test_a_cell_is_the_mean_of_its_runs(result: Accuracy) -> None:
    cell = next(c for c in result.cells if (c.row, c.controller) == ("Exp08", "puma3_fixed"))
    runs = fly_at_phases("Exp08", "puma3_fixed", 2)
    assert runs.shape == (2, 3)
    assert np.array_equal(runs.mean(axis=0), cell.rms_deg)
    # Another phase of the encoders is another run.
    assert not np.array_equal(runs[0], runs[1])
