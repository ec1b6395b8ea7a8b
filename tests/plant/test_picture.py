"""Pictures of runs: their data and marks; and that the page about the plant is complete."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from plant.flight import Flight, fly
from plant.picture import PictureError, draw, save
from plant.scenario import Event, Scenario

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly(REPOSITORY / "controllers" / "puma3.toml", speed=3.0, backend="compiled")


def test_the_picture_shows_the_run_and_its_extremes(flight: Flight) -> None:
    figure = draw(flight)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["reference [deg]", "error by the encoder [deg]", "applied torque [N m]"]
    assert figure.axes[-1].get_xlabel() == "time [s]"
    errors = np.rad2deg(flight.run.error_rad)
    for joint, line in enumerate(figure.axes[1].lines):
        drawn = np.asarray(line.get_ydata())
        assert drawn.max() == errors[: 2 * (len(errors) // 2), joint].max()
        assert len(drawn) <= 4000
    assert [line.get_label() for line in figure.axes[1].lines] == ["waist", "shoulder", "elbow"]


def test_events_are_marked_when_they_happen(flight: Flight) -> None:
    events = [
        {"kind": "missed-ticks", "at_s": 1.0, "duration_s": 0.5},
        {"kind": "encoder-jump", "at_s": 2.0, "counts": 1},
        {"kind": "encoder-noise", "sigma_counts": 0.1},
    ]
    figure = draw(flight, Scenario.model_validate({"events": events}))
    assert [text.get_text().strip() for text in figure.axes[0].texts] == [
        "missed-ticks",
        "encoder-jump",
    ]
    assert all(len(axes.patches) == 1 for axes in figure.axes)


def test_a_picture_that_cannot_be_written_says_why(flight: Flight, tmp_path: Path) -> None:
    figure = draw(flight)
    save(figure, tmp_path / "run.svg")
    assert "<dc:date>" not in (tmp_path / "run.svg").read_text(encoding="utf-8")
    for name in ("run.txt", "nowhere/run.svg"):
        with pytest.raises(PictureError, match=r"picture .*run"):
            save(figure, tmp_path / name)


def test_the_page_about_the_plant_names_every_event_and_key() -> None:
    page = (REPOSITORY / "docs" / "the-plant.md").read_text(encoding="utf-8")
    _, page = page.split("| `kind` |")
    rows = dict(re.findall(r"^\| `([a-z-]+)` \| (.*?) \|", page, flags=re.MULTILINE))
    common = {"kind", "at_s", "duration_s"}
    events = get_args(get_args(Event)[0])
    kinds = {k: event for event in events for k in get_args(event.model_fields["kind"].annotation)}
    assert rows.keys() == kinds.keys()
    for kind, event in kinds.items():
        assert set(re.findall(r"`(\w+)`", rows[kind])) == set(event.model_fields) - common
