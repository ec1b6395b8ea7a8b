"""The inputs of the bench: a recorded closed loop, special cases, and random bits.

Every variant on every core replays the same bytes. The recording is this project's controller on
the simulated robot; the special cases are single ticks out of that motion in which something is
zero, subnormal, extreme, infinite or not a number, because a step's time may depend on it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from random import Random

import numpy as np

from codegen.controller import Controller, load
from plant.closed_loop import build_plant, simulate
from plant.controller import GeneratedController, structures
from plant.model import gravity_torque
from plant.robot import load_robot
from plant.trajectory import to_and_fro
from verification.experiments import CONTROLLERS

ROBOTS = {3: ("puma3", "reference"), 6: ("puma6", "puma560")}
"""Number of joints: the controller, and the robot that it is recorded on."""

TICKS = 256
"""Length of the recording."""
AMPLITUDE_RAD = 0.01
"""Each joint moves so far and back within the recording, without reaching its torque limit."""
RANDOM_TICKS = 64
SEED = 31

_SETTLING = 4
"""Recorded ticks before a special one, so that no memory is zero by chance."""


class Kind(Enum):
    """What a sequence stands for in the figures."""

    RECORDED = "recorded"
    SPECIAL = "special"
    RANDOM = "random"


@dataclass(frozen=True)
class Tick:
    """The input of one tick; every tuple has one value a joint.

    Attributes:
        counts: measured positions [count].
        position_q8: reference positions [count/256].
        velocity: reference velocities [rad/s].
        acceleration: reference accelerations [rad/s^2].
    """

    counts: tuple[int, ...]
    position_q8: tuple[int, ...]
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]


@dataclass(frozen=True)
class Replayed:
    """Consecutive ticks after one switch-on.

    Attributes:
        name: of the case, for people.
        kind: all ticks of the recording are measured, of any other sequence the last one.
        fails: whether this project's step answers the last tick with an error.
        counts: positions at switch-on [count].
        holding_torque: what holds the robot then [N m].
        ticks: the inputs.
    """

    name: str
    kind: Kind
    fails: bool
    counts: tuple[int, ...]
    holding_torque: tuple[float, ...]
    ticks: tuple[Tick, ...]


def controller_of(joints: int, experiment: str | None = None) -> Controller:
    """The controller that the bench measures for this number of joints."""
    return load(CONTROLLERS / f"{ROBOTS[joints][0]}.toml", experiment=experiment)


def record(joints: int) -> Replayed:
    """The controller on its robot, moving a little way and back; deterministic.

    Raises:
        KeyError: no controller has so many joints.
        plant.closed_loop.PlantError, plant.closed_loop.ControllerError: it did not get there.
    """
    specification = controller_of(joints)
    controller = GeneratedController(specification)
    robot = load_robot(ROBOTS[joints][1])
    if robot.trajectory is None:
        raise ValueError(f"robot {robot.name} has no posture to start from")
    sample_time = float(specification.sample_time)
    plant = build_plant(robot)
    motion = to_and_fro(
        robot.trajectory.start_rad,
        np.full(joints, AMPLITUDE_RAD),
        np.array([0.0, 1.0, 0.0]),
        TICKS / 2 * sample_time,
    )
    run = simulate(plant, controller, motion, sample_time, progress=False)
    position_q8 = controller.position_q8(run.q_ref + plant.encoder.zero_rad)
    ticks = tuple(
        Tick(
            tuple(map(int, run.counts[k])),
            tuple(map(int, position_q8[k])),
            tuple(map(float, run.qd_ref[k])),
            tuple(map(float, run.qdd_ref[k])),
        )
        for k in range(TICKS)
    )
    holding = tuple(map(float, gravity_torque(plant.model, motion.start_rad)))
    return Replayed("recorded motion", Kind.RECORDED, False, ticks[0].counts, holding, ticks)


def _wrap(value: int) -> int:
    """The integer modulo 2^32, as an int32."""
    return (value + 2**31) % 2**32 - 2**31


def special_cases(recorded: Replayed, controller: Controller) -> tuple[Replayed, ...]:
    """Ticks that may take another path than the usual one."""
    joints = len(controller.joints)
    before = recorded.ticks[:_SETTLING]
    usual = recorded.ticks[_SETTLING]
    limits = [joint.max_displacement for joint in controller.joints]

    def case(name: str, tick: Tick, *, fails: bool = False) -> Replayed:
        ticks = (*before, tick)
        return replace(recorded, name=name, kind=Kind.SPECIAL, fails=fails, ticks=ticks)

    def velocity(name: str, value: float, *, fails: bool = False) -> Replayed:
        return case(name, replace(usual, velocity=(value,) * joints), fails=fails)

    def acceleration(name: str, value: float, *, fails: bool = False) -> Replayed:
        return case(name, replace(usual, acceleration=(value,) * joints), fails=fails)

    def error(name: str, value: int) -> Replayed:
        q8 = tuple(_wrap(counts * 256 + value) for counts in usual.counts)
        return case(name, replace(usual, position_q8=q8))

    def moved(name: str, distance: Callable[[int], int], *, fails: bool = False) -> Replayed:
        counts = tuple(
            _wrap(c + distance(limit)) for c, limit in zip(before[-1].counts, limits, strict=True)
        )
        return case(name, replace(usual, counts=counts), fails=fails)

    def still(name: str, value: float) -> Replayed:
        zeros = (0.0,) * joints
        rest = Tick((0,) * joints, (0,) * joints, zeros, zeros)
        last = replace(rest, velocity=(value,) * joints)
        return Replayed(name, Kind.SPECIAL, False, rest.counts, zeros, (rest, rest, last))

    return (
        replace(recorded, name="first tick", kind=Kind.SPECIAL, ticks=before[:1]),
        still("all zero", 0.0),
        still("smallest subnormal velocity error", 2.0**-149),
        still("largest subnormal velocity error", 2.0**-126 - 2.0**-149),
        still("smallest normal velocity error", 2.0**-126),
        error("largest position error", 2**31 - 1),
        error("largest negative position error", -(2**31)),
        _across_the_wrap(recorded),
        moved("fastest plausible motion", lambda limit: limit),
        acceleration("saturated", 1e6),
        acceleration("saturated, negative", -1e6),
        acceleration("acceleration of 1e38 rad/s^2", 1e38),
        velocity("velocity of 1e30 rad/s", 1e30),
        moved("encoder jump", lambda limit: limit + 1, fails=True),
        velocity("torque overflows", 3.4e38, fails=True),
        velocity("velocity infinite", float("inf"), fails=True),
        velocity("velocity NaN", float("nan"), fails=True),
        acceleration("acceleration infinite", float("-inf"), fails=True),
        acceleration("acceleration NaN", float("nan"), fails=True),
    )


def _across_the_wrap(recorded: Replayed) -> Replayed:
    """The recorded motion shifted so that every counter wraps at the measured tick."""
    ticks = recorded.ticks[: _SETTLING + 1]
    shifts = [2**31 - counts for counts in ticks[-1].counts]

    def shifted(tick: Tick) -> Tick:
        return replace(
            tick,
            counts=tuple(_wrap(c + s) for c, s in zip(tick.counts, shifts, strict=True)),
            position_q8=tuple(
                _wrap(q + 256 * s) for q, s in zip(tick.position_q8, shifts, strict=True)
            ),
        )

    moved = tuple(map(shifted, ticks))
    return replace(
        recorded,
        name="counters wrap",
        kind=Kind.SPECIAL,
        counts=moved[0].counts,
        ticks=moved,
    )


def random_cases(recorded: Replayed) -> tuple[Replayed, ...]:
    """Ticks whose floats are random bits: any exponent, now and then infinite or NaN."""
    random = Random(SEED)
    joints = len(recorded.counts)
    before = recorded.ticks[:2]

    def any_float() -> float:
        return float(struct.unpack("<f", random.randbytes(4))[0])

    def tick() -> Tick:
        return Tick(
            tuple(_wrap(c + random.randrange(-9, 10)) for c in before[-1].counts),
            tuple(random.randrange(-(2**31), 2**31) for _ in range(joints)),
            tuple(any_float() for _ in range(joints)),
            tuple(any_float() for _ in range(joints)),
        )

    # What the step answers to them is not known beforehand, and not needed.
    return tuple(
        replace(recorded, name="random bits", kind=Kind.RANDOM, ticks=(*before, tick()))
        for _ in range(RANDOM_TICKS)
    )


def all_sequences(joints: int) -> tuple[Replayed, ...]:
    """Everything that is replayed, in order."""
    recorded = record(joints)
    return (
        recorded,
        *special_cases(recorded, controller_of(joints)),
        *random_cases(recorded),
    )


def input_bytes(controller: Controller, sequences: tuple[Replayed, ...]) -> bytes:
    """The inputs as the target has them in memory, one after the other."""
    made = structures(controller).input

    def one(tick: Tick) -> bytes:
        given = made()
        given.counts[:] = tick.counts
        given.reference_position_q8[:] = tick.position_q8
        given.reference_velocity_rad_per_s[:] = tick.velocity
        given.reference_acceleration_rad_per_s2[:] = tick.acceleration
        return bytes(given)

    return b"".join(one(tick) for sequence in sequences for tick in sequence.ticks)


def sequence_bytes(sequences: tuple[Replayed, ...]) -> bytes:
    """The switch-ons as the target has them in memory: see ``bench_sequence`` in bench.h."""
    return b"".join(
        struct.pack(f"<I{len(s.counts)}i", len(s.ticks), *s.counts)
        + struct.pack(f"<{len(s.counts)}f", *s.holding_torque)
        for s in sequences
    )
