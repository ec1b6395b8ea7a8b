"""Table II on the plants: figures against numbers worked out here, and what is promised of them."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from verification.__main__ import main
from verification.paper import table_2
from verification.table2.fly import PLANTS, TableOf, TablePlant, _table, figures, fly_table
from verification.table2.present import summary, table_of

REFERENCE = PLANTS[0]
PAPER = {row: np.array(x.rms_deg) for row, x in table_2().items()}


@pytest.fixture(scope="module")
def flown() -> TableOf:
    """The whole table on the reference plant."""
    (table,) = fly_table([REFERENCE], phases=2)
    return table


def test_the_reference_plant_reproduces_the_table(flown: TableOf) -> None:
    assert [row.exp for row in flown.rows] == list(PAPER)
    assert min(flown.spearman) >= 0.98
    assert flown.worst_factor <= 1.5
    assert flown.best == ("Exp08", "Exp08", "Exp08")
    assert flown.outside == ()


def test_figures_are_those_of_the_definitions(flown: TableOf) -> None:
    told = figures([flown])["plants"]["reference"]
    rms = {row["exp"]: np.array(row["rms_deg"]) for row in told["rows"]}
    for row in told["rows"]:
        mine = rms[row["exp"]]
        np.testing.assert_allclose(row["factor"], mine / PAPER[row["exp"]])
        percent = 100.0 * (mine - rms["Exp08"]) / rms["Exp08"]
        np.testing.assert_allclose(row["difference_percent"], percent, atol=1e-9)
    for name in ("01/08", "02/08", "05/08", "13/08"):
        np.testing.assert_allclose(told["ratios"][name], rms[f"Exp{name[:2]}"] / rms["Exp08"])
        paper = PAPER[f"Exp{name[:2]}"] / PAPER["Exp08"]
        np.testing.assert_allclose(told["paper_ratios"][name], paper)


def _made(errors: dict[str, np.ndarray]) -> TableOf:
    return _table(REFERENCE, dict(errors), 1)


def test_the_paper_itself_would_be_perfect() -> None:
    table = _made(PAPER)
    assert table.worst_factor == 1.0
    np.testing.assert_allclose(table.spearman, 1.0)


def test_a_wrong_cell_is_seen() -> None:
    errors = {row: rms.copy() for row, rms in PAPER.items()}
    errors["Exp03"][1] *= 1.0 / 1.6
    errors["Exp05"][2] *= 1.7
    errors["Exp04"][0] = 0.5 * errors["Exp08"][0]
    table = _made(errors)
    assert [cell[:2] for cell in table.outside] == [("Exp03", 2), ("Exp04", 1), ("Exp05", 3)]
    assert math.isclose(table.worst_factor, 3.8)
    assert table.best == ("Exp04", "Exp08", "Exp08")
    # By hand: two rows change places on joint 1 by that, of which the ranks say so.
    assert table.spearman[0] < 1.0


def test_a_row_that_fails_is_told_and_left_out() -> None:
    errors: dict[str, np.ndarray | str] = dict(PAPER)
    table = _table(REFERENCE, errors | {"Exp13": "the motion became non-finite"}, 1)
    assert table.worst_factor == math.inf
    np.testing.assert_allclose(table.spearman, 1.0)
    assert "13/08" not in table.ratios
    console = Console(record=True, width=200)
    console.print(table_of(table))
    assert "the motion became non-finite" in console.export_text()
    # Without Exp08 nothing can be compared with it, and all the rest is still told.
    table = _table(REFERENCE, errors | {"Exp08": "diverged"}, 1)
    assert table.ratios == {}
    assert all(row.difference_percent is None for row in table.rows)
    assert summary(table)


def test_the_command_leaves_its_figures(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["table2", "--plant", "flexible", "--phases", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["plants"]["flexible"]
    assert told["evidence"] == "measured"
    assert len(told["rows"]) == 13
    with pytest.raises(SystemExit):
        main(["table2", "--phases", "0"])


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.name)
def test_every_plant_is_there(plant: TablePlant) -> None:
    repository = Path(__file__).parents[2]
    assert (repository / "controllers" / f"{plant.controller}.toml").is_file()
    assert (repository / "plant" / "robots" / f"{plant.robot}.toml").is_file()
