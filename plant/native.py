"""The generated C as a shared library of this machine, compiled once for each content."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from codegen.controller import Controller
from codegen.emit import REPOSITORY, differences, generate, write

BUILD = REPOSITORY / "build"
GENERATED = REPOSITORY / "generated"

# -ffp-contract=off keeps the bits equal to those on every other target.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-Wall", "-Wextra", "-Werror")


class CompilerError(Exception):
    """The C compiler is missing or refused the generated C."""


def sources_of(controller: Controller) -> Path:
    """The directory with the controller's C: the committed one where it is the same.

    Otherwise the C is generated into ``build/generated/NAME``.
    """
    generated = generate(controller)
    if not differences(generated, GENERATED):
        return GENERATED / controller.name
    return write(generated, BUILD / "generated")


def compiler() -> str:
    """The C compiler, ``$CC`` or ``cc``.

    Raises:
        CompilerError: it is not there.
    """
    name = os.environ.get("CC", "cc")
    if shutil.which(name) is None:
        raise CompilerError(f"C compiler {name!r} not found: install one (Debian: gcc) or set CC")
    return name


def shared_library(directory: Path) -> Path:
    """The shared library of all C files of a directory, compiled unless it is there already.

    Raises:
        CompilerError: the compiler is missing or reports an error.
    """
    return library(directory.name, c_files(directory))


def c_files(directory: Path) -> dict[str, bytes]:
    """The C sources and headers of a directory, by name."""
    found = sorted(p for p in directory.iterdir() if p.suffix in (".c", ".h"))
    return {path.name: path.read_bytes() for path in found}


def library(
    name: str, files: Mapping[str, bytes], flags: Sequence[str] = FLAGS, libraries: str = ""
) -> Path:
    """The shared library of some C, compiled unless it is there already.

    Args:
        name: what the library's own name begins with.
        files: sources and headers by file name, all for one folder.
        flags: of the compiler.
        libraries: a flag for the linker such as ``-lm``, or nothing.

    Raises:
        CompilerError: the compiler is missing or reports an error.
    """
    command = [compiler(), *flags]
    digest = hashlib.sha256(" ".join([*command, libraries]).encode())
    for file, content in files.items():
        digest.update(file.encode() + b"\0" + content)
    target = BUILD / "host" / f"{name}-{digest.hexdigest()[:16]}.so"
    if target.exists():
        return target
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
        fresh = Path(scratch) / target.name
        for file, content in files.items():
            (Path(scratch) / file).write_bytes(content)
        sources = [str(Path(scratch) / file) for file in files if file.endswith(".c")]
        done = subprocess.run(
            [*command, "-o", str(fresh), *sources, *filter(None, [libraries])],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            raise CompilerError(f"{' '.join(command)} failed:\n{done.stderr}")
        # A rename is atomic: two runs at the same time see a whole library or none.
        fresh.replace(target)
    return target
