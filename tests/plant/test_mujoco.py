"""Rigid-body dynamics against MuJoCo, which shares no code with Pinocchio."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from plant.model import build_model
from plant.mujoco_arm import mujoco_model
from plant.robot import InertiaTensor, Link, LinksTable, Robot, load_robot

Floats = NDArray[np.float64]
Keys = tuple[str | int, ...]

# Of the largest element of the matrix or vector; rounding makes some 1e-14.
TOLERANCE = 1e-12
STATES = 10
SWING_S = 1.0
# Short enough for the Z1, whose light wrist swings fast.
SWING_STEP_S = 5e-4
SWING_TOLERANCE_RAD = 1e-9
# When one number differs by 1 %, a comparison must miss its tolerance by this factor at least.
NOTICED = 10
# How high the base stands adds a constant to the potential energy: no motion shows it.
WITHOUT_EFFECT = {("chain", 0, "d_m")}


def _model(robot: Robot) -> Any:
    """Without friction, for a swing."""
    return mujoco_model(robot, SWING_STEP_S, fourth_order=True)


def _mujoco_terms(model: Any, q: Floats, qd: Floats) -> tuple[Floats, Floats]:
    """M [kg m^2] with armature, and C qd + g [N m]."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, qd
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return M, data.qfrc_bias.copy()


def _pinocchio_terms(model: pin.Model, q: Floats, qd: Floats) -> tuple[Floats, Floats]:
    """The same two of the plant's model."""
    data = model.createData()
    M = pin.crba(model, data, q).copy()
    return M, pin.nonLinearEffects(model, data, q, qd).copy()


def _disagreement(ours: Robot, theirs: Any) -> tuple[float, float]:
    """Largest differences of M and of the bias forces, relative to the largest element of each.

    Args:
        ours: the robot that Pinocchio gets.
        theirs: the model that MuJoCo gets.
    """
    rng = np.random.default_rng(1986)
    model = build_model(ours)
    worst = np.zeros(2)
    for _ in range(STATES):
        q, qd = rng.uniform(-3.0, 3.0, (2, ours.joints))
        pairs = zip(_pinocchio_terms(model, q, qd), _mujoco_terms(theirs, q, qd), strict=True)
        found = [np.max(np.abs(own - other)) / np.max(np.abs(other)) for own, other in pairs]
        worst = np.maximum(worst, found)
    return float(worst[0]), float(worst[1])


def _made_up(convention: str) -> Robot:
    """Five links, the third locked, with nothing at zero: skew axes and full inertia tensors."""
    rng = np.random.default_rng(5)

    def link(index: int) -> Link:
        # Of masses of 1 kg at three points, so that it is the inertia of a real body.
        points = rng.uniform(-0.3, 0.3, (3, 3))
        tensor = np.trace(points @ points.T) * np.eye(3) - points @ points.T
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor.tolist()
        a, d, alpha = rng.uniform([-0.5, -0.5, -170.0], [0.5, 0.5, 170.0]).tolist()
        return Link(
            name=f"link {index}",
            a_m=a,
            alpha_deg=alpha,
            d_m=d,
            mass_kg=float(rng.uniform(0.5, 5.0)),
            center_of_mass_m=rng.uniform(-0.3, 0.3, 3).tolist(),
            inertia_kgm2=InertiaTensor(xx=xx, yy=yy, zz=zz, xy=xy, yz=yz, xz=xz),
        )

    links = LinksTable.model_validate(
        {
            "source": "made up",
            "convention": convention,
            "gravity_m_per_s2": 9.81,
            "chain": [link(index) for index in range(5)],
        }
    )
    moving = (0, 1, 3, 4)
    return replace(
        load_robot("puma560_akb"),
        body=links,
        moving=moving,
        armature_kgm2=rng.uniform(0.1, 1.0, len(moving)),
    )


PUMAS: dict[str, Callable[[], Robot]] = {
    "puma560": lambda: load_robot("puma560"),
    "puma560, wrist locked": lambda: load_robot("puma560", lock_wrist=True),
    "puma560_akb": lambda: load_robot("puma560_akb"),
    "reference": lambda: load_robot("reference"),
}
URDFS: dict[str, Callable[[], Robot]] = {
    "ur5": lambda: load_robot("ur5"),
    "ur5, wrist locked": lambda: load_robot("ur5", lock_wrist=True),
    "panda": lambda: load_robot("panda"),
    "z1": lambda: load_robot("z1"),
}
ARMS = (
    PUMAS
    | URDFS
    | {
        "made up, standard DH": lambda: _made_up("standard-dh"),
        "made up, modified DH": lambda: _made_up("modified-dh"),
    }
)


ALL_KINDS = """
description = "a joint of each kind, and one more that is locked"
locked = ["flies"]

[urdf]
source = "made up"
file = "mine.urdf"
gravity_m_per_s2 = 9.81

[transmission]
source = "made up"
gear_ratio = [10, 20, 30]
motor_inertia_kgm2 = 1e-3
"""
_INERTIAL = """
  <inertial>
    <origin xyz="0.1 0.2 -0.3" rpy="0.3 -0.2 0.1"/><mass value="2"/>
    <inertia ixx="0.03" ixy="0.001" ixz="-0.002" iyy="0.04" iyz="0.003" izz="0.05"/>
  </inertial>
  <visual><geometry><mesh filename="package://nowhere/no.stl"/></geometry></visual>
  <collision><geometry><mesh filename="nor_here.dae"/></geometry></collision>"""
ALL_KINDS_URDF = f"""<robot name="mine">
<link name="base"/>
<link name="one">{_INERTIAL}</link>
<link name="two">{_INERTIAL}</link>
<link name="three">{_INERTIAL}</link>
<link name="four">{_INERTIAL}</link>
<joint name="turns" type="revolute">
  <parent link="base"/><child link="one"/><origin xyz="0 0 0.4" rpy="0.5 0.6 0.7"/>
  <axis xyz="0.6 0 0.8"/><limit lower="-1" upper="2" effort="9" velocity="9"/>
  <dynamics damping="7" friction="8"/>
</joint>
<joint name="slides" type="prismatic">
  <parent link="one"/><child link="two"/><origin xyz="0.3 0 0" rpy="0.1 0 0.9"/>
  <axis xyz="0 1 0"/><limit lower="0" upper="0.1" effort="9" velocity="9"/>
</joint>
<joint name="spins" type="continuous">
  <parent link="two"/><child link="three"/><origin xyz="0 0.2 0" rpy="0 0.7 0"/>
  <axis xyz="1 0 0"/>
</joint>
<joint name="flies" type="floating">
  <parent link="three"/><child link="four"/><origin xyz="0 0.2 0.1" rpy="0 0.7 1"/>
</joint>
</robot>
"""


@pytest.fixture(params=ARMS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return ARMS[request.param]()


@pytest.fixture(params=PUMAS)
def puma(request: pytest.FixtureRequest) -> Robot:
    return PUMAS[request.param]()


def test_a_urdf_with_all_supported_joints_is_that_of_mujoco(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(ALL_KINDS, encoding="utf-8")
    (tmp_path / "mine.urdf").write_text(ALL_KINDS_URDF, encoding="utf-8")
    robot = load_robot(path)
    assert robot.joint_names == ("turns", "slides", "spins")
    inertia, bias = _disagreement(robot, _model(robot))
    assert inertia < TOLERANCE
    assert bias < TOLERANCE


def test_inertia_and_bias_forces_are_those_of_mujoco(robot: Robot) -> None:
    inertia, bias = _disagreement(robot, _model(robot))
    assert inertia < TOLERANCE
    assert bias < TOLERANCE


def _start(robot: Robot) -> Floats:
    """A posture [rad] in which no joint is balanced."""
    return np.linspace(0.3, 0.9, robot.joints)


def _swing_in_mujoco(model: Any, start: Floats) -> Floats:
    """Positions [rad] after a free swing from rest, by MuJoCo's Runge-Kutta of order four."""
    data = mujoco.MjData(model)
    data.qpos[:] = start
    for _ in range(round(SWING_S / SWING_STEP_S)):
        mujoco.mj_step(model, data)
    return np.array(data.qpos)


def _swing_in_pinocchio(robot: Robot, start: Floats) -> Floats:
    """The same from Pinocchio's accelerations, by SciPy's Runge-Kutta of order eight."""
    model, n = build_model(robot), robot.joints
    data, no_torque = model.createData(), np.zeros(n)

    def rates(_: float, y: Floats) -> Floats:
        return np.concatenate((y[n:], pin.aba(model, data, y[:n], y[n:], no_torque)))

    at_rest = np.concatenate((start, np.zeros(n)))
    solution = solve_ivp(rates, (0.0, SWING_S), at_rest, method="DOP853", rtol=1e-12, atol=1e-13)
    positions: Floats = solution.y[:n, -1]
    return positions


def test_free_swing_is_that_of_mujoco(robot: Robot) -> None:
    start = _start(robot)
    theirs = _swing_in_mujoco(_model(robot), start)
    assert np.max(np.abs(theirs - start)) > 0.5, "the arm must swing to show anything"
    ours = _swing_in_pinocchio(robot, start)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=SWING_TOLERANCE_RAD)


def _numbers(table: Any) -> Iterator[Keys]:
    """Where the numbers other than 0 stand in a table of dictionaries and lists."""
    for key, value in table.items() if isinstance(table, dict) else enumerate(table):
        if isinstance(value, float) and value != 0.0:
            yield (key,)
        elif isinstance(value, dict | list) and key != "range_deg":  # what the joint may do
            yield from ((key, *rest) for rest in _numbers(value))


def _with_one_number_larger(robot: Robot) -> Iterator[tuple[Keys, Robot]]:
    """Robots that differ from this one by 1 % of one number, and where that number stands."""
    assert isinstance(robot.body, LinksTable)
    links = robot.body.model_dump()
    for keys in _numbers(links):
        changed = deepcopy(links)
        table: Any = changed
        for key in keys[:-1]:
            table = table[key]
        table[keys[-1]] *= 1.01
        yield keys, replace(robot, body=LinksTable.model_validate(changed))
    for joint in range(robot.joints):
        armature = robot.armature_kgm2.copy()
        armature[joint] *= 1.01
        yield ("armature_kgm2", joint), replace(robot, armature_kgm2=armature)


def _unnoticed(robot: Robot, difference: Callable[[Robot], float], tolerance: float) -> set[Keys]:
    """The numbers of which 1 % changes too little for a comparison with that tolerance."""
    changed = dict(_with_one_number_larger(robot))
    assert len(changed) > 40, "all numbers of the links and motors"
    return {keys for keys, other in changed.items() if difference(other) < NOTICED * tolerance}


def test_one_per_cent_of_any_number_changes_inertia_or_bias_forces(puma: Robot) -> None:
    theirs = _model(puma)

    def difference(changed: Robot) -> float:
        return max(_disagreement(changed, theirs))

    assert _unnoticed(puma, difference, TOLERANCE) <= WITHOUT_EFFECT


def test_one_per_cent_of_any_number_changes_the_free_swing(puma: Robot) -> None:
    start = _start(puma)
    theirs = _swing_in_mujoco(_model(puma), start)

    def difference(changed: Robot) -> float:
        return float(np.max(np.abs(_swing_in_pinocchio(changed, start) - theirs)))

    assert _unnoticed(puma, difference, SWING_TOLERANCE_RAD) <= WITHOUT_EFFECT
