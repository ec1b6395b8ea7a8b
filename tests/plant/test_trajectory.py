"""Reference trajectories: continuity, derivatives, rest at the ends."""

from __future__ import annotations

import numpy as np
import pytest

from plant.robot import load_robot
from plant.trajectory import RestToRest, to_and_fro

MOTION = RestToRest(
    postures_rad=np.array([[0.0, 1.0], [0.5, -1.0], [0.5, 2.0]]), segment_s=np.array([1.0, 2.5])
)


def test_passes_through_the_postures_at_rest() -> None:
    reference = MOTION.at(np.array([-1.0, 0.0, 1.0, 3.5, 9.0]))
    np.testing.assert_allclose(
        reference.position_rad, MOTION.postures_rad[[0, 0, 1, 2, 2]], atol=1e-15
    )
    np.testing.assert_allclose(reference.velocity_rad_per_s, 0.0, atol=1e-15)
    np.testing.assert_allclose(reference.acceleration_rad_per_s2, 0.0, atol=1e-12)


def test_velocity_and_acceleration_are_the_derivatives() -> None:
    h = 1e-5
    # Times that keep clear of the knots.
    times = np.array([0.1, 0.37, 0.5, 0.93, 1.2, 2.0, 3.3])
    ahead, here, behind = MOTION.at(times + h), MOTION.at(times), MOTION.at(times - h)
    slope = (ahead.position_rad - behind.position_rad) / (2 * h)
    curvature = (ahead.velocity_rad_per_s - behind.velocity_rad_per_s) / (2 * h)
    np.testing.assert_allclose(here.velocity_rad_per_s, slope, atol=1e-8)
    np.testing.assert_allclose(here.acceleration_rad_per_s2, curvature, atol=1e-7)


def test_is_continuous_across_the_knots() -> None:
    h = 1e-9
    for knot in (0.0, 1.0, 3.5):
        before, after = MOTION.at(np.array([knot - h])), MOTION.at(np.array([knot + h]))
        np.testing.assert_allclose(before.position_rad, after.position_rad, atol=1e-7)
        np.testing.assert_allclose(before.velocity_rad_per_s, after.velocity_rad_per_s, atol=1e-7)
        np.testing.assert_allclose(
            before.acceleration_rad_per_s2, after.acceleration_rad_per_s2, atol=1e-6
        )


def test_is_a_quintic_with_the_known_peak_speed() -> None:
    """15/8 of the mean speed, in the middle; a cubic would give 3/2."""
    middle = MOTION.at(np.array([0.5]))
    np.testing.assert_allclose(middle.velocity_rad_per_s[0], 15 / 8 * np.array([0.5, -2.0]))
    times = np.linspace(0.0, 1.0, 50)
    for joint in (0, 1):
        exact = np.polynomial.Polynomial.fit(times, MOTION.at(times).position_rad[:, joint], 5)
        np.testing.assert_allclose(
            exact(times), MOTION.at(times).position_rad[:, joint], atol=1e-12
        )


def test_ticks_are_multiples_of_the_sample_time() -> None:
    reference = MOTION.sampled(0.001)
    assert reference.position_rad.shape == (3500, 2)
    np.testing.assert_allclose(reference.time_s, np.arange(3500) / 1000, rtol=1e-15)


def test_faster_is_the_same_path_in_less_time() -> None:
    fast = MOTION.faster(1.5)
    assert fast.duration_s == pytest.approx(MOTION.duration_s / 1.5)
    times = np.linspace(0.0, 3.5, 40)
    slow_at, fast_at = MOTION.at(times), fast.at(times / 1.5)
    np.testing.assert_allclose(fast_at.position_rad, slow_at.position_rad, atol=1e-12)
    np.testing.assert_allclose(
        fast_at.velocity_rad_per_s, 1.5 * slow_at.velocity_rad_per_s, atol=1e-12
    )
    np.testing.assert_allclose(
        fast_at.acceleration_rad_per_s2, 1.5**2 * slow_at.acceleration_rad_per_s2, atol=1e-9
    )


def test_reference_motion_is_four_quintics_in_twelve_seconds() -> None:
    motion = load_robot("reference").trajectory
    assert motion is not None
    np.testing.assert_array_equal(motion.segment_s, [3.0, 3.0, 3.0, 3.0])
    away = np.rad2deg(motion.postures_rad - motion.start_rad)
    np.testing.assert_allclose(away, np.outer([0, 40, 0, -40, 0], np.ones(3)), atol=1e-12)


def test_refuses_what_is_no_motion() -> None:
    with pytest.raises(ValueError, match="m segments need"):
        RestToRest(np.zeros((3, 2)), np.array([1.0]))
    with pytest.raises(ValueError, match="m segments need"):
        to_and_fro(np.zeros(2), np.ones(2), np.array([0.0, 1.0]), segment_s=0.0)
