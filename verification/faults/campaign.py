"""All faults on all plants with all guards: the worst of several moments and encoder phases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from joblib import Parallel, delayed

from verification.evidence import Evidence
from verification.faults.cases import CASES, DEFAULT, GUARDS, WINDUP, Case, ground
from verification.faults.catalogue import BY_NAME
from verification.faults.score import Score, nominal_peaks_deg, try_fault


@dataclass(frozen=True)
class Line:
    """A fault on a plant.

    Attributes:
        fault: its name.
        meaning: what happens.
        scores: by the guard's name.
    """

    fault: str
    meaning: str
    scores: Mapping[str, Score]


@dataclass(frozen=True)
class Standing:
    """All faults on one plant.

    Attributes:
        case: which.
        nominal_peak_error_deg: without a fault, by joint, the largest of all attempts.
        lines: one a fault.
    """

    case: Case
    nominal_peak_error_deg: tuple[float, ...]
    lines: tuple[Line, ...]


@dataclass(frozen=True)
class Result:
    """The whole campaign.

    Attributes:
        standings: one a plant.
        evidence: measured, on the simulated plants.
    """

    standings: tuple[Standing, ...]
    evidence: Evidence = Evidence.MEASURED


def line(case: Case, name: str) -> Line:
    """Flies a fault on a plant with every guard."""
    there, fault = ground(case), BY_NAME[name]
    scores: dict[str, Score] = {}
    for guard in GUARDS:
        # Anti-windup does nothing where no joint is at its limit.
        same = guard is WINDUP and not scores[DEFAULT.name].saturated_ticks
        scores[guard.name] = scores[DEFAULT.name] if same else try_fault(there, fault, guard)
    return Line(name, fault.meaning, scores)


def fly_all(
    cases: Sequence[Case] = CASES,
    advance: Callable[[], None] = lambda: None,
    processes: int = -1,
) -> Result:
    """Flies the campaign.

    Args:
        cases: which plants.
        advance: told of each fault on a plant as it ends.
        processes: faults at a time; one for each core by default.

    Raises:
        PlantError, RobotError, CompilerError, SpecificationError: a plant or its C can't be made.
    """
    # Compiled here, so that the processes find it.
    nominal = {case.name: nominal_peaks_deg(ground(case)) for case in cases}
    jobs = [(case, name) for case in cases for name in case.faults]
    pool = Parallel(n_jobs=processes, return_as="generator")
    found: dict[tuple[str, str], Line] = {}
    for (case, name), done in zip(jobs, pool(delayed(line)(*job) for job in jobs), strict=True):
        found[case.name, name] = done
        advance()
    return Result(
        tuple(
            Standing(
                case, nominal[case.name], tuple(found[case.name, name] for name in case.faults)
            )
            for case in cases
        )
    )
