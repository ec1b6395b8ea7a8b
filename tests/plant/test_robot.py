"""Robot files: what is right is read, what is wrong is refused with the reason."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plant.friction import CoulombStribeck, LuGre
from plant.robot import ROBOTS, LinksTable, RobotError, load_robot, robot_names

REFERENCE = (ROBOTS / "reference.toml").read_text(encoding="utf-8")


def _written(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def _edited(folder: Path, before: str, after: str) -> Path:
    assert REFERENCE.count(before) == 1
    return _written(folder, REFERENCE.replace(before, after))


def test_there_are_the_robots() -> None:
    assert robot_names() == [
        "panda",
        "puma560",
        "puma560_akb",
        "reference",
        "reference_flexible",
        "reference_published_friction",
        "ur5",
        "z1",
    ]
    for name in robot_names():
        robot = load_robot(name)
        assert robot.name == name
        assert all(source for _, source in robot.sources)


@pytest.mark.parametrize("lock_wrist", [False, True])
def test_puma560_is_the_published_one(published: dict[str, Any], lock_wrist: bool) -> None:
    robot = load_robot("puma560", lock_wrist=lock_wrist)
    n = 3 if lock_wrist else 6
    assert robot.joints == n
    assert isinstance(robot.body, LinksTable)
    for link, expected in zip(robot.body.chain, published["links"], strict=True):
        assert link.a_m == expected["a"]
        assert link.d_m == pytest.approx(expected["d"], abs=1e-15)
        assert np.deg2rad(link.alpha_deg) == expected["alpha"]
        assert link.mass_kg == expected["m"]
        assert link.center_of_mass_m == expected["r"]
        np.testing.assert_array_equal(link.inertia_kgm2.matrix(), expected["I"])
        assert link.range_deg is not None
        np.testing.assert_allclose(np.deg2rad(link.range_deg), expected["qlim"], rtol=1e-12)
    assert robot.gear_ratio.tolist() == [link["G"] for link in published["links"]][:n]


def test_reference_takes_its_links_from_another_robot() -> None:
    reference, akb = load_robot("reference"), load_robot("puma560_akb")
    assert reference.body == akb.body
    assert reference.joint_names == ("waist", "shoulder", "elbow")
    assert "based_on" in REFERENCE
    assert "mass_kg" not in REFERENCE


def test_values_given_at_the_motor_are_taken_to_the_joint() -> None:
    robot = load_robot("reference")
    assert robot.drive is not None
    # Jin et al. 2017, section IV: 0.637, 0.637, 0.319 N m behind gears of 120:1.
    np.testing.assert_allclose(robot.drive.torque_limit_Nm, [76.44, 76.44, 38.28])
    np.testing.assert_allclose(robot.armature_kgm2, [0.301, 0.301, 0.0936], rtol=1e-3)


def test_locking_the_wrist_drops_its_columns() -> None:
    six, three = load_robot("puma560"), load_robot("puma560", lock_wrist=True)
    for a, b in ((six.drive, three.drive), (six.encoder, three.encoder)):
        assert a is not None
        assert b is not None
        for value, kept in zip(vars(a).values(), vars(b).values(), strict=True):
            np.testing.assert_array_equal(np.atleast_1d(value)[:3], np.atleast_1d(kept))
    assert isinstance(six.friction, LuGre)
    assert isinstance(three.friction, LuGre)
    assert three.friction.parameters == six.friction.parameters[:3]


def test_friction_model_can_be_chosen() -> None:
    assert isinstance(load_robot("reference").friction, LuGre)
    assert isinstance(
        load_robot("reference", friction="coulomb-stribeck").friction, CoulombStribeck
    )
    dahl = load_robot("reference", friction="dahl").friction
    assert isinstance(dahl, LuGre)
    assert {joint.curve.static_over_coulomb for joint in dahl.parameters} == {1.0}
    presliding = [j.curve.coulomb_positive_Nm / j.stiffness_Nm_per_rad for j in dahl.parameters]
    assert presliding == pytest.approx([3e-4] * 3)


def test_unknown_robot_names_the_nearest() -> None:
    with pytest.raises(RobotError, match=r"'puma56'.*'puma560'"):
        load_robot("puma56")
    with pytest.raises(RobotError, match="puma560, puma560_akb, reference"):
        load_robot("qqq")
    with pytest.raises(RobotError, match=r"no robot file .*nowhere\.toml"):
        load_robot("nowhere.toml")


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("pulses_per_rev = 2048", "pulses_per_rev = 2048\npulses = 1", "encoder.pulses: Extra"),
        ("pulses_per_rev = 2048", 'pulses_per_rev = "2048"', "encoder.pulses_per_rev: .*integer"),
        ("pulses_per_rev = 2048", "pulses_per_rev = 0", "encoder.pulses_per_rev: .*greater"),
        ("gear_ratio = 120", "gear_ratio = [120, 120]", "transmission.gear_ratio has 2 values, 3"),
        ("gear_ratio = 120", "gear_ratio = [120, 0, 1]", "gear_ratio must not be 0"),
        ("gear_ratio = 120", "gear_ratio = inf", "transmission.gear_ratio.*finite"),
        ("start_deg = [0, -45, 90]", "start_deg = [0]", "trajectory.start_deg has 1 values, 3"),
        ("[[6, -6],", "[[6, 6],", "a negative"),
        ("amplitude = 0.2", "amplitude = 1.0", "friction.ripple.amplitude: .*less than 1"),
        ('source = "chosen"', 'source = " "', "friction.regularisation.source"),
        ('source = "chosen"', "", "friction.regularisation.source: Field required"),
        ("locked = [4, 5, 6]", "locked = [4, 5, 7]", r"no joints \[7\]"),
        ("locked = [4, 5, 6]", "locked = [1, 2, 3, 4, 5, 6]", "all joints are locked"),
        ('based_on = "puma560_akb"', 'based_on = "puma561"', "unknown robot 'puma561'"),
        ('based_on = "puma560_akb"', 'based_on = "mine.toml"', "mine.toml is based on mine itself"),
        ('based_on = "puma560_akb"', "", "give the table .links. or .urdf."),
        ('model = "lugre"', 'model = "viscous"', "friction.model: .*lugre"),
        ("[transmission]", "[transmission", "no valid TOML"),
    ],
)
def test_what_is_wrong_is_refused(tmp_path: Path, before: str, after: str, message: str) -> None:
    with pytest.raises(RobotError, match=message) as refusal:
        load_robot(_edited(tmp_path, before, after))
    assert "mine.toml" in str(refusal.value)


def test_all_mistakes_are_listed_at_once(tmp_path: Path) -> None:
    text = REFERENCE.replace("pulses_per_rev", "pulses").replace("segment_s = 3.0", "")
    with pytest.raises(RobotError) as refusal:
        load_robot(_written(tmp_path, text))
    for key in ("encoder.pulses_per_rev", "encoder.pulses", "trajectory.segment_s"):
        assert key in str(refusal.value)


def test_motion_must_stay_within_the_joints_range(tmp_path: Path) -> None:
    text = (ROBOTS / "puma560.toml").read_text(encoding="utf-8")
    path = _written(tmp_path, text.replace("amplitude_deg = 40", "amplitude_deg = 91"))
    message = "trajectory takes the shoulder from -46 to 136 deg, its range is -45 to 225 deg"
    with pytest.raises(RobotError, match=re.escape(message)):
        load_robot(path)


def test_a_robot_without_a_wrist_has_none_to_lock(tmp_path: Path) -> None:
    text = (ROBOTS / "puma560.toml").read_text(encoding="utf-8")
    path = _written(tmp_path, text.replace("wrist = [4, 5, 6]", ""))
    with pytest.raises(RobotError, match="no wrist to lock"):
        load_robot(path, lock_wrist=True)


def test_friction_may_be_that_of_another_robot(tmp_path: Path) -> None:
    own = load_robot("reference_published_friction")
    assert own.friction == load_robot("puma560", lock_wrist=True).friction
    assert ("friction", dict(load_robot("puma560").sources)["friction"]) in own.sources
    (tmp_path / "base.toml").write_text(
        'description = "d"\nbased_on = "reference"\n', encoding="utf-8"
    )
    mine = tmp_path / "mine.toml"
    mine.write_text(
        'description = "d"\nbased_on = "reference"\nfriction_from = "base.toml"\n',
        encoding="utf-8",
    )
    assert load_robot(mine).friction == load_robot("reference").friction


@pytest.mark.parametrize("name", ["mine.toml", "puma560_akb", "reference_published_friction"])
def test_friction_comes_from_a_robot_that_has_its_own(tmp_path: Path, name: str) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(
        f'description = "d"\nbased_on = "reference"\nfriction_from = "{name}"\n',
        encoding="utf-8",
    )
    with pytest.raises(RobotError, match=r"friction_from: .* has no \[friction\] of its own"):
        load_robot(mine)
