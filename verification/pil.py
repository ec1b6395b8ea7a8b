"""Processor in the loop: the controller on an emulated microcontroller drives the simulated robot.

At every tick the encoder counts and the reference go to the target, and its torque moves the
plant. The host's compiled C is stepped on the same inputs, and every torque has to have the same
bits. What the target says comes through two FIFOs by semihosting, or through its serial port.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from codegen.controller import load
from codegen.emit import REPOSITORY
from codegen.problems import SpecificationError
from plant.assembly import Floats, PlantError, build_plant
from plant.closed_loop import ControllerError, ControllerOutput, simulate
from plant.controller import GeneratedController, LayoutError
from plant.flight import DEFAULT_ROBOTS
from plant.native import BUILD, CompilerError
from plant.robot import load_robot
from plant.trajectory import Reference, RestToRest
from plant.units import Unit
from verification.commands.output import stoppable
from verification.evidence import Evidence, write_json
from verification.firmware import (
    Board,
    ToolError,
    build,
    emulated_board_names,
    load_board,
)
from verification.target import IMAGES, Link, Target, TargetError

RESULT = BUILD / "pil" / "pil.json"


class Answer(NamedTuple):
    """What a side answers at a tick.

    Attributes:
        torque: in the C's own numbers and unit, shape (n,).
        status: of ``tdc_NAME_step``.
    """

    torque: NDArray[Any]
    status: int


@dataclass
class Recording:
    """What both sides did, tick by tick.

    Attributes:
        start: counts and holding torque of the reset.
        inputs: bytes of each ``tdc_NAME_input``.
        target: the target's torques and statuses.
        host: the same of the host's C.
        exchange_s: time from sending an input to having its torque, added up.
    """

    start: tuple[NDArray[np.int32], Floats] | None = None
    inputs: list[bytes] = field(default_factory=list)
    target: list[Answer] = field(default_factory=list)
    host: list[Answer] = field(default_factory=list)
    exchange_s: float = 0.0


class TargetController:
    """The target as the closed loop sees it, with the host's C beside it on the same inputs.

    Fulfils :class:`plant.closed_loop.Controller`; the loop gets the target's torque.

    Args:
        target: a running target.
        host: the same controller on the host, tuned as it is to fly.
    """

    def __init__(self, target: Target, host: GeneratedController) -> None:
        self._target, self._host = target, host
        self.recording = Recording()

    def reset(self, counts: NDArray[np.int32], holding_torque_Nm: Floats, /) -> int:
        """Switches both on; returns the target's status.

        Raises:
            TargetError: the host's status is another.
        """
        self.recording = Recording(start=(counts.copy(), holding_torque_Nm.copy()))
        of_host = self._host.reset(counts, holding_torque_Nm)
        of_target = self._target.reset(self._host.config, counts, holding_torque_Nm).status
        if of_host != of_target:
            raise TargetError(f"init returns {of_target} on the target, {of_host} on the host")
        return of_target

    def step(
        self,
        counts: NDArray[np.int32],
        position_rad: Floats,
        velocity_rad_per_s: Floats,
        acceleration_rad_per_s2: Floats,
        /,
    ) -> ControllerOutput:
        """One tick on both sides; returns the target's answer."""
        host = self._host
        status = host.step(counts, position_rad, velocity_rad_per_s, acceleration_rad_per_s2).status
        given = bytes(host.input)
        start = time.perf_counter()
        reply = self._target.step(given)
        record = self.recording
        record.exchange_s += time.perf_counter() - start
        record.inputs.append(given)
        record.host.append(Answer(host.torque, status))
        record.target.append(Answer(reply.torque, reply.status))
        return ControllerOutput(host.units.torque.physical(reply.torque), reply.status)


@dataclass(frozen=True)
class Mismatch:
    """The first place where target and host differ.

    Attributes:
        tick: from 0.
        joint: from 0, or None where only the status differs.
        target: torque [N m] (as shortest decimal) or status on the target.
        host: the same on the host.
        target_bits: the torque's bits, or empty.
        host_bits: the same on the host.
    """

    tick: int
    joint: int | None
    target: str
    host: str
    target_bits: str = ""
    host_bits: str = ""

    def __str__(self) -> str:
        """One line for a person."""
        if self.joint is None:
            return f"tick {self.tick}: status {self.target} on the target, {self.host} on the host"
        return (
            f"tick {self.tick}, joint {self.joint}: {self.target} N m ({self.target_bits}) on the "
            f"target, {self.host} N m ({self.host_bits}) on the host"
        )


def first_mismatch(target: Sequence[Answer], host: Sequence[Answer], unit: Unit) -> Mismatch | None:
    """Compares torques bit by bit (so that -0 is not 0, and NaN may be equal), and statuses.

    Args:
        target: its answers.
        host: the host's.
        unit: of a torque.
    """
    for tick, (mine, theirs) in enumerate(zip(target, host, strict=True)):
        my_bits, their_bits = _bits(mine.torque), _bits(theirs.torque)
        different = np.flatnonzero(my_bits != their_bits)
        if len(different):
            joint = int(different[0])
            digits = 2 * my_bits.itemsize
            return Mismatch(
                tick,
                joint,
                str(unit.physical(mine.torque)[joint]),
                str(unit.physical(theirs.torque)[joint]),
                f"0x{my_bits[joint]:0{digits}X}",
                f"0x{their_bits[joint]:0{digits}X}",
            )
        if mine.status != theirs.status:
            return Mismatch(tick, None, str(mine.status), str(theirs.status))
    return None


def _bits(torque: NDArray[Any]) -> NDArray[np.unsignedinteger[Any]]:
    return torque.view(f"u{torque.itemsize}")


class _Beginning(RestToRest):
    """The first ticks of a motion; all of it by default."""

    def __init__(self, whole: RestToRest, ticks: int | None) -> None:
        super().__init__(whole.postures_rad, whole.segment_s)
        object.__setattr__(self, "_ticks", ticks)

    def sampled(self, sample_time_s: float) -> Reference:
        """The reference at the first ticks."""
        whole = super().sampled(sample_time_s)
        n: int | None = getattr(self, "_ticks")  # noqa: B009 - set on a frozen dataclass
        return Reference(
            whole.time_s[:n],
            whole.position_rad[:n],
            whole.velocity_rad_per_s[:n],
            whole.acceleration_rad_per_s2[:n],
        )


@dataclass(frozen=True)
class Flight:
    """A controller with the gains to fly: an experiment's, or those of its specification."""

    controller: str
    experiment: str | None = None

    def __str__(self) -> str:
        """As the command line writes it."""
        return self.controller + (f":{self.experiment}" if self.experiment else "")

    def tuned(self) -> GeneratedController:
        """The host's C with these gains."""
        path = REPOSITORY / "controllers" / f"{self.controller}.toml"
        host = GeneratedController(load(path))
        host.set_gains(load(path, experiment=self.experiment))
        return host


FLIGHTS = (
    Flight("puma3", "Exp01"),
    Flight("puma3", "Exp08"),
    Flight("puma3_fixed"),
    Flight("puma3_float64"),
    Flight("puma3_precise"),
    Flight("puma6"),
)


@dataclass(frozen=True)
class PilRun:
    """One closed loop with the processor in it.

    Attributes:
        board: its name.
        core: its processor.
        controller: name of the controller.
        experiment: whose gains it flew with, None for the specification's own.
        link: how host and target talked.
        ticks: length of the run.
        target_sha256: of all torques tick by tick, little-endian numbers of the C: binary32,
            binary64, or int32 in fixed-point.
        host_sha256: the same of the host's C on the same inputs.
        equal: whether all torques and statuses are bit-equal, replayed ones included.
        mismatch: the first difference, or None.
        seconds: time of all ticks from the host's sending the input to its having the torque.
        seconds_total: wall time of the whole closed loop, the simulated robot included.
        replay_seconds: time in which the recorded inputs, streamed, were answered; None if they
            were not replayed.
    """

    board: str
    core: str
    controller: str
    experiment: str | None
    link: Link
    ticks: int
    target_sha256: str
    host_sha256: str
    equal: bool
    mismatch: Mismatch | None
    seconds: float
    seconds_total: float
    replay_seconds: float | None


def fly(target: Target, host: GeneratedController, ticks: int | None = None) -> Recording:
    """Flies the target on the robot for this number of joints, along the robot's trajectory.

    Args:
        target: a running target.
        host: the same controller on the host, tuned as it is to fly.
        ticks: length of the run; the whole trajectory by default.

    Raises:
        TargetError: the target ended, or init differs.
        ControllerError, PlantError: the run failed though both sides agreed. Where they did not,
            the recording ends there: a target that computes something else may well crash a robot.
    """
    robot = load_robot(DEFAULT_ROBOTS[host.joints])
    if robot.trajectory is None:
        raise PlantError(f"robot {robot.name} has no trajectory")
    controller = TargetController(target, host)
    try:
        simulate(
            build_plant(robot),
            controller,
            _Beginning(robot.trajectory, ticks),
            float(host.specification.sample_time),
            progress=False,
        )
    except (ControllerError, PlantError):
        record = controller.recording
        if first_mismatch(record.target, record.host, host.units.torque) is None:
            raise
    return controller.recording


def run(
    board: Board,
    image: Path,
    flight: Flight,
    *,
    ticks: int | None = None,
    link: Link = "semihosting",
) -> PilRun:
    """Flies a controller on an emulated board and compares.

    Args:
        board: the board.
        image: its `pil.elf`, or `pil_uart.elf` for the link ``uart``.
        flight: controller and gains.
        ticks: length of the run; the robot's whole trajectory by default.
        link: how the image talks; only semihosting is quick enough for the replay.

    Raises:
        TargetError: the target does not run, or init differs.
        ControllerError, PlantError: the run failed though both sides agreed.
    """
    host = flight.tuned()
    replay_s: float | None = None
    with Target(board, image, host, link) as target:
        start = time.perf_counter()
        record = fly(target, host, ticks)
        total_s = time.perf_counter() - start
        unit = host.units.torque
        mismatch = first_mismatch(record.target, record.host, unit)
        if link == "semihosting":
            replayed, replay_s = _replay(target, host, record)
            mismatch = mismatch or first_mismatch(replayed, record.target, unit)
    return PilRun(
        board=board.name,
        core=board.core,
        controller=flight.controller,
        experiment=flight.experiment,
        link=link,
        ticks=len(record.target),
        target_sha256=_sha256(record.target),
        host_sha256=_sha256(record.host),
        equal=mismatch is None,
        mismatch=mismatch,
        seconds=record.exchange_s,
        seconds_total=total_s,
        replay_seconds=replay_s,
    )


def _replay(
    target: Target, host: GeneratedController, record: Recording
) -> tuple[list[Answer], float]:
    assert record.start is not None
    target.reset(host.config, *record.start)
    start = time.perf_counter()
    replies = target.replay(record.inputs)
    seconds = time.perf_counter() - start
    return [Answer(r["torque"].copy(), int(r["status"])) for r in replies], seconds


def _sha256(answers: Sequence[Answer]) -> str:
    torques = np.array([answer.torque for answer in answers])
    return hashlib.sha256(torques.astype(torques.dtype.newbyteorder("<")).tobytes()).hexdigest()


# --- The command ------------------------------------------------------------------------------


def campaign(
    boards: Sequence[str],
    flights: Sequence[Flight],
    ticks: int | None,
    uart_ticks: int,
    console: Console,
) -> list[PilRun]:
    """Every flight on every board by semihosting, and the first one briefly by UART."""
    runs = []
    for board in map(load_board, boards):
        plans: list[tuple[Flight, int | None, Link]] = [(f, ticks, "semihosting") for f in flights]
        if uart_ticks > 0:
            plans.append((flights[0], uart_ticks, "uart"))
        for flight, length, link in plans:
            with console.status(f"{board.name} flies {flight} ({link})"):
                image = build(board, flight.controller, IMAGES[link])
                runs.append(run(board, image, flight, ticks=length, link=link))
    return runs


def table(runs: Sequence[PilRun]) -> Table:
    """The runs for a person."""
    shown = Table(title="Processor in the loop", title_justify="left", box=None, pad_edge=False)
    shown.add_column("board", no_wrap=True)
    shown.add_column("controller", no_wrap=True)
    for name in ("ticks", "exchange\n\\[s]", "closed loop\n\\[s]", "replay\n\\[s]"):
        shown.add_column(name, justify="right")
    shown.add_column("torques", no_wrap=True)
    for r in runs:
        shown.add_row(
            f"{r.board}\n[dim]{r.core}[/]",
            f"{Flight(r.controller, r.experiment)}\n[dim]{r.link}[/]",
            str(r.ticks),
            f"{r.seconds:.2f}",
            f"{r.seconds_total:.2f}",
            "" if r.replay_seconds is None else f"{r.replay_seconds:.2f}",
            f"bit-equal\n[dim]{r.target_sha256[:8]}[/]" if r.equal else "[bold red]DIFFERENT[/]",
        )
    return shown


def _flight(text: str) -> Flight:
    controller, _, experiment = text.partition(":")
    return Flight(controller, experiment or None)


def _positive(text: str) -> int:
    number = int(text)
    if number <= 0:
        raise ValueError
    return number


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m verification.pil",
        description="Flies generated controllers on emulated boards and compares every torque "
        "with the host's, bit by bit.",
        epilog="example: python -m verification.pil --board mps2-an386 --flight puma3:Exp08",
    )
    parser.add_argument(
        "--board",
        action="append",
        choices=emulated_board_names(),
        help="default: all; may be repeated",
    )
    parser.add_argument(
        "--flight",
        action="append",
        type=_flight,
        metavar="NAME[:EXPERIMENT]",
        help=f"default: {', '.join(map(str, FLIGHTS))}; may be repeated",
    )
    parser.add_argument(
        "--ticks", type=_positive, help="length of a run; default: the whole trajectory"
    )
    parser.add_argument(
        "--uart-ticks", type=int, default=100, help="length of the run by UART, 0 for none"
    )
    parser.add_argument("--output", type=Path, default=RESULT, help="the JSON file")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; returns 0, 1 for a mismatch, 2 for what could not be run."""
    options = _parser().parse_args(arguments)
    console = Console(highlight=False)
    try:
        runs = campaign(
            options.board or emulated_board_names(),
            options.flight or FLIGHTS,
            options.ticks,
            options.uart_ticks,
            console,
        )
    except (
        ToolError,
        TargetError,
        CompilerError,
        LayoutError,
        SpecificationError,
        ControllerError,
        PlantError,
    ) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    write_json({"evidence": Evidence.MEASURED, "runs": runs}, options.output)
    console.print(table(runs))
    for r in runs:
        if r.mismatch is not None:
            flight = Flight(r.controller, r.experiment)
            console.print(f"[bold red]{r.board}, {flight}[/]: {escape(str(r.mismatch))}")
    with suppress(ValueError):
        console.print(f"figures: {options.output.resolve().relative_to(REPOSITORY)}")
    return 0 if all(r.equal for r in runs) else 1


if __name__ == "__main__":
    sys.exit(stoppable(main))
