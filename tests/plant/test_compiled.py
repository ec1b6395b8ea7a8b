"""The compiled backend against the reference: Pinocchio and the loop in Python."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from codegen.controller import Controller, load
from plant.assembly import Plant, PlantError, PlantState, build_plant
from plant.closed_loop import (
    NOT_CALLED,
    ControllerError,
    Run,
    beginning,
    run_from,
    simulate,
    switch_on,
)
from plant.compiled import loop
from plant.compiled.dynamics import (
    SUBSTEP,
    SYMBOLIC,
    TERMS,
    dynamics_c,
    numbers,
    structure,
    terms_function,
)
from plant.compiled.loop import CompiledLoop
from plant.compiled.loop import simulate as simulate_compiled
from plant.controller import SATURATED, GeneratedController, LayoutError
from plant.drive import Drive
from plant.encoder import Mounting
from plant.flexibility import Flexibility
from plant.flight import Backend, fly
from plant.friction import LuGre, frictionless
from plant.integrator import Integrator
from plant.model import dynamics, energy, gravity_torque
from plant.native import library, shared_library, sources_of
from plant.robot import FrictionName, Robot, load_robot
from plant.scenario import Scenario
from plant.trajectory import RestToRest

Floats = NDArray[np.float64]
CONTROLLERS = Path(__file__).parents[2] / "controllers"
TICK, H = 1e-3, 1e-4
STATES = 1000
START = np.deg2rad([0.0, -45.0, 90.0])
FLOAT64 = 'precision = "float64"'


@dataclass(frozen=True, eq=False)
class Case:
    """A loop and the plant that it was compiled for."""

    plant: Plant
    loop: CompiledLoop


def _case(robot: Robot, controller: str) -> Case:
    plant = build_plant(robot)
    return Case(plant, CompiledLoop(plant, load(CONTROLLERS / controller)))


@pytest.fixture(scope="module")
def puma3() -> Controller:
    return load(CONTROLLERS / "puma3.toml")


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("reference")


@pytest.fixture(scope="module")
def reference(robot: Robot) -> Case:
    return _case(robot, "puma3.toml")


@pytest.fixture(scope="module")
def six() -> Case:
    return _case(load_robot("puma560"), "puma6.toml")


@pytest.fixture(scope="module", params=["reference", "wrist locked", "six"])
def puma(request: pytest.FixtureRequest, reference: Case, six: Case) -> Case:
    """All PUMAs that can be simulated."""
    if request.param == "wrist locked":
        return _case(load_robot("puma560", lock_wrist=True), "puma3.toml")
    return six if request.param == "six" else reference


def _random(n: int, count: int = STATES, seed: int = 1986) -> tuple[Floats, ...]:
    """Positions, velocities from creep to fast, bristles and torques, each of shape (count, n)."""
    rng = np.random.default_rng(seed)
    position = rng.uniform(-np.pi, np.pi, (count, n))
    velocity = rng.choice([-1.0, 1.0], (count, n)) * 10.0 ** rng.uniform(-8.0, 0.7, (count, n))
    velocity[rng.uniform(size=(count, n)) < 0.1] = 0.0
    # Some bristles are stretched beyond the level.
    bristle = rng.uniform(-5e-4, 5e-4, (count, n))
    return position, velocity, bristle, rng.uniform(-60.0, 60.0, (count, n))


def _c(name: str, loop: CompiledLoop) -> Callable[..., list[Floats]]:
    """A function of the compiled dynamics; columns of its arguments are states."""
    function = ca.external(name, str(loop.path))
    return lambda *columns: [np.array(x) for x in function(*columns)]


def test_inertia_bias_and_acceleration_are_those_of_pinocchio(puma: Case) -> None:
    model, n = puma.plant.model, puma.plant.joints
    q, qd, _, torque = _random(n)
    given = np.tile(numbers(puma.plant)[:, np.newaxis], STATES)
    _assert_terms(model, (q, qd, torque), _c(TERMS, puma.loop)(q.T, qd.T, torque.T, given))


@pytest.mark.parametrize("name", ["ur5", "panda", "z1"])
def test_terms_of_a_urdf_are_those_of_pinocchio(name: str) -> None:
    plant = build_plant(load_robot(name))
    q, qd, _, torque = _random(plant.joints, 200)
    given = np.tile(numbers(plant)[:, np.newaxis], 200)
    terms = [np.array(x) for x in terms_function(structure(plant))(q.T, qd.T, torque.T, given)]
    _assert_terms(plant.model, (q, qd, torque), terms)


def _assert_terms(model: pin.Model, states: tuple[Floats, ...], terms: list[Floats]) -> None:
    (M, nle, qdd), data, n = terms, model.createData(), model.nv
    for k, (q, qd, torque) in enumerate(zip(*states, strict=True)):
        inertia = pin.crba(model, data, q)
        np.testing.assert_allclose(M[:, k * n : (k + 1) * n], inertia, rtol=0, atol=1e-12)
        bias = pin.nonLinearEffects(model, data, q, qd)
        np.testing.assert_allclose(nle[:, k], bias, rtol=0, atol=1e-12)
        expected = pin.aba(model, data, q, qd, torque)
        scale = max(1.0, np.abs(expected).max())
        np.testing.assert_allclose(qdd[:, k], expected, rtol=0, atol=1e-12 * scale)


def _any_tree(rng: np.random.Generator) -> pin.Model:
    """Two branches of turning and sliding joints about any axes, in tilted gravity."""
    model = pin.Model()
    model.gravity.linear = rng.normal(size=3) * 9.81
    kinds = (pin.JointModelRX, pin.JointModelPY, pin.JointModelRZ, pin.JointModelRevoluteUnaligned)
    for i, parent in enumerate((0, 1, 2, 1, 4, 5, 0)):
        kind = (*kinds, pin.JointModelPrismaticUnaligned)[i % 5]
        axis = rng.normal(size=3)
        joint = kind(axis / np.linalg.norm(axis)) if i % 5 >= 3 else kind()
        model.addJoint(parent, joint, pin.SE3.Random(), f"joint {i}")
        model.appendBodyToJoint(i + 1, pin.Inertia.Random(), pin.SE3.Random())
    model.armature = rng.uniform(0.1, 1.0, model.nv)
    return model


def test_any_tree_of_turning_and_sliding_joints_is_that_of_pinocchio(reference: Case) -> None:
    rng = np.random.default_rng(6)
    pin.seed(6)
    model = _any_tree(rng)
    plant = replace(reference.plant, model=model, friction=frictionless(model.nv))
    q, qd, _, torque = _random(model.nv, 100)
    function = terms_function(structure(plant))
    given = np.tile(numbers(plant)[:, np.newaxis], 100)
    terms = [np.array(x) for x in function(q.T, qd.T, torque.T, given)]
    _assert_terms(model, (q, qd, torque), terms)


@pytest.mark.parametrize("name", get_args(FrictionName))
def test_friction_is_the_same_expression(name: FrictionName) -> None:
    friction = load_robot("reference", friction=name).friction
    assert friction is not None
    n = friction.joints
    symbols = [ca.SX.sym(x, n) for x in ("q", "v", "z")]
    q, v, z = symbols
    steps = [
        joint.step(q[i], v[i], z[i], H, SYMBOLIC) for i, joint in enumerate(friction.parameters)
    ]
    function = ca.Function("friction", symbols, [ca.vertcat(*x) for x in zip(*steps, strict=True)])
    for q, v, z in zip(*_random(n)[:3], strict=True):
        expected = friction.step(q.tolist(), v.tolist(), z.tolist(), H)
        for got, wanted in zip(function(q, v, z), expected, strict=True):
            np.testing.assert_allclose(np.array(got).ravel(), wanted, rtol=1e-14, atol=1e-300)


def test_a_substep_is_that_of_the_integrator(puma: Case) -> None:
    integrator, states = Integrator(puma.plant), _random(puma.plant.joints)
    external = _random(puma.plant.joints, seed=5)[-1]
    given = np.tile(numbers(puma.plant)[:, np.newaxis], STATES)
    columns = (*(x.T for x in states), external.T, np.full((1, STATES), H), given)
    q, qd, bristle, friction = _c(SUBSTEP, puma.loop)(*columns)
    for k, (position, velocity, state, torque) in enumerate(zip(*states, strict=True)):
        start = PlantState.as_one(position, velocity, state.tolist(), torque)
        after, first, _ = integrator.advance(start, torque, H, H, external[k])
        np.testing.assert_allclose(q[:, k], after.q, rtol=0, atol=1e-12)
        np.testing.assert_allclose(qd[:, k], after.qd, rtol=0, atol=1e-12)
        np.testing.assert_allclose(bristle[:, k], after.friction, rtol=0, atol=1e-12)
        np.testing.assert_allclose(friction[:, k], first, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["reference_flexible", "six"])
def test_a_substep_on_springs_is_that_of_the_integrator(six: Case, name: str) -> None:
    if name == "six":
        springs = Flexibility(np.geomspace(3e2, 3e4, 6), np.array([0.0, 10.0, 5.0, 0.0, 1.0, 0.1]))
        plant = replace(six.plant, flexibility=springs)
        case = Case(plant, CompiledLoop(plant, load(CONTROLLERS / "puma6.toml")))
    else:
        case = _case(load_robot(name), "puma3.toml")
    n = case.plant.joints
    q, qd, bristle, torque = _random(n)
    twist, rate, _, external = _random(n, seed=7)
    q_motor, qd_motor = q + 1e-2 * twist, qd + rate
    given = np.tile(numbers(case.plant)[:, np.newaxis], STATES)
    rows = (np.hstack((q, q_motor)), np.hstack((qd, qd_motor)), bristle, torque, external)
    columns = (*(x.T for x in rows), np.full((1, STATES), H), given)
    got = [x.T for x in _c(SUBSTEP, case.loop)(*columns)]
    integrator = Integrator(case.plant)
    for k in range(STATES):
        start = PlantState(
            q[k], qd[k], q_motor[k], qd_motor[k], bristle[k].tolist(), torque[k], torque[k]
        )
        after, first, _ = integrator.advance(start, torque[k], H, H, external[k])
        expected = (
            np.concatenate((after.q, after.q_motor)),
            np.concatenate((after.qd, after.qd_motor)),
            np.array(after.friction),
            first,
        )
        for found, wanted in zip(got, expected, strict=True):
            np.testing.assert_allclose(found[k], wanted, rtol=1e-12, atol=1e-12)


def _variant(folder: Path, name: str) -> Controller:
    """One of the repository's controllers for three joints, or one that computes in double."""
    if name != "float64":
        return load(CONTROLLERS / f"{name}.toml")
    text = (CONTROLLERS / "puma3.toml").read_text(encoding="utf-8")
    path = folder / "puma3_double.toml"
    path.write_text(text.replace('name = "puma3"', f'name = "puma3_double"\n{FLOAT64}'))
    return load(path)


def _assert_close(one: Run, other: Run, tolerance: float = 1e-12) -> None:
    """Equal but for rounding errors of the plant; what the controller computes has equal bits."""
    for name in ("q", "qd", "q_motor", "q_encoder", "torque_applied_Nm", "friction_Nm"):
        a, b = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance, err_msg=name)
    for name in ("time_s", "q_ref", "qd_ref", "qdd_ref", "counts", "torque_commanded_Nm", "status"):
        a, b = getattr(one, name), getattr(other, name)
        np.testing.assert_array_equal(a, b, err_msg=name)
        assert a.dtype == b.dtype
    for a, b in zip(vars(one.end).values(), vars(other.end).values(), strict=True):
        np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize(
    ("name", "delay"),
    [("puma3", 0.0), ("puma3", 0.37), ("puma3", 1.0), ("puma3_fixed", 0.0), ("float64", 0.37)],
)
def test_each_tick_of_a_run_is_that_of_the_loop_in_python(
    robot: Robot, tmp_path: Path, name: str, delay: float
) -> None:
    """One tick at a time, both from the state in which the loop in Python left the last one.

    Fast enough for the drives' limits; two of the counters overflow soon after the start.
    """
    plain, specification = build_plant(robot), _variant(tmp_path, name)
    assert robot.trajectory is not None
    start = plain.encoder.counts(robot.trajectory.start_rad).astype(np.int64)
    encoder = replace(
        plain.encoder,
        offset_counts=np.array([2**31 - 20, 0, -(2**33) - 7]) - start,
        phase=np.array([0.0, 0.3, 0.9]),
    )
    held = np.abs(gravity_torque(plain.model, robot.trajectory.start_rad))
    drive = Drive(held + np.array([8.0, 14.0, 9.0]), delay)
    plant = replace(plain, encoder=encoder, drive=drive)
    loop = CompiledLoop(plant, specification)
    python, compiled = (loop.controller() for _ in range(2))
    whole = beginning(plant, robot.trajectory.faster(6.0), TICK)
    switch_on(python, whole)
    state, excess = whole.state, []
    for tick in range(0, 2000, 10):
        begin = whole.part(tick, 1, state)
        memory = bytes(python.state)
        ctypes.memmove(ctypes.addressof(compiled.state), memory, len(memory))
        expected = run_from(plant, python, begin, TICK, H, progress=False)
        _assert_close(loop.run(plant, compiled, begin, TICK, H, reset=False), expected)
        assert bytes(compiled.state) == bytes(python.state)
        # From here to the next comparison, Python goes alone.
        begin = whole.part(tick + 1, 9, expected.end)
        state = run_from(plant, python, begin, TICK, H, progress=False).end
        commanded = expected.torque_commanded_Nm[0].astype(np.float64)
        excess.append(commanded - drive.limited(commanded))
    assert np.max(excess) > 0.0 > np.min(excess), "the drives are to reach both limits"


EVENTFUL = [
    {"kind": "encoder-noise", "sigma_counts": 0.7},
    {"kind": "encoder-wrap", "at_s": 0.2, "joints": [1]},
    {"kind": "late-ticks", "late": 0.5, "random": True},
    {"kind": "disturbance", "torque_Nm": 8.0, "frequency_Hz": 20.0, "joints": [2, 3]},
    {"kind": "payload", "at_s": 0.1, "duration_s": 0.2, "mass_kg": 0.7},
    {"kind": "payload", "at_s": 0.25, "mass_kg": 0.3, "center_of_mass_m": [0.1, 0.2, 0.3]},
    {"kind": "missed-ticks", "at_s": 0.004, "duration_s": 0.002},
    {"kind": "torque-limit", "at_s": 0.05, "duration_s": 0.3, "factor": 0.4},
    {"kind": "torque-share", "at_s": 0.06, "duration_s": 0.1, "share": 0.7, "joints": [2]},
    {"kind": "encoder-garbage", "at_s": 0.011, "duration_s": 0.002, "joints": [3]},
    {"kind": "encoder-jump", "at_s": 0.014, "duration_s": 0.004, "counts": -3},
    {"kind": "encoder-dropout", "at_s": 0.023, "duration_s": 0.002, "joints": [2]},
    {"kind": "encoder-stuck", "at_s": 0.032, "duration_s": 0.003, "joints": [1]},
    {"kind": "encoder-lost-pulses", "at_s": 0.041, "duration_s": 0.004, "joints": [2, 3]},
]


@pytest.mark.parametrize("mounted", ["motor", "joint"])
@pytest.mark.parametrize("flexible", [True, False])
def test_a_run_with_everything_is_that_of_the_loop_in_python(
    robot: Robot, puma3: Controller, mounted: Mounting, flexible: bool
) -> None:
    """Ten ticks at a time, both from the state in which the loop in Python left the last ones.

    Ten are few enough for the runs to differ by rounding errors only, and enough for every event
    to begin or end within them.
    """
    plain = build_plant(robot)
    springs = Flexibility(np.array([2e4, 2e4, 1e4]), np.array([10.0, 10.0, 0.0]))
    # Counters that begin near 0, so that a reading of 0 is none that the controller refuses.
    offset = -plain.encoder.exact_counts(START)
    plant = replace(
        plain,
        flexibility=springs if flexible else None,
        encoder=replace(plain.encoder, mounted=mounted, offset_counts=offset),
        drive=replace(plain.drive, delay=0.31, bandwidth_Hz=np.array([100.0, 300.0, np.inf])),
    )
    scenario = Scenario.model_validate({"events": EVENTFUL})
    assert robot.trajectory is not None
    whole = beginning(plant, robot.trajectory.faster(8.0), TICK, scenario.script)
    loop = CompiledLoop(plant, puma3, models=whole.script.models)
    python, compiled = (loop.controller() for _ in range(2))
    switch_on(python, whole)
    state, statuses = whole.state, set[int]()
    for tick in range(0, 400, 10):
        begin = whole.part(tick, 10, state)
        memory = bytes(python.state)
        ctypes.memmove(ctypes.addressof(compiled.state), memory, len(memory))
        expected = run_from(plant, python, begin, TICK, H, progress=False)
        _assert_close(loop.run(plant, compiled, begin, TICK, H, reset=False), expected, 1e-9)
        state = expected.end
        statuses |= set(expected.status.tolist())
    assert {0, SATURATED, NOT_CALLED} <= statuses


def test_a_payload_that_the_c_does_not_know_is_refused(reference: Case) -> None:
    motion = RestToRest(np.array([START, START]), np.array([0.01]))
    load = {"kind": "payload", "mass_kg": 1.0, "center_of_mass_m": [0.1, 0.2, 0.3]}
    scenario = Scenario.model_validate({"events": [load]})
    begin = beginning(reference.plant, motion, TICK, scenario.script)
    begin.script.models[-1].gravity.linear = np.array([1.0, 0.0, -9.81])
    with pytest.raises(PlantError, match="another structure"):
        reference.loop.run(reference.plant, reference.loop.controller(), begin, TICK)
    plain = beginning(reference.plant, motion, TICK)
    short = replace(plain, script=plain.script.rows(0, 5))
    with pytest.raises(PlantError, match="the script is for 5 ticks, the reference for 10"):
        reference.loop.run(reference.plant, reference.loop.controller(), short, TICK)


@pytest.mark.parametrize("name", ["puma3", "puma3_fixed"])
def test_a_run_begins_and_tracks_as_in_python(
    reference: Case, robot: Robot, tmp_path: Path, name: str
) -> None:
    controller = GeneratedController(_variant(tmp_path, name))
    assert robot.trajectory is not None
    motion = robot.trajectory.faster(4.0)
    python = simulate(reference.plant, controller, motion, TICK, progress=False)
    compiled = simulate_compiled(reference.plant, controller, motion, TICK)
    assert compiled.q.shape == python.q.shape
    for name_ in ("q", "qd", "counts", "torque_commanded_Nm", "friction_Nm", "status"):
        # Until a count is read differently, the runs differ by rounding errors only.
        a, b = getattr(compiled, name_)[:10], getattr(python, name_)[:10]
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9, err_msg=name_)
    np.testing.assert_allclose(compiled.rms_error_deg(), python.rms_error_deg(), rtol=0.05)
    np.testing.assert_allclose(
        compiled.rms_true_error_deg(), python.rms_true_error_deg(), rtol=0.05
    )


def test_six_joints_fly_on_either_backend() -> None:
    flights = [fly(CONTROLLERS / "puma6.toml", speed=6.0, backend=b) for b in get_args(Backend)]
    python, compiled = (flight.run for flight in flights)
    assert np.any(python.q != compiled.q)
    np.testing.assert_allclose(compiled.rms_error_deg(), python.rms_error_deg(), rtol=0.05)


def _swing(case: Case, substep_s: float) -> PlantState:
    """A quarter second of free fall from the start posture."""
    step, given = ca.external(SUBSTEP, str(case.loop.path)), numbers(case.plant)
    state = [START, np.array([1.0, 0.0, -1.0]), np.zeros(3)]
    for _ in range(round(0.25 / substep_s)):
        *state, _ = step(*state, np.zeros(3), np.zeros(3), substep_s, given)
    q, qd, friction = (np.array(x).ravel() for x in state)
    return PlantState.as_one(q, qd, friction.tolist(), np.zeros(3))


@pytest.fixture(scope="module")
def smooth(reference: Case, puma3: Controller) -> Case:
    plant = replace(reference.plant, friction=frictionless(3))
    return Case(plant, CompiledLoop(plant, puma3))


def test_free_swing_converges_to_an_independent_solution_with_order_one(smooth: Case) -> None:
    def rates(_: float, y: Floats) -> Floats:
        terms = dynamics(smooth.plant.model, y[:3], y[3:], np.zeros(3))
        return np.concatenate((y[3:], np.linalg.solve(terms.M, -terms.tau)))

    start = np.concatenate((START, [1.0, 0.0, -1.0]))
    exact = solve_ivp(rates, (0.0, 0.25), start, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    ends = [_swing(smooth, substep) for substep in (1e-3, 5e-4, 2.5e-4)]
    errors = [np.linalg.norm(np.concatenate((end.q, end.qd)) - exact) for end in ends]
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=0.1)
    assert errors[-1] < 5e-3


def test_energy_of_a_frictionless_swing_is_kept_with_order_one(smooth: Case) -> None:
    model = smooth.plant.model
    before = energy(model, START, np.array([1.0, 0.0, -1.0]))
    ends = [_swing(smooth, substep) for substep in (1e-3, 5e-4, 2.5e-4)]
    drifts = np.array([energy(model, end.q, end.qd) - before for end in ends])
    np.testing.assert_allclose(np.log2(drifts[:-1] / drifts[1:]), 1.0, atol=0.2)
    # What is of first order taken out, a hundredth of the drift is left.
    assert abs(2.0 * drifts[2] - drifts[1]) < 0.02 * abs(drifts[2])


def test_friction_takes_energy_away(reference: Case) -> None:
    before = energy(reference.plant.model, START, np.array([1.0, 0.0, -1.0]))
    end = _swing(reference, H)
    assert energy(reference.plant.model, end.q, end.qd) < before - 1.0


def _bits(run: Run) -> dict[str, bytes]:
    arrays = {**vars(run), "end": np.array([run.end.q, run.end.qd, run.end.friction])}
    return {name: np.asarray(x).tobytes() for name, x in arrays.items()}


def test_runs_in_threads_have_the_bits_of_runs_one_after_the_other(
    reference: Case, robot: Robot
) -> None:
    """Gains and friction differ from run to run; all share one library."""
    assert robot.trajectory is not None
    begin = beginning(reference.plant, robot.trajectory.faster(2.0), TICK)
    rows = ("Exp01", "Exp02", "Exp05", "Exp08", "Exp13")
    tuned = [load(CONTROLLERS / "puma3.toml", experiment=row) for row in rows]

    def fly_one(i: int) -> dict[str, bytes]:
        controller = reference.loop.controller()
        controller.set_gains(tuned[i % len(tuned)])
        plant = _rougher(reference.plant, 1.0 + 0.5 * (i // len(tuned)))
        return _bits(reference.loop.run(plant, controller, begin, TICK))

    runs = range(3 * len(tuned))
    one_by_one = [fly_one(i) for i in runs]
    with ThreadPoolExecutor(8) as pool:
        assert [*pool.map(fly_one, runs)] == one_by_one
    assert len({run["q"] for run in one_by_one}) == len(runs)


def _rougher(plant: Plant, factor: float) -> Plant:
    assert isinstance(plant.friction, LuGre)
    joints = tuple(
        replace(
            joint,
            viscous_Nms_per_rad=factor * joint.viscous_Nms_per_rad,
            curve=replace(
                joint.curve, coulomb_positive_Nm=factor * joint.curve.coulomb_positive_Nm
            ),
        )
        for joint in plant.friction.parameters
    )
    return replace(plant, friction=LuGre(joints))


def _variables(path: Path) -> set[str]:
    """What a library could write to, by name."""
    command = ["nm", "--format=posix", str(path)]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    symbols = (line.split()[:2] for line in told.splitlines())
    return {name for name, kind in symbols if kind in "bBdDC"}


def test_the_library_has_no_memory_of_its_own(reference: Case) -> None:
    """But for what the compiler puts into every shared library."""
    empty = library("empty", {"empty.c": b"extern const int nothing;\n"})
    one = library("one", {"one.c": b"int one;\n"})
    assert _variables(reference.loop.path) <= _variables(empty)
    assert _variables(one) - _variables(empty) == {"one"}


def test_structures_are_those_of_the_header() -> None:
    structures: dict[str, type[ctypes.Structure]] = {
        "loop_part": loop.LoopPart,
        "loop_plant": loop.LoopPlant,
        "loop_state": loop.LoopState,
        "loop_record": loop.LoopRecord,
        "loop_controller": loop.LoopController,
    }
    offsets = [
        f"offsetof({name}, {field[0]})"
        for name, made in structures.items()
        for field in made._fields_
    ]
    values = [*(f"sizeof({name})" for name in structures), *offsets, "LOOP_MAX_JOINTS"]
    text = '#include "loop.h"\n#include <stddef.h>\n'
    text += f"const size_t values[] = {{{', '.join(values)}}};\n"
    header = (loop.FOLDER / "loop.h").read_bytes()
    path = library("structures", {"structures.c": text.encode(), "loop.h": header})
    found = (ctypes.c_size_t * len(values)).in_dll(ctypes.CDLL(str(path)), "values")
    expected = [ctypes.sizeof(made) for made in structures.values()]
    expected += [getattr(made, f[0]).offset for made in structures.values() for f in made._fields_]
    assert [*found] == [*expected, loop.MAX_JOINTS]


def test_other_numbers_need_no_other_library(reference: Case, puma3: Controller) -> None:
    rougher = _rougher(reference.plant, 1.5)
    assert CompiledLoop(rougher, puma3).path == reference.loop.path
    heavier = replace(reference.plant, model=reference.plant.model.copy())
    heavier.model.armature = 2.0 * reference.plant.model.armature
    assert structure(heavier) == structure(reference.plant)
    assert np.any(numbers(heavier) != numbers(reference.plant))
    # Where nothing rubs, nothing of the friction is in the C.
    smooth = replace(reference.plant, friction=frictionless(3))
    assert "exp(" in dynamics_c(structure(rougher))
    assert "exp(" not in dynamics_c(structure(smooth))


def test_the_same_plant_gives_the_same_c(reference: Case) -> None:
    once, again = (dynamics_c.__wrapped__(structure(reference.plant)) for _ in range(2))
    assert once == again


def test_controller_errors_name_tick_and_status_as_in_python(
    reference: Case, puma3: Controller
) -> None:
    motion = RestToRest(np.array([START, START + 0.5]), np.array([0.05]))
    told = []
    for run in (simulate, simulate_compiled):
        controller = GeneratedController(puma3)
        controller.config.joint[1].max_displacement = 1
        with pytest.raises(ControllerError) as raised:
            run(reference.plant, controller, motion, TICK, progress=False)
        told.append((raised.value.tick, raised.value.status))
    assert told[0] == told[1]
    assert told[0][0] > 0
    for run in (simulate, simulate_compiled):
        controller = GeneratedController(puma3)
        controller.config.joint[1].inertia_kgm2 = -1.0
        with pytest.raises(ControllerError, match="at its reset"):
            run(reference.plant, controller, motion, TICK, progress=False)


def test_non_finite_motion_stops_the_run(reference: Case) -> None:
    motion = RestToRest(np.array([START, START]), np.array([0.01]))
    begin = beginning(reference.plant, motion, TICK)
    controller = reference.loop.controller()
    for qd, tick in ((np.nan, 0), (1e300, 0)):
        state = replace(begin.state, qd=np.full(3, qd))
        with pytest.raises(PlantError, match=f"non-finite in tick {tick}"):
            reference.loop.run(reference.plant, controller, replace(begin, state=state), TICK)


def test_what_cannot_be_run_says_why(reference: Case, puma3: Controller, six: Case) -> None:
    with pytest.raises(PlantError, match="puma560 has 6 joints, controller puma3 3"):
        CompiledLoop(six.plant, puma3)
    motion = RestToRest(np.array([START, START]), np.array([0.01]))
    begin = beginning(reference.plant, motion, TICK)
    six_joints = RestToRest(np.zeros((2, 6)), np.array([0.01])).sampled(TICK)
    smooth = replace(reference.plant, friction=frictionless(3))
    with pytest.raises(PlantError, match="another structure"):
        reference.loop.run(smooth, reference.loop.controller(), begin, TICK)
    for wrong in (
        replace(begin, reference=six_joints),
        replace(begin, state=replace(begin.state, command_Nm=np.zeros(2))),
        replace(begin, state=replace(begin.state, friction=[0.0])),
    ):
        with pytest.raises(PlantError, match="joint"):
            reference.loop.run(reference.plant, reference.loop.controller(), wrong, TICK)
    lame = replace(reference.plant, drive=Drive(np.ones(1)))
    with pytest.raises(PlantError, match=r"3 numbers are needed, one a joint, not shape \(1,\)"):
        reference.loop.run(lame, reference.loop.controller(), begin, TICK)
    fixed = GeneratedController(load(CONTROLLERS / "puma3_fixed.toml"))
    with pytest.raises(LayoutError, match="another controller than puma3_fixed"):
        reference.loop.run(reference.plant, fixed, begin, TICK)
    bare = GeneratedController(puma3, shared_library(sources_of(puma3)))
    with pytest.raises(PlantError, match="needs the C"):
        simulate_compiled(reference.plant, bare, motion, TICK)
    ball = pin.Model()
    ball.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    with pytest.raises(PlantError, match=r"joint ball .* fixed axis"):
        CompiledLoop(replace(reference.plant, model=ball), puma3)
    with pytest.raises(PlantError, match="33 joints, more than 32"):
        loop.structure_of(replace(reference.plant, model=_chain(33)))


def _chain(joints: int) -> pin.Model:
    model = pin.Model()
    for i in range(joints):
        model.addJoint(i, pin.JointModelRZ(), pin.SE3.Identity(), f"joint {i}")
    return model
