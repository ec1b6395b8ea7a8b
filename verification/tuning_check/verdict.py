"""When a gain set is unsafe, when it is safe with a reservation, and what to change.

Every rule and every threshold stands here. Unsafe is what does not bring the error back, what is
unstable in samples, and what a run shows to shake or to live on the drives' limits. A reservation
is what works but should be known. Where neither is said nothing that was looked at is wrong; what
could not be looked at is told beside it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from fractions import Fraction

from plant.tuning.procedure import VIBRATION_LIMIT
from plant.tuning.rig import SATURATED_SHARE
from verification.claim.flown import LOST_DEG, VIBRATING
from verification.error_dynamics.classes import Kind
from verification.error_dynamics.model import show
from verification.evidence import Evidence
from verification.sampled_stability.intervals import (
    Interval,
    Margin,
    containing,
    stable_intervals,
)
from verification.sampled_stability.loop import Loop
from verification.tuning_check.flight import Flight, JointFlown
from verification.tuning_check.joint import Noise, Sampled, Specified
from verification.tuning_check.robot import Eigenvalues

LEAST_MARGIN = 1.5
"""To an end of the interval: links that are 30 % lighter than in the model (the least that
`make autotune` trains on) raise Mbar/M by a factor of 1/0.7 = 1.43."""
LOUD = 0.1
"""Of the torque limit, by one count of the encoder: a tenth of the drive goes into noise."""
DROWNED = 0.5
"""Likewise: then the torque can jump by the whole limit from one tick to the next."""
RINGING = 0.25
"""Overshoot of a half-turn: what a linear joint with a damping ratio of 0.4 does."""
_HALVINGS = 10
"""So often is the sample time halved in search of a stable loop."""


class Severity(IntEnum):
    """How bad a finding is; a gain set is as bad as its worst."""

    SAFE = 0
    RESERVATION = 1
    UNSAFE = 2

    @property
    def words(self) -> str:
        """The verdict in plain words."""
        return ("safe", "safe, but", "unsafe")[self]


@dataclass(frozen=True)
class Finding:
    """Something that speaks against a gain set.

    Attributes:
        severity: how much.
        what: what is wrong, in a few words that follow "unsafe: " and "safe, but ".
        says: the same with its numbers.
        fix: what to change, with numbers where they are known; empty where nothing need be.
        evidence: what it rests on; None for a rule of thumb or plain arithmetic.
    """

    severity: Severity
    what: str
    says: str
    fix: str
    evidence: Evidence | None = None


def findings(
    joint: Specified, eigenvalues: Eigenvalues | None, flown: JointFlown | None, *, flexible: bool
) -> tuple[Finding, ...]:
    """Everything against a joint's gains, the worst first.

    Args:
        joint: as specified.
        eigenvalues: of the robot's M^-1 Mbar; None where they are not known.
        flown: what a run showed; None without one.
        flexible: whether the plant's joints are: the intervals are of rigid ones, and judge
            nothing else.
    """
    found = (
        *_error_dynamics(joint),
        *_interval(joint.sampled, None if flexible else eigenvalues),
        *_noise(joint.noise),
        *(() if flown is None else of_run(flown)),
    )
    return tuple(sorted(found, key=lambda each: -each.severity))


def worst(found: Iterable[Finding]) -> Severity:
    """Of the findings."""
    return max((each.severity for each in found), default=Severity.SAFE)


def sentence(severity: Severity, reasons: Sequence[str]) -> str:
    """A verdict in plain words."""
    separator = ": " if severity is Severity.UNSAFE else " "
    return severity.words + (separator + ", ".join(reasons) if reasons else "")


def of_flight(flight: Flight) -> tuple[Finding, ...]:
    """A run that did not get to its end speaks against all joints."""
    if flight.failure is None:
        return ()
    says = f"the run ended early: {flight.failure}"
    return (Finding(Severity.UNSAFE, "does not fly", says, "", Evidence.MEASURED),)


# --- The rules ---------------------------------------------------------------------------------


def _error_dynamics(joint: Specified) -> Iterator[Finding]:
    if joint.no_dynamics is not None:
        what = "nothing brings the error back"
        yield Finding(Severity.UNSAFE, what, joint.no_dynamics, "write KD > 0 and KP > 0")
    if joint.dynamics is None:
        return
    kind, alpha = joint.dynamics.kind, joint.joint.alpha
    if not kind.converges:
        what = "the error stays"
        yield Finding(Severity.UNSAFE, what, joint.dynamics.reason, "write exponents above 0")
    elif kind is Kind.ASYMPTOTIC:
        yield Finding(
            Severity.RESERVATION,
            "small errors fade slowly",
            f"small errors fade slower than any exponential: {joint.dynamics.reason}",
            "write alpha <= 1 and beta <= alpha",
        )
    elif not kind.finite and alpha < 1:
        partner = alpha / (2 - alpha)
        yield Finding(
            Severity.RESERVATION,
            "not finite-time",
            f"not finite-time although alpha < 1: beta = {show(joint.joint.beta)} is not below "
            "alpha",
            f'write beta = "finite-time", which is {show(partner)}',
        )
    overshoot = joint.dynamics.overshoot_per_half_turn
    if overshoot is not None and overshoot[0] > RINGING:
        node = joint.dynamics.kd_star
        yield Finding(
            Severity.RESERVATION,
            "rings",
            f"the error overshoots by {overshoot[1]:.0%} at each half-turn",
            "raise KD" + (f"; from {node[1]:.4g} on there is no overshoot" if node else ""),
        )


def _interval(sampled: Sampled, eigenvalues: Eigenvalues | None) -> Iterator[Finding]:
    if not sampled.intervals:
        yield Finding(
            Severity.UNSAFE,
            "no Mbar is stable in samples",
            "no Mbar makes the sampled linear law stable at this sample time and delay",
            _stabler(sampled.loop),
            Evidence.PROVED if sampled.proved else None,
        )
        return
    if eigenvalues is None:
        return
    low, high = map(Fraction, eigenvalues.sampled)
    if containing(sampled.intervals, low, high) is None:
        yield Finding(
            Severity.UNSAFE,
            "unstable in samples",
            f"M^-1 Mbar has eigenvalues from {float(low):.3g} to {float(high):.3g} in postures of "
            f"this robot; the sampled law is stable {_where(sampled.intervals)}",
            _into(sampled, low, high),
            # A single posture would be a proof, but its eigenvalue was found in rounded numbers.
            Evidence.SAMPLED,
        )
        return
    yield from _margins(sampled, eigenvalues)
    if containing(sampled.at_one_count, low, high) is None:
        stable = _where(sampled.at_one_count)
        yield Finding(
            Severity.RESERVATION,
            "may chatter",
            "where errors are of one count the law is as steep as a linear one that is stable "
            f"{stable}, not at all eigenvalues of M^-1 Mbar, {float(low):.3g} to {float(high):.3g} "
            "(rule of thumb)",
            "raise alpha, beta or gamma, lower Mbar or lambda, or take a finer encoder",
        )


def _margins(sampled: Sampled, eigenvalues: Eigenvalues) -> Iterator[Finding]:
    """Of eigenvalues whose samples are inside."""
    margin = margin_of(sampled, eigenvalues)
    if margin is None:
        yield Finding(
            Severity.RESERVATION,
            "not proved in every posture",
            "the certified bounds of the eigenvalues cross an end of the stable interval, all "
            "samples are inside",
            _into(sampled, eigenvalues.low, eigenvalues.high),
        )
        return
    room = {"upper": float(margin.up), "lower": 1.0 / float(margin.down)}
    end = min(room, key=room.__getitem__)
    if room[end] < LEAST_MARGIN:
        yield Finding(
            Severity.RESERVATION,
            "near an end of the stable interval",
            f"only a factor of {room[end]:.3g} to the {end} end of the stable interval, less than "
            f"{LEAST_MARGIN:g}",
            _into(sampled, eigenvalues.low, eigenvalues.high),
            eigenvalues.evidence,
        )


def margin_of(sampled: Sampled, eigenvalues: Eigenvalues) -> Margin | None:
    """To both ends of the interval; None where not all eigenvalues are inside."""
    inside = containing(sampled.intervals, eigenvalues.low, eigenvalues.high)
    return None if inside is None else inside.margin(eigenvalues.low, eigenvalues.high)


def _noise(noise: Noise) -> Iterator[Finding]:
    if noise.share >= LOUD:
        yield Finding(
            Severity.UNSAFE if noise.share >= DROWNED else Severity.RESERVATION,
            "encoder noise",
            f"one encoder count is {noise.worst_Nm:.3g} N m of torque, {noise.share:.0%} of the "
            "limit",
            f"multiply Mbar by {LOUD / noise.share:.2g}, or take a finer encoder or a longer "
            "sample time",
        )


def of_run(flown: JointFlown) -> Iterator[Finding]:
    """What a run shows against a joint; what cures it is looked for by flying again."""

    def measured(severity: Severity, what: str, says: str) -> Finding:
        return Finding(severity, what, says, "", Evidence.MEASURED)

    if flown.peak_deg > LOST_DEG:
        says = f"the run loses its reference: an error of {flown.peak_deg:.3g} deg"
        yield measured(Severity.UNSAFE, "loses the reference", says)
    if flown.saturated > SATURATED_SHARE:
        says = f"the torque is at its limit in {flown.saturated:.1%} of the ticks"
        yield measured(Severity.UNSAFE, "at the torque limit", says)
    if flown.torque_step > VIBRATING:
        says = f"the torque changes by {flown.torque_step:.0%} of its limit from tick to tick (RMS)"
        yield measured(Severity.UNSAFE, "vibrates hard", says)
    elif flown.vibration > VIBRATION_LIMIT:
        says = (
            f"audible torque steps have {flown.vibration:.3g} times the power that encoder counts "
            f"explain, more than {VIBRATION_LIMIT:g}"
        )
        yield measured(Severity.RESERVATION, "vibrates", says)


# --- What to change ----------------------------------------------------------------------------


def _where(intervals: Sequence[Interval]) -> str:
    ranges = (f"({float(i.low):.4g}, {float(i.high):.4g})" for i in intervals)
    return "in " + " and ".join(ranges) if intervals else "nowhere"


def _into(sampled: Sampled, low: Fraction, high: Fraction) -> str:
    """By what to multiply Mbar so that both margins hold, or the same, as large as they can be."""
    interval = max(sampled.intervals, key=lambda i: float(i.high) - float(i.low))
    least, most = float(interval.low) / float(low), float(interval.high) / float(high)
    if least >= most:
        return (
            "no factor of Mbar brings all postures inside: lower KP/KD and lambda, or shorten the "
            "sample time"
        )
    roomy = LEAST_MARGIN * least, most / LEAST_MARGIN
    if roomy[0] > roomy[1]:
        return f"multiply Mbar by {(least * most) ** 0.5:.2g}, in the middle of the interval"
    if roomy[1] < 1.0:
        return f"multiply Mbar by at most {_down(roomy[1])}"
    return f"multiply Mbar by at least {roomy[0]:.3g}"


def _down(x: float) -> str:
    return f"{int(100 * x) / 100:.2f}" if x >= 0.1 else f"{x:.2g}"


def _stabler(loop: Loop) -> str:
    """The longest of the halved sample times for which there is a stable Mbar."""
    for halvings in range(1, _HALVINGS + 1):
        sample_time = loop.sample_time_s / 2**halvings
        shorter = replace(loop, sample_time_s=sample_time)
        if stable_intervals(shorter):
            return (
                f"shorten the sample time to {1e3 * float(sample_time):.3g} ms, or lower KD, KP "
                "and lambda"
            )
    return "give KD > 0 and KP > 0; lower lambda"
