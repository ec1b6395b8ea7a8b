"""Bounds of s and of e of one joint while |eps| <= xi, from its gains.

The joint obeys sdot + lambda sig(s)^gamma = eps (32) and edd + KD sig(ed)^alpha + KP sig(e)^beta
= sdot (26). Hence |s| <= S = (xi/lambda)^(1/gamma) (38), and with z = ed - s,

    e' = z + s,    z' = -KD sig(z + s)^alpha - KP sig(e)^beta,

so that s, of which nothing but |s| <= S is used, disturbs e like an unknown velocity. On a pair
beta = alpha/(2 - alpha) the bound of |e| is C S^(2 - alpha), C of KD, KP and alpha alone. The loop
without correction has eps where sdot was: |e| <= C' xi^(1/beta). That holds for sdot too, of which
|sdot| <= xi + lambda S^gamma = 2 xi is known, so that |e| <= C' (2 xi)^(1/beta) with a correction
as well; it is the smaller bound where lambda is small.

The joints are decoupled, the time is continuous, and the bound xi of the TDE error is given.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal

from verification.certificates.error_bound import check
from verification.certificates.error_bound.prove import (
    FORMAT,
    Certificate,
    NotProvedError,
    bound_of_e,
    sliding,
)
from verification.error_dynamics.balls import up
from verification.error_dynamics.classes import classify
from verification.error_dynamics.model import (
    ErrorDynamicsError,
    Number,
    Parameters,
    number,
    parameters,
    show,
)

Scope = Literal["ultimate", "invariant"]
_EXPONENT_LARGEST = 100
_LARGEST = Fraction(10**9)


@dataclass(frozen=True)
class Bound:
    """A bound of |e|.

    Attributes:
        error_rad: rounded up.
        scope: "ultimate", which every motion gets below in finite time, and stays below if it
            begins at rest without error; or "invariant", the latter alone.
        kind: "proved" where the certificate was verified, else "hand proof".
    """

    error_rad: float
    scope: Scope
    kind: Literal["proved", "hand proof"]


@dataclass(frozen=True)
class ErrorBound:
    """What is known of s and e of a joint while its TDE error is bounded.

    Attributes:
        parameters: gains and exponents of the error dynamics, exact.
        lambda_: gain of the correction.
        gamma: its exponent.
        tde_error: xi, bound of |eps| in rad/s^2.
        sliding_bound_rad_per_s: of |s| (38), from s(0) = 0 on, rounded up; None where
            none is known.
        sliding_kind: "proved" where the certificate was verified, else "hand proof".
        by_sliding: bound of |e| from that of |s|.
        by_sliding_rate: bound of |e| from |sdot| <= 2 xi, of the loop with correction.
        uncorrected: bound of |e| of the loop without correction, lambda = 0, for the same xi.
        not_given: why a bound above is None, by its name.
        certificate: for the checker; None where there is none.
    """

    parameters: Parameters
    lambda_: Fraction
    gamma: Fraction
    tde_error: Fraction
    sliding_bound_rad_per_s: float | None
    sliding_kind: Literal["proved", "hand proof"] | None
    by_sliding: Bound | None
    by_sliding_rate: Bound | None
    uncorrected: Bound | None
    not_given: Mapping[str, str] = field(default_factory=dict)
    certificate: Certificate | None = None

    @property
    def corrected(self) -> Bound | None:
        """The smaller bound of |e| of the loop with correction."""
        found = [bound for bound in (self.by_sliding, self.by_sliding_rate) if bound is not None]
        return min(found, key=lambda bound: bound.error_rad, default=None)

    @property
    def error(self) -> Bound | None:
        """The bound of |e| of the loop with these gains."""
        return self.corrected if self.lambda_ else self.uncorrected

    @property
    def error_bound_rad(self) -> float | None:
        """Of the loop with these gains, rounded up; None where none is known: see `reason`."""
        return self.error.error_rad if self.error else None

    @property
    def corrected_rad(self) -> float | None:
        """Of the loop with correction, rounded up."""
        return self.corrected.error_rad if self.corrected else None

    @property
    def uncorrected_rad(self) -> float | None:
        """Of the loop without correction, for the same xi, rounded up."""
        return self.uncorrected.error_rad if self.uncorrected else None

    @property
    def reason(self) -> str:
        """Why there is no bound of |e|; empty where there is one."""
        if self.error is not None:
            return ""
        names = ("by_sliding", "by_sliding_rate") if self.lambda_ else ("uncorrected",)
        return "; ".join(dict.fromkeys(self.not_given[n] for n in names))

    def summary(self) -> dict[str, Any]:
        """The record for JSON, without the certificate."""
        p = self.parameters
        return {
            "parameters": {
                **{n: str(getattr(p, n)) for n in ("KD", "KP", "alpha", "beta")},
                "lambda": str(self.lambda_),
                "gamma": str(self.gamma),
            },
            "tde_error_rad_per_s2": str(self.tde_error),
            "sliding_bound_rad_per_s": self.sliding_bound_rad_per_s,
            "sliding_kind": self.sliding_kind,
            "error_bound_rad": self.error_bound_rad,
            "reason": self.reason,
            "by_sliding": self.by_sliding,
            "by_sliding_rate": self.by_sliding_rate,
            "uncorrected": self.uncorrected,
            "not_given": dict(self.not_given),
        }


def error_bound(
    KD: Number,
    KP: Number,
    alpha: Number,
    beta: Number,
    lambda_: Number,
    gamma: Number,
    *,
    tde_error: Number,
) -> ErrorBound:
    """Bounds |s| and |e| of one joint while |eps| <= tde_error.

    Args:
        KD: damping gain, greater than 0; a number, or a decimal or fraction as text.
        KP: stiffness gain, greater than 0.
        alpha: exponent of the velocity error, at least 0.
        beta: exponent of the position error, at least 0, or "finite-time".
        lambda_: gain of the correction, at least 0.
        gamma: exponent of the correction, at least 0.
        tde_error: xi, bound of the magnitude of the TDE error in rad/s^2, at least 0.

    Raises:
        ErrorDynamicsError: an argument is no number, or out of range.
    """
    p = parameters(KD, KP, alpha, beta)
    gain, exponent, xi = (
        number(name, value)
        for name, value in (("lambda", lambda_), ("gamma", gamma), ("tde-error", tde_error))
    )
    for name, value, unit in (("lambda", gain, ""), ("tde-error", xi, " rad/s^2")):
        if value and not 1 / _LARGEST <= value <= _LARGEST:
            raise ErrorDynamicsError(
                f"{name} = {show(value)}: expected 0, or from 1e-9 to 1e9{unit}"
            )
    if exponent and not Fraction(1, 1000) <= exponent <= _EXPONENT_LARGEST:
        raise ErrorDynamicsError(
            f"gamma = {show(exponent)}: expected 0, or from 1/1000 to {_EXPONENT_LARGEST}"
        )
    return _bound(p, gain, exponent, xi)


@functools.lru_cache(maxsize=256)
def _bound(p: Parameters, lambda_: Fraction, gamma: Fraction, xi: Fraction) -> ErrorBound:
    parts: dict[str, Any] = {}
    missing: dict[str, str] = {}
    at_rest = classify(p)
    zero = Bound(0.0, "ultimate", "hand proof") if at_rest.kind.converges else None
    none = None if zero else f"without TDE error too the error does not converge: {at_rest.reason}"
    s: float | None = None
    known: dict[str, Bound | None] = dict.fromkeys(("by_sliding", "by_sliding_rate", "uncorrected"))

    def give_zero(name: str) -> None:
        known[name] = zero
        if none:
            missing[name] = none

    if lambda_ == 0:
        missing["sliding"] = "without correction (lambda = 0) nothing pulls s back (27)"
        for name in ("by_sliding", "by_sliding_rate"):
            missing[name] = "there is no correction: lambda = 0"
    elif gamma == 0 and lambda_ <= xi:
        missing["sliding"] = (
            f"gamma = 0 holds s at 0 where lambda > xi (37): write lambda above {show(xi)}"
        )
        missing["by_sliding"] = "there is no bound of |s|"
    elif gamma == 0 or xi == 0:
        s = 0.0
        give_zero("by_sliding")
    else:
        _collect(parts, missing, "sliding", lambda: sliding(xi, lambda_, gamma))
        if "sliding" in parts:
            largest = Fraction(parts["sliding"]["at_most"])
            _collect(parts, missing, "by_sliding", lambda: bound_of_e(p, largest, of_velocity=True))
        else:
            missing["by_sliding"] = "there is no bound of |s|"
    if xi == 0:
        give_zero("uncorrected")
    else:
        _collect(parts, missing, "uncorrected", lambda: bound_of_e(p, xi, of_velocity=False))
    if lambda_ and gamma == 0:
        missing["by_sliding_rate"] = "a correction with gamma = 0 jumps"
    elif lambda_ and xi == 0:
        give_zero("by_sliding_rate")
    elif "sliding" in parts:
        _collect(
            parts, missing, "by_sliding_rate", lambda: bound_of_e(p, 2 * xi, of_velocity=False)
        )
    elif lambda_:
        missing["by_sliding_rate"] = "there is no bound of |s|"
    verified = _verified(p, lambda_, gamma, xi, parts, missing)
    if "sliding" in verified:
        s = up(Fraction(verified["sliding"]["at_most"]))
    for name in known:
        if name in verified:
            part = verified[name]
            known[name] = Bound(up(Fraction(part["bound"])), part["claim"], "proved")
    return ErrorBound(
        parameters=p,
        lambda_=lambda_,
        gamma=gamma,
        tde_error=xi,
        sliding_bound_rad_per_s=s,
        sliding_kind=None if s is None else "proved" if "sliding" in verified else "hand proof",
        **known,
        not_given=missing,
        certificate=_certificate(p, lambda_, gamma, xi, verified) if verified else None,
    )


def _collect(parts: dict[str, Any], missing: dict[str, str], name: str, make: Any) -> None:
    try:
        parts[name] = make()
    except NotProvedError as error:
        missing[name] = str(error)


def _certificate(
    p: Parameters, lambda_: Fraction, gamma: Fraction, xi: Fraction, parts: Mapping[str, Any]
) -> Certificate:
    return {"format": FORMAT, **_of(p, lambda_, gamma, xi), **parts}


def _of(p: Parameters, lambda_: Fraction, gamma: Fraction, xi: Fraction) -> dict[str, str]:
    gains = {name: str(getattr(p, name)) for name in ("KD", "KP", "alpha", "beta")}
    return {**gains, "lambda": str(lambda_), "gamma": str(gamma), "tde_error": str(xi)}


def _verified(
    p: Parameters,
    lambda_: Fraction,
    gamma: Fraction,
    xi: Fraction,
    parts: Mapping[str, Any],
    missing: dict[str, str],
) -> dict[str, Any]:
    """The parts that the checker accepts, one by one; the bounds of e need that of s."""
    gains = {name: Fraction(text) for name, text in _of(p, lambda_, gamma, xi).items()}
    good: dict[str, Any] = {}
    for name, part in parts.items():
        tried = {**({"sliding": good["sliding"]} if "sliding" in good else {}), name: part}
        wrong = next(check.complaints(_certificate(p, lambda_, gamma, xi, tried), gains), None)
        if wrong is None:
            good[name] = part
        else:
            missing[name] = f"the checker refuses it: {wrong}"
    return good
