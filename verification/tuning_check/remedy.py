"""What cures what a run shows: other gains, flown until nothing more speaks against them.

First Mbar goes down, since too large a one is the usual fault, then up; then gamma goes to 1, then
lambda down. Each step changes the joints that offend, and they alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Literal

from codegen.controller import Controller, Joint
from plant.tuning.gains import rounded
from verification.tuning_check.flight import Course, Flight
from verification.tuning_check.verdict import of_joint

MOST_RUNS = 10
"""In one direction: Mbar to a tenth or ten times."""

Quantity = Literal["inertia", "gamma", "lambda_"]


@dataclass(frozen=True)
class Direction:
    """One way to change a joint.

    Attributes:
        quantity: the joint's field that changes.
        key: how a specification writes it.
        step: the next value; None at the end.
    """

    quantity: Quantity
    key: str
    step: Callable[[Fraction], Fraction | None]

    def of(self, joint: Joint) -> Joint:
        """A joint one step on; itself at the end."""
        value = self.step(getattr(joint, self.quantity))
        changed: dict[str, Any] = {} if value is None else {self.quantity: value}
        return replace(joint, **changed)


def _times(factor: Fraction) -> Callable[[Fraction], Fraction | None]:
    return lambda value: rounded(value * factor) if value else None


def _mbar_times(factor: Fraction) -> Direction:
    return Direction("inertia", "inertia_kgm2", _times(factor))


DIRECTIONS = (
    _mbar_times(Fraction(4, 5)),
    _mbar_times(Fraction(5, 4)),
    Direction("gamma", "gamma", lambda x: min(x + Fraction(1, 10), Fraction(1)) if x < 1 else None),
    Direction("lambda_", "lambda", _times(Fraction(1, 2))),
)


@dataclass(frozen=True)
class Remedy:
    """What was found.

    Attributes:
        changes: by the key of a specification, the values to write; None where nothing in the
            range cures.
        runs: how many were flown in search of it.
    """

    changes: dict[str, tuple[Fraction, ...]] | None
    runs: int

    @property
    def says(self) -> str:
        """In plain words."""
        if self.changes is None:
            return (
                f"none of {self.runs} runs with another Mbar, gamma or lambda is quiet: raise "
                "alpha, lower KD and KP, or shorten the delay"
            )
        written = (
            f"{key} = [{', '.join(f'{float(x):g}' for x in values)}]"
            for key, values in self.changes.items()
        )
        return f"write {' and '.join(written)}: flown, and the run shows nothing against it"


def remedy(controller: Controller, course: Course, flight: Flight, factor: float) -> Remedy | None:
    """Looks for gains with which a run shows nothing; None where these already do.

    Args:
        controller: whose gains were flown.
        course: where.
        flight: with them.
        factor: by which Mbar must change anyway, for the interval; 1 if it need not.
    """
    if factor == 1.0 and not any(offending(flight, len(controller.joints))):
        return None
    start, runs = controller, 0
    if factor != 1.0:
        scale = _times(Fraction(factor))
        start = _changed(
            controller, [Direction("inertia", "", scale).of(j) for j in controller.joints]
        )
        flight, runs = course.fly(start), 1
    for direction in DIRECTIONS:
        tried, found = start, flight
        for _ in range(MOST_RUNS):
            bad = offending(found, len(controller.joints))
            if not any(bad):
                return Remedy(_changes(controller, tried), runs)
            joints = [direction.of(j) if b else j for j, b in zip(tried.joints, bad, strict=True)]
            if joints == list(tried.joints):
                break
            tried = _changed(controller, joints)
            found, runs = course.fly(tried), runs + 1
    return Remedy(None, runs)


def offending(flight: Flight, joints: int) -> list[bool]:
    """Which joints a run speaks against; all of them where it did not get to its end."""
    return [any(True for _ in of_joint(flight, j)) for j in range(joints)]


def _changed(controller: Controller, joints: Iterable[Joint]) -> Controller:
    return replace(controller, joints=tuple(joints))


def _changes(before: Controller, after: Controller) -> dict[str, tuple[Fraction, ...]]:
    found = {}
    for direction in DIRECTIONS:
        values = tuple(getattr(joint, direction.quantity) for joint in after.joints)
        if values != tuple(getattr(joint, direction.quantity) for joint in before.joints):
            found[direction.key] = values
    return found
