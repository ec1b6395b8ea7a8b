"""A gain set's check for people at a terminal, and as plain data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from verification.error_dynamics.balls import Enclosure
from verification.error_dynamics.command import ENDS, LOOKS
from verification.evidence import Evidence, plain
from verification.sampled_stability.intervals import Interval, Margin
from verification.tuning_check.check import JointCheck, TuningCheck, same_gains
from verification.tuning_check.flight import JointFlown
from verification.tuning_check.remedy import Remedy
from verification.tuning_check.robot import Eigenvalues
from verification.tuning_check.verdict import Finding, Severity, margin_of, sentence
from verification.workspace.certify import LIMIT

COLOURS = {Severity.SAFE: "green", Severity.RESERVATION: "yellow", Severity.UNSAFE: "red"}
_THOUSAND = 1000
_SCOPES = {"ultimate": "", "invariant": ", from rest"}
_ENCLOSED = "enclosed"
MEANING = (
    "The intervals are of the linear law (alpha = beta = gamma = 1) on rigid joints with M(q) "
    "frozen; the eigenvalues of M^-1 Mbar decide where all joints have the same KD, KP and lambda.",
    "The bound of |e| is of the law in continuous time (32), for the largest |eps| of this run, "
    "which has the encoder's counts in it; another motion has another.",
)


# --- As plain data -----------------------------------------------------------------------------


def figures(checked: TuningCheck) -> dict[str, Any]:
    """The check for JSON; exact numbers as text."""
    found = checked.eigenvalues
    return {
        "controller": checked.controller.name,
        "plant": checked.plant,
        "verdict": headline(checked),
        "severity": checked.severity.words,
        "safe": checked.severity is not Severity.UNSAFE,
        "sample_time_s": str(checked.controller.sample_time),
        "acceleration": checked.controller.options.acceleration,
        "compute_delay": checked.timing.compute_delay,
        "torque_delay": str(checked.timing.torque_delay),
        "flexible": checked.flexible,
        "same_gains": _same(checked),
        "eigenvalues": found
        and {
            "low": float(found.low),
            "high": float(found.high),
            "sampled": found.sampled,
            "evidence": found.evidence.value,
            "margin_33": found.margin_33,
        },
        "failure": checked.flight.failure if checked.flight else None,
        "joints": [_joint(joint, checked) for joint in checked.joints],
        "remedy": checked.remedy
        and {"says": checked.remedy.says, "changes": _changes(checked.remedy)},
        "gaps": checked.gaps,
        "meaning": " ".join(MEANING),
    }


def _joint(checked: JointCheck, whole: TuningCheck) -> dict[str, Any]:
    specified, bound = checked.specified, checked.bound
    dynamics, sampled, noise = specified.dynamics, specified.sampled, specified.noise
    gains = ("inertia", "kd", "kp", "lambda_", "alpha", "beta", "gamma")
    margin = margin_of_joint(checked, whole)
    count = specified.resolution_rad
    return {
        "joint": checked.name,
        "verdict": checked.verdict,
        "severity": checked.severity.words,
        "findings": [_finding(each) for each in checked.findings],
        "gains": {name.rstrip("_"): str(getattr(specified.joint, name)) for name in gains},
        "class": dynamics.kind.value if dynamics else None,
        "class_evidence": dynamics.evidence if dynamics else None,
        "reason": dynamics.reason if dynamics else specified.no_dynamics,
        "equilibrium": dynamics.equilibrium.value if dynamics and dynamics.equilibrium else None,
        "kd_star": dynamics and dynamics.kd_star,
        "overshoot_per_half_turn": dynamics and dynamics.overshoot_per_half_turn,
        "settling_time_s": dynamics and dynamics.settling_time_s,
        "time_to_resolution_s": dynamics and dynamics.time_to_resolution_s,
        "resolution_rad": count,
        "not_given": dict(dynamics.not_given) if dynamics else {},
        "intervals": _intervals(sampled.intervals),
        "intervals_evidence": Evidence.PROVED.value if sampled.proved else None,
        "intervals_at_one_count": _intervals(sampled.at_one_count),
        "margin": margin and {"down": float(margin.down), "up": float(margin.up)},
        "noise": {
            "worst_Nm": noise.worst_Nm,
            "rms_Nm": noise.rms_Nm,
            "worst_step_Nm": noise.worst_step_Nm,
            "rms_step_Nm": noise.rms_step_Nm,
            "limit_Nm": noise.limit_Nm,
            "share": noise.share,
        },
        "flown": plain(checked.flown) if checked.flown else None,
        "bound": bound
        and {
            "tde_error_rad_per_s2": checked.flown.tde_error if checked.flown else None,
            "sliding_rad_per_s": bound.sliding_bound_rad_per_s,
            "error_rad": bound.error_bound_rad,
            "error_deg": _degrees(bound.error_bound_rad),
            "error_counts": _over(bound.error_bound_rad, count),
            "reason": bound.reason,
            "scope": bound.error and bound.error.scope,
            "evidence": bound.error and f"{bound.error.kind}, given the measured TDE error",
        },
    }


def _same(checked: TuningCheck) -> bool:
    return same_gains([joint.specified for joint in checked.joints])


def _changes(found: Remedy) -> dict[str, list[float]] | None:
    if found.changes is None:
        return None
    return {key: [float(x) for x in values] for key, values in found.changes.items()}


def margin_of_joint(checked: JointCheck, whole: TuningCheck) -> Margin | None:
    """To both ends of the joint's interval; None where nothing is known or not all is inside."""
    if whole.eigenvalues is None:
        return None
    return margin_of(checked.specified.sampled, whole.eigenvalues)


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "severity": finding.severity.words,
        "what": finding.what,
        "says": finding.says,
        "fix": finding.fix,
        "evidence": finding.evidence.value if finding.evidence else None,
    }


def _intervals(intervals: Sequence[Interval]) -> list[list[float]]:
    return [[float(i.low), float(i.high)] for i in intervals]


def _degrees(rad: float | None) -> float | None:
    return None if rad is None else math.degrees(rad)


def _over(value: float | None, unit: float) -> float | None:
    return None if value is None else value / unit


# --- In words ----------------------------------------------------------------------------------


def headline(checked: TuningCheck) -> str:
    """The verdict in one line."""
    joints: dict[str, dict[str, None]] = {}
    for finding, names in grouped(checked):
        if finding.severity is checked.severity:
            joints.setdefault(finding.what, {}).update(dict.fromkeys(names))
    reasons = [f"{what}{_at(tuple(names), checked)}" for what, names in joints.items()]
    return sentence(checked.severity, reasons) + ("" if reasons else _limits(checked))


def _limits(checked: TuningCheck) -> str:
    """How far a verdict goes that has nothing against the gains."""
    if checked.plant is None:
        return ", as far as the specification alone says"
    if checked.eigenvalues is None:
        return ", as far as could be looked at"
    return ", as sampled" if checked.eigenvalues.evidence is Evidence.SAMPLED else ""


def grouped(checked: TuningCheck) -> list[tuple[Finding, tuple[str, ...]]]:
    """Each finding once, the worst first, with the joints that it is of."""
    joints: dict[Finding, list[str]] = {}
    for joint in checked.joints:
        for finding in joint.findings:
            joints.setdefault(finding, []).append(joint.name)
    ordered = sorted(joints.items(), key=lambda item: -item[0].severity)
    return [(finding, tuple(names)) for finding, names in ordered]


def _at(names: Sequence[str], checked: TuningCheck) -> str:
    return "" if len(names) == len(checked.joints) else f" ({', '.join(names)})"


def error_ends(joint: JointCheck) -> str:
    """How the error ends, in words."""
    dynamics = joint.specified.dynamics
    return ENDS[dynamics.kind] if dynamics else (joint.specified.no_dynamics or "")


def looks(joint: JointCheck) -> str:
    """What the origin looks like, in words."""
    dynamics = joint.specified.dynamics
    return LOOKS[dynamics.equilibrium] if dynamics and dynamics.equilibrium else "–"


def settling(joint: JointCheck) -> str:
    """Until the error is zero, from 1 rad at rest."""
    dynamics = joint.specified.dynamics
    if dynamics is not None and not dynamics.kind.finite:
        return "never"
    return seconds(dynamics.settling_time_s if dynamics else None)


def settling_to_a_count(joint: JointCheck) -> str:
    """Until it is below the encoder's resolution for good."""
    dynamics = joint.specified.dynamics
    return seconds(dynamics.time_to_resolution_s if dynamics else None)


def seconds(value: Enclosure | None) -> str:
    """A time, of which both ends of the enclosure agree in all digits shown, or both ends."""
    if value is None:
        return "–"
    low, high = (f"{end:.4g}" for end in value)
    return f"{low} s" if low == high else f"{low} to {high} s"


def stable_in(intervals: Sequence[Interval]) -> str:
    """Intervals of Mbar/M in a few digits."""
    shown = (f"{float(i.low):.4g} to {float(i.high):.4g}" for i in intervals)
    return " and ".join(shown) or "none"


def divided_and_multiplied(margin: Margin | None) -> str:
    """By what Mbar may be divided and multiplied; rounded inwards."""
    if margin is None:
        return "not all are inside"
    return f"÷ {_floor(1 / float(margin.down))}, × {_floor(float(margin.up))}"


def _floor(x: float) -> str:
    unit = 10.0 ** (math.floor(math.log10(x)) - 2)
    return f"{math.floor(x / unit) * unit:.3g}"


@dataclass(frozen=True)
class Row:
    """Something that is told of each joint.

    Attributes:
        title: what.
        cells: one a joint.
        evidence: what it rests on.
    """

    title: str
    cells: tuple[str, ...]
    evidence: str

    @property
    def alike(self) -> bool:
        """Whether all joints have the same."""
        return len(set(self.cells)) == 1


def rows(checked: TuningCheck) -> Iterator[Row]:
    """All that is told of the joints."""

    def row(title: str, cell: Callable[[JointCheck], str], evidence: str) -> Row:
        return Row(title, tuple(cell(joint) for joint in checked.joints), evidence)

    dynamics = [d for d in (joint.specified.dynamics for joint in checked.joints) if d]
    shown = " / ".join(dict.fromkeys(d.evidence for d in dynamics)) or "–"
    by_value = _ENCLOSED if any(d.kd_star for d in dynamics) else shown
    enclosed = _ENCLOSED if any(d.settling_time_s for d in dynamics) else shown
    in_time = _ENCLOSED if any(d.time_to_resolution_s for d in dynamics) else "–"
    yield row("the error ends", error_ends, shown)
    yield row("the origin is a", looks, by_value)
    yield row("zero, from 1 rad at rest, after", settling, enclosed)
    yield row("below one count for good after", settling_to_a_count, in_time)
    samples = [joint.specified.sampled for joint in checked.joints]
    proved = Evidence.PROVED.value if all(s.proved for s in samples) else "not proved"
    yield row("stable for Mbar/M from", lambda j: stable_in(j.specified.sampled.intervals), proved)
    yield row(
        "the same as steep as at one count",
        lambda j: stable_in(j.specified.sampled.at_one_count),
        "rule of thumb",
    )
    found = checked.eigenvalues
    if found is not None:
        evidence = found.evidence.value
        spread = f"{float(found.low):.4g} to {float(found.high):.4g}"
        yield row("eigenvalues of M^-1 Mbar", lambda _: spread, evidence)
        holds = evidence if found.margin_33 >= 1.0 else Evidence.SAMPLED.value
        yield row("(33), all of them below 2", lambda _: condition_33(found), holds)
        yield row(
            "Mbar may be changed by" + (", joints rigid" if checked.flexible else ""),
            lambda j: divided_and_multiplied(margin_of_joint(j, checked)),
            evidence,
        )
    yield row("one encoder count is", _count, "arithmetic")
    yield row("counts alone, RMS", lambda j: f"{j.specified.noise.rms_Nm:.2g} N m", "arithmetic")
    if checked.flight is not None and checked.flight.joints:
        for title, cell in _FLOWN:
            cells = (cell(joint.flown) for joint in checked.joints if joint.flown)
            yield Row(title, tuple(cells), Evidence.MEASURED.value)
        bounds = [joint.bound.error for joint in checked.joints if joint.bound]
        kinds = " / ".join(dict.fromkeys(bound.kind for bound in bounds if bound))
        yield row("so |e| stays below", bound_words, f"{kinds}, given ξ" if kinds else "–")
    yield row("verdict", lambda j: j.verdict, "")


def _count(joint: JointCheck) -> str:
    noise = joint.specified.noise
    return f"{noise.worst_Nm:.3g} N m, {noise.share:.1%} of the limit"


def _acceleration(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g} rad/s²"


_FLOWN: tuple[tuple[str, Callable[[JointFlown], str]], ...] = (
    ("error on the run, RMS", lambda f: f"{f.rms_deg:.4f} deg"),
    ("its peak", lambda f: f"{f.peak_deg:.4f} deg"),
    ("ξ, largest |ε|", lambda f: _acceleration(f.tde_error)),
    ("largest mean ε of 50 ticks", lambda f: _acceleration(f.mean_tde_error)),
    ("vibration, 1 for counts alone", lambda f: f"{f.vibration:.3g}"),
    ("torque step, RMS over the limit", lambda f: f"{f.torque_step:.1%}"),
    ("ticks at the limit", lambda f: f"{f.saturated:.1%}"),
)
"""What a run shows of a joint: title and cell."""


def bound_words(joint: JointCheck) -> str:
    """The bound of |e| in degrees and counts."""
    bound = joint.bound
    if bound is None:
        return "–"
    if bound.error_bound_rad is None:
        return f"none: {bound.reason}"
    counts = float(f"{bound.error_bound_rad / joint.specified.resolution_rad:.3g}")
    shown = f"{counts:,.0f}".replace(",", "\u00a0") if counts >= _THOUSAND else f"{counts:g}"
    deg = f"{math.degrees(bound.error_bound_rad):.3g} deg"
    return f"{deg}, {shown} counts{_SCOPES[bound.error.scope] if bound.error else ''}"


def condition_33(found: Eigenvalues) -> str:
    """Whether (33) holds, and by what Mbar may be multiplied until it does not."""
    factor = f"× {_floor(found.margin_33)}"
    if found.sampled[1] >= LIMIT:
        return f"fails; holds for Mbar {factor}"
    return f"{'holds' if found.margin_33 >= 1.0 else 'open'}, {factor}"


# --- At a terminal -----------------------------------------------------------------------------


def show(checked: TuningCheck, console: Console) -> None:
    """Prints all of it."""
    for table in _tables(checked):
        console.print(table)
    for text in notes(checked):
        console.print(escape(text), soft_wrap=True)
    for finding, names in grouped(checked):
        console.print(_coloured(finding, _at(names, checked)), soft_wrap=True)
    if checked.remedy is not None:
        console.print(f"To change (measured): {escape(checked.remedy.says)}.", soft_wrap=True)
    colour = COLOURS[checked.severity]
    console.print(f"[bold {colour}]{escape(headline(checked))}[/]", soft_wrap=True)


def _tables(checked: TuningCheck) -> Iterator[Table]:
    """What all joints have alike, and what they have not."""
    title = escape(f"{checked.controller.name} on {checked.plant or 'no plant'}")
    alike, apart = Table(title=title, title_justify="left"), Table()
    for column in ("all joints", "", "evidence"):
        alike.add_column(column)
    for column in ("", *(escape(joint.name) for joint in checked.joints), "evidence"):
        apart.add_column(column)
    for row in rows(checked):
        if row.alike:
            alike.add_row(row.title, escape(row.cells[0]), row.evidence)
        else:
            apart.add_row(row.title, *map(escape, row.cells), row.evidence)
    yield alike
    if apart.row_count:
        yield apart


def notes(checked: TuningCheck) -> Iterator[str]:
    """What the figures mean, and what is not among them."""
    if not _same(checked):
        yield (
            "the joints differ in KD, KP or lambda: the intervals of each are a guide and decide "
            "nothing together"
        )
    yield from MEANING if checked.flight else MEANING[:1]
    yield from (f"note: {gap}" for gap in checked.gaps)


def _coloured(finding: Finding, at: str) -> str:
    evidence = f" ({finding.evidence.value})" if finding.evidence else ""
    fix = f" To change: {finding.fix}." if finding.fix else ""
    says = escape(f"{finding.says}{at}{evidence}.{fix}")
    return f"[{COLOURS[finding.severity]}]{finding.severity.words}[/]: {says}"


def summary(checked: TuningCheck) -> Iterator[str]:
    """A controller in a line, and what speaks against it in a line each, as rich markup."""
    kinds = dict.fromkeys(_kind(joint) for joint in checked.joints)
    samples = dict.fromkeys(stable_in(j.specified.sampled.intervals) for j in checked.joints)
    loudest = max(j.specified.noise.share for j in checked.joints)
    yield (
        f"  [bold]{escape(checked.controller.name)}[/bold]: {escape(', '.join(kinds))}; stable for "
        f"Mbar/M from {', '.join(samples)}; one count is at most {loudest:.1%} of a torque limit"
    )
    for finding, names in grouped(checked):
        yield f"    {_coloured(finding, _at(names, checked))}"


def _kind(joint: JointCheck) -> str:
    dynamics = joint.specified.dynamics
    if dynamics is None:
        return "no error dynamics"
    settles = dynamics.settling_time_s
    zero = f", zero from 1 rad in {seconds(settles)}" if settles else ""
    return f"{dynamics.kind.value}{zero}"
