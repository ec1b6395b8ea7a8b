"""Where the C's structures have their fields in the memory of WebAssembly, as data for a page.

The structures are the ctypes structures that the host's C is called with; only pointers are
shorter: WebAssembly has addresses of 32 bits. All types are aligned by their own size.
"""

from __future__ import annotations

import base64
import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

_NUMBERS: dict[Any, str] = {
    ctypes.c_float: "f32",
    ctypes.c_double: "f64",
    ctypes.c_uint8: "u8",
    ctypes.c_int32: "i32",
    ctypes.c_uint32: "u32",
    ctypes.c_int64: "i64",
    ctypes.c_void_p: "u32",
}
"""The page's names of C's types; they end in the number of bits."""


def structures(*kinds: type[ctypes.Structure]) -> dict[str, Any]:
    """Size, alignment and fields of structures and of those in them, by their names.

    Each field is given as its type's name, its offset in bytes, and how many there are.
    """
    made: dict[str, Any] = {}
    for kind in kinds:
        _add(made, kind)
    return made


def _add(made: dict[str, Any], kind: type[ctypes.Structure]) -> None:
    fields: dict[str, Any] = {}
    offset, alignment = 0, 1
    for name, field_type, *_ in kind._fields_:
        element: Any = field_type
        count = 1
        if issubclass(element, ctypes.Array):
            element, count = element._type_, element._length_
        type_name, size, aligned = _known(made, element)
        offset = _up(offset, aligned)
        fields[name] = [type_name, offset, count]
        offset += size * count
        alignment = max(alignment, aligned)
    made[kind.__name__] = {
        "size": _up(offset, alignment),
        "alignment": alignment,
        "fields": fields,
    }


def _known(made: dict[str, Any], field_type: Any) -> tuple[str, int, int]:
    """A type's name, size and alignment."""
    if issubclass(field_type, ctypes.Structure):
        name = field_type.__name__
        if name not in made:
            _add(made, field_type)
        return name, made[name]["size"], made[name]["alignment"]
    name = _NUMBERS[field_type]
    size = int(name[1:]) // 8
    return name, size, size


def _up(offset: int, alignment: int) -> int:
    return -(-offset // alignment) * alignment


def array(values: NDArray[Any]) -> dict[str, Any]:
    """An array of numbers, row by row, with the page's name of its type."""
    kind = values.dtype
    name = f"{kind.kind}{8 * kind.itemsize}"
    return {"type": name, "values": np.ravel(values).tolist()}


def text(content: bytes) -> str:
    """Bytes in Base64."""
    return base64.b64encode(content).decode("ascii")
