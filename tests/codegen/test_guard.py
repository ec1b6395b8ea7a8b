"""What the generated C does about ticks that it can't take at their word, in each arithmetic."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from codegen.controller import load
from codegen.status import Status
from plant.controller import GeneratedController
from plant.native import shared_library
from tests.codegen.conftest import CONTROLLERS, GENERATED

KINDS = ("puma3", "puma3_precise", "puma3_float64", "puma3_fixed")
N = 3
V = 300
"""Counts a tick: nearly 2 rad/s."""
HOLDING = np.array([1.0, -20.0, 5.0])
STILL = np.zeros(N)


class Rig:
    """A controller whose reference is where the encoders should be, so that no error is left."""

    def __init__(self, kind: str) -> None:
        self.c = GeneratedController(
            load(CONTROLLERS / f"{kind}.toml"), shared_library(GENERATED / kind)
        )
        self.rad = np.array([j.rad_per_count for j in self.c.specification.joints])
        self.tick_s = float(self.c.specification.sample_time)
        self.begin()

    def begin(self, counts: int = 0) -> None:
        """Switches on at these counts."""
        assert self.c.reset(np.full(N, counts, np.int32), HOLDING) == Status.OK

    def tick(
        self,
        counts: int | list[int],
        speed: int = V,
        *,
        reference: int | None = None,
        acceleration: float = 0.0,
    ) -> tuple[list[float], int]:
        """One tick; speeds in counts a tick, the reference where the counts are by default."""
        read = np.full(N, counts) if isinstance(counts, int) else np.array(counts)
        wanted = read if reference is None else np.full(N, reference)
        output = self.c.step(
            read.astype(np.int32),
            wanted * self.rad,
            np.full(N, speed) * self.rad / self.tick_s,
            np.full(N, acceleration),
        )
        return output.torque_Nm.tolist(), output.status

    def run(self, ticks: range) -> None:
        """Even motion along ticks counted from the origin."""
        for k in ticks:
            assert self.tick(k * V)[1] == Status.OK, k

    @property
    def sliding(self) -> list[float]:
        """The integral part of each joint's sliding variable, in the C's own unit."""
        fields = [field[0] for field in self.c.last_memory[0]._fields_]
        name = next(name for name in fields if "sliding" in name)
        return [getattr(memory, name) for memory in self.c.last_memory]


@pytest.fixture(params=KINDS)
def rig(request: pytest.FixtureRequest) -> Rig:
    return Rig(request.param)


def held() -> Any:
    """Even motion along the reference needs no more than what held the robot, but for rounding."""
    return pytest.approx(HOLDING.tolist(), abs=0.1)


def test_a_missed_tick_costs_one_and_leaves_no_mark(rig: Rig) -> None:
    rig.run(range(1, 5))
    torque, status = rig.tick(6 * V)  # the fifth was missed
    assert (torque, status) == (held(), Status.ENCODER_JUMP)
    assert rig.tick(7 * V) == (held(), Status.OK)
    rig.run(range(8, 12))


def test_slow_motion_may_miss_a_tick(rig: Rig) -> None:
    """An acceleration that the drive could give is none to be refused."""
    for k in range(1, 5):
        assert rig.tick(10 * k, 10)[1] == Status.OK
    assert rig.tick(60, 10)[1] in (Status.OK, Status.SATURATED)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("joint", range(N))
def test_the_largest_plausible_change_of_speed_is_no_jump(rig: Rig, joint: int, sign: int) -> None:
    specified = rig.c.specification
    limit = specified.max_displacement_change(specified.joints[joint])
    for beyond in (0, 1):
        rig.begin()
        rig.run(range(1, 3))
        counts = [3 * V] * N
        counts[joint] += sign * (limit + beyond)
        status = rig.tick(counts)[1]
        assert (status == Status.ENCODER_JUMP) == bool(beyond)


def test_by_default_it_is_that_of_the_torque_limit_on_mbar() -> None:
    controller = load(CONTROLLERS / "puma3.toml")
    for joint in controller.joints:
        noise = 8
        counts = (controller.max_displacement_change(joint) - noise) * joint.rad_per_count / 1e-6
        one = joint.rad_per_count / 1e-6
        exact = float(joint.torque_limit / joint.inertia)
        assert exact <= counts < exact + one


@pytest.mark.parametrize("garbage", [0, 2**31 - 1, -(2**31), 123_456_789])
@pytest.mark.parametrize("ticks", [1, 5, 18])
def test_after_a_dropout_it_goes_on_where_the_robot_is(rig: Rig, ticks: int, garbage: int) -> None:
    offset = 10_000_000  # far from all the garbage
    rig.begin(offset)
    for k in range(1, 6):
        assert rig.tick(offset + k * V)[1] == Status.OK
    for _ in range(ticks):
        assert rig.tick(garbage) == (held(), Status.ENCODER_JUMP)
    back = 6 + ticks
    # The first good reading is far from the last one that was read; the second is believed.
    assert rig.tick(offset + back * V) == (held(), Status.ENCODER_JUMP)
    assert rig.tick(offset + (back + 1) * V) == (held(), Status.OK)
    assert rig.tick(offset + (back + 2) * V) == (held(), Status.OK)


def test_a_lasting_jump_is_believed_when_the_robot_could_be_there(rig: Rig) -> None:
    limit = rig.c.specification.joints[0].max_displacement
    jump = 3 * limit
    rig.run(range(1, 6))
    statuses = [rig.tick(k * V + jump, reference=k * V + jump)[1] for k in range(6, 20)]
    lost = statuses.index(Status.OK)
    # The robot is believed to be at most a limit a tick away from the last good position.
    assert jump + (lost + 1) * V <= (lost + 1) * limit
    assert jump + lost * V > lost * limit
    assert statuses == [Status.ENCODER_JUMP] * lost + [Status.OK] * (14 - lost)


def test_a_collision_costs_one_tick(rig: Rig) -> None:
    rig.run(range(1, 6))
    assert rig.tick(5 * V)[1] == Status.ENCODER_JUMP
    assert rig.tick(5 * V, 0) == (held(), Status.OK)
    assert [m.displacement for m in rig.c.last_memory] == [0] * N


@pytest.mark.parametrize("most", [1, 20, 1023])
def test_after_too_many_lost_ticks_only_init_helps(rig: Rig, most: int) -> None:
    rig.c.config.max_lost_ticks = most
    rig.run(range(1, 6))
    for _ in range(most):
        assert rig.tick(2**30) == (held(), Status.ENCODER_JUMP)
    before = bytes(rig.c.state)
    for counts in (2**30, 5 * V):
        assert rig.tick(counts) == ([0.0] * N, Status.STOPPED)
    assert bytes(rig.c.state) == before
    rig.begin(5 * V)
    assert rig.tick(6 * V) == (held(), Status.OK)


def test_a_good_tick_forgets_the_lost_ones(rig: Rig) -> None:
    rig.c.config.max_lost_ticks = 4
    at = 0
    for _ in range(10):
        rig.run(range(at + 1, at + 4))
        at += 3
        for _ in range(2):
            assert rig.tick(2**30)[1] == Status.ENCODER_JUMP
        at += 3
        assert rig.tick(at * V)[1] == Status.ENCODER_JUMP
        at += 1
        assert rig.tick(at * V)[1] == Status.OK


def test_a_bad_first_tick_is_counted_too(rig: Rig) -> None:
    rig.c.config.max_lost_ticks = 2
    assert [rig.tick(2**30)[1] for _ in range(3)] == [
        Status.ENCODER_JUMP,
        Status.ENCODER_JUMP,
        Status.STOPPED,
    ]


@pytest.mark.parametrize("kind", KINDS[:3])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_bad_reference_costs_its_tick_alone(kind: str, bad: float) -> None:
    rig = Rig(kind)
    rig.run(range(1, 6))
    assert rig.tick(6 * V, acceleration=bad) == (held(), Status.NOT_FINITE)
    assert rig.tick(7 * V) == (held(), Status.OK)
    rig.run(range(8, 12))


@pytest.mark.parametrize("anti_windup", [0, 1])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_sliding_variable_of_a_saturated_joint_stands_still(
    rig: Rig, sign: int, anti_windup: int
) -> None:
    rig.c.config.anti_windup = anti_windup
    far = sign * 200_000
    rig.tick(0, 0)
    before = rig.sliding
    seen = set()
    for _ in range(5):
        rig.tick(0, 0, reference=far)
        cut = [bool(rig.c.state.saturated_joints >> i & 1) for i in range(N)]
        seen |= set(cut)
        for i in range(N):
            assert (rig.sliding[i] == before[i]) == (cut[i] and anti_windup == 1)
        before = rig.sliding
    assert seen == {False, True}
