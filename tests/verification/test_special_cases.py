"""The special cases have the bits of the inclusive C, and laws that are wrong have not."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from codegen.controller import load
from codegen.law import SX, LawFunction, Quantity
from codegen.presets import LAW_PRESETS
from verification import __main__ as command
from verification.experiments import CONTROLLERS
from verification.special_cases import laws, present
from verification.special_cases.compare import (
    Bench,
    bench,
    compare,
    first_difference,
    first_difference_of_runs,
    lock_step,
)
from verification.special_cases.laws import CASES, Case
from verification.special_cases.proofs import own_law_is_inclusive, proofs_of
from verification.special_cases.source import controller_c

TICKS = 400
BY_NAME = {case.name: case for case in CASES}


@pytest.fixture(scope="module", params=present.NAMES)
def flown(request: pytest.FixtureRequest) -> Bench:
    return bench(request.param, TICKS)


@pytest.fixture(scope="module")
def puma3() -> Bench:
    return bench("puma3", TICKS)


def own(case: Case, law: LawFunction | None = None) -> Case:
    """A case, or a wrong law in its place, without other roundings."""
    return replace(case, law=law or case.law, roundings=())


@pytest.mark.parametrize("case", CASES, ids=list(BY_NAME))
def test_every_case_has_the_bits_of_the_inclusive_law(flown: Bench, case: Case) -> None:
    found = compare(flown, own(case))
    assert found.ticks == TICKS
    assert found.equal, found


@pytest.mark.parametrize("case", CASES, ids=list(BY_NAME))
def test_every_case_is_proved(case: Case) -> None:
    assert all(proof.holds for proof in proofs_of(case))
    assert len(proofs_of(case)) >= 2


def test_the_paper_s_special_cases_are_all_there() -> None:
    listed = {"(9)(10)", "(24)", "(39)", "(40)", "(41)", "(60)-(62)"}
    assert {case.equation for case in CASES} == listed
    assert {case.preset.name for case in CASES} == LAW_PRESETS.keys() & {
        *("hsia", "jin", "sliding-mode", "terminal-sliding", "nonlinear-ded")
    }


# --- What a case doesn't have isn't there ------------------------------------------------------

# Words of the C that must be in a case's law; all others of these must not.
_WORDS: dict[str, set[str]] = {
    "hsia": set(),
    "jin": {"lambda", "sliding_integral"},
    "sliding-mode": {"lambda", "sliding_integral", "gamma", "tdc_sig_pow("},
    "terminal-sliding": {"lambda", "sliding_integral", "gamma", "tdc_sig_pow("},
    "nonlinear-ded": {"alpha", "beta", "tdc_sig_pow("},
    "model-free": set(),
}


@pytest.mark.parametrize("name", _WORDS)
def test_a_case_holds_only_its_own_terms(name: str) -> None:
    case = BY_NAME[name]
    tuned = load(CONTROLLERS / "puma3.toml", experiment=case.preset.name)
    text = controller_c(case.law, tuned)
    law = text[text.index("/* From counts") :]  # the configuration has all gains
    every = set().union(*_WORDS.values())
    assert {word for word in every if word in law} == _WORDS[name]


# --- Wrong laws --------------------------------------------------------------------------------


def changed(law: LawFunction, name: str, change: Callable[[SX], SX]) -> LawFunction:
    """A law in which one quantity is another expression; others keep the old one."""

    def quantity(q: Quantity) -> Quantity:
        return replace(q, expression=change(q.expression)) if q.name == name else q

    return replace(law, quantities=tuple(map(quantity, law.quantities)))


def one_ulp(value: float) -> float:
    bits = struct.unpack("<I", struct.pack("<f", value))[0]
    up: float = struct.unpack("<f", struct.pack("<I", bits + 1))[0]
    return up


E = laws.E
MUTANTS: dict[str, tuple[str, LawFunction]] = {
    "KP one ulp off": (
        "hsia",
        laws.law_function(
            "hsia",
            "wrong",
            laws.torque(
                "(9)",
                laws.grouped(
                    laws.MBAR
                    * laws.grouped(laws.QDD_D, laws.KD * laws.ED, laws.KP * one_ulp(1.0) * E),
                    laws.LAST_TAU,
                    -(laws.MBAR * laws.LAST_QDD),
                ),
            ),
        ),
    ),
    "Hsia's sums in another order": ("hsia", laws.hsia(laws.left_to_right)),
    "Jin's sums in another order": ("jin", laws.jin(laws.left_to_right)),
    "Hsia for Jin": ("jin", laws.hsia()),
    "Jin for Hsia's correction": ("sliding-mode", laws.jin()),
    "sgn exact": ("sliding-mode", laws.sliding_mode(sgn=laws.sign)),
    "sign for power": ("terminal-sliding", laws.sliding_mode(sgn=laws.sign)),
    "no correction": ("terminal-sliding", laws.hsia()),
    "linear": ("nonlinear-ded", laws.hsia()),
    "a step of s that is left out": (
        "jin",
        changed(laws.jin(), "next_sliding_integral", lambda _: laws.INTEGRAL),
    ),
    "MFC as printed": ("model-free", laws.model_free_as_printed()),
    "MFC with half of qdd(t-L)": (
        "model-free",
        laws.law_function(
            "model_free",
            "wrong",
            laws.torque(
                "(61)",
                laws.MBAR * laws.grouped(laws.QDD_D, laws.KD * laws.ED, laws.KP * E)
                - (laws.MBAR * (0.5 * laws.LAST_QDD) - laws.LAST_TAU),
            ),
        ),
    ),
}


@pytest.mark.parametrize("name", MUTANTS)
def test_a_wrong_law_differs(puma3: Bench, name: str) -> None:
    case, law = MUTANTS[name]
    found = compare(puma3, own(BY_NAME[case], law))
    assert found.lock_step is not None
    assert found.own_loop is not None
    assert not found.equal
    said = str(found.lock_step)
    assert f"tick {found.lock_step.tick}, {found.lock_step.joint}" in said
    assert repr(found.lock_step.special) in said


def test_beta_one_ulp_off_differs(puma3: Bench) -> None:
    """One ulp of a float below 1 is 2^-24, 128 steps of the grid that the C holds exponents on."""
    case = BY_NAME["nonlinear-ded"]
    tuned = load(CONTROLLERS / "puma3.toml", experiment=case.preset.name)
    inclusive, off = puma3.inclusive(tuned), puma3.inclusive(tuned)
    off.config.joint[1].beta += 128
    flown = puma3.fly(inclusive, puma3.loop)
    same, other = lock_step(puma3, flown.counts, [inclusive, off])
    found = first_difference("torque", same, other, ["waist", "shoulder", "elbow"])
    assert found is not None
    assert found.joint == "shoulder"
    assert np.array_equal(same[:, [0, 2]], other[:, [0, 2]])
    own_loop = puma3.fly(off, puma3.loop)
    assert first_difference_of_runs(flown, own_loop, ["waist", "shoulder", "elbow"]) is not None


WRONG = {
    name: mutant
    for name, mutant in MUTANTS.items()
    if name in {"KP one ulp off", "Hsia for Jin", "linear", "MFC with half of qdd(t-L)"}
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_law_is_not_proved(name: str) -> None:
    case, law = WRONG[name]
    proof = own_law_is_inclusive(BY_NAME[case], law)
    assert not proof.holds
    assert proof.residual != "0"


@pytest.mark.parametrize("case", CASES, ids=list(BY_NAME))
def test_another_order_of_sums_is_proved_all_the_same(case: Case) -> None:
    printed = next(r for r in case.roundings if r.name == laws.PRINTED)
    assert own_law_is_inclusive(case, printed.law).holds


# --- Bits and signs ----------------------------------------------------------------------------


def test_zeros_of_two_signs_are_different_and_equal_nans_are_not() -> None:
    zero, nan = np.array([[0.0, 1.0]]), np.array([math.nan])
    found = first_difference("torque", zero, -zero * [1, -1], ["a", "b"])
    assert found is not None
    assert (found.tick, found.joint, repr(found.special)) == (0, "a", "-0.0")
    assert first_difference("q", nan, nan.copy(), []) is None


@pytest.mark.parametrize(
    ("x", "expected"),
    [(0.0, 0.0), (5e-324, 1.0), (-5e-324, -1.0), (-3.0, -1.0), (1e308, 1.0), (math.inf, 1.0)],
)
def test_the_exact_sign_is_exact(x: float, expected: float) -> None:
    argument = ca.SX.sym("x")
    largest = np.finfo(np.float64).max
    made = ca.Function("sign", [argument, laws.LARGEST.symbol], [laws.sign(argument)])
    assert float(made(x, largest)) == expected


# --- The command -------------------------------------------------------------------------------


def run(arguments: Sequence[str]) -> int:
    return command.main(["special-cases", *arguments])


def test_the_command_tells_and_leaves_the_figures(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    assert run(["--controller", "puma3", "--ticks", "100", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((tmp_path / "special_cases.json").read_text())
    assert told["holds"]
    cases = {case["case"]: case for case in told["cases"]}
    assert cases.keys() == BY_NAME.keys()
    for case in cases.values():
        (comparison,) = case["comparisons"]
        assert comparison["evidence"] == "measured"
        assert comparison["ticks"] == 100
        assert comparison["equal"]
        assert case["proved"]
    (rounding,) = cases["hsia"]["comparisons"][0]["roundings"]
    assert rounding["torques"] == 300
    assert 0 < rounding["different"] < 300
    assert 0 < rounding["largest_Nm"] < 1e-4
    assert rounding["first"]["signal"] == "torque"


def test_a_difference_is_the_command_s_failure(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    wrong = own(BY_NAME["hsia"], laws.hsia(laws.left_to_right))
    examine = present.examine

    def with_a_wrong_law(
        controllers: Sequence[str], ticks: int, advance: Callable[[int], None]
    ) -> present.SpecialCases:
        return examine(controllers, ticks, [wrong], advance)

    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    monkeypatch.setattr(present, "examine", with_a_wrong_law)
    assert run(["--controller", "puma3", "--ticks", "100"]) == 1
    said = capsys.readouterr().out
    assert "DIFFERENT" in said
    assert "hsia, puma3, lock-step: torque at tick" in said


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--controller", "puma3_fixed"], "floating-point"),
        (["--controller", "nobody"], "nobody.toml"),
    ],
)
def test_a_controller_that_it_can_t_do_is_bad_input(
    capsys: pytest.CaptureFixture[str], arguments: list[str], says: str
) -> None:
    assert run([*arguments, "--ticks", "5"]) == 2
    assert says in capsys.readouterr().err
