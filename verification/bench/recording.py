"""The inputs of the bench: a recorded closed loop, special cases, and random bits.

Every variant on every core replays the same motion, those with the same numbers the same bytes.
The recording is this project's controller on
the simulated robot; the special cases are single ticks out of that motion in which something is
zero, subnormal, extreme, infinite or not a number, because a step's time may depend on it. All of
it is in SI units and converted into those of a controller.
"""

from __future__ import annotations

import ctypes
import functools
import math
import struct
import sys
from dataclasses import dataclass, replace
from enum import Enum
from random import Random

import numpy as np
from numpy.typing import NDArray

from codegen.arithmetic import FLOAT64
from codegen.controller import Controller, read, resolve
from codegen.exact import binary32
from plant.assembly import build_plant
from plant.closed_loop import simulate
from plant.controller import GeneratedController, structures
from plant.model import gravity_torque
from plant.robot import load_robot
from plant.trajectory import Reference, to_and_fro
from plant.units import units
from verification.experiments import CONTROLLERS

Counts = NDArray[np.int32]

ROBOTS = {3: ("puma3", "reference"), 6: ("puma6", "puma560")}
"""Number of joints: the controller, and the robot that it is recorded on."""

RECORDED, LED = "recorded motion", "led motion"
"""Names of the two kinds of recordings."""

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


class Outcome(Enum):
    """What this project's step answers to the last tick of a sequence, and how it gets there.

    A tick is usual unless it is the first, at a torque limit, or an error.
    """

    USUAL = "usual"
    FIRST = "first"
    LIMIT = "limit"
    ERROR = "error"
    ANY = "any"


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
        outcome: of the last tick; the first of several is always ``FIRST``, the others ``USUAL``.
        counts: positions at switch-on [count].
        holding_torque: what holds the robot then [N m].
        ticks: the inputs.
    """

    name: str
    kind: Kind
    outcome: Outcome
    counts: tuple[int, ...]
    holding_torque: tuple[float, ...]
    ticks: tuple[Tick, ...]


def controller_of(
    joints: int, experiment: str | None = None, numbers: tuple[tuple[str, str], ...] = ()
) -> Controller:
    """The controller that the bench measures for this number of joints.

    Args:
        joints: their number.
        experiment: a row of Table II, whose gains replace those of the specification.
        numbers: keys of the specification that are changed, and their values.
    """
    path = CONTROLLERS / f"{ROBOTS[joints][0]}.toml"
    return resolve({**read(path), **dict(numbers)}, str(path), experiment=experiment)


@functools.cache
def record(joints: int) -> Replayed:
    """The controller on its robot, moving a little way and back; deterministic.

    References are rounded to float, which the numbers of every variant but integers hold exactly.

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
            tuple(map(binary32, run.qd_ref[k])),
            tuple(map(binary32, run.qdd_ref[k])),
        )
        for k in range(TICKS)
    )
    holding = tuple(map(binary32, gravity_torque(plant.model, motion.start_rad)))
    return Replayed(RECORDED, Kind.RECORDED, Outcome.USUAL, ticks[0].counts, holding, ticks)


def _wrap(value: int) -> int:
    """The integer modulo 2^32, as an int32."""
    return (value + 2**31) % 2**32 - 2**31


def special_cases(recorded: Replayed, controller: Controller) -> tuple[Replayed, ...]:
    """Ticks that may take another path than the usual one.

    Integers are neither subnormal, infinite nor NaN: there those cases are left out, and the
    extreme ones are clipped, to the largest plausible reference where the step is to answer with a
    torque, and to the largest integer where it is to refuse.
    """
    make = _Cases(recorded, controller)
    own = _in_integers(make) if controller.arithmetic.kind == "fixed-point" else _in_floats(make)
    return (
        replace(
            recorded,
            name="first tick",
            kind=Kind.SPECIAL,
            outcome=Outcome.FIRST,
            ticks=recorded.ticks[:1],
        ),
        make.still("all zero", 0.0),
        make.error("largest position error", 2**31 - 1),
        make.error("largest negative position error", -(2**31)),
        _across_the_wrap(recorded),
        make.moved("fastest plausible motion", 0, Outcome.USUAL),
        make.moved("encoder jump", 1, Outcome.ERROR),
        *own,
    )


@dataclass(frozen=True)
class _Cases:
    """Makes special ticks out of a recorded motion for a controller."""

    recorded: Replayed
    controller: Controller

    @property
    def joints(self) -> int:
        return len(self.controller.joints)

    @property
    def usual(self) -> Tick:
        return self.recorded.ticks[_SETTLING]

    def case(self, name: str, tick: Tick, outcome: Outcome) -> Replayed:
        ticks = (*self.recorded.ticks[:_SETTLING], tick)
        return replace(self.recorded, name=name, kind=Kind.SPECIAL, outcome=outcome, ticks=ticks)

    def velocity(self, name: str, outcome: Outcome, *values: float) -> Replayed:
        """With these reference velocities, or one for all joints [rad/s]."""
        return self.case(name, replace(self.usual, velocity=self._each(values)), outcome)

    def acceleration(self, name: str, outcome: Outcome, *values: float) -> Replayed:
        """With these reference accelerations, or one for all joints [rad/s^2]."""
        return self.case(name, replace(self.usual, acceleration=self._each(values)), outcome)

    def overflow(self, name: str, largest: float) -> Replayed:
        """With the largest number as velocity and acceleration: the two terms overflow."""
        each = self._each((largest,))
        return self.case(name, replace(self.usual, velocity=each, acceleration=each), Outcome.ERROR)

    def _each(self, values: tuple[float, ...]) -> tuple[float, ...]:
        return values * (self.joints // len(values))

    def error(self, name: str, value: int) -> Replayed:
        """With this position error [count/256]; it takes every joint to its limit."""
        q8 = tuple(_wrap(counts * 256 + value) for counts in self.usual.counts)
        return self.case(name, replace(self.usual, position_q8=q8), Outcome.LIMIT)

    def moved(self, name: str, further: int, outcome: Outcome) -> Replayed:
        """As fast as is plausible with its reference, at last this much further [count]."""
        zeros = (0.0,) * self.joints
        # In the direction of the joint's positive speed: some motors turn the other way.
        limits = tuple(
            int(math.copysign(joint.max_displacement, joint.rad_per_count))
            for joint in self.controller.joints
        )

        def tick(number: int, beyond: int) -> Tick:
            counts = tuple(limit * number + int(math.copysign(beyond, limit)) for limit in limits)
            q8 = tuple(256 * c for c in counts)
            return Tick(counts, q8, _plausible(self.controller)[0], zeros)

        ticks = (tick(1, 0), tick(2, 0), tick(3, further))
        rest = (0,) * self.joints
        return Replayed(name, Kind.SPECIAL, outcome, rest, zeros, ticks)

    def still(self, name: str, *values: float) -> Replayed:
        """At rest at zero until the reference has this velocity [rad/s]."""
        zeros = (0.0,) * self.joints
        rest = Tick((0,) * self.joints, (0,) * self.joints, zeros, zeros)
        last = replace(rest, velocity=self._each(values))
        ticks = (rest, rest, last)
        return Replayed(name, Kind.SPECIAL, Outcome.USUAL, rest.counts, zeros, ticks)


def _in_floats(make: _Cases) -> tuple[Replayed, ...]:
    """What only floating-point numbers can be."""
    double = make.controller.arithmetic.real is FLOAT64
    smallest, normal = (2.0**-1074, 2.0**-1022) if double else (2.0**-149, 2.0**-126)
    largest = sys.float_info.max if double else (2.0 - 2.0**-23) * 2.0**127
    limit, error = Outcome.LIMIT, Outcome.ERROR
    return (
        make.still("smallest subnormal velocity error", smallest),
        make.still("largest subnormal velocity error", normal - smallest),
        make.still("smallest normal velocity error", normal),
        make.acceleration("saturated", limit, 1e6),
        make.acceleration("saturated, negative", limit, -1e6),
        make.acceleration("acceleration of 1e38 rad/s^2", limit, 1e38),
        make.velocity("velocity of 1e30 rad/s", limit, 1e30),
        make.overflow("torque overflows", largest),
        make.velocity("velocity infinite", error, math.inf),
        make.velocity("velocity NaN", error, math.nan),
        make.acceleration("acceleration infinite", error, -math.inf),
        make.acceleration("acceleration NaN", error, math.nan),
    )


def _in_integers(make: _Cases) -> tuple[Replayed, ...]:
    """The nearest to that in integers."""
    fastest, hardest = _plausible(make.controller)
    unit = units(make.controller).velocity.per_si
    assert unit is not None
    return (
        make.still("smallest velocity error", *map(float, 1.0 / np.abs(unit))),
        make.velocity("largest plausible velocity", Outcome.USUAL, *fastest),
        make.acceleration("saturated", Outcome.LIMIT, *hardest),
        make.acceleration("saturated, negative", Outcome.LIMIT, *(-a for a in hardest)),
        make.velocity("largest velocity", Outcome.ERROR, math.inf),
        make.acceleration("largest acceleration", Outcome.ERROR, -math.inf),
    )


def _plausible(controller: Controller) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Each joint's largest reference velocity [rad/s] and acceleration [rad/s^2] in integers."""
    tick = float(controller.sample_time)
    fastest = tuple(j.max_displacement * abs(j.rad_per_count) / tick for j in controller.joints)
    return fastest, tuple(velocity / tick for velocity in fastest)


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
        outcome=Outcome.USUAL,
        counts=moved[0].counts,
        ticks=moved,
    )


def random_cases(recorded: Replayed, controller: Controller) -> tuple[Replayed, ...]:
    """Ticks whose references are random bits: any exponent, now and then infinite or NaN.

    Integers are of any magnitude, now and then beyond what is plausible.
    """
    random = Random(SEED)
    before = recorded.ticks[:2]
    draw = _random_integers if controller.arithmetic.kind == "fixed-point" else _random_floats

    def tick() -> Tick:
        return Tick(
            tuple(_wrap(c + random.randrange(-9, 10)) for c in before[-1].counts),
            tuple(random.randrange(-(2**31), 2**31) for _ in controller.joints),
            *draw(random, controller),
        )

    # What the step answers to them is not known beforehand, and not needed.
    return tuple(
        replace(
            recorded,
            name="random bits",
            kind=Kind.RANDOM,
            outcome=Outcome.ANY,
            ticks=(*before, tick()),
        )
        for _ in range(RANDOM_TICKS)
    )


def _random_floats(
    random: Random, controller: Controller
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Velocities and accelerations of random bits; one in 32 is infinite or NaN."""
    form, size = ("<d", 8) if controller.arithmetic.real is FLOAT64 else ("<f", 4)

    def one() -> float:
        if random.randrange(32) == 0:
            return random.choice((math.inf, -math.inf, math.nan))
        return float(struct.unpack(form, random.randbytes(size))[0])

    def each() -> tuple[float, ...]:
        return tuple(one() for _ in controller.joints)

    return each(), each()


def _random_integers(
    random: Random, controller: Controller
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Velocities and accelerations of random magnitude up to twice the plausible ones."""

    def each(limits: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(
            random.choice((-1.0, 1.0)) * limit * 2.0 ** random.uniform(-30.0, 1.0)
            for limit in limits
        )

    fastest, hardest = _plausible(controller)
    return each(fastest), each(hardest)


def led(controller: Controller, amplitude_rad: float, seconds: float) -> tuple[Reference, Counts]:
    """To and fro with all joints, and what encoders count that follow the reference exactly.

    For a controller that no simulated robot fits. Where a joint may not move as fast, all of them
    move less far.

    Args:
        controller: whose sample time, encoders and plausible speeds these are.
        amplitude_rad: how far each joint moves.
        seconds: of the whole motion.

    Returns:
        The reference, and counts of shape (ticks, n).
    """
    joints, tick = controller.joints, float(controller.sample_time)
    slowest = min(j.max_displacement * abs(j.rad_per_count) / tick for j in joints)
    # A rest-to-rest motion peaks at about twice its mean speed, and may reach half of the limit.
    amplitude = min(amplitude_rad, slowest * seconds / 8.0)
    motion = to_and_fro(
        np.zeros(len(joints)),
        np.full(len(joints), amplitude),
        np.array([0.0, 1.0, 0.0]),
        seconds / 2.0,
    )
    reference = motion.sampled(tick)
    per_rad = np.array([1.0 / j.rad_per_count for j in joints])
    return reference, np.rint(reference.position_rad * per_rad).astype(np.int32)


def recording_for(controller: Controller) -> Replayed:
    """The bench's recording where a controller has that robot's encoders; else it is led."""
    joints = len(controller.joints)
    own = controller_of(joints) if joints in ROBOTS else None
    if own is not None and _encoders(own) == _encoders(controller):
        return record(joints)
    reference, counts = led(controller, AMPLITUDE_RAD, TICKS * float(controller.sample_time))
    per_rad = np.array([1.0 / j.rad_per_count for j in controller.joints])
    q8 = np.rint(reference.position_rad * per_rad * 256.0).astype(int)
    ticks = tuple(
        Tick(
            tuple(map(int, counts[k])),
            tuple(map(int, q8[k])),
            tuple(map(binary32, reference.velocity_rad_per_s[k])),
            tuple(map(binary32, reference.acceleration_rad_per_s2[k])),
        )
        for k in range(len(counts))
    )
    return Replayed(LED, Kind.RECORDED, Outcome.USUAL, ticks[0].counts, (0.0,) * joints, ticks)


def _encoders(controller: Controller) -> tuple[object, ...]:
    """What a recording depends on: sample time, counts, and what motion is plausible."""
    return (
        controller.sample_time,
        *((j.counts_per_joint_rev, j.max_displacement) for j in controller.joints),
    )


def all_sequences(controller: Controller, recorded: Replayed | None = None) -> tuple[Replayed, ...]:
    """Everything that is replayed for a controller's numbers, in order; the recording is one.

    Args:
        controller: with these numbers.
        recorded: the recording; the bench's own for this number of joints by default.
    """
    recorded = record(len(controller.joints)) if recorded is None else recorded
    return (
        recorded,
        *special_cases(recorded, controller),
        *random_cases(recorded, controller),
    )


def input_bytes(controller: Controller, sequences: tuple[Replayed, ...]) -> bytes:
    """The inputs as the target has them in memory, one after the other."""
    made, signals = structures(controller).input, units(controller)

    def one(tick: Tick) -> bytes:
        given = made()
        given.counts[:] = tick.counts
        given.reference_position_q8[:] = tick.position_q8
        for unit, values in (
            (signals.velocity, tick.velocity),
            (signals.acceleration, tick.acceleration),
        ):
            getattr(given, unit.field)[:] = unit.stored(np.array(values)).tolist()
        return bytes(given)

    return b"".join(one(tick) for sequence in sequences for tick in sequence.ticks)


def sequence_bytes(controller: Controller, sequences: tuple[Replayed, ...]) -> bytes:
    """The switch-ons as the target has them in memory: see ``bench_sequence`` in bench.h."""
    joints = len(controller.joints)

    class Sequence(ctypes.Structure):
        _fields_ = (
            ("ticks", ctypes.c_uint32),
            ("counts", ctypes.c_int32 * joints),
            ("holding_torque", structures(controller).torque * joints),
        )

    def one(sequence: Replayed) -> bytes:
        made = Sequence(len(sequence.ticks))
        made.counts[:] = sequence.counts
        torque = units(controller).torque.stored(np.array(sequence.holding_torque))
        made.holding_torque[:] = torque.tolist()
        return bytes(made)

    return b"".join(map(one, sequences))
