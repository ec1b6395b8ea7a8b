"""The proofs hold, and a law that is wrong in any term is not proved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
import sympy as sp

from codegen import law as coded
from codegen.law import LawFunction, LawOptions, Quantity, measurement, torque_law
from codegen.presets import LAW_PRESETS
from verification import symbolic as sy
from verification.symbolic import Proof, all_proofs

PROOFS = all_proofs()


@pytest.mark.parametrize("proof", PROOFS, ids=[p.name for p in PROOFS])
def test_it_holds_with_readable_steps(proof: Proof) -> None:
    assert proof.holds, proof.residual
    assert proof.residual == "0"
    assert proof.equation
    assert len(proof.steps) >= 2
    for step in proof.steps:
        assert "**" not in step.formula
        assert "Derivative" not in step.formula


def test_names_are_unique() -> None:
    assert len({p.name for p in PROOFS}) == len(PROOFS)


def delayed_estimate(time: Any) -> Any:
    return sy.tau(time - sy.L) - sy.M * sy.qdd(time - sy.L)


def mutant(**changes: Any) -> Callable[[Any], Any]:
    """The inclusive law with one of its terms replaced."""

    def torque(time: Any) -> Any:
        terms = {
            "damping": sy.KD * sy.sig(sy.e(time).diff(time), sy.ALPHA),
            "stiffness": sy.KP * sy.sig(sy.e(time), sy.BETA),
            "correction": sy.LAMBDA * sy.sig(sy.s(time), sy.GAMMA),
            "reference": sy.qdd_d(time),
            "estimate": delayed_estimate(time),
        }
        terms |= {name: change(time) for name, change in changes.items()}
        estimate = terms.pop("estimate")
        return sy.M * sum(terms.values()) + estimate

    return torque


def test_the_unchanged_law_passes_the_same_way() -> None:
    assert sy.closed_loop(mutant()).holds


@pytest.mark.parametrize(
    "changes",
    [
        {"correction": lambda _: 0},
        {"correction": lambda t: -sy.LAMBDA * sy.sig(sy.s(t), sy.GAMMA)},
        {"correction": lambda t: sy.LAMBDA * sy.sig(sy.s(t), sy.ALPHA)},
        {"damping": lambda t: sy.KD * sy.e(t).diff(t)},
        {"stiffness": lambda t: 2 * sy.KP * sy.sig(sy.e(t), sy.BETA)},
        {"reference": lambda t: sy.qdd_d(t - sy.L)},
        {"estimate": lambda t: sy.tau(t - sy.L)},
        {"estimate": lambda t: sy.tau(t - sy.L) + sy.M * sy.qdd(t - sy.L)},
        {"estimate": lambda t: sy.tau(t - sy.L) - sy.M * sy.qdd(t - 2 * sy.L)},
    ],
    ids=[
        "no correction",
        "its sign",
        "its exponent",
        "linear damping",
        "stiffness doubled",
        "late reference",
        "no acceleration",
        "its sign in the estimate",
        "two samples old",
    ],
)
def test_a_wrong_law_is_not_proved(changes: dict[str, Callable[[Any], Any]]) -> None:
    proof = sy.closed_loop(mutant(**changes))
    assert not proof.holds
    assert proof.residual != "0"


@pytest.mark.parametrize(
    "filter_",
    [
        lambda torque, last, ratio: (ratio * torque - last) / (1 + ratio),
        lambda torque, last, ratio: ratio * torque + (1 - ratio) * last,
        lambda torque, last, ratio: (torque + ratio * last) / (1 + ratio),
    ],
)
def test_a_wrong_low_pass_is_not_proved(filter_: Callable[[Any, Any, Any], Any]) -> None:
    assert not sy.low_pass_is_a_smaller_inertia(filter_).holds


def changed(function: LawFunction, name: str, expression: Any) -> LawFunction:
    """A law function in which one quantity is another expression."""

    def quantity(q: Quantity) -> Quantity:
        return replace(q, expression=expression) if q.name == name else q

    return replace(function, quantities=tuple(quantity(q) for q in function.quantities))


G = {name: i.symbol for name, i in coded.GAINS.items()}
X = {name: i.symbol for name, i in coded.SIGNALS.items()}
RESTORING = coded.damping_term(G["kd"], X["velocity_error"], G["alpha"]) + coded.stiffness_term(
    G["kp"], X["position_error"], G["beta"]
)


@pytest.mark.parametrize(
    ("name", "expression"),
    [
        ("damping", G["kd"] * coded.sig(X["velocity_error"], G["beta"])),
        ("stiffness", G["kp"] * X["position_error"]),
        ("sliding_variable", X["velocity_error"] - X["sliding_integral"]),
        ("correction", -coded.tde_correction(G["lambda"], X["sliding_integral"], G["gamma"])),
        ("time_delay_estimate", X["last_torque"] + G["inertia"] * X["last_acceleration"]),
        ("filtered_torque", X["last_torque"]),
        ("next_sliding_integral", X["sliding_integral"] + RESTORING),
    ],
)
def test_code_that_is_not_the_paper_is_noticed(name: str, expression: Any) -> None:
    law = changed(torque_law(LawOptions(low_pass=True)), name, expression)
    assert not sy.code_is_the_paper(law).holds


def test_a_quantity_that_is_missing_is_noticed() -> None:
    law = torque_law(LawOptions(low_pass=True))
    without = replace(law, quantities=tuple(q for q in law.quantities if q.name != "correction"))
    proof = sy.code_is_the_paper(without)
    assert not proof.holds
    assert "correction" in proof.residual


@pytest.mark.parametrize(
    ("name", "expression"),
    [
        # The rectangle of another sample, none at all, and a trapezoid's half.
        ("next_sliding_integral", X["sliding_integral"]),
        (
            "next_sliding_integral",
            X["sliding_integral"] + 0.5 * coded.SAMPLE_TIME.symbol * RESTORING,
        ),
        ("sliding_variable", X["sliding_integral"]),
        ("control_torque", X["last_torque"]),
    ],
)
def test_a_wrong_sampled_law_is_not_proved(name: str, expression: Any) -> None:
    options = LawOptions()
    assert not sy.sampled_closed_loop(options, changed(torque_law(options), name, expression)).holds


def test_a_velocity_error_with_a_wrong_factor_makes_rho_depend_on_the_robot() -> None:
    options = LawOptions()
    velocity = X["reference_velocity"] - 2 * X["displacement"] * coded.SCALES["velocity"].symbol
    wrong = changed(measurement(options), "velocity_error", velocity)
    proof = sy.sampled_closed_loop(options, measure=wrong)
    assert not proof.holds
    assert "n[k]" in proof.residual


def test_a_special_case_with_another_formula_is_not_proved() -> None:
    assert not sy.special_case(LAW_PRESETS["hsia"], sy.KP).holds


@pytest.mark.parametrize("prove", [sy.model_free_is_hsia, sy.model_free_closed_loop])
@pytest.mark.parametrize(
    "wrong",
    [
        lambda time, sigma, k_i: -sy.model_free_law(time, sigma, k_i),
        lambda time, sigma, k_i: sigma**2 * sy.model_free_law(time, sigma, k_i),
        lambda time, sigma, k_i: sy.model_free_law(time, sigma, k_i) - sy.qdd_d(time) / sigma,
        lambda time, sigma, k_i: sy.model_free_law(time, sigma, k_i) + sy.tau(time - sy.L),
    ],
    ids=["its sign", "sigma upside down", "no reference", "tau(t-L) twice"],
)
def test_a_wrong_model_free_law_is_not_proved(prove: Any, wrong: Any) -> None:
    assert not prove(wrong).holds


A, B = sp.symbols("|e| |ė|", positive=True)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda e, ed: ed**2 / 2 - sy.KP * e ** (sy.BETA + 1) / (sy.BETA + 1),
        lambda e, ed: ed**2 / 2 + sy.KP * e ** (sy.BETA + 1),
        lambda e, ed: ed**2 / 2 + sy.KP * e ** (sy.ALPHA + 1) / (sy.ALPHA + 1),
        lambda e, ed: ed**2 + sy.KP * e ** (sy.BETA + 1) / (sy.BETA + 1),
        lambda _, ed: ed**2 / 2,
    ],
    ids=["sign of the spring", "its factor", "its exponent", "no half", "no spring"],
)
def test_another_energy_does_not_fall_as_21(wrong: Any) -> None:
    assert sy.energy_falls(sy.energy).holds
    assert not sy.energy_falls(wrong).holds


@pytest.mark.parametrize(
    "scale",
    [
        lambda alpha: sy.KP * (2 - alpha),
        lambda alpha: (sy.KP * (1 + alpha)) ** sp.Rational(1, 2),
        lambda _: sp.Integer(1),
    ],
)
def test_other_coordinates_are_not_the_normal_form(scale: Any) -> None:
    assert not sy.finite_time_normal_form(scale).holds


@pytest.mark.parametrize(
    "wrong",
    [sy.inclusive_law, lambda t: sy.nonlinear_law(t) - 2 * sy.M * sy.KP * sy.sig(sy.e(t), sy.BETA)],
    ids=["with correction", "sign of the spring"],
)
def test_another_law_than_24_does_not_give_27(wrong: Any) -> None:
    assert not sy.uncorrected_loop(wrong).holds


@pytest.mark.parametrize("wrong", [lambda s: s**2, lambda s: -(s**2) / 2, lambda s: s])
def test_another_energy_of_s_does_not_change_as_57(wrong: Any) -> None:
    assert not sy.sliding_energy_rate(wrong).holds


@pytest.mark.parametrize(
    "wrong",
    [
        lambda xi, gamma: (xi / sy.LAMBDA) ** gamma,
        lambda xi, gamma: (xi * sy.LAMBDA) ** (1 / gamma),
        lambda xi, _: xi / sy.LAMBDA,
        lambda xi, gamma: (xi / sy.LAMBDA) ** (1 / (gamma + 1)),
    ],
)
def test_another_bound_than_38_is_not_proved(wrong: Any) -> None:
    assert not sy.sliding_bound(wrong).holds


def test_the_energy_falls_in_numbers_too() -> None:
    """The rate of (20) along (17) by differences, beside (21), with SymPy's symbols replaced."""
    kd, kp, alpha, beta, h = 20.0, 100.0, 0.95, 0.7, 1e-6
    values = {sy.KD: kd, sy.KP: kp, sy.ALPHA: alpha, sy.BETA: beta}
    function = sp.lambdify((A, B), sy.energy(A, B).subs(values), "math")

    def sign_power(x: float, a: float) -> float:
        return float(abs(x) ** a * (1 if x > 0 else -1))

    for e, ed in ((0.3, 0.5), (-0.3, 0.5), (0.3, -0.5), (-0.3, -0.5)):
        edd = -kd * sign_power(ed, alpha) - kp * sign_power(e, beta)
        ahead = function(abs(e + h * ed), abs(ed + h * edd))
        behind = function(abs(e - h * ed), abs(ed - h * edd))
        assert (ahead - behind) / (2 * h) == pytest.approx(-kd * abs(ed) ** (alpha + 1), rel=1e-6)
