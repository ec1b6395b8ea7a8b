"""From a controller to a directory of C: templates, manifest, and an all-or-nothing write."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
import textwrap
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from codegen import law, sig_pow
from codegen.c99 import Statement, float_literal, print_law
from codegen.controller import Controller, Joint
from codegen.exact import binary32
from codegen.layout import (
    Field,
    Layout,
    Range,
    Scalar,
    Struct,
    common_scale,
    joint_config_values,
    layout,
    scale_values,
)
from codegen.rendering import TEMPLATES, environment

PACKAGE = Path(__file__).parent
REPOSITORY = PACKAGE.parent
FORMAT_STYLE = REPOSITORY / ".clang-format"

# Only what shapes the output: another version of these may print other bytes.
_DEPENDENCIES = ("casadi", "clang-format", "jinja2", "mpmath")


class GenerationError(Exception):
    """The C could not be generated or written; nothing was changed."""


@dataclass(frozen=True)
class GeneratedFiles:
    """The content of ``generated/NAME/``, by file name, manifest included."""

    controller: str
    files: dict[str, str]


@dataclass(frozen=True)
class PrintedLaw:
    """The statements of one joint's law in C."""

    measurement: tuple[Statement, ...]
    switch_on: tuple[Statement, ...]
    torque_law: tuple[Statement, ...]
    saturation: tuple[Statement, ...]
    signals: frozenset[str]
    """Names of the signals that the statements read."""

    @property
    def statements(self) -> tuple[Statement, ...]:
        """All statements in the order of the C."""
        return (*self.measurement, *self.switch_on, *self.torque_law, *self.saturation)


def print_joint_law(controller: Controller, structures: Layout) -> PrintedLaw:
    """The law of one joint as C statements, spelled for the templates."""
    fields = {f.quantity: f.name for f in structures.joint_config.fields if f.quantity}

    def spelling(parameter: law.Input) -> str:
        if parameter.home is law.Home.GAIN:
            return f"gains->{fields[parameter.name]}"
        if parameter.home is law.Home.SCALE:
            shared = common_scale(controller) is not None
            return f"{parameter.name.upper()}_SCALE" if shared else f"scale->{parameter.name}"
        if parameter.home is law.Home.CONSTANT:
            return f"TDC_{controller.name.upper()}_{parameter.name.upper()}_S"
        return parameter.name

    functions = (
        law.measurement(controller.options),
        law.switch_on(),
        law.torque_law(controller.options),
    )
    measurement, switch_on, torque_law = (print_law(f, spelling) for f in functions)
    # The step looks first whether any torque must be limited; rarely one must.
    saturation = tuple(s for s in torque_law if s.name == "limited_torque")
    torque_law = tuple(s for s in torque_law if s not in saturation)
    signals = frozenset(i.name for f in functions for i in f.inputs if i.home is law.Home.SIGNAL)
    return PrintedLaw(measurement, switch_on, torque_law, saturation, signals)


def generate(controller: Controller) -> GeneratedFiles:
    """The C of a controller and its manifest; the same input gives the same bytes.

    Raises:
        GenerationError: clang-format is missing or failed.
    """
    structures = layout(controller.options, len(controller.joints))
    printed = print_joint_law(controller, structures)
    generator = generator_sha256()
    inputs = _sha256(_json({"controller": controller.canonical(), "generator": generator}))
    templates = environment()
    shared = {"banner": _banner(None, generator), "tables": sig_pow.tables()}
    context = {
        **_controller_context(controller, structures, printed),
        "banner": _banner(controller.name, inputs),
    }
    sources = {
        "tdc.h": ("tdc.h.j2", shared),
        "tdc_sig_pow.h": ("tdc_sig_pow.h.j2", shared),
        "tdc_sig_pow.c": ("tdc_sig_pow.c.j2", shared),
        f"tdc_{controller.name}.h": ("controller.h.j2", context),
        f"tdc_{controller.name}.c": ("controller.c.j2", context),
    }
    files = {
        name: _format(templates.get_template(template).render(values), name)
        for name, (template, values) in sources.items()
    }
    files["manifest.json"] = _manifest(controller, printed, files, generator, inputs)
    return GeneratedFiles(controller.name, files)


def identity(controller: Controller) -> int:
    """What a configuration must have been made for: all that its fields can't change.

    Name, structure of the law, sample time and encoder; a hash of 32 bits.
    """
    fixed = {
        "name": controller.name,
        "options": asdict(controller.options),
        "sample_time": str(controller.sample_time),
        "counts_per_joint_rev": [str(j.counts_per_joint_rev) for j in controller.joints],
    }
    return int(_sha256(_json(fixed))[:8], 16)


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
            _swap(fresh, target, Path(scratch) / "old")
    except OSError as error:
        raise GenerationError(
            f"{target}: {error.strerror or error}; nothing was changed. "
            "Check that the directory exists and that you may write to it"
        ) from error
    return target


def _swap(fresh: Path, target: Path, old: Path) -> None:
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


def _controller_context(
    controller: Controller, structures: Layout, printed: PrintedLaw
) -> dict[str, Any]:
    config = [joint_config_values(controller, joint) for joint in controller.joints]

    def defaults(struct: Struct, field: Field) -> str:
        """The default of a field of the header, for its comment."""
        if struct is not structures.joint_config:
            return ""
        values = [_default_text(field, joint, controller) for joint in controller.joints]
        return values[0] if len(set(values)) == 1 else ", ".join(values)

    def initialiser(field: Field, joint: Joint) -> str:
        value = config[controller.joints.index(joint)][field.name]
        if field.type is Scalar.EXPONENT:
            return f"{{{_integer(int(value))}}} /* {_default_text(field, joint, controller)} */"
        return float_literal(float(value)) if field.type is Scalar.FLOAT else _integer(int(value))

    demanded = "filtered_torque" if controller.options.low_pass else "control_torque"
    return {
        "c": controller,
        "title": _comment_lines(_title(controller)),
        "p": f"tdc_{controller.name}",
        "NAME": controller.name.upper(),
        "layout": structures,
        "sample_time_text": str(float(controller.sample_time)),
        "sample_time_literal": float_literal(binary32(controller.sample_time)),
        "identity": f"0x{identity(controller):08X}u",
        "measurement": printed.measurement,
        "switch_on": printed.switch_on,
        "torque_law": printed.torque_law,
        "signals": printed.signals,
        "saturation": printed.saturation,
        "demanded_torque": demanded,
        "measured": _MEASURED,
        "memory": {**_MEMORY, "applied_torque_Nm": demanded},
        "even_motion": _EVEN_MOTION,
        "literal": float_literal,
        "counts_per_rad": lambda joint: binary32(1.0 / joint.rad_per_count),
        "common_scale": common_scale(controller),
        "scale_values": lambda joint: scale_values(controller, joint),
        "defaults": defaults,
        "initialiser": initialiser,
        "check": _check,
    }


def _title(controller: Controller) -> str:
    joints = len(controller.joints)
    robot = f": {controller.description}" if controller.description else ""
    return f"Inclusive time delay control of {joints} joint{'s' if joints > 1 else ''}{robot}."


def _comment_lines(text: str) -> list[str]:
    """The text in lines for a block comment; a comment's end in it would end the comment."""
    return textwrap.wrap(text.replace("*/", "* /"), 96)


# Fields of joint_state that not every law has: what measure() finds for them,
_MEASURED = {"displacement_change": "change_counts", "error_q8": "error_counts_q8"}
# what joint_step() stores in them and in those that it computes,
_MEMORY = {
    **{field: f"now.{name}" for field, name in _MEASURED.items()},
    "reference_velocity_rad_per_s": "input->reference_velocity_rad_per_s[i]",
    "sliding_integral_rad_per_s": "next_sliding_integral",
}
# and what they are while the robot moves evenly.
_EVEN_MOTION = {
    "displacement_change": "0",
    "error_q8": "position_error_q8(input, i)",
    "reference_velocity_rad_per_s": "input->reference_velocity_rad_per_s[i]",
}


def _default_text(field: Field, joint: Joint, controller: Controller) -> str:
    """The default as the specification has it: a short decimal, or a fraction."""
    if field.quantity is None:
        return str(joint.max_displacement)
    if field.quantity == "low_pass_ratio":
        exact = controller.low_pass_ratio
    else:
        exact = getattr(joint, "lambda_" if field.quantity == "lambda" else field.quantity)
    if exact is None:
        raise GenerationError(f"{field.name} has no default")
    decimal = f"{float(exact):.9g}"
    return decimal if type(exact)(decimal) == exact else str(exact)


def _integer(value: int) -> str:
    """An integer literal of int32_t; the smallest one has none and is spelled by its macro."""
    return "INT32_MIN" if value == -(2**31) else str(value)


def _check(field: Field) -> str:
    """The C condition of a field's range, 1u where it holds."""
    value = f"gains->{field.name}"
    if field.range is Range.POSITIVE:
        return f"is_positive({value})"
    if field.range is Range.NOT_NEGATIVE:
        return f"is_not_negative({value})"
    if field.range is Range.RATIO:
        return f"is_positive({value}) & (({value} <= 1.0f) ? 1u : 0u)"
    if field.range is Range.RESTORING_EXPONENT:
        return f"({value}.minus_one_q31 > INT32_MIN) ? 1u : 0u"
    if field.range is Range.EXPONENT:
        return ""  # every tdc_exponent is in range
    if field.range is Range.DISPLACEMENT:
        return f"(({value} >= 1) && ({value} <= {2**30})) ? 1u : 0u"
    raise GenerationError(f"no check is known for {field.name}: {field.range}")


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


def _format(text: str, name: str) -> str:
    """The text in the project's C style; also drops what the templates left blank."""
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
    printed: PrintedLaw,
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
                    "line": _line(files[source], s.name),
                }
                for s in printed.statements
            ],
        }
    )


def _line(text: str, quantity: str) -> int:
    """The line where the C defines a quantity, counted from 1."""
    for number, line in enumerate(text.splitlines(), start=1):
        if f"const float {quantity} =" in line:
            return number
    raise GenerationError(f"the C doesn't define {quantity}")


def _json(value: object) -> str:
    return json.dumps(value, indent=2, sort_keys=True, ensure_ascii=False) + "\n"


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8")).hexdigest()
