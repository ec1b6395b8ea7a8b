"""Makes a controller's package: written, tried, and only then put in place of an older one."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from codegen.controller import Controller
from codegen.emit import generate, swap
from codegen.layout import layout
from codegen.source import GenerationError
from package.checks import Part, check, parts
from package.contents import Package, context, files, package_of
from package.figures import Figures, figures
from package.recording import Recording, record
from package.rendering import text
from plant.native import BUILD

PACKAGES = BUILD / "package"


@dataclass(frozen=True)
class Made:
    """A package that is in place.

    Attributes:
        folder: where.
        parts: what is in it, and how far each was tried.
    """

    folder: Path
    parts: tuple[Part, ...]


def make(
    controller: Controller,
    output: Path = PACKAGES,
    boards: Iterable[str] | None = None,
    says: Callable[[str], None] = lambda _: None,
) -> Made:
    """Makes ``output/NAME``: all of it, or nothing is changed.

    Args:
        controller: the specification.
        output: the folder of packages.
        boards: emulated boards to measure the cost on; all of them by default.
        says: is told what is done next.

    Raises:
        GenerationError: the C can't be generated, or the folder can't be written.
        package.tools.CheckError: a part doesn't work.
        verification.firmware.ToolError: a compiler or an emulator is missing.
        verification.bench.rows.BenchError: the cost that was measured can't be right.
    """
    package = package_of(controller, generate(controller))
    says("flight")
    recording = record(controller)
    says("figures")
    found = figures(controller, boards)
    made = {**files(package), "README.md": readme(package, recording, found).encode("utf-8")}
    target = output / controller.name
    try:
        output.mkdir(parents=True, exist_ok=True)
        # Beside its place, so that one rename puts it there.
        with tempfile.TemporaryDirectory(prefix=".package-", dir=output) as scratch:
            fresh = Path(scratch) / controller.name
            for path, body in made.items():
                file = fresh / path
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(body)
            check(fresh, package, recording, says)
            swap(fresh, target, Path(scratch) / "old")
    except OSError as error:
        raise GenerationError(
            f"{target}: {error.strerror or error}; the old package is as it was. "
            "Check that the directory exists and that you may write to it"
        ) from error
    return Made(target, parts(package, recording))


def readme(package: Package, recording: Recording, found: Figures) -> str:
    """The package's README."""
    values = {
        **context(package),
        "fields": layout(package.controller).input.fields,
        "parts": parts(package, recording),
        "figures": found,
    }
    return text("README.md.j2", values)
