"""What a controller costs on each board: flash, static RAM, and stack in two independent ways.

The static stack is the deepest path through the call graph that GCC writes, with the frame sizes
of -fstack-usage; what the compiler's own library takes, which has neither, is read from its
instructions. The painted stack is what a run on the emulated board really touched.
"""

from __future__ import annotations

import argparse
import ctypes
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.table import Table

from codegen.emit import REPOSITORY
from verification.commands.output import stoppable
from verification.disassembly import (
    Instruction,
    Program,
    disassemble,
    functions,
    jump_target,
    registers_in_list,
)
from verification.evidence import write_json
from verification.firmware import (
    FIRMWARE_BUILD,
    Application,
    Board,
    ToolError,
    build,
    common_facts,
    emulated_board_names,
    load_board,
    tool,
)
from verification.pil import Flight, fly
from verification.target import Target, TargetError

RESULT = FIRMWARE_BUILD / "size.json"
CONTROLLERS = ("puma3", "puma3_fixed", "puma6")
_MEASURED_TICKS = 100

# app_mode of firmware_stub/app.h.
DISABLED, RUNNING, FAULT = 0, 2, 3


class StackError(Exception):
    """The deepest path can't be told from the call graph; the message says why."""


# --- Static stack -----------------------------------------------------------------------------


@dataclass
class CallGraph:
    """Frame sizes and calls of a program, by GCC's names of functions.

    Attributes:
        frames: bytes of each function's frame.
        calls: whom each function calls.
    """

    frames: dict[str, int] = field(default_factory=dict)
    calls: dict[str, set[str]] = field(default_factory=dict)


@dataclass(frozen=True)
class StackPath:
    """A path of calls with the stack that it takes."""

    size: int
    functions: tuple[str, ...]


_NODE = re.compile(r'node: \{ title: "([^"]+)" label: "([^"]*)"')
_FRAME = re.compile(r"(\d+) bytes \((\w[\w,]*)\)")
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')


def read_call_graph(files: Iterable[Path]) -> CallGraph:
    """Reads what ``gcc -fcallgraph-info=su`` wrote, one ``.ci`` file for each object.

    Raises:
        StackError: a frame's size is not constant, or there is no file.
    """
    graph, texts = CallGraph(), [path.read_text(encoding="utf-8") for path in files]
    if not texts:
        raise StackError("no call graph: the firmware was not built with -fcallgraph-info=su")
    for text in texts:
        for title, label in _NODE.findall(text):
            frame = _FRAME.search(label)
            if frame is None:
                continue  # only declared here
            if frame[2] != "static":
                raise StackError(f"the frame of {title} has no constant size: {frame[0]}")
            graph.frames[title] = int(frame[1])
        for source, target in _EDGE.findall(text):
            graph.calls.setdefault(source, set()).add(target)
    return graph


def deepest(graph: CallGraph, start: str, above: tuple[str, ...] = ()) -> StackPath:
    """The path from a function on that takes most stack.

    Raises:
        StackError: a function is recursive, unknown, or called through a pointer.
    """
    if start in above:
        raise StackError(f"recursion: {' -> '.join((*above, start))}")
    if start not in graph.frames:
        raise StackError(f"{start}, called by {' -> '.join(above)}, has no known frame")
    below = [deepest(graph, f, (*above, start)) for f in sorted(graph.calls.get(start, ()))]
    worst = max(below, key=lambda path: path.size, default=StackPath(0, ()))
    return StackPath(graph.frames[start] + worst.size, (start, *worst.functions))


_IMMEDIATE = re.compile(r"#(-?\d+)")
_JUMP = re.compile(r"b(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)?|cbn?z")
_UNBOUNDED = 1 << 16
"""More stack than any function here has, in bytes: a loop pushes."""


@dataclass(frozen=True)
class Code:
    """A linked program for Thumb.

    Attributes:
        program: its instructions.
        symbols: addresses of functions by their names.
    """

    program: Program
    symbols: Mapping[str, int]

    def function(self, start: int) -> list[int]:
        """The addresses of a function's instructions: up to the next symbol."""
        end = min((a for a in self.symbols.values() if a > start), default=max(self.program) + 1)
        return [address for address in self.program if start <= address < end]


def stack_below(code: Code, start: int, above: tuple[int, ...] = ()) -> int:
    """Bytes of stack that a function takes with all that it calls, from its instructions.

    All ways through it are followed. A jump through a table may lead to whatever in the function
    nothing else leads to. Conditional execution counts as executed.

    Raises:
        StackError: it is recursive, calls through a register, or moves the stack pointer by
            something that is no constant.
    """
    if start in above:
        raise StackError(f"recursion at {start:#x}")
    depth_at: dict[int, int] = {}
    to_do, most, at_table = [(start, 0)], 0, -1
    while to_do:
        address, depth = to_do.pop()
        if depth <= depth_at.get(address, -1):
            continue
        depth_at[address] = depth
        instruction = code.program.get(address)
        if instruction is None or depth > _UNBOUNDED:
            raise StackError(f"no bound for the stack of the function at {start:#x}")
        depth += _growth(instruction)
        most = max(most, depth)
        target, name = jump_target(instruction), instruction.mnemonic
        if name == "bl" and target is not None:
            most = max(most, depth + stack_below(code, target, (*above, start)))
        elif name in ("bl", "blx"):
            raise StackError(f"a call through a register: {instruction}")
        elif _JUMP.fullmatch(name) and target is not None:
            to_do.append((target, depth))
        if name in ("mov", "tbb", "tbh") and re.search(r"\bpc\b", instruction.operands):
            at_table = max(at_table, depth)
        if not _ends(instruction):
            to_do.append((instruction.next_address, depth))
        if not to_do and at_table >= 0:
            to_do = [(a, at_table) for a in code.function(start) if a not in depth_at]
    return most


def _growth(instruction: Instruction) -> int:
    """Bytes by which an instruction moves the stack pointer down; negative where it goes up.

    Raises:
        StackError: by no constant.
    """
    name, operands = instruction.mnemonic, instruction.operands
    count = len(registers_in_list(instruction))
    constant = _IMMEDIATE.search(operands)
    if name == "push" or (name.startswith("stmdb") and operands.startswith("sp!")):
        return 4 * count
    if name == "pop" or (name.startswith("ldmia") and operands.startswith("sp!")):
        return -4 * count
    if name in ("add", "sub", "addw", "subw") and operands.startswith("sp,") and constant:
        return int(constant[1]) * (1 if name.startswith("sub") else -1)
    if "[sp, #" in operands and operands.endswith("]!") and constant:
        return -int(constant[1])
    if "[sp], #" in operands and constant:
        return -int(constant[1])
    if re.match(r"sp\b", operands) and not name.startswith("cmp"):
        raise StackError(f"the stack pointer moves by no constant: {instruction}")
    return 0


def _ends(instruction: Instruction) -> bool:
    """Whether execution never goes on behind this: a return, or a jump without a condition."""
    name, operands = instruction.mnemonic, instruction.operands
    if name in ("pop", "ldmia"):
        return "pc" in registers_in_list(instruction)
    return name in ("b", "bx", "tbb", "tbh", "udf") or operands.startswith("pc,")


def add_library(graph: CallGraph, code: Code) -> None:
    """Completes a call graph with the functions of the program that GCC wrote nothing about.

    They are the compiler's own, such as ``__aeabi_fadd``; each comes with all that it calls.

    Raises:
        StackError: see :func:`stack_below`.
    """
    called = {target for targets in graph.calls.values() for target in targets}
    for name in sorted(called - graph.frames.keys()):
        if name in code.symbols:
            graph.frames[name] = stack_below(code, code.symbols[name])
        elif name.startswith("__aeabi_"):
            graph.frames[name] = 0  # GCC thought of it and did without: it would have been linked


def objects_of(image: Path) -> list[Path]:
    """The object files that the linker's map says the image was made of."""
    text = image.with_suffix(".map").read_text(encoding="utf-8")
    loaded = re.findall(r"^LOAD (.+\.o)$", text, flags=re.MULTILINE)
    from_stub = [(REPOSITORY / "firmware_stub" / name).resolve() for name in loaded]
    return sorted(set(from_stub))


# --- All figures of a controller on a board ---------------------------------------------------


@dataclass(frozen=True)
class Memory:
    """Flash and static RAM in bytes; the stack's reserve is not part of it."""

    flash: int
    ram: int


@dataclass(frozen=True)
class Stack:
    """Bytes of stack.

    Attributes:
        static: the deepest path of the call graph.
        painted: the most that a run touched.
        path: the functions of the deepest path.
    """

    static: int
    painted: int
    path: tuple[str, ...]


@dataclass(frozen=True)
class Size:
    """What a controller costs on a board, alone and with the application around it.

    Attributes:
        board: its name.
        core: its processor.
        controller: its name.
        controller_memory: of the generated C, without the compiler's library that it needs on a
            processor without an FPU; its RAM is the state that the caller owns.
        config_bytes: of a configuration, should the caller keep one in RAM to tune it.
        controller_stack: below the caller of init or step.
        application_memory: of the whole firmware.
        application_stack: program, and the tick's interrupt on top of it.
        stack_reserved: what the linker sets aside.
    """

    board: str
    core: str
    controller: str
    controller_memory: Memory
    config_bytes: int
    controller_stack: Stack
    application_memory: Memory
    application_stack: Stack
    stack_reserved: int


def _sections(board: Board, file: Path) -> dict[str, int]:
    """Sizes of an ELF file's sections by name."""
    program = tool(f"{board.toolchain}size", board.toolchain_package)
    done = subprocess.run(
        [program, "-A", "-d", str(file)], capture_output=True, text=True, check=True
    )
    return {m[1]: int(m[2]) for m in re.finditer(r"^(\.\S+)\s+(\d+)\s", done.stdout, re.MULTILINE)}


def _memory(sections: dict[str, int]) -> Memory:
    def total(*names: str) -> int:
        return sum(size for name, size in sections.items() if name.startswith(tuple(names)))

    code, data = total(".text", ".rodata", ".srodata"), total(".data", ".sdata")
    return Memory(flash=code + data, ram=data + total(".bss", ".sbss"))


def measure(board: Board, name: str) -> Size:
    """Builds a controller's firmware and takes its size, the stack also in a run.

    Raises:
        ToolError, TargetError: a tool is missing, or the firmware does not run.
        StackError: the static bound is not one: the call graph is incomplete, or a run took more.
    """
    app, pil = build(board, name, "app"), build(board, name, "pil")
    host = Flight(name).tuned()
    alone = _controller_memory(board, app.parent / "controller", ctypes.sizeof(host.state))
    return Size(
        board=board.name,
        core=board.core,
        controller=name,
        controller_memory=alone,
        config_bytes=ctypes.sizeof(host.config),
        controller_stack=_checked(_controller_stack(board, pil, name), f"{name} on {board.name}"),
        application_memory=_memory(_sections(board, app)),
        application_stack=_checked(
            _application_stack(board, app), f"the application of {name} on {board.name}"
        ),
        stack_reserved=int(common_facts()["STACK_BYTES"]),
    )


def _controller_memory(board: Board, objects: Path, state_bytes: int) -> Memory:
    parts = [_memory(_sections(board, file)) for file in sorted(objects.glob("*.o"))]
    return Memory(sum(p.flash for p in parts), sum(p.ram for p in parts) + state_bytes)


def _checked(stack: Stack, what: str) -> Stack:
    if stack.painted > stack.static:
        raise StackError(
            f"{what} touched {stack.painted} bytes of stack; the call graph says {stack.static} at "
            f"most ({' -> '.join(stack.path)})"
        )
    return stack


def _graph(board: Board, image: Path) -> CallGraph:
    infos = (path.with_suffix(".ci") for path in objects_of(image))
    # Assembly has none; what it calls stands in core.mk.
    graph = read_call_graph(path for path in infos if path.exists())
    if board.toolchain.startswith("arm-"):
        add_library(graph, Code(disassemble(board, image), functions(board, image)))
    return graph


def _controller_stack(board: Board, pil: Path, name: str) -> Stack:
    graph = _graph(board, pil)
    paths = [deepest(graph, f"tdc_{name}_{function}") for function in ("init", "step")]
    worst = max(paths, key=lambda path: path.size)
    return Stack(worst.size, _painted_by_controller(board, pil, name), worst.functions)


def _painted_by_controller(board: Board, pil: Path, name: str) -> int:
    host = Flight(name).tuned()
    with Target(board, pil, host) as target:
        record = fly(target, host, _MEASURED_TICKS)
        assert record.start is not None
        reset = target.reset(host.config, *record.start)
        steps = target.replay(record.inputs, measured=True)
    return max(reset.stack_bytes, int(steps["stack"].max()))


def _application_stack(board: Board, app: Path) -> Stack:
    graph = _graph(board, app)
    program = deepest(graph, board.startup)
    tick = deepest(graph, board.tick_handler)
    return Stack(
        program.size + board.interrupt_frame_bytes + tick.size,
        _painted_by_application(board, app),
        (*program.functions, "(interrupt)", *tick.functions),
    )


def _painted_by_application(board: Board, app: Path) -> int:
    """Through every mode, with a fault of the controller on the way."""

    def is_mode(number: int) -> Callable[[str], bool]:
        return lambda line: line.split()[1:2] == [str(number)]

    with Application(board, app) as application:
        for key, mode in (("r", RUNNING), ("j", FAULT), ("d", DISABLED)):
            application.press(key)
            application.wait_for(is_mode(mode))
        application.press("s")
        return int(application.wait_for(lambda line: line.startswith("# stack")).split()[-1])


# --- The command ------------------------------------------------------------------------------


def table(sizes: Sequence[Size]) -> Table:
    """The sizes for a person."""
    shown = Table(
        title="Size [byte]",
        title_justify="left",
        box=None,
        collapse_padding=True,
        pad_edge=False,
        caption="stack: the call graph's bound (what a run touched)",
        caption_justify="left",
    )
    shown.add_column("core", no_wrap=True)
    shown.add_column("controller\nalone", no_wrap=True)
    for name in ("\nflash", "\nstate", "\nconfig", "\nstack"):
        shown.add_column(name, justify="right", no_wrap=True)
    for name in ("with app.\nflash", "\nRAM", "\nstack"):
        shown.add_column(name, justify="right", no_wrap=True)
    for s in sizes:
        shown.add_row(
            s.core,
            s.controller,
            str(s.controller_memory.flash),
            str(s.controller_memory.ram),
            str(s.config_bytes),
            f"{s.controller_stack.static} ({s.controller_stack.painted})",
            str(s.application_memory.flash),
            str(s.application_memory.ram),
            f"{s.application_stack.static} ({s.application_stack.painted})",
        )
    return shown


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; returns 0, or 2 for what could not be measured."""
    parser = argparse.ArgumentParser(prog="python -m verification.size", description=__doc__)
    parser.add_argument(
        "--board",
        action="append",
        choices=emulated_board_names(),
        help="default: all; may be repeated",
    )
    parser.add_argument(
        "--controller",
        action="append",
        help=f"default: {', '.join(CONTROLLERS)}; may be repeated",
    )
    parser.add_argument("--output", type=Path, default=RESULT, help="the JSON file")
    options = parser.parse_args(arguments)
    console = Console(highlight=False)
    sizes = []
    try:
        for board in map(load_board, options.board or emulated_board_names()):
            for name in options.controller or CONTROLLERS:
                with console.status(f"measuring {name} on {board.name}"):
                    sizes.append(measure(board, name))
    except (ToolError, TargetError, StackError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    write_json({"sizes": sizes}, options.output)
    console.print(table(sizes))
    with suppress(ValueError):
        console.print(f"figures: {options.output.resolve().relative_to(REPOSITORY)}")
    return 0


if __name__ == "__main__":
    sys.exit(stoppable(main))
