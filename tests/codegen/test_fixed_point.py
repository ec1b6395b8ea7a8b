"""Fixed-point C: its units, the analysis that excludes overflow, and its agreement with the law."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codegen.controller import Controller, load, read, resolve
from codegen.emit import generate, write
from codegen.fixed_point import INT32_MAX, SLIDING_INTEGRAL_MAX, fixed_joint, formats
from codegen.law import LawOptions, measurement, torque_law
from codegen.problems import SpecificationError
from plant.controller import GeneratedController
from plant.native import FLAGS, compiler, shared_library
from plant.units import units
from tests.codegen.conftest import CONTROLLERS, GENERATED
from tests.toolchain import WARNINGS
from verification.equivalence import variants

FIXED = load(CONTROLLERS / "puma3_fixed.toml")
OK, SATURATED, BAD_CONFIG, NOT_INITIALISED, JUMP, OUT_OF_RANGE = 0, 1, -2, -3, -4, -6
PHASE_LOST = 0x54444304
N = 3
F, T = 19, 16
POWER_ERROR = 2.0**-21.5


def fixed_puma(**law: Any) -> Controller:
    """puma3_fixed with other keys in [law], and in [safety] where they belong there."""
    data = read(CONTROLLERS / "puma3_fixed.toml")
    for key, value in law.items():
        table = "safety" if key == "max_speed_rad_per_s" else "law"
        data[table][key] = value
    return resolve(data, "puma3_fixed.toml")


@pytest.fixture
def puma() -> GeneratedController:
    return GeneratedController(FIXED, shared_library(GENERATED / "puma3_fixed"))


def step(
    controller: GeneratedController,
    counts: Sequence[int],
    *,
    reference_q8: Sequence[int] | None = None,
    velocity: Sequence[int] = (0,) * N,
    acceleration: Sequence[int] = (0,) * N,
) -> tuple[list[int], int]:
    """One tick in the controller's own units; the reference holds still by default."""
    given = controller.input
    given.counts[:] = counts
    given.reference_position_q8[:] = reference_q8 or [256 * c for c in counts]
    given.reference_velocity_q[:] = velocity
    given.reference_acceleration_q[:] = acceleration
    status = controller._step(*controller._pointers)
    return list(controller._torque), status


def memory_of(controller: GeneratedController) -> tuple[list[bytes], int]:
    """What a failed tick must leave as it was."""
    return [bytes(joint) for joint in controller.last_memory], controller.state.phase


def start(controller: GeneratedController) -> None:
    assert controller.reset(np.zeros(N, np.int32), np.array([1.0, -20.0, 5.0])) == OK


# --- Units and the analysis ---------------------------------------------------------------------


def test_the_formats_are_the_finest_that_fit() -> None:
    """By another way: the sums of the largest magnitudes in real numbers, joint by joint."""

    def largest(joint: Any, bits: int) -> float:
        rad, tick = abs(joint.rad_per_count), 0.001
        displacement, to_counts = joint.max_displacement, tick**2 / rad
        velocity = 2 * displacement * rad / tick
        sliding = velocity + 2 ** (30 - bits) * rad / tick
        demand = (
            float(joint.kd) * velocity ** float(joint.alpha)
            + float(joint.kp) * (2**23 * rad) ** float(joint.beta)
            + float(joint.lambda_) * sliding ** float(joint.gamma)
        )
        return float((displacement + demand * to_counts) * 2.0**bits)

    chosen = formats(FIXED)
    assert (chosen.fraction_bits, chosen.torque_bits) == (F, T)
    assert max(largest(joint, F) for joint in FIXED.joints) < 2**31
    # One bit more would let the velocity error leave what is kept for it.
    assert 2 * FIXED.joints[0].max_displacement * 2 ** (F + 1) > SLIDING_INTEGRAL_MAX + 1
    inertia = max(float(j.inertia) * abs(j.rad_per_count) / 1e-6 for j in FIXED.joints)
    assert inertia * 2.0 ** (T - F) < 0.5 < inertia * 2.0 ** (T + 1 - F)


@pytest.mark.parametrize(
    ("law", "quantity", "fix"),
    [
        ({"kp": 1e9}, "stiffness", "lower law.kp"),
        ({"kd": 1e9}, "damping", "lower law.kd"),
        ({"lambda": 1e9}, "correction", "lower law.lambda"),
        ({"max_speed_rad_per_s": 1e5}, "velocity_error", "lower safety.max_speed"),
        ({"inertia_kgm2": 1e8}, "inertia_factor", "lower the gains"),
    ],
)
def test_gains_that_could_overflow_are_refused_with_the_reason(
    law: dict[str, float], quantity: str, fix: str, tmp_path: Path
) -> None:
    with pytest.raises(SpecificationError) as caught:
        write(generate(fixed_puma(**law)), tmp_path)
    (problem,) = caught.value.problems
    assert problem.key == "arithmetic"
    assert "fits into 32 bits" in problem.rule
    assert quantity in problem.rule
    assert fix in problem.fix
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("keys", "named", "rule"),
    [
        ({"arithmetic": "fixed-point", "precision": "float64"}, "precision", "no floating-point"),
        ({"arithmetic": "fixed-point", "accuracy": "precise"}, "accuracy", "float32 only"),
        ({"precision": "float64", "accuracy": "precise"}, "accuracy", "float32 only"),
        ({"arithmetic": "fixed"}, "arithmetic", "floating-point"),
        ({"precision": "double"}, "precision", "float64"),
        ({"accuracy": "exact"}, "accuracy", "precise"),
    ],
)
def test_choices_that_do_not_go_together_are_refused(
    keys: dict[str, str], named: str, rule: str
) -> None:
    with pytest.raises(SpecificationError) as caught:
        resolve(read(CONTROLLERS / "puma3.toml") | keys)
    problem = next(p for p in caught.value.problems if p.key == named)
    assert rule in problem.rule


# --- The law ------------------------------------------------------------------------------------


OPTIONS = [v.options for v in variants(replace(FIXED, low_pass_ratio=Fraction(3, 13)))]


def options_name(options: LawOptions) -> str:
    return "-".join(
        filter(
            None,
            (
                options.velocity_error,
                options.acceleration,
                "low-pass" * options.low_pass,
                "report" * options.torque_report,
            ),
        )
    )


@pytest.mark.parametrize("options", OPTIONS, ids=options_name)
def test_the_c_agrees_with_the_casadi_law(options: LawOptions, tmp_path: Path) -> None:
    """The next torque and integral, within the errors of the powers and half units of rounding."""
    ratio = Fraction(3, 13) if options.low_pass else None
    controller = replace(FIXED, options=options, low_pass_ratio=ratio, name="variant")
    library = shared_library(write(generate(controller), tmp_path))
    c = GeneratedController(controller, library)
    rng = np.random.default_rng(7)
    worst = 0.0
    for _ in range(400):
        worst = max(worst, _one_step(c, rng))
    # The bound is no wider than it must be: some step comes near it.
    assert 0.05 < worst <= 1.0


def _one_step(c: GeneratedController, rng: np.random.Generator) -> float:
    """The largest error of one random step, in its bounds."""
    controller = c.specification
    chosen, options = formats(controller), controller.options
    unit, torque_unit = 2.0**-chosen.fraction_bits, 2.0**-chosen.torque_bits
    displacement = [
        int(rng.integers(-j.max_displacement, j.max_displacement + 1) / 4)
        for j in controller.joints
    ]
    position = [int(rng.normal() * 10 ** rng.uniform(0, 7)) for _ in range(N)]
    assert c.reset(np.zeros(N, np.int32), np.zeros(N)) == OK
    c.state.phase = 0x54444302
    c.config.anti_windup = 0
    memory, given = c.last_memory, c.input
    for i, joint in enumerate(controller.joints):
        limit = joint.max_displacement << chosen.fraction_bits
        m = memory[i]
        m.counts = int(rng.integers(-(2**31), 2**31))
        m.displacement = displacement[i] + int(rng.integers(-3, 4))
        m.sliding_integral_q = int(rng.normal() * 10 ** rng.uniform(1, 8.5))
        m.applied_torque_q = int(rng.uniform(-0.5, 0.5) * c.config.joint[i].torque_limit_q)
        given.counts[i] = _wrap(m.counts + displacement[i])
        given.reference_position_q8[i] = _wrap(256 * given.counts[i] + position[i])
        given.reference_velocity_q[i] = int(
            np.clip(displacement[i] / unit + rng.normal() * 10 ** rng.uniform(1, 8), -limit, limit)
        )
        given.reference_acceleration_q[i] = int(rng.normal() * 10 ** rng.uniform(1, 7))
        if options.acceleration == "delayed":
            m.displacement_change = int(rng.integers(-3, 4))
        if options.velocity_error == "error-difference":
            m.error_q8 = _wrap(position[i] - int(rng.integers(-2000, 2000)))
        if options.velocity_error == "half-sample":
            m.reference_velocity_q = int(rng.integers(-limit, limit))
        if options.torque_report:
            given.applied_torque_q[i] = m.applied_torque_q // 2
    before = [_copied(memory[i]) for i in range(N)]
    status = c._step(*c._pointers)
    assert status in (OK, SATURATED)
    worst = 0.0
    for i, joint in enumerate(controller.joints):
        rad, tick = joint.rad_per_count, float(controller.sample_time)
        last = before[i]
        per_count = rad / tick  # rad/s of one count a tick
        change = displacement[i] - last["displacement"]
        values = {
            "error_q8": position[i],
            "displacement": displacement[i],
            "displacement_change": last.get("displacement_change", change),
            "position": rad / 256,
            "velocity": per_count / (256 if options.velocity_error == "error-difference" else 1),
            "acceleration": per_count / tick,
            "reference_velocity": given.reference_velocity_q[i] * unit * per_count,
            "last_reference_velocity": last.get("reference_velocity_q", 0) * unit * per_count,
            "error_change_q8": _wrap(position[i] - last.get("error_q8", 0)),
            "reference_acceleration": given.reference_acceleration_q[i] * unit * per_count / tick,
            "last_torque": (
                given.applied_torque_q[i] if options.torque_report else last["applied_torque_q"]
            )
            * torque_unit,
            "sliding_integral": last["sliding_integral_q"] * unit * per_count,
            "sample_time": tick,
            "inertia": float(joint.inertia),
            "kd": float(joint.kd),
            "kp": float(joint.kp),
            "lambda": float(joint.lambda_),
            "alpha": float(joint.alpha),
            "beta": float(joint.beta),
            "gamma": float(joint.gamma),
            "torque_limit": float(joint.torque_limit),
            "low_pass_ratio": float(controller.low_pass_ratio or 0),
        }
        for function in (measurement(options), torque_law(options)):
            outputs = function.casadi_function().call([values[i_.name] for i_ in function.inputs])
            values |= {q.name: float(o) for q, o in zip(function.quantities, outputs, strict=True)}
        half = 0.5 * unit * abs(per_count) / tick  # half a unit of acceleration [rad/s^2]
        powers = [abs(values[n]) for n in ("damping", "stiffness", "correction")]
        # The half sample's sum is halved and rounded down: s and ed are off by half a unit.
        shift = half * tick if options.velocity_error == "half-sample" else 0.0
        steep = _steepness(values, shift)
        off = 3 * half + POWER_ERROR * sum(powers) + steep
        inertia = float(joint.inertia)
        bound = (
            inertia * off
            + 2.0**-30
            * inertia
            * (
                sum(powers)
                + abs(values["last_acceleration"])
                + abs(values["reference_acceleration"])
            )
            + 2.0 * torque_unit
        )
        now = _copied(c.last_memory[i])
        remembered = {
            "counts": given.counts[i],
            "displacement": displacement[i],
            "displacement_change": change,
            "error_q8": position[i],
            "reference_velocity_q": given.reference_velocity_q[i],
        }
        assert all(now[name] == value for name, value in remembered.items() if name in now)
        got = now["applied_torque_q"] * torque_unit
        worst = max(worst, abs(got - values["limited_torque"]) / bound)
        integral = c.last_memory[i].sliding_integral_q * unit * per_count
        clamp = SLIDING_INTEGRAL_MAX * unit * abs(per_count)
        expected = np.clip(values["next_sliding_integral"], -clamp, clamp)
        allowed = tick * (2 * half + POWER_ERROR * sum(powers[:2]) + steep) + 1e-12 * clamp
        worst = max(worst, abs(integral - expected) / allowed)
    return worst


def _steepness(values: dict[str, float], shift: float) -> float:
    """What an error of the velocity error makes of its two powers, at most."""
    if shift == 0.0:
        return 0.0
    off = 0.0
    for gain, base, exponent in (
        ("kd", "velocity_error", "alpha"),
        ("lambda", "sliding_variable", "gamma"),
    ):
        x = abs(values[base])
        ends = (abs(x - shift), x + shift)
        off += values[gain] * abs(ends[1] ** values[exponent] - ends[0] ** values[exponent])
        if x < shift:
            off += 2 * values[gain] * shift ** values[exponent]
    return off


def _copied(memory: ctypes.Structure) -> dict[str, int]:
    return {name: getattr(memory, name) for name, *_ in memory._fields_}


def _wrap(value: int) -> int:
    return (int(value) + 2**31) % 2**32 - 2**31


def test_nothing_overflows_with_the_undefined_behaviour_sanitiser(tmp_path: Path) -> None:
    """Every corner of what is allowed, and random bits in every input."""
    target = tmp_path / "checked.so"
    sources = sorted(str(p) for p in (GENERATED / "puma3_fixed").glob("*.c"))
    subprocess.run(
        [
            compiler(),
            *FLAGS,
            "-fsanitize=undefined",
            "-fno-sanitize-recover=all",
            *sources,
            "-o",
            str(target),
        ],
        check=True,
    )
    # Loaded in a process of its own: the sanitiser ends it at the first finding.
    script = f"""
import itertools, numpy as np
from pathlib import Path
from codegen.controller import load
from codegen.fixed_point import SLIDING_INTEGRAL_MAX
from plant.controller import GeneratedController
specification = load(Path({str(CONTROLLERS / "puma3_fixed.toml")!r}))
c = GeneratedController(specification, Path({str(target)!r}))
c.config.max_lost_ticks = 1023
for joint in c.config.joint:
    joint.max_displacement_change = 2**30 - 1
joint = c.config.joint[0]
limit, motion = joint.max_displacement, joint.max_displacement << {F}
corners = itertools.product(*[(-1, 1)] * 6)
good = 0
for signs in corners:
    c.reset(np.zeros(3, np.int32), np.zeros(3))
    c.state.phase = 0x54444302
    for i in range(3):
        m = c.last_memory[i]
        m.counts, m.displacement = 0, signs[0] * limit
        m.sliding_integral_q = signs[1] * SLIDING_INTEGRAL_MAX
        m.applied_torque_q = signs[2] * c.config.joint[i].torque_limit_q
        c.input.counts[i] = signs[3] * limit
        c.input.reference_position_q8[i] = 256 * c.input.counts[i] + signs[4] * (2**31 - 1)
        c.input.reference_velocity_q[i] = signs[5] * motion
        c.input.reference_acceleration_q[i] = signs[4] * motion
    good += c._step(*c._pointers) >= 0
assert good == 64, good
rng = np.random.default_rng(3)
for _ in range(20000):
    words = rng.integers(-2**31, 2**31, 12)
    for field, row in zip(("counts", "reference_position_q8", "reference_velocity_q",
                           "reference_acceleration_q"), words.reshape(4, 3)):
        getattr(c.input, field)[:] = row.tolist()
    c._step(*c._pointers)
print("nothing")
"""
    runtime = subprocess.run(
        [compiler(), "-print-file-name=libubsan.so"], capture_output=True, text=True, check=True
    ).stdout.strip()
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=False,
        env={"LD_PRELOAD": runtime, "PATH": "/usr/bin:/bin"},
        cwd=CONTROLLERS.parent,
    )
    assert done.stdout.strip() == "nothing", done.stderr


# --- The contract -------------------------------------------------------------------------------


def test_a_reference_beyond_its_range_changes_nothing(puma: GeneratedController) -> None:
    start(puma)
    assert step(puma, [0] * N)[1] == OK
    motion = puma.config.joint[1].max_displacement << F
    before = memory_of(puma)
    for field in ("velocity", "acceleration"):
        for beyond in (motion + 1, -motion - 1, INT32_MAX, -INT32_MAX - 1):
            torque, status = step(puma, [0] * N, **{field: [0, beyond, 0]})
            assert status == OUT_OF_RANGE
            assert torque == [puma.last_memory[i].applied_torque_q for i in range(N)]
            assert puma.state.phase in (PHASE_LOST, PHASE_LOST + 1)
            assert memory_of(puma)[0] == before[0]
            start(puma)
            step(puma, [0] * N)
        for within in (motion, -motion):
            start(puma)
            assert step(puma, [0] * N, **{field: [0, within, 0]})[1] in (OK, SATURATED)
        start(puma)
        step(puma, [0] * N)
        before = memory_of(puma)


def test_a_jump_is_seen_in_both_directions(puma: GeneratedController) -> None:
    limit = puma.config.joint[0].max_displacement
    for sign in (1, -1):
        start(puma)
        assert step(puma, [sign * (limit + 1), 0, 0])[1] == JUMP
        assert step(puma, [sign * limit, 0, 0])[1] in (OK, SATURATED)


def test_the_torque_is_cut_to_its_limit_and_remembered(puma: GeneratedController) -> None:
    start(puma)
    motion = puma.config.joint[1].max_displacement << F
    torque, status = step(puma, [0] * N, acceleration=[0, motion, 0])
    limit = puma.config.joint[1].torque_limit_q
    assert (torque[1], status, puma.state.saturated_joints) == (limit, SATURATED, 0b010)
    assert puma.last_memory[1].applied_torque_q == limit


def test_a_holding_torque_beyond_the_limit_is_refused(puma: GeneratedController) -> None:
    assert puma.reset(np.zeros(N, np.int32), np.array([0.0, 80.0, 0.0])) == OUT_OF_RANGE
    assert step(puma, [0] * N) == ([0, 0, 0], NOT_INITIALISED)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("torque_limit_q", 0),
        ("torque_limit_q", INT32_MAX),
        ("inertia_factor", 0),
        ("inertia_factor", -INT32_MAX - 1),
        ("max_displacement", 0),
        ("max_displacement", 2**30),
        ("max_displacement_change", 0),
        ("max_displacement_change", 2**30),
        ("stiffness", (2**31, 30 << 24)),
        ("damping", (2**31, 10 << 24)),
        ("correction", (2**31, 2 << 24)),
        ("torque_limit_q", 2**29 + 1),
        ("damping", (0, 0)),
    ],
)
def test_a_configuration_that_could_overflow_is_refused(
    puma: GeneratedController, field: str, value: Any
) -> None:
    assert puma.check_config() == OK
    setattr(puma.config.joint[2], field, value)
    assert puma.check_config() == BAD_CONFIG


def test_two_powers_that_both_saturate_do_not_add_up_to_little(puma: GeneratedController) -> None:
    for field in ("damping", "stiffness"):
        setattr(puma.config.joint[0], field, (2**31, 100 << 24))
    assert puma.check_config() == BAD_CONFIG


def test_limits_may_be_lowered_below_what_is_remembered(puma: GeneratedController) -> None:
    """The sums still fit: a wrapped one would turn the torque's sign."""
    joint = puma.config.joint[0]
    joint.torque_limit_q, joint.inertia_factor = 2**29, 2**30
    assert puma.check_config() == OK
    start(puma)
    step(puma, [0] * N)
    puma.last_memory[0].applied_torque_q = 2**29
    puma.last_memory[0].displacement = -(2 ** (29 - F))
    joint.torque_limit_q, joint.max_displacement = 5_000_000, 700
    joint.max_displacement_change = 2**30 - 1
    assert puma.check_config() == OK
    torque, status = step(puma, [-700, 0, 0], velocity=[700 << F, 0, 0])
    assert (torque[0], status) == (5_000_000, SATURATED)


def test_gains_of_the_experiments_fit_into_the_same_c(puma: GeneratedController) -> None:
    for number in range(1, 13):
        tuned = load(CONTROLLERS / "puma3_fixed.toml", experiment=f"Exp{number:02}")
        puma.set_gains(tuned)
        assert puma.check_config() == OK, number
    # |e|^1.5 of the largest error that fits into an integer doesn't; its own C has coarser units.
    tuned = load(CONTROLLERS / "puma3_fixed.toml", experiment="Exp13")
    puma.set_gains(tuned)
    assert puma.check_config() == BAD_CONFIG
    assert formats(tuned).fraction_bits < F


def test_a_motor_that_turns_back_has_a_negative_factor() -> None:
    data = read(CONTROLLERS / "puma3_fixed.toml")
    data["encoder"] = {"gear_ratio": -120}
    turned = resolve(data)
    assert units(turned).torque.field == "applied_torque_q"
    ours, theirs = (fixed_joint(c, c.joints[0], formats(c)) for c in (FIXED, turned))
    assert theirs.inertia_factor == -ours.inertia_factor
    assert theirs.powers == ours.powers


@pytest.mark.parametrize("cpu", ["cortex-m3", "cortex-m0plus"])
@pytest.mark.parametrize("level", ["-O2", "-Os"])
def test_the_objects_need_nothing_but_memcpy(cpu: str, level: str, tmp_path: Path) -> None:
    undefined: set[str] = set()
    defined: set[str] = set()
    for source in (GENERATED / "puma3_fixed").glob("*.c"):
        target = tmp_path / f"{source.stem}.o"
        subprocess.run(
            [
                "arm-none-eabi-gcc",
                f"-mcpu={cpu}",
                "-mthumb",
                "-mfloat-abi=soft",
                level,
                "-ffreestanding",
                "-fbuiltin",
                *WARNINGS,
                "-c",
                str(source),
                "-o",
                str(target),
            ],
            check=True,
        )
        listing = subprocess.run(
            ["arm-none-eabi-nm", str(target)], capture_output=True, text=True, check=True
        ).stdout
        for words in map(str.split, listing.splitlines()):
            (undefined if words[-2] == "U" else defined).add(words[-1])
        assert not any(w[-2] in "dDbB" for w in map(str.split, listing.splitlines()))
    assert undefined - defined <= {"memcpy"}
