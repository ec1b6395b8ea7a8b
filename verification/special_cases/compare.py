"""A special case and the inclusive C side by side: torques and whole runs, bit by bit.

Two comparisons of the same closed loop. In lock-step the inclusive C flies the robot, and the
special case is told the same counts at every tick, remembering its own torques. On its own the
special case flies another robot of the same kind; then everything that was recorded must be equal.
Roundings, which are no such equality, are tried one step at a time from the inclusive C's memory:
their differences don't add up over the run, so that one step's difference is what is told.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.controller import Controller, load
from plant.assembly import Plant, build_plant
from plant.closed_loop import Beginning, ControllerError, Run, beginning, switch_on
from plant.compiled.loop import CompiledLoop
from plant.controller import GeneratedController
from plant.flight import check_encoders, default_robot
from plant.native import shared_library
from plant.robot import load_robot
from verification.evidence import Evidence
from verification.experiments import CONTROLLERS
from verification.special_cases.laws import Case
from verification.special_cases.source import check, write_sources


@dataclass(frozen=True)
class Difference:
    """The first place where two signals have other bits.

    Attributes:
        signal: of ``plant.closed_loop.Run``, or ``torque`` in lock-step.
        tick: from 0.
        joint: its name, or None where the signal isn't a joint's.
        inclusive: the inclusive C's value.
        special: the special case's.
    """

    signal: str
    tick: int
    joint: str | None
    inclusive: float
    special: float

    def __str__(self) -> str:
        """One line for a person; the numbers are the shortest that tell them apart."""
        where = "" if self.joint is None else f", {self.joint}"
        return (
            f"{self.signal} at tick {self.tick}{where}: {self.inclusive!r} by the inclusive law, "
            f"{self.special!r} by its own"
        )


@dataclass(frozen=True)
class RoundingResult:
    """How far the same law in another rounding is from the inclusive C, one step at a time.

    Attributes:
        name: of the rounding.
        torques: how many were compared.
        different: how many of them have other bits.
        largest_Nm: the largest difference of one step [N m].
        first: the first difference.
    """

    name: str
    torques: int
    different: int
    largest_Nm: float
    first: Difference | None


@dataclass(frozen=True)
class Comparison:
    """A special case beside the inclusive C of one controller.

    Attributes:
        controller: whose inclusive C was flown.
        ticks: how many were compared, each with the torque of every joint.
        lock_step: the first torque with other bits on the same counts.
        own_loop: the first recorded signal with other bits, each in its own loop.
        roundings: of the same law; they aren't claimed to be equal.
        evidence: measured, on the simulated plant.
    """

    controller: str
    ticks: int
    lock_step: Difference | None
    own_loop: Difference | None
    roundings: tuple[RoundingResult, ...]
    evidence: Evidence = Evidence.MEASURED

    @property
    def equal(self) -> bool:
        """Whether all bits are equal."""
        return self.lock_step is None and self.own_loop is None


@dataclass(frozen=True, eq=False)
class Bench:
    """The inclusive C of a controller with its robot, and how a run of it begins."""

    shipped: Controller
    plant: Plant
    loop: CompiledLoop
    begin: Beginning

    @property
    def sample_time_s(self) -> float:
        """L."""
        return float(self.shipped.sample_time)

    def fly(self, controller: GeneratedController, loop: CompiledLoop) -> Run:
        """A run of a controller from the beginning."""
        return loop.run(self.plant, controller, self.begin, self.sample_time_s)

    def inclusive(self, tuned: Controller) -> GeneratedController:
        """The shipped C with other gains, as an engineer tunes it on the rig."""
        controller = self.loop.controller()
        controller.set_gains(tuned)
        return controller


def bench(name: str, ticks: int | None = None) -> Bench:
    """The bench of a controller of ``controllers/`` on its robot's whole trajectory.

    Args:
        name: of the file, without suffix.
        ticks: only so many of the trajectory's.

    Raises:
        SpecificationError, RobotError, PlantError, CompilerError: as ``plant.flight.fly``.
    """
    shipped = load(CONTROLLERS / f"{name}.toml")
    check(shipped)
    robot = load_robot(default_robot(shipped))
    check_encoders(shipped, robot)
    plant = build_plant(robot)
    assert robot.trajectory is not None, "every default robot has one"
    begin = beginning(plant, robot.trajectory, float(shipped.sample_time))
    if ticks is not None:
        begin = begin.part(0, ticks, begin.state)
    return Bench(shipped, plant, CompiledLoop(plant, shipped), begin)


# --- Bits --------------------------------------------------------------------------------------


def first_difference(
    signal: str, inclusive: NDArray[Any], special: NDArray[Any], joints: Sequence[str]
) -> Difference | None:
    """The first entry with other bits, so that -0 is not 0; shape (ticks,) or (ticks, n)."""
    different = np.argwhere(bits(inclusive) != bits(special))
    if not len(different):
        return None
    place = tuple(map(int, different[0]))
    joint = joints[place[1]] if len(place) > 1 else None
    return Difference(signal, place[0], joint, inclusive[place].item(), special[place].item())


def bits(signal: NDArray[Any]) -> NDArray[np.unsignedinteger[Any]]:
    """The numbers' bits."""
    return np.ascontiguousarray(signal).view(f"u{signal.itemsize}")


def first_difference_of_runs(
    inclusive: Run, special: Run, joints: Sequence[str]
) -> Difference | None:
    """The first difference of everything that was recorded, signal by signal."""
    found = (
        first_difference(field.name, getattr(inclusive, field.name), signal, joints)
        for field in fields(Run)
        if isinstance(signal := getattr(special, field.name), np.ndarray)
    )
    return next((difference for difference in found if difference is not None), None)


# --- The comparisons ---------------------------------------------------------------------------


def lock_step(
    bench: Bench,
    counts: NDArray[np.int32],
    controllers: Sequence[GeneratedController],
    *,
    one_memory: bool = False,
) -> list[NDArray[Any]]:
    """Torques of several controllers that are told the same counts, each of shape (ticks, n).

    Args:
        bench: how they are switched on, and the reference.
        counts: of each tick, shape (ticks, n).
        controllers: of one layout; all are reset first.
        one_memory: whether all begin each tick from the memory of the first one.

    Raises:
        ControllerError: one of them reported an error.
    """
    begin, encoder = bench.begin, bench.plant.encoder
    for controller in controllers:
        switch_on(controller, begin)
    first, *others = controllers
    reference = begin.reference
    position = reference.position_rad + encoder.zero_rad
    rates = (reference.velocity_rad_per_s, reference.acceleration_rad_per_s2)
    torques = [np.empty(counts.shape, np.dtype(c.types.torque)) for c in controllers]
    for k, row in enumerate(counts):
        if one_memory:
            for other in others:
                ctypes.memmove(
                    ctypes.byref(other.state), ctypes.byref(first.state), ctypes.sizeof(first.state)
                )
        for controller, told in zip(controllers, torques, strict=True):
            status = controller.step(row, position[k], *(rate[k] for rate in rates)).status
            if status < 0:
                raise ControllerError(k, status)
            told[k] = controller.torque
    return torques


def compare(bench: Bench, case: Case) -> Comparison:
    """One special case beside the inclusive C.

    Raises:
        CompilerError, GenerationError: the C can't be made.
        ControllerError: a controller reported an error.
    """
    tuned = load(CONTROLLERS / f"{bench.shipped.name}.toml", experiment=case.preset.name)
    joints = [joint.name for joint in tuned.joints]
    inclusive = bench.inclusive(tuned)
    flown = bench.fly(inclusive, bench.loop)
    sources = write_sources(case.law, tuned, case.name)
    own_loop = CompiledLoop(bench.plant, tuned, sources)
    own = bench.fly(own_loop.controller(), own_loop)
    torques, told = lock_step(bench, flown.counts, [inclusive, own_loop.controller()])
    others = [
        GeneratedController(
            tuned, shared_library(write_sources(r.law, tuned, f"{case.name}-rounding-{number}"))
        )
        for number, r in enumerate(case.roundings, 1)
    ]
    _, *rounded = lock_step(bench, flown.counts, [inclusive, *others], one_memory=True)
    return Comparison(
        controller=bench.shipped.name,
        ticks=len(torques),
        lock_step=first_difference("torque", torques, told, joints),
        own_loop=first_difference_of_runs(flown, own, joints),
        roundings=tuple(
            RoundingResult(
                rounding.name,
                torques.size,
                int(np.count_nonzero(bits(torques) != bits(other))),
                float(np.abs(other.astype(np.float64) - torques).max()),
                first_difference("torque", torques, other, joints),
            )
            for rounding, other in zip(case.roundings, rounded, strict=True)
        ),
    )
