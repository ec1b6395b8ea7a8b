"""All that is known of one joint's desired error dynamics, as one record."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal

from flint import arb

from verification.certificates.error_dynamics import check
from verification.certificates.error_dynamics.prove import (
    Certificate,
    NotProvedError,
    certificate,
)
from verification.error_dynamics.balls import Enclosure, ball, down, enclosure, precision, up
from verification.error_dynamics.classes import Approach, Kind, approach, classify
from verification.error_dynamics.model import (
    ErrorDynamicsError,
    Number,
    Parameters,
    number,
    parameters,
)
from verification.error_dynamics.motion import Motions
from verification.error_dynamics.phase_plane import (
    TERMS,
    PhasePlane,
    UnresolvedError,
    critical_damping,
    equilibrium,
)
from verification.error_dynamics.twisting import Twisting

RESOLUTION_RAD = Fraction(64, 10**7)
"""Of the paper's encoder at the joint: 8192 counts per turn of a motor with a gear of 120:1."""


@dataclass(frozen=True)
class Lyapunov:
    """A Lyapunov function, and what its decrease proves.

    Attributes:
        function: its formula.
        decrease: what is known of its derivative.
        proves: in plain words.
        kind: "proved" where the certificate was verified, else "hand proof".
        strict: whether it falls everywhere but at the origin.
        values: its numbers, as fractions in text.
        settling_time_bound_s: from e(0) = 1, ed(0) = 0; None where none follows.
        decay_rate_per_s: of the function, of the linear dynamics; None elsewhere.
        certificate: for the checker; None where there is none.
    """

    function: str
    decrease: str
    proves: str
    kind: Literal["proved", "hand proof"]
    strict: bool
    values: dict[str, str] = field(default_factory=dict)
    settling_time_bound_s: float | None = None
    decay_rate_per_s: float | None = None
    certificate: Certificate | None = None


@dataclass(frozen=True)
class ErrorDynamics:
    """One joint's desired error dynamics (17). Pairs are rigorous lower and upper bounds.

    Attributes:
        parameters: gains and exponents, exact.
        kind: how the error ends.
        reason: why, in plain words.
        evidence: "proved" where a verified certificate shows it, else "hand proof".
        equilibrium: what the origin looks like in the phase plane.
        kd_star: the damping gain from which on a homogeneous pair is a node.
        stiction_band_rad: a motion may end wherever |e| is at most this; None where it may not.
        settling_time_s: until e = 0, from e(0) = 1 rad, ed(0) = 0.
        start: e(0) in rad and ed(0) in rad/s.
        settling_time_from_start_s: until e = 0, from there.
        resolution_rad: of the encoder at the joint.
        time_to_resolution_s: until |e| is below the resolution for good, from the same start.
        overshoot_per_half_turn: |e| at a rest over |e| at the rest before.
        lyapunov: a Lyapunov function with what it proves.
        not_given: why a quantity above is None, by its name.
    """

    parameters: Parameters
    kind: Kind
    reason: str
    evidence: Literal["proved", "hand proof"]
    equilibrium: Approach | None
    kd_star: Enclosure | None
    stiction_band_rad: Enclosure | None
    settling_time_s: Enclosure | None
    start: tuple[Fraction, Fraction]
    settling_time_from_start_s: Enclosure | None
    resolution_rad: Fraction
    time_to_resolution_s: Enclosure | None
    overshoot_per_half_turn: Enclosure | None
    lyapunov: Lyapunov
    not_given: Mapping[str, str]

    def summary(self) -> dict[str, Any]:
        """The record for JSON, without the certificate."""
        lyapunov = {
            name: getattr(self.lyapunov, name)
            for name in Lyapunov.__dataclass_fields__
            if name != "certificate"
        }
        return {
            "parameters": {
                n: str(getattr(self.parameters, n)) for n in ("KD", "KP", "alpha", "beta")
            },
            "class": self.kind.value,
            "reason": self.reason,
            "kind": self.evidence,
            "converges": self.kind.converges,
            "equilibrium": self.equilibrium.value if self.equilibrium else None,
            "kd_star": self.kd_star,
            "stiction_band_rad": self.stiction_band_rad,
            "settling_time_s": self.settling_time_s,
            "start": {"e_rad": str(self.start[0]), "ed_rad_per_s": str(self.start[1])},
            "settling_time_from_start_s": self.settling_time_from_start_s,
            "resolution_rad": str(self.resolution_rad),
            "time_to_resolution_s": self.time_to_resolution_s,
            "overshoot_per_half_turn": self.overshoot_per_half_turn,
            "lyapunov": lyapunov,
            "not_given": dict(self.not_given),
        }


def analyse(
    KD: Number,
    KP: Number,
    alpha: Number,
    beta: Number,
    *,
    e0: Number = 1,
    ed0: Number = 0,
    resolution_rad: Number = RESOLUTION_RAD,
) -> ErrorDynamics:
    """Analyses edd + KD sig(ed)^alpha + KP sig(e)^beta = 0.

    Args:
        KD: damping gain, greater than 0; a number, or a decimal or fraction as text.
        KP: stiffness gain, greater than 0.
        alpha: exponent of the velocity error, at least 0.
        beta: exponent of the position error, at least 0, or "finite-time".
        e0: position error at the start, in rad.
        ed0: velocity error at the start, in rad/s.
        resolution_rad: of the encoder at the joint.

    Raises:
        ErrorDynamicsError: an argument is no number, or out of range.
    """
    p = parameters(KD, KP, alpha, beta)
    start = number("e0", e0), number("ed0", ed0)
    resolution = number("resolution", resolution_rad)
    for name, value in (("e0", start[0]), ("ed0", start[1])):
        if abs(value) > _LARGEST or 0 < abs(value) < 1 / _LARGEST:
            raise ErrorDynamicsError(f"{name}: expected 0, or from 1e-12 to 1e12; check its unit")
    if not 1 / _LARGEST <= resolution <= _LARGEST:
        raise ErrorDynamicsError(
            "resolution: expected from 1e-12 to 1e12 rad; the paper's encoder has 6.4e-6"
        )
    found = classify(p)
    lyapunov = _lyapunov(p, found.kind)
    figures = _figures(p, found.kind, start, resolution)
    return ErrorDynamics(
        parameters=p,
        kind=found.kind,
        reason=found.reason,
        evidence=lyapunov.kind,
        start=start,
        resolution_rad=resolution,
        lyapunov=lyapunov,
        **figures,
    )


_LARGEST = Fraction(10**12)
"""Of a start's numbers and their inverses."""

_NEVER_ZERO = "the error never is exactly zero"
_ELSEWHERE = "a motion need not end at the origin"
_OFF_THE_PAIR = (
    "it is not enclosed for exponents off the pair beta = alpha/(2 - alpha), whose motions are not "
    "the same curve at every size"
)
_ABSURD = 1e300
_TIMES = ("settling_time_s", "settling_time_from_start_s", "time_to_resolution_s")
_FROM_ONE = (Fraction(1), Fraction(0))


class _Figures:
    """Collects the quantitative fields of the record, and why one is missing."""

    def __init__(self) -> None:
        self.values: dict[str, Enclosure | Approach | None] = {
            "equilibrium": None,
            "kd_star": None,
            "stiction_band_rad": None,
            "overshoot_per_half_turn": None,
            **dict.fromkeys(_TIMES),
        }
        self.missing: dict[str, str] = {}

    def give(self, name: str, compute: Callable[[], arb]) -> None:
        try:
            value = compute()
        except UnresolvedError as error:
            self.miss(name, str(error))
            return
        if value.is_finite() and value.abs_upper() < _ABSURD:
            self.values[name] = enclosure(value)
        else:
            self.miss(name, "arithmetic of this precision does not enclose it")

    def miss(self, name: str, why: str) -> None:
        self.missing[name] = why


def _figures(
    p: Parameters, kind: Kind, start: tuple[Fraction, Fraction], resolution: Fraction
) -> dict[str, Any]:
    """The quantitative fields of the record."""
    figures = _Figures()
    figures.values["equilibrium"] = approach(p)
    with precision(terms=TERMS + 1):
        if p.homogeneous:
            _homogeneous(figures, p, kind, start, resolution)
        elif kind is Kind.SLIDING:
            _twisting(figures, p, start, resolution)
        else:
            for name in (*_TIMES, "overshoot_per_half_turn"):
                figures.miss(name, _OFF_THE_PAIR if kind.converges else _ELSEWHERE)
            if kind.converges and not kind.finite:
                for name in _TIMES[:2]:
                    figures.miss(name, _NEVER_ZERO)
            figures.miss("kd_star", "the exponents alone decide between node and focus")
        if kind is Kind.STICTION:
            band = ball(p.KD) / ball(p.KP)
            figures.give("stiction_band_rad", lambda: band ** (1 / ball(p.beta)))
    return {**figures.values, "not_given": figures.missing}


def _homogeneous(
    figures: _Figures,
    p: Parameters,
    kind: Kind,
    start: tuple[Fraction, Fraction],
    resolution: Fraction,
) -> None:
    figures.give("kd_star", lambda: critical_damping(p))
    try:
        figures.values["equilibrium"] = equilibrium(p)
        motions = Motions(PhasePlane.of(p))
    except UnresolvedError as error:
        for name in ("equilibrium", "overshoot_per_half_turn", *_TIMES):
            figures.miss(name, str(error))
        return
    figures.give("overshoot_per_half_turn", motions.overshoot)

    def settling(e: Fraction, ed: Fraction) -> arb:
        return motions.time_to_origin(motions.motion(e, ed)) if e or ed else arb(0)

    if kind.finite:
        figures.give("settling_time_s", lambda: settling(*_FROM_ONE))
        figures.give("settling_time_from_start_s", lambda: settling(*start))
    else:
        figures.miss("settling_time_s", _NEVER_ZERO)
        figures.miss("settling_time_from_start_s", _NEVER_ZERO)
    figures.give(
        "time_to_resolution_s",
        lambda: motions.time_to_band(motions.motion(*start), resolution) if any(start) else arb(0),
    )


def _twisting(
    figures: _Figures, p: Parameters, start: tuple[Fraction, Fraction], resolution: Fraction
) -> None:
    twisting = Twisting(p)
    figures.give("settling_time_s", lambda: twisting.time_to_origin(*_FROM_ONE))
    figures.give("settling_time_from_start_s", lambda: twisting.time_to_origin(*start))
    figures.give("time_to_resolution_s", lambda: twisting.time_to_band(*start, resolution))
    figures.give("overshoot_per_half_turn", lambda: ball(twisting.ratio))
    figures.miss("kd_star", "it is a focus at any gains")


# --- Lyapunov functions ------------------------------------------------------------------------


def _lyapunov(p: Parameters, kind: Kind) -> Lyapunov:
    """The strict function where there is a verified certificate, else the energy."""
    why = ""
    if p.homogeneous and p.alpha <= 1:
        try:
            made = certificate(p)
        except NotProvedError as error:
            why = f" (no strict function: {error})"
        else:
            gains = {name: getattr(p, name) for name in ("KD", "KP", "alpha", "beta")}
            wrong = next(check.complaints(made, gains), None)
            if wrong is None:
                return _quadratic(made) if p.linear else _homogeneous_function(made)
            why = f" (the checker refuses the strict function: {wrong})"
    return Lyapunov(
        function="V = ed^2/2 + KP |e|^(beta + 1)/(beta + 1)",
        decrease="V' = -KD |ed|^(alpha + 1)",
        proves=_ENERGY[kind] + why,
        kind="hand proof",
        strict=False,
    )


_EVERYWHERE = "that every motion ends at the origin (with LaSalle's principle), but no rate"
_ENERGY = {
    Kind.FINITE_TIME: _EVERYWHERE,
    Kind.EXPONENTIAL: _EVERYWHERE,
    Kind.ASYMPTOTIC: _EVERYWHERE,
    Kind.SLIDING: "that no motion grows; that it ends at the origin follows from its half-turns",
    Kind.STICTION: "that every motion stops, but not where",
    Kind.NOT_CONVERGENT: "that no motion grows, and nothing more",
}


def _quadratic(made: Certificate) -> Lyapunov:
    values = {name: str(made[name]) for name in ("d", "c", "error_factor_squared")}
    return Lyapunov(
        function="W = ed^2 + KP e^2 + d e ed",
        decrease="W' <= -c W",
        proves="|e(t)| <= sqrt(error_factor_squared) |e(0)| exp(-c t/2), from rest",
        kind="proved",
        strict=True,
        values=values,
        decay_rate_per_s=down(Fraction(values["c"])),
        certificate=made,
    )


def _homogeneous_function(made: Certificate) -> Lyapunov:
    values = {name: str(made[name]) for name in ("delta", "c")}
    return Lyapunov(
        function="W = (2V)^((3 - alpha)/2) + delta ((2 - alpha) KP)^(1 - alpha/2) e ed",
        decrease="W' <= -c W^(2/(3 - alpha))",
        proves="the error is zero at settling_time_bound_s at the latest, from e = 1 rad at rest; "
        "from any start at (3 - alpha)/((1 - alpha) c) W(0)^((1 - alpha)/(3 - alpha))",
        kind="proved",
        strict=True,
        values=values,
        settling_time_bound_s=up(Fraction(str(made["settling_time_bound_s"]))),
        certificate=made,
    )
