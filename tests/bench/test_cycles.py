"""The estimate of cycles, against sums by hand; the manuals' own examples are among them."""

from __future__ import annotations

import pytest

from verification.bench.cycles import (
    CORES,
    CORTEX_M0PLUS,
    CORTEX_M3,
    CORTEX_M4,
    Core,
    Run,
    UnknownInstructionError,
    cycles,
    estimate,
    transitions,
)
from verification.disassembly import Instruction, Program, parse

START = 0x100


def program(*lines: str) -> Program:
    """Instructions one after the other, each with its size in front, and a NOP behind them."""
    found: dict[int, Instruction] = {}
    address = START
    for line in (*lines, "2 nop"):
        size, mnemonic, *operands = line.split(maxsplit=2)
        found[address] = Instruction(address, int(size), mnemonic, "".join(operands))
        address += int(size)
    return found


def straight(core: Core, *lines: str) -> float:
    """Estimated cycles of instructions that are executed once."""
    code = program(*lines)
    *_, last, behind = code
    return estimate(core, code, [Run(START, last, behind, 1)])


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        # The examples of section 3.3.2.
        (("2 ldr r0, [r1, #0]", "2 ldr r1, [r2, #0]"), 3),
        (("2 ldr r0, [r1, r2]", "2 str r0, [r3, #20]"), 3),
        (("2 ldr r0, [r1, r2]", "2 str r1, [r3, r2]"), 3),
        (("2 ldr r0, [r1, r5]", "2 ldr r1, [r2, #0]", "2 ldr r2, [r3, #4]"), 4),
        (("4 stmia r0!, {r1, r2, r3, r4, r5, r6, r7, r8}",), 9),
        (("4 ldrd r0, r1, [r2]",), 3),
        # An address that the load before it, or data processing, has just made.
        (("2 ldr r0, [r1, #0]", "2 ldr r2, [r0, #0]"), 4),
        (("2 adds r0, r1, r2", "2 ldr r3, [r0, #0]"), 1 + 2 + 1),
        (("2 adds r0, r1, r2", "2 ldr r3, [r4, #0]"), 1 + 2),
        (("2 adds r0, r1, r2", "2 str r0, [r4, #0]"), 1 + 1),
        (("2 sub sp, #16", "2 push {r4, r5}"), 1 + 3 + 1),
        (("2 cmp r0, r1", "2 ldr r3, [r0, #0]"), 1 + 2),
        # Stores: the write buffer, and nothing overlaps behind one.
        (("2 str r0, [r1, #4]",), 1),
        (("2 str r0, [r1, r2]",), 2),
        (("2 str r0, [r1, #4]", "2 ldr r2, [r3, #0]"), 1 + 2),
        # IT: folded behind 16 bits only.
        (("2 cmp r0, #0", "2 it ne", "2 movne r0, #1"), 1 + 0 + 1),
        (("4 cmp r0, #256", "2 ite ne", "2 movne r0, #1", "2 moveq r0, #2"), 1 + 1 + 1 + 1),
    ],
)
def test_integers_on_m3_and_m4(lines: tuple[str, ...], expected: float) -> None:
    assert straight(CORTEX_M4, *lines) == expected
    assert straight(CORTEX_M3, *lines) == expected


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (("4 vadd.f32 s0, s1, s2", "4 vmul.f32 s3, s4, s5"), 2),
        (("4 vadd.f32 s0, s1, s2", "4 vmul.f32 s3, s0, s5"), 2 + 1),
        (("4 vadd.f32 s0, s1, s2", "4 vcmpe.f32 s0, #0.0"), 2 + 1),
        (("4 vmul.f32 s0, s1, s2", "4 vstr s0, [r0, #4]"), 1 + 2 + 1),
        # The addend is needed a cycle later, a factor is not.
        (("4 vmul.f32 s0, s1, s2", "4 vfma.f32 s0, s3, s4"), 1 + 3),
        (("4 vmul.f32 s0, s1, s2", "4 vfma.f32 s3, s0, s4"), 1 + 3 + 1),
        # Not arithmetic: VNEG, VMOV, VLDR.
        (("4 vneg.f32 s0, s1", "4 vadd.f32 s2, s0, s0"), 2),
        (("4 vldr s0, [r0]", "4 vadd.f32 s2, s0, s0"), 2 + 1),
        (("4 vcvt.f32.s32 s0, s1", "4 vmov r0, s0"), 1 + 2 + 1),
        (("4 vmov.f32 s0, #1.0", "4 vmrs APSR_nzcv, fpscr"), 2),
        (("4 vmovgt s0, r3",), 2),
        (("4 vldr d0, [r0, #8]",), 3),
        (("4 vpush {d8-d9}",), 5),
        (("4 vstmia r0!, {s0-s2}",), 4),
        (("4 vdiv.f32 s0, s1, s2",), 14),
    ],
)
def test_floats_on_m4(lines: tuple[str, ...], expected: float) -> None:
    assert straight(CORTEX_M4, *lines) == expected


@pytest.mark.parametrize(
    ("line", "expected"),
    [("4 mla r0, r1, r2, r3", 2), ("4 umlal r0, r1, r2, r3", 5.5), ("4 udiv r0, r1, r2", 7)],
)
def test_the_middle_of_a_range_on_m3(line: str, expected: float) -> None:
    assert straight(CORTEX_M3, line) == expected


def test_both_results_of_a_long_multiply_count() -> None:
    for register in ("r0", "r1"):
        lines = ("4 smull r0, r1, r2, r3", f"2 ldr r3, [{register}, #0]")
        assert straight(CORTEX_M4, *lines) == 1 + 2 + 1
        assert straight(CORTEX_M3, *lines) == 4 + 2 + 1


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (("2 ldr r0, [r1, #0]", "2 ldr r1, [r2, #0]"), 4),
        (("2 str r0, [r1, #0]", "2 muls r0, r1"), 2 + 1),
        (("2 push {r4, r5, lr}",), 4),
        (("2 adds r0, r1, r2", "2 ldr r3, [r0, #0]"), 3),
    ],
)
def test_m0plus_overlaps_nothing(lines: tuple[str, ...], expected: float) -> None:
    assert straight(CORTEX_M0PLUS, *lines) == expected


@pytest.mark.parametrize(("core", "expected"), [(CORTEX_M4, 10 * 2 + 9 * 2), (CORTEX_M0PLUS, 29)])
def test_a_loop_is_charged_for_the_jumps_that_are_taken(core: Core, expected: float) -> None:
    code = program("2 subs r0, #1", "2 bne 100 <loop>")
    runs = [Run(START, START + 2, START, 9), Run(START, START + 2, START + 4, 1)]
    assert transitions(code, runs).total() == 20
    assert estimate(core, code, runs) == expected


@pytest.mark.parametrize(
    ("core", "line", "expected"),
    [
        (CORTEX_M4, "4 bl 200 <far>", 1 + 2),
        (CORTEX_M4, "2 pop {r4, pc}", 1 + 2 + 2),
        (CORTEX_M4, "4 ldr pc, [sp], #8", 2 + 2),
        (CORTEX_M4, "4 tbb [pc, r0]", 2 + 2),
        (CORTEX_M0PLUS, "4 bl 200 <far>", 3),
        (CORTEX_M0PLUS, "2 bx lr", 2),
        (CORTEX_M0PLUS, "2 mov pc, r2", 2),
        (CORTEX_M0PLUS, "2 pop {r4, pc}", 3 + 2),
    ],
)
def test_jumps(core: Core, line: str, expected: float) -> None:
    code = {**program(line), 0x200: Instruction(0x200, 2, "nop")}
    assert estimate(core, code, [Run(START, START, 0x200, 1)]) == expected


def test_a_branch_to_the_next_instruction_is_a_jump() -> None:
    assert straight(CORTEX_M4, "2 b 102 <next>") == 3
    assert straight(CORTEX_M4, "2 beq 102 <next>") == 1


FORMS = """
bls bcs blt adcs bics lsls muls subspl movs negs mvnne rsbs teqne cmpcs strhi
"""


@pytest.mark.parametrize("mnemonic", FORMS.split())
def test_conditions_and_flags_do_not_change_the_row(mnemonic: str) -> None:
    assert cycles(CORTEX_M4, Instruction(0, 2, mnemonic, "r0, [r1]")) == 1


@pytest.mark.parametrize("core", CORES)
def test_an_instruction_without_a_row_is_named(core: str) -> None:
    with pytest.raises(UnknownInstructionError, match=r"frobs r0, r1 at 0x102"):
        straight(CORES[core], "2 nop", "2 frobs r0, r1")
    with pytest.raises(UnknownInstructionError, match=r"vadd.f64 |vadd.f32 "):
        straight(CORTEX_M3, "4 vadd.f32 s0, s1, s2")


def test_a_listing_is_read() -> None:
    code = parse(
        "00000100 <f>:\n"
        "     100:\tf8d1 2000 \tldr.w\tr2, [r1]\n"
        "     104:\t4a0c      \tldr\tr2, [pc, #48]\t@ (138 <f+0x38>)\n"
        "     106:\td101      \tbne.n\t10c <f+0xc>\n"
        "     108:\t20000400 \t.word\t0x20000400\n"
        "     10c:\t46c0      \tnop\t\t\t@ (mov r8, r8)\n"
    )
    assert list(code.values()) == [
        Instruction(0x100, 4, "ldr", "r2, [r1]"),
        Instruction(0x104, 2, "ldr", "r2, [pc, #48]"),
        Instruction(0x106, 2, "bne", "10c <f+0xc>"),
        Instruction(0x10C, 2, "nop"),
    ]
