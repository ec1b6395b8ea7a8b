"""Eigenvalues of M(q)^-1 Mbar over the workspace, against Pinocchio and damaged certificates."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import scipy.optimize
from numpy.typing import NDArray

from codegen.controller import load
from plant.model import build_model
from plant.robot import Robot, load_robot
from verification import __main__ as command_line
from verification.experiments import CONTROLLERS
from verification.workspace import certify, check
from verification.workspace.certify import Certified, WorkspaceError, certified_eigenvalues

MBAR, MBAR_6 = (
    [joint.inertia for joint in load(CONTROLLERS / f"{name}.toml").joints]
    for name in ("puma3", "puma6")
)
LOOSE = 0.005
"""How much wider than the samples the bounds may be, relative."""


@pytest.fixture(scope="module")
def akb() -> Robot:
    return load_robot("puma560_akb", lock_wrist=True)


@pytest.fixture(scope="module")
def certified(akb: Robot) -> Certified:
    return certified_eigenvalues(akb, MBAR)


@pytest.fixture(scope="module")
def six() -> Certified:
    return certified_eigenvalues(load_robot("puma560"), MBAR_6)


def _eigenvalues(
    robot: Robot, q: NDArray[np.float64], Mbar: Sequence[Fraction | float] = MBAR
) -> NDArray[np.float64]:
    """Of M(q)^-1 Mbar by Pinocchio and a general eigenvalue solver."""
    model = build_model(robot)
    data = model.createData()
    diagonal = np.diag([float(x) for x in Mbar])
    found = [np.linalg.eigvals(np.linalg.solve(pin.crba(model, data, x), diagonal)) for x in q]
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
    assert found.tight
    assert found.holds_33
    assert float(found.largest_scaling) == pytest.approx(2 / float(found.high), rel=1e-5)
    assert found.largest_scaling <= 2 / found.high


def test_six_joints_are_bounded_tightly(six: Certified) -> None:
    """By random postures, and by those of an optimizer that starts at the outermost of them."""
    robot = load_robot("puma560")
    assert six.complaints == ()
    assert six.tight
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (3000, 6))
    values = _eigenvalues(robot, q, MBAR_6)
    assert float(six.low) < values.min()
    assert values.max() < float(six.high)
    for sign, start, bound in (
        (1, q[values.min(axis=1).argmin()], six.low),
        (-1, q[values.max(axis=1).argmax()], six.high),
    ):

        def outermost(x: NDArray[np.float64], sign: int = sign) -> float:
            return float(np.min(sign * _eigenvalues(robot, x[np.newaxis], MBAR_6)))

        best = sign * scipy.optimize.minimize(outermost, start, method="Powell").fun
        assert 0 < sign * (best / float(bound) - 1) < LOOSE


def test_a_budget_that_is_spent_gives_a_coarser_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = load_robot("z1")
    told: list[int] = []
    Mbar = [0.06, 0.13, 0.04, 0.015, 0.016, 0.012]
    monkeypatch.setattr(certify, "_WORK", 2000)
    found = certified_eigenvalues(robot, Mbar, advance=told.append)
    assert found.proved
    assert not found.tight
    assert sum(told) == certify.STAGES
    q = np.random.default_rng(6).uniform(-np.pi, np.pi, (2000, 6))
    values = _eigenvalues(robot, q, Mbar)
    assert float(found.low) < values.min()
    assert values.max() < float(found.high)
    low, high = found.pessimism
    assert float(found.low) * (1 + low) == pytest.approx(found.sampled.low)
    assert float(found.high) / (1 + high) == pytest.approx(found.sampled.high)
    # Above, only the rotors' inertia is left, which is a bound for every arm that has rotors.
    assert found.certificate["high"]["boxes"] == []
    rotors = max(x / a for x, a in zip(Mbar, build_model(robot).armature, strict=True))
    assert float(found.high) == pytest.approx(rotors, rel=1e-4)


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


# --- The checker's parts -----------------------------------------------------------------------


def _links(certified: Certified) -> list[check._Link]:
    return [check._link(row, k) for k, row in enumerate(certified.certificate["robot"])]


@pytest.mark.parametrize(("name", "wrist"), [("puma560_akb", True), ("puma560", False)])
def test_the_checker_knows_the_inertia_matrix(
    name: str, wrist: bool, certified: Certified, six: Certified
) -> None:
    """Its M(q), by kinetic energy and as a sum of waves, against Pinocchio's."""
    model = build_model(load_robot(name, lock_wrist=wrist))
    n = model.nv
    waves = check._waves(_links(certified if wrist else six), n - 1)
    assert np.all(waves.noise >= 2.0**-29 * waves.sizes.sum(axis=tuple(range(n - 1))))
    assert np.all(waves.noise < 1e-7)
    for _ in range(5):
        turns = [Fraction(int(k), 1000) for k in np.random.default_rng(3).integers(0, 1000, n - 1)]
        M = check._at(waves.coefficients, [check._basis([x])[np.newaxis] for x in turns])
        q = np.array([0.0, *(2 * np.pi * float(x) for x in turns)])
        expected = pin.crba(model, model.createData(), q)
        difference = np.abs(M[0, 0] - expected[np.tril_indices(n)])
        assert np.all(difference < 1e-3 * waves.noise + 1e-13)


def test_sizes_are_those_of_the_fourier_coefficients(six: Certified) -> None:
    """By a fast Fourier transform over finer samples of Pinocchio's M, joints 4 to 6 at 0."""
    model = build_model(load_robot("puma560"))
    data, x = model.createData(), np.arange(8) * 2 * np.pi / 8
    M = np.array([[pin.crba(model, data, np.array([0, a, b, 0, 0, 0])) for b in x] for a in x])
    coefficients = np.fft.fft2(M, axes=(0, 1)) / 64
    sizes = np.abs(coefficients)[..., *np.tril_indices(6)]
    for high in range(3, 6):
        assert np.all(sizes[high] < 1e-12)
    folded = np.array([sizes[0], sizes[1] + sizes[-1], sizes[2] + sizes[-2]])
    folded = np.stack([folded[:, 0], folded[:, 1] + folded[:, -1], folded[:, 2] + folded[:, -2]], 1)
    waves = check._waves(_links(six), 5)
    # A wave of the wrist's joints counts in full in the one, with its phase at 0 in the other.
    whole = waves.sizes.sum(axis=(2, 3, 4))
    assert np.all(folded <= whole + 1e-9)
    assert np.allclose(folded[..., 0], whole[..., 0], atol=0.05)
    plain = check._waves(_links(certified_eigenvalues(load_robot("reference"), MBAR)), 2)
    model = build_model(load_robot("reference"))
    data = model.createData()
    M = np.array([[pin.crba(model, data, np.array([0, a, b])) for b in x] for a in x])
    sizes = np.abs(np.fft.fft2(M, axes=(0, 1)) / 64)[..., *np.tril_indices(3)]
    folded = np.array([sizes[0], sizes[1] + sizes[-1], sizes[2] + sizes[-2]])
    folded = np.stack([folded[:, 0], folded[:, 1] + folded[:, -1], folded[:, 2] + folded[:, -2]], 1)
    np.testing.assert_allclose(plain.sizes, folded, atol=1e-10)


@pytest.mark.parametrize("t", [0.05, 0.3, 0.8, 1.6, 3.1, 6.3])
def test_waves_are_off_by_no_more_than_said(t: float) -> None:
    """On a fine grid; and not by much less, for a parabola on a small box."""
    x = np.linspace(-1, 1, 2001)
    wave, at = np.exp(1j * t * x), np.exp(1j * t * np.array([-1, 0, 1]))
    parabola = at[0] * x * (x - 1) / 2 + at[1] * (1 - x**2) + at[2] * x * (x + 1) / 2
    worst = np.abs(wave - parabola).max()
    assert worst <= check._wrong(np.array(t), True)
    assert np.abs(wave - 1).max() <= check._wrong(np.array(t), False)
    if t < 1:
        assert worst > 0.9 * check._wrong(np.array(t), True)


def test_a_parabola_is_within_its_control_values() -> None:
    """Bernstein's weights (1-u)^2, 2u(1-u), u^2 of the control values give the parabola."""
    ends = Fraction(1, 10), Fraction(7, 10)
    center, control, _ = check._sides(ends, [(1, 1), (1, 1)])
    u = np.linspace(0, 1, 11)
    weights = np.stack([(1 - u) ** 2, 2 * u * (1 - u), u**2])
    values = control[1].T @ weights
    low, high = 2 * np.pi * 0.4, 2 * np.pi * 0.7
    nodes = np.array([low, (low + high) / 2, high])
    for wave, at in enumerate((np.ones(3), np.cos(nodes), np.sin(nodes))):
        through = np.polynomial.Polynomial.fit(nodes, at, 2)
        np.testing.assert_allclose(values[wave], through(low + (high - low) * u), atol=1e-12)
    np.testing.assert_allclose(center[0, 0, 1], np.cos((low + high) / 2), atol=1e-15)


def test_a_box_is_definite_only_where_its_postures_are(six: Certified) -> None:
    """Random boxes and bounds: what is accepted holds in the box, what fails in it is refused."""
    robot = load_robot("puma560")
    waves, ranges = check._waves(_links(six), 5), [(Fraction(0), Fraction(1))] * 5
    random = np.random.default_rng(8)
    verdicts = []
    for _ in range(60):
        p = random.integers(0, 6, 5)
        box = tuple((int(random.integers(0, 2**x)), int(x)) for x in p)
        low, width = np.array([k / 2**x for k, x in box]), 0.5**p
        u = random.uniform(0, 1, (40, 5))
        values = _eigenvalues(robot, _turning(2 * np.pi * (low + width * u)), MBAR_6)
        for sign, worst in ((1, values.max()), (-1, values.min())):
            for factor in (0.9999, 1.002, 1.5):
                r = Fraction(float(worst * factor**sign))
                definite = check._definite(waves, MBAR_6, ranges, [box], r, sign).all()
                assert not (definite and factor < 1)
                verdicts.append(bool(definite))
    assert 20 < sum(verdicts) < len(verdicts) - 20


def test_a_box_is_not_definite_for_its_centre_alone(akb: Robot, certified: Certified) -> None:
    """The largest eigenvalue at a corner is above r, that at the centre below."""
    waves = check._waves(_links(certified), 2)
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
            assert not check._definite(waves, MBAR, ranges, [((k, 6), (k, 6))], r, 1).any()
            refused += 1
    assert refused > 10


def _factorizes(matrix: NDArray[np.float64]) -> bool:
    n = len(matrix)
    return bool(check._factorizes(matrix[np.newaxis, *np.tril_indices(n)], n)[0])


def test_only_definite_matrices_factorize() -> None:
    random = np.random.default_rng(9)
    for n in (1, 2, 3, 6):
        for _ in range(20):
            vectors = np.linalg.qr(random.normal(size=(n, n)))[0]
            values = 10.0 ** random.uniform(-3, 3, n)
            definite = (vectors * values) @ vectors.T
            assert _factorizes(definite)
            values[random.integers(n)] *= -1
            assert not _factorizes((vectors * values) @ vectors.T)
    assert not _factorizes(np.ones((3, 3)))  # its smallest eigenvalue is 0
    assert not _factorizes(np.zeros((2, 2)))
    assert not _factorizes(np.diag([1.0, np.nan, 1.0]))
    # det = 1 - (1 - 2^-52)^2 > 0, but nearer to 0 than the rounding of larger ones.
    assert not _factorizes(np.array([[1.0, 1 - 2.0**-52], [1 - 2.0**-52, 1.0]]))


def test_rotors_alone_bound_the_eigenvalues(six: Certified) -> None:
    rotors = max(
        x / Fraction(row["armature_kgm2"])
        for x, row in zip(MBAR_6, six.certificate["robot"], strict=True)
    )
    for factor, said in ((Fraction(1001, 1000), 0), (Fraction(999, 1000), 1)):
        certificate = json.loads(json.dumps(six.certificate))
        certificate["high"] = {"r": str(rotors * factor), "boxes": []}
        assert len(list(check.complaints(certificate))) == said
    certificate["high"]["r"] = str(rotors * 2)
    for entry in (("mass_kg",), ("inertia_kgm2", 0, 0)):
        damaged = json.loads(json.dumps(certificate))
        _set(("robot", 3, *entry), "-1/1000000")(damaged)
        assert not check._rotors_suffice(
            [check._link(row, k) for k, row in enumerate(damaged["robot"])],
            MBAR_6,
            rotors * 2,
        )
    certificate["low"] = {"r": certificate["low"]["r"], "boxes": []}
    assert list(check.complaints(certificate))


@pytest.mark.parametrize(
    ("rows", "good"),
    [
        ([[1, 0, 0], [0, 0, 0], [0, 0, 2]], True),
        ([[1, 2, 0], [2, 1, 0], [0, 0, 1]], False),
        ([[1, 0, 2], [0, 1, 0], [2, 0, 1]], False),
        ([[1, 0, 0], [0, 1, 2], [0, 2, 1]], False),
        ([[2, -1, -1], [-1, 2, -1], [-1, -1, 2]], True),
        ([[19, -10, -10], [-10, 19, -10], [-10, -10, 19]], False),
        ([[1, 0, 0], [0, -1, 0], [0, 0, -1]], False),
    ],
)
def test_inertias_are_not_negative(rows: list[list[int]], good: bool) -> None:
    assert check._not_negative([[Fraction(x) for x in row] for row in rows]) is good


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
        for k in (0, 1, 7, 15, 25, -1)
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
    "outside box": _set(("low", "boxes", 0, 0), [8, 3]),
    "negative box": _set(("low", "boxes", 0, 0), [-1, 3]),
    "too fine box": _set(("low", "boxes", 0, 0), [0, 4000]),
    "box of texts": _set(("low", "boxes", 0, 0), ["0", 3]),
}
OF_THREE = {
    "flat box": _set(("low", "boxes", 0), [[0, 3]]),
    "longer upper arm": _scaled(("robot", 2, "offset_m", 0), Fraction(2)),
}
OF_SIX = {
    **{f"no rotor at joint {i + 1}": _set(("robot", i, "armature_kgm2"), "0") for i in (3, 4, 5)},
    **{
        f"Mbar {i + 1} times {factor}": _scaled(("inertia_kgm2", i), Fraction(factor))
        for i in (3, 4, 5)
        for factor in (-1, 0)
    },
    **{
        f"{side}: box {k} is elsewhere in joint {c + 2}": _box(side, k, c, [0, 40])
        for side in ("low", "high")
        for k in (5, 120)
        for c in (2, 3, 4)
    },
    **{
        f"{side}: box {k} is missing": _without((side, "boxes", k))
        for side in ("low", "high")
        for k in (60, 150, 250)
    },
    "box of three joints": _set(("low", "boxes", 0), [[0, 3], [0, 3]]),
    "heavier hand": _scaled(("robot", 5, "mass_kg"), Fraction(4)),
    "longer forearm": _scaled(("robot", 4, "offset_m", 2), Fraction(2)),
    "hand before the wrist": _set(("robot", 5, "parent"), 1),
}


def test_there_are_enough_damages() -> None:
    assert len(DAMAGES) >= 50


@pytest.mark.parametrize("damage", (d := DAMAGES | OF_THREE).values(), ids=d.keys())
def test_a_damaged_certificate_is_refused(damage: Damage, certified: Certified) -> None:
    certificate = json.loads(json.dumps(certified.certificate))
    damage(certificate)
    assert list(check.complaints(certificate))


@pytest.mark.parametrize("damage", (d := DAMAGES | OF_SIX).values(), ids=d.keys())
def test_a_damaged_certificate_of_six_joints_is_refused(damage: Damage, six: Certified) -> None:
    certificate = json.loads(json.dumps(six.certificate))
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
    assert said["tight"] is True
    assert all(0 < x < LOOSE for x in said["pessimism"])
    assert check.main([str(path)]) == 0


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--robot", "puma560"], "Mbar has 3 joints, puma560 has 6"),
        (["--robot", "reference", "--certificate", "/nowhere/at/all.json"], "can't be written"),
    ],
)
def test_bad_input_names_cause_and_fix(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command_line.main(["workspace", *arguments]) == 2
    assert says in capsys.readouterr().err


def test_more_joints_than_the_checker_takes_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(certify, "MAX_COORDINATES", 4)
    with pytest.raises(WorkspaceError, match="depends on 5 joint positions, at most 4"):
        certified_eigenvalues(load_robot("puma560"), MBAR_6)


def test_a_coarser_bound_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(certify, "_WORK", 300)
    assert command_line.main(["workspace", "--robot", "reference"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "coarser: the bounds are at most" in shown
    assert "proved: the certificate was verified" in shown


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_mbar_must_be_positive(akb: Robot, bad: float) -> None:
    with pytest.raises(WorkspaceError, match="must be > 0"):
        certified_eigenvalues(akb, [0.1, bad, 0.1])
