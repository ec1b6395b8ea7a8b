"""The first screen: four questions, each with its answer and the figures that it rests on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from verification.bench.present import thousands
from verification.bench.variants import CASADI_POWF, NAIVE_DOUBLE, PROJECT
from verification.equivalence import Summary
from verification.evidence import Evidence
from verification.experiments import Beside, Gain
from verification.paper import REFERENCE_ROW
from verification.report.certificates import Certificates
from verification.report.processor import Processor
from verification.symbolic import Proof
from verification.table2.fly import FACTOR, TableOf
from verification.tuning_check.present import divided_and_multiplied, headline, margin_of_joint
from verification.tuning_check.verdict import Severity

HEADLINE_CORE = "Cortex-M4F"
"""The smallest core with an FPU, which the default numbers are for."""
HEADLINE_ALPHA = "0.95"
"""Of Exp08."""
TIMES_CHEAPER = 100.0
"""At least so many fewer instructions than CasADi's own C, which computes in double."""


@dataclass(frozen=True)
class KeyFigure:
    """A figure for the first screen."""

    value: str
    unit: str
    says: str
    evidence: Evidence
    anchor: str
    good: bool


@dataclass(frozen=True)
class Answer:
    """A question that a reader comes with.

    Attributes:
        name: of its place in the page.
        question: in the reader's words.
        says: the answer in a sentence or two.
        keys: the figures behind it.
        missing: the command that would give more of them, or None.
        sections: anchors and titles of what says more.
    """

    name: str
    question: str
    says: str
    keys: tuple[KeyFigure, ...]
    missing: str | None
    sections: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Found:
    """What the answers are made from.

    Attributes:
        rows: Table II on the reference plant beside the paper's.
        gains: errors over Exp08's.
        tables: Table II on every plant, the reference plant first.
        summaries: of the C beside its law, by controller.
        proofs: in computer algebra.
        certificates: of gains.
        processor: what was found on emulated processors.
        faults: what `make faults` left, or None.
    """

    rows: Sequence[Beside]
    gains: Sequence[Gain]
    tables: Sequence[TableOf]
    summaries: Sequence[Summary]
    proofs: Sequence[Proof]
    certificates: Certificates
    processor: Processor
    faults: dict[str, Any] | None


def answers(found: Found) -> tuple[Answer, ...]:
    """The four, in the order in which one would ask."""
    return (_what(found), _safe(found), _good(found), _cost(found.processor))


def _spread(values: Sequence[float], form: str) -> str:
    """Least and largest of some values."""
    low, high = form.format(min(values)), form.format(max(values))
    return low if low == high else f"{low} to {high}"


# --- What is it? -------------------------------------------------------------------------------


def _what(found: Found) -> Answer:
    return Answer(
        "what",
        "What is it?",
        "A controller for robot arms that needs no model of the robot: it takes the torque and "
        "the acceleration of a sample ago for all that it doesn't know. Written down once, "
        "generated as C without allocation, and compared with its equations.",
        (*_law(found.summaries, found.proofs), *_bits(found.processor)),
        None if found.processor.flights else "make pil",
        (
            ("law", "The law in the C"),
            ("equivalence", "The C beside its law"),
            ("arithmetic", "Float, double, fixed-point"),
            ("proofs", "Proofs"),
        ),
    )


def _law(summaries: Sequence[Summary], proofs: Sequence[Proof]) -> Iterator[KeyFigure]:
    """The paper's equations, and the C beside them."""
    held = sum(proof.holds for proof in proofs)
    yield KeyFigure(
        f"{held}",
        f"of {len(proofs)} statements",
        "hold in computer algebra: the closed loop (32), its sampled form, the special cases",
        Evidence.PROVED,
        "proofs",
        held == len(proofs),
    )
    steps = sum(s.tally.steps for s in summaries)
    violations = sum(s.violations for s in summaries)
    yield KeyFigure(
        f"{violations}",
        f"of {thousands(steps)} steps",
        "in which the generated C left the bound around the law",
        Evidence.SAMPLED,
        "equivalence",
        violations == 0,
    )


def _bits(processor: Processor) -> Iterator[KeyFigure]:
    """Bit-equality on the emulated processors, where it was measured."""
    if processor.flights is None:
        return
    cores = list(dict.fromkeys(str(flight["core"]) for flight in processor.flights))
    yield KeyFigure(
        f"{processor.equal}",
        f"of {len(processor.flights)} flights",
        f"have the host's torques bit for bit on emulated {', '.join(cores)}",
        Evidence.MEASURED,
        "processor",
        processor.equal == len(processor.flights),
    )


# --- Is it safe? -------------------------------------------------------------------------------


def _safe(found: Found) -> Answer:
    verdicts = "; ".join(
        f"on {check.plant.replace('_', ' ')}: {headline(check)}"
        for check in found.certificates.checks
        if check.plant
    )
    return Answer(
        "safe",
        "Is it safe?",
        f"The shipped gains, {verdicts}. Every input gets a defined torque within the limits; "
        "nothing here is certified, and no hardware was measured.",
        (*_margins(found.certificates), *_faults(found.faults)),
        None if found.faults else "make faults",
        (
            ("certificates", "Gains: proofs and verdict"),
            ("faults", "When things go wrong"),
        ),
    )


def _margins(certificates: Certificates) -> Iterator[KeyFigure]:
    """How far Mbar may be changed on the reference arm, and when the error is zero."""
    check = certificates.checks[0]
    margin = margin_of_joint(check.joints[0], check)
    yield KeyFigure(
        divided_and_multiplied(margin),
        "of Mbar",
        "leave the sampled law stable at every posture (linear law, rigid joints)",
        Evidence.PROVED,
        "certificates",
        check.severity is not Severity.UNSAFE and margin is not None and certificates.hold,
    )
    settling = next(s for s in certificates.settling if s.alpha == HEADLINE_ALPHA)
    if settling.dynamics.settling_time_s is not None:
        yield KeyFigure(
            f"{settling.dynamics.settling_time_s[1]:.4f}",
            "s",
            f"until an error of 1 rad is zero for good, alpha = {HEADLINE_ALPHA}, no disturbance",
            Evidence.PROVED,
            "certificates",
            certificates.hold,
        )


def _faults(faults: dict[str, Any] | None) -> Iterator[KeyFigure]:
    """After how many faults the joints came back to their usual error."""
    if faults is None:
        return
    back = {
        (standing["case"]["name"], line["fault"]): isinstance(
            line["scores"]["default"]["back_seen_s"], float | int
        )
        for standing in faults["standings"]
        for line in standing["lines"]
    }
    lasting = dict.fromkeys(fault for (_, fault), ended in back.items() if not ended)
    yield KeyFigure(
        f"{sum(back.values())}",
        f"of {len(back)} faults in motion",
        "end with the joints back at their usual error"
        + (f"; not {', '.join(lasting)}" if lasting else ""),
        Evidence.MEASURED,
        "faults",
        good=True,
    )


# --- How good is it? ---------------------------------------------------------------------------


def _good(found: Found) -> Answer:
    best = next(row for row in found.rows if row.experiment == REFERENCE_ROW)
    hsia = next(gain for gain in found.gains if gain.experiment == "Exp01")
    table = found.tables[0]
    cells = 3 * len(table.rows)
    return Answer(
        "good",
        "How good is it?",
        "The whole law tracks an order of magnitude better than Hsia's, on the simulated arm as "
        "on the paper's. The arm's friction and motion were chosen so that the paper's magnitudes "
        "come out; the ratios were not.",
        (
            KeyFigure(
                _spread(best.ours_deg, "{:.4f}"),
                "deg RMS",
                f"tracking error of Exp08, joints 1 to 3; the paper's robot: "
                f"{_spread(best.paper_deg, '{:.4f}')}",
                Evidence.MEASURED,
                "table-2",
                all(0.5 <= r <= 2.0 for r in best.ratio),
            ),
            KeyFigure(
                _spread(hsia.ours, "{:.0f}"),
                "times",
                f"smaller error than Hsia's law (Exp01) by joint; the paper's robot: "
                f"{_spread(hsia.paper, '{:.0f}')}",
                Evidence.MEASURED,
                "table-2",
                min(hsia.ours) >= 8.0,
            ),
            KeyFigure(
                f"{cells - len(table.outside)}",
                f"of {cells} cells",
                f"of Table II within a factor {FACTOR:g} of the paper's, the farthest "
                f"{table.worst_factor:.2f}",
                Evidence.MEASURED,
                "other-plants",
                not table.outside,
            ),
        ),
        None,
        (
            ("tracking", "Tracking"),
            ("table-2", "Table II"),
            ("torques", "Torques"),
            ("reversal", "Reversal"),
            ("six-joints", "Six joints"),
            ("other-plants", "Other plants"),
            ("paper-figures", "The paper's figures"),
            ("claim", "How far the claim holds"),
            ("special-cases", "Special cases"),
            ("rivals", "Rivals"),
        ),
    )


# --- What does it cost? ------------------------------------------------------------------------


def _cost(processor: Processor) -> Answer:
    return Answer(
        "cost",
        "What does it cost?",
        "No model, no allocation, a few hundred instructions a tick. Counted in emulators, which "
        "run every instruction and know no pipeline.",
        tuple(_of_a_tick(processor)),
        "make bench" if processor.cost is None else None,
        (("processor", "On the microcontroller"), ("reproduce", "How to get these figures again")),
    )


def _of_a_tick(processor: Processor) -> Iterator[KeyFigure]:
    """Instructions of a tick on one core against CasADi's own C, flash and stack."""
    if processor.cost is None:
        return
    joints = processor.cost.rows[0].joints
    rows = {
        row.variant: row
        for row in processor.cost.rows
        if (row.core, row.joints) == (HEADLINE_CORE, joints)
    }
    ours, naive = rows[PROJECT.name], rows[NAIVE_DOUBLE.name].times_the_project
    yield KeyFigure(
        f"{ours.instructions_per_step:.0f}",
        "instructions a tick",
        f"on {HEADLINE_CORE}, {joints} joints, at most {ours.worst_instructions}: {naive:.0f} "
        f"times fewer than CasADi's own C, {rows[CASADI_POWF.name].times_the_project:.1f} times "
        "fewer than that C with powf",
        Evidence.MEASURED,
        "processor",
        naive >= TIMES_CHEAPER,
    )
    yield KeyFigure(
        f"{ours.flash_bytes / 1024:.1f} KiB",
        "of flash",
        f"and {thousands(ours.stack_bytes)} bytes of stack, with all that it needs",
        Evidence.MEASURED,
        "processor",
        good=True,
    )
