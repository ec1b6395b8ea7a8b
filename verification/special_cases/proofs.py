"""The identities in algebra: a special case, as it is printed to C, is the inclusive law."""

from __future__ import annotations

from codegen.law import LawFunction
from verification.special_cases.laws import INVERSE_SIGMA, SIGMA, Case
from verification.symbolic import (
    LAW_SYMBOLS,
    M,
    Proof,
    Step,
    code_low_pass,
    conclude,
    inclusive_torque,
    law_in_sympy,
    low_pass_is_a_smaller_inertia,
    model_free_closed_loop,
    model_free_is_hsia,
    show,
    special_cases,
    with_fixed_gains,
)

_SYMBOLS = {**LAW_SYMBOLS, INVERSE_SIGMA.name: M, SIGMA.name: 1 / M}


def own_law_is_inclusive(case: Case, law: LawFunction | None = None) -> Proof:
    """The case's own law is (31) with the preset's gains.

    The expression graphs that both C are printed from meet here.

    Args:
        case: the special case.
        law: in place of its law; a wrong one must not pass.
    """
    inclusive = inclusive_torque(case.preset)
    own = with_fixed_gains(law_in_sympy(law or case.law, _SYMBOLS)["torque"], case.preset)
    steps = (
        Step(case.equation, "The law by itself", f"τ = {show(own)}"),
        Step("(31)", f"The inclusive law, preset {case.preset.name}", f"τ = {show(inclusive)}"),
    )
    return conclude(
        f"own_{case.name}",
        case.equation,
        f"The law {case.name}, written by itself, is the inclusive law with its gains.",
        steps,
        own - inclusive,
    )


def proofs_of(case: Case) -> tuple[Proof, ...]:
    """All proofs of a case: the paper's identity, and that of the two expression graphs."""
    of_the_paper = (
        (model_free_is_hsia(), model_free_closed_loop())
        if case.name == "model-free"
        else tuple(p for p in special_cases() if p.name == f"special_case_{case.name}")
    )
    return (*of_the_paper, own_law_is_inclusive(case))


def proofs_of_the_low_pass() -> tuple[Proof, ...]:
    """(42)-(44), in the paper's form and in the generator's; no bits are claimed of it."""
    return (low_pass_is_a_smaller_inertia(), code_low_pass())
