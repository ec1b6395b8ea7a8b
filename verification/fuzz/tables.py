"""The tables of ``target/tables.h`` for one controller, as C.

Places and types come from the ctypes structures, which are made of the same description as the
header; the C compares their sizes with the header's when it starts.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from codegen.controller import Controller
from codegen.exact import LOST_TICKS_MAX
from codegen.layout import layout
from codegen.structs import Range, Scalar, Struct
from plant.controller import structures
from plant.units import units

STATUS_NAME = re.compile(r"^\s*(TDC_\w+) = (-?\d+),", re.MULTILINE)
PHASE = re.compile(r"^#define TDC_PHASE_\w+ (0x[0-9A-F]+)u", re.MULTILINE)

_TYPES = {
    ctypes.c_float: "SCALAR_FLOAT",
    ctypes.c_double: "SCALAR_DOUBLE",
    ctypes.c_int32: "SCALAR_INT32",
    ctypes.c_uint32: "SCALAR_UINT32",
}

_RULES = {
    None: "RULE_ANY",
    Range.POSITIVE: "RULE_POSITIVE",
    Range.NOT_NEGATIVE: "RULE_NOT_NEGATIVE",
    Range.RATIO: "RULE_RATIO",
    Range.DISPLACEMENT: "RULE_DISPLACEMENT",
    Range.LOST_TICKS: "RULE_LOST_TICKS",
    Range.SWITCH: "RULE_SWITCH",
    Range.ON_ERROR: "RULE_ON_ERROR",
    Range.IDENTITY: "RULE_IDENTITY",
}
# An exponent's rule is one of a single number only where it is kept in one.
_EXPONENT_RULES = {
    Range.RESTORING_EXPONENT: "RULE_ABOVE_MINUS_1",
    Range.EXPONENT: "RULE_ANY",
}
_ELSEWHERE = "RULE_ELSEWHERE"


@dataclass(frozen=True)
class Number:
    """One number of a structure.

    Attributes:
        path: the names of the fields and the indices that lead to it.
        offset: its place [bytes].
        type: its ctypes type.
    """

    path: tuple[str | int, ...]
    offset: int
    type: Any


def numbers(kind: Any, path: tuple[str | int, ...] = (), offset: int = 0) -> Iterator[Number]:
    """Every number in a ctypes type, in the order of the memory."""
    if issubclass(kind, ctypes.Structure):
        for name, inner, *_ in kind._fields_:
            yield from numbers(inner, (*path, name), offset + getattr(kind, name).offset)
    elif issubclass(kind, ctypes.Array):
        for i in range(kind._length_):
            yield from numbers(kind._type_, (*path, i), offset + i * ctypes.sizeof(kind._type_))
    else:
        yield Number(path, offset, kind)


def tables(controller: Controller, shared_header: str) -> str:
    """The C file with a controller's tables.

    Args:
        controller: whose structures.
        shared_header: the text of its ``tdc.h``, for the statuses and phases.
    """
    types, described = structures(controller), layout(controller)
    statuses = [value for _, value in STATUS_NAME.findall(shared_header)]
    phases = [int(phase, 16) for phase in PHASE.findall(shared_header)]
    floating = controller.arithmetic.kind == "floating-point"
    starts = ("counts", units(controller).torque.field)
    # What a tick after lost ones works out itself is what the generator says of even motion.
    resumes = (
        *starts,
        *(f.name for f in described.joint_state.fields if "sliding_integral" in f.name),
    )
    # Running phases take turns: the last bit is the index of the memory.
    return "\n".join(
        [
            "#include <stdbool.h>",
            '#include "verification/fuzz/target/tables.h"',
            *_table("config", types.config, lambda n: _row(n, _rule(described.config, n.path))),
            *_table("state", types.state, lambda n: _state_row(n, starts, resumes)),
            *_table("input", types.input, lambda n: _row(n, "RULE_ANY")),
            f"const int32_t statuses[] = {{{', '.join(statuses)}}};",
            f"const size_t status_count = {len(statuses)}u;",
            f"const uint32_t first_phase = 0x{min(phases):X}u;",
            f"const uint32_t last_phase = 0x{max(phases) + 1:X}u;",
            f"const uint32_t most_lost_ticks = {LOST_TICKS_MAX}u;",
            f"const bool takes_any_bits = {str(floating).lower()};",
            f"const scalar_type number_type = {_TYPES[types.torque]};",
            "",
        ]
    )


def _table(name: str, kind: Any, row: Callable[[Number], str]) -> list[str]:
    rows = [row(number) for number in numbers(kind)]
    return [
        f"static const scalar {name}_scalars[] = {{",
        *(f"    {row}," for row in rows),
        "};",
        f"const structure {name}_table = {{{name}_scalars, {len(rows)}u, {ctypes.sizeof(kind)}u}};",
    ]


def _row(number: Number, rule: str, memory: int = -1, flags: Sequence[bool] = 4 * (False,)) -> str:
    words = ", ".join(str(flag).lower() for flag in flags)
    place = f"{number.offset}u, {_TYPES[number.type]}, {rule}, (scalar_memory)({memory}), {words}"
    return f"{{{place}}} /* {'.'.join(map(str, number.path))} */"


def _rule(struct: Struct, path: Sequence[str | int]) -> str:
    """The rule of the number at the end of a path, from the field that it belongs to."""
    field = next(f for f in struct.fields if f.name == path[0])
    inner = [step for step in path[1:] if not isinstance(step, int)]
    if isinstance(field.type, Struct):
        return _rule(field.type, inner)
    if field.range in _EXPONENT_RULES:
        one_number = field.type is Scalar.EXPONENT
        return _EXPONENT_RULES[field.range] if one_number else _ELSEWHERE
    # A fixed-point power states no range of its own; the inertia's rule speaks of all three.
    return _RULES.get(field.range, _ELSEWHERE)


def _state_row(number: Number, starts: Sequence[str], resumes: Sequence[str]) -> str:
    path, name = number.path, number.path[-1]
    memory = path[path.index("tick") + 1] if "tick" in path else -1
    assert isinstance(memory, int)
    of_a_tick = memory >= 0
    flags = (
        of_a_tick and name in starts,
        of_a_tick and name in resumes,
        of_a_tick and name == "counts",
        name == "lost_ticks",
    )
    return _row(number, "RULE_ANY", memory, flags)
