"""Random steps for the equivalence check: configurations, states and inputs of the C structures.

Two regimes are drawn in turn. ``rig`` stays near what a robot sees with gains near the shipped
ones, so that the deviations found there mean something to a control engineer. ``wide`` spans
decades of every gain, exponents over their whole range, and signals from one encoder unit to the
full scale. In both, positions lie anywhere on the 32-bit circle and often at its seam.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from codegen.controller import Controller
from codegen.floating_point import scale_values
from plant.controller import Structures

Records = NDArray[Any]
"""A structured array that lies in memory like an array of the C structure."""

Regime = Literal["rig", "wide"]
REGIMES: tuple[Regime, ...] = get_args(Regime)

PHASE_START, PHASE_RUNNING, PHASE_LOST = 0x54444300, 0x54444302, 0x54444304
RUNNING_PHASES = (PHASE_RUNNING, PHASE_RUNNING + 1)
LOST_PHASES = (PHASE_LOST, PHASE_LOST + 1)
"""The lowest bit is the index of the last good tick's memory; in good ticks it changes."""

PHASES = (PHASE_START, *RUNNING_PHASES, *LOST_PHASES)

STARTS_FROM = ("counts", "applied_torque_Nm")
"""What the first tick takes from the memory; the rest of it follows from that tick's input."""

RESUMES_FROM = (*STARTS_FROM, "sliding_integral_rad_per_s")
"""Likewise a tick after lost ones."""

_EXPONENTS = ("alpha", "beta", "gamma")
_DECADES = ("inertia_kgm2", "kd", "kp", "lambda", "torque_limit_Nm")
_SPECIAL_EXPONENTS = np.array([0.4, 0.5, 0.6, 0.95, 0.98, 1.0, 1.2, 1.5, 95 / 105])


@dataclass(frozen=True)
class Cases:
    """Arguments of many steps, one record a step; the C writes the states in place."""

    config: Records
    state: Records
    input: Records

    def __len__(self) -> int:
        return len(self.input)


def has(records: Records, name: str) -> bool:
    """Whether the structure has a field; some exist only in some structures of the law."""
    return name in (records.dtype.names or ())


def wrap(value: NDArray[np.int64]) -> NDArray[np.int64]:
    """An integer modulo 2^32, as the int32 that has these bits."""
    wrapped: NDArray[np.int64] = (value + 2**31) % 2**32 - 2**31
    return wrapped


# --- Memory ------------------------------------------------------------------------------------


def is_running(state: Records) -> NDArray[np.bool_]:
    """Whether the last tick of each state was a good one, shape (steps,)."""
    running: NDArray[np.bool_] = np.isin(state["phase"], RUNNING_PHASES)
    return running


def is_starting(state: Records) -> NDArray[np.bool_]:
    """Whether each state has no good tick behind it, shape (steps,)."""
    starting: NDArray[np.bool_] = state["phase"] == PHASE_START
    return starting


def is_filled(state: Records) -> NDArray[np.bool_]:
    """Whether each state is one that init has filled, shape (steps,)."""
    filled: NDArray[np.bool_] = np.isin(state["phase"], PHASES)
    return filled


def latest_counts(state: Records) -> NDArray[np.int64]:
    """Readings at the last ticks, lost or not, of states that aren't running; (steps, joints)."""
    other = (state["phase"] & 1) ^ 1
    counts: NDArray[np.int64] = state["joint"]["tick"]["counts"][np.arange(len(state)), :, other]
    return counts.astype(np.int64)


def last_memory(state: Records) -> Records:
    """That of the last good tick as ``joint_state`` structures, shape (steps, joints); a copy."""
    memory: Records = state["joint"]["tick"][np.arange(len(state)), :, state["phase"] & 1]
    return memory


def first_index(state: Records) -> Records:
    """A view of the memory of index 0, which is the last tick's in every even phase."""
    view: Records = state["joint"]["tick"][..., 0]
    return view


def disperse(state: Records, rng: np.random.Generator) -> None:
    """Moves the memories of half the states to index 1, and fills scratch at random.

    Scratch is all that a tick must not read: the memory beside the last one's, but for the latest
    counts where ticks were lost, and what the first tick, or one after lost ones, finds out for
    itself. Random bits there are caught wherever they are used.

    Args:
        state: states of even phases; those that nobody filled are left alone.
        rng: the source of all of it.
    """
    running, starting, filled = is_running(state), is_starting(state), is_filled(state)
    last, latest = first_index(state).copy(), latest_counts(state)
    state["phase"][filled & ~starting & (rng.random(len(state)) < 0.5)] += 1
    ticks = state["joint"]["tick"]
    bits = np.frombuffer(rng.bytes(ticks.nbytes), ticks.dtype).reshape(ticks.shape)
    memory = bits[:, :, 0].copy()
    for name in last.dtype.names or ():
        read = running | (filled & (name in RESUMES_FROM) & ~(starting & (name not in STARTS_FROM)))
        memory[name] = np.where(read[:, None], last[name], memory[name])
    rows, index = np.flatnonzero(filled), state["phase"] & 1
    ticks[rows] = bits[rows]
    ticks[rows, :, index[rows]] = memory[rows]
    rows = np.flatnonzero(filled & ~running)
    ticks["counts"][rows, :, index[rows] ^ 1] = latest[rows]


# --- Drawing -----------------------------------------------------------------------------------


def draw(
    controller: Controller,
    structures: Structures,
    default_config: ctypes.Structure,
    steps: int,
    regime: Regime,
    rng: np.random.Generator,
) -> Cases:
    """Random steps of one regime; about 2 % have an encoder jump, 1 % a value that isn't finite."""
    config = np.zeros(steps, np.dtype(structures.config))
    config[:] = np.frombuffer(bytes(default_config), config.dtype)[0]
    state = np.zeros(steps, np.dtype(structures.state))
    given = np.zeros(steps, np.dtype(structures.input))
    _draw_gains(config, regime, rng)
    _draw_positions(config, state, given, regime, rng)
    _draw_signals(controller, config, state, given, regime, rng)
    _spoil(given, rng)
    disperse(state, rng)
    return Cases(config, state, given)


def _draw_gains(config: Records, regime: Regime, rng: np.random.Generator) -> None:
    joint = config["joint"]
    shape = joint.shape
    decades = 0.3 if regime == "rig" else 1.5
    for name in _DECADES:
        joint[name] *= 10.0 ** rng.uniform(-decades, decades, shape)
    if regime == "wide":
        # A torque at its limit says nothing of the law: most of these gains need more room.
        joint["torque_limit_Nm"] *= 10.0
    config["on_error"] = rng.integers(0, 2, len(config))
    config["anti_windup"] = rng.integers(0, 2, len(config))
    config["max_lost_ticks"] = rng.integers(1, 40, len(config))
    if has(joint, "low_pass_ratio"):
        joint["low_pass_ratio"] = rng.uniform(2.0**-10, 1.0, shape)
    if regime == "rig":
        return
    tight = rng.random(shape) < 0.02
    joint["max_displacement_change"][tight] = rng.integers(1, 64, np.count_nonzero(tight))
    for name in ("kd", "kp", "lambda"):
        joint[name][rng.random(shape) < 0.05] = 0.0
    for name in _EXPONENTS:
        smallest = -(2**31) if name == "gamma" else -(2**31) + 1
        drawn = rng.integers(smallest, 2**31, shape)
        special = np.rint((rng.choice(_SPECIAL_EXPONENTS, shape) - 1.0) * 2.0**31)
        ends = rng.choice([smallest, 2**31 - 1], shape)
        kind = rng.random(shape)
        joint[name] = np.select([kind < 0.5, kind < 0.95], [drawn, special], ends)


def _signed_decades(
    rng: np.random.Generator, low: float, high: float, shape: Sequence[int]
) -> NDArray[np.float64]:
    """Numbers of either sign, their magnitude uniform in decades from 10^low to 10^high."""
    drawn: NDArray[np.float64] = 10.0 ** rng.uniform(low, high, shape)
    drawn *= rng.choice([-1.0, 1.0], shape)
    return drawn


def _integers(rng: np.random.Generator, largest: float, shape: Sequence[int]) -> NDArray[np.int64]:
    """Integers of either sign over all magnitudes, with many small ones and zeros."""
    drawn = np.rint(_signed_decades(rng, -0.7, np.log10(largest), shape)).astype(np.int64)
    return np.clip(drawn, -(2**31), 2**31 - 1)


def _draw_positions(
    config: Records, state: Records, given: Records, regime: Regime, rng: np.random.Generator
) -> None:
    joint = first_index(state)
    shape = joint.shape
    limit = config["joint"]["max_displacement"].astype(np.int64)

    def small(largest: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.clip(_integers(rng, float(largest.max()), shape), -largest, largest)

    anywhere = rng.integers(-(2**31), 2**31, shape)
    seam = wrap(2**31 + rng.integers(-2000, 2000, shape))
    origin = rng.integers(-2000, 2000, shape)
    counts = rng.choice([0, 1, 2], shape)
    counts = np.choose(counts, [anywhere, seam, origin])
    moved = small(limit)
    # A jump of one joint makes an error of the whole step: few steps may have one.
    jump = (rng.random(len(state)) < 0.02)[:, None] & (rng.random(shape) < 0.5)
    moved = np.where(jump, rng.integers(-(2**31), 2**31, shape), moved)
    now = wrap(counts + moved)
    largest_error = 2.0**14 if regime == "rig" else 2.0**31
    error = _integers(rng, largest_error, shape)

    state["phase"] = rng.choice(
        [PHASE_START, PHASE_LOST, PHASE_RUNNING], len(state), p=[0.125, 0.125, 0.75]
    )
    state["saturated_joints"] = rng.integers(0, 2 ** shape[1], len(state))
    state["lost_ticks"] = rng.integers(0, 25, len(state))
    # Where ticks were lost, the latest reading lies near the last good one, or anywhere.
    joint["counts"] = wrap(counts + np.where(is_running(state)[:, None], 0, small(limit)))
    latest = np.where((rng.random(len(state)) < 0.05)[:, None], anywhere, counts)
    state["joint"]["tick"]["counts"][..., 1] = latest
    # An acceleration of one count a tick a tick is already several rad/s^2.
    largest_change = np.minimum(limit, 3 if regime == "rig" else 64)
    joint["displacement"] = wrap(moved + small(largest_change))
    if has(joint, "displacement_change"):
        joint["displacement_change"] = small(largest_change)
    if has(joint, "error_q8"):
        change = small(np.minimum(256 * limit, 2**31 - 1))
        joint["error_q8"] = wrap(error - change)
    given["counts"] = now
    given["reference_position_q8"] = wrap(wrap(now * 256) + error)


def _draw_signals(
    controller: Controller,
    config: Records,
    state: Records,
    given: Records,
    regime: Regime,
    rng: np.random.Generator,
) -> None:
    joint = first_index(state)
    shape = joint.shape
    high = 0.0 if regime == "rig" else 1.5
    rad_per_s = np.array([j.rad_per_count for j in controller.joints]) / float(
        controller.sample_time
    )
    moved = wrap(given["counts"].astype(np.int64) - joint["counts"])
    # Errors are small when the reference moves like the robot; with an independent reference
    # every step would be a huge error.
    velocity = np.clip(moved * rad_per_s, -20.0, 20.0) + _signed_decades(rng, -7, high, shape)
    given["reference_velocity_rad_per_s"] = velocity
    given["reference_acceleration_rad_per_s2"] = _signed_decades(rng, -4, 1 + high, shape)
    if has(joint, "reference_velocity_rad_per_s"):
        joint["reference_velocity_rad_per_s"] = velocity + _signed_decades(rng, -5, -1, shape)
    limit = config["joint"]["torque_limit_Nm"]
    joint["applied_torque_Nm"] = limit * rng.uniform(-1.0, 1.0, shape)
    if has(given, "applied_torque_Nm"):
        given["applied_torque_Nm"] = limit * rng.uniform(-1.5, 1.5, shape)
    measured = moved * rad_per_s
    velocity_error = velocity - measured
    if has(joint, "error_q8"):
        error = wrap(given["reference_position_q8"] - 256 * given["counts"].astype(np.int64))
        velocity_error = wrap(error - joint["error_q8"]) * rad_per_s / 256
    if has(joint, "reference_velocity_rad_per_s"):
        velocity_error = (velocity + joint["reference_velocity_rad_per_s"]) / 2 - measured
    joint["sliding_integral_rad_per_s"] = _sliding_integral(velocity_error, high, rng)


def _sliding_integral(
    velocity_error: NDArray[np.float64], high: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Often close to -ed: s is then small, where lambda sig(s)^gamma is steepest."""
    shape = velocity_error.shape
    near_zero = -velocity_error + _signed_decades(rng, -8, -1, shape)
    choices = [near_zero, _signed_decades(rng, -8, high, shape), np.zeros(shape)]
    chosen = rng.choice(3, shape, p=[0.6, 0.35, 0.05])
    return np.choose(chosen, choices)


def _spoil(given: Records, rng: np.random.Generator) -> None:
    """Puts a NaN or an infinity into a few steps."""
    names = [n for n in given.dtype.names or () if given.dtype[n].base == np.float32]
    joints = given["counts"].shape[1]
    for row in np.flatnonzero(rng.random(len(given)) < 0.01):
        given[rng.choice(names)][row, rng.integers(joints)] = rng.choice([np.nan, np.inf, -np.inf])


def shipped_scales(controller: Controller) -> dict[str, NDArray[np.float64]]:
    """The binary32 conversion factors that the C holds, by name, shape (joints,)."""
    each = [scale_values(controller, joint) for joint in controller.joints]
    return {name: np.array([values[name] for values in each]) for name in each[0]}
