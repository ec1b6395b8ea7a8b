"""The instructions of a program, as the toolchain's objdump prints them.

What a library brings along has no call graph and no source here: its stack and its cycles are read
from the instructions themselves.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from verification.firmware import Board, ToolError, tool

_LINE = re.compile(
    r"^\s*(?P<address>[0-9a-f]+):\t(?P<code>[0-9a-f]+(?: [0-9a-f]+)*)\s*\t(?P<text>[^@;]+)"
)


@dataclass(frozen=True)
class Instruction:
    """One instruction.

    Attributes:
        address: where it stands.
        size: bytes.
        mnemonic: as printed, without a width (``.n``, ``.w``): ``ldmia``, ``vadd.f32``, ``bne``.
        operands: as printed, without the comment behind them.
    """

    address: int
    size: int
    mnemonic: str
    operands: str = ""

    @property
    def next_address(self) -> int:
        """Where execution goes on if this is no jump."""
        return self.address + self.size

    def __str__(self) -> str:
        return f"{self.mnemonic} {self.operands} at {self.address:#x}"


Program = Mapping[int, Instruction]
"""Instructions by their address."""


def parse(listing: str) -> Program:
    """What ``objdump -d`` printed; data between the code is left out."""
    found: dict[int, Instruction] = {}
    for match in filter(None, map(_LINE.match, listing.splitlines())):
        mnemonic, *operands = match["text"].split(maxsplit=1)
        if mnemonic.startswith("."):
            continue
        address = int(match["address"], 16)
        found[address] = Instruction(
            address,
            len(match["code"].replace(" ", "")) // 2,
            mnemonic.removesuffix(".n").removesuffix(".w"),
            operands[0].strip() if operands else "",
        )
    return found


def disassemble(board: Board, elf: Path) -> Program:
    """The instructions of a linked program.

    Raises:
        ToolError: objdump is missing or reports an error.
    """
    return parse(_binutil(board, "objdump", "-d", str(elf)))


def functions(board: Board, elf: Path) -> dict[str, int]:
    """Where each function of a linked program stands.

    Raises:
        ToolError: nm is missing or reports an error.
    """
    lines = (line.split() for line in _binutil(board, "nm", str(elf)).splitlines())
    return {w[-1]: int(w[0], 16) for w in lines if len(w) == 3 and w[1] in "tTwW"}


def _binutil(board: Board, name: str, *arguments: str) -> str:
    program = tool(f"{board.toolchain}{name}", board.toolchain_package.replace("gcc", "binutils"))
    done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ToolError(f"{name} {' '.join(arguments)} failed:\n{done.stderr}")
    return done.stdout


# --- Operands of Thumb instructions -------------------------------------------------------------

_TARGET = re.compile(r"\b([0-9a-f]+) <")
_LIST = re.compile(r"\{([^}]*)\}")
_RANGE = re.compile(r"([rsd])(\d+)-\1(\d+)")


def jump_target(instruction: Instruction) -> int | None:
    """Where a jump or a call goes, or None if a register says so."""
    match = _TARGET.search(instruction.operands)
    return int(match[1], 16) if match else None


def registers_in_list(instruction: Instruction) -> list[str]:
    """The registers between braces; empty without any."""
    match = _LIST.search(instruction.operands)
    if match is None:
        return []
    found: list[str] = []
    for word in (w.strip() for w in match[1].split(",")):
        run = _RANGE.fullmatch(word)
        found += [f"{run[1]}{i}" for i in range(int(run[2]), int(run[3]) + 1)] if run else [word]
    return found
