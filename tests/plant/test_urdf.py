"""Robots with a URDF: what is read of it, what is refused, and robots that are based on others."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from plant.__main__ import main
from plant.model import build_model, dynamics, link_placement
from plant.robot import ROBOTS, LinksTable, RobotError, load_robot
from plant.urdf import UrdfBody, UrdfError, package_file, read_urdf

UR5 = (ROBOTS / "ur5.toml").read_text(encoding="utf-8")
UR5_URDF = package_file("example-robot-data", "ur_description/urdf/ur5_robot.urdf")
BASED = 'description = "mine"\nbased_on = "ur5"\n'


def _written(folder: Path, text: str, name: str = "mine.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def _with_urdf(folder: Path, before: str, after: str) -> Path:
    """A UR5 whose URDF, beside it, is another."""
    text = UR5_URDF.read_text(encoding="utf-8")
    assert before in text
    _written(folder, text.replace(before, after, 1), "mine.urdf")
    table = '[urdf]\nsource = "x"\nfile = "mine.urdf"\ngravity_m_per_s2 = 9.81\n'
    return _written(folder, BASED + table)


@pytest.mark.parametrize(("name", "locked"), [("ur5", 0), ("panda", 2), ("z1", 1)])
def test_dynamics_are_those_of_the_whole_urdf(name: str, locked: int) -> None:
    """Pinocchio reads the file itself, unlocked and unedited; what is locked stands at zero."""
    robot = load_robot(name)
    assert isinstance(robot.body, UrdfBody)
    file = {"ur5": "ur5_robot.urdf", "panda": "panda.urdf", "z1": "z1.urdf"}[name]
    whole = pin.buildModelFromUrdf(str(package_file("example-robot-data", f"urdf/{file}")))
    assert tuple(whole.names)[1:] == robot.joint_names + robot.locked_names
    whole.gravity.linear = np.array([0.0, 0.0, -9.81])
    n, ours = robot.joints, build_model(robot)
    rng = np.random.default_rng(5)
    for q, qd, qdd in rng.uniform(-2.0, 2.0, (10, 3, n)):
        still = [np.concatenate((x, np.zeros(locked))) for x in (q, qd, qdd)]
        expected = pin.rnea(whole, whole.createData(), *still)[:n] + robot.armature_kgm2 * qdd
        np.testing.assert_allclose(dynamics(ours, q, qd, qdd).tau, expected, rtol=0, atol=1e-10)


def test_the_flange_is_where_the_maker_says() -> None:
    """DH parameters of the UR5 (Universal Robots, CB3 manual, table C.3), the arm stretched."""
    reach = 0.42500 + 0.39225
    placement = link_placement(build_model(load_robot("ur5")), np.zeros(6), 6)
    # The joint's axis lies 0.10915 m beside the plane of the arm, 0.09465 m below it.
    np.testing.assert_allclose(placement[:3, 3], [reach, 0.10915, 0.089159 - 0.09465], atol=1e-5)


def test_ranges_are_those_of_the_file() -> None:
    ranges = {x.name: x.range_deg for x in load_robot("z1").chain}
    assert ranges["joint2"] == pytest.approx((0.0, 170.0))
    assert ranges["joint3"] == pytest.approx((-165.0, 0.0))
    assert load_robot("panda").chain[-1].range_deg is None, "a finger slides"


def test_a_motion_out_of_the_ranges_is_refused(tmp_path: Path) -> None:
    text = (ROBOTS / "z1.toml").read_text(encoding="utf-8")
    path = _written(tmp_path, text.replace("amplitude_deg = 40", "amplitude_deg = 88"))
    with pytest.raises(RobotError, match="takes the joint2 from 2 to 178 deg, its range is 0 to"):
        load_robot(path)


def test_continuous_joints_turn_without_limits(tmp_path: Path) -> None:
    before = '<joint name="wrist_3_joint" type="revolute">'
    path = _with_urdf(tmp_path, before, before.replace("revolute", "continuous"))
    robot = load_robot(path)
    assert robot.chain[5].range_deg is None
    model = build_model(robot)
    assert (model.nq, model.nv) == (6, 6)
    q = np.full(6, 100.0)
    np.testing.assert_array_equal(
        dynamics(model, q, q, q).tau, dynamics(build_model(load_robot("ur5")), q, q, q).tau
    )


def test_only_what_dynamics_depend_on_is_kept() -> None:
    robot = load_robot("z1")
    assert isinstance(robot.body, UrdfBody)
    for word in ("mesh", "visual", "collision", "damping", "transmission", "gazebo"):
        assert word not in robot.body.xml


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (
            '"wrist_3_joint" type="revolute"',
            '"wrist_3_joint" type="floating"',
            'joint wrist_3_joint is floating, .*lock it with locked = ["wrist_3_joint"]',
        ),
        (
            '"wrist_3_joint" type="revolute"',
            '"wrist_3_joint" type="prismatic"',
            "joint wrist_3_joint slides, but [trajectory]",
        ),
        (
            '<axis xyz="0 0 1"/>',
            '<axis xyz="0 0 1"/><mimic joint="elbow_joint"/>',
            'joint shoulder_pan_joint follows elbow_joint: lock it with locked = ["shoulder_pan',
        ),
        ('lower="-6.28318530718"', 'lower="low"', "joint shoulder_pan_joint has the limit 'low'"),
        ('<child link="shoulder_link"/>', "", "joint shoulder_pan_joint has no <child link=...>"),
        ('<child link="shoulder_link"/>', '<child link="x"/>', "connects link x, which isn't"),
        (
            '<child link="upper_arm_link"/>',
            '<child link="shoulder_link"/>',
            "link shoulder_link is moved by two joints",
        ),
        ('<link name="world"/>', '<link name="world"/><link name="moon"/>', "2 links are moved by"),
        ("</robot>", "", "no valid XML"),
        ("<robot ", "<robots><robot ", "no valid XML"),
    ],
)
def test_what_is_wrong_with_a_urdf_is_refused(
    tmp_path: Path, before: str, after: str, message: str
) -> None:
    with pytest.raises(RobotError) as refusal:
        load_robot(_with_urdf(tmp_path, before, after))
    assert re.search(re.escape(message).replace(r"\.\*", ".*"), str(refusal.value))
    assert "mine.toml" in str(refusal.value)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("ur5_robot.urdf", "ur6_robot.urdf", "0 files of package example-robot-data are called"),
        ("ur_description/urdf/ur5_robot.urdf", "urdf", "0 files of package"),
        ('"example-robot-data"', '"example-robots"', "pip install example-robots"),
        ('package = "example-robot-data"\n', "", "no URDF .*ur5_robot.urdf: No such file"),
        ("wrist = [4, 5, 6]", "wrist = [4, 5, 7]", "wrist: there are no joints .7. to lock"),
        ("[urdf]", 'locked = ["wrist"]\n[urdf]', "locked: .*'wrist'.*wrist_1_joint"),
        ("[urdf]", 'locked = ["wrist_3_joint"]\n[urdf]', "coulomb_Nm has 6 values, 5 joints are"),
        ("[urdf]", "[links]\nx = 1\n[urdf]", "links.source"),
    ],
)
def test_what_is_wrong_with_a_robot_file_is_refused(
    tmp_path: Path, before: str, after: str, message: str
) -> None:
    assert before in UR5
    with pytest.raises(RobotError, match=message):
        load_robot(_written(tmp_path, UR5.replace(before, after)))


def test_a_file_that_is_no_urdf_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UrdfError, match="root element is <mujoco>, a URDF's is <robot>"):
        read_urdf(_written(tmp_path, "<mujoco/>", "x.urdf"), 9.81)


def test_one_of_several_files_of_that_name_is_not_guessed() -> None:
    with pytest.raises(UrdfError, match=r"\d+ files of package example-robot-data .*, not one"):
        package_file("example-robot-data", "README.md")


def test_joints_are_locked_by_name_or_number(tmp_path: Path) -> None:
    text = UR5[: UR5.index("[friction]")]
    for locked in ('["wrist_3_joint", 5]', "[5, 6]"):
        robot = load_robot(_written(tmp_path, f"locked = {locked}\n{text}"))
        assert robot.locked_names == ("wrist_2_joint", "wrist_3_joint")
        assert build_model(robot).nq == 4


def test_a_variant_is_a_few_lines(tmp_path: Path) -> None:
    drive = '[drive]\nsource = "weaker"\ngiven_at = "joint"\ntorque_limit_Nm = 10\n'
    robot, ur5 = load_robot(_written(tmp_path, BASED + drive)), load_robot("ur5")
    assert robot.drive is not None
    np.testing.assert_array_equal(robot.drive.torque_limit_Nm, np.full(6, 10.0))
    assert robot.body == ur5.body
    assert robot.friction == ur5.friction
    sources = dict(robot.sources)
    assert sources["drive"] == "weaker"
    assert sources["urdf"] == dict(ur5.sources)["urdf"]
    assert robot.description == "mine"


def test_locked_joints_are_inherited_unless_others_are(tmp_path: Path) -> None:
    variant = _written(tmp_path, BASED.replace("ur5", "panda"))
    assert load_robot(variant).locked_names == load_robot("panda").locked_names
    other = 'locked = ["panda_joint7", "panda_finger_joint1", "panda_finger_joint2"]\n'
    with pytest.raises(RobotError, match="motor_inertia_kgm2 has 7 values, 6 joints are not"):
        load_robot(_written(tmp_path, BASED.replace("ur5", "panda") + other))


def test_another_body_takes_the_place_of_the_inherited_one(tmp_path: Path) -> None:
    text = (ROBOTS / "puma560.toml").read_text(encoding="utf-8")
    links = text[text.index("[links]") : text.index("[transmission]")]
    robot = load_robot(_written(tmp_path, BASED + "[trajectory]\n" + _motion() + links))
    assert isinstance(robot.body, LinksTable)
    np.testing.assert_array_equal(robot.armature_kgm2, load_robot("ur5").armature_kgm2)


def test_a_urdf_takes_the_place_of_inherited_links(tmp_path: Path) -> None:
    table = UR5[UR5.index("[urdf]") : UR5.index("[transmission]")]
    robot = load_robot(_written(tmp_path, BASED.replace("ur5", "puma560") + table))
    assert robot.body == load_robot("ur5").body
    np.testing.assert_array_equal(robot.gear_ratio, load_robot("puma560").gear_ratio)


def _motion() -> str:
    keys = ('source = "x"', "start_deg = [0, 0, 0, 0, 0, 0]", "amplitude_deg = 1", "via = [0, 1]")
    return "\n".join([*keys, "segment_s = 1", ""])


def test_files_are_seen_from_the_folder_of_the_file_that_names_them(tmp_path: Path) -> None:
    folder = tmp_path / "base"
    folder.mkdir()
    _with_urdf(folder, "x", "x")
    variant = 'description = "mine"\nbased_on = "base/mine.toml"\n'
    assert load_robot(_written(tmp_path, variant)).body == load_robot(folder / "mine.toml").body


def test_robots_that_are_based_on_each_other_are_refused(tmp_path: Path) -> None:
    _written(tmp_path, 'description = "x"\nbased_on = "mine.toml"\n', "other.toml")
    path = _written(tmp_path, 'description = "x"\nbased_on = "other.toml"\n')
    with pytest.raises(RobotError, match=r"mine\.toml is based on other itself"):
        load_robot(path)


def test_a_missing_base_names_the_file_that_wants_it(tmp_path: Path) -> None:
    path = _written(tmp_path, BASED.replace("ur5", "ur55"))
    with pytest.raises(RobotError, match=r"mine.toml: based_on: unknown robot 'ur55'.*'ur5'"):
        load_robot(path)


def test_the_urdf_can_be_replaced(tmp_path: Path) -> None:
    heavier = _with_urdf(tmp_path, '<mass value="8.393"/>', '<mass value="9"/>')
    replaced = load_robot("ur5", urdf=tmp_path / "mine.urdf")
    assert replaced.body.chain == load_robot("ur5").body.chain
    q = np.zeros(6)
    gravity = dynamics(build_model(replaced), q, q, q).g
    np.testing.assert_array_equal(gravity, dynamics(build_model(load_robot(heavier)), q, q, q).g)
    # The upper arm's centre of mass is 0.28 m from the shoulder.
    less = dynamics(build_model(load_robot("ur5")), q, q, q).g
    assert math.isclose(gravity[1] - less[1], -(9 - 8.393) * 0.28 * 9.81, rel_tol=1e-9)
    with pytest.raises(RobotError, match=r"puma560.toml: has \[links\]"):
        load_robot("puma560", urdf=tmp_path / "mine.urdf")


def test_a_robot_may_leave_its_urdf_to_the_command_line(tmp_path: Path) -> None:
    path = _written(tmp_path, BASED + '[urdf]\nsource = "x"\ngravity_m_per_s2 = 9.81\n')
    with pytest.raises(RobotError, match=r"urdf\.file: name the URDF here, or with --urdf"):
        load_robot(path)
    assert load_robot(path, urdf=UR5_URDF).joint_names == load_robot("ur5").joint_names


def test_dynamics_of_a_urdf_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dynamics", "--robot", "ur5", "--q=0,-1.5,1.5,0,0,0"]) == 0
    assert "wrist_3_joint" in capsys.readouterr().out
    assert main(["dynamics", "--robot", "panda", "--q=0,0,0,-1,0,1,0"]) == 0
    assert "locked at zero: panda_finger_joint1, panda_finger_joint2" in capsys.readouterr().out
