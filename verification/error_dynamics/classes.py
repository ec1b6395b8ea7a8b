"""How the error ends, for any gains and exponents, with the argument by hand.

V = ed^2/2 + KP |e|^(beta + 1)/(beta + 1) falls by V' = -KD |ed|^(alpha + 1) (20)(21); where
alpha > 0 nothing but the origin stays at ed = 0, so that every motion ends there (LaSalle). How
fast follows from what is left of the dynamics near the origin:

- beta < alpha/(2 - alpha), or alpha >= 2: the damping is the smallest term. The motion turns around
  the origin with the stiffness alone, and per turn V loses a share of V^((alpha + 1)/2) per time:
  gone in finite time for alpha < 1, exponentially for alpha = 1, else as a power of the time.
- beta > alpha/(2 - alpha): the inertia is the smallest term, KD sig(ed)^alpha = -KP sig(e)^beta.
  The motion creeps along ed ~ -e^(beta/alpha): finite for beta < alpha, exponential for beta =
  alpha, else a power of the time.
- beta = alpha/(2 - alpha): all terms have the same size at every scale; the dynamics is homogeneous
  of a degree with the sign of alpha - 1.

Together: finite in time exactly for alpha < 1 and beta < alpha; not even exponential for alpha > 1
or beta > alpha, since V' >= -KD (2V)^((alpha + 1)/2) resp. the creeping motion is that slow.

With alpha = 0 the damping is Coulomb friction; a motion at rest stays where KP |e|^beta <= KD.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from verification.error_dynamics.model import Parameters, finite_time_beta, show


class Kind(Enum):
    """How the error ends; the value is the word for users and scripts."""

    FINITE_TIME = "finite-time"
    EXPONENTIAL = "exponential"
    ASYMPTOTIC = "asymptotic"
    SLIDING = "sliding"
    STICTION = "stiction"
    NOT_CONVERGENT = "not convergent"

    @property
    def converges(self) -> bool:
        """Whether every motion ends at the origin."""
        return self not in (Kind.STICTION, Kind.NOT_CONVERGENT)

    @property
    def finite(self) -> bool:
        """Whether it is there after a finite time."""
        return self in (Kind.FINITE_TIME, Kind.SLIDING)


class Approach(Enum):
    """What the origin looks like in the phase plane, near it."""

    NODE = "node"
    CRITICAL = "critical node"
    FOCUS = "focus"
    BAND = "band of equilibria"


@dataclass(frozen=True)
class Classification:
    """How the error ends, and why in plain words."""

    kind: Kind
    reason: str


def classify(parameters: Parameters) -> Classification:
    """How the error ends for any gains and exponents."""
    alpha, beta = parameters.alpha, parameters.beta
    if alpha == 0:
        return _coulomb(parameters)
    words = f"alpha = {show(alpha)}, beta = {show(beta)}: "
    if alpha < 1 and beta < alpha:
        pair = (
            "the pair beta = alpha/(2 - alpha) (34)(35)"
            if parameters.homogeneous
            else "finite in time although not the pair (34)(35), which is sufficient only"
        )
        reason = f"alpha < 1 and beta < alpha, so the error is exactly zero after a time; {pair}"
        return Classification(Kind.FINITE_TIME, words + reason)
    if alpha <= 1 and beta <= alpha:
        if parameters.linear:
            reason = "the linear error dynamics (7); the error never is exactly zero"
        elif alpha == 1:
            reason = "linear damping takes a share of the energy per time, so never all of it"
        else:
            reason = (
                "near zero the error creeps as KD sig(ed)^alpha = -KP sig(e)^alpha, by a share per "
                "time; (34) alone is not enough for finite time"
            )
        return Classification(Kind.EXPONENTIAL, words + reason)
    reason = (
        "alpha > 1, so the damping fades faster than the speed"
        if alpha > 1
        else "beta > alpha, so the stiffness fades faster than the damping"
    )
    return Classification(
        Kind.ASYMPTOTIC, words + f"{reason}; the error falls like a power of the time"
    )


def _coulomb(parameters: Parameters) -> Classification:
    """alpha = 0, in Filippov's sense."""
    if parameters.beta > 0:
        return Classification(
            Kind.STICTION,
            "alpha = 0 is Coulomb friction: in Filippov's sense the motion stops in finite time, "
            "but anywhere with |e| <= (KD/KP)^(1/beta), and stays there",
        )
    if parameters.KP > parameters.KD:
        return Classification(
            Kind.SLIDING,
            "alpha = beta = 0 with KP > KD is the twisting algorithm: each half-turn is "
            "(KP - KD)/(KP + KD) of the last, and a second-order sliding mode holds the error at "
            "zero after a finite time",
        )
    return Classification(
        Kind.NOT_CONVERGENT,
        "alpha = beta = 0 with KP <= KD: in Filippov's sense every error at rest is an "
        "equilibrium; write KP > KD, or exponents above 0",
    )


def approach(parameters: Parameters) -> Approach | None:
    """What the origin looks like, from the exponents alone; None for a homogeneous pair.

    Whichever term is the smallest near the origin decides: the damping (a focus, at any gains) or
    the inertia (a node, at any gains).
    """
    alpha, beta = parameters.alpha, parameters.beta
    if parameters.homogeneous:
        return None
    if alpha == 0:
        return Approach.FOCUS if classify(parameters).kind.converges else Approach.BAND
    return Approach.FOCUS if alpha >= 2 or beta < finite_time_beta(alpha) else Approach.NODE
