"""The firmware on every board: it builds without a warning, and the application works there."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import verification.firmware
from codegen.emit import REPOSITORY
from verification.disassembly import disassemble
from verification.firmware import (
    STUB,
    Application,
    Board,
    ToolError,
    board_names,
    build,
    common_facts,
    emulated_board_names,
    emulator,
    facts,
    load_board,
    tool,
)

BOARDS = ("mps2-an385", "mps2-an385-m0plus", "mps2-an386", "mps2-an500", "riscv-virt")

# Columns of report_record, and the numbers of app_mode and app_fault.
TICK, MODE, FAULT, STATUS, OVERRUNS = range(5)
DISABLED, HOLDING, RUNNING, IN_FAULT = range(4)
CONTROLLER_FAULT, OVERRUN_FAULT, ENCODER_FAULT = 1, 2, 3
ENCODER_JUMP = -4


def in_mode(mode: int) -> Callable[[str], bool]:
    return lambda line: line.split()[MODE : MODE + 1] == [str(mode)]


def numbers(line: str) -> list[int]:
    return [int(word) for word in line.split()]


def test_all_boards_are_tested() -> None:
    assert tuple(board_names()) == BOARDS


@pytest.mark.parametrize("controller", ["puma3", "puma6", "puma3_fixed", "puma3_float64"])
@pytest.mark.parametrize("board", BOARDS)
def test_every_image_builds_without_a_warning(board: str, controller: str) -> None:
    for image in ("app", "pil", "pil_uart"):
        assert build(load_board(board), controller, image).is_file()


@pytest.fixture(params=BOARDS)
def application(request: pytest.FixtureRequest) -> Iterator[Application]:
    board = load_board(request.param)
    with Application(board, build(board, "puma3", "app")) as running:
        running.wait_for(in_mode(DISABLED))
        yield running


def start(application: Application) -> None:
    application.press("r")
    application.wait_for(in_mode(HOLDING))
    application.wait_for(in_mode(RUNNING))


def test_overruns_of_the_real_timer_end_in_a_fault(application: Application) -> None:
    start(application)
    application.press("o")
    told = numbers(application.wait_for(in_mode(IN_FAULT)))
    assert told[FAULT] == OVERRUN_FAULT
    assert told[OVERRUNS] == 3
    calm = [
        numbers(line)[OVERRUNS]
        for line in application.lines
        if in_mode(RUNNING)(line) or in_mode(HOLDING)(line)
    ]
    # None was late but those that were made so; the last record may fall among these.
    assert set(calm[:-1]) <= {0}
    assert calm[-1] < 3


def test_faults_and_the_way_out_of_them(application: Application) -> None:
    for key, fault in (("j", CONTROLLER_FAULT), ("e", ENCODER_FAULT)):
        start(application)
        application.press(key)
        told = numbers(application.wait_for(in_mode(IN_FAULT)))
        assert told[FAULT] == fault
        if fault == CONTROLLER_FAULT:
            assert told[STATUS] == ENCODER_JUMP
        application.press("r")
        application.wait_for(in_mode(IN_FAULT))
        application.press("d")
        application.wait_for(in_mode(DISABLED))


def test_a_processor_exception_stops_the_robot(application: Application) -> None:
    start(application)
    application.press("x")
    assert application.wait_for(lambda line: line.startswith("EMERGENCY"))


Move = list[list[int]]
"""Counts [count] and torques [mN m] of three joints, ten times along a move of the reference."""


def first_move(board: Board, image: Path) -> Move:
    """The first move of the reference after the switch to running."""
    with Application(board, image) as application:
        start(application)
        while not 1000 <= numbers(application.lines[-1])[TICK] % 4000 < 2000:
            application.wait_for(in_mode(RUNNING))
        while numbers(application.lines[-1])[TICK] % 4000 < 2000:
            application.wait_for(in_mode(RUNNING))
        told = [numbers(line) for line in application.lines if in_mode(RUNNING)(line)]
    return [row[7:] for row in told if 1000 <= row[TICK] % 4000 < 2000 and row[TICK] % 100 == 0]


@cache
def moves_of(controller: str) -> tuple[Move, ...]:
    """One on each board."""
    boards = map(load_board, BOARDS)
    return tuple(first_move(board, build(board, controller, "app")) for board in boards)


@pytest.mark.parametrize("controller", ["puma3", "puma3_fixed"])
def test_the_application_moves_the_same_on_all_boards(controller: str) -> None:
    moves = moves_of(controller)
    assert len(moves[0]) == 10
    assert len({tuple(row) for row in moves[0]}) == 10, "the robot moves"
    assert all(move == moves[0] for move in moves)


def assert_alike(move: Move, other: Move) -> None:
    """Both follow the reference; a count more or less in a tick is a few newton metres."""
    apart = np.abs(np.array(move) - np.array(other))
    assert apart[:, :3].max() <= 5
    assert apart[:, 3:].max() <= 5000
    assert np.abs(np.array(move)[:, 3:]).max() > 10_000


def test_fixed_point_moves_the_robot_like_floating_point() -> None:
    """The units of the stub are those of the generator: no number of one is one of the other."""
    assert_alike(moves_of("puma3_fixed")[0], moves_of("puma3")[0])


def test_double_runs_where_the_fpu_has_it() -> None:
    board = load_board("mps2-an500")
    image = build(board, "puma3_float64", "app")
    assert needed(board, sorted(image.parent.glob("controller/*.o"))) == set()
    assert_alike(first_move(board, image), moves_of("puma3")[BOARDS.index(board.name)])


def needed(board: Board, objects: Sequence[Path]) -> set[str]:
    """The symbols that these objects take from others."""
    program = tool(f"{board.toolchain}nm", board.toolchain_package)
    command = [program, "--format=posix", *map(str, objects)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    lines = [line.split() for line in said.splitlines() if not line.endswith(":")]
    undefined = {words[0] for words in lines if words[1] == "U"}
    return undefined - {words[0] for words in lines if words[1] != "U"}


@pytest.mark.parametrize("name", ["mps2-an385", "mps2-an385-m0plus"])
def test_a_tick_in_fixed_point_calls_no_library_for_floats(name: str) -> None:
    """From the encoders to the drives; only a robot that is simulated takes floats."""
    board = load_board(name)
    folder = build(board, "puma3_fixed", "app").parent
    assert needed(board, sorted(folder.glob("controller/*.o"))) <= {"memcpy"}
    path = [folder / "app.o", folder / "telemetry.o", folder / "report.o"]
    calls = {symbol for symbol in needed(board, path) if symbol.startswith("__")}
    divisions = {f"__aeabi_{name}" for name in ("idiv", "idivmod", "uidiv", "uidivmod")}
    assert calls <= {"__aeabi_lmul", *divisions}
    # Floats would be seen.
    floats = build(board, "puma3", "app").parent
    assert "__aeabi_fmul" in needed(board, sorted(floats.glob("controller/*.o")))
    assert "__aeabi_fmul" in needed(board, [floats / "app.o"])


ARMV6_M = re.compile(
    r"adcs|adds?|ands|asrs|b(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)?|bics|bkpt|blx?|bx|cmn|cmp"
    r"|dmb|dsb|eors|isb|ldmia|ldrs?[bh]?|lsls|lsrs|movs?|muls|mvns|negs|nop|orrs|pop|push"
    r"|rev(16|sh)?|rors|sbcs|stmia|str[bh]?|subs?|[su]xt[bh]|tst|udf|wfi"
)
"""What a Cortex-M0+ has, of the instructions that compilers make."""


@pytest.mark.parametrize(
    ("controller", "image"), [("puma6", "app"), ("puma6", "pil"), ("puma3_fixed", "app")]
)
def test_a_cortex_m0plus_has_every_instruction(controller: str, image: str) -> None:
    """The emulated Cortex-M3 would execute more."""
    board = load_board("mps2-an385-m0plus")
    program = disassemble(board, build(board, controller, image)).values()
    assert len(program) > 1000
    # An undefined instruction provokes an exception; the tests of the application need one.
    foreign = {str(i) for i in program if not ARMV6_M.fullmatch(i.mnemonic)}
    assert {text for text in foreign if "UNDEFINED" not in text} == set()
    wide = {i.mnemonic for i in program if i.size == 4 and str(i) not in foreign}
    assert wide <= {"bl", "dmb", "dsb", "isb"}


UNALIGNED = """
#include "cores/core.h"
int main(void)
{
    static uint32_t words[2];
    /* In assembly: the compiler knows what its processor can't. */
    __asm volatile("str %0, [%0, #0]" ::"l"((uintptr_t)words + 1u) : "memory");
    const uint32_t report[] = {0x20026u, 0u};
    (void)core_semihosting(0x20, report);
    return 0;
}
void core_tick(void) {}
void core_panic(void)
{
    const uint32_t report[] = {0x20026u, 77u};
    (void)core_semihosting(0x20, report);
}
"""


@pytest.mark.parametrize(("name", "status"), [("mps2-an385", 0), ("mps2-an385-m0plus", 77)])
def test_an_unaligned_access_faults_where_it_has_to(name: str, status: int, tmp_path: Path) -> None:
    board, source, elf = load_board(name), tmp_path / "unaligned.c", tmp_path / "unaligned.elf"
    source.write_text(UNALIGNED, encoding="utf-8")
    command = [
        *(f"{board.toolchain}gcc", *board.cpu_flags, *common_facts()["LINK_FLAGS"].split()),
        *("-std=c99", "-O1", "-ffreestanding", f"-I{STUB}", f"-L{board.folder}"),
        *(f"-T{STUB}/cores/sections.ld", "-Wl,--defsym=STACK_BYTES=1024", str(source)),
        *(f"{STUB}/cores/cortex-m/core.c", f"{STUB}/runtime/start.c", "-lgcc", "-o", str(elf)),
    ]
    subprocess.run(command, check=True)
    options = common_facts()["QEMU_SEMIHOSTING"].split()
    done = subprocess.run(emulator(board, elf, options), check=False, timeout=20)
    assert done.returncode == status


def test_unknown_board() -> None:
    with pytest.raises(ToolError, match=r"no board 'esp32'; there are mps2-an385"):
        load_board("esp32")


def test_facts_are_plain_assignments(tmp_path: Path) -> None:
    file = tmp_path / "board.mk"
    file.write_text("# comment\nA := b c\n", encoding="utf-8")
    assert facts(file) == {"A": "b c"}
    file.write_text("A := $(B)\n", encoding="utf-8")
    with pytest.raises(ToolError, match="not of the form"):
        facts(file)


def test_what_is_missing_is_named_with_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    board = load_board("riscv-virt")
    with pytest.raises(ToolError, match=r"qemu-system-riscv32.*apt-get install qemu-system-misc"):
        emulator(board, Path("x.elf"))
    with pytest.raises(ToolError, match="apt-get install make"):
        build(board, "puma3", "app")


def test_a_compiler_error_is_shown(tmp_path: Path) -> None:
    board = load_board("mps2-an386")
    with pytest.raises(ToolError, match="unrecognized command-line option"):
        build(board, "puma3", "pil", output=tmp_path, extra_flags="-fno-such-thing")


def test_a_board_may_exist_as_hardware_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stub = tmp_path / "firmware_stub"
    shutil.copytree(STUB, stub)
    mine = stub / "boards" / "mine" / "board.mk"
    mine.parent.mkdir()
    text = (STUB / "boards" / "mps2-an386" / "board.mk").read_text(encoding="utf-8")
    mine.write_text("\n".join(x for x in text.splitlines() if not x.startswith("QEMU")) + "\n")
    monkeypatch.setattr(verification.firmware, "STUB", stub)
    assert set(board_names()) - set(emulated_board_names()) == {"mine"}
    with pytest.raises(ToolError, match="mine has no emulator"):
        emulator(load_board("mine"), Path("x.elf"))


def test_a_new_board_is_a_folder(tmp_path: Path) -> None:
    """As the README says, on a copy of the stub."""
    stub = tmp_path / "firmware_stub"
    shutil.copytree(STUB, stub)
    shutil.copytree(stub / "boards" / "mps2-an386", stub / "boards" / "mine")
    generated = REPOSITORY / "generated" / "puma3"
    words = ["BOARD=mine", "CONTROLLER=puma3", f"GENERATED={generated}", f"OUT={tmp_path}/out"]
    done = subprocess.run(["make", "-C", stub, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "app.elf").is_file()
