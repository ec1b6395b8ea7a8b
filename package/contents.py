"""What a package is: its files, and all that its templates say."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from codegen.controller import Controller
from codegen.emit import REPOSITORY, GeneratedFiles, formatted
from codegen.fixed_point import formats
from package.fmu import fmu
from package.rendering import text
from plant.units import units

FMU = "fmu/{}.fmu"
JOURNAL = "https://ieeexplore.ieee.org/xpl/RecentIssue.jsp?punumber=3516"
"""Where the law is published: Arduino asks for an address."""

# File in the package: its template.
_TEXTS = {
    "CMakeLists.txt": "CMakeLists.txt.j2",
    "cmake/{p}-config.cmake.in": "config.cmake.in.j2",
    "examples/minimal/CMakeLists.txt": "example_CMakeLists.txt.j2",
    "library.json": "library.json.j2",
    "library.properties": "library.properties.j2",
    "idf_component.yml": "idf_component.yml.j2",
    "zephyr/module.yml": "module.yml.j2",
    "zephyr/CMakeLists.txt": "zephyr_CMakeLists.txt.j2",
    "zephyr/Kconfig": "Kconfig.j2",
}


@dataclass(frozen=True)
class Package:
    """A controller as something to hand over.

    Attributes:
        controller: the specification.
        generated: its C.
        version: of the package, which is the generator's.
    """

    controller: Controller
    generated: GeneratedFiles
    version: str

    @property
    def prefix(self) -> str:
        """What the C's names begin with, and the package is called."""
        return f"tdc_{self.controller.name}"

    @property
    def other_majors(self) -> tuple[str, ...]:
        """Versions that who asks for one of them must not get this one instead of."""
        major = int(self.version.split(".")[0])
        return tuple(f"{other}.0.0" for other in (major - 1, major + 1) if other >= 0)

    @property
    def sources(self) -> tuple[str, ...]:
        """The C files to compile."""
        return tuple(sorted(name for name in self.generated.files if name.endswith(".c")))

    @property
    def headers(self) -> tuple[str, ...]:
        """The headers beside them."""
        return tuple(sorted(name for name in self.generated.files if name.endswith(".h")))

    @property
    def summary(self) -> str:
        """What it controls, in one line of plain text."""
        joints = len(self.controller.joints)
        of = " ".join(self.controller.description.split()) or self.controller.name
        return f"Inclusive time delay control of {joints} joint{'s' * (joints > 1)}: {of}"


def package_of(controller: Controller, generated: GeneratedFiles) -> Package:
    """The package of a controller's C."""
    return Package(controller, generated, version("inclusive-tdc"))


def files(package: Package) -> dict[str, bytes]:
    """All files but the README, by path.

    Raises:
        codegen.source.GenerationError: clang-format is missing or failed.
    """
    values = context(package)
    c = {f"src/{name}": package.generated.files[name] for name in package.sources + package.headers}
    made = {
        **c,
        "manifest.json": package.generated.files["manifest.json"],
        "LICENSE": (REPOSITORY / "LICENSE").read_text(encoding="utf-8"),
        "examples/minimal/main.c": formatted(text("main.c.j2", values), "main.c"),
        **{
            path.format(p=package.prefix): text(template, values)
            for path, template in _TEXTS.items()
        },
    }
    encoded = {path: body.encode("utf-8") for path, body in made.items()}
    return {**encoded, FMU.format(package.prefix): fmu(package.controller, package.generated)}


def context(package: Package) -> dict[str, Any]:
    """What the templates are given."""
    controller = package.controller
    fixed = controller.arithmetic.kind == "fixed-point"
    return {
        "c": controller,
        "p": package.prefix,
        "NAME": controller.name.upper(),
        "version": package.version,
        "summary": package.summary,
        "sources": package.sources,
        "headers": package.headers,
        "journal": JOURNAL,
        "fixed": fixed,
        "formats": formats(controller) if fixed else None,
        "torque_type": controller.arithmetic.torque,
        "torque": "torque_q" if fixed else "torque_Nm",
        "velocity": units(controller).velocity.field,
        "acceleration": units(controller).acceleration.field,
        "sample_time": repr(float(controller.sample_time)),
        "joints": len(controller.joints),
        "rate_hz": f"{float(1 / controller.sample_time):g}",
    }
