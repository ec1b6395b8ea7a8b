"""Where a step's instructions go: to the powers, the law, the checks, and what holds it together.

The compiler says from which function each instruction comes, through all that it inlined
(``addr2line -i``). Where it mixed the instructions of two functions, it still keeps them apart.
"""

from __future__ import annotations

import re
import subprocess
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from enum import Enum
from pathlib import Path

from verification.firmware import Board, ToolError, tool


class Part(Enum):
    """What an instruction is for."""

    POWERS = "powers"
    LAW = "law"
    CHECKS = "checks"
    FRAME = "call and loop"
    LIBRARY = "library"

    @property
    def meaning(self) -> str:
        """One sentence."""
        return _MEANING[self]


_MEANING = {
    Part.POWERS: "the three powers of each joint, without what they call of the library",
    Part.LAW: "everything else of the law, from counts to a torque within its limit",
    Part.CHECKS: "encoder jumps, references out of range, torques beyond the limit or not finite",
    Part.FRAME: "the call, the loop over the joints, and committing all of them or none",
    Part.LIBRARY: "the compiler's own functions, which compute with float where there is no FPU",
}

_CHECKS = {
    "beyond_displacement",
    "tdc_beyond",
    "tdc_beyond64",
    "joint_faults",
    "all_faults",
    "settle",
    "error_torque",
}
_LAW = {"joint_step", "measure"}


def part_of(chain: Sequence[tuple[str, str]], own: Set[str]) -> Part:
    """The part that an instruction belongs to.

    Args:
        chain: function and source file, from the innermost inlined function outwards.
        own: names of this project's source files.
    """
    functions = [name for name, _ in chain]
    if not any(file in own for _, file in chain):
        return Part.LIBRARY
    if any("sig_pow" in name for name in functions):
        return Part.POWERS
    if _CHECKS.intersection(functions):
        return Part.CHECKS
    return Part.LAW if _LAW.intersection(functions) else Part.FRAME


def parts(board: Board, elf: Path, own: Set[str], executed: Mapping[int, int]) -> dict[str, int]:
    """Executed instructions by part; their sum is that of ``executed``.

    Args:
        board: where the program runs.
        elf: the program, with debug information.
        own: names of this project's source files.
        executed: how often the instruction at each address was executed.

    Raises:
        ToolError: addr2line is missing or failed.
    """
    found: Counter[str] = Counter({part.value: 0 for part in Part})
    for address, chain in _chains(board, elf, sorted(executed)).items():
        found[part_of(chain, own).value] += executed[address]
    return dict(found)


def _chains(
    board: Board, elf: Path, addresses: list[int]
) -> dict[int, tuple[tuple[str, str], ...]]:
    """Of each address the functions that it is inlined into, the innermost first."""
    package = board.toolchain_package.replace("gcc", "binutils")
    command = [tool(f"{board.toolchain}addr2line", package), "-afi", "-e", str(elf)]
    asked = "\n".join(map(hex, addresses))
    done = subprocess.run(command, input=asked, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ToolError(f"{' '.join(command)} failed:\n{done.stderr}")
    answers = re.split(r"^0x[0-9a-f]+\n", done.stdout, flags=re.MULTILINE)[1:]
    return {
        address: _pairs(answer.splitlines())
        for address, answer in zip(addresses, answers, strict=True)
    }


def _pairs(lines: list[str]) -> tuple[tuple[str, str], ...]:
    files = (Path(place.rpartition(":")[0]).name for place in lines[1::2])
    return tuple(zip(lines[::2], files, strict=True))
