"""The program of ``target/``: compiled for the host as a library, for boards as an image.

On a board it reads what it is asked from a file of the host and writes its answers to another, by
semihosting; the image links the very object files of the firmware.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codegen.emit import REPOSITORY, identity
from plant.native import BUILD, CompilerError, compiler, sources_of
from plant.native import FLAGS as HOST_FLAGS
from plant.units import units
from verification.cases import Records
from verification.chain.vectors import case_type
from verification.equivalence import Compiled
from verification.firmware import STUB, Board, ToolError, build, common_facts, emulator, tool

TARGET = Path(__file__).parent / "target"
CHAIN_BUILD = BUILD / "chain"
STEPS = ("steps", "draw", "draw_floating_point", "draw_fixed_point")
"""The C that host and target share, without the suffix."""

UNWRITTEN = -12345
"""What a torque is where the step wrote none (``target/steps.h``)."""

STATUSES = (
    "stopped",
    "out of range",
    "not finite",
    "encoder jump",
    "not initialised",
    "bad configuration",
    "bad argument",
    "good",
    "saturated",
)
"""Statuses in the order of their numbers, from TDC_STOPPED = -7 to TDC_SATURATED = 1."""

FIRST_STATUS = -7

SUMMARY = np.dtype(
    [
        ("hash", "<u8"),
        ("statuses", "<u4", (len(STATUSES),)),
        ("refused", "<u4"),
        ("refused_torques", "<u4"),
        ("nothing", "<u4"),
    ]
)
"""The C's ``block_summary``."""

# Folders with the objects of the firmware.
_PARTS = ("controller", "cores", "runtime", "pil")

_HELLO_MAGIC = 0x43484132
_TAKE_CASES, _TAKE_BLOCKS, _RECORD_BLOCK = 1, 2, 3
_HELLO_BYTES = 20

# A block takes milliseconds: a target that writes nothing for this long has crashed.
SILENCE_S = 20.0
_LOOK_AFTER_S = 0.02


@dataclass(frozen=True)
class Blocks:
    """Which random steps: blocks of a size, numbered from 0."""

    count: int
    steps: int


def result_type(library: Compiled) -> np.dtype[np.void]:
    """The C's ``step_result``; a torque is named with its unit, as in the controller's own C."""
    joints = len(library.controller.joints)
    name = units(library.controller).torque.field.removeprefix("applied_")
    return np.dtype(
        [
            ("status", "<i4"),
            (name, np.dtype(library.types.torque), (joints,)),
            ("state", np.dtype(library.types.state)),
        ]
    )


def _defines(library: Compiled) -> tuple[str, ...]:
    name = library.controller.name
    return (f"-DCONTROLLER={name}", f"-DCONTROLLER_UPPER={name.upper()}")


# --- On the host -------------------------------------------------------------------------------


class Host:
    """The steps on this computer.

    Args:
        library: the controller; its generated C is compiled together with the steps.
        generated: the directory of the C, instead of the controller's own.
        flags: more compiler flags, behind those that the C ships with.

    Raises:
        plant.native.CompilerError: the compiler is missing or reports an error.
    """

    def __init__(
        self, library: Compiled, generated: Path | None = None, flags: Sequence[str] = ()
    ) -> None:
        self._library = library
        directory = generated or sources_of(library.controller)
        CHAIN_BUILD.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=CHAIN_BUILD) as scratch:
            path = Path(scratch) / "steps.so"
            own = (TARGET / f"{source}.c" for source in STEPS)
            sources = (*own, *sorted(directory.glob("*.c")))
            command = [compiler(), *HOST_FLAGS, f"-I{REPOSITORY}", f"-I{directory}"]
            command += [*_defines(library), *flags, *map(str, sources), "-o", str(path)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise CompilerError(f"{' '.join(command)} failed:\n{done.stderr}")
            self._c = ctypes.CDLL(str(path))

    def take(self, records: Records) -> Records:
        """The results of single steps."""
        cases = np.ascontiguousarray(records)
        results = np.zeros(len(cases), result_type(self._library))
        self._c.step_take_all(_address(cases), _address(results), ctypes.c_uint32(len(cases)))
        return results

    def summaries(self, blocks: Blocks) -> Records:
        """The summaries of random blocks."""
        results = np.zeros(blocks.count, SUMMARY)
        for block in range(blocks.count):
            self._c.block_take(
                ctypes.c_uint32(block),
                ctypes.c_uint32(blocks.steps),
                _address(results[block : block + 1]),
                None,
                None,
            )
        return results

    def record(self, block: int, steps: int) -> tuple[Records, Records]:
        """All steps of a random block with their results."""
        cases = np.zeros(steps, case_type(self._library))
        results = np.zeros(steps, result_type(self._library))
        self._c.block_record(
            ctypes.c_uint32(block), ctypes.c_uint32(steps), _address(cases), _address(results)
        )
        return cases, results


def _address(array: NDArray[np.void]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


# --- On a board --------------------------------------------------------------------------------


def image(
    board: Board,
    library: Compiled,
    generated: Path | None = None,
    output: Path | None = None,
    flags: Sequence[str] = (),
) -> Path:
    """Builds the program for a board, around the object files of its firmware.

    Args:
        board: the board.
        library: the controller.
        generated: the directory of the C, instead of the controller's own.
        output: a directory for the result; necessary with other C or more flags.
        flags: more compiler flags, behind those that the C ships with.

    Raises:
        verification.firmware.ToolError: a tool is missing or reports an error.
    """
    name = library.controller.name
    directory = generated or sources_of(library.controller)
    folder = output or CHAIN_BUILD / board.name / name
    build(board, name, "pil", generated=directory, output=folder, extra_flags=" ".join(flags))
    # All of the firmware's objects are linked but the one with its main program.
    shipped = [p for part in _PARTS for p in sorted((folder / part).rglob("*.o"))]
    elf = folder / "chain.elf"
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        own = [
            _compile(board, library, TARGET / f"{source}.c", directory, Path(scratch), flags)
            for source in (*STEPS, "main")
        ]
        fresh = Path(scratch) / elf.name
        _run(
            [
                *(_gcc(board), *board.cpu_flags, *common_facts()["LINK_FLAGS"].split()),
                *(f"-L{board.folder}", "-T", str(STUB / "cores" / "sections.ld")),
                f"-Wl,--defsym=STACK_BYTES={common_facts()['STACK_BYTES']}",
                *(str(p) for p in (*own, *shipped) if p.name != "pil.o"),
                *("-lgcc", "-o", str(fresh)),
            ]
        )
        # A rename is atomic: two runs at the same time see a whole program or none.
        fresh.replace(elf)
    return elf


def _gcc(board: Board) -> str:
    return tool(f"{board.toolchain}gcc", board.toolchain_package)


def _compile(
    board: Board,
    library: Compiled,
    source: Path,
    generated: Path,
    folder: Path,
    flags: Sequence[str],
) -> Path:
    facts = common_facts()
    shared = [
        w for k in ("C_FLAGS", "FREESTANDING_FLAGS", "WARNING_FLAGS") for w in facts[k].split()
    ]
    includes = [f"-I{path}" for path in (REPOSITORY, STUB, STUB / "include", generated)]
    target = folder / f"{source.stem}.o"
    command = [_gcc(board), *board.cpu_flags, *shared, *includes, *_defines(library), *flags]
    _run([*command, "-c", str(source), "-o", str(target)])
    return target


def _run(command: Sequence[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ToolError(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")


class Target:
    """The steps on an emulated board; each call is one run of the emulator.

    Args:
        board: the board.
        elf: its image, from :func:`image`.
        library: the controller.
    """

    def __init__(self, board: Board, elf: Path, library: Compiled) -> None:
        self.board = board
        self._elf = elf.resolve()
        self._library = library
        self._case, self._result = case_type(library), result_type(library)

    def take(self, records: Records) -> Records:
        """The results of single steps.

        Raises:
            verification.firmware.ToolError: the emulator is missing, or the program failed.
        """
        asked = _request(_TAKE_CASES, 0, len(records), 0) + np.ascontiguousarray(records).tobytes()
        answer = self._ask(asked, len(records) * self._result.itemsize)
        return np.frombuffer(answer, self._result)

    def summaries(self, blocks: Blocks, advance: Callable[[int], None] = lambda _: None) -> Records:
        """The summaries of random blocks.

        Args:
            blocks: which.
            advance: told how many more steps were taken, now and then.

        Raises:
            verification.firmware.ToolError: the emulator is missing, or the program failed.
        """
        asked = _request(_TAKE_BLOCKS, 0, blocks.count, blocks.steps)
        size = SUMMARY.itemsize
        answer = self._ask(
            asked, blocks.count * size, lambda new: advance(new // size * blocks.steps), size
        )
        return np.frombuffer(answer, SUMMARY)

    def record(self, block: int, steps: int) -> tuple[Records, Records]:
        """All steps of a random block with their results.

        Raises:
            verification.firmware.ToolError: the emulator is missing, or the program failed.
        """
        both = np.dtype([("case", self._case), ("result", self._result)])
        asked = _request(_RECORD_BLOCK, block, 1, steps)
        pairs = np.frombuffer(self._ask(asked, steps * both.itemsize), both)
        return pairs["case"], pairs["result"]

    def _ask(
        self,
        asked: bytes,
        answer_bytes: int,
        advance: Callable[[int], None] = lambda _: None,
        unit: int = 1,
    ) -> bytes:
        with tempfile.TemporaryDirectory(prefix="tdc-chain-") as scratch:
            folder = Path(scratch)
            (folder / "from_host").write_bytes(asked)
            answers = folder / "to_host"
            options = common_facts()["QEMU_SEMIHOSTING"].split()
            with (folder / "messages").open("wb") as messages:
                process = subprocess.Popen(
                    emulator(self.board, self._elf, options),
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=messages,
                    stderr=messages,
                )
                try:
                    _watch(process, answers, advance, unit)
                finally:
                    process.kill()
                    process.wait()
            data = answers.read_bytes() if answers.exists() else b""
            said = (folder / "messages").read_text(errors="replace").strip()
        expected = _HELLO_BYTES + answer_bytes
        hello = data[:_HELLO_BYTES]
        if len(hello) == _HELLO_BYTES and hello != self._hello():
            raise ToolError(
                f"{self._elf} on {self.board.name} is no program for this controller: it says "
                f"{np.frombuffer(hello, '<u4').tolist()}, not "
                f"{np.frombuffer(self._hello(), '<u4').tolist()}"
            )
        if process.returncode != 0 or len(data) != expected:
            raise ToolError(
                f"{self._elf} on {self.board.name} ended with {process.returncode} after "
                f"{len(data)} of {expected} bytes; the emulator says:\n{said}"
            )
        return data[_HELLO_BYTES:]

    def _hello(self) -> bytes:
        sizes = (self._case.itemsize, self._result.itemsize, SUMMARY.itemsize)
        words = [_HELLO_MAGIC, identity(self._library.controller), *sizes]
        return np.array(words, "<u4").tobytes()


def _request(command: int, first: int, count: int, steps: int) -> bytes:
    return np.array([command, first, count, steps], "<u4").tobytes()


def _watch(
    process: subprocess.Popen[bytes], answers: Path, advance: Callable[[int], None], unit: int
) -> None:
    """Waits for the end of the emulator, or for its silence, and tells how the answers grow."""
    seen, last = _HELLO_BYTES, time.monotonic()
    has_ended = False
    while not has_ended and time.monotonic() - last < SILENCE_S:
        time.sleep(_LOOK_AFTER_S)
        has_ended = process.poll() is not None
        size = answers.stat().st_size if answers.exists() else 0
        whole = (size - seen) // unit * unit
        if whole > 0:
            advance(whole)
            seen, last = seen + whole, time.monotonic()
