"""From a controller to a directory of C: templates, manifest, and an all-or-nothing write."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from codegen import sig_pow, sig_pow64, sig_pow_fixed, sig_pow_precise
from codegen.c99 import Statement
from codegen.controller import Controller
from codegen.exact import DISPLACEMENT_MAX, LOST_TICKS_MAX
from codegen.fixed_c import fixed_source
from codegen.fixed_point import formats
from codegen.floating_c import floating_source
from codegen.layout import layout
from codegen.rendering import TEMPLATES, environment
from codegen.source import ControllerSource, GenerationError
from codegen.structs import Field, Layout, Struct

PACKAGE = Path(__file__).parent
REPOSITORY = PACKAGE.parent
FORMAT_STYLE = REPOSITORY / ".clang-format"

# Only what shapes the output: another version of these may print other bytes.
_DEPENDENCIES = ("casadi", "clang-format", "jinja2", "mpmath")


@dataclass(frozen=True)
class GeneratedFiles:
    """The content of ``generated/NAME/``, by file name, manifest included."""

    controller: str
    files: dict[str, str]


def controller_source(controller: Controller, structures: Layout) -> ControllerSource:
    """What one controller's own C is made from."""
    fixed = controller.arithmetic.kind == "fixed-point"
    return fixed_source(controller) if fixed else floating_source(controller, structures)


def generate(controller: Controller) -> GeneratedFiles:
    """The C of a controller and its manifest; the same input gives the same bytes.

    Raises:
        GenerationError: clang-format is missing or failed.
    """
    structures = layout(controller)
    source = controller_source(controller, structures)
    generator = generator_sha256()
    inputs = _sha256(_json({"controller": controller.canonical(), "generator": generator}))
    templates = environment()
    shared = {"banner": _banner(None, generator), **_tables(source.files)}
    context = {
        **_header_context(controller, structures, source),
        **source.context,
        "banner": _banner(controller.name, inputs),
    }
    sources = {
        **{name: (f"{name}.j2", shared) for name in ("tdc.h", *source.files)},
        f"tdc_{controller.name}.h": ("controller.h.j2", context),
        f"tdc_{controller.name}.c": (source.template, context),
    }
    files = {
        name: formatted(templates.get_template(template).render(values), name)
        for name, (template, values) in sources.items()
    }
    files["manifest.json"] = _manifest(controller, source.statements, files, generator, inputs)
    return GeneratedFiles(controller.name, files)


def untunable(controller: Controller) -> dict[str, Any]:
    """What of a specification its configuration can't change: all but gains and limits."""
    return {
        "name": controller.name,
        "arithmetic": asdict(controller.arithmetic),
        "options": asdict(controller.options),
        "sample_time": str(controller.sample_time),
        "counts_per_joint_rev": [str(j.counts_per_joint_rev) for j in controller.joints],
    }


def identity(controller: Controller) -> int:
    """What a configuration must have been made for; a hash of 32 bits.

    That is `untunable`, the shape of the configuration, and the units of integers, which follow
    from the gains.
    """
    structures = layout(controller)
    parts = untunable(controller) | {
        struct.name: [(f.name, f.type.name, f.count) for f in struct.fields]
        for struct in (structures.joint_config, structures.config)
    }
    if controller.arithmetic.kind == "fixed-point":
        parts["formats"] = asdict(formats(controller))
    return int(_sha256(_json(parts))[:8], 16)


def generator_sha256() -> str:
    """The hash of this package's sources, its templates and the format style."""
    sources = sorted([*PACKAGE.glob("*.py"), *TEMPLATES.glob("*.j2")])
    digest = hashlib.sha256()
    for path in (*sources, FORMAT_STYLE):
        digest.update(path.name.encode() + b"\0" + path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()


def write(generated: GeneratedFiles, directory: Path) -> Path:
    """Writes the files to ``directory/NAME``, all of them or none; returns that path.

    The old directory is replaced by renaming, so that an interruption leaves either the old or
    the new output whole.

    Raises:
        GenerationError: the directory can't be written.
    """
    target = directory / generated.controller
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".tdc-", dir=directory) as scratch:
            fresh = Path(scratch) / "fresh"
            fresh.mkdir()
            for name, text in generated.files.items():
                (fresh / name).write_bytes(text.encode("utf-8"))
            swap(fresh, target, Path(scratch) / "old")
    except OSError as error:
        raise GenerationError(
            f"{target}: {error.strerror or error}; nothing was changed. "
            "Check that the directory exists and that you may write to it"
        ) from error
    return target


def swap(fresh: Path, target: Path, old: Path) -> None:
    """Puts a folder in another one's place, which becomes ``old``; on an error nothing changes.

    Args:
        fresh: what comes, on the same file system.
        target: its place.
        old: where what was there goes.

    Raises:
        OSError: it can't be done.
    """
    if target.exists():
        target.replace(old)
    try:
        fresh.replace(target)
    except OSError:
        if old.exists():
            old.replace(target)
        raise


def differences(generated: GeneratedFiles, directory: Path) -> list[str]:
    """What differs between the generated files and those in ``directory/NAME``, a line each."""
    target = directory / generated.controller
    found = {p.name: p.read_bytes() for p in target.iterdir()} if target.is_dir() else {}
    expected = {name: text.encode("utf-8") for name, text in generated.files.items()}
    return [
        f"{target / name}: "
        + (
            "missing"
            if name not in found
            else "not made by the generator"
            if name not in expected
            else "differs"
        )
        for name in sorted(found.keys() | expected.keys())
        if found.get(name) != expected.get(name)
    ]


# --- What the templates are given --------------------------------------------------------------

_TABLES: dict[str, Callable[[], Any]] = {
    "tdc_sig_pow.c": lambda: {"tables": sig_pow.tables()},
    "tdc_sig_pow_precise.c": lambda: {"precise_tables": sig_pow_precise.precise_tables()},
    "tdc_sig_pow64.c": lambda: {"tables": sig_pow64.tables()},
    "tdc_fixed.c": sig_pow_fixed.template_values,
}


def _tables(files: Sequence[str]) -> dict[str, Any]:
    """What the shared C files are made from."""
    made: dict[str, Any] = {}
    for name in files:
        made |= _TABLES[name]() if name in _TABLES else {}
    return made


def _header_context(
    controller: Controller, structures: Layout, source: ControllerSource
) -> dict[str, Any]:
    def defaults(struct: Struct, field: Field) -> str:
        """The default of a field of the header, for its comment."""
        if struct is not structures.joint_config:
            return ""
        values = [source.default_text(field, joint) for joint in controller.joints]
        return values[0] if len(set(values)) == 1 else ", ".join(values)

    return {
        "c": controller,
        "title": _comment_lines(_title(controller)),
        "p": f"tdc_{controller.name}",
        "NAME": controller.name.upper(),
        "layout": structures,
        "sample_time_text": str(float(controller.sample_time)),
        "identity": f"0x{identity(controller):08X}u",
        "defaults": defaults,
        "headers": [name for name in source.files if name.endswith(".h")],
        "lost_ticks_max": LOST_TICKS_MAX,
        "displacement_max": DISPLACEMENT_MAX,
    }


def _title(controller: Controller) -> str:
    joints = len(controller.joints)
    robot = f": {controller.description}" if controller.description else ""
    return f"Inclusive time delay control of {joints} joint{'s' if joints > 1 else ''}{robot}."


def _comment_lines(text: str) -> list[str]:
    """The text in lines for a block comment; a comment's end in it would end the comment."""
    return textwrap.wrap(text.replace("*/", "* /"), 96)


# --- Rendering ---------------------------------------------------------------------------------


def _banner(controller: str | None, sha256: str) -> str:
    version = metadata.version("inclusive-tdc")
    origin = (
        f"from the specification of controller {controller}"
        if controller
        else "for all its controllers alike"
    )
    return (
        f"/*\n * Generated by inclusive-tdc {version} {origin}; do not edit.\n"
        f" * {'Inputs' if controller else 'Generator'} sha256 {sha256}\n"
        " * SPDX-License-Identifier: Apache-2.0\n */"
    )


def formatted(text: str, name: str) -> str:
    """The text in the project's C style; also drops what the templates left blank.

    Raises:
        GenerationError: clang-format is missing or failed.
    """
    executable = Path(sys.executable).parent / "clang-format"
    command = [
        str(executable) if executable.exists() else "clang-format",
        f"--style=file:{FORMAT_STYLE}",
        f"--assume-filename={name}",
    ]
    try:
        done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    except OSError as error:
        raise GenerationError(
            f"clang-format can't be started ({error.strerror}): run `make` once to install it"
        ) from error
    except subprocess.CalledProcessError as error:
        raise GenerationError(f"clang-format failed on {name}: {error.stderr.strip()}") from error
    return done.stdout.strip() + "\n"


def _manifest(
    controller: Controller,
    statements: Sequence[Statement],
    files: dict[str, str],
    generator: str,
    inputs: str,
) -> str:
    source = f"tdc_{controller.name}.c"
    return _json(
        {
            "controller": controller.canonical(),
            "inputs_sha256": inputs,
            "generator": {
                "version": metadata.version("inclusive-tdc"),
                "sha256": generator,
                "dependencies": {name: metadata.version(name) for name in _DEPENDENCIES},
            },
            "configuration_identity": f"0x{identity(controller):08X}",
            "files": {name: _sha256(text) for name, text in sorted(files.items())},
            "quantities": [
                {
                    "name": s.name,
                    "equation": s.equation,
                    "unit": s.unit,
                    "meaning": s.meaning,
                    "file": source,
                    "line": _line(files[source], s),
                }
                for s in statements
            ],
        }
    )


def _line(text: str, statement: Statement) -> int:
    """The line where the C defines a quantity, counted from 1, however its text was wrapped."""
    characters = re.sub(r"\s", "", f"{statement.name}={statement.expression}")
    found = re.search(r"\b" + r"\s*".join(map(re.escape, characters)), text)
    if found is None:
        raise GenerationError(f"the C doesn't define {statement.name}")
    return text.count("\n", 0, found.start()) + 1


def _json(value: object) -> str:
    return json.dumps(value, indent=2, sort_keys=True, ensure_ascii=False) + "\n"


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8")).hexdigest()
