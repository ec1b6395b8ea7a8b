"""When a gain set is unsafe, when it is safe with a reservation, and what to change.

Every rule and every threshold stands here. Unsafe is what does not bring the error back, what is
unstable in samples, and what a run shows to shake or to live on the drives' limits. A reservation
is what works but should be known. Where neither is said nothing that was looked at is wrong; what
could not be looked at is told beside it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from fractions import Fraction

from plant.tuning.procedure import VIBRATION_LIMIT
from plant.tuning.rig import SATURATED_SHARE
from verification.claim.flown import LOST_DEG, VIBRATING
from verification.error_dynamics.classes import Kind
from verification.error_dynamics.model import show
from verification.evidence import Evidence
from verification.sampled_stability.intervals import Interval, Margin, containing
from verification.tuning_check.change import mbar_factor, shorter_sample_time, words
from verification.tuning_check.flight import Flight, JointFlown
from verification.tuning_check.joint import Noise, Sampled, Specified
from verification.tuning_check.robot import Eigenvalues

LEAST_MARGIN = 1.5
"""To an end of the interval, and flown: links that are 30 % lighter than in the model (the least
that `make autotune` trains on) raise Mbar/M by a factor of 1/0.7 = 1.43."""
LOUD = 0.1
"""Of the torque limit, by one count of the encoder: a tenth of the drive goes into noise."""
DROWNED = 0.5
"""Likewise: then the torque can jump by the whole limit from one tick to the next."""
RINGING = 0.25
"""Overshoot of a half-turn: what a linear joint with a damping ratio of 0.4 does."""


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


def of_gains(
    joint: Specified, eigenvalues: Eigenvalues | None, *, same_gains: bool = True
) -> Iterator[Finding]:
    """Everything against a joint's gains that needs no run.

    The eigenvalues are of rigid joints. Elasticity helps at neither end of the interval: at the
    lower one the loop swings slowly, and springs act as if they were rigid; at the upper one the
    loop feels less of the links than it would.

    Args:
        joint: as specified.
        eigenvalues: of the robot's M^-1 Mbar; None where they are not known.
        same_gains: whether all joints have the same KD, KP and lambda; else eigenvalues outside of
            an interval of one joint prove nothing, and only warn.
    """
    yield from _error_dynamics(joint)
    if not joint.sampled.intervals:
        yield Finding(
            Severity.UNSAFE,
            "no Mbar is stable in samples",
            "no Mbar makes the sampled linear law stable at this sample time and delay",
            shorter_sample_time(joint.sampled.loop),
            Evidence.PROVED if joint.sampled.proved else None,
        )
    elif eigenvalues is not None and not _inside(joint.sampled.intervals, eigenvalues):
        yield _outside(joint.sampled, eigenvalues, same_gains=same_gains)
    else:
        if eigenvalues is not None:
            yield from _margins(joint.sampled, eigenvalues)
        yield from _at_one_count(joint.sampled, eigenvalues)
    yield from _noise(joint.noise)


def by_severity(found: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings, the worst first."""
    return tuple(sorted(found, key=lambda each: -each.severity))


def worst(found: Iterable[Finding]) -> Severity:
    """Of the findings."""
    return max((each.severity for each in found), default=Severity.SAFE)


def sentence(severity: Severity, reasons: Sequence[str]) -> str:
    """A verdict in plain words."""
    separator = ": " if severity is Severity.UNSAFE else " "
    return severity.words + (separator + ", ".join(reasons) if reasons else "")


def of_joint(flight: Flight, joint: int) -> Iterator[Finding]:
    """What a run shows against a joint; one that did not get to its end speaks against all.

    What cures it is looked for by flying again.
    """
    if flight.failure is not None:
        says = f"the run ended early: {flight.failure}"
        yield Finding(Severity.UNSAFE, "does not fly", says, "", Evidence.MEASURED)
    else:
        yield from _of_run(flight.joints[joint])


# --- The rules ---------------------------------------------------------------------------------


def _error_dynamics(joint: Specified) -> Iterator[Finding]:
    if joint.no_dynamics is not None:
        what = "the error is not brought to zero"
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


def _inside(intervals: Sequence[Interval], eigenvalues: Eigenvalues) -> bool:
    """Whether all that were found are in one interval."""
    return containing(intervals, *map(Fraction, eigenvalues.sampled)) is not None


def _outside(sampled: Sampled, eigenvalues: Eigenvalues, *, same_gains: bool) -> Finding:
    low, high = eigenvalues.sampled
    return Finding(
        Severity.UNSAFE if same_gains else Severity.RESERVATION,
        "unstable in samples" if same_gains else "maybe unstable in samples",
        f"M^-1 Mbar has eigenvalues from {low:.3g} to {high:.3g} in postures of this robot; "
        f"the sampled law is stable in {_ranges(sampled.intervals)}",
        words(mbar_factor(sampled, low, high, LEAST_MARGIN)),
        # A single posture would be a proof, but its eigenvalue was found in rounded numbers.
        Evidence.SAMPLED,
    )


def _margins(sampled: Sampled, eigenvalues: Eigenvalues) -> Iterator[Finding]:
    margin = margin_of(sampled, eigenvalues)
    bounds = float(eigenvalues.low), float(eigenvalues.high)
    fix = words(mbar_factor(sampled, *bounds, LEAST_MARGIN))
    if margin is None:
        yield Finding(
            Severity.RESERVATION,
            "not proved in every posture",
            "the certified bounds of the eigenvalues cross an end of the stable interval, all "
            "samples are inside",
            fix,
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
            fix,
            eigenvalues.evidence,
        )


def _at_one_count(sampled: Sampled, eigenvalues: Eigenvalues | None) -> Iterator[Finding]:
    stable = sampled.at_one_count
    if not stable or (eigenvalues is not None and not _inside(stable, eigenvalues)):
        where = f"Mbar/M in {_ranges(stable)} only" if stable else "no Mbar"
        yield Finding(
            Severity.RESERVATION,
            "may chatter",
            "where errors are of one encoder count the law is as steep as a linear one that is "
            f"stable for {where} (rule of thumb)",
            "raise alpha, beta or gamma, lower Mbar or lambda, or take a finer encoder",
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


def _of_run(flown: JointFlown) -> Iterator[Finding]:
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


def of_margin(factor: Fraction, flown: Iterable[Finding]) -> Iterator[Finding]:
    """What a run with another Mbar shows against a joint, whose own run is not unsafe.

    Args:
        factor: by which Mbar was multiplied.
        flown: what that run showed.
    """
    unsafe = dict.fromkeys(f.what for f in flown if f.severity is Severity.UNSAFE)
    if unsafe:
        says = f"with Mbar times {float(factor):.2g} a run is unsafe: {', '.join(unsafe)}"
        what = "near too large an Mbar" if factor > 1 else "near too small an Mbar"
        yield Finding(Severity.RESERVATION, what, says, "", Evidence.MEASURED)


def _ranges(intervals: Sequence[Interval]) -> str:
    return " and ".join(f"({float(i.low):.4g}, {float(i.high):.4g})" for i in intervals)
