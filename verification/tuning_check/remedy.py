"""What cures what a run shows: Mbar, lowered or raised until nothing more speaks against it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from codegen.controller import Controller
from verification.tuning_check.flight import Course, Flight, scaled
from verification.tuning_check.verdict import of_flight, of_run

STEPS = (Fraction(4, 5), Fraction(5, 4))
"""What the Mbar of each joint that offends is multiplied by from one run to the next: all the way
down first, since too large an Mbar is the usual fault, then up."""
MOST_RUNS = 10
"""In one direction: down to a tenth."""


@dataclass(frozen=True)
class Remedy:
    """What was found.

    Attributes:
        factors: of each joint's Mbar; None where no factor in the range cures.
        runs: how many were flown in search of it.
    """

    factors: tuple[Fraction, ...] | None
    runs: int

    def says(self, names: Sequence[str]) -> str:
        """In plain words, for joints of these names."""
        if self.factors is None:
            return (
                f"no Mbar of {self.runs} that were flown cures it: lower lambda, raise gamma or "
                "alpha, or shorten the delay"
            )
        changed = ", ".join(
            f"{float(factor):.2g} at {name}"
            for name, factor in zip(names, self.factors, strict=True)
            if factor != 1
        )
        return f"multiply Mbar by {changed}: flown again, nothing more was found"


def remedy(controller: Controller, course: Course, flight: Flight) -> Remedy | None:
    """Looks for an Mbar with which a run shows nothing; None where this one already does.

    Args:
        controller: whose gains were flown.
        course: where.
        flight: with them.
    """
    if not any(offending(flight, len(controller.joints))):
        return None
    runs = 0
    for step in STEPS:
        factors, found = [Fraction(1) for _ in controller.joints], flight
        for _ in range(MOST_RUNS):
            bad = offending(found, len(factors))
            factors = [f * step if b else f for f, b in zip(factors, bad, strict=True)]
            found = course.fly(scaled(controller, factors))
            runs += 1
            if not any(offending(found, len(factors))):
                return Remedy(tuple(factors), runs)
    return Remedy(None, runs)


def offending(flight: Flight, joints: int) -> list[bool]:
    """Which joints a run speaks against; all of them where it did not get to its end."""
    if of_flight(flight):
        return [True] * joints
    return [bool(tuple(of_run(flown))) for flown in flight.joints]
