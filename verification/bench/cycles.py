"""Estimated cycles of a step, from what was executed and Arm's tables of cycles.

Nothing here is measured. Each executed instruction is charged what the processor's Technical
Reference Manual (TRM) gives for it, with its rules for neighbours, for memory without wait states:

- Cortex-M4F: Arm DDI 0439D (r0p1), tables 3-1 and 7-1, section 3.3.2 and the notes of 7.2.3;
- Cortex-M3: Arm 100165_0201_02 (r2p1), table 3-1 and section 3.3.2;
- Cortex-M0+: Arm DDI 0484C (r0p1), table 3-1.

Where a TRM leaves a range, the middle of it is taken, and these are chosen:

- P, the cycles that refill the pipeline after a jump, is 2 on M3 and M4 (TRM: 1 to 3). On the M0+
  the table has it in its figures: 1.
- The Cortex-M0+ has the fast multiplier (MULS in 1 cycle, not 32).
- VLDR and VSTR are not pipelined with their neighbours: table 7-1 does not say that they are.
- An IT instruction behind a 16-bit instruction is folded whenever it can be.
- An instruction whose condition failed is charged as if it had been executed.

The Cortex-M7 issues two instructions at once and Arm prints no such table for it, nor does anyone
for "an RV32": they have no estimate.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from verification.disassembly import Instruction, Program, registers_in_list

NOTE = (
    "Estimated cycles: every executed instruction is charged what the Technical Reference Manual "
    "of its core says, for memory without wait states. Nothing of it was measured; the "
    "Cortex-M7 and RV32 have no such table."
)
"""What has to stand beside every estimate."""


class UnknownInstructionError(Exception):
    """An executed instruction has no row in the table; the message names both."""


@dataclass(frozen=True)
class Run:
    """Instructions that were executed one after the other, and what came next.

    Attributes:
        first: address of the first.
        last: address of the last; only this one may jump.
        next: address of the instruction behind them.
        count: how often.
    """

    first: int
    last: int
    next: int
    count: int


@dataclass(frozen=True)
class Cycles:
    """A cell of the table: ``fixed + each N``, N the number of registers loaded or stored."""

    fixed: float
    each: float = 0.0


@dataclass(frozen=True)
class Core:
    """A processor's table.

    Attributes:
        table: cycles by mnemonic, without condition and flags.
        refill: what a jump that is taken costs on top, P of the TRM.
        return_extra: what a POP into the PC costs on top of that.
        pipelined: the rules of section 3.3.2 (M3 and M4): loads and stores overlap with their
            neighbours, and so on.
    """

    table: Mapping[str, Cycles]
    refill: float
    return_extra: float = 0.0
    pipelined: bool = False


def _names(text: str) -> frozenset[str]:
    return frozenset(text.split())


def _rows(*rows: tuple[str, Cycles]) -> dict[str, Cycles]:
    return {name: cell for names, cell in rows for name in names.split()}


def _between(least: int, most: int) -> Cycles:
    """The middle of a range of which the operands choose."""
    return Cycles((least + most) / 2)


# --- Arm's tables; P is added where a jump is taken ---------------------------------------------

_LOADS = "ldr ldrh ldrb ldrsh ldrsb"
_STORES = "str strh strb"
_MULTIPLE = "ldm ldmia ldmdb stm stmia stmdb push pop"

_ARMV7_M = _rows(
    ("mov movw movt add addw adc adr sub subw sbc rsb neg mul", Cycles(1)),
    ("ssat usat cmp cmn and eor orr orn bic mvn tst teq", Cycles(1)),
    ("lsl lsr asr ror rrx clz", Cycles(1)),
    ("sdiv udiv", _between(2, 12)),
    (_LOADS, Cycles(2)),
    (_STORES, Cycles(2)),
    ("ldrd strd", Cycles(1, 1)),
    (_MULTIPLE, Cycles(1, 1)),
    ("b bl bx blx cbz cbnz", Cycles(1)),
    ("tbb tbh", Cycles(2)),
    ("it", Cycles(1)),
    ("sxth sxtb uxth uxtb ubfx sbfx bfc bfi rev rev16 revsh rbit nop", Cycles(1)),
)

CORTEX_M3 = Core(
    {
        **_ARMV7_M,
        **_rows(
            ("mla mls", Cycles(2)),
            ("smull umull", _between(3, 5)),
            ("smlal umlal", _between(4, 7)),
        ),
    },
    refill=2,
    pipelined=True,
)

_CORE_REGISTER_MOVE = Cycles(2)
"""VMOV of one float from or to one core register, of two from or to two: table 7-1."""

CORTEX_M4 = Core(
    {
        **_ARMV7_M,
        **_rows(
            ("mla mls smull umull smlal umlal umaal smmul smmla smmls", Cycles(1)),
            ("smulbb smulbt smultb smultt smlabb smlabt smlatb smlatt", Cycles(1)),
            ("uxtab uxtah sxtab sxtah pkhbt pkhtb", Cycles(1)),
            ("vabs vadd vcmp vcmpe vcvt vmov vmrs vmsr vmul vneg vnmul vsub", Cycles(1)),
            ("vmla vmls vnmla vnmls vfma vfms vfnma vfnms", Cycles(3)),
            ("vdiv vsqrt", Cycles(14)),
            ("vldr vstr vldm vldmia vldmdb vstm vstmia vstmdb vpush vpop", Cycles(1, 1)),
        ),
    },
    refill=2,
    pipelined=True,
)

CORTEX_M0PLUS = Core(
    _rows(
        ("mov add adc adr sub sbc rsb neg mul cmp cmn and eor orr bic mvn tst", Cycles(1)),
        ("lsl lsr asr ror sxth sxtb uxth uxtb rev rev16 revsh nop", Cycles(1)),
        (_LOADS, Cycles(2)),
        (_STORES, Cycles(2)),
        (_MULTIPLE, Cycles(1, 1)),
        ("b bx blx", Cycles(1)),
        ("bl", Cycles(2)),
    ),
    refill=1,
    return_extra=1,
)

CORES: Mapping[str, Core] = {
    "Cortex-M0+": CORTEX_M0PLUS,
    "Cortex-M3": CORTEX_M3,
    "Cortex-M4F": CORTEX_M4,
}
"""The tables by the names of ``board.mk``; a core that is not here has no estimate."""


# --- Classes of instructions --------------------------------------------------------------------

_SINGLE_LOADS = _names(_LOADS)
_SINGLE_STORES = _names(_STORES)
_BASE_FIRST = _names("ldm ldmia ldmdb stm stmia stmdb vldm vldmia vldmdb vstm vstmia vstmdb")
_ON_STACK = _names("push pop vpush vpop")
_FLOAT_LOADS = _names("vldr vldm vldmia vldmdb vpop")
_FLOAT_LISTS_STORED = _names("vstm vstmia vstmdb vpush")
_FLOAT_ARITHMETIC = _names(
    "vadd vsub vmul vnmul vdiv vsqrt vcvt vmla vmls vnmla vnmls vfma vfms vfnma vfnms"
)
_TWO_RESULTS = _names("smull umull smlal umlal umaal")
_NO_RESULT = _names(
    f"{_LOADS} {_STORES} {_MULTIPLE} ldrd strd cmp cmn tst teq b bl bx blx cbz cbnz tbb tbh it nop"
)


# --- One instruction ----------------------------------------------------------------------------

_CONDITION = re.compile(r"(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)$")


def _mnemonic(core: Core, instruction: Instruction) -> str:
    """The row's name: without data types, condition and the S of the flags.

    Raises:
        UnknownInstructionError: there is no such row.
    """
    stem = instruction.mnemonic.partition(".")[0]
    if re.fullmatch(r"it[te]{0,3}", stem):
        stem = "it"
    bare = _CONDITION.sub("", stem)
    # In this order: BLS is B with a condition, not BL with flags.
    for name in (stem, bare, stem.removesuffix("s"), bare.removesuffix("s")):
        if name in core.table:
            return name
    raise UnknownInstructionError(f"no row in the table of cycles for: {instruction}")


def _operands(instruction: Instruction) -> list[str]:
    """Operands between commas, those in brackets and braces together."""
    return [w.strip() for w in re.split(r",(?![^\[{]*[\]}])", instruction.operands) if w.strip()]


_SINGLES = re.compile(r"\b(?:r\d+|sp|lr|ip|pc|sl|fp|sb)\b")


def _core_registers(text: str) -> set[str]:
    return set(_SINGLES.findall(text))


def _floats(text: str) -> set[str]:
    """Single-precision registers, a double as its two halves."""
    doubles = {f"s{2 * int(d) + half}" for d in re.findall(r"\bd(\d+)", text) for half in (0, 1)}
    return set(re.findall(r"\bs\d+\b", text)) | doubles


def _register_count(name: str, instruction: Instruction) -> int:
    """N of the TRM: words loaded or stored."""
    if name in ("ldrd", "strd"):
        return 2
    if name in ("vldr", "vstr"):
        return len(_floats(_operands(instruction)[0]))
    listed = registers_in_list(instruction)
    return sum(2 if register.startswith("d") else 1 for register in listed)


def _address_registers(name: str, instruction: Instruction) -> set[str]:
    """What a load or store computes its address from; empty for all others."""
    if name in _ON_STACK:
        return {"sp"}
    if name in _BASE_FIRST:
        return _core_registers(_operands(instruction)[0])
    bracket = re.search(r"\[([^\]]*)\]", instruction.operands)
    return _core_registers(bracket[1]) if bracket else set()


def cycles(core: Core, instruction: Instruction) -> float:
    """Cycles of one instruction alone, without a jump.

    Raises:
        UnknownInstructionError: the table has no row for it.
    """
    name = _mnemonic(core, instruction)
    cell = core.table[name]
    alone = cell.fixed + cell.each * _register_count(name, instruction)
    if core.pipelined and name in _SINGLE_STORES and not _has_register_offset(instruction):
        return 1.0  # "STR Rx,[Ry,#imm] is always one cycle": the write buffer
    if name == "vmov" and _core_registers(instruction.operands):
        return _CORE_REGISTER_MOVE.fixed
    if name == "pop" and "pc" in registers_in_list(instruction):
        return alone + core.return_extra
    return alone


def _has_register_offset(instruction: Instruction) -> bool:
    return len(_address_registers("str", instruction)) > 1


# --- Two neighbours -----------------------------------------------------------------------------


def with_next(core: Core, instruction: Instruction, following: Instruction) -> float:
    """Cycles that two neighbours take more than each of them alone; negative where they overlap.

    Raises:
        UnknownInstructionError: the table has no row for one of them.
    """
    if not core.pipelined:
        return 0.0
    name, after = _mnemonic(core, instruction), _mnemonic(core, following)
    address = _address_registers(after, following)
    if after == "it":
        neighbours = instruction.next_address == following.address
        return -1.0 if instruction.size == 2 and neighbours else 0.0  # folded
    if name in _SINGLE_LOADS and after in _SINGLE_LOADS | _SINGLE_STORES:
        independent = not _core_registers(_operands(instruction)[0]) & address
        return -1.0 if independent and cycles(core, following) > 1 else 0.0
    more = 0.0
    if _integer_result(name, instruction) & address:
        more += 1.0  # no forwarding from data processing to an address
    if name in _FLOAT_ARITHMETIC:
        result = _floats(_operands(instruction)[0])
        more += 1.0 if result & _floats_read(after, following) else 0.0
    return more


def _integer_result(name: str, instruction: Instruction) -> set[str]:
    """Core registers that an instruction of data processing writes."""
    if name in _NO_RESULT or name.startswith("v"):
        return set()
    written = _operands(instruction)[: 2 if name in _TWO_RESULTS else 1]
    return _core_registers(" ".join(written))


def _floats_read(name: str, instruction: Instruction) -> set[str]:
    """Float registers that an instruction needs at once."""
    operands = _operands(instruction)
    if name in _FLOAT_LOADS or not name.startswith("v"):
        return set()
    if name == "vstr":
        return _floats(operands[0])
    if name in _FLOAT_LISTS_STORED:
        return _floats(" ".join(registers_in_list(instruction)))
    if name in ("vcmp", "vcmpe"):
        return _floats(instruction.operands)
    # Multiply-accumulate needs its addend, the first operand, a cycle later.
    return _floats(" ".join(operands[1:]))


# --- All that was executed ------------------------------------------------------------------------


def transitions(program: Program, runs: Iterable[Run]) -> Counter[tuple[int, int]]:
    """How often each instruction was followed by each other one, by their addresses."""
    found: Counter[tuple[int, int]] = Counter()
    for run in runs:
        address = run.first
        while address != run.last:
            after = program[address].next_address
            found[address, after] += run.count
            address = after
        found[run.last, run.next] += run.count
    return found


def estimate(core: Core, program: Program, runs: Iterable[Run]) -> float:
    """Estimated cycles of all that was executed, the instruction behind the last run excluded.

    Raises:
        UnknownInstructionError: the table has no row for one of the instructions.
    """
    total = 0.0
    for (address, after), count in transitions(program, runs).items():
        instruction, following = program[address], program[after]
        # A branch to the next instruction is one all the same.
        taken = after != instruction.next_address or instruction.mnemonic == "b"
        each = cycles(core, instruction) + with_next(core, instruction, following)
        total += count * (each + (core.refill if taken else 0.0))
    return total
