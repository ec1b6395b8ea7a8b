"""Friction models against published values, closed forms and independent integration."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from plant.assembly import Plant, PlantState, build_plant
from plant.friction import (
    CoulombStribeck,
    CoulombStribeckJoint,
    FrictionModel,
    LuGre,
    LuGreJoint,
    StribeckCurve,
    dahl_joint,
    frictionless,
)
from plant.integrator import Integrator
from plant.model import gravity_torque
from plant.robot import FrictionName, load_robot

CURVE = StribeckCurve(
    coulomb_positive_Nm=6.0,
    coulomb_negative_Nm=5.0,
    static_over_coulomb=1.3,
    velocity_rad_per_s=0.02,
)
JOINT = LuGreJoint(
    CURVE,
    stiffness_Nm_per_rad=26000.0,
    bristle_damping_Nms_per_rad=100.0,
    viscous_Nms_per_rad=5.0,
)
SPEEDS = [s * v for v in (1e-4, 3e-3, 0.02, 0.1, 1.5) for s in (1, -1)]


def _settled(joint: LuGreJoint, velocity: float, step: float = 1e-4) -> tuple[float, float]:
    """Deflection and torque once the bristle has moved ten times its range."""
    model, state, torque = LuGre((joint,)), [0.0], 0.0
    duration = 10.0 * 1.3 * joint.curve.mean_static_level / joint.stiffness_Nm_per_rad / velocity
    for _ in range(max(2, math.ceil(abs(duration) / step))):
        state, (torque,), _ = model.step([0.0], [velocity], state, step)
    return state[0], torque


@pytest.mark.parametrize(
    ("velocity", "key"), [("qd_plus", "plus"), ("qd_minus", "minus"), ("qd", "at_qd")]
)
@pytest.mark.parametrize("name", get_args(FrictionName))
def test_joint_friction_is_the_published_one(
    published: dict[str, Any], name: Any, velocity: str, key: str
) -> None:
    """Coulomb x |G| by the sign of the joint velocity, viscous x G^2; the library counts -F."""
    friction = load_robot("puma560", friction=name).friction
    assert friction is not None
    ones = np.array(published["friction"]["qd"], dtype=float)
    qd = {"qd_plus": ones, "qd_minus": -ones, "qd": np.array(published["qd"])}[velocity]
    # At these speeds nothing is left of the chosen static friction.
    torque = friction.steady_torque([0.0] * 6, qd.tolist())
    expected = -np.array(published["friction"][key])
    np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-9)


def test_levels_and_viscous_coefficients_are_the_published_ones(published: dict[str, Any]) -> None:
    friction = load_robot("puma560").friction
    assert isinstance(friction, LuGre)
    joints, values = friction.parameters, published["friction"]
    for attribute, key, sign in (
        ("coulomb_positive_Nm", "zero_plus_limit", -1),
        ("coulomb_negative_Nm", "zero_minus_limit", 1),
    ):
        levels = [getattr(joint.curve, attribute) for joint in joints]
        np.testing.assert_allclose(levels, sign * np.array(values[key]), rtol=0, atol=1e-9)
    viscous = [joint.viscous_Nms_per_rad for joint in joints]
    np.testing.assert_allclose(viscous, values["joint_viscous"], rtol=0, atol=1e-9)


def test_stribeck_curve_falls_from_static_to_coulomb_level() -> None:
    assert CURVE.level(0.0, 0.0) == pytest.approx(1.3 * 6.0)
    assert CURVE.level(0.0, 10.0) == pytest.approx(6.0)
    assert CURVE.level(0.0, -10.0) == pytest.approx(5.0)
    at_stribeck_velocity = 6.0 * (1.0 + 0.3 / math.e)
    assert CURVE.level(0.0, CURVE.velocity_rad_per_s) == pytest.approx(at_stribeck_velocity)


def test_ripple_repeats_with_the_motor() -> None:
    cycles, gear = 2, -62.0
    curve = replace(CURVE, ripple_amplitude=0.2, ripple_rad_per_rad=cycles * gear)
    period = 2 * math.pi / (cycles * abs(gear))
    phases = np.linspace(0.0, period, 200, endpoint=False)
    levels = np.array([curve.level(q, 1.0) for q in phases])
    again = np.array([curve.level(q + period, 1.0) for q in phases])
    np.testing.assert_allclose(levels, again, rtol=1e-9)
    plain = CURVE.level(0.0, 1.0)
    assert levels.max() == pytest.approx(1.2 * plain, rel=1e-3)
    assert levels.min() == pytest.approx(0.8 * plain, rel=1e-3)
    assert levels.mean() == pytest.approx(plain)


@pytest.mark.parametrize("velocity", SPEEDS)
def test_lugre_settles_on_the_stribeck_curve(velocity: float) -> None:
    deflection, torque = _settled(JOINT, velocity)
    level = math.copysign(CURVE.level(0.0, velocity), velocity)
    assert deflection == pytest.approx(level / JOINT.stiffness_Nm_per_rad, rel=1e-3)
    assert torque == pytest.approx(level + JOINT.viscous_Nms_per_rad * velocity, rel=1e-3)
    assert LuGre((JOINT,)).steady_torque([0.0], [velocity])[0] == pytest.approx(torque, rel=1e-3)


def test_lugre_is_a_spring_before_it_slides() -> None:
    joint = replace(JOINT, bristle_damping_Nms_per_rad=0.0, viscous_Nms_per_rad=0.0)
    step, velocity, steps = 1e-4, 1e-6, 100
    model, state, torque = LuGre((joint,)), [0.0], 0.0
    for _ in range(steps):
        state, (torque,), _ = model.step([0.0], [velocity], state, step)
    moved = steps * step * velocity
    assert torque / moved == pytest.approx(JOINT.stiffness_Nm_per_rad, rel=1e-4)


DAHL = dahl_joint(CURVE, presliding_rad=3e-4, viscous_Nms_per_rad=0.0)


def test_dahl_has_neither_stribeck_effect_nor_bristle_damping() -> None:
    for velocity in SPEEDS:
        _, torque = _settled(DAHL, velocity)
        assert torque == pytest.approx(6.0 if velocity > 0.0 else -5.0, rel=1e-3)
    assert DAHL.bristle_damping_Nms_per_rad == 0.0
    assert pytest.approx(5.5 / 3e-4) == DAHL.stiffness_Nm_per_rad


@pytest.mark.parametrize("speed", [1e-3, 0.1, 2.0])
def test_dahl_follows_its_hysteresis_at_any_speed(speed: float) -> None:
    """Dahl's own form, dF/dx = sigma0 (1 - F sgn(v) / Fc), in which no time occurs."""
    model, steps, stroke = LuGre((DAHL,)), 400, 1e-3
    state, force, sigma = [0.0], 0.0, DAHL.stiffness_Nm_per_rad
    for sign, level in ((1.0, 6.0), (-1.0, 5.0), (1.0, 6.0)):
        h = stroke / steps / speed
        for _ in range(steps):
            state, (torque,), _ = model.step([0.0], [sign * speed], state, h)
        end = solve_ivp(
            lambda _, f, s=sign, fc=level: s * sigma * (1.0 - f * s / fc),
            (0.0, stroke),
            [force],
            method="DOP853",
            rtol=1e-11,
            atol=1e-13,
        )
        force = float(end.y[0, -1])
        assert torque == pytest.approx(force, rel=1e-7)


@given(
    velocity=st.floats(-2.0, 2.0),
    deflection=st.floats(-3.5e-4, 3.5e-4),
    step=st.sampled_from([1e-5, 1e-4, 1e-3]),
)
def test_bristle_is_advanced_exactly(velocity: float, deflection: float, step: float) -> None:
    """Against an independent integration of dz/dt = v - sigma0 |v| z / level."""
    rate = JOINT.stiffness_Nm_per_rad * abs(velocity) / CURVE.level(0.0, velocity)
    solution = solve_ivp(
        lambda _, z: velocity - rate * z,
        (0.0, step),
        [deflection],
        method="DOP853",
        rtol=1e-11,
        atol=1e-16,
    )
    (advanced,), (torque,), _ = LuGre((JOINT,)).step([0.0], [velocity], [deflection], step)
    assert advanced == pytest.approx(solution.y[0, -1], rel=1e-8, abs=1e-13)
    assert torque == pytest.approx(
        JOINT.stiffness_Nm_per_rad * advanced
        + JOINT.bristle_damping_Nms_per_rad * (advanced - deflection) / step
        + JOINT.viscous_Nms_per_rad * velocity,
        rel=1e-12,
        abs=1e-12,
    )


@given(
    velocity=st.floats(1e-5, 2.0),
    sign=st.sampled_from([1.0, -1.0]),
    load=st.floats(-1.0, 0.99),
    step=st.sampled_from([1e-5, 1e-4, 1e-3]),
)
def test_lugre_derivative_is_that_of_the_torque(
    velocity: float, sign: float, load: float, step: float
) -> None:
    """Where the level does not depend on the velocity, D = dF/dv exactly."""
    joint = replace(JOINT, curve=replace(CURVE, static_over_coulomb=1.0))
    model, velocity = LuGre((joint,)), sign * velocity
    state = [load * sign * joint.curve.level(0.0, velocity) / joint.stiffness_Nm_per_rad]
    dv = 1e-4 * abs(velocity)
    above, below = (
        model.step([0.0], [velocity + s * dv], state, step).torque_Nm[0] for s in (1, -1)
    )
    (derivative,) = model.step([0.0], [velocity], state, step).derivative_Nms_per_rad
    assert derivative == pytest.approx((above - below) / (2 * dv), rel=1e-4, abs=1e-4)


@given(
    velocity=st.floats(-5.0, 5.0),
    deflection=st.floats(-1e-3, 1e-3),
    step=st.sampled_from([1e-6, 1e-4, 1e-3]),
)
def test_derivative_is_never_negative(velocity: float, deflection: float, step: float) -> None:
    models: tuple[FrictionModel, ...] = (
        LuGre((JOINT,)),
        LuGre((DAHL,)),
        CoulombStribeck((CoulombStribeckJoint(CURVE, 5.0, 1e-3),)),
    )
    for model in models:
        taken = model.step([0.0], [velocity], [deflection], step)
        assert taken.derivative_Nms_per_rad[0] >= 0.0
        assert math.isfinite(taken.torque_Nm[0])


@given(steps=st.lists(st.tuples(st.floats(-2.0, 2.0), st.sampled_from([1e-5, 1e-4, 1e-3]))))
def test_bristle_never_exceeds_the_static_level(steps: list[tuple[float, float]]) -> None:
    model, state = LuGre((JOINT,)), [0.0]
    limit = CURVE.level(0.0, 0.0) / JOINT.stiffness_Nm_per_rad
    for velocity, step in steps:
        state = model.step([0.0], [velocity], state, step).state
        assert abs(state[0]) <= limit * (1.0 + 1e-12)


@pytest.mark.parametrize("amplitude", [1e-4, 1e-3, 0.5])
@pytest.mark.parametrize("name", get_args(FrictionName))
def test_friction_dissipates_over_a_cycle(name: Any, amplitude: float) -> None:
    friction = load_robot("reference", friction=name).friction
    assert isinstance(friction, LuGre | CoulombStribeck)
    steps, step, n = 20000, 1e-4, friction.joints
    state, work, path = friction.at_rest(), np.zeros(n), 0.0
    for k in range(2 * steps):
        phase = 2 * math.pi * k / steps
        q, v = amplitude * math.sin(phase), amplitude * math.cos(phase) * 2 * math.pi / steps / step
        state, torque, _ = friction.step([q] * n, [v] * n, state, step)
        # The first cycle loads the bristles.
        if k >= steps:
            work += np.array(torque) * v * step
            path += abs(v) * step
    assert np.all(work > 0.0)
    if amplitude == 0.5:
        coulomb = np.array([joint.curve.coulomb_positive_Nm for joint in friction.parameters])
        viscous = np.array([joint.viscous_Nms_per_rad for joint in friction.parameters])
        # Mean of v^2 over the path of a sinusoid: integral of v dx = pi A^2 omega.
        expected = coulomb * path + viscous * math.pi * amplitude**2 * 2 * math.pi / steps / step
        np.testing.assert_allclose(work, expected, rtol=0.02)


@pytest.mark.parametrize("name", ["puma560", "reference"])
def test_armature_takes_the_implicit_friction(name: str) -> None:
    """aba with h D added to the armature solves (M + h D) qdd = tau - nle - F."""
    plant = build_plant(load_robot(name))
    n, h, rng = plant.joints, 1e-4, np.random.default_rng(1995)
    for _ in range(20):
        q, qd, torque = rng.uniform(-2.0, 2.0, (3, n)) * np.array([[1.0], [0.05], [30.0]])
        state = PlantState.as_one(q, qd, rng.uniform(-3e-4, 3e-4, n).tolist(), torque)
        after, friction, _ = Integrator(plant).advance(state, torque, h, h)
        _, force, derivative = plant.friction.step(q.tolist(), qd.tolist(), state.friction, h)
        data = plant.model.createData()
        M = pin.crba(plant.model, data, q)
        rest = torque - pin.nonLinearEffects(plant.model, data, q, qd) - force
        qdd = np.linalg.solve(M + h * np.diag(derivative), rest)
        np.testing.assert_allclose(after.qd, qd + h * qdd, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(after.q, q + h * after.qd, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(
            friction, force + h * np.array(derivative) * qdd, rtol=1e-9, atol=1e-9
        )


def _stiffened(plant: Plant, factor: float) -> Plant:
    assert isinstance(plant.friction, LuGre)
    joints = tuple(
        replace(joint, stiffness_Nm_per_rad=factor * joint.stiffness_Nm_per_rad)
        for joint in plant.friction.parameters
    )
    return replace(plant, friction=LuGre(joints))


@pytest.mark.parametrize("stiffness", [1.0, 100.0])
def test_implicit_step_is_stable_at_one_millisecond(stiffness: float) -> None:
    """A robot let go with some speed comes to rest and sticks, however stiff its bristles are."""
    plant = _stiffened(build_plant(load_robot("reference")), stiffness)
    start = np.deg2rad([0.0, -45.0, 90.0])
    held = gravity_torque(plant.model, start)
    state = PlantState.as_one(start, np.array([0.2, -0.2, 0.2]), plant.friction.at_rest(), held)
    state = Integrator(plant).advance(state, held, 1.0, 1e-3).state
    stopped = state.q.copy()
    state = Integrator(plant).advance(state, held, 2.0, 1e-3).state
    assert np.all(np.abs(stopped - start) < 0.05)
    assert np.all(np.abs(state.q - stopped) < 1e-5)
    assert np.all(np.abs(state.qd) < 1e-4)


@given(
    velocity=st.floats(-1.0, 1.0),
    step=st.sampled_from([1e-5, 1e-4, 1e-3, 1e-2]),
    inertia=st.floats(0.05, 5.0),
)
def test_coulomb_stribeck_brakes_without_reversing(
    velocity: float, step: float, inertia: float
) -> None:
    model = CoulombStribeck((CoulombStribeckJoint(CURVE, 0.0, 1e-3),))
    _, (torque,), (derivative,) = model.step([0.0], [velocity], [0.0], step)
    after = velocity - step * torque / (inertia + step * derivative)
    assert abs(after) <= abs(velocity)
    assert after * velocity >= 0.0


def test_frictionless_is_frictionless() -> None:
    model = frictionless(2)
    assert model.joints == 2
    taken = model.step([0.1, 0.2], [1.0, -1.0], model.at_rest(), 1e-3)
    assert taken.torque_Nm == [0.0, 0.0]
    assert taken.derivative_Nms_per_rad == [0.0, 0.0]
    assert model.steady_torque([0.0, 0.0], [1.0, -1.0]) == [0.0, 0.0]
