"""Each part of a package, tried with the strongest tool that works without a network.

*Built* means compiled here and run, with results that were compared. *Manifest checked* means that
the build system's own tool, or its published rules, accept the description; nothing was compiled
with that build system.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from package.contents import FMU, Package
from package.recording import Recording
from verification.firmware import tool


class Label(Enum):
    """How far a part was tried."""

    BUILT = "built"
    MANIFEST = "manifest checked"


class CheckError(Exception):
    """A part of a package doesn't work; the message says which and what its tool said."""


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


def _environment() -> dict[str, str]:
    """Of the tools that are run: the pinned ones first, and no word to a network."""
    pinned = str(Path(sys.executable).parent)
    return {
        **os.environ,
        "PATH": os.pathsep.join([pinned, os.environ.get("PATH", "")]),
        "PLATFORMIO_SETTING_ENABLE_TELEMETRY": "no",
        "PLATFORMIO_SETTING_CHECK_PLATFORMIO_INTERVAL": "100000",
        "IDF_COMPONENT_CHECK_NEW_VERSION": "0",
    }


def run(command: Sequence[str | Path], directory: Path, **more: str) -> str:
    """What a tool prints.

    Raises:
        CheckError: it ends with an error.
    """
    done = _tried(command, directory, **more)
    if done.returncode != 0:
        raise CheckError(f"{' '.join(map(str, command))} failed:\n{done.stdout}{done.stderr}")
    return done.stdout


def _tried(
    command: Sequence[str | Path], directory: Path, **more: str
) -> subprocess.CompletedProcess[str]:
    environment = {**_environment(), **more}
    program = shutil.which(str(command[0]), path=environment["PATH"])
    if program is None:
        raise CheckError(f"{command[0]} not found: run `make` once to install it")
    return subprocess.run(
        [program, *map(str, command[1:])],
        cwd=directory,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


# --- CMake -------------------------------------------------------------------------------------

REFUSED = "1.0"
"""A version of the CMake package that isn't there."""


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
        wrong = ["cmake", "-S", consumer, "-B", here / "wrong", found]
        refused = _tried([*wrong, f"-DTDC_VERSION={package.next_major}"], here)
        if refused.returncode == 0 or "version" not in refused.stderr:
            raise CheckError(
                f"find_package takes version {package.next_major}, which is not there:\n"
                f"{refused.stdout}{refused.stderr}"
            )


# --- FMU ---------------------------------------------------------------------------------------


def build_fmu(archive: Path, directory: Path) -> Path:
    """Validates an FMU and compiles it into a folder, which it returns.

    Raises:
        CheckError: it is not valid, or doesn't compile without a warning.
    """
    import fmpy
    from fmpy.validation import validate_fmu

    problems = validate_fmu(str(archive))
    if problems:
        raise CheckError(f"{archive.name} is no valid FMU:\n" + "\n".join(problems))
    folder = directory / "fmu"
    fmpy.extract(str(archive), unzipdir=str(folder))
    # In a process of its own: it prints as it likes, and finds CMake in PATH.
    program = (
        "import sys; from fmpy.build import build_platform_binary;"
        "build_platform_binary(sys.argv[1], all_warnings=True, cmake_options="
        "{'CMAKE_C_FLAGS:STRING': '-Werror -ffp-contract=off'})"
    )
    tool("c++", "g++")
    run([sys.executable, "-c", program, folder], directory)
    return folder


def simulate_fmu(folder: Path, package: Package, recording: Recording) -> NDArray[Any]:
    """FMPy's own simulation of a compiled FMU with what a flight's controller was given.

    Returns:
        A structured array with the outputs; row k + 1 is of tick k.
    """
    import fmpy

    joints = len(package.controller.joints)
    tick = float(package.controller.sample_time)
    ticks = len(recording.counts)
    given = {
        "counts": recording.counts,
        "reference_position": recording.position_rad,
        "reference_velocity": recording.velocity_rad_per_s,
        "reference_acceleration": recording.acceleration_rad_per_s2,
    }
    columns = [
        (f"{name}[{i + 1}]", rows[:, i]) for name, rows in given.items() for i in range(joints)
    ]
    kinds = [("time", np.float64), *((name, column.dtype.type) for name, column in columns)]
    signals = np.zeros(ticks, dtype=kinds)
    signals["time"] = tick * np.arange(ticks)
    for name, column in columns:
        signals[name] = column
    holding = recording.holding_torque_Nm
    with contextlib.redirect_stdout(io.StringIO()):
        answered: NDArray[Any] = fmpy.simulate_fmu(
            str(folder),
            start_time=0.0,
            stop_time=tick * ticks,
            output_interval=tick,
            input=signals,
            start_values={f"holding_torque[{i + 1}]": float(holding[i]) for i in range(joints)},
            output=[*(f"torque[{i + 1}]" for i in range(joints)), "status"],
        )
    return answered


def check_fmu(folder: Path, package: Package, recording: Recording) -> None:
    """Validates, compiles and simulates the FMU; its torques must have the flight's bits.

    Raises:
        CheckError: one of that doesn't work.
    """
    with tempfile.TemporaryDirectory(prefix="fmu-") as scratch:
        built = build_fmu(folder / FMU.format(package.prefix), Path(scratch))
        answered = simulate_fmu(built, package, recording)
    compare(answered, recording)


def compare(answered: NDArray[Any], recording: Recording) -> None:
    """Compares an FMU's outputs with a flight, bit for bit.

    Raises:
        CheckError: they differ; with the first tick in which they do.
    """
    joints = recording.torque_Nm.shape[1]
    torque = np.stack([answered[f"torque[{i + 1}]"][1:] for i in range(joints)], axis=1)
    wanted = recording.torque_Nm.astype(np.float64)
    if torque.shape != wanted.shape:
        raise CheckError(f"the FMU made {len(torque)} ticks, not {len(wanted)}")
    differs = (torque.view(np.uint64) != np.ascontiguousarray(wanted).view(np.uint64)).any(axis=1)
    differs |= answered["status"][1:] != recording.status
    if differs.any():
        k = int(np.argmax(differs))
        raise CheckError(
            f"the FMU differs from the C in {int(differs.sum())} of {len(wanted)} ticks, first in "
            f"tick {k}: {torque[k].tolist()} N m, status {answered['status'][k + 1]}, not "
            f"{wanted[k].tolist()} N m, status {recording.status[k]}"
        )


# --- Manifests ---------------------------------------------------------------------------------


def check_platformio(folder: Path, _: Package) -> None:
    """Packs the library as ``pio pkg publish`` would.

    PlatformIO looks a licence's name up in the network, so that the key is left out here.

    Raises:
        CheckError: PlatformIO refuses it.
    """
    with tempfile.TemporaryDirectory(prefix="pio-") as scratch:
        copy = Path(scratch) / "library"
        shutil.copytree(folder, copy)
        manifest = copy / "library.json"
        described = json.loads(manifest.read_text(encoding="utf-8"))
        del described["license"]
        manifest.write_text(json.dumps(described), encoding="utf-8")
        core = str(Path(scratch) / "core")
        run(["pio", "pkg", "pack", copy, "-o", scratch], copy, PLATFORMIO_CORE_DIR=core)
        if not list(Path(scratch).glob("*.tar.gz")):
            raise CheckError("pio pkg pack left no archive")


def check_esp_idf(folder: Path, package: Package) -> None:
    """Packs the component as ``compote component upload`` would.

    Raises:
        CheckError: ESP-IDF's component manager refuses it.
    """
    with tempfile.TemporaryDirectory(prefix="esp-") as scratch:
        copy = Path(scratch) / package.prefix
        shutil.copytree(folder, copy)
        command = ["compote", "component", "pack", "--name", package.prefix]
        run([*command, "--dest-dir", scratch], copy)
        if not list(Path(scratch).glob("*.tgz")):
            raise CheckError("compote left no archive")


ZEPHYR_MODULE: dict[str, Any] = {
    "type": "object",
    "additionalProperties": False,
    "properties": {
        "name": {"type": "string"},
        "build": {
            "type": "object",
            "additionalProperties": False,
            "properties": {key: {"type": "string"} for key in ("cmake", "kconfig")},
        },
    },
}
"""What Zephyr takes in ``zephyr/module.yml``, of those keys that a library needs."""


def check_zephyr(folder: Path, package: Package) -> None:
    """Holds ``zephyr/module.yml`` to Zephyr's schema, and looks for the files that it names.

    Raises:
        CheckError: a key or a file is wrong.
    """
    import jsonschema
    import yaml

    module = yaml.safe_load((folder / "zephyr" / "module.yml").read_text(encoding="utf-8"))
    try:
        jsonschema.validate(module, ZEPHYR_MODULE)
    except jsonschema.ValidationError as error:
        raise CheckError(f"zephyr/module.yml: {error.message}") from error
    build = module["build"]
    for path in (Path(build["cmake"]) / "CMakeLists.txt", Path(build["kconfig"])):
        if not (folder / path).is_file():
            raise CheckError(f"zephyr/module.yml names {path}, which is not there")
    listed = (folder / "zephyr" / "CMakeLists.txt").read_text(encoding="utf-8")
    for source in package.sources:
        if f"../src/{source}" not in listed:
            raise CheckError(f"zephyr/CMakeLists.txt leaves src/{source} out")
    option = f"TDC_{package.controller.name.upper()}"
    if f"config {option}\n" not in (folder / build["kconfig"]).read_text(encoding="utf-8"):
        raise CheckError(f"{build['kconfig']} has no option {option}")


ARDUINO_KEYS = (
    *("name", "version", "author", "maintainer", "sentence", "paragraph", "category", "url"),
    "architectures",
)
"""What Arduino's library specification asks for in ``library.properties``."""

ARDUINO_CATEGORIES = frozenset(
    (
        *("Display", "Communication", "Signal Input/Output", "Sensors", "Device Control"),
        *("Timing", "Data Storage", "Data Processing", "Other"),
    )
)


def check_arduino(folder: Path, package: Package) -> None:
    """Holds ``library.properties`` and the folders to Arduino's published rules.

    Raises:
        CheckError: a rule is broken.
    """
    text = (folder / "library.properties").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    pairs = [line.partition("=") for line in lines]
    found = {key: value for key, equals, value in pairs if equals}
    rules = {
        "every line is key=value, each key once": len(found) == len(lines),
        f"the keys {', '.join(ARDUINO_KEYS)}": all(found.get(key) for key in ARDUINO_KEYS),
        "a name of letters, digits, spaces and _ - ., at most 63": re.fullmatch(
            r"[A-Za-z0-9][A-Za-z0-9 _.-]{0,62}", found.get("name", "")
        ),
        "a version of three numbers": re.fullmatch(r"\d+\.\d+\.\d+", found.get("version", "")),
        "one of Arduino's categories": found.get("category") in ARDUINO_CATEGORIES,
        "a url with its scheme": re.fullmatch(r"https?://\S+", found.get("url", "")),
        "a paragraph that doesn't begin as the sentence does": not found.get(
            "paragraph", ""
        ).startswith(found.get("sentence", "-")),
        "all C in src/, and none of it beside": not list(folder.glob("*.[ch]"))
        and all((folder / "src" / name).is_file() for name in package.sources),
        "includes names a header in src/": (folder / "src" / found.get("includes", "-")).is_file(),
    }
    broken = [rule for rule, holds in rules.items() if not holds]
    if broken:
        raise CheckError("library.properties: Arduino asks for " + "; ".join(broken))


# --- All of them -------------------------------------------------------------------------------


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
            f"{package.next_major} refused",
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
            "packed by the component manager",
            "put the folder into components/ of a project",
        ),
        Part(
            "Zephyr",
            "zephyr/",
            Label.MANIFEST,
            "held to the schema of module.yml; the files that it names are there",
            f"add the folder to ZEPHYR_EXTRA_MODULES, and CONFIG_TDC_{package.controller.name.upper()}=y",
        ),
        Part(
            "Arduino",
            "library.properties, src/",
            Label.MANIFEST,
            "held to Arduino's published rules",
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
