"""The manifests of a package, held to the tools and the rules of those who read them."""

from __future__ import annotations

import json
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

from package.contents import Package
from package.tools import CheckError, run


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
        _stand_in(
            Path(scratch), f"set(ESP_PLATFORM 1)\n{ESP_IDF}add_subdirectory({folder} component)"
        )


# What the CMake files of a component and of a module call, reduced to what a compiler sees of it.
ESP_IDF = """
macro(idf_component_register)
    cmake_parse_arguments(C "" "" "SRCS;INCLUDE_DIRS" ${ARGN})
    set(COMPONENT_LIB component)
    add_library(component STATIC ${C_SRCS})
    target_include_directories(component PUBLIC ${C_INCLUDE_DIRS})
endmacro()
"""
ZEPHYR = """
macro(zephyr_library_named name)
    set(library ${name})
    add_library(${name} STATIC)
    target_include_directories(${name} PRIVATE ${included})
endmacro()
macro(zephyr_include_directories)
    set(included ${ARGN})
endmacro()
macro(zephyr_library_sources)
    target_sources(${library} PRIVATE ${ARGN})
endmacro()
macro(zephyr_library_compile_options)
    target_compile_options(${library} PRIVATE ${ARGN})
endmacro()
"""


def _stand_in(scratch: Path, listed: str) -> None:
    """Compiles with a CMake file whose build system is stood in for by a few macros."""
    project = scratch / "stand_in"
    project.mkdir()
    text = f"cmake_minimum_required(VERSION 3.16)\nproject(stand_in LANGUAGES C)\n{listed}\n"
    (project / "CMakeLists.txt").write_text(text, encoding="utf-8")
    run(["cmake", "-S", project, "-B", project / "build"], project)
    run(["cmake", "--build", project / "build"], project)


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
    option = f"TDC_{package.controller.name.upper()}"
    if f"config {option}\n" not in (folder / build["kconfig"]).read_text(encoding="utf-8"):
        raise CheckError(f"{build['kconfig']} has no option {option}")
    with tempfile.TemporaryDirectory(prefix="zephyr-") as scratch:
        chosen = f"set(CONFIG_{option} y)\n{ZEPHYR}"
        _stand_in(Path(scratch), f"{chosen}add_subdirectory({folder / build['cmake']} module)")


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
    # A sketch is C++, in the language that Arduino's compilers take since long.
    header = folder / "src" / found["includes"]
    run(["c++", "-std=c++11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", header], folder)
