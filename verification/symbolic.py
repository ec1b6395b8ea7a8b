"""Proofs in SymPy: the paper's closed loop (32), its sampled form, and what (31) includes.

The joints are decoupled by the diagonal gains, so that one joint with arbitrary symbols stands
for all: every coupling between joints is inside N(t). ``sig`` is an undefined function wherever
nothing but its name is used; nothing about it can then be assumed by mistake.

Two sides meet here. The paper's equations are written in this module, one function per equation.
The law that the C is printed from comes from ``codegen.law`` as an expression graph. A proof
holds when SymPy simplifies the difference of both sides to 0.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, get_args

import casadi as ca
import sympy as sp
from sympy.printing.str import StrPrinter

from codegen.law import (
    AccelerationEstimate,
    LawFunction,
    LawOptions,
    VelocityError,
    measurement,
    torque_law,
)
from codegen.presets import SPECIAL_CASES, LawPreset
from verification.law_graph import Operations, evaluate

Expr: TypeAlias = Any
"""A SymPy expression (SymPy ships no complete type stubs)."""


@dataclass(frozen=True)
class Step:
    """One line of a proof: its equation in the paper, what is done, and the formula."""

    equation: str
    says: str
    formula: str


@dataclass(frozen=True)
class Proof:
    """A statement, the steps to it, and whether its residual simplifies to zero.

    Attributes:
        name: an identifier.
        equation: the equation of the paper that the statement is or belongs to.
        statement: what is proved, with its hypotheses.
        steps: readable lines, each with its equation number.
        residual: left side minus right side after simplification; "0" when it holds.
        holds: whether SymPy simplified the residual to zero.
    """

    name: str
    equation: str
    statement: str
    steps: tuple[Step, ...]
    residual: str
    holds: bool


# --- Notation ----------------------------------------------------------------------------------

t, L = sp.symbols("t L", real=True)
M, KD, KP, LAMBDA = sp.symbols("M̄ K_D K_P λ", positive=True)
ALPHA, BETA, GAMMA = sp.symbols("α β γ", positive=True)

q, q_d, tau, N, s = (sp.Function(name) for name in ("q", "q_d", "τ", "N", "s"))
e = sp.Function("e", real=True)
qdd, qdd_d = sp.Function("q̈"), sp.Function("q̈_d")
sig = sp.Function("sig", real=True)
"""sig(x, a) = |x|^a sgn(x), undefined on purpose: the proofs need no property of it."""


_FACTORS = ("M̄", "L", "c", "λ", "K_D", "K_P", "ω'")
_TERMS = ("q̈_d", "ë", "K_D", "K_P", "λ", "M̄", "N", "τ", "τ*")
"""The order in which a control engineer writes factors and terms; SymPy's own is by name."""


class _Printer(StrPrinter):  # type: ignore[misc]
    """Formulas as a reader writes them: sig(x)^a, dots for rates, familiar order, no stars."""

    def _print_Function(self, expression: Expr) -> str:  # noqa: N802 (SymPy's hook)
        if expression.func != sig:
            name, arguments = expression.func.__name__, map(self._print, expression.args)
            return f"{name}({', '.join(arguments)})"
        base, exponent = expression.args
        return f"sig({self._print(base)})^{self._grouped(exponent)}"

    def _grouped(self, expression: Expr) -> str:
        """A base or an exponent, which is in brackets unless it is a single number or name."""
        text: str = self._print(expression)
        return f"({text})" if " " in text or "/" in text else text

    def _print_Derivative(self, expression: Expr) -> str:  # noqa: N802 (SymPy's hook)
        variable, order = expression.variable_count[0]
        name = expression.expr.func.__name__
        accented = unicodedata.normalize("NFC", name[0] + {1: "\u0307", 2: "\u0308"}[order])
        return f"{accented}{name[1:]}({self._print(variable)})"

    def _print_Integral(self, expression: Expr) -> str:  # noqa: N802 (SymPy's hook)
        variable, low, high = expression.limits[0]
        limits = f"{self._print(low)}, {self._print(high)}"
        return f"∫[{limits}] ({self._print(expression.function)}) d{variable}"

    def _print_Add(self, expression: Expr, order: object = None) -> str:  # noqa: ARG002, N802
        terms = [self._print(term) for term in expression.args]
        terms.sort(key=lambda text: (text.startswith("-"), _rank(text, _TERMS)))
        return " + ".join(terms).replace("+ -", "- ")

    def _print_Mul(self, expression: Expr) -> str:  # noqa: N802 (SymPy's hook)
        sign, positive = ("-", -expression) if expression.could_extract_minus_sign() else ("", None)
        numerator, denominator = sp.fraction(positive if positive is not None else expression)
        text = sign + self._product(numerator)
        if denominator == 1:
            return text
        below = self._print(denominator)
        return f"{text}/({below})" if " " in below else f"{text}/{below}"

    def _product(self, expression: Expr) -> str:
        factors = [
            f"({self._print(f)})" if f.is_Add else self._print(f)
            for f in sp.Mul.make_args(expression)
        ]
        factors.sort(key=lambda text: (not text[0].isdigit(), _rank(text, _FACTORS)))
        return " ".join(f for f in factors if f != "1" or len(factors) == 1)

    def _print_Pow(self, expression: Expr, rational: bool = False) -> str:  # noqa: ARG002, N802
        if expression.exp.is_negative:
            below = self._print(1 / expression)
            return f"1/({below})" if " " in below and expression.exp == -1 else f"1/{below}"
        return f"{self._grouped(expression.base)}^{self._grouped(expression.exp)}"


def _rank(text: str, order: tuple[str, ...]) -> int:
    head = re.split(r"[ (^/]", text.lstrip("-("))[0]
    return order.index(head) if head in order else len(order)


def show(expression: Expr) -> str:
    """An expression as a line of text."""
    text: str = _Printer().doprint(expression)
    return text


def _equals(left: Expr, right: Expr) -> str:
    return f"{show(left)} = {show(right)}"


def conclude(
    name: str, equation: str, statement: str, steps: tuple[Step, ...], residual: Expr
) -> Proof:
    """A proof whose residual SymPy simplifies; it holds where nothing remains."""
    simplified = sp.simplify(sp.expand(residual))
    return Proof(name, equation, statement, steps, show(simplified), bool(simplified == 0))


# --- The paper's equations, continuous time ----------------------------------------------------


def ded(velocity_error: Expr, position_error: Expr) -> Expr:
    """Damper and spring of the nonlinear desired error dynamics (17)."""
    return KD * sig(velocity_error, ALPHA) + KP * sig(position_error, BETA)


def estimate(time: Expr) -> Expr:
    """The time delay estimate of N(t) (6): tau(t-L) - Mbar qdd(t-L)."""
    return tau(time - L) - M * qdd(time - L)


def inclusive_law(time: Expr) -> Expr:
    """The torque of the inclusive law (31)."""
    error_dynamics = ded(e(time).diff(time), e(time))
    correction = LAMBDA * sig(s(time), GAMMA)
    return M * (qdd_d(time) + error_dynamics + correction) + estimate(time)


def tde_error(time: Expr) -> Expr:
    """The time delay estimation error eps of (11), Mbar^-1 [N(t) - N(t-L)]."""
    return (N(time) - N(time - L)) / M


def robot_torque(time: Expr) -> Expr:
    """The robot of (2) as the torque that moves it: Mbar qdd + N."""
    return M * qdd(time) + N(time)


def sliding_variable(time: Expr) -> Expr:
    """s of (26), the integral from switch-on of edd + KD sig(ed)^alpha + KP sig(e)^beta."""
    x = sp.Symbol("x", real=True)
    integrand = e(x).diff(x, 2) + ded(e(x).diff(x), e(x))
    return sp.Integral(integrand, (x, 0, time))


def closed_loop(law: Callable[[Expr], Expr] = inclusive_law) -> Proof:
    """(31) put into (2) with (4)-(6) gives (32), sdot + lambda sig(s)^gamma = eps.

    Args:
        law: the torque as a function of time; another one than (31) must not pass.
    """
    delayed = robot_torque(t - L)
    torque = law(t).subs(tau(t - L), delayed)
    acceleration = sp.expand((torque - N(t)) / M)
    rate = sliding_variable(t).diff(t)
    error_acceleration = qdd_d(t) - qdd(t)
    rate_in_q = rate.subs(e(t).diff(t, 2), error_acceleration)
    left = rate_in_q.subs(qdd(t), acceleration) + LAMBDA * sig(s(t), GAMMA)
    steps = (
        Step("(2)", "The robot at time t", _equals(tau(t), robot_torque(t))),
        Step("(2)", "and one delay earlier", _equals(tau(t - L), delayed)),
        Step("(4)-(6)", "so that the estimate is N(t-L) itself", _equals(N(t - L), estimate(t))),
        Step("(31)", "The law", _equals(tau(t), law(t))),
        Step("(2)", "moves the robot with", _equals(qdd(t), acceleration)),
        Step("(11)", "The error of the estimate is", _equals(sp.Symbol("ε"), tde_error(t))),
        Step("(26)", "By definition", _equals(s(t), sliding_variable(t))),
        Step("(26)", "whose rate is", _equals(s(t).diff(t), rate)),
        Step("(7)", "with, from e = q_d - q,", _equals(e(t).diff(t, 2), error_acceleration)),
        Step("(32)", "Everything put in", "ṡ(t) + λ sig(s(t))^γ = " + show(sp.expand(left))),
        Step("(32)", "which is", f"ε(t) = {show(tde_error(t))}"),
    )
    return conclude(
        "closed_loop",
        "(32)",
        "The inclusive law on the robot gives ṡ + λ sig(s)^γ = ε, for every sig, every "
        "reference, every robot and every gain.",
        steps,
        left - tde_error(t),
    )


def nonlinear_law(time: Expr) -> Expr:
    """The torque of the law without correction of the TDE error (24)."""
    return M * (qdd_d(time) + ded(e(time).diff(time), e(time))) + estimate(time)


def uncorrected_loop(law: Callable[[Expr], Expr] = nonlinear_law) -> Proof:
    """(24) put into (2) gives (25), which is sdot = eps (27).

    Args:
        law: the torque as a function of time; another one than (24) must not pass.
    """
    torque = law(t).subs(tau(t - L), robot_torque(t - L))
    acceleration = sp.expand((torque - N(t)) / M)
    rate = sliding_variable(t).diff(t)
    left = rate.subs(e(t).diff(t, 2), qdd_d(t) - acceleration)
    steps = (
        Step("(24)", "The law", _equals(tau(t), law(t))),
        Step("(2)", "moves the robot with", _equals(qdd(t), acceleration)),
        Step("(26)", "The sliding variable changes by", _equals(s(t).diff(t), rate)),
        Step("(25)", "which is, put in,", _equals(s(t).diff(t), sp.expand(left))),
        Step("(27)", "the error of the estimate (11)", f"ε(t) = {show(tde_error(t))}"),
    )
    return conclude(
        "uncorrected_loop",
        "(27)",
        "Without correction of the error of time delay estimation, ṡ = ε: nothing pulls s back.",
        steps,
        left - tde_error(t),
    )


def ideal_velocity() -> Proof:
    """(28)-(30): s is the ideal velocity minus the robot's, where both start equal."""
    x = sp.Symbol("x", real=True)
    ideal_rate = qdd_d(t) + ded(e(t).diff(t), e(t))
    s_rate = sliding_variable(t).diff(t).subs(e(t).diff(t, 2), qdd_d(t) - qdd(t))
    steps = (
        Step("(28)", "The ideal acceleration is", f"q̈_ideal(t) = {show(ideal_rate)}"),
        Step(
            "(29)",
            "Its integral from switch-on is the ideal velocity",
            f"q̇_ideal(t) = q̇(0) + ∫[0, t] ({show(ideal_rate.subs(t, x))}) dx",
        ),
        Step("(26)", "The sliding variable changes by", _equals(s(t).diff(t), s_rate)),
        Step("(30)", "which is q̈_ideal - q̈, and s(0) = 0", "s(t) = q̇_ideal(t) - q̇(t)"),
    )
    return conclude(
        "ideal_velocity",
        "(30)",
        "s is the ideal velocity minus the velocity of the robot.",
        steps,
        s_rate - (ideal_rate - qdd(t)),
    )


def low_pass_is_a_smaller_inertia(
    filter_: Callable[[Expr, Expr, Expr], Expr] | None = None,
) -> Proof:
    """(42) into the first-order low-pass (43) is (44): Mbar becomes Mbar w'/(1+w').

    Args:
        filter_: torque, last torque and w' to the filtered torque; another one than (43)
            must not pass.
    """
    w = sp.Symbol("ω'", positive=True)
    u, last_torque, last_acceleration = sp.symbols("u τ(t-L) q̈(t-L)", real=True)
    filtered = filter_ or (lambda torque, last, ratio: (ratio * torque + last) / (1 + ratio))
    unfiltered = M * (u - last_acceleration) + last_torque
    smaller = w / (1 + w) * M * (u - last_acceleration) + last_torque
    torque = filtered(unfiltered, last_torque, w)
    star = sp.Symbol("τ*", real=True)
    steps = (
        Step("(42)", "With u = u_n + λ sig(s)^γ", f"τ* = {show(unfiltered)}"),
        Step("(43)", "is filtered, ω' = ω L", f"τ = {show(filtered(star, last_torque, w))}"),
        Step("(44)", "Put in", f"τ = {show(sp.collect(sp.simplify(torque), M))}"),
        Step("(44)", "is the law with a smaller inertia", f"τ = {show(smaller)}"),
    )
    return conclude(
        "low_pass",
        "(44)",
        "The low-pass on the torque is the unfiltered law with M̄ ω'/(1+ω') in place of M̄.",
        steps,
        torque - smaller,
    )


def model_free_law(time: Expr, sigma: Expr, k_i: Expr) -> Expr:
    """The torque of model-free control (61) with nu = 2.

    phi is F of the ultralocal model (60), qdd = F + sigma tau, estimated from one delay ago.
    """
    x = sp.Symbol("x", real=True)
    linear = KD * e(time).diff(time) + KP * e(time) + k_i * sp.Integral(e(x), (x, 0, time))
    return -(ultralocal_rest(time - L, sigma) - qdd_d(time) - linear) / sigma


def ultralocal_rest(time: Expr, sigma: Expr) -> Expr:
    """F of the ultralocal model (60) with nu = 2: what sigma tau lacks of qdd."""
    return qdd(time) - sigma * tau(time)


def hsia_law(time: Expr) -> Expr:
    """The torque of Hsia's law (9)(10)."""
    u_h = qdd_d(time) + KD * e(time).diff(time) + KP * e(time)
    return M * u_h + estimate(time)


_SIGMA, _K_I = sp.symbols("σ K_I", positive=True)
ModelFreeLaw: TypeAlias = Callable[[Expr, Expr, Expr], Expr]
"""Time, sigma and K_I to the torque."""


def model_free_is_hsia(law: ModelFreeLaw = model_free_law) -> Proof:
    """(61) with nu = 2, K_I = 0 and sigma = 1/Mbar is Hsia's law (9)(10).

    Args:
        law: another one than (61) must not pass.
    """
    torque = law(t, 1 / M, sp.Integer(0))
    rest = ultralocal_rest(t - L, _SIGMA)
    steps = (
        Step("(60)", "The ultralocal model, ν = 2", "q̈(t) = F(t) + σ τ(t)"),
        Step("(60)", "estimates F from one delay ago", f"φ(t) = {show(rest)}"),
        Step("(61)", "The law", _equals(tau(t), law(t, _SIGMA, _K_I))),
        Step("(61)", "with K_I = 0 and σ = 1/M̄", _equals(tau(t), torque)),
        Step("(9)(10)", "is Hsia's", _equals(tau(t), hsia_law(t))),
    )
    return conclude(
        "model_free_is_hsia",
        "(61)",
        "Model-free control with ν = 2, K_I = 0, σ = 1/M̄ and φ from the delayed sample is Hsia's "
        "time delay control.",
        steps,
        torque - hsia_law(t),
    )


def model_free_closed_loop(law: ModelFreeLaw = model_free_law) -> Proof:
    """(61) on the robot gives (62), whose right side phi - F is eps (11) for sigma = 1/Mbar.

    Args:
        law: another one than (61) must not pass.
    """
    x = sp.Symbol("x", real=True)
    at = ultralocal_rest(t, _SIGMA), ultralocal_rest(t - L, _SIGMA)
    acceleration = sp.Function("F")(t) + _SIGMA * law(t, _SIGMA, _K_I)
    left = (
        (qdd_d(t) - acceleration)
        + KD * e(t).diff(t)
        + KP * e(t)
        + _K_I * sp.Integral(e(x), (x, 0, t))
    )
    rest = at[1] - sp.Function("F")(t)
    # On the robot (2), tau = Mbar qdd + N, at both times.
    on_robot = {tau(time): robot_torque(time) for time in (t, t - L)}
    error = (at[1] - at[0]).subs(on_robot).subs(_SIGMA, 1 / M)
    steps = (
        Step("(60)", "The robot moves with", "q̈(t) = F(t) + σ τ(t)"),
        Step("(61)", "under the law", _equals(tau(t), law(t, _SIGMA, _K_I))),
        Step(
            "(62)",
            "so that",
            f"ë(t) + K_D ė(t) + K_P e(t) + K_I ∫[0, t] (e(x)) dx = {show(sp.expand(left))}",
        ),
        Step("(62)", "which is, with φ from one delay ago,", f"φ(t) - F(t) = {show(rest)}"),
        Step("(2)", "For σ = 1/M̄ and the robot at both times it is", show(sp.expand(error))),
        Step("(11)", "the error of time delay estimation", f"ε(t) = {show(tde_error(t))}"),
    )
    return conclude(
        "model_free_closed_loop",
        "(62)",
        "Model-free control gives ë + K_D ė + K_P e + K_I ∫e = φ - F, for every σ and K_I; for "
        "σ = 1/M̄ its right side is ε of time delay control.",
        steps,
        sp.Abs(sp.simplify(sp.expand(left - rest))) + sp.Abs(sp.simplify(error - tde_error(t))),
    )


# --- Energy ------------------------------------------------------------------------------------

# SymPy does not simplify |x| and sgn(x). A number is its sign times its magnitude instead: each
# statement is proved for every sign, 0 among them, with magnitudes greater than 0.
_E_MAGNITUDE, _ED_MAGNITUDE, _S_MAGNITUDE = sp.symbols("|e| |ė| |s|", positive=True)
_SIGNS = (1, -1, 0)

EnergyFunction: TypeAlias = Callable[[Expr, Expr], Expr]
"""|e| and |ed| to an energy."""
SlidingEnergy: TypeAlias = Callable[[Expr], Expr]
"""|s| to an energy."""


def energy(position_magnitude: Expr, velocity_magnitude: Expr) -> Expr:
    """V of (20), the energy of the desired error dynamics, of |e| and |ed|."""
    return velocity_magnitude**2 / 2 + KP * position_magnitude ** (BETA + 1) / (BETA + 1)


def sliding_energy(magnitude: Expr) -> Expr:
    """Vs of appendix B, s^2/2, of |s|."""
    return magnitude**2 / 2


def _signed(sign: int, magnitude: Expr, exponent: Expr) -> Expr:
    """sig(x)^a of x = sign * magnitude, by its definition below (17); a > 0 where x is 0."""
    return sign * magnitude**exponent


def _sum_of_magnitudes(residuals: Iterable[Expr]) -> Expr:
    """Zero only if every residual is."""
    return sum((sp.Abs(sp.simplify(sp.expand(r))) for r in residuals), sp.Integer(0))


def energy_falls(function: EnergyFunction = energy) -> Proof:
    """(20) along (17) gives (21), Vdot = -KD |ed|^(alpha+1), in each quadrant and on the axes.

    Args:
        function: the energy; another one than (20) must not pass.
    """
    a, b = _E_MAGNITUDE, _ED_MAGNITUDE
    energy_ = function(a, b)

    def residual(sign_e: int, sign_ed: int) -> Expr:
        velocity = _signed(sign_ed, b, 1)
        acceleration = -KD * _signed(sign_ed, b, ALPHA) - KP * _signed(sign_e, a, BETA)
        # By the chain rule; where e or ed is 0 its sign is, and so is the slope of (20) there.
        rate = sign_e * energy_.diff(a) * velocity + sign_ed * energy_.diff(b) * acceleration
        return rate + KD * abs(sign_ed) * b ** (ALPHA + 1)

    steps = (
        Step("(20)", "The energy, with α, β > 0", f"V = {show(energy_)}"),
        Step("(20)", "has the slopes", f"sgn(e) {show(sp.simplify(energy_.diff(a)))}"),
        Step("(20)", "and", f"sgn(ė) {show(sp.simplify(energy_.diff(b)))}"),
        Step("(17)", "Along", f"ë = {show(-ded(_ED, _E))}"),
        Step("(21)", "for each sign of e and ė, 0 too,", f"V̇ = {show(-KD * b ** (ALPHA + 1))}"),
    )
    return conclude(
        "energy_falls",
        "(21)",
        "Along the desired error dynamics its energy changes by V̇ = -K_D |ė|^(α + 1), for every "
        "α, β > 0, in each quadrant and on the axes.",
        steps,
        _sum_of_magnitudes(residual(x, y) for x in _SIGNS for y in _SIGNS),
    )


def finite_time_scale(exponent: Expr) -> Expr:
    """The factor of sig(e)^(1/(2-alpha)) in the normal form of the finite-time pair."""
    return sp.sqrt(KP * (2 - exponent))


def finite_time_normal_form(scale: Callable[[Expr], Expr] = finite_time_scale) -> Proof:
    """The finite-time pair (34)(35) in coordinates in which only two numbers are left.

    X = sqrt(KP (2-alpha)) sig(e)^(1/(2-alpha)) and Y = ed obey X' = kappa |X|^(alpha-1) Y and
    Y' = -kappa sig(X)^alpha - KD sig(Y)^alpha.

    Args:
        scale: alpha to the factor in X; another one must not pass.
    """
    # Written with beta, which may be any number above 0, no base can be negative.
    alpha = 2 * BETA / (1 + BETA)
    rest = sp.simplify(2 - alpha)
    kappa = KP ** (rest / 2) * rest ** (-alpha / 2)
    magnitude = scale(alpha) * _E_MAGNITUDE ** (1 / rest)
    # For e not 0: the signs of both sides are those of ed and of e, their magnitudes compare.
    ratios = (
        magnitude.diff(_E_MAGNITUDE) / (kappa * magnitude ** (alpha - 1)),
        KP * _E_MAGNITUDE**BETA / (kappa * magnitude**alpha),
    )
    residuals = (sp.expand_log(sp.log(sp.simplify(ratio)), force=True) for ratio in ratios)
    x_, y_ = _real("X", "Y")
    power = (2 - ALPHA) / 2
    kappa_ = sp.Symbol("κ", positive=True)
    factor, exponent = show(scale(ALPHA)), show(1 / (2 - ALPHA))
    steps = (
        Step("(34)(35)", "The finite-time pair", f"β = {show(ALPHA / (2 - ALPHA))}, 0 < α < 1"),
        Step("(17)", "With", f"X = {factor} sig(e)^({exponent}), Y = ė"),
        Step("(17)", "and", f"κ = {show(KP**power)}/{show((2 - ALPHA) ** (ALPHA / 2))}"),
        Step("(17)", "the rate of e is, for e ≠ 0,", "Ẋ = κ |X|^(α - 1) Y"),
        Step("(17)", "and ë is", f"Ẏ = {show(-kappa_ * sig(x_, ALPHA) - KD * sig(y_, ALPHA))}"),
    )
    return conclude(
        "finite_time_normal_form",
        "(35)",
        "With β = α/(2 - α) the desired error dynamics is Ẋ = κ |X|^(α - 1) Y, "
        "Ẏ = -κ sig(X)^α - K_D sig(Y)^α for e ≠ 0: besides time, only α and K_D/κ matter.",
        steps,
        _sum_of_magnitudes(residuals),
    )


def sliding_energy_rate(function: SlidingEnergy = sliding_energy) -> Proof:
    """Vs along (32) changes by s eps - lambda |s|^(gamma+1), the first lines of (57).

    Args:
        function: the energy of s; another one than s^2/2 must not pass.
    """
    b, error = _S_MAGNITUDE, sp.Symbol("ε", real=True)
    energy_ = function(b)

    def residual(sign: int) -> Expr:
        rate = error - LAMBDA * _signed(sign, b, GAMMA)
        expected = sign * b * error - LAMBDA * abs(sign) * b ** (GAMMA + 1)
        return sign * energy_.diff(b) * rate - expected

    variable = sp.Symbol("s", real=True)
    steps = (
        Step("(57)", "The energy", f"V_s = {show(energy_)}"),
        Step("(32)", "along", f"ṡ = {show(error - LAMBDA * sig(variable, GAMMA))}"),
        Step("(57)", "for each sign of s", f"V̇_s = s ε - {show(LAMBDA * b ** (GAMMA + 1))}"),
    )
    return conclude(
        "sliding_energy_rate",
        "(57)",
        "Along the closed loop V_s = s²/2 changes by V̇_s = s ε - λ |s|^(γ + 1).",
        steps,
        _sum_of_magnitudes(residual(sign) for sign in _SIGNS),
    )


def sliding_bound(
    bound: Callable[[Expr, Expr], Expr] = lambda xi, gamma: (xi / LAMBDA) ** (1 / gamma),
) -> Proof:
    """Outside |s| = (xi/lambda)^(1/gamma) (38) Vs falls, for every TDE error within xi.

    Args:
        bound: of |s|, from xi and gamma; another one than (38) must not pass.
    """
    b, size, spare, margin = sp.symbols("|s| |ε| ξ-|ε| g", positive=True)
    # Any error within xi: xi is its magnitude and what is spare.
    slacks = [
        sp.expand(b * (size + spare) - sign_s * sign_error * b * size)
        for sign_s in (1, -1)
        for sign_error in _SIGNS
    ]
    xi = sp.Symbol("ξ", positive=True)

    def factor(magnitude: Expr) -> Expr:
        """What |s| is multiplied by in the last line of (57)."""
        return xi - LAMBDA * magnitude**GAMMA

    # |s| is beyond the bound of xi where it is at the bound of xi + g for some g > 0.
    outside = factor(bound(xi + margin, GAMMA))
    at_sign = factor(b).subs(GAMMA, 0)
    steps = (
        Step("(57)", "With |ε| ≤ ξ", "V̇_s ≤ |s| (ξ - λ |s|^γ)"),
        Step("(58)", "For g > 0, at", f"|s| = {show(bound(xi + margin, GAMMA))}"),
        Step("(58)", "the factor of |s| is", f"{show(factor(b))} = {show(sp.simplify(outside))}"),
        Step("(38)", "less than 0; g = 0 gives the bound", f"|s| ≤ {show(bound(xi, GAMMA))}"),
        Step("(59)", "For γ = 0 the factor is", f"{show(at_sign)} < 0 if λ > ξ (37)"),
    )
    proof = conclude(
        "sliding_bound",
        "(38)",
        "Where |ε| ≤ ξ, V̇_s < 0 outside |s| ≤ (ξ/λ)^(1/γ), for every γ > 0; s, which starts from "
        "0, stays within. For γ = 0 V̇_s < 0 wherever s ≠ 0, if λ > ξ.",
        steps,
        _sum_of_magnitudes((outside + margin, at_sign - (xi - LAMBDA))),
    )
    if not all(slack.is_nonnegative for slack in slacks):
        return replace(proof, residual="s ε may exceed |s| ξ", holds=False)
    return proof


# --- The law that the C is printed from --------------------------------------------------------


def _multiply(a: Expr, b: Expr) -> Expr:
    """A product; sgn(x) |x|^a is sig(x)^a by its definition below (17)."""
    for sign, power in ((a, b), (b, a)):
        base, exponent = power.as_base_exp()
        if isinstance(sign, sp.sign) and base == sp.Abs(sign.args[0]):
            return sig(sign.args[0], exponent)
    return a * b


_OPERATIONS: Operations = {
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a - b,
    ca.OP_MUL: _multiply,
    ca.OP_DIV: lambda a, b: a / b,
    ca.OP_NEG: lambda a: -a,
    ca.OP_SQ: lambda a: a**2,
    ca.OP_TWICE: lambda a: 2 * a,
    ca.OP_SIGN: sp.sign,
    ca.OP_FABS: sp.Abs,
    ca.OP_POW: lambda a, b: a**b,
    ca.OP_CONSTPOW: lambda a, b: a**b,
    ca.OP_FMIN: sp.Min,
    ca.OP_FMAX: sp.Max,
}


def _number(value: float) -> Expr:
    return sp.Rational(value)


def law_in_sympy(function: LawFunction, values: Mapping[str, Expr]) -> dict[str, Expr]:
    """The quantities of a law function as SymPy expressions of the given inputs."""
    return evaluate(function, values, _OPERATIONS, _number)


def _real(*names: str) -> tuple[Expr, ...]:
    return sp.symbols(" ".join(names), real=True)  # type: ignore[no-any-return]


_E, _ED, _QDD_D, _LAST_TAU, _LAST_QDD = _real("e", "ė", "q̈_d", "τ(t-L)", "q̈(t-L)")
_INTEGRAL, _LIMIT, _RATIO = _real("I", "τ_max", "ω'/(1+ω')")

_GAIN_VALUES = {
    "inertia": M,
    "kd": KD,
    "kp": KP,
    "lambda": LAMBDA,
    "alpha": ALPHA,
    "beta": BETA,
    "gamma": GAMMA,
    "torque_limit": _LIMIT,
    "low_pass_ratio": _RATIO,
    "sample_time": L,
}
_SIGNAL_VALUES = {
    "reference_acceleration": _QDD_D,
    "last_torque": _LAST_TAU,
    "sliding_integral": _INTEGRAL,
    "position_error": _E,
    "velocity_error": _ED,
    "last_acceleration": _LAST_QDD,
}

LAW_SYMBOLS: Mapping[str, Expr] = {**_GAIN_VALUES, **_SIGNAL_VALUES}
"""The symbol of each gain and signal of the generator's law, by its name there."""


def code_is_the_paper(law: LawFunction | None = None) -> Proof:
    """Every quantity of the generator's law equals the paper's equation that it names."""
    function = law or torque_law(LawOptions(low_pass=True))
    code = law_in_sympy(function, LAW_SYMBOLS)
    damping = KD * sig(_ED, ALPHA)
    stiffness = KP * sig(_E, BETA)
    sliding = _ED + _INTEGRAL
    correction = LAMBDA * sig(sliding, GAMMA)
    torque = M * (_QDD_D + damping + stiffness + correction) + _LAST_TAU - M * _LAST_QDD
    paper = {
        "damping": damping,
        "stiffness": stiffness,
        "restoring": damping + stiffness,
        "nonlinear_input": _QDD_D + damping + stiffness,
        "sliding_variable": sliding,
        "correction": correction,
        "time_delay_estimate": _LAST_TAU - M * _LAST_QDD,
        "control_torque": torque,
        "filtered_torque": _RATIO * torque + (1 - _RATIO) * _LAST_TAU,
        "next_sliding_integral": _INTEGRAL + L * (damping + stiffness),
    }
    steps = tuple(
        Step(quantity.equation, quantity.name, show(code[quantity.name]))
        for quantity in function.quantities
        if quantity.name in paper
    )
    residual = sum(
        (
            sp.Abs(sp.simplify(sp.expand(code[name] - paper[name])))
            for name in code
            if name in paper
        ),
        sp.Integer(0),
    )
    missing = sorted(paper.keys() - code.keys())
    proof = conclude(
        "code_is_the_paper",
        "(31)",
        "The expression graph that the C is printed from is the paper's law, quantity by "
        "quantity (I is the integral part of (26)).",
        steps,
        residual,
    )
    if missing:
        return replace(proof, residual=f"no quantity {', '.join(missing)}", holds=False)
    return proof


def code_low_pass() -> Proof:
    """The generator's low-pass law equals its unfiltered law with a smaller inertia (44)."""
    filtered = law_in_sympy(torque_law(LawOptions(low_pass=True)), LAW_SYMBOLS)["filtered_torque"]
    smaller = law_in_sympy(torque_law(LawOptions()), {**LAW_SYMBOLS, "inertia": M * _RATIO})
    steps = (
        Step("(43)", "The generator's filtered torque", f"τ = {show(filtered)}"),
        Step(
            "(44)",
            "its unfiltered torque with M̄ ω'/(1+ω')",
            f"τ = {show(smaller['control_torque'])}",
        ),
    )
    return conclude(
        "code_low_pass",
        "(44)",
        "In the generator's law, too, the low-pass is nothing but a smaller M̄.",
        steps,
        filtered - smaller["control_torque"],
    )


def with_fixed_gains(expression: Expr, preset: LawPreset) -> Expr:
    """An expression with the gains that a preset fixes."""
    fixed = {
        _GAIN_VALUES[key]: sp.Rational(str(value))
        for key, value in preset.fixed.items()
        if isinstance(value, int) or "/" in value
    }
    # By definition sig(x)^1 = x and sig(x)^0 = sgn(x), also at x = 0.
    return expression.subs(fixed).replace(sig, _known_sig)


def inclusive_torque(preset: LawPreset) -> Expr:
    """The torque of the generator's law with the gains that a preset fixes."""
    return with_fixed_gains(
        law_in_sympy(torque_law(LawOptions()), LAW_SYMBOLS)["control_torque"], preset
    )


def special_case(preset: LawPreset, paper: Expr) -> Proof:
    """The generator's law with a preset's fixed gains is the paper's special case.

    Args:
        preset: the special case, with the gains that define it.
        paper: what the paper prints in its place for u_n + correction.
    """
    code = law_in_sympy(torque_law(LawOptions()), LAW_SYMBOLS)
    torque = inclusive_torque(preset)
    expected = M * paper + _LAST_TAU - M * _LAST_QDD
    values = ", ".join(f"{key} = {value}" for key, value in preset.fixed.items())
    steps = (
        Step("(31)", "The law", f"τ = {show(code['control_torque'])}"),
        Step("III-C4", "with the gains that define the case", values),
        Step(preset.equation, "is", f"τ = {show(expected)}"),
    )
    return conclude(
        f"special_case_{preset.name}", preset.equation, preset.meaning, steps, torque - expected
    )


def _known_sig(x: Expr, exponent: Expr) -> Expr:
    return {sp.Integer(1): x, sp.Integer(0): sp.sign(x)}.get(exponent, sig(x, exponent))


def special_cases() -> tuple[Proof, ...]:
    """The inclusiveness of the law (III-C4): (9)(10), (39), (40) and (41) are cases of (31)."""
    linear = _QDD_D + KD * _ED + KP * _E
    sliding = _ED + _INTEGRAL
    damping, stiffness = KD * sig(_ED, ALPHA), KP * sig(_E, BETA)
    paper = {
        "hsia": linear,
        "jin": linear + LAMBDA * sliding,
        "sliding-mode": linear + LAMBDA * sp.sign(sliding),
        "terminal-sliding": linear + LAMBDA * sig(sliding, GAMMA),
        "nonlinear-ded": _QDD_D + damping + stiffness,
    }
    return tuple(special_case(p, paper[p.name]) for p in SPECIAL_CASES if p.name in paper)


# --- The sampled closed loop -------------------------------------------------------------------


_WHEN = ("k+1", "k", "k-1", "k-2", "k-3")
_COUNT = sp.Symbol("c", positive=True)
_POSITION = _real(*(f"n[{w}]" for w in _WHEN))
_REFERENCE = _real(*(f"n_d[{w}]" for w in _WHEN))
_REFERENCE_VELOCITY = _real(*(f"q̇_d[{w}]" for w in _WHEN))
_NEXT, _NOW, _LAST = 0, 1, 2
"""Indices of t+L, t and t-L in the tuples above."""


def _scales(mode: VelocityError) -> dict[str, Expr]:
    """From counts to SI units; c is the angle of one count, error signals are in c/256."""
    difference = 256 if mode == "error-difference" else 1
    return {
        "position": _COUNT / 256,
        "velocity": _COUNT / L / difference,
        "acceleration": _COUNT / L**2,
    }


def second_difference(k: int) -> Expr:
    """Acceleration of the sampled position, over the two samples that end at tick k."""
    return _COUNT * (_POSITION[k] - 2 * _POSITION[k + 1] + _POSITION[k + 2]) / L**2


def _measured_velocity_error(function: LawFunction, mode: VelocityError, k: int) -> Expr:
    """The velocity error that the code forms at tick k from the sampled positions."""
    error = [256 * (r - n) for r, n in zip(_REFERENCE, _POSITION, strict=True)]
    values = {
        **_scales(mode),
        "error_q8": error[k],
        "error_change_q8": error[k] - error[k + 1],
        "displacement": _POSITION[k] - _POSITION[k + 1],
        "displacement_change": sp.Integer(0),
        "reference_velocity": _REFERENCE_VELOCITY[k],
        "last_reference_velocity": _REFERENCE_VELOCITY[k + 1],
    }
    return law_in_sympy(function, values)["velocity_error"]


def _measured_acceleration(function: LawFunction, options: LawOptions, k: int) -> Expr:
    """qdd(t-L) as the code estimates it at tick k."""
    at = k + 1 if options.acceleration == "delayed" else k
    change = _POSITION[at] - 2 * _POSITION[at + 1] + _POSITION[at + 2]
    zero = sp.Integer(0)
    values = {i.name: zero for i in function.inputs}
    values |= {**_scales(options.velocity_error), "displacement_change": change}
    return law_in_sympy(function, values)["last_acceleration"]


def sampled_closed_loop(
    options: LawOptions, law: LawFunction | None = None, measure: LawFunction | None = None
) -> Proof:
    """(32) sample by sample, from the generator's law and its rectangle rule for s.

    s[k+1] - s[k] = L (eps[k] + rho[k] - lambda sig(s[k])^gamma), exactly. N[k] is what (2)
    says of the sample from k to k+1, tau[k] minus Mbar times the second difference that ends
    at k+1; eps[k] = Mbar^-1 (N[k] - its estimate); rho[k] is the mismatch between the reference
    acceleration that is given and the one that the sampled reference has, and depends on the
    reference alone. While a joint saturates, eps also holds the torque that is missing.

    Args:
        options: how velocity error and acceleration are formed; without low-pass, which is a
            smaller Mbar (44).
        law: the generator's law; another one must not pass.
        measure: its measurement; another one must not pass.
    """
    law = law or torque_law(options)
    measure = measure or measurement(options)
    e_k, ed_k, ed_next, integral, torque_last = _real("e[k]", "ė[k]", "ė[k+1]", "I[k]", "τ[k-1]")
    acceleration_d = sp.Symbol("q̈_d[k]", real=True)
    values = {
        **_GAIN_VALUES,
        "reference_acceleration": acceleration_d,
        "last_torque": torque_last,
        "sliding_integral": integral,
        "position_error": e_k,
        "velocity_error": ed_k,
        "last_acceleration": _measured_acceleration(measure, options, _NOW),
    }
    now = law_in_sympy(law, values)
    following = law_in_sympy(
        law,
        {
            **values,
            "velocity_error": ed_next,
            "sliding_integral": now["next_sliding_integral"],
        },
    )
    s_k = now["sliding_variable"]
    step = following["sliding_variable"] - s_k
    disturbance = now["control_torque"] - M * second_difference(_NEXT)
    error = (disturbance - now["time_delay_estimate"]) / M
    difference = _measured_velocity_error(
        measure, options.velocity_error, _NEXT
    ) - _measured_velocity_error(measure, options.velocity_error, _NOW)
    mismatch = sp.expand(difference / L + second_difference(_NEXT) - acceleration_d)
    right = L * (error + mismatch - LAMBDA * sig(ed_k + integral, GAMMA))
    residual = (step - right).subs(ed_next, ed_k + difference)
    of_the_reference = {*_REFERENCE, *_REFERENCE_VELOCITY, acceleration_d, L, _COUNT}
    depends_on_more = mismatch.free_symbols - of_the_reference
    estimate_offset = now["time_delay_estimate"] - (torque_last - M * second_difference(_NOW))
    steps = (
        Step(
            "(2)",
            "The sample from k to k+1 defines",
            f"N[k] = τ[k] - M̄ a[k+1], a[k+1] = {show(second_difference(_NEXT))}",
        ),
        Step(
            "(6)",
            "of which the code estimates",
            f"N̂[k] = {show(sp.Symbol('N[k-1]') + sp.factor(sp.expand(estimate_offset)))}",
        ),
        Step("(11)", "with the error", "ε[k] = (N[k] - N̂[k]) / M̄"),
        Step("(26)", "The code's sliding variable", f"s[k] = {show(s_k)}"),
        Step(
            "(26)",
            "with the rectangle rule",
            f"I[k+1] = {show(sp.expand(now['next_sliding_integral']))}",
        ),
        Step(
            "(7)", "The velocity error changes by", f"ė[k+1] - ė[k] = {show(sp.expand(difference))}"
        ),
        Step("", "The reference's own mismatch is", f"ρ[k] = {show(mismatch)}"),
        Step("(32)", "Everything put in", "s[k+1] - s[k] = L (ε[k] + ρ[k] - λ sig(s[k])^γ)"),
    )
    proof = conclude(
        f"sampled_{options.velocity_error}_{options.acceleration}",
        "(32)",
        f"The generator's law in samples ({options.velocity_error}, {options.acceleration} "
        "acceleration): s[k+1] - s[k] = L (ε[k] + ρ[k] - λ sig(s[k])^γ), exactly, while no joint "
        "saturates; ρ depends on the reference alone.",
        steps,
        residual,
    )
    if depends_on_more:
        names = ", ".join(sorted(map(str, depends_on_more)))
        return replace(proof, residual=f"ρ depends on {names}", holds=False)
    return proof


def sampled_closed_loops() -> tuple[Proof, ...]:
    """The sampled closed loop for every way to form velocity error and acceleration."""
    return tuple(
        sampled_closed_loop(LawOptions(velocity, acceleration))
        for velocity in get_args(VelocityError)
        for acceleration in get_args(AccelerationEstimate)
    )


def all_proofs() -> tuple[Proof, ...]:
    """Every proof of this module, the paper's first."""
    return (
        energy_falls(),
        finite_time_normal_form(),
        uncorrected_loop(),
        closed_loop(),
        sliding_energy_rate(),
        sliding_bound(),
        ideal_velocity(),
        low_pass_is_a_smaller_inertia(),
        model_free_is_hsia(),
        model_free_closed_loop(),
        code_is_the_paper(),
        code_low_pass(),
        *special_cases(),
        *sampled_closed_loops(),
    )
