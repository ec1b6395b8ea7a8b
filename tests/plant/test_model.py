"""Rigid-body dynamics against published numbers and against what mechanics demands."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from plant.model import build_model, dynamics, energy, gravity_torque, link_placement
from plant.robot import Robot, load_robot, robot_names

TOLERANCE = 1e-9
# Key of the reference data, robot, whether its wrist is locked.
PUBLISHED = [
    ("configs_6dof", "puma560", False),
    ("configs_3dof_wrist_locked_at_zero", "puma560", True),
    ("akb_variant", "puma560_akb", False),
]


def _configurations(published: dict[str, Any], key: str) -> dict[str, Any]:
    configurations: dict[str, Any] = published[key]
    return configurations.get("configs", configurations)  # type: ignore[no-any-return]


def _random_states(
    robot: Robot, count: int = 20
) -> list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
    rng = np.random.default_rng(560)
    return [tuple(rng.uniform(-3.0, 3.0, (3, robot.joints))) for _ in range(count)]


@pytest.fixture(params=robot_names())
def robot(request: pytest.FixtureRequest) -> Robot:
    return load_robot(request.param)


@pytest.mark.parametrize(("key", "name", "lock_wrist"), PUBLISHED)
def test_dynamics_are_the_published_ones(
    published: dict[str, Any], key: str, name: str, lock_wrist: bool
) -> None:
    robot = load_robot(name, lock_wrist=lock_wrist)
    model = build_model(robot)
    qd, qdd = (np.array(published[k])[: robot.joints] for k in ("qd", "qdd"))
    configurations = _configurations(published, key)
    assert configurations
    for configuration in configurations.values():
        terms = dynamics(model, np.array(configuration["q"]), qd, qdd)
        np.testing.assert_allclose(terms.M, configuration["M"], rtol=0, atol=TOLERANCE)
        np.testing.assert_allclose(terms.g, configuration["g"], rtol=0, atol=TOLERANCE)
        np.testing.assert_allclose(terms.tau, configuration["tau"], rtol=0, atol=TOLERANCE)
        np.testing.assert_allclose(terms.C @ qd, configuration["Cqd"], rtol=0, atol=TOLERANCE)
        for matrix in configuration.keys() & {"C_pin", "C_rtb"}:
            np.testing.assert_allclose(terms.C, configuration[matrix], rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize(("key", "name", "lock_wrist"), PUBLISHED)
def test_kinematics_are_the_published_ones(
    published: dict[str, Any], key: str, name: str, lock_wrist: bool
) -> None:
    model = build_model(load_robot(name, lock_wrist=lock_wrist))
    for configuration in _configurations(published, key).values():
        for transform in configuration.keys() & {"fk", "T"}:
            placement = link_placement(model, np.array(configuration["q"]), 6)
            np.testing.assert_allclose(placement, configuration[transform], rtol=0, atol=TOLERANCE)


def test_armature_is_the_published_one(published: dict[str, Any]) -> None:
    armature = load_robot("puma560").armature_kgm2
    np.testing.assert_allclose(
        armature, published["friction"]["joint_armature"], rtol=0, atol=TOLERANCE
    )


def test_terms_add_up_to_the_torque(robot: Robot) -> None:
    model = build_model(robot)
    for q, qd, qdd in _random_states(robot):
        terms = dynamics(model, q, qd, qdd)
        np.testing.assert_allclose(
            terms.M @ qdd + terms.C @ qd + terms.g, terms.tau, rtol=0, atol=TOLERANCE
        )


def test_inertia_is_symmetric_and_positive_definite(robot: Robot) -> None:
    model = build_model(robot)
    for q, qd, qdd in _random_states(robot):
        M = dynamics(model, q, qd, qdd).M
        np.testing.assert_array_equal(M, M.T)
        # Whatever the links do, the motors' inertia is always there.
        assert np.linalg.eigvalsh(M - np.diag(robot.armature_kgm2)).min() > -TOLERANCE
        assert np.linalg.eigvalsh(M).min() > 0.0


def test_locked_wrist_is_the_wrist_at_zero_without_its_motors() -> None:
    six, three = load_robot("puma560"), load_robot("puma560", lock_wrist=True)
    for q, qd, qdd in _random_states(three):
        rigid = dynamics(build_model(three), q, qd, qdd)
        free = dynamics(build_model(six), *(np.concatenate((x, np.zeros(3))) for x in (q, qd, qdd)))
        np.testing.assert_allclose(rigid.M, free.M[:3, :3], rtol=0, atol=TOLERANCE)
        np.testing.assert_allclose(rigid.tau, free.tau[:3], rtol=0, atol=TOLERANCE)


def test_inertia_rate_minus_twice_coriolis_is_skew(robot: Robot) -> None:
    model, h = build_model(robot), 1e-5
    for q, qd, qdd in _random_states(robot):
        ahead, behind = (dynamics(model, q + s * h * qd, qd, qdd).M for s in (1, -1))
        skew = (ahead - behind) / (2 * h) - 2 * dynamics(model, q, qd, qdd).C
        np.testing.assert_allclose(skew, -skew.T, rtol=0, atol=1e-7)


def test_coriolis_matrix_consists_of_christoffel_symbols(robot: Robot) -> None:
    """C_ij = sum_k (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) qd_k / 2; many other C are skew too."""
    model, h = build_model(robot), 1e-5
    for q, qd, qdd in _random_states(robot, count=5):
        steps = h * np.eye(robot.joints)
        # slopes[k, i, j] = dM_ij / dq_k
        slopes = np.array(
            [
                (dynamics(model, q + s, qd, qdd).M - dynamics(model, q - s, qd, qdd).M) / (2 * h)
                for s in steps
            ]
        )
        christoffel = 0.5 * (
            np.einsum("kij,k->ij", slopes, qd)
            + np.einsum("jik,k->ij", slopes, qd)
            - np.einsum("ijk,k->ij", slopes, qd)
        )
        np.testing.assert_allclose(dynamics(model, q, qd, qdd).C, christoffel, rtol=0, atol=1e-7)


def test_gravity_torque_is_the_slope_of_potential_energy(robot: Robot) -> None:
    model, h = build_model(robot), 1e-5
    rest = np.zeros(robot.joints)
    for q, _, _ in _random_states(robot):
        slope = [
            (energy(model, q + s, rest) - energy(model, q - s, rest)) / (2 * h)
            for s in h * np.eye(robot.joints)
        ]
        np.testing.assert_allclose(gravity_torque(model, q), slope, rtol=0, atol=1e-7)


def test_power_is_the_rate_of_energy(robot: Robot) -> None:
    model, h = build_model(robot), 1e-5
    for q, qd, qdd in _random_states(robot):
        ahead, behind = (energy(model, q + s * qd + s * s / 2 * qdd, qd + s * qdd) for s in (h, -h))
        power = qd @ dynamics(model, q, qd, qdd).tau
        assert power == pytest.approx((ahead - behind) / (2 * h), abs=1e-5)
