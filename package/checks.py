"""Each part of a package, tried with the strongest tool that works without a network.

*Built* means compiled here and run, with results that were compared. *Manifest checked* means that
the build system's own tool, or its published rules, accept the description; nothing was compiled
with that build system.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from package.contents import FMU, Package
from package.manifests import check_arduino, check_esp_idf, check_platformio, check_zephyr
from package.recording import Recording
from package.simulation import check_fmu
from package.tools import CheckError, run, tried


class Label(Enum):
    """How far a part was tried."""

    BUILT = "built"
    MANIFEST = "manifest checked"


@dataclass(frozen=True)
class Part:
    """A part of a package.

    Attributes:
        title: for whom it is.
        files: what of the folder it is.
        label: how far it is tried.
        tried: with what, in one sentence.
        use: how it is used.
    """

    title: str
    files: str
    label: Label
    tried: str
    use: str


def check_cmake(folder: Path, package: Package) -> None:
    """Installs the package, builds and runs its example with it, and asks for a wrong version.

    Raises:
        CheckError: one of that doesn't work.
    """
    with tempfile.TemporaryDirectory(prefix="cmake-") as scratch:
        here = Path(scratch)
        prefix = here / "prefix"
        run(["cmake", "-S", folder, "-B", here / "build", f"-DCMAKE_INSTALL_PREFIX={prefix}"], here)
        run(["cmake", "--build", here / "build", "--target", "install"], here)
        consumer = folder / "examples" / "minimal"
        build = here / "consumer"
        found = f"-DCMAKE_PREFIX_PATH={prefix}"
        run(["cmake", "-S", consumer, "-B", build, found], here)
        run(["cmake", "--build", build], here)
        # The example ends with an error where the controller doesn't hold the robot still.
        run([build / "minimal"], here)
        for wrong in package.other_majors:
            command: list[str | Path] = ["cmake", "-S", consumer, "-B", here / wrong, found]
            refused = tried([*command, f"-DTDC_VERSION={wrong}"], here)
            # CMake breaks its lines, where depends on the package's name.
            said = " ".join(refused.stderr.split())
            if refused.returncode == 0 or f'requested version "{wrong}"' not in said:
                raise CheckError(
                    f"find_package doesn't refuse version {wrong}, which is not there:\n"
                    f"{refused.stdout}{refused.stderr}"
                )


def parts(package: Package, recording: Recording) -> tuple[Part, ...]:
    """The parts of a package, as :func:`check` tries them."""
    p, version = package.prefix, package.version
    ticks = f"{len(recording.counts):,}".replace(",", " ")
    return (
        Part(
            "CMake",
            "CMakeLists.txt, cmake/",
            Label.BUILT,
            "installed, found by the example, which was built and run; version "
            f"{' and '.join(package.other_majors)} refused",
            f"find_package({p} {version} REQUIRED CONFIG), then link {p}::{p}",
        ),
        Part(
            "FMI 3.0",
            FMU.format(p),
            Label.BUILT,
            f"validated, compiled and simulated with FMPy: {ticks} ticks ({recording.source}), "
            "every torque with the bits of the C",
            f"fmpy compile {FMU.format(p)}, or a tool that builds source FMUs",
        ),
        Part(
            "PlatformIO",
            "library.json",
            Label.MANIFEST,
            "packed by pio, without the licence's key, which it looks up in the network",
            "put the folder into lib/ of a project",
        ),
        Part(
            "ESP-IDF",
            "idf_component.yml, CMakeLists.txt",
            Label.MANIFEST,
            "packed by the component manager; its CMake file compiled with stand-ins",
            "put the folder into components/ of a project",
        ),
        Part(
            "Zephyr",
            "zephyr/",
            Label.MANIFEST,
            "held to the schema of module.yml; its CMake file compiled with stand-ins",
            f"add the folder to ZEPHYR_EXTRA_MODULES, and set CONFIG_{p.upper()}=y",
        ),
        Part(
            "Arduino",
            "library.properties, src/",
            Label.MANIFEST,
            "held to Arduino's published rules; the header compiled as C++",
            "put the folder into libraries/ of the sketchbook",
        ),
    )


def check(
    folder: Path, package: Package, recording: Recording, says: Callable[[str], None]
) -> None:
    """Tries every part of a package.

    Args:
        folder: with the package.
        package: what it is.
        recording: a flight of its controller.
        says: is told what is tried next.

    Raises:
        CheckError: a part doesn't work.
        verification.firmware.ToolError: a compiler is missing.
    """
    says("FMI 3.0")
    check_fmu(folder, package, recording)
    for title, one in (
        ("CMake", check_cmake),
        ("PlatformIO", check_platformio),
        ("ESP-IDF", check_esp_idf),
        ("Zephyr", check_zephyr),
        ("Arduino", check_arduino),
    ):
        says(title)
        one(folder, package)
