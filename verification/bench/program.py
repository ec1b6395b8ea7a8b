"""Compiles and links the bench's programs, and weighs them.

Every variant is compiled with the same flags, those that the generated C is shipped with, and
linked with the C library that the toolchain comes with: newlib for Cortex-M, picolibc for RISC-V.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from codegen.controller import Controller
from codegen.emit import REPOSITORY, generate, write
from codegen.rendering import environment
from plant.controller import structures
from plant.native import compiler
from verification.bench.recording import Replayed, controller_of, input_bytes, sequence_bytes
from verification.bench.variants import PACKAGE, TARGET, TEMPLATES, Variant
from verification.firmware import (
    STUB,
    Board,
    ToolError,
    compile_flags,
    facts,
    tool,
)

# Functions and tables in sections of their own, so that the linker can drop what is not used.
_SECTION_FLAGS = ("-ffunction-sections", "-fdata-sections")
_STACK_BYTES = 8192


@dataclass(frozen=True)
class Library:
    """The C library of a toolchain.

    Attributes:
        name: for people.
        package: the Debian package that has it.
        flags: what makes the compiler use it.
    """

    name: str
    package: str
    flags: tuple[str, ...]


_LIBRARIES = {
    "arm-none-eabi-": Library("newlib", "libnewlib-arm-none-eabi", ()),
    "riscv64-unknown-elf-": Library(
        "picolibc", "picolibc-riscv64-unknown-elf", ("--specs=picolibc.specs",)
    ),
}


@dataclass(frozen=True)
class Prepared:
    """A variant's C for one controller, the same for every board.

    Attributes:
        variant: which.
        controller: the specification.
        generated: directory of this project's C, whose header every variant includes.
        sources: the C files of the variant.
        directory: what was written for it.
    """

    variant: Variant
    controller: Controller
    generated: Path
    sources: tuple[Path, ...]
    directory: Path

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.controller.joints)

    @property
    def numbers(self) -> str:
        """The C type of its torques: variants with the same one take the same inputs."""
        return self.controller.arithmetic.torque


@dataclass(frozen=True)
class Data:
    """The recorded inputs as an assembly source and the binaries it includes."""

    source: Path
    ticks: int


@dataclass(frozen=True)
class Program:
    """A linked program on a board.

    Attributes:
        prepared: the variant.
        board: where it runs.
        elf: the program.
        begin: address where counting starts, the call of the step.
        end: address where it ends, behind the call.
        flash_bytes: what the step adds to a program: code, tables and initial values.
    """

    prepared: Prepared
    board: Board
    elf: Path
    begin: int
    end: int
    flash_bytes: int


@dataclass(frozen=True)
class Harness:
    """What all programs of a board, a number of joints and numbers share.

    Attributes:
        objects: of the program that replays and measures.
        weigh: of the program that is only weighed.
        bytes_without_step: that program's weight around an empty step.
    """

    objects: tuple[Path, ...]
    weigh: Path
    bytes_without_step: int


def library(board: Board) -> Library:
    """The C library that a board's programs are linked with."""
    return _LIBRARIES[board.toolchain]


def core_folder(board: Board) -> str:
    """Name of the folder in ``firmware_stub/cores`` of a board's family of cores."""
    return facts(board.folder / "board.mk")["CORE"]


def prepare(variant: Variant, joints: int, directory: Path) -> Prepared:
    """Generates and writes a variant's C below a directory.

    Variants with the same gains and numbers share the generated C.

    Raises:
        codegen.emit.GenerationError: it could not be generated.
    """
    controller = controller_of(joints, variant.experiment, variant.numbers)
    return prepare_for(controller, variant, directory)


def prepare_for(controller: Controller, variant: Variant, directory: Path) -> Prepared:
    """Generates and writes a variant's C of any controller below a directory.

    Raises:
        codegen.emit.GenerationError: it could not be generated.
    """
    joints = len(controller.joints)
    chosen = (variant.experiment or "default", *(value for _, value in variant.numbers))
    shared = directory / "generated" / "-".join(chosen)
    generated = shared / controller.name
    if not generated.exists():
        write(generate(controller), shared)
    own = directory / "variants" / f"{variant.name}-{joints}"
    own.mkdir(parents=True)
    return Prepared(variant, controller, generated, variant.write(controller, generated, own), own)


def write_data(controller: Controller, sequences: tuple[Replayed, ...], directory: Path) -> Data:
    """Writes the inputs of all ticks in a controller's units, and the room for their results."""
    own = directory / f"data-{len(controller.joints)}-{controller.arithmetic.torque}"
    own.mkdir(parents=True)
    ticks = sum(len(s.ticks) for s in sequences)
    (own / "inputs.bin").write_bytes(input_bytes(controller, sequences))
    (own / "sequences.bin").write_bytes(sequence_bytes(controller, sequences))
    text = (
        environment(TEMPLATES)
        .get_template("data.S.j2")
        .render(sequences=len(sequences), results_bytes=(ticks + 1) * result_bytes(controller))
    )
    source = own / "data.S"
    source.write_text(text, encoding="utf-8")
    return Data(source, ticks)


def result_bytes(controller: Controller) -> int:
    """Size of a ``bench_result`` (see bench.h)."""
    return 8 + ctypes.sizeof(structures(controller).torque) * len(controller.joints)


def run(command: Sequence[str], directory: Path | None = None) -> str:
    """Runs a tool; returns what it printed.

    Raises:
        ToolError: it reports an error.
    """
    done = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ToolError(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
    return done.stdout


def flags(board: Board) -> tuple[str, ...]:
    """The compiler flags of a board's programs that shape the code."""
    return (*board.cpu_flags, *compile_flags(), *_SECTION_FLAGS, *library(board).flags)


def library_version(board: Board) -> str:
    """The version of the board's C library.

    Raises:
        ToolError: it isn't there; the message names the Debian package.
    """
    gcc = tool(f"{board.toolchain}gcc", board.toolchain_package)
    needed = library(board)
    command = [gcc, *flags(board), "-E", "-dM", "-include", "math.h", "-x", "c", os.devnull]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ToolError(
            f"{gcc} finds no {needed.name}: install it (Debian: apt-get install {needed.package})"
        )
    macro = f"#define _{needed.name.upper()}_VERSION "
    found = [line for line in done.stdout.splitlines() if line.startswith(macro)]
    return found[0].removeprefix(macro).strip('"') if found else "of unknown version"


def require_tools(board: Board) -> None:
    """Checks that everything is there, before the first program is built.

    Raises:
        ToolError: something isn't; the message names the Debian package.
    """
    library_version(board)
    for name in ("size", "nm", "addr2line"):
        _binutil(board, name)
    tool(board.emulator[0], board.emulator_package)


def compiler_version(board: Board) -> str:
    """The version of the board's compiler.

    Raises:
        ToolError: it is missing.
    """
    gcc = tool(f"{board.toolchain}gcc", board.toolchain_package)
    return run([gcc, "-dumpfullversion"]).strip()


def _gcc(board: Board, prepared: Prepared) -> list[str]:
    name = prepared.controller.name
    gcc = tool(f"{board.toolchain}gcc", board.toolchain_package)
    folders = (REPOSITORY, STUB, prepared.generated, prepared.directory)
    return [
        gcc,
        *flags(board),
        *(f"-I{folder}" for folder in folders),
        f"-DCONTROLLER={name}",
        f"-DCONTROLLER_UPPER={name.upper()}",
        f"-DBENCH_TORQUE={prepared.numbers}",
        "-g",  # changes no instruction, and tells from which function each one comes
    ]


def _link(
    board: Board, prepared: Prepared, objects: Sequence[Path], target: Path, entry: str
) -> Path:
    run(
        [
            *_gcc(board, prepared),
            *("-nostartfiles", "-static", "-Wl,--gc-sections", f"-Wl,-e,{entry}"),
            *(f"-L{board.folder}", "-T", str(STUB / "cores" / "sections.ld")),
            f"-Wl,--defsym=STACK_BYTES={_STACK_BYTES}",
            *map(str, objects),
            *("-lm", "-o", str(target)),
        ]
    )
    return target


def _compile(
    board: Board, prepared: Prepared, source: Path, target: Path, more: Sequence[str] = ()
) -> Path:
    target.parent.mkdir(parents=True, exist_ok=True)
    command = [*_gcc(board, prepared), *more, "-c", str(source), "-o", str(target)]
    # The recorded inputs are included from where their source is.
    run(command, source.parent)
    return target


def harness(board: Board, prepared: Prepared, data: Data, directory: Path) -> Harness:
    """Compiles what is the same in all programs of a board, a number of joints and numbers.

    Args:
        board: what to compile for.
        prepared: any variant with that number of joints and those numbers.
        data: the inputs.
        directory: where object files go.

    Raises:
        ToolError: a tool is missing or reports an error.
    """
    folder = directory / "harness" / f"{board.name}-{prepared.joints}-{prepared.numbers}"
    core = core_folder(board)
    cores = STUB / "cores" / core
    sources = [
        (TARGET / "main.c", "main.o"),
        (TARGET / f"timed_call_{core}.S", "timed_call.o"),
        *((path, f"core_{path.stem}.o") for path in sorted(cores.glob("*.[cS]"))),
        (STUB / "runtime" / "start.c", "start.o"),
        (data.source, "data.o"),
    ]
    objects = tuple(_compile(board, prepared, path, folder / name) for path, name in sources)
    weigh = _compile(board, prepared, TARGET / "weigh.c", folder / "weigh.o")
    empty = _compile(board, prepared, TARGET / "empty.c", folder / "empty.o")
    bytes_without_step = _weight(board, prepared, (weigh, empty), folder / "empty.elf")
    return Harness(objects, weigh, bytes_without_step)


def _weight(board: Board, prepared: Prepared, objects: Sequence[Path], elf: Path) -> int:
    """Bytes in flash of a program of these objects, from what ``main`` reaches."""
    _link(board, prepared, objects, elf, "main")
    text, data = run([_binutil(board, "size"), str(elf)]).splitlines()[1].split()[:2]
    return int(text) + int(data)


def build(board: Board, prepared: Prepared, common: Harness, directory: Path) -> Program:
    """Compiles, links and weighs a variant on a board.

    Args:
        board: what to compile for.
        prepared: the variant's C.
        common: from :func:`harness`, for this board, number of joints and numbers.
        directory: where programs go.

    Raises:
        ToolError: a tool is missing or reports an error.
    """
    folder = directory / "programs" / f"{board.name}-{prepared.joints}" / prepared.variant.name
    objects = tuple(
        _compile(board, prepared, source, folder / f"{source.stem}.o", prepared.variant.flags)
        for source in prepared.sources
    )
    elf = folder / "bench.elf"
    _link(board, prepared, (*common.objects, *objects), elf, "reset_handler")
    weight = _weight(board, prepared, (common.weigh, *objects), folder / "weigh.elf")
    symbols = _symbols(board, elf)
    return Program(
        prepared,
        board,
        elf,
        symbols["bench_begin"],
        symbols["bench_end"],
        weight - common.bytes_without_step,
    )


def _binutil(board: Board, name: str) -> str:
    return tool(f"{board.toolchain}{name}", board.toolchain_package.replace("gcc", "binutils"))


def _symbols(board: Board, elf: Path) -> dict[str, int]:
    lines = (line.split() for line in run([_binutil(board, "nm"), str(elf)]).splitlines())
    return {words[-1]: int(words[0], 16) for words in lines if len(words) == 3}


def plugin(directory: Path, source: Path = PACKAGE / "plugin.c") -> Path:
    """The TCG plugin that counts instructions, compiled for this computer.

    Raises:
        plant.native.CompilerError: the compiler is missing.
        ToolError: it reports an error.
    """
    target = directory / "count.so"
    run(
        [
            *(compiler(), "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared"),
            *(str(source), "-o", str(target)),
        ]
    )
    return target
