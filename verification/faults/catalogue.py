"""The faults, as data: what happens to a robot in motion, from which tick on and for how long."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np

from plant.scenario import (
    DisturbanceEvent,
    EncoderFaultEvent,
    EncoderGarbageEvent,
    EncoderJumpEvent,
    EncoderWrapEvent,
    Event,
    LateTicksEvent,
    MissedTicksEvent,
    PayloadEvent,
    TorqueLimitEvent,
    TorqueShareEvent,
)
from plant.trajectory import Reference

TICK_S = 1e-3
"""L of the controllers that are flown, in which the catalogue counts."""

SHOULDER = [2]
"""Faults of one encoder are those of the joint that gravity loads most."""


class Moment(NamedTuple):
    """When a fault begins.

    Attributes:
        tick: of the run.
        direction: of all joints' motion at it, 1.0 or -1.0.
    """

    tick: int
    direction: float

    @property
    def at_s(self) -> float:
        """The time of the tick."""
        return self.tick * TICK_S


Events = Callable[[Moment], tuple[Event, ...]]
Told = Callable[[Reference, Moment], Reference]
"""What the controller is told in place of the reference."""


class Reset(Enum):
    """The torque that a controller is told at its reset in motion."""

    BUMPLESS = "what the drives were last told"
    FROM_ZERO = "zero"


@dataclass(frozen=True, eq=False)
class Fault:
    """One fault.

    Attributes:
        name: an identifier.
        meaning: what happens, in words.
        ticks: how many it lasts; None to the end of the run.
        events: of a scenario.
        told: what becomes of the reference.
        inertia: factor on Mbar, from the start of the run.
        reset: whether the controller is reset in place of the first tick.
    """

    name: str
    meaning: str
    ticks: int | None
    events: Events = lambda _: ()
    told: Told = lambda reference, _: reference
    inertia: float = 1.0
    reset: Reset | None = None

    @property
    def whole_run(self) -> bool:
        """Whether the fault is there from the start on."""
        return self.inertia != 1.0


# --- Encoders ----------------------------------------------------------------------------------


def _duration(ticks: int) -> float:
    return ticks * TICK_S


def _ticks(count: int) -> str:
    return "1 tick" if count == 1 else f"{count} ticks"


def _dropout(ticks: int) -> Fault:
    return Fault(
        f"dropout {ticks}",
        f"all encoders read 0 for {_ticks(ticks)}",
        ticks,
        lambda m: (
            EncoderFaultEvent(kind="encoder-dropout", at_s=m.at_s, duration_s=_duration(ticks)),
        ),
    )


def _garbage(ticks: int) -> Fault:
    return Fault(
        f"garbage {ticks}",
        f"all encoders read random numbers for {_ticks(ticks)}",
        ticks,
        lambda m: (
            EncoderGarbageEvent(kind="encoder-garbage", at_s=m.at_s, duration_s=_duration(ticks)),
        ),
    )


def _stuck(ticks: int) -> Fault:
    return Fault(
        f"stuck {ticks}",
        f"the shoulder's encoder shows its last reading for {_ticks(ticks)}",
        ticks,
        lambda m: (
            EncoderFaultEvent(
                kind="encoder-stuck",
                at_s=m.at_s,
                duration_s=_duration(ticks),
                joints=SHOULDER,
            ),
        ),
    )


def _lost_pulses(ticks: int) -> Fault:
    return Fault(
        f"lost pulses {ticks}",
        f"the shoulder's counter stands still for {_ticks(ticks)} and is off ever after",
        ticks,
        lambda m: (
            EncoderFaultEvent(
                kind="encoder-lost-pulses",
                at_s=m.at_s,
                duration_s=_duration(ticks),
                joints=SHOULDER,
            ),
        ),
    )


def _jump(counts: int, ticks: int | None = None) -> Fault:
    """In the direction of motion."""
    until = "ever after" if ticks is None else f"for {_ticks(ticks)}"
    return Fault(
        f"jump {counts}" + ("" if ticks is None else f" for {ticks}"),
        f"the shoulder's counter is {counts} counts ahead {until}",
        ticks,
        lambda m: (
            EncoderJumpEvent(
                kind="encoder-jump",
                at_s=m.at_s,
                duration_s=None if ticks is None else _duration(ticks),
                counts=round(m.direction * counts),
                joints=SHOULDER,
            ),
        ),
    )


_WRAP = Fault(
    "wrap",
    "all counters overflow",
    1,
    lambda m: (EncoderWrapEvent(kind="encoder-wrap", at_s=m.at_s),),
)


# --- Timing ------------------------------------------------------------------------------------


def _missed(ticks: int) -> Fault:
    return Fault(
        f"missed {ticks}",
        f"the controller is not called for {_ticks(ticks)}",
        ticks,
        lambda m: (
            MissedTicksEvent(kind="missed-ticks", at_s=m.at_s, duration_s=_duration(ticks)),
        ),
    )


_LATE = Fault(
    "late 1",
    "one tick comes half a sample late",
    1,
    lambda m: (LateTicksEvent(kind="late-ticks", at_s=m.at_s, duration_s=TICK_S, late=0.5),),
)
_JITTER = Fault(
    "jitter 1 s",
    "ticks come up to 0.3 of a sample late, at random, for 1 s",
    1000,
    lambda m: (
        LateTicksEvent(kind="late-ticks", at_s=m.at_s, duration_s=1.0, late=0.3, random=True),
    ),
)


# --- Drives and bodies -------------------------------------------------------------------------

_HOLD_Nm = 80.0
"""Against the waist, whose limit is 76.4 N m: friction makes up for the rest, so that it stops."""

_SATURATED = Fault(
    "saturated 1 s",
    f"{_HOLD_Nm:g} N m against the waist's motion for 1 s, more than its limit",
    1000,
    lambda m: (
        DisturbanceEvent(
            kind="disturbance",
            at_s=m.at_s,
            duration_s=1.0,
            torque_Nm=-m.direction * _HOLD_Nm,
            joints=[1],
        ),
    ),
)
_DEAD = Fault(
    "drives dead 50",
    "the drives give nothing for 50 ticks",
    50,
    lambda m: (TorqueLimitEvent(kind="torque-limit", at_s=m.at_s, duration_s=0.05, factor=0.0),),
)
_WEAK = Fault(
    "drives half 1 s",
    "the drives give half of what they are told for 1 s",
    1000,
    lambda m: (TorqueShareEvent(kind="torque-share", at_s=m.at_s, duration_s=1.0, share=0.5),),
)
_PAYLOAD_KG = 0.5
_PAYLOAD = Fault(
    "payload doubled",
    f"the hand carries {_PAYLOAD_KG:g} kg from the start and as much again from now on",
    None,
    lambda m: tuple(
        PayloadEvent(kind="payload", at_s=at_s, mass_kg=_PAYLOAD_KG) for at_s in (0.0, m.at_s)
    ),
)


# --- Reference ---------------------------------------------------------------------------------

_STEP_DEG = 1.0


def _stepped(reference: Reference, moment: Moment) -> Reference:
    step = np.where(reference.time_s >= moment.at_s - TICK_S / 2, np.deg2rad(_STEP_DEG), 0.0)
    return replace(reference, position_rad=reference.position_rad + step[:, np.newaxis])


def _not_a_number(ticks: int) -> Fault:
    def told(reference: Reference, moment: Moment) -> Reference:
        acceleration = reference.acceleration_rad_per_s2.copy()
        acceleration[moment.tick : moment.tick + ticks] = np.nan
        return replace(reference, acceleration_rad_per_s2=acceleration)

    return Fault(
        f"NaN {ticks}",
        f"the reference's acceleration is not a number for {_ticks(ticks)}",
        ticks,
        told=told,
    )


_STEP = Fault(
    "reference step",
    f"the reference of all joints steps by {_STEP_DEG:g} deg, its velocity doesn't",
    None,
    told=_stepped,
)


# --- Controller --------------------------------------------------------------------------------


def _reset(name: str, how: Reset) -> Fault:
    return Fault(name, f"reset in motion, told that the torque was {how.value}", 1, reset=how)


def _mbar(factor: float) -> Fault:
    return Fault(f"Mbar x{factor:g}", f"Mbar {factor:g} times as large", None, inertia=factor)


CATALOGUE = (
    *map(_dropout, (1, 5, 50)),
    _garbage(5),
    *map(_stuck, (1, 5, 50)),
    _lost_pulses(5),
    *map(_jump, (50, 500, 5000, 100_000)),
    _jump(5000, 15),
    _WRAP,
    *map(_missed, (1, 5, 50)),
    _LATE,
    _JITTER,
    _SATURATED,
    _DEAD,
    _WEAK,
    _PAYLOAD,
    _STEP,
    *map(_not_a_number, (1, 50)),
    _reset("reset", Reset.BUMPLESS),
    _reset("reset from zero", Reset.FROM_ZERO),
    *map(_mbar, (0.3, 3.0)),
)
BY_NAME = {fault.name: fault for fault in CATALOGUE}
