"""The special cases of the inclusive law, each written by itself as the paper writes it.

No function here calls the inclusive law (31) or one of its terms. What a case doesn't have isn't
there: Hsia's law has no sliding variable, Jin's no power function. Only the declarations of
gains and signals come from ``codegen.law``, so that the same printer makes C of both.

Algebra has one sum where floats have many. The paper's sums don't say in which order they are
added, the inclusive C does: the spring and the damper first, and the time delay estimate first.
With that order, `grouped`, the cases have the inclusive law's bits; with the order in which the
paper prints the terms, `left_to_right`, they are the same laws with other roundings.

What (31) adds to a case is then 0 * sig(s)^1, a zero for every finite s: it changes no sum but a
sum -0, whose sign it may turn. sig(x)^1 is x, exactly. sig(x)^0 is *not* sgn(x), exactly: all
kernels of the power round there. (40) with `sign` has other bits than the C with gamma = 0.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca

from codegen.law import GAINS, SAMPLE_TIME, SCALES, SIGNALS, SX, Home, Input, LawFunction, Quantity
from codegen.presets import LAW_PRESETS, LawPreset

Sum: TypeAlias = Callable[..., SX]
"""An order in which three or more terms are added."""

LARGEST = Input("largest", Home.CONSTANT, "", "the largest finite number")
INVERSE_SIGMA = Input("inverse_sigma", Home.GAIN, "kg m^2", "1/sigma of the ultralocal model (60)")
SIGMA = Input("sigma", Home.GAIN, "1/(kg m^2)", "sigma = 1/Mbar, rounded")

E, ED = SIGNALS["position_error"].symbol, SIGNALS["velocity_error"].symbol
QDD_D, LAST_QDD = (SIGNALS[n].symbol for n in ("reference_acceleration", "last_acceleration"))
LAST_TAU, INTEGRAL = SIGNALS["last_torque"].symbol, SIGNALS["sliding_integral"].symbol
MBAR, KD, KP, LAMBDA = (GAINS[n].symbol for n in ("inertia", "kd", "kp", "lambda"))
ALPHA, BETA, GAMMA = (GAINS[n].symbol for n in ("alpha", "beta", "gamma"))

_DECLARED = (
    *GAINS.values(),
    *SCALES.values(),
    *SIGNALS.values(),
    SAMPLE_TIME,
    LARGEST,
    INVERSE_SIGMA,
    SIGMA,
)


# --- Sums, signs and powers --------------------------------------------------------------------


def left_to_right(*terms: SX) -> SX:
    """(a + b) + c: as a reader, or a compiler of C, takes a printed sum."""
    return functools.reduce(operator.add, terms)


def grouped(first: SX, *others: SX) -> SX:
    """a + (b + c): as the inclusive law adds."""
    return first + left_to_right(*others)


def sign(x: SX) -> SX:
    """sgn(x), exactly: no x but 0 times the largest number, twice, stays below 1."""
    return ca.fmax(-1, ca.fmin(1, x * LARGEST.symbol * LARGEST.symbol))


def sig(x: SX, exponent: SX) -> SX:
    """sig(x)^a = |x|^a sgn(x), which the printer makes one call of the C's power function."""
    return ca.sign(x) * ca.fabs(x) ** exponent


# --- The laws ----------------------------------------------------------------------------------


def law_function(name: str, meaning: str, *quantities: Quantity) -> LawFunction:
    """A law of named quantities, whose inputs are those that they are made from."""
    used = {s.name() for s in ca.symvar(ca.vertcat(*(q.expression for q in quantities)))}
    inputs = tuple(i for i in _DECLARED if i.name in used)
    return LawFunction(name, meaning, inputs, quantities)


def torque(equation: str, expression: SX) -> Quantity:
    """tau, before the limit of the drive."""
    return Quantity("torque", equation, "N m", "tau", expression)


def _with_sliding_variable(
    name: str, equation: str, meaning: str, correction: Callable[[SX], SX], add: Sum
) -> LawFunction:
    """Linear error dynamics (7) corrected by a function of s: what (39), (40) and (41) share."""
    damper, spring = KD * ED, KP * E
    s = ED + INTEGRAL
    u = add(QDD_D, damper, spring) + correction(s)
    return law_function(
        name,
        meaning,
        Quantity("damper", "(7)", "rad/s^2", "KD ed", damper),
        Quantity("spring", "(7)", "rad/s^2", "KP e", spring),
        Quantity("s", "(26)", "rad/s", "sliding variable", s),
        Quantity("u", equation, "rad/s^2", "acceleration asked for", u),
        torque(equation, add(MBAR * u, LAST_TAU, -(MBAR * LAST_QDD))),
        Quantity(
            "next_sliding_integral",
            "(26)",
            "rad/s",
            "s - ed at t+L",
            INTEGRAL + SAMPLE_TIME.symbol * (damper + spring),
        ),
    )


def hsia(add: Sum = grouped) -> LawFunction:
    """(9)(10): tau = Mbar u_h + tau(t-L) - Mbar qdd(t-L), u_h = qdd_d + KD ed + KP e."""
    u_h = add(QDD_D, KD * ED, KP * E)
    return law_function(
        "hsia",
        "Hsia's time delay control.",
        Quantity("u_h", "(10)", "rad/s^2", "acceleration asked for", u_h),
        torque("(9)", add(MBAR * u_h, LAST_TAU, -(MBAR * LAST_QDD))),
    )


def jin(add: Sum = grouped) -> LawFunction:
    """(39): Hsia's law and lambda s."""
    meaning = "Jin's enhanced time delay control."
    return _with_sliding_variable("jin", "(39)", meaning, lambda s: LAMBDA * s, add)


def sliding_mode(add: Sum = grouped, sgn: Callable[[SX], SX] | None = None) -> LawFunction:
    """(40): Hsia's law and lambda sgn(s).

    Args:
        add: the order of the sums.
        sgn: by default the power function at the exponent gamma = 0, which rounds; `sign` doesn't.
    """
    switched = sgn or (lambda s: sig(s, GAMMA))
    meaning = "Time delay estimation with sliding mode."
    return _with_sliding_variable(
        "sliding_mode", "(40)", meaning, lambda s: LAMBDA * switched(s), add
    )


def terminal_sliding(add: Sum = grouped) -> LawFunction:
    """(41): Hsia's law and lambda sig(s)^gamma."""
    meaning = "Jin's terminal sliding mode with time delay estimation."
    return _with_sliding_variable(
        "terminal_sliding", "(41)", meaning, lambda s: LAMBDA * sig(s, GAMMA), add
    )


def nonlinear_ded(add: Sum = grouped) -> LawFunction:
    """(24): tau = Mbar u_n + tau(t-L) - Mbar qdd(t-L) with u_n of (23)."""
    u_n = add(QDD_D, KD * sig(ED, ALPHA), KP * sig(E, BETA))
    return law_function(
        "nonlinear_ded",
        "Time delay control with nonlinear error dynamics, not corrected.",
        Quantity("u_n", "(23)", "rad/s^2", "acceleration asked for", u_n),
        torque("(24)", add(MBAR * u_n, LAST_TAU, -(MBAR * LAST_QDD))),
    )


def model_free(add: Sum = grouped) -> LawFunction:
    """(61) with nu = 2, KI = 0, the gain 1/sigma = Mbar multiplied into the bracket.

    phi estimates F of (60) from one sample ago: phi/sigma = qdd(t-L)/sigma - tau(t-L).
    """
    gain = INVERSE_SIGMA.symbol
    phi = gain * LAST_QDD - LAST_TAU
    asked = add(QDD_D, KD * ED, KP * E)
    return law_function(
        "model_free",
        "Model-free control by Fliess and Join.",
        Quantity("phi_over_sigma", "(60)", "N m", "phi/sigma", phi),
        torque("(61)", gain * asked - phi),
    )


def model_free_as_printed() -> LawFunction:
    """(61) with nu = 2, KI = 0, term by term: tau = -(phi - qdd_d - KD ed - KP e)/sigma."""
    phi = LAST_QDD - SIGMA.symbol * LAST_TAU
    return law_function(
        "model_free",
        "Model-free control by Fliess and Join.",
        Quantity("phi", "(60)", "rad/s^2", "F estimated at t-L", phi),
        torque("(61)", -(phi - QDD_D - KD * ED - KP * E) / SIGMA.symbol),
    )


def errors() -> LawFunction:
    """e, ed and qdd(t-L) from counts by plain differences, as in section IV."""
    signal = {name: i.symbol for name, i in SIGNALS.items()}
    scale = {name: i.symbol for name, i in SCALES.items()}
    velocity = signal["displacement"] * scale["velocity"]
    acceleration = signal["displacement_change"] * scale["acceleration"]
    return law_function(
        "errors",
        "Counts to errors.",
        Quantity("position_error", "(7)", "rad", "e", signal["error_q8"] * scale["position"]),
        Quantity("velocity_error", "(7)", "rad/s", "ed", signal["reference_velocity"] - velocity),
        Quantity("last_acceleration", "(6)", "rad/s^2", "qdd(t-L)", acceleration),
    )


# --- The cases ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Rounding:
    """The same law in other floats: equal in algebra, not in bits."""

    name: str
    law: LawFunction


@dataclass(frozen=True)
class Case:
    """A special case and the inclusive law's gains that make it.

    Attributes:
        name: an identifier.
        equation: the paper's.
        preset: whose gains the inclusive C flies with.
        law: written by itself, with the inclusive law's order of sums.
        roundings: the same law in other orders.
        remark: what its equality means, where that isn't plain.
    """

    name: str
    equation: str
    preset: LawPreset
    law: LawFunction
    roundings: tuple[Rounding, ...]
    remark: str = ""


PRINTED = "the order as printed"


def _case(name: str, law: Callable[..., LawFunction], *others: Rounding, remark: str = "") -> Case:
    preset = LAW_PRESETS[name]
    printed = Rounding(PRINTED, law(left_to_right))
    return Case(name, preset.equation, preset, law(), (printed, *others), remark)


CASES = (
    _case("hsia", hsia),
    _case("jin", jin),
    _case(
        "sliding-mode",
        sliding_mode,
        Rounding("sgn(s), exactly", sliding_mode(sgn=sign)),
        remark="equal with sgn(s) as the C has it, sig(s)^0 by its power function, which rounds; "
        "an exact sgn(s) has other bits.",
    ),
    _case("terminal-sliding", terminal_sliding),
    _case("nonlinear-ded", nonlinear_ded),
    Case(
        "model-free",
        "(60)-(62)",
        LAW_PRESETS["hsia"],
        model_free(),
        (Rounding(PRINTED, model_free_as_printed()),),
        "equal with the gain 1/sigma = Mbar multiplied into the bracket of (61); sigma = 1/Mbar "
        "is a rounded number, and dividing by it rounds again.",
    ),
)
