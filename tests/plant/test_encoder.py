"""Encoders: resolution, direction, wrap-around."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plant.encoder import Encoder
from plant.robot import load_robot


def _encoder(gear: float = 120.0, phase: float = 0.0, offset: int = 0) -> Encoder:
    return Encoder.on_shaft(
        np.array([gear]),
        np.array([8192.0]),
        phase=np.array([phase]),
        offset_counts=np.array([offset], dtype=np.int64),
    )


def test_resolution_of_the_paper() -> None:
    """Jin et al. 2017, section IV: 3.66e-4 deg at each joint."""
    encoder = load_robot("reference").encoder
    assert encoder is not None
    np.testing.assert_allclose(np.rad2deg(encoder.resolution_rad), 3.66e-4, rtol=1e-3)


def test_one_joint_turn_is_gear_times_counts() -> None:
    encoder = _encoder(gear=120.0, phase=0.5)
    assert encoder.counts(np.array([2 * math.pi]))[0] == 120 * 8192


def test_counts_step_down_to_the_lower_edge_in_both_directions() -> None:
    encoder = _encoder()
    (count,) = encoder.resolution_rad
    positions = np.array([[-1.01], [-0.5], [-0.01], [0.01], [0.99], [1.01]]) * count
    assert encoder.counts(positions)[:, 0].tolist() == [-2, -1, -1, 0, 0, 1]
    assert _encoder(phase=0.75).counts(np.array([0.3 * count]))[0] == 1


def test_a_motor_that_turns_against_its_joint_counts_down() -> None:
    forward, backward = _encoder(gear=62.0, phase=0.5), _encoder(gear=-62.0, phase=0.5)
    (count,) = forward.resolution_rad
    assert backward.resolution_rad[0] == count
    assert forward.counts(np.array([1000 * count]))[0] == 1000
    assert backward.counts(np.array([1000 * count]))[0] == -1000


@given(
    offset=st.integers(-(2**33), 2**33),
    ticks=st.lists(st.integers(-50_000, 50_000), min_size=1, max_size=30),
    gear=st.sampled_from([120.0, -62.6111]),
)
def test_wrapped_counts_unwrap_to_the_position(offset: int, ticks: list[int], gear: float) -> None:
    plain, shifted = _encoder(gear, 0.5), _encoder(gear, 0.5, offset)
    positions = np.array(ticks)[:, np.newaxis] * plain.resolution_rad
    expected = plain.counts(positions).astype(np.int64)
    counts = shifted.counts(positions)
    assert counts.dtype == np.int32
    # Equal modulo 2^32, that is two's complement.
    assert np.all((counts.astype(np.int64) - expected - offset) % 2**32 == 0)
    np.testing.assert_array_equal(shifted.positions_rad(counts), expected / shifted.counts_per_rad)


def test_counter_wraps_from_the_largest_to_the_smallest_count() -> None:
    encoder = _encoder(offset=2**31 - 1, phase=0.5)
    (count,) = encoder.resolution_rad
    positions = np.array([[0.0], [count], [2 * count]])
    assert encoder.counts(positions)[:, 0].tolist() == [2**31 - 1, -(2**31), -(2**31) + 1]
    np.testing.assert_allclose(encoder.positions_rad(encoder.counts(positions)), positions)


def test_zero_is_what_the_counter_shows_at_position_zero() -> None:
    encoder = _encoder(offset=1000)
    assert encoder.zero_rad[0] == pytest.approx(1000 * encoder.resolution_rad[0])
