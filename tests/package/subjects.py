"""What the tests of packages share: packages, and a compiled FMU with a flight of its C."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

from codegen.controller import Controller, load
from codegen.emit import GeneratedFiles
from package.contents import FMU, Package, files, package_of
from package.recording import Recording
from package.simulation import build_fmu
from plant.native import shared_library

ROOT = Path(__file__).parents[2]
M4F = "mps2-an386"


@dataclass(frozen=True)
class Subject:
    """A compiled FMU of puma3, and the flight of Exp08 that it is held against."""

    fmu: Path
    recording: Recording


def controller(name: str) -> Controller:
    """A committed specification."""
    return load(ROOT / "controllers" / f"{name}.toml")


@functools.cache
def packaged(name: str) -> Package:
    """Its package, of the committed C: that it is what is generated has tests of its own."""
    folder = ROOT / "generated" / name
    texts = {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}
    return package_of(controller(name), GeneratedFiles(name, texts))


def library_of(name: str) -> Path:
    """The committed C, compiled."""
    return shared_library(ROOT / "generated" / name)


_CONTENTS: dict[tuple[str, str], dict[str, bytes]] = {}


def contents_of(package: Package) -> dict[str, bytes]:
    """The files of a package, made once in a process."""
    key = package.prefix, package.version
    if key not in _CONTENTS:
        _CONTENTS[key] = files(package)
    return _CONTENTS[key]


def fmu_of(package: Package, directory: Path) -> Path:
    """Its FMU, compiled."""
    archive = directory / f"{package.prefix}.fmu"
    archive.write_bytes(contents_of(package)[FMU.format(package.prefix)])
    return build_fmu(archive, directory)
