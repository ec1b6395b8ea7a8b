"""The firmware of `firmware_stub/`: its boards, its build, and the emulators that run it.

Every fact about a board (compiler, CPU flags, emulator) stands in `firmware_stub/**/*.mk`, which
make and this module both read.
"""

from __future__ import annotations

import fcntl
import os
import select
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from codegen.emit import REPOSITORY
from plant.native import BUILD

STUB = REPOSITORY / "firmware_stub"
FIRMWARE_BUILD = BUILD / "firmware"

SERIAL_ON_STDIO = ("-chardev", "stdio,id=console,signal=off", "-serial", "chardev:console")
"""Emulator options that put the board's serial port on standard input and output."""


class ToolError(Exception):
    """A compiler or emulator is missing or failed; the message says which and what to do."""


@dataclass(frozen=True)
class Board:
    """A board as its `board.mk` and its core's `core.mk` tell it.

    Attributes:
        name: of the folder in `firmware_stub/boards`.
        core: the processor, for people.
        toolchain: prefix of the compiler and its tools.
        toolchain_package: the Debian package that has them.
        cpu_flags: what every compiler call needs to make code for this processor.
        startup: the function that the stack begins with.
        tick_handler: the function that the tick's interrupt begins with.
        interrupt_frame_bytes: what the processor pushes on the stack at an interrupt.
        emulator: command line that stands for the board, without options for the console; empty
            for a board that exists as hardware only.
        emulator_package: the Debian package that has it.
    """

    name: str
    core: str
    toolchain: str
    toolchain_package: str
    cpu_flags: tuple[str, ...]
    startup: str
    tick_handler: str
    interrupt_frame_bytes: int
    emulator: tuple[str, ...]
    emulator_package: str

    @property
    def folder(self) -> Path:
        """Where the board's own files are."""
        return STUB / "boards" / self.name


def facts(path: Path) -> dict[str, str]:
    """The assignments ``NAME := value`` of a makefile that has nothing else.

    Raises:
        ToolError: a line is something else.
    """
    found: dict[str, str] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line or line.startswith("#"):
            continue
        name, assigned, value = line.partition(" := ")
        if not assigned or "$" in value:
            raise ToolError(f"{path}: not of the form NAME := value: {line!r}")
        found[name] = value
    return found


def common_facts() -> dict[str, str]:
    """The facts of `common.mk`, which hold for every board."""
    return facts(STUB / "common.mk")


def board_names() -> list[str]:
    """All boards, in a fixed order."""
    return sorted(path.parent.name for path in (STUB / "boards").glob("*/board.mk"))


def emulated_board_names() -> list[str]:
    """The boards that an emulator stands for."""
    return [name for name in board_names() if load_board(name).emulator]


def load_board(name: str) -> Board:
    """A board by its name.

    Raises:
        ToolError: there is no such board.
    """
    if name not in board_names():
        raise ToolError(f"no board {name!r}; there are {', '.join(board_names())}")
    own = facts(STUB / "boards" / name / "board.mk")
    core = facts(STUB / "cores" / own["CORE"] / "core.mk")
    common = common_facts()
    return Board(
        name=name,
        core=own["CORE_NAME"],
        toolchain=core["TOOLCHAIN"],
        toolchain_package=core["TOOLCHAIN_PACKAGE"],
        cpu_flags=tuple(own["CPU_FLAGS"].split()),
        startup=core["STARTUP"],
        tick_handler=core["TICK_HANDLER"],
        interrupt_frame_bytes=int(own["INTERRUPT_FRAME_BYTES"]),
        emulator=(*own["QEMU"].split(), *common["QEMU_OPTIONS"].split()) if "QEMU" in own else (),
        emulator_package=own.get("QEMU_PACKAGE", ""),
    )


def tool(name: str, package: str) -> str:
    """The path of a program.

    Raises:
        ToolError: it is not installed; the message names the Debian package.
    """
    path = shutil.which(name)
    if path is None:
        raise ToolError(f"{name} not found: install it (Debian: apt-get install {package})")
    return path


def compile_flags() -> tuple[str, ...]:
    """How the generated C is compiled for shipping: standard, optimisation, rounding."""
    return tuple(common_facts()["C_FLAGS"].split())


def build(
    board: Board,
    controller: str,
    image: str,
    *,
    generated: Path | None = None,
    output: Path | None = None,
    extra_flags: str = "",
) -> Path:
    """Builds an image with `firmware_stub/Makefile`; what is up to date stays.

    Args:
        board: the board to build for.
        controller: name of the controller.
        image: ``app``, ``pil`` or ``pil_uart``.
        generated: the directory of the generated C, instead of `generated/NAME`.
        output: a directory for the result; necessary with any of the other options.
        extra_flags: more compiler flags.

    Returns:
        The ELF file.

    Raises:
        ToolError: the compiler or make is missing or reports an error.
    """
    tool("make", "make")
    tool(f"{board.toolchain}gcc", board.toolchain_package)
    directory = output or FIRMWARE_BUILD / board.name / controller
    target = directory / f"{image}.elf"
    settings = {
        "BOARD": board.name,
        "CONTROLLER": controller,
        "OUT": str(directory),
        "EXTRA_FLAGS": extra_flags,
    }
    if generated is not None:
        settings["GENERATED"] = str(generated)
    with _locked(directory):
        _make(target, settings)
    return target


def _make(target: Path, settings: Mapping[str, str]) -> None:
    words = [f"{name}={value}" for name, value in settings.items()]
    # A make that calls us passes its own flags and job server on, which are not meant for this one.
    environment = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS")}
    done = subprocess.run(
        ["make", "--no-print-directory", "-C", str(STUB), *words, str(target)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    if done.returncode != 0:
        raise ToolError(f"the firmware {target} was not built:\n{done.stdout}{done.stderr}")


@contextmanager
def _locked(directory: Path) -> Iterator[None]:
    """Keeps two processes from building into the same directory at the same time."""
    directory.mkdir(parents=True, exist_ok=True)
    with (directory / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def emulator(board: Board, image: Path, options: Sequence[str] = ()) -> list[str]:
    """The command that runs an image on the emulated board; it dies with the caller.

    Raises:
        ToolError: there is no emulator, or it is not installed.
    """
    if not board.emulator:
        raise ToolError(f"{board.name} has no emulator: no QEMU in its board.mk")
    program = tool(board.emulator[0], board.emulator_package)
    command = [program, *board.emulator[1:], *options, "-kernel", str(image)]
    # An emulator whose starter was killed would spin for ever.
    leash = shutil.which("setpriv")
    return command if leash is None else [leash, "--pdeathsig", "KILL", *command]


class Application:
    """The application of an emulated board with its console; a context manager.

    Time is counted in instructions and skips what the processor sleeps, so that a run takes the
    same course on any host, as fast as it can; only when a key arrives is left to chance.

    Args:
        board: the board.
        image: its `app.elf`.

    Raises:
        ToolError: the emulator is missing.
    """

    def __init__(self, board: Board, image: Path) -> None:
        steady = common_facts()["QEMU_STEADY_CLOCK"] + ",sleep=off"
        options = (*SERIAL_ON_STDIO, *steady.split())
        self.lines: list[str] = []
        self._partial = b""
        self._process = subprocess.Popen(
            emulator(board, image, options),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,
        )

    def __enter__(self) -> Self:
        """The application itself, ready for keys."""
        try:
            # A serial port forgets what comes before the firmware has set it up.
            self.wait_for(lambda line: line.startswith("# tick"))
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Ends the emulator."""
        self._end()

    def _end(self) -> None:
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()

    def press(self, key: str) -> None:
        """Sends a key."""
        assert self._process.stdin is not None
        self._process.stdin.write(key.encode())

    def wait_for(self, wanted: Callable[[str], bool], timeout_s: float = 20.0) -> str:
        """The next line for which ``wanted`` is true; all lines go to ``lines``.

        Raises:
            ToolError: it did not come in time.
        """
        assert self._process.stdout is not None
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            while b"\n" in self._partial:
                first, _, self._partial = self._partial.partition(b"\n")
                line = first.decode(errors="replace")
                self.lines.append(line)
                if wanted(line):
                    return line
            ready, _, _ = select.select([self._process.stdout], [], [], 0.2)
            if ready:
                part = os.read(self._process.stdout.fileno(), 65536)
                if not part:
                    break
                self._partial += part
        last = "\n".join(self.lines[-5:])
        raise ToolError(f"the application did not say what was waited for; its last lines:\n{last}")
