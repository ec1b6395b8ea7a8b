"""Counts a program's instructions twice: by a TCG plugin, and by a timer of the guest.

The plugin counts every instruction that QEMU translates between two addresses. With -icount,
QEMU's virtual clock moves on by a fixed time for each instruction, so that a timer of the guest
counts them as well, by another way through QEMU. The two must agree in every tick.
"""

from __future__ import annotations

import struct
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from plant.units import units
from verification.bench.cycles import Run
from verification.bench.program import Program, core_folder, result_bytes, run
from verification.firmware import Board, ToolError, common_facts, emulator, facts, tool

SHIFT = 10
"""Under -icount an instruction takes 2^10 ns: many timer counts, so that rounding loses none."""

_TIMEOUT_S = 120.0
_TIMER_BITS = {"cortex-m": 24, "rv32": 32}
_FORMS = {"float": "f", "double": "d", "int32_t": "i"}


@dataclass(frozen=True)
class Replay:
    """What a program counted and answered in each tick, in the order of the inputs.

    Attributes:
        instructions: of the call, the step and its return, by the plugin.
        timer_instructions: the same by the guest's timer, without ``timer_overhead``.
        timer_overhead: instructions that the timer sees and the plugin doesn't, measured on an
            empty step: the second reading of the timer.
        stack_bytes: depth of the step's stack.
        runs: what was executed in the ticks that were to be recorded, all together.
        torque_Nm: the answers, one tuple a tick [N m].
    """

    instructions: tuple[int, ...]
    timer_instructions: tuple[int, ...]
    timer_overhead: int
    stack_bytes: tuple[int, ...]
    runs: tuple[Run, ...]
    torque_Nm: tuple[tuple[float, ...], ...]

    @property
    def disagreements(self) -> int:
        """Ticks in which the two counts differ."""
        return sum(a != b for a, b in zip(self.instructions, self.timer_instructions, strict=True))


def emulator_version(board: Board) -> str:
    """The emulator's own name and version.

    Raises:
        ToolError: it is missing.
    """
    program = tool(board.emulator[0], board.emulator_package)
    words = run([program, "--version"]).splitlines()[0].split()
    return f"QEMU {words[words.index('version') + 1]}"


@dataclass(frozen=True)
class _Results:
    timer: tuple[int, ...]
    stack: tuple[int, ...]
    torque: tuple[tuple[float, ...], ...]


def replay(program: Program, plugin: Path, ticks: int, recorded: int = 0) -> Replay:
    """Runs a program twice, once with each way to count.

    Args:
        program: from :func:`verification.bench.program.build`.
        plugin: from :func:`verification.bench.program.plugin`.
        ticks: how many inputs it replays.
        recorded: in how many of them, from the first on, the instructions are recorded.

    Raises:
        ToolError: the emulator is missing or failed, or a timer can't hold what it counted.
    """
    listing = program.elf.with_suffix(".counts")
    trace = program.elf.with_suffix(".runs")
    arguments = f"{plugin},begin={program.begin:#x},end={program.end:#x},out={listing}"
    if recorded:
        # The pass before the first input is the empty step.
        arguments += f",runs={trace},first=1,last={recorded}"
    counted = _run(program, ("-plugin", arguments), ticks)
    counts = tuple(map(int, listing.read_text(encoding="utf-8").split()))
    if len(counts) != ticks + 1:
        raise ToolError(f"{program.elf}: the plugin saw {len(counts)} steps, not {ticks + 1}")
    timed = _run(program, ("-icount", f"shift={SHIFT}"), ticks)
    # As text, in which NaN equals itself.
    if repr(counted.torque[1:]) != repr(timed.torque[1:]):
        raise ToolError(f"{program.elf}: two runs with the same inputs gave different torques")
    per_instruction = _timer_counts_per_instruction(program)
    if max(counts) * per_instruction >= 2 ** _TIMER_BITS[core_folder(program.board)]:
        raise ToolError(f"{program.elf}: {max(counts)} instructions overflow the timer")
    by_timer = [_whole(value / per_instruction, program) for value in timed.timer]
    overhead = by_timer[0] - counts[0]
    return Replay(
        counts[1:],
        tuple(value - overhead for value in by_timer[1:]),
        overhead,
        counted.stack[1:],
        _read_runs(trace) if recorded else (),
        counted.torque[1:],
    )


def _read_runs(trace: Path) -> tuple[Run, ...]:
    lines = (line.split() for line in trace.read_text(encoding="utf-8").splitlines())
    return tuple(Run(int(a, 16), int(b, 16), int(c, 16), int(n)) for a, b, c, n in lines)


def _timer_counts_per_instruction(program: Program) -> float:
    """Timer counts in the virtual time of one instruction."""
    if core_folder(program.board) == "rv32":
        return float(2**SHIFT)  # mcycle counts virtual nanoseconds
    clock_hz = int(facts(program.board.folder / "board.mk")["TICK_CLOCK_HZ"])
    return float(2**SHIFT) * clock_hz / 1e9


def _whole(instructions: float, program: Program) -> int:
    # Each reading of the timer is rounded to a whole count, far less than an instruction.
    nearest = round(instructions)
    if abs(instructions - nearest) > 0.1:
        raise ToolError(f"{program.elf}: the timer counted {instructions} instructions")
    return nearest


def _run(program: Program, options: tuple[str, ...], ticks: int) -> _Results:
    semihosting = tuple(common_facts()["QEMU_SEMIHOSTING"].split())
    command = emulator(program.board, program.elf, (*semihosting, *options))
    try:
        done = subprocess.run(command, capture_output=True, check=False, timeout=_TIMEOUT_S)
    except subprocess.TimeoutExpired as error:
        raise ToolError(f"{' '.join(command)}: no end after {_TIMEOUT_S:.0f} s") from error
    controller = program.prepared.controller
    if done.returncode != 0 or len(done.stdout) != (ticks + 1) * result_bytes(controller):
        raise ToolError(
            f"{' '.join(command)} ended with status {done.returncode} and {len(done.stdout)} "
            f"bytes of results:\n{done.stderr.decode(errors='replace')}"
        )
    form = _FORMS[program.prepared.numbers]
    rows = list(struct.iter_unpack(f"<II{program.prepared.joints}{form}", done.stdout))
    torque = units(controller).torque
    return _Results(
        tuple(row[0] for row in rows),
        tuple(row[1] for row in rows),
        tuple(tuple(torque.physical(np.array(row[2:])).tolist()) for row in rows),
    )
