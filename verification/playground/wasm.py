"""C as WebAssembly: modules that import nothing, compiled once for each content."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path

from codegen.emit import REPOSITORY
from plant.native import BUILD, CompilerError

HEADERS = Path(__file__).parent / "include"
_STRING_H = REPOSITORY / "firmware_stub" / "include" / "string.h"
_EXPM1_C = Path("lib/libc/musl/src/math/expm1.c")

# The same meaning as on every other target: no fused operations. The stack is as large as loop.c
# needs it several times over, and all other memory is the page's.
_FLAGS = (
    *("-target", "wasm32-freestanding", "-std=c99", "-O3", "-ffp-contract=off"),
    *("-fno-sanitize=all", "-Wall", "-Wextra", "-Werror", "-Wno-unused-parameter"),
    *("-nostdlib", "-lcompiler_rt", "-Wl,--no-entry", "-Wl,--strip-all"),
    "-Wl,-z,stack-size=131072",
)
HEAP = "__heap_base"
"""The export that says where the memory begins that is the page's."""


def module(name: str, files: Mapping[str, bytes], exports: Sequence[str]) -> bytes:
    """The WebAssembly of some C, with sines, exponentials and ``memcpy`` in it.

    It has no imports, and exports its memory, :data:`HEAP` and what is named.

    Args:
        name: what the name of the file in the build folder begins with.
        files: sources and headers by file name, all for one folder.
        exports: functions, and objects, which are exported as their addresses.

    Raises:
        CompilerError: the compiler is missing or reports an error.
    """
    zig = _zig()
    every = {**_runtime(zig), **files}
    words = (*_FLAGS, *(f"-Wl,--export={export}" for export in (HEAP, *exports)))
    digest = hashlib.sha256(" ".join((metadata.version("ziglang"), *words)).encode())
    for file, content in every.items():
        digest.update(file.encode() + b"\0" + content)
    target = BUILD / "wasm" / f"{name}-{digest.hexdigest()[:16]}.wasm"
    if not target.exists():
        _compile(every, words, target)
    return target.read_bytes()


def _zig() -> Path:
    """The package's ``__init__.py``; its own folder has the compiler's sources of libm."""
    found = importlib.util.find_spec("ziglang")
    if found is None or found.origin is None:
        raise CompilerError(
            "the Python package ziglang, which compiles C to WebAssembly, is missing: run `make "
            "setup`, which installs it"
        )
    return Path(found.origin)


def _runtime(zig: Path) -> dict[str, bytes]:
    """What the C needs of a libc beyond the compiler's own runtime library."""
    headers = {path.name: path.read_bytes() for path in sorted(HEADERS.glob("*.h"))}
    return headers | {
        _STRING_H.name: _STRING_H.read_bytes(),
        _EXPM1_C.name: (zig.parent / _EXPM1_C).read_bytes(),
    }


def _compile(files: Mapping[str, bytes], words: Sequence[str], target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
        for file, content in files.items():
            (Path(scratch) / file).write_bytes(content)
        sources = sorted(file for file in files if file.endswith(".c"))
        done = subprocess.run(
            [sys.executable, "-m", "ziglang", "cc", *words, "-I.", "-o", "made.wasm", *sources],
            cwd=scratch,
            # The compiler keeps its own runtime library, compiled, in a folder of the project's.
            env=os.environ | {"ZIG_GLOBAL_CACHE_DIR": str(BUILD / "wasm" / "zig")},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            raise CompilerError(f"zig cc {' '.join(words)} failed:\n{done.stderr}")
        (Path(scratch) / "made.wasm").replace(target)
