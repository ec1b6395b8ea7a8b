"""Every numbered equation of the paper: where it is in the code, and what is known of it.

Jin, Kang, Chang, Lee 2017 has 62. What the code says itself is not said here again: quantities of
the law, laws and presets of the special cases, and proofs carry the numbers of their equations, and
:func:`links` finds them. Only the rest is declared: the equation in words, functions that carry no
number, tests, and how strong the evidence is - or why there is none.

``python -m verification equations`` makes docs/equations.md of it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from codegen import law
from codegen.presets import SPECIAL_CASES
from plant.friction import LuGre
from plant.model import dynamics
from plant.propose import starting_inertia
from verification import symbolic
from verification.certificates.error_dynamics import check as lyapunov_check
from verification.certificates.error_dynamics import prove as lyapunov_prove
from verification.certificates.sig_pow import check as power_check
from verification.certificates.sig_pow import prove as power_prove
from verification.error_bound import error_bound
from verification.error_dynamics.analysis import analyse
from verification.error_dynamics.classes import classify
from verification.error_dynamics.model import Parameters, finite_time_beta
from verification.evidence import Evidence
from verification.figures.flow import ErrorDynamics
from verification.sampled_stability.intervals import stable_intervals
from verification.sampled_stability.loop import low_pass_ratio
from verification.special_cases import laws
from verification.special_cases.laws import CASES
from verification.special_cases.proofs import own_law_is_inclusive
from verification.symbolic import Proof

Symbol = Callable[..., Any]
"""A function or a class of the project; named by its module and its qualified name."""

COUNT = 62
"""How many equations the paper numbers."""


@dataclass(frozen=True)
class Equation:
    """One numbered equation.

    Attributes:
        number: the paper's.
        says: its content, in this project's words and notation.
        evidence: the kind of evidence; None where there is none.
        finding: what exactly the evidence is of, or why there is none.
        code: where it is, beyond what :func:`links` finds.
        tests: ``file::function`` from the root of the repository.
        commands: names of ``python -m verification``.
        certified: makers and checkers of certificates that prove it.
    """

    number: int
    says: str
    evidence: Evidence | None
    finding: str
    code: tuple[Symbol, ...] = ()
    tests: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    certified: tuple[Symbol, ...] = ()


@dataclass(frozen=True)
class Section:
    """A part of the paper with its equations, in their order."""

    name: str
    equations: tuple[Equation, ...]


@dataclass(frozen=True)
class Links:
    """What names an equation in the code itself.

    Attributes:
        quantities: name of a quantity and the function that makes it.
        presets: of ``codegen.presets``.
        proofs: whose statement is the equation.
        steps: proofs that use it on their way.
    """

    quantities: tuple[tuple[str, Symbol], ...]
    presets: tuple[str, ...]
    proofs: tuple[Proof, ...]
    steps: tuple[Proof, ...]


def numbers(text: str) -> frozenset[int]:
    """The equations that a text such as "(31)", "(9)(10)" or "(4)-(6)" names."""
    found: set[int] = set()
    for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", text):
        found.update(range(int(first), int(last or first) + 1))
    return frozenset(found)


def all_proofs() -> tuple[Proof, ...]:
    """Every proof in computer algebra, of the paper's identities and of the special cases."""
    return (*symbolic.all_proofs(), *map(own_law_is_inclusive, CASES))


def proved_by(proof: Proof) -> frozenset[int]:
    """The equations that a proof's statement is about."""
    if proof.name == symbolic.code_is_the_paper.__name__:
        # It compares quantity by quantity: each step is a statement of its own.
        return numbers("".join(step.equation for step in proof.steps))
    return numbers(proof.equation)


def _quantities() -> Iterator[tuple[law.Quantity, Symbol]]:
    options = law.LawOptions(low_pass=True)
    for function, maker in (
        (law.measurement(options), law.measurement),
        (law.switch_on(), law.switch_on),
        (law.torque_law(options), law.torque_law),
    ):
        yield from ((quantity, maker) for quantity in function.quantities)
    for case in CASES:
        yield from ((quantity, getattr(laws, case.law.name)) for quantity in case.law.quantities)


def links(number: int, proofs: Iterable[Proof]) -> Links:
    """What names an equation in the code itself, so that it is not declared here."""
    given = tuple(proofs)
    of = tuple(p for p in given if number in proved_by(p))
    presets = (p.name for p in SPECIAL_CASES if number in numbers(p.equation))
    return Links(
        tuple((q.name, maker) for q, maker in _quantities() if number in numbers(q.equation)),
        tuple(presets),
        of,
        tuple(
            p for p in given if p not in of and any(number in numbers(s.equation) for s in p.steps)
        ),
    )


# --- The equations -----------------------------------------------------------------------------

_SYMBOLIC = "tests/verification/test_symbolic.py::"
_DYNAMICS = "tests/verification/test_error_dynamics.py::"
_LYAPUNOV = "tests/verification/test_error_dynamics_certificate.py::"
_BOUND = "tests/verification/test_error_bound.py::"
_CASES = "tests/verification/test_special_cases.py::"
_FIGURES = "tests/verification/test_figures.py::"
_INTERVAL = "tests/verification/test_sampled_stability.py::"
_POWER = "tests/verification/test_sig_pow_proof.py::"

_STEP = "tests/codegen/test_step.py::test_four_ticks_follow_the_paper"
_ENCLOSED = (
    "tests/verification/test_equivalence.py::test_the_shipped_controllers_lie_in_the_enclosure"
)
_CODE_IS_THE_PAPER = _SYMBOLIC + "test_code_that_is_not_the_paper_is_noticed"
_BITS = _CASES + "test_every_case_has_the_bits_of_the_inclusive_law"
_EXPONENTS = "tests/verification/test_equations.py::test_the_exponents_of_appendix_a_are_one_pair"
_LYAPUNOV_TESTS = (
    _LYAPUNOV + "test_the_papers_gains_are_verified",
    _LYAPUNOV + "test_random_gains_are_verified",
)
_LYAPUNOV_CERTIFIED = (lyapunov_prove.certificate, lyapunov_check.complaints)

_IN_THE_CODE = "the expression that the C is printed from is this equation, in real numbers"
_PREMISE = "a premise: the proofs start from it"
_DEFINITION = "a definition"
_SPECIAL = (
    "the law is (31) with the preset's gains, in real numbers; that both C have the same bits is "
    "sampled"
)
_NO_BOUND = "no proof of its own: a step of that of (38), for one joint"
_LEMMA = "not used: a published lemma, and the certificates of (34)(35) go without it"


def _equation(
    number: int,
    says: str,
    evidence: Evidence | None,
    finding: str,
    *code: Symbol,
    tests: tuple[str, ...] = (),
    commands: tuple[str, ...] = (),
    certified: tuple[Symbol, ...] = (),
) -> Equation:
    return Equation(number, says, evidence, finding, code, tests, commands, certified)


_ROBOT = (
    _equation(
        1,
        "The robot: M(q) qdd + C(q, qd) qd + G(q) + F(q, qd) + tau_d = tau.",
        Evidence.SAMPLED,
        "M, C and G add up to the torque at random states and agree with published ones at single "
        "postures; F and tau_d are models of the plant",
        dynamics,
        LuGre,
        tests=(
            "tests/plant/test_model.py::test_terms_add_up_to_the_torque",
            "tests/plant/test_model.py::test_dynamics_are_the_published_ones",
            "tests/plant/test_friction.py::test_joint_friction_is_the_published_one",
        ),
    ),
    _equation(
        2,
        "The same with a constant diagonal inertia: Mbar qdd + N = tau.",
        None,
        _PREMISE,
        symbolic.robot_torque,
    ),
    _equation(
        3,
        "N is all the rest: (M - Mbar) qdd + C qd + G + F + tau_d.",
        None,
        f"{_DEFINITION}, so that (1) and (2) are one; the law never computes N so",
    ),
    _equation(
        4,
        "N hardly changes in a sample: N(t) is estimated by N(t-L).",
        None,
        "an approximation; what it misses is eps of (12), which nothing here assumes to be small",
        symbolic.estimate,
    ),
    _equation(
        5,
        "N(t-L) from what is known: tau(t-L) - Mbar qdd(t-L).",
        None,
        "no proof of its own: it is (2) one delay ago, and a step of the proof of (32)",
        symbolic.estimate,
    ),
    _equation(
        6,
        "Time delay estimation: N(t) ~ tau(t-L) - Mbar qdd(t-L).",
        Evidence.PROVED,
        _IN_THE_CODE,
        symbolic.estimate,
        law.time_delay_estimate,
        tests=(_CODE_IS_THE_PAPER, _STEP),
    ),
)

_HSIA = (
    _equation(
        7,
        "Linear desired error dynamics: edd + KD ed + KP e = 0.",
        Evidence.PROVED,
        "as a wish it needs no proof; that its error falls exponentially is proved for KD = 20, "
        "KP = 100 and other gains, one certificate for each",
        classify,
        tests=(
            _LYAPUNOV + "test_the_linear_dynamics_is_verified",
            _DYNAMICS + "test_the_linear_dynamics",
        ),
        commands=("error-dynamics",),
        certified=_LYAPUNOV_CERTIFIED,
    ),
    _equation(
        8,
        "The error: e = q_d - q.",
        None,
        f"{_DEFINITION}; `position_error`, which the code lists under (7), is this e in SI units",
        law.measurement,
        tests=(_STEP,),
    ),
    _equation(
        9,
        "Hsia's law: tau = Mbar u_h + tau(t-L) - Mbar qdd(t-L).",
        Evidence.PROVED,
        _SPECIAL,
        symbolic.hsia_law,
        tests=(_CASES + "test_every_case_is_proved", _BITS),
        commands=("special-cases",),
    ),
    _equation(
        10,
        "In it, u_h = qdd_d + KD ed + KP e.",
        Evidence.PROVED,
        _SPECIAL,
        symbolic.hsia_law,
        tests=(_CASES + "test_every_case_is_proved", _BITS),
        commands=("special-cases",),
    ),
    _equation(
        11,
        "What Hsia's law leaves: u_h - qdd = Mbar^-1 (N(t) - its estimate).",
        None,
        "no proof of its own; the proofs of (32) and (62) take eps from here",
        symbolic.tde_error,
    ),
    _equation(
        12,
        "The error of the estimate: eps = Mbar^-1 (N(t) - N(t-L)).",
        None,
        f"{_DEFINITION}, after (5) is put into (11)",
        symbolic.tde_error,
    ),
    _equation(
        13,
        "Hence u_h = qdd + eps.",
        None,
        "no proof of its own: (12) written the other way",
    ),
    _equation(
        14,
        "With (10), u_h - qdd = edd + KD ed + KP e.",
        None,
        "no proof of its own: (10) and (8)",
    ),
    _equation(
        15,
        "Closed loop of Hsia's law: edd + KD ed + KP e = Mbar^-1 (N(t) - N(t-L)).",
        None,
        "no proof of its own: (62) for sigma = 1/Mbar is this, with an integral term more",
    ),
    _equation(
        16,
        "In short: edd + KD ed + KP e = eps.",
        None,
        "no proof of its own: (62) for sigma = 1/Mbar is this, with an integral term more",
    ),
)

_NONLINEAR = (
    _equation(
        17,
        "Nonlinear desired error dynamics: edd + KD sig(ed)^alpha + KP sig(e)^beta = 0.",
        Evidence.PROVED,
        f"its terms: {_IN_THE_CODE}; that it is stable rests on (20)(21)",
        law.damping_term,
        law.stiffness_term,
        law.restoring_acceleration,
        symbolic.ded,
        Parameters,
        tests=(_CODE_IS_THE_PAPER, _STEP, _ENCLOSED),
        commands=("error-dynamics", "equivalence"),
    ),
    *(
        _equation(
            number,
            f"Joint by joint, sig({x})^{a} = |{x}|^{a} sgn({x}).",
            Evidence.PROVED,
            f"{_DEFINITION}; proved is how far the C's power in binary32, standard and precise, is "
            "from it at most; the powers in binary64 and fixed-point have no certificate",
            law.sig,
            tests=(
                _POWER + "test_every_generated_kernel_is_proved",
                _POWER + "test_the_precise_kernel_is_proved",
            ),
            commands=("sig-pow",),
            certified=(power_prove.prove, power_check.complaints),
        )
        for number, x, a in ((18, "ed", "alpha"), (19, "e", "beta"))
    ),
    _equation(
        20,
        "Energy: V = sum of ed^2/2 + KP |e|^(beta+1)/(beta+1).",
        Evidence.SAMPLED,
        f"{_DEFINITION}; the code's V is compared at one state, for the exponents of Fig. 1 and 2",
        ErrorDynamics.energy,
        analyse,
        tests=(_FIGURES + "test_energy_falls_by_what_the_damper_takes",),
    ),
    _equation(
        21,
        "It falls by what the damper takes: Vdot = - sum of KD |ed|^(alpha+1).",
        Evidence.PROVED,
        "for all gains and exponents, in each quadrant, on the axes and at the origin; beside that "
        "sampled along single motions",
        ErrorDynamics.power,
        classify,
        tests=(
            _SYMBOLIC + "test_another_energy_does_not_fall_as_21",
            _FIGURES + "test_energy_falls_by_what_the_damper_takes",
        ),
        commands=("error-dynamics", "energy"),
    ),
)

_INCLUSIVE = (
    _equation(
        22,
        "Time delay control with any u_n: tau = Mbar u_n + the estimate of N.",
        None,
        "no proof of its own: (24) is this with (6) put in",
    ),
    _equation(
        23,
        "u_n = qdd_d + KD sig(ed)^alpha + KP sig(e)^beta.",
        Evidence.PROVED,
        _IN_THE_CODE,
        law.nonlinear_input,
        tests=(_CODE_IS_THE_PAPER, _STEP),
    ),
    _equation(
        24,
        "Both together: tau = Mbar u_n + tau(t-L) - Mbar qdd(t-L), without correction.",
        Evidence.PROVED,
        _SPECIAL,
        tests=(_CASES + "test_every_case_is_proved", _BITS),
        commands=("special-cases",),
    ),
    _equation(
        25,
        "Its closed loop: edd + KD sig(ed)^alpha + KP sig(e)^beta = eps.",
        None,
        "no proof of its own: a step of that of (27), whose left side is this one",
    ),
    _equation(
        26,
        "Sliding variable: s = integral of edd + KD sig(ed)^alpha + KP sig(e)^beta, s(0) = 0.",
        Evidence.PROVED,
        f"{_IN_THE_CODE}, with the rectangle rule for the integral; s(0) = 0 is tested on the C",
        law.sliding_variable,
        law.initial_sliding_integral,
        law.next_sliding_integral,
        symbolic.sliding_variable,
        tests=(_CODE_IS_THE_PAPER, _STEP),
    ),
    _equation(
        27,
        "Without correction s drifts with the estimate's error: sdot = eps.",
        Evidence.PROVED,
        "in continuous time, from (24) and (26)",
        symbolic.uncorrected_loop,
        tests=(_SYMBOLIC + "test_another_law_than_24_does_not_give_27",),
    ),
    _equation(
        28,
        "Ideal acceleration, as if eps were 0: qdd_ideal = qdd_d + KD sig(ed)^alpha "
        "+ KP sig(e)^beta.",
        None,
        f"{_DEFINITION}, from which the proof of (30) starts",
    ),
    _equation(
        29,
        "Ideal velocity: the integral of (28).",
        None,
        f"{_DEFINITION}, from which the proof of (30) starts; both velocities begin equal there",
    ),
    _equation(
        30,
        "s is the velocity that is missing: s = qd_ideal - qd.",
        Evidence.PROVED,
        "for equal velocities at the beginning",
        symbolic.ideal_velocity,
        tests=(_SYMBOLIC + "test_it_holds_with_readable_steps",),
    ),
    _equation(
        31,
        "The inclusive law: tau = Mbar (u_n + lambda sig(s)^gamma) + tau(t-L) - Mbar qdd(t-L).",
        Evidence.PROVED,
        f"{_IN_THE_CODE}; that the C rounds no more than it may is sampled, and how it tracks is "
        "measured on simulated plants",
        law.tde_correction,
        law.control_torque,
        symbolic.inclusive_law,
        tests=(_CODE_IS_THE_PAPER, _STEP, _ENCLOSED),
        commands=("symbolic", "equivalence", "chain", "table2"),
    ),
    _equation(
        32,
        "Its closed loop: sdot + lambda sig(s)^gamma = eps.",
        Evidence.PROVED,
        "in continuous time, and sample by sample for the generator's law, with a term more that "
        "depends on the reference alone, while no joint saturates",
        symbolic.closed_loop,
        symbolic.sampled_closed_loop,
        tests=(
            _SYMBOLIC + "test_a_wrong_law_is_not_proved",
            _SYMBOLIC + "test_a_wrong_sampled_law_is_not_proved",
        ),
        commands=("symbolic",),
    ),
    _equation(
        33,
        "Condition for a bounded eps: the norm of I - M^-1 Mbar is below 1.",
        Evidence.SAMPLED,
        "that the Mbar which is proposed for a robot keeps the spectral radius below 1, at "
        "postures along its motion; that the condition suffices is not checked. It knows no "
        "samples: the interval of Mbar/M in which one linear sampled joint is stable is proved "
        "instead, for each loop that is asked for; with the paper's gains it is narrower",
        starting_inertia,
        stable_intervals,
        tests=(
            "tests/plant/test_propose.py::"
            "test_mbar_keeps_the_stability_condition_all_along_the_trajectory",
            _INTERVAL + "test_known_intervals",
            _INTERVAL + "test_every_certificate_is_verified",
        ),
        commands=("sampled-interval",),
    ),
)

_ANALYSIS = (
    *(
        _equation(
            number,
            says,
            Evidence.PROVED,
            "that this pair is enough for finite time, with a bound of the time: for the paper's "
            "gains and others, one certificate for each. For all gains it is argued by hand, in "
            "the module of `classify`; the pair is sufficient, not necessary",
            classify,
            finite_time_beta,
            tests=(
                *_LYAPUNOV_TESTS,
                _DYNAMICS + "test_classes_at_the_edges",
                "tests/codegen/test_specification.py::test_finite_time_beta_is_exact",
            ),
            commands=("error-dynamics",),
            certified=_LYAPUNOV_CERTIFIED,
        )
        for number, says in (
            (34, "Finite time, first half: 0 < alpha < 1."),
            (35, "Finite time, second half: beta = alpha/(2 - alpha)."),
        )
    ),
    _equation(
        36,
        "gamma = 0: sdot + lambda sgn(s) = eps.",
        None,
        "no proof of its own: (32) with gamma = 0; the proof of (32) has gamma > 0",
    ),
    _equation(
        37,
        "Then s slides where the smallest lambda exceeds xi, the bound of eps.",
        None,
        _NO_BOUND,
    ),
    _equation(
        38,
        "gamma > 0: |s_i| < (xi/lambda_min)^(1/gamma_i) in the end.",
        Evidence.PROVED,
        "for one joint: outside the bound Vs falls, for every eps within xi; in continuous time. "
        "What it means for e the paper does not say: a bound of |e| is proved for given gains, one "
        "certificate for each, and the number (xi/lambda)^(1/gamma) is enclosed in it",
        symbolic.sliding_bound,
        error_bound,
        tests=(
            _SYMBOLIC + "test_another_bound_than_38_is_not_proved",
            _BOUND + "test_the_bound_of_s_is_enclosed",
            _BOUND + "test_the_papers_gains",
            _BOUND + "test_damaged_certificates_are_refused",
        ),
        commands=("error-bound", "energy"),
    ),
    *(
        _equation(
            number,
            says,
            Evidence.PROVED,
            _SPECIAL + more,
            tests=(_CASES + "test_every_case_is_proved", _BITS),
            commands=("special-cases",),
        )
        for number, says, more in (
            (39, "Jin's enhanced law: alpha = beta = gamma = 1, so that lambda s is added.", ""),
            (
                40,
                "Integral sliding mode: alpha = beta = 1, gamma = 0, so that lambda sgn(s) is "
                "added.",
                ", with the sign as the C's power gives it",
            ),
            (
                41,
                "Terminal sliding mode: alpha = beta = 1, lambda sig(s)^gamma, 0 < gamma < 1.",
                "",
            ),
        )
    ),
)

_LOW_PASS = (
    _equation(
        42,
        "The torque before the filter: tau* = Mbar u + tau(t-L) - Mbar qdd(t-L).",
        None,
        _PREMISE,
    ),
    _equation(
        43,
        "First-order low-pass, w' = w L: tau = (w' tau* + tau(t-L)) / (1 + w').",
        Evidence.PROVED,
        _IN_THE_CODE,
        law.low_pass,
        low_pass_ratio,
        tests=(_SYMBOLIC + "test_a_wrong_low_pass_is_not_proved", _STEP),
    ),
    _equation(
        44,
        "Filtering is the same as a smaller inertia, Mbar w'/(1 + w').",
        Evidence.PROVED,
        "in real numbers, of the paper's law and of the generator's; no bits are claimed",
        symbolic.low_pass_is_a_smaller_inertia,
        symbolic.code_low_pass,
        tests=(
            _SYMBOLIC + "test_a_wrong_low_pass_is_not_proved",
            _INTERVAL + "test_the_low_pass_is_a_smaller_inertia",
        ),
        commands=("special-cases",),
    ),
)

_SAMPLED_PAIR = "that (47) and (35) are one pair, exactly, at a hundred exponents"

_APPENDIX_A = (
    _equation(45, "The lemma's control: u = -(l1 sig(x1)^rho1 + l2 sig(x2)^rho2).", None, _LEMMA),
    _equation(
        46,
        "The lemma's first condition: 0 < rho1 < 1.",
        Evidence.SAMPLED,
        f"{_SAMPLED_PAIR}; the lemma itself is not used",
        tests=(_EXPONENTS,),
    ),
    _equation(
        47,
        "The lemma's second: rho2 = 2 rho1/(1 + rho1).",
        Evidence.SAMPLED,
        f"{_SAMPLED_PAIR}; the lemma itself is not used",
        finite_time_beta,
        tests=(_EXPONENTS,),
    ),
    _equation(48, "The plant of the lemma, a double integrator.", None, _LEMMA),
    _equation(49, "Both together.", None, _LEMMA),
    _equation(
        50,
        "(17) as a system of first order in e and ed.",
        None,
        "another way to write (17)",
        ErrorDynamics,
        tests=(_FIGURES + "test_trajectories_are_those_of_exact_powers",),
    ),
    _equation(
        51,
        "The same, joint by joint.",
        None,
        "another way to write (17), in which the checker of the certificates has it",
        Parameters,
        lyapunov_check.complaints,
        tests=(_LYAPUNOV + "test_the_checkers_formulas_are_the_dynamics",),
    ),
    _equation(52, "beta is the lemma's rho1 (and KP its l1).", None, "a change of names"),
    _equation(53, "alpha is the lemma's rho2 (and KD its l2).", None, "a change of names"),
    *(
        _equation(number, says, Evidence.SAMPLED, _SAMPLED_PAIR, *code, tests=(_EXPONENTS,))
        for number, says, code in (
            (54, "(46) for the other exponent: 0 < 2 rho1/(1 + rho1) < 1.", ()),
            (55, "(47) the other way round: rho1 = rho2/(2 - rho2).", (finite_time_beta,)),
            (56, "Hence 0 < rho2 < 1.", ()),
        )
    ),
)

_APPENDIX_B = (
    _equation(
        57,
        "Vs = s's/2 has Vsdot <= sum of |s_i| (xi - lambda_min |s_i|^gamma_i).",
        Evidence.PROVED,
        "for one joint, with its own lambda; the paper's smallest lambda only loosens it",
        symbolic.sliding_energy_rate,
        tests=(_SYMBOLIC + "test_another_energy_of_s_does_not_change_as_57",),
        commands=("energy",),
    ),
    _equation(58, "Hence Vs falls where |s_i|^gamma_i > xi/lambda_min for all i.", None, _NO_BOUND),
    _equation(59, "gamma = 0: Vsdot <= sum of |s_i| (xi - lambda_min).", None, _NO_BOUND),
)

_APPENDIX_C = (
    _equation(
        60,
        "Ultralocal model of model-free control: q^(nu) = F + sigma tau.",
        None,
        f"{_DEFINITION} of F; the proof that carries its number is of the law (61)",
        symbolic.ultralocal_rest,
    ),
    _equation(
        61,
        "Its law: tau = -(phi - q_d^(nu) - KD ed - KP e - KI integral of e)/sigma.",
        Evidence.PROVED,
        "with nu = 2, KI = 0, sigma = 1/Mbar and phi from one sample ago it is Hsia's (9)(10)",
        symbolic.model_free_law,
        symbolic.model_free_is_hsia,
        tests=(
            _SYMBOLIC + "test_a_wrong_model_free_law_is_not_proved",
            _CASES + "test_every_case_is_proved",
            _BITS,
        ),
        commands=("special-cases",),
    ),
    _equation(
        62,
        "Its closed loop: e^(nu) + KD ed + KP e + KI integral of e = phi - F.",
        Evidence.PROVED,
        "for nu = 2; the right side is eps of (12) for sigma = 1/Mbar",
        symbolic.model_free_closed_loop,
        tests=(_SYMBOLIC + "test_a_wrong_model_free_law_is_not_proved",),
        commands=("symbolic",),
    ),
)

SECTIONS = (
    Section("II-A, II-B: the robot and time delay estimation", _ROBOT),
    Section("II-C: linear error dynamics, Hsia's law", _HSIA),
    Section("III-A: nonlinear error dynamics", _NONLINEAR),
    Section("III-B: the inclusive law", _INCLUSIVE),
    Section("III-C: finite time, sliding, and special cases", _ANALYSIS),
    Section("III-D: low-pass and a smaller inertia", _LOW_PASS),
    Section("Appendix A: finite time by a published lemma", _APPENDIX_A),
    Section("Appendix B: how s behaves", _APPENDIX_B),
    Section("Appendix C: model-free control", _APPENDIX_C),
)

EQUATIONS = tuple(equation for section in SECTIONS for equation in section.equations)
