"""A fault flown: the shipped C in the closed loop, and a supervisor above it.

The supervisor is what a machine has above its controller: once the controller has stopped, and the
fault is over, it resets it in motion and leads the reference from where the encoders see the robot
back to where it should be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.status import Status
from plant.assembly import Floats, Plant
from plant.closed_loop import ENDED_BY, Beginning, Run, beginning, switch_on
from plant.compiled.loop import CompiledLoop
from plant.controller import GeneratedController
from plant.trajectory import Reference
from verification.faults.cases import Attempt, Ground, Guard, controller_of, events_of
from verification.faults.catalogue import TICK_S, Fault, Reset

HORIZON_S = 3.0
"""How long a run is looked at from its fault on."""

REACTION_TICKS = 10
"""What a supervisor takes from the controller's stop to its reset."""

REPLAN_S, REPLAN_RAD_PER_S = 0.3, 1.0
"""The least time in which a reference is led back, and the largest speed beside its own."""


@dataclass(frozen=True, eq=False)
class Flown:
    """A run with its fault; arrays have one row a tick.

    Attributes:
        error_rad: told position minus that of the joint, shape (ticks, n).
        seen_error_rad: the same by the counters, as the controller sees it.
        torque_Nm: mean over the tick of what the drives applied, shape (ticks, n).
        status: shape (ticks,).
        entry: the tick from which on the controller runs again after a stop; None without one.
    """

    error_rad: Floats
    seen_error_rad: Floats
    torque_Nm: Floats
    status: NDArray[np.int64]
    entry: int | None = None


def fly(
    ground: Ground, fault: Fault | None, guard: Guard, attempt: Attempt, *, replan: bool = True
) -> Flown:
    """One run, until ``HORIZON_S`` after the fault.

    Args:
        ground: where.
        fault: what happens; None for nothing.
        guard: of the controller.
        attempt: when, and at which encoder phase.
        replan: whether the supervisor leads the reference back after a stop; else the controller
            goes on along the reference as it is.

    Raises:
        PlantError: the motion became non-finite.
    """
    encoder = replace(ground.plant.encoder, phase=np.full(ground.plant.joints, attempt.phase))
    plant = replace(ground.plant, encoder=encoder)
    events = () if fault is None else fault.events(attempt.moment)
    begin = beginning(plant, ground.trajectory, TICK_S, events_of(events))
    if fault is not None:
        begin = replace(begin, reference=fault.told(begin.reference, attempt.moment))
    begin = begin.part(0, attempt.moment.tick + round(HORIZON_S / TICK_S), begin.state)
    controller = controller_of(ground, guard, 1.0 if fault is None else fault.inertia)
    pilot = _Pilot(ground.loop, plant, controller, begin)
    if fault is not None and fault.reset is not None:
        return pilot.with_reset(attempt.moment.tick, fault.reset)
    over = attempt.moment.tick + ((fault.ticks or 0) if fault is not None else 0)
    return pilot.supervised(over, replan=replan)


_GOES_ON = ENDED_BY - {Status.STOPPED}


@dataclass(frozen=True, eq=False)
class _Pilot:
    """Flies a run in parts."""

    loop: CompiledLoop
    plant: Plant
    controller: GeneratedController
    begin: Beginning

    def with_reset(self, tick: int, how: Reset) -> Flown:
        """A reset between two ticks, as a new controller takes over from an old one."""
        switch_on(self.controller, self.begin)
        first = self._part(self.begin.part(0, tick, self.begin.state))
        held = first.end.command_Nm
        self.controller.reset(first.counts[-1], held if how is Reset.BUMPLESS else 0.0 * held)
        return self._flown(first, self._part(self.begin.part(tick, self._ticks, first.end)))

    def supervised(self, over: int, *, replan: bool) -> Flown:
        """A run; where the controller stops it is reset, but not before the fault is over."""
        switch_on(self.controller, self.begin)
        alone = self._part(self.begin)
        stops = np.flatnonzero(alone.status == Status.STOPPED)
        # Two readings from after the fault are needed to see where the robot moves to.
        entry = max(int(stops[0]) + REACTION_TICKS, over + 2) if len(stops) else self._ticks
        if entry >= self._ticks:
            return self._flown(alone)
        switch_on(self.controller, self.begin)
        first = self._part(self.begin.part(0, entry, self.begin.state))
        self.controller.reset(first.counts[-1], first.end.command_Nm)
        rest = self.begin.part(entry, self._ticks, first.end)
        if replan:
            deviation = -seen_error_rad(first, self.begin)[-2:]
            rest = replace(rest, reference=led_back(rest.reference, deviation))
        return self._flown(first, self._part(rest), entry=entry)

    @property
    def _ticks(self) -> int:
        return self.begin.script.ticks

    def _part(self, begin: Beginning) -> Run:
        return self.loop.run(
            self.plant, self.controller, begin, TICK_S, reset=False, ended_by=_GOES_ON
        )

    def _flown(self, *parts: Run, entry: int | None = None) -> Flown:
        """Errors are from what was told first, wherever the reference was led meanwhile."""

        def whole(name: str) -> NDArray[Any]:
            return np.concatenate([getattr(part, name) for part in parts])

        told = self.begin.reference.position_rad
        return Flown(
            told - whole("q"),
            _seen(told, whole("counts"), self.begin),
            whole("torque_applied_Nm"),
            whole("status"),
            entry,
        )


def seen_error_rad(run: Run, begin: Beginning) -> Floats:
    """Told position minus that by the counters, which wrap, as the controller sees it."""
    return _seen(run.q_ref, run.counts, begin)


def _seen(told_rad: Floats, counts: NDArray[np.int32], begin: Beginning) -> Floats:
    encoder = begin.script.encoder
    told = np.rint(told_rad * encoder.counts_per_rad).astype(np.int64) + encoder.offset_counts
    apart = (told - counts).astype(np.uint32).view(np.int32)
    seen: Floats = apart / encoder.counts_per_rad
    return seen


def led_back(reference: Reference, deviation_rad: Floats) -> Reference:
    """A reference that begins where the robot is, and how it moves, and becomes the old one.

    With r the time since the last reading over T, d0 the deviation then and v0 its rate, it adds

        d = d0 (1 - 10 r^3 + 15 r^4 - 6 r^5) + v0 T (r - 6 r^3 + 8 r^4 - 3 r^5)

    the quintic with d(0) = d0, d'(0) = v0, d''(0) = 0 that is zero with its rates at r = 1.

    Args:
        reference: from the tick after the last reading on.
        deviation_rad: of the robot from the reference at the last two readings, shape (2, n).
    """
    start = deviation_rad[1]
    rate = (deviation_rad[1] - deviation_rad[0]) / TICK_S
    # A quintic from rest is 15/8 times as fast as it is on average.
    duration = max(REPLAN_S, 1.875 * float(np.abs(start).max()) / REPLAN_RAD_PER_S)
    since = TICK_S * np.arange(1, len(reference.time_s) + 1, dtype=np.float64)
    r = np.minimum(since / duration, 1.0)
    places = _polynomial([1, 0, 0, -10, 15, -6]), _polynomial([0, 1, 0, -6, 8, -3])

    def added(order: int) -> Floats:
        by_place, by_rate = (place.deriv(order)(r) / duration**order for place in places)
        return np.outer(by_place, start) + np.outer(by_rate, duration * rate)

    return replace(
        reference,
        position_rad=reference.position_rad + added(0),
        velocity_rad_per_s=reference.velocity_rad_per_s + added(1),
        acceleration_rad_per_s2=reference.acceleration_rad_per_s2 + added(2),
    )


def _polynomial(coefficients: Sequence[int]) -> np.polynomial.Polynomial:
    return np.polynomial.Polynomial(coefficients)
