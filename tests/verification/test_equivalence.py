"""The generated C agrees with the law, and C with a single mistake does not."""

from __future__ import annotations

import re
from pathlib import Path

import mpmath
import numpy as np
import pytest

from codegen.controller import Controller, load
from codegen.law import LawOptions
from plant.controller import LayoutError
from plant.native import GENERATED, shared_library
from verification.cases import (
    PHASE_RUNNING,
    PHASE_START,
    PHASES,
    REGIMES,
    STARTS_FROM,
    Regime,
    disperse,
    draw,
    first_index,
    last_memory,
    shipped_scales,
    wrap,
)
from verification.equivalence import check, check_all, compiled, summary, variant, variants
from verification.evidence import Evidence
from verification.experiments import CONTROLLERS

PUMA3 = load(CONTROLLERS / "puma3.toml")
PUMA6 = load(CONTROLLERS / "puma6.toml")
VARIANTS = variants(PUMA3)


@pytest.mark.parametrize("controller", [PUMA3, PUMA6], ids=lambda c: c.name)
def test_the_shipped_controllers_lie_in_the_enclosure(controller: Controller) -> None:
    result = check(controller, 20_000)
    assert result.holds, result.violations
    assert result.evidence is Evidence.SAMPLED
    assert result.tally.steps == 20_000
    assert min(result.tally.saturated, result.tally.jumps, result.tally.not_finite) > 50
    for each in (result.torque_Nm, result.sliding_integral_rad_per_s):
        for deviation in each.values():
            assert 0.0 < deviation.median < deviation.worst
            # Below, the enclosure would be too wide to say anything.
            assert 0.3 < deviation.worst_share <= 1.0


@pytest.mark.parametrize("controller", VARIANTS, ids=[v.name for v in VARIANTS])
def test_every_structure_of_the_law_lies_in_the_enclosure(controller: Controller) -> None:
    result = check(controller, 3000)
    assert result.holds, result.violations


def test_all_structures_are_there_once() -> None:
    assert len({v.options for v in VARIANTS}) == len({v.name for v in VARIANTS}) == 24
    assert VARIANTS[0] is PUMA3
    assert variant(PUMA3, LawOptions(low_pass=True)).low_pass_ratio is not None


def test_the_same_seed_gives_the_same_figures() -> None:
    assert check(PUMA3, 2000) == check(PUMA3, 2000)


def test_processes_give_what_one_process_gives() -> None:
    both = check_all([PUMA3], 200, processes=2)
    assert list(both) == ["puma3"]
    assert [r.controller for r in both["puma3"]] == [v.name for v in VARIANTS]
    assert both["puma3"][0] == check(PUMA3, 200)
    total = summary(PUMA3, both["puma3"])
    assert (total.variants, total.tally.steps, total.violations) == (24, 4800, 0)


@pytest.mark.parametrize("regime", REGIMES)
def test_states_of_every_phase_are_drawn_with_noise_where_no_step_looks(regime: Regime) -> None:
    c = compiled(PUMA3)
    rng = np.random.default_rng(5)
    state = draw(PUMA3, c.types, c.default_config, 2000, regime, rng).state
    phases, often = np.unique(state["phase"], return_counts=True)
    assert phases.tolist() == list(PHASES)
    assert min(often) > 80
    other = state.copy()
    other["phase"] ^= 1
    scratch = last_memory(other)
    # But for the latest reading where ticks were lost.
    for name in set(scratch.dtype.names or ()) - {"counts"}:
        assert len(np.unique(scratch[name].view(np.uint32))) > 0.99 * scratch.size
    first = state["phase"] == PHASE_START
    assert len(np.unique(last_memory(state)["displacement"][first])) > 0.99 * 3 * first.sum()


def test_dispersed_states_remember_the_same() -> None:
    state = np.zeros(300, np.dtype(compiled(PUMA3).types.state))
    state["phase"] = np.repeat([PHASE_START, PHASE_RUNNING, 7], 100)
    rng = np.random.default_rng(6)
    for name in last_memory(state).dtype.names or ():
        first_index(state)[name] = rng.integers(-1000, 1000, (300, 3))
    before = state.copy()
    disperse(state, rng)
    assert 20 < np.count_nonzero(state["phase"] == PHASE_RUNNING + 1) < 80
    then, now = last_memory(before), last_memory(state)
    assert np.array_equal(then[100:200], now[100:200])
    for name in STARTS_FROM:
        assert np.array_equal(then[name], now[name])
    assert np.array_equal(before[200:], state[200:])


@pytest.mark.parametrize("controller", [PUMA3, PUMA6], ids=lambda c: c.name)
def test_the_conversion_factors_follow_from_the_encoder(controller: Controller) -> None:
    for name, values in shipped_scales(controller).items():
        for joint, value in zip(controller.joints, values, strict=True):
            counts, sample_time = (
                mpmath.mpf(x.numerator) / x.denominator
                for x in (joint.counts_per_joint_rev, controller.sample_time)
            )
            angle = 2 * mpmath.pi / counts
            exact = {
                "position": angle / 256,
                "velocity": angle / sample_time,
                "acceleration": angle / sample_time**2,
            }[name]
            assert abs(value - exact) <= abs(exact) * 2.0**-24 * (1 + 2.0**-20)


@pytest.mark.parametrize(
    ("value", "wrapped"),
    [(2**31, -(2**31)), (-(2**31) - 1, 2**31 - 1), (2**40 + 5, 5), (-1, -1)],
)
def test_wrapping_is_that_of_int32(value: int, wrapped: int) -> None:
    assert wrap(np.array([value]))[0] == wrapped


# --- Mutants -----------------------------------------------------------------------------------

MUTANTS = {
    "sign of the spring": ("= damping + stiffness;", "= damping - stiffness;"),
    "sign of the acceleration": (
        "last_torque - (gains->inertia_kgm2",
        "last_torque + (gains->inertia_kgm2",
    ),
    "1/256 dropped": ("error_q8 * POSITION_SCALE,", "error_q8 * 256.0f * POSITION_SCALE,"),
    "commanded torque remembered": (
        "next->applied_torque_Nm = limited_torque;",
        "",
    ),
    "not saturated": (
        "tdc_max(-gains->torque_limit_Nm, tdc_min(gains->torque_limit_Nm, control_torque));",
        "control_torque;",
    ),
    "sample time forgotten": ("(TDC_PUMA3_SAMPLE_TIME_S * restoring)", "restoring"),
    "rectangle of the wrong quantity": (
        "(TDC_PUMA3_SAMPLE_TIME_S * restoring)",
        "(TDC_PUMA3_SAMPLE_TIME_S * nonlinear_input)",
    ),
    "wrong exponent": (
        "tdc_sig_pow(sliding_variable, gains->gamma)",
        "tdc_sig_pow(sliding_variable, gains->beta)",
    ),
    "power off by a millionth": (
        "gains->lambda * tdc_sig_pow(sliding_variable, gains->gamma)",
        "gains->lambda * 1.000001f * tdc_sig_pow(sliding_variable, gains->gamma)",
    ),
    "position in float": (
        "displacement_counts = tdc_difference(input->counts[i], last->counts);",
        "displacement_counts = (int32_t)((float)input->counts[i] - (float)last->counts);",
    ),
    "s reset in motion": (
        "= last->sliding_integral_rad_per_s;",
        "= -velocity_error;",
    ),
    "s of the first tick taken from memory": (
        "last->sliding_integral_rad_per_s = sliding_integral;",
        "(void)sliding_integral;",
    ),
    "jump seen in one direction": (
        "((uint32_t)limit - (uint32_t)counts) | ((uint32_t)limit + (uint32_t)counts)",
        "((uint32_t)limit - (uint32_t)counts)",
    ),
    "change of speed not looked at": (
        "| beyond(gains->max_displacement_change, tdc_difference(displacement, last_displacement))",
        "| (0u & (uint32_t)last_displacement)",
    ),
    "change of speed before lost ticks": (
        "last->displacement = tdc_difference(input->counts[i], last->counts);",
        "(void)input;",
    ),
    "way since the last good tick not looked at": (
        "jump |= tdc_outside(since_good, reach(gains, state->lost_ticks + 1u));",
        "jump |= 0u & tdc_outside(since_good, reach(gains, 1u));",
    ),
    "way since the last tick not looked at": (
        "jump |= tdc_outside(since_latest, gains->max_displacement);",
        "(void)since_latest;",
    ),
    "reach a tick too short": ("state->lost_ticks + 1u", "state->lost_ticks"),
    "reading of a lost tick forgotten": (
        "*latest_counts(state, i) = input->counts[i];",
        "(void)input;",
    ),
    "lost ticks not counted": ("++state->lost_ticks;", ""),
    "lost ticks of earlier times counted": ("state->lost_ticks = 0u; }", "}"),
    "stopped a tick too late": (
        "state->lost_ticks >= config->max_lost_ticks",
        "state->lost_ticks > config->max_lost_ticks",
    ),
    "resumed from the last good reading": (
        "last->counts = *latest_counts(state, i);",
        "",
    ),
    "wound up": ("if (config->anti_windup != 0u) {", "if (0) {"),
    "never wound up": ("if (config->anti_windup != 0u) {", "if (1) {"),
    "jump of the last joint only": (
        "tdc_in_order(unusual | ",
        "tdc_in_order((unusual & 0u) | ",
    ),
    "jump not looked for": (
        "return jump | tdc_beyond",
        "return (jump & 0u) | tdc_beyond",
    ),
    "limit looked at on one side": (
        "tdc_beyond(gains->torque_limit_Nm, control_torque);",
        "(tdc_bits(gains->torque_limit_Nm) - tdc_bits(control_torque));",
    ),
    "limit of the last joint not looked at": (
        "return jump | tdc_beyond",
        "return (i == (TDC_PUMA3_JOINTS - 1u)) ? jump : jump | tdc_beyond",
    ),
    "last joint not settled": (
        "uint32_t finite = 1u; for (uint32_t i = 0u; i < TDC_PUMA3_JOINTS; ++i) {",
        "uint32_t finite = 1u; for (uint32_t i = 0u; i < (TDC_PUMA3_JOINTS - 1u); ++i) {",
    ),
    "index not flipped": (
        "state->phase = TDC_PHASE_RUNNING + next;",
        "state->phase = TDC_PHASE_RUNNING + last;",
    ),
    "index not flipped when settled": (
        "TDC_PHASE_RUNNING + (last ^ 1u)",
        "TDC_PHASE_RUNNING + last",
    ),
    "index flipped after an error": (
        "++state->lost_ticks;",
        "++state->lost_ticks; state->phase ^= 1u;",
    ),
    "scratch read": ("&memory->tick[last], input", "&memory->tick[next], input"),
    "scratch held after an error": (
        "tick[state->phase & 1u].applied_torque_Nm",
        "tick[(state->phase & 1u) ^ 1u].applied_torque_Nm",
    ),
    "scratch settled is the last memory": (
        "const next = &state->joint[i].tick[last ^ 1u];",
        "const next = &state->joint[i].tick[last];",
    ),
    "saturation bits of an earlier tick": ("{ state->saturated_joints = 0u;", "{"),
    "infinity passed on": ("finite &= tdc_is_finite(control_torque);", ""),
    "wrong torque after an error": (
        "(config->on_error == TDC_HOLD_TORQUE)",
        "(config->on_error != TDC_HOLD_TORQUE)",
    ),
    "failed tick leaves a trace": (
        "++state->lost_ticks;",
        "++state->lost_ticks; state->saturated_joints = 0u;",
    ),
    "failed tick writes over the last memory": (
        "next->counts = input->counts[i];",
        "next->counts = input->counts[i];"
        " ((tdc_puma3_joint_state *)last)->counts = input->counts[i];",
    ),
}


def mutated(old: str, new: str, folder: Path) -> Path:
    """A copy of puma3's C in which one piece of text, spaced in any way, is another."""
    folder.mkdir()
    pattern = r"\s*".join(re.escape(token) for token in re.findall(r"\w+|\S", old))
    for source in (GENERATED / "puma3").iterdir():
        text = source.read_text(encoding="utf-8")
        if source.name == "tdc_puma3.c":
            text, count = re.subn(pattern, lambda _: new, text)
            assert count == 1, f"{old!r} stands {count} times in the C"
        (folder / source.name).write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", MUTANTS)
def test_c_with_a_mistake_is_caught(name: str, tmp_path: Path) -> None:
    library = shared_library(mutated(*MUTANTS[name], tmp_path / "mutant"))
    result = check(PUMA3, 6000, library)
    assert not result.holds
    assert result.violations[0].steps > 0
    assert "torque" in result.violations[0].example


def test_an_unchanged_copy_passes(tmp_path: Path) -> None:
    same = ("= damping + stiffness;", "= damping + stiffness;")
    assert check(PUMA3, 2000, shared_library(mutated(*same, tmp_path / "copy"))).holds


def test_another_controllers_library_is_refused() -> None:
    with pytest.raises(LayoutError):
        check(PUMA3, 10, shared_library(GENERATED / "puma6"))
