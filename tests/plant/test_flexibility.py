"""Flexible joints against closed forms and an independent solution of Spong's equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from plant.assembly import Plant, PlantError, PlantState, at_rest, build_plant
from plant.drive import Drive
from plant.flexibility import Flexibility
from plant.friction import frictionless
from plant.integrator import Integrator
from plant.model import dynamics, gravity_torque
from plant.robot import load_robot

Floats = NDArray[np.float64]
START = np.deg2rad([0.0, -45.0, 90.0])
SPRINGS = Flexibility(np.array([2e4, 2e4, 1e4]), np.array([10.0, 10.0, 5.0]))


@pytest.fixture(scope="module")
def rigid() -> Plant:
    return build_plant(load_robot("reference"))


def _elastic(plant: Plant, springs: Flexibility = SPRINGS) -> Plant:
    return replace(plant, flexibility=springs)


def _one_joint(link: float, motor: float, springs: Flexibility, plant: Plant) -> Plant:
    """A single joint about the vertical, without gravity or friction."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint")
    model.appendBodyToJoint(
        1, pin.Inertia(0.0, np.zeros(3), np.diag([0.0, 0.0, link])), pin.SE3.Identity()
    )
    model.armature = np.array([motor])
    drive = Drive(np.full(1, 100.0))
    return replace(plant, model=model, drive=drive, friction=frictionless(1), flexibility=springs)


def _state(q: Floats, q_motor: Floats, qd: Floats, qd_motor: Floats, plant: Plant) -> PlantState:
    zero = np.zeros_like(q)
    return PlantState(q, qd, q_motor, qd_motor, plant.friction.at_rest(), zero, zero)


def test_two_masses_vibrate_as_the_closed_form_says(rigid: Plant) -> None:
    """The twist of a free joint obeys delta'' = -K (1/M + 1/J) delta - D (1/M + 1/J) delta'."""
    link, motor, stiffness, damping = 0.8, 0.3, 2e4, 15.0
    plant = _one_joint(link, motor, Flexibility(np.array([stiffness]), np.array([damping])), rigid)
    mobility = 1.0 / link + 1.0 / motor
    decay = 0.5 * damping * mobility
    frequency = np.sqrt(stiffness * mobility - decay**2)
    errors = []
    for substep in (2e-6, 1e-6):
        start = _state(np.zeros(1), np.full(1, 1e-3), np.zeros(1), np.zeros(1), plant)
        end = Integrator(plant).advance(start, np.zeros(1), 0.02, substep).state
        t = 0.02
        exact = np.exp(-decay * t) * (
            np.cos(frequency * t) + decay / frequency * np.sin(frequency * t)
        )
        errors.append(abs((end.q_motor - end.q)[0] / 1e-3 - exact))
        # Nothing acts from outside: the centre of mass stays, to rounding.
        assert abs(link * end.q[0] + motor * (end.q_motor[0] - 1e-3)) < 1e-12
    assert errors[0] < 5e-3
    assert 1.8 < errors[0] / errors[1] < 2.2


def test_motion_converges_to_an_independent_solution_with_order_one(rigid: Plant) -> None:
    plant = replace(_elastic(rigid), friction=frictionless(3))
    bare = pin.Model(plant.model)
    bare.armature = np.zeros(3)
    J = plant.model.armature
    torque = np.array([3.0, -30.0, 5.0])
    start = _state(START, START + 1e-3, np.zeros(3), np.array([0.5, 0.0, -0.5]), plant)

    def rates(_: float, y: Floats) -> Floats:
        q, theta, qd, thetad = np.split(y, 4)
        spring = SPRINGS.stiffness_Nm_per_rad * (theta - q)
        spring += SPRINGS.damping_Nms_per_rad * (thetad - qd)
        terms = dynamics(bare, q, qd, np.zeros(3))
        qdd = np.linalg.solve(terms.M, spring - terms.tau)
        return np.concatenate((qd, thetad, qdd, (torque - spring) / J))

    y = np.concatenate((start.q, start.q_motor, start.qd, start.qd_motor))
    exact = solve_ivp(rates, (0.0, 0.1), y, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    errors = []
    for substep in (4e-5, 2e-5, 1e-5):
        moving = replace(start, torque_Nm=torque)
        end = Integrator(plant).advance(moving, torque, 0.1, substep).state
        got = np.concatenate((end.q, end.q_motor, end.qd, end.qd_motor))
        errors.append(np.linalg.norm(got - exact))
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=0.15)
    assert errors[-1] < 5e-3


def test_a_stiff_spring_is_a_rigid_joint(rigid: Plant) -> None:
    """The rigid step is the limit of the flexible one, friction and all, at any length of step."""
    stiff = _elastic(rigid, Flexibility(np.full(3, 1e13), np.zeros(3)))
    rng = np.random.default_rng(8)
    for _ in range(50):
        q, qd = rng.uniform(-3, 3, 3), rng.uniform(-2, 2, 3)
        torque, external = rng.uniform(-50, 50, 3), rng.uniform(-20, 20, 3)
        state = PlantState.as_one(q, qd, rng.uniform(-3e-4, 3e-4, 3).tolist(), torque)
        one = Integrator(rigid).advance(state, torque, 1e-4, 1e-4, external)
        other = Integrator(stiff).advance(state, torque, 1e-4, 1e-4, external)
        np.testing.assert_allclose(other.state.qd, one.state.qd, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(other.state.qd_motor, one.state.qd, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(other.friction_Nm, one.friction_Nm, rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("stiffness", [1e2, 1e4, 1e7])
def test_a_step_never_feeds_energy_into_a_spring(rigid: Plant, stiffness: float) -> None:
    plant = _one_joint(0.01, 0.3, Flexibility(np.array([stiffness]), np.zeros(1)), rigid)
    integrator, energy = Integrator(plant), []
    state = _state(np.zeros(1), np.full(1, 1e-2), np.zeros(1), np.zeros(1), plant)
    for _ in range(200):
        spring = 0.5 * stiffness * (state.q_motor - state.q)[0] ** 2
        energy.append(spring + 0.005 * state.qd[0] ** 2 + 0.15 * state.qd_motor[0] ** 2)
        state = integrator.advance(state, np.zeros(1), 1e-3, 1e-3).state
    assert np.all(np.diff(energy) <= 1e-12 * energy[0])


def test_the_robot_rests_on_its_springs(rigid: Plant) -> None:
    plant = _elastic(rigid)
    state = at_rest(plant, START)
    np.testing.assert_array_equal(plant.encoder.counts(state.q_motor), plant.encoder.counts(START))
    held = gravity_torque(plant.model, state.q)
    np.testing.assert_allclose(
        SPRINGS.stiffness_Nm_per_rad * (state.q_motor - state.q), held, rtol=1e-9, atol=1e-9
    )
    assert np.abs(held).max() > 10.0
    after = Integrator(plant).advance(state, state.command_Nm, 0.05, 2e-5).state
    assert np.abs(after.q - state.q).max() < 1e-9
    seen_at_joint = replace(plant, encoder=replace(plant.encoder, mounted="joint"))
    np.testing.assert_array_equal(at_rest(seen_at_joint, START).q, START)


def test_springs_too_soft_to_hold_the_arm_are_refused(rigid: Plant) -> None:
    soft = _elastic(rigid, Flexibility(np.full(3, 5.0), np.zeros(3)))
    with pytest.raises(PlantError, match="too soft"):
        at_rest(soft, START)
