"""C as WebAssembly: modules that import nothing, compiled once for each content."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
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
    every = {**_runtime(), **files}
    words = ("cc", *_FLAGS, *(f"-Wl,--export={export}" for export in (HEAP, *exports)))
    sources = sorted(file for file in every if file.endswith(".c"))
    return _made(name, ".wasm", every, (*words, "-I.", *sources), "-o").read_bytes()


def host_libm() -> Path:
    """The same sines and exponentials as a static library of this machine, bit for bit.

    A plant that rubs and vibrates makes much of a last bit: the host's own libm would be another
    flight after some hundred ticks.

    Raises:
        CompilerError: the compiler is missing or reports an error.
    """
    words = (
        *("build-lib", "-static", "-fcompiler-rt", "-fPIC", "-OReleaseFast", "-I."),
        *("-target", f"{platform.machine()}-linux-none"),
        *("-cflags", "-O2", "-ffp-contract=off", "--", _EXPM1_C.name),
    )
    return _made("libm", ".a", _runtime(), words, "-femit-bin")


def _zig() -> Path:
    """The package's ``__init__.py``; its own folder has the compiler's sources of libm."""
    found = importlib.util.find_spec("ziglang")
    if found is None or found.origin is None:
        raise CompilerError(
            "the Python package ziglang, which compiles C to WebAssembly, is missing: run `make "
            "setup`, which installs it"
        )
    return Path(found.origin)


def _runtime() -> dict[str, bytes]:
    """What the C needs of a libc beyond the compiler's own runtime library."""
    headers = {path.name: path.read_bytes() for path in sorted(HEADERS.glob("*.h"))}
    return headers | {
        _STRING_H.name: _STRING_H.read_bytes(),
        _EXPM1_C.name: (_zig().parent / _EXPM1_C).read_bytes(),
    }


def _made(
    name: str, suffix: str, files: Mapping[str, bytes], words: Sequence[str], output: str
) -> Path:
    """What the compiler makes of files in a folder, unless it is there already."""
    digest = hashlib.sha256(" ".join((metadata.version("ziglang"), *words)).encode())
    for file, content in files.items():
        digest.update(file.encode() + b"\0" + content)
    target = BUILD / "wasm" / f"{name}-{digest.hexdigest()[:16]}{suffix}"
    if target.exists():
        return target
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
        for file, content in files.items():
            (Path(scratch) / file).write_bytes(content)
        made = f"made{suffix}"
        named = (output, made) if output == "-o" else (f"{output}={made}",)
        done = subprocess.run(
            [sys.executable, "-m", "ziglang", *words, *named],
            cwd=scratch,
            # The compiler keeps its own runtime library, compiled, in a folder of the project's.
            env=os.environ | {"ZIG_GLOBAL_CACHE_DIR": str(BUILD / "wasm" / "zig")},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            raise CompilerError(f"zig {' '.join(words)} failed:\n{done.stderr}")
        # A rename is atomic: two runs at the same time see a whole file or none.
        (Path(scratch) / made).replace(target)
    return target
