"""The contract of the generated functions: what each input gets, and what is left untouched."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codegen.controller import load
from plant.controller import GeneratedController, LayoutError
from plant.native import shared_library
from tests.codegen.conftest import CONTROLLERS, GENERATED, variant

OK, SATURATED = 0, 1
BAD_ARGUMENT, BAD_CONFIG, NOT_INITIALISED, ENCODER_JUMP, NOT_FINITE = -1, -2, -3, -4, -5
HOLD, ZERO = 0, 1
STOPPED = -7
PHASE_START, PHASE_RUNNING, PHASE_LOST = 0x54444300, 0x54444302, 0x54444304
SAMPLE_TIME = 0.001
RAD_PER_COUNT = 2 * math.pi / (8192 * 120)
HOLDING = np.array([1.0, -20.0, 5.0])
N = 3

Make = Callable[[str], GeneratedController]


@pytest.fixture
def make(variant_sources: Callable[[str], Path]) -> Make:
    return lambda name: GeneratedController(variant(name), shared_library(variant_sources(name)))


@pytest.fixture
def puma3() -> GeneratedController:
    return GeneratedController(
        load(CONTROLLERS / "puma3.toml"), shared_library(GENERATED / "puma3")
    )


def step(
    controller: GeneratedController,
    counts: list[int],
    *,
    reference_q8: list[int] | None = None,
    velocity: list[float] | None = None,
    acceleration: list[float] | None = None,
) -> tuple[list[float], int]:
    """One tick with everything given as the C takes it; the reference holds still by default."""
    given_ = controller.input
    given_.counts[:] = counts
    wrapped = [_wrap(256 * c) for c in counts]
    given_.reference_position_q8[:] = wrapped if reference_q8 is None else reference_q8
    given_.reference_velocity_rad_per_s[:] = velocity or [0.0] * N
    given_.reference_acceleration_rad_per_s2[:] = acceleration or [0.0] * N
    torque = (ctypes.c_float * N)()
    status = controller._step(
        ctypes.byref(controller.config),
        ctypes.byref(controller.state),
        ctypes.byref(given_),
        torque,
    )
    return list(torque), status


def _wrap(value: int) -> int:
    return (value + 2**31) % 2**32 - 2**31


def start(controller: GeneratedController, counts: list[int] | None = None) -> None:
    status = controller.reset(np.array(counts or [0] * N, dtype=np.int32), HOLDING)
    assert status == OK


def scribble_on_scratch(controller: GeneratedController) -> None:
    """Fills the memory beside the last tick's with the bits of a NaN."""
    for joint in controller.state.joint:
        scratch = joint.tick[1 - (controller.state.phase & 1)]
        ctypes.memset(ctypes.byref(scratch), 0xFF, ctypes.sizeof(scratch))


def kept(controller: GeneratedController) -> bytes:
    """All of a running state that the next tick takes from it."""
    state = controller.state
    words = (ctypes.c_uint32 * 2)(state.phase, state.saturated_joints)
    return bytes(words) + b"".join(map(bytes, controller.last_memory))


def test_the_counts_of_a_radian_are_published(puma3: GeneratedController) -> None:
    published = (ctypes.c_float * N).in_dll(puma3._library, "tdc_puma3_counts_per_rad")
    assert list(published) == pytest.approx([1 / RAD_PER_COUNT] * N, rel=1e-7)


def test_at_rest_the_holding_torque_is_held(puma3: GeneratedController) -> None:
    start(puma3, [5, -7, 100_000])
    for _ in range(3):
        assert step(puma3, [5, -7, 100_000]) == (HOLDING.tolist(), OK)


@pytest.mark.parametrize("missing", range(4))
def test_init_refuses_null(puma3: GeneratedController, missing: int) -> None:
    arguments: list[Any] = [
        ctypes.byref(puma3.config),
        ctypes.byref(puma3.state),
        (ctypes.c_int32 * N)(),
        (ctypes.c_float * N)(),
    ]
    arguments[missing] = None
    assert puma3._init(*arguments) == BAD_ARGUMENT
    assert bytes(puma3.state) == bytes(len(bytes(puma3.state)))


@pytest.mark.parametrize("missing", range(4))
def test_step_refuses_null_with_zero_torque(puma3: GeneratedController, missing: int) -> None:
    start(puma3)
    before = bytes(puma3.state)
    torque = (ctypes.c_float * N)(9.0, 9.0, 9.0)
    arguments: list[Any] = [
        ctypes.byref(puma3.config),
        ctypes.byref(puma3.state),
        ctypes.byref(puma3.input),
        torque,
    ]
    arguments[missing] = None
    assert puma3._step(*arguments) == BAD_ARGUMENT
    assert list(torque) == ([9.0] * N if missing == 3 else [0.0] * N)
    assert bytes(puma3.state) == before


def test_a_state_that_nobody_filled_is_refused(puma3: GeneratedController) -> None:
    assert step(puma3, [0] * N) == ([0.0] * N, NOT_INITIALISED)
    ctypes.memset(ctypes.byref(puma3.state), 0xFF, ctypes.sizeof(puma3.state))
    assert step(puma3, [0] * N) == ([0.0] * N, NOT_INITIALISED)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_init_refuses_a_holding_torque_that_is_not_finite(
    puma3: GeneratedController, bad: float
) -> None:
    before = bytes(puma3.state)
    assert puma3.reset(np.zeros(N, np.int32), np.array([0.0, bad, 0.0])) == NOT_FINITE
    assert bytes(puma3.state) == before


BAD_GAINS = [
    ("inertia_kgm2", 0.0),
    ("inertia_kgm2", -1.0),
    ("inertia_kgm2", math.nan),
    ("inertia_kgm2", math.inf),
    ("kd", -1.0),
    ("kd", math.nan),
    ("kp", -1e-30),
    ("lambda", math.inf),
    ("alpha", -(2**31)),
    ("beta", -(2**31)),
    ("torque_limit_Nm", 0.0),
    ("torque_limit_Nm", math.nan),
    ("max_displacement", 0),
    ("max_displacement", 2**30),
    ("max_displacement_change", 0),
    ("max_displacement_change", 2**30),
]


@pytest.mark.parametrize(("field", "value"), BAD_GAINS)
@pytest.mark.parametrize("joint", [0, N - 1])
def test_the_run_time_check_refuses_what_breaks_a_rule(
    puma3: GeneratedController, field: str, value: float, joint: int
) -> None:
    assert puma3.check_config() == OK
    setattr(puma3.config.joint[joint], field, value)
    assert puma3.check_config() == BAD_CONFIG
    before = bytes(puma3.state)
    assert puma3.reset(np.zeros(N, np.int32), HOLDING) == BAD_CONFIG
    assert bytes(puma3.state) == before


@pytest.mark.parametrize(("field", "value"), [("kd", 0.0), ("lambda", 0.0), ("gamma", -(2**31))])
def test_the_run_time_check_takes_the_ends_of_the_ranges(
    puma3: GeneratedController, field: str, value: float
) -> None:
    setattr(puma3.config.joint[1], field, value)
    assert puma3.check_config() == OK


def test_the_run_time_check_refuses_another_specification(puma3: GeneratedController) -> None:
    puma3.config.specification ^= 1
    assert puma3.check_config() == BAD_CONFIG


@pytest.mark.parametrize(
    ("field", "good", "bad"),
    [
        ("on_error", (HOLD, ZERO), (2, 2**32 - 1)),
        ("anti_windup", (0, 1), (2, 2**32 - 1)),
        ("max_lost_ticks", (1, 1023), (0, 1024, 2**32 - 1)),
    ],
)
def test_the_run_time_check_looks_at_what_all_joints_share(
    puma3: GeneratedController, field: str, good: tuple[int, ...], bad: tuple[int, ...]
) -> None:
    for values, status in ((good, OK), (bad, BAD_CONFIG)):
        for value in values:
            setattr(puma3.config, field, value)
            assert puma3.check_config() == status


def test_a_low_pass_ratio_above_one_is_refused(make: Make) -> None:
    controller = make("low-pass")
    for value, status in (
        (1.0, OK),
        (1.001, BAD_CONFIG),
        (0.0, BAD_CONFIG),
        (math.nan, BAD_CONFIG),
    ):
        controller.config.joint[2].low_pass_ratio = value
        assert controller.check_config() == status


@pytest.mark.parametrize(("on_error", "torque"), [(HOLD, HOLDING.tolist()), (ZERO, [0.0] * N)])
@pytest.mark.parametrize("joint", range(N))
@pytest.mark.parametrize(
    ("fault", "status"),
    [("jump", ENCODER_JUMP), (math.nan, NOT_FINITE), (math.inf, NOT_FINITE), (3e38, NOT_FINITE)],
)
def test_a_lost_tick_leaves_the_memory(
    puma3: GeneratedController,
    joint: int,
    fault: Any,
    status: int,
    on_error: int,
    torque: list[float],
) -> None:
    puma3.config.on_error = on_error
    puma3.config.joint[joint].inertia_kgm2 = 2.0
    start(puma3)
    counts, acceleration = [0] * N, [0.0] * N
    if fault == "jump":
        counts[joint] = puma3.config.joint[joint].max_displacement + 1
    else:
        acceleration[joint] = fault
    for tick in (1, 2):  # the memory lies at either index
        assert step(puma3, [0] * N)[1] == OK
        before = kept(puma3)
        assert step(puma3, counts, acceleration=acceleration) == (torque, status)
        assert puma3.state.phase == PHASE_LOST + tick % 2
        assert puma3.state.lost_ticks == 1
        puma3.state.phase = PHASE_RUNNING + tick % 2
        assert kept(puma3) == before
        start(puma3)
        assert step(puma3, [0] * N)[1] == OK


@pytest.mark.parametrize("sign", [1, -1])
def test_a_failed_first_tick_leaves_what_init_set(puma3: GeneratedController, sign: int) -> None:
    start(puma3, [7, 8, 9])
    jump = sign * 100_000
    assert step(puma3, [7, 8, jump], velocity=[math.inf] * N)[1] == ENCODER_JUMP
    assert step(puma3, [7, 8, 9], velocity=[math.nan] * N) == (HOLDING.tolist(), ENCODER_JUMP)
    assert step(puma3, [7, 8, 9], velocity=[math.nan] * N) == (HOLDING.tolist(), NOT_FINITE)
    assert puma3.state.phase == PHASE_START
    assert puma3.state.lost_ticks == 3
    assert puma3.state.saturated_joints == 0
    assert [m.counts for m in puma3.last_memory] == [7, 8, 9]
    assert [m.applied_torque_Nm for m in puma3.last_memory] == HOLDING.tolist()
    # The next attempt is a first tick like any other: nothing of the failed ones is left.
    again = step(puma3, [7, 8, 9], velocity=[0.1] * N)
    start(puma3, [7, 8, 9])
    assert again == step(puma3, [7, 8, 9], velocity=[0.1] * N)


def test_good_ticks_write_their_memory_to_either_index_in_turn(puma3: GeneratedController) -> None:
    start(puma3)
    assert puma3.state.phase == PHASE_START
    for tick in range(1, 6):
        scribble_on_scratch(puma3)
        # The third one is settled, because a torque is beyond its limit.
        acceleration = [0.0, 0.0, {3: 1e6, 4: -100.0}.get(tick, 0.0)]
        before = [bytes(m) for m in puma3.last_memory]
        torque, status = step(puma3, [tick, 0, -tick], acceleration=acceleration)
        assert status == (SATURATED if tick == 3 else OK)
        assert puma3.state.phase == PHASE_RUNNING + tick % 2
        if tick > 1:  # the first tick completes its memory before it takes it
            assert [bytes(j.tick[1 - tick % 2]) for j in puma3.state.joint] == before
        assert [m.counts for m in puma3.last_memory] == [tick, 0, -tick]
        assert [m.applied_torque_Nm for m in puma3.last_memory] == torque


@pytest.mark.parametrize("name", ["paper", "all"])
def test_scratch_is_not_read(make: Make, name: str) -> None:
    """Two controllers take the same ticks, one with noise in its scratch; bad ticks included.

    Of a lost tick, the reading is kept there, and read.
    """
    clean, noisy = make(name), make(name)
    start(clean)
    start(noisy)
    for tick, spoilt in enumerate([1.0, 1.0, math.nan, 1.0, 1.0, math.inf, 1.0, 1e30, 1.0]):
        latest = [j.tick[1 - (noisy.state.phase & 1)].counts for j in noisy.state.joint]
        scribble_on_scratch(noisy)
        for joint, counts in zip(noisy.state.joint, latest, strict=True):
            if not PHASE_RUNNING <= noisy.state.phase <= PHASE_RUNNING + 1:
                joint.tick[1 - (noisy.state.phase & 1)].counts = counts
        taken = [
            step(each, [3 * tick, 5 * tick, -tick * tick], velocity=[0.2, 0.1 * spoilt, -0.3])
            for each in (clean, noisy)
        ]
        assert taken[0] == taken[1]
        assert kept(clean) == kept(noisy)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("joint", range(N))
def test_a_torque_at_its_limit_is_not_cut_and_one_beyond_is(
    puma3: GeneratedController, joint: int, sign: int
) -> None:
    for gain in ("kd", "kp", "lambda"):
        for gains in puma3.config.joint:
            setattr(gains, gain, 0.0)
    # Without feedback and at rest, the law demands the last torque.
    limit = puma3.config.joint[joint].torque_limit_Nm
    above = float(np.nextafter(np.float32(limit), np.float32(np.inf)))
    for demanded, bits in ((limit, 0), (above, 1 << joint)):
        holding = HOLDING.copy()
        holding[joint] = sign * demanded
        assert puma3.reset(np.zeros(N, np.int32), holding) == OK
        torque, status = step(puma3, [0] * N)
        assert (torque[joint], status) == (sign * limit, SATURATED if bits else OK)
        assert puma3.state.saturated_joints == bits
    # Where another joint must be cut, that at its limit is looked at too, and not flagged.
    other = (joint + 1) % N
    holding[joint] = sign * limit
    holding[other] = 1e6
    assert puma3.reset(np.zeros(N, np.int32), holding) == OK
    assert step(puma3, [0] * N)[1] == SATURATED
    assert puma3.state.saturated_joints == 1 << other


@pytest.mark.parametrize("sign", [1, -1])
def test_the_widest_limit_of_the_displacement_is_no_jump(
    puma3: GeneratedController, sign: int
) -> None:
    """Sums of the limit and the displacement reach 2^31 - 2 there."""
    for joint in puma3.config.joint:
        joint.max_displacement = joint.max_displacement_change = 2**30 - 1
        joint.torque_limit_Nm = 3e38
    for second, status in (
        (2**31 + 1, ENCODER_JUMP),
        (2**30 - 2**31, ENCODER_JUMP),
        (2**31 - 2, OK),
    ):
        start(puma3)
        assert step(puma3, [sign * (2**30 - 1)] * N)[1] == OK
        assert step(puma3, [_wrap(sign * second)] * N)[1] == status


def test_an_infinite_integral_fails_every_tick_until_init(puma3: GeneratedController) -> None:
    """Only the torque is looked at; the header says what errors of 1e30 rad do."""
    puma3.config.max_lost_ticks = 2
    gains, largest = puma3.config.joint[0], float(np.finfo(np.float32).max)
    gains.inertia_kgm2, gains.kd, gains.kp = 1e-38, 0.0, 3e38
    assert puma3.check_config() == OK
    start(puma3)
    _, status = step(puma3, [0] * N, reference_q8=[2 * 10**7, 0, 0], velocity=[-largest, 0.0, 0.0])
    assert status == OK
    assert math.isinf(puma3.last_memory[0].sliding_integral_rad_per_s)
    statuses = [step(puma3, [0] * N)[1] for _ in range(3)]
    assert statuses == [NOT_FINITE, NOT_FINITE, STOPPED]
    start(puma3)
    assert step(puma3, [0] * N)[1] == OK


@pytest.mark.parametrize("sign", [1, -1])
def test_the_largest_plausible_displacement_is_no_jump(
    puma3: GeneratedController, sign: int
) -> None:
    limit = puma3.config.joint[0].max_displacement
    start(puma3)
    assert step(puma3, [sign * (limit + 1), 0, 0])[1] == ENCODER_JUMP
    assert step(puma3, [sign * limit, 0, 0])[1] in (OK, SATURATED)


def test_the_saturated_torque_is_what_is_remembered(puma3: GeneratedController) -> None:
    start(puma3)
    limit = puma3.config.joint[1].torque_limit_Nm
    torque, status = step(puma3, [0] * N, acceleration=[0.0, 1e4, 0.0])
    assert (torque[1], status) == (limit, SATURATED)
    assert puma3.state.saturated_joints == 0b010
    assert puma3.last_memory[1].applied_torque_Nm == limit
    # With the commanded torque remembered, an equal step back would not leave the limit.
    torque, status = step(puma3, [0] * N, acceleration=[0.0, -10.0, 0.0])
    assert status == OK
    assert torque[1] == pytest.approx(limit - 10 * puma3.config.joint[1].inertia_kgm2)
    assert puma3.state.saturated_joints == 0


def test_the_reported_torque_is_taken_for_the_last_one(make: Make) -> None:
    controller = make("torque-report")
    start(controller)
    controller.input.applied_torque_Nm[:] = [3.0, -4.0, 5.0]
    assert step(controller, [0] * N) == ([3.0, -4.0, 5.0], OK)


@given(
    offsets=st.lists(st.integers(-(2**31), 2**31 - 1), min_size=N, max_size=N),
    moves=st.lists(st.integers(-700, 700), min_size=N, max_size=N),
)
def test_the_place_on_the_circle_of_counts_changes_no_bit(
    offsets: list[int], moves: list[int]
) -> None:
    torques = []
    for shift in ([0] * N, offsets):
        controller = GeneratedController(
            load(CONTROLLERS / "puma3.toml"), shared_library(GENERATED / "puma3")
        )
        start(controller, [_wrap(s) for s in shift])
        runs = []
        for tick in range(1, 4):
            counts = [_wrap(s + tick * m) for s, m in zip(shift, moves, strict=True)]
            reference = [_wrap(256 * s + 1000 * tick) for s in shift]
            runs.append(step(controller, counts, reference_q8=reference, velocity=[0.3] * N))
        torques.append(runs)
    assert torques[0] == torques[1]


def sig(x: float, exponent: float) -> float:
    return math.copysign(abs(x) ** exponent, x)


def paper_torque(
    controller: GeneratedController,
    joint: int,
    e: float,
    ed: float,
    s: float,
    qdd_d: float,
    qdd: float,
    last: float,
) -> float:
    """(31), written down once more, in double."""
    g = controller.config.joint[joint]
    alpha, beta, gamma = (1 + getattr(g, name) / 2**31 for name in ("alpha", "beta", "gamma"))
    u = qdd_d + g.kd * sig(ed, alpha) + g.kp * sig(e, beta)
    tau: float = g.inertia_kgm2 * (u + getattr(g, "lambda") * sig(s, gamma) - qdd) + last
    ratio: float = getattr(g, "low_pass_ratio", 1.0)
    return ratio * tau + (1 - ratio) * last


@pytest.mark.parametrize(
    "name",
    ["paper", "error-difference", "half-sample", "delayed", "low-pass", "all"],
)
def test_four_ticks_follow_the_paper(make: Make, name: str) -> None:
    """The sampled law, written independently: differences, s from zero, delayed estimate."""
    controller = make(name)
    options = controller.specification.options
    controller.config.joint[2].torque_limit_Nm = 1e6  # saturation has its own test
    start(controller)
    positions = [40, 95, 170, 260, 380]
    reference_q8 = [256 * 60 * k + 77 for k in range(1, 6)]
    velocity = [0.3, 0.35, 0.42, 0.38, 0.31]
    acceleration = [5.0, -3.0, 2.0, 0.5, 1.0]
    last = float(HOLDING[2])
    integral = e_before = None
    seconds: list[float] = []
    for k, q in enumerate(positions):
        q_before = positions[k - 1] if k else 0
        e = (reference_q8[k] / 256 - q) * RAD_PER_COUNT
        rate = (q - q_before) * RAD_PER_COUNT / SAMPLE_TIME
        if options.velocity_error == "reference-rate":
            ed = velocity[k] - rate
        elif options.velocity_error == "half-sample":
            ed = (velocity[k] + velocity[max(k - 1, 0)]) / 2 - rate
        else:
            ed = (e - e_before) / SAMPLE_TIME if e_before is not None else 0.0
        second = (q - 2 * q_before + positions[k - 2]) if k > 1 else (q - 2 * q_before)
        seconds.append(second * RAD_PER_COUNT / SAMPLE_TIME**2 if k else 0.0)
        qdd = seconds[-1]
        if options.acceleration == "delayed":
            qdd = seconds[-2] if k else 0.0
        integral = -ed if integral is None else integral
        if options.torque_report:
            controller.input.applied_torque_Nm[:] = [0.0, 0.0, last]
        expected = paper_torque(controller, 2, e, ed, ed + integral, acceleration[k], qdd, last)
        torque, status = step(
            controller,
            [0, 0, q],
            reference_q8=[0, 0, reference_q8[k]],
            velocity=[0.0, 0.0, velocity[k]],
            acceleration=[0.0, 0.0, acceleration[k]],
        )
        assert status == OK
        assert torque[2] == pytest.approx(expected, rel=1e-5, abs=2e-5)
        g = controller.config.joint[2]
        integral += SAMPLE_TIME * (
            g.kd * sig(ed, 1 + g.alpha / 2**31) + g.kp * sig(e, 1 + g.beta / 2**31)
        )
        last, e_before = torque[2], e


def test_switching_on_in_motion_does_not_kick(puma3: GeneratedController) -> None:
    """At 1 rad/s a second difference against rest would ask for 380 N m."""
    moved = round(SAMPLE_TIME / RAD_PER_COUNT)
    start(puma3)
    torque, status = step(puma3, [moved] * N, velocity=[1.0] * N)
    assert status == OK
    assert np.allclose(torque, HOLDING, atol=0.2)


def test_gains_can_be_tuned_while_running(puma3: GeneratedController) -> None:
    puma3.set_gains(load(CONTROLLERS / "puma3.toml", experiment="Exp01"))
    assert puma3.check_config() == OK
    assert getattr(puma3.config.joint[0], "lambda") == 0.0
    assert puma3.config.joint[0].alpha == 0
    with pytest.raises(LayoutError, match="gains"):
        puma3.set_gains(load(CONTROLLERS / "puma6.toml"))


def test_a_library_of_another_specification_is_refused(
    variant_sources: Callable[[str], Path],
) -> None:
    with pytest.raises(LayoutError):
        GeneratedController(variant("paper"), shared_library(variant_sources("delayed")))
    with pytest.raises(LayoutError):
        GeneratedController(load(CONTROLLERS / "puma6.toml"), shared_library(GENERATED / "puma3"))


def test_exponents_are_set_from_floats_within_their_range(tmp_path: Path) -> None:
    source = tmp_path / "exponent.c"
    source.write_text(
        '#include "tdc.h"\n'
        "int set(int32_t *q31, float a);\n"
        "int set(int32_t *q31, float a)\n"
        "{ return (int)tdc_exponent_set((tdc_exponent *)(void *)q31, a); }\n"
    )
    (tmp_path / "tdc.h").write_bytes((GENERATED / "puma3" / "tdc.h").read_bytes())
    library = ctypes.CDLL(str(shared_library(tmp_path)))
    library.set.argtypes = [ctypes.POINTER(ctypes.c_int32), ctypes.c_float]
    q31 = ctypes.c_int32(77)
    for bad in (-1e-30, 2.0, math.nan, math.inf):
        assert library.set(ctypes.byref(q31), bad) == BAD_CONFIG
        assert q31.value == 77
    assert library.set(None, 1.0) == BAD_CONFIG
    for a in (0.0, 0.4, 0.95, 1.0, 1.5, float(np.nextafter(np.float32(2), np.float32(0)))):
        assert library.set(ctypes.byref(q31), a) == OK
        assert q31.value / 2**31 + 1 == pytest.approx(float(np.float32(a)), abs=2**-24)
