"""Eigenvalues of M(q)^-1 Mbar over the workspace, against Pinocchio and damaged certificates."""

from __future__ import annotations

import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from codegen.controller import load
from plant.model import build_model
from plant.robot import Robot, load_robot
from verification import __main__ as command_line
from verification.experiments import CONTROLLERS
from verification.workspace import check
from verification.workspace.certify import Certified, WorkspaceError, certified_eigenvalues

MBAR = [joint.inertia for joint in load(CONTROLLERS / "puma3.toml").joints]
LOOSE = 0.005
"""How much wider than the samples the bounds may be, relative."""


@pytest.fixture(scope="module")
def akb() -> Robot:
    return load_robot("puma560_akb", lock_wrist=True)


@pytest.fixture(scope="module")
def certified(akb: Robot) -> Certified:
    return certified_eigenvalues(akb, MBAR)


def _eigenvalues(robot: Robot, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of M(q)^-1 Mbar by Pinocchio and a general eigenvalue solver."""
    model = build_model(robot)
    data = model.createData()
    Mbar = np.diag([float(x) for x in MBAR])
    found = [np.linalg.eigvals(np.linalg.solve(pin.crba(model, data, x), Mbar)) for x in q]
    return np.real(np.array(found))


def _turning(posture: NDArray[np.float64]) -> NDArray[np.float64]:
    """Joint positions with any first one."""
    first = np.random.default_rng(1).uniform(-3, 3, len(posture))
    return np.column_stack([first, posture])


@pytest.mark.parametrize("name", ["reference", "puma560", "puma560_akb"])
def test_the_bounds_hold_every_sample_and_are_tight(name: str) -> None:
    robot = load_robot(name, lock_wrist=name != "reference")
    found = certified_eigenvalues(robot, MBAR)
    assert found.complaints == ()
    grid = np.linspace(-np.pi, np.pi, 90)
    values = _eigenvalues(robot, _turning(np.stack(np.meshgrid(grid, grid), -1).reshape(-1, 2)))
    assert float(found.low) < values.min() < float(found.low) * (1 + LOOSE)
    assert float(found.high) * (1 - LOOSE) < values.max() < float(found.high)
    assert found.holds_33
    assert float(found.largest_scaling) == pytest.approx(2 / float(found.high), rel=1e-5)
    assert found.largest_scaling <= 2 / found.high


def test_within_the_joint_ranges_the_bounds_are_narrower() -> None:
    robot = load_robot("puma560", lock_wrist=True)
    inside, anywhere = (
        certified_eigenvalues(robot, MBAR, within_ranges=ranges) for ranges in (True, False)
    )
    assert inside.proved
    assert anywhere.low <= inside.low
    assert inside.high <= anywhere.high
    low, high = np.deg2rad([link.range_deg or (0, 0) for link in robot.chain[1:3]]).T
    q = low + (high - low) * np.random.default_rng(2).uniform(size=(4000, 2))
    values = _eigenvalues(robot, _turning(q))
    assert float(inside.low) < values.min()
    assert values.max() < float(inside.high)
    assert inside.certificate["range_turns"] == [["-1/8", "5/8"], ["-5/8", "1/8"]]


def test_a_condition_that_fails_is_not_certified(akb: Robot, certified: Certified) -> None:
    just_below, above = (
        certified_eigenvalues(akb, [x * certified.largest_scaling * factor for x in MBAR])
        for factor in (Fraction(99, 100), Fraction(101, 100))
    )
    assert just_below.holds_33
    assert above.proved
    assert not above.holds_33
    assert above.sampled.high > 2


def test_the_checker_knows_the_inertia_matrix(akb: Robot, certified: Certified) -> None:
    """Its M(q), by kinetic energy, on boxes that are a point, against Pinocchio's."""
    model = build_model(akb)
    links = [check._link(row, k) for k, row in enumerate(certified.certificate["robot"])]
    random = np.random.default_rng(3)
    for _ in range(5):
        position = [Fraction(int(k), 1000) for k in random.integers(0, 1000, 2)]
        turns = {i + 1: check._cosine_and_sine([x], [x], i) for i, x in enumerate(position)}
        M = check._inertia_matrix(links, turns)
        q = np.array([0.0, *(2 * np.pi * float(x) for x in position)])
        expected = pin.crba(model, model.createData(), q)
        for i in range(3):
            for j in range(i + 1):
                entry = M[i][j]
                assert entry is not None
                np.testing.assert_allclose(entry.center.low, expected[i, j], atol=1e-12)
                assert np.all(entry.center.low <= entry.center.high)
                assert np.all(entry.center.high - entry.center.low < 1e-12)


def test_slopes_of_the_checker_enclose_those_of_the_inertia_matrix(certified: Certified) -> None:
    """The mean value form on a wide box, against M at points of it."""
    links = [check._link(row, k) for k, row in enumerate(certified.certificate["robot"])]
    low, high = [Fraction(1, 10), Fraction(3, 5)], [Fraction(3, 20), Fraction(7, 10)]
    on = check._inertia_matrix(
        links,
        {i + 1: check._cosine_and_sine([low[i]], [high[i]], i) for i in range(2)},
    )
    for u in np.random.default_rng(4).uniform(0, 1, (20, 2)):
        at = [a + (b - a) * Fraction(float(x)) for a, b, x in zip(low, high, u, strict=True)]
        M = check._inertia_matrix(
            links, {i + 1: check._cosine_and_sine([at[i]], [at[i]], i) for i in range(2)}
        )
        for i in range(3):
            for j in range(i + 1):
                wide, exact = on[i][j], M[i][j]
                assert wide is not None
                assert exact is not None
                assert wide.box.low.item() <= exact.center.low.item()
                assert exact.center.high.item() <= wide.box.high.item()
                for c in wide.slopes:
                    assert wide.slopes[c].low.item() <= exact.slopes[c].low.item() + 1e-12
                    assert exact.slopes[c].high.item() <= wide.slopes[c].high.item() + 1e-12


def test_slopes_of_sines_and_cosines() -> None:
    at = [Fraction(1, 12)]  # 30 degrees
    cosine, sine = check._cosine_and_sine(at, at, 0)
    assert cosine.slopes[0].low.item() == pytest.approx(-0.5, abs=1e-12)
    assert sine.slopes[0].low.item() == pytest.approx(np.sqrt(0.75), abs=1e-12)


def test_a_box_is_not_definite_for_its_centre_alone(akb: Robot, certified: Certified) -> None:
    """The largest eigenvalue at a corner is above r, that at the centre below."""
    links = [check._link(row, k) for k, row in enumerate(certified.certificate["robot"])]
    ranges, wide = [(Fraction(0), Fraction(1))] * 2, 2 * np.pi / 2**6
    refused = 0
    for k in range(0, 64, 3):
        start = np.array([k, k]) * wide
        ends = [start, start + wide]
        corners = np.array([[a[0], b[1]] for a in ends for b in ends])
        center, highest = (
            _eigenvalues(akb, _turning(q)).max() for q in ((start + wide / 2)[np.newaxis], corners)
        )
        if highest > center * (1 + 1e-6):
            r = Fraction(float(center + highest) / 2)
            assert not check._definite(links, MBAR, ranges, [((k, 6), (k, 6))], r, 1).any()
            refused += 1
    assert refused > 10


# --- Damaged certificates ----------------------------------------------------------------------

Damage = Callable[[dict[str, Any]], None]


def _set(path: tuple[Any, ...], value: Any) -> Damage:
    def damage(certificate: dict[str, Any]) -> None:
        place = certificate
        for key in path[:-1]:
            place = place[key]
        assert place[path[-1]] != value
        place[path[-1]] = value

    return damage


def _scaled(path: tuple[Any, ...], factor: Fraction) -> Damage:
    def damage(certificate: dict[str, Any]) -> None:
        place = certificate
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = str(Fraction(place[path[-1]]) * factor)

    return damage


def _without(path: tuple[Any, ...]) -> Damage:
    def damage(certificate: dict[str, Any]) -> None:
        place = certificate
        for key in path[:-1]:
            place = place[key]
        del place[path[-1]]

    return damage


def _box(side: str, place: int, coordinate: int, value: list[Any]) -> Damage:
    return _set((side, "boxes", place, coordinate), value)


LINK = ("parent", "rotation", "offset_m", "axis", "mass_kg", "center_of_mass_m")
DAMAGES: dict[str, Damage] = {
    **{f"without {key}": _without((key,)) for key in ("robot", "inertia_kgm2", "range_turns")},
    **{f"without {side}": _without((side,)) for side in ("low", "high")},
    **{f"link without {key}": _without(("robot", 1, key)) for key in LINK},
    **{
        f"{side}: box {k} is missing": _without((side, "boxes", k))
        for side in ("low", "high")
        for k in (0, 1, 7, 100, 200, -1)
    },
    **{
        f"{side}: box {k} is elsewhere": _box(side, k, c, [0, 40])
        for side in ("low", "high")
        for k in (3, -2)
        for c in (0, 1)
    },
    "low too large": _scaled(("low", "r"), Fraction(101, 100)),
    "high too small": _scaled(("high", "r"), Fraction(99, 100)),
    "low a little too large": _scaled(("low", "r"), Fraction(1004, 1000)),
    "high a little too small": _scaled(("high", "r"), Fraction(996, 1000)),
    "low negative": _set(("low", "r"), "-1"),
    "low zero": _set(("low", "r"), "0"),
    "high is a float": _set(("high", "r"), 0.2),
    "high has an exponent": _set(("high", "r"), "1e9999"),
    "high divides by zero": _set(("high", "r"), "1/0"),
    "high is NaN": _set(("high", "r"), "nan"),
    "another entry": _set(("high", "boxes", 0), "all"),
    **{
        f"Mbar {i + 1} times {factor}": _scaled(("inertia_kgm2", i), Fraction(factor))
        for i in range(3)
        for factor in (-1, 0)
    },
    "all Mbar larger": lambda c: c.update(
        inertia_kgm2=[str(Fraction(x) * Fraction(102, 100)) for x in c["inertia_kgm2"]]
    ),
    "all Mbar smaller": lambda c: c.update(
        inertia_kgm2=[str(Fraction(x) * Fraction(98, 100)) for x in c["inertia_kgm2"]]
    ),
    "one Mbar too few": _without(("inertia_kgm2", 0)),
    "heavier upper arm": _scaled(("robot", 1, "mass_kg"), Fraction(2)),
    "heavier forearm": _scaled(("robot", 2, "mass_kg"), Fraction(2)),
    "negative mass": _scaled(("robot", 2, "mass_kg"), Fraction(-1)),
    "no rotor at joint 1": _set(("robot", 0, "armature_kgm2"), "0"),
    "no rotor at joint 2": _set(("robot", 1, "armature_kgm2"), "0"),
    "no rotor at joint 3": _set(("robot", 2, "armature_kgm2"), "0"),
    "longer upper arm": _scaled(("robot", 2, "offset_m", 0), Fraction(2)),
    "not symmetric": _set(("robot", 1, "inertia_kgm2", 0, 1), "1"),
    "no rotation": _set(("robot", 1, "rotation", 0, 0), "2"),
    "a reversed inertia": _set(("robot", 2, "inertia_kgm2", 1, 1), "-5"),
    "axis of no length": _set(("robot", 1, "axis"), ["0", "0", "0"]),
    "axis too long": _set(("robot", 1, "axis", 2), "2"),
    "axis in the plane": _set(("robot", 1, "axis"), ["1", "0"]),
    "parent of itself": _set(("robot", 1, "parent"), 1),
    "two arms": _set(("robot", 1, "parent"), -1),
    "parent that is true": _set(("robot", 1, "parent"), True),
    "one joint less": _without(("robot", 2)),
    "no range": _set(("range_turns",), []),
    "empty range": _set(("range_turns", 0), ["0", "0"]),
    "range turned around": _set(("range_turns", 0), ["1", "0"]),
    "huge range": _set(("range_turns", 1), ["-1000000", "1000000"]),
    "no box": _set(("high", "boxes"), []),
    "one box": _set(("high", "boxes"), [[[0, 0], [0, 0]]]),
    "flat box": _set(("low", "boxes", 0), [[0, 3]]),
    "outside box": _set(("low", "boxes", 0, 0), [8, 3]),
    "negative box": _set(("low", "boxes", 0, 0), [-1, 3]),
    "too fine box": _set(("low", "boxes", 0, 0), [0, 4000]),
    "box of texts": _set(("low", "boxes", 0, 0), ["0", 3]),
}


def test_there_are_enough_damages() -> None:
    assert len(DAMAGES) >= 50


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES.keys())
def test_a_damaged_certificate_is_refused(damage: Damage, certified: Certified) -> None:
    certificate = json.loads(json.dumps(certified.certificate))
    damage(certificate)
    assert list(check.complaints(certificate))


@pytest.mark.parametrize("side", ["low", "high"])
def test_a_bound_that_is_wrong_only_between_the_centres_is_refused(
    side: str, certified: Certified
) -> None:
    """At the centres of the boxes all is well: only their width tells."""
    certificate = json.loads(json.dumps(certified.certificate))
    inward = Fraction(1, 10**7) * (1 if side == "low" else -1)
    certificate[side]["r"] = str(Fraction(getattr(certified.sampled, side)) * (1 + inward))
    assert list(check.complaints(certificate))


def test_a_certificate_survives_its_file(certified: Certified, tmp_path: Path) -> None:
    path = tmp_path / "certificate.json"
    path.write_text(json.dumps(certified.certificate), encoding="utf-8")
    assert check.main([str(path)]) == 0
    path.write_text("{}", encoding="utf-8")
    assert check.main([str(path)]) == 1
    path.write_text("not JSON", encoding="utf-8")
    assert check.main([str(path)]) == 2


# --- The command -------------------------------------------------------------------------------


def test_the_command_answers_in_json(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "certificate.json"
    arguments = ["workspace", "--robot", "reference", "--json", "--certificate", str(path)]
    assert command_line.main(arguments) == 0
    said = json.loads(capsys.readouterr().out)
    low, high = said["eigenvalues"]
    assert 0 < low < high < 2
    assert said["holds_33"] is True
    assert said["largest_scaling"] == pytest.approx(2 / high, rel=1e-5)
    assert said["evidence"] == "proved"
    assert check.main([str(path)]) == 0


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--robot", "puma560"], "Mbar has 3 joints, puma560 has 6"),
        (["--robot", "ur5", "--controller", str(CONTROLLERS / "puma6.toml")], "at most 3"),
        (["--robot", "reference", "--certificate", "/nowhere/at/all.json"], "can't be written"),
    ],
)
def test_bad_input_names_cause_and_fix(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command_line.main(["workspace", *arguments]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_mbar_must_be_positive(akb: Robot, bad: float) -> None:
    with pytest.raises(WorkspaceError, match="must be > 0"):
        certified_eigenvalues(akb, [0.1, bad, 0.1])
