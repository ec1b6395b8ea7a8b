"""A controller as a source FMU: FMI 3.0, co-simulation, a communication step a sample time."""

from __future__ import annotations

import io
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from importlib import resources
from importlib.metadata import version
from typing import Any

import numpy as np

from codegen.controller import Controller
from codegen.emit import REPOSITORY, GeneratedFiles, formatted
from codegen.floating_point import FieldValue
from codegen.layout import joint_config_values, layout
from codegen.structs import Scalar
from package.rendering import text
from package.variables import FIXED_POWER, UNITS, Role, variables
from plant.units import Unit, units

HEADERS = ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h")
"""FMI's own, under their own licence; FMPy brings them."""

_DIMENSIONS = {
    "s": {"s": 1},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "kg.m2": {"kg": 1, "m": 2},
}
"""FMI's units in SI base units."""

_READERS = {Scalar.EXPONENT: "exponent(kept)", Scalar.EXPONENT64: "exponent64(kept)"}
_WRITERS = {
    Scalar.EXPONENT: "good = set_exponent(&kept, value);",
    Scalar.EXPONENT64: "good = set_exponent64(&kept, value);",
}


def fmu(controller: Controller, generated: GeneratedFiles) -> bytes:
    """The FMU, a zip archive with the same bytes for the same C.

    Args:
        controller: the specification.
        generated: its C.

    Raises:
        codegen.source.GenerationError: clang-format is missing or failed.
    """
    return _zip(fmu_files(controller, generated))


def fmu_files(controller: Controller, generated: GeneratedFiles) -> dict[str, str]:
    """What is in the FMU, by path."""
    own = {name: body for name, body in generated.files.items() if name.endswith((".c", ".h"))}
    headers = {name: _header(name) for name in HEADERS}
    shared = _shared(controller)
    description = text("modelDescription.xml.j2", {**shared, "token": ""})
    glue = text("fmu.c.j2", {**shared, "token": ""})
    # The token stands for all that the XML and the C must agree on.
    token = str(uuid.uuid5(uuid.NAMESPACE_OID, "\0".join([description, glue, *own.values()])))
    sources = sorted(["fmu.c", *(name for name in own if name.endswith(".c"))])
    return {
        "modelDescription.xml": text("modelDescription.xml.j2", {**shared, "token": token}),
        "sources/buildDescription.xml": text(
            "buildDescription.xml.j2", {**shared, "sources": sources}
        ),
        "sources/fmu.c": formatted(text("fmu.c.j2", {**shared, "token": token}), "fmu.c"),
        **{f"sources/{name}": body for name, body in {**own, **headers}.items()},
        "documentation/index.html": text("fmu.html.j2", shared),
        "documentation/licenses/license.txt": _licence(headers),
    }


def _shared(controller: Controller) -> dict[str, Any]:
    """What the FMU's templates are given."""
    table = variables(controller)
    stored = list(dict.fromkeys(v.stored for v in table))
    torque_per_Nm = units(controller).torque.per_si
    return {
        "c": controller,
        "p": f"tdc_{controller.name}",
        "NAME": controller.name.upper(),
        "version": version("inclusive-tdc"),
        "sample_time": repr(float(controller.sample_time)),
        "variables": table,
        "starts": starts(controller),
        "units": {name: _DIMENSIONS[name] for name in UNITS.values()},
        "roles": [role.name for role in Role],
        "stored": [each.name for each in stored],
        "c_types": {each.name: each.value for each in stored},
        "readers": {s.name: _READERS.get(s, "(double)kept") for s in stored},
        "writers": {s.name: _WRITERS.get(s, f"kept = ({s.value})value;") for s in stored},
        "torque_type": controller.arithmetic.torque,
        "torque_per_Nm": None if torque_per_Nm is None else float(torque_per_Nm),
        # As the plant has them, so that both round alike.
        "counts_per_rad": [1.0 / joint.rad_per_count for joint in controller.joints],
        "signals": _signals(controller),
    }


def _signals(controller: Controller) -> dict[str, dict[str, Any]]:
    """The signals whose unit the C chooses: C type, field, factors, and the model's array."""
    own, joints = units(controller), len(controller.joints)

    def signal(unit: Unit, array: str) -> dict[str, Any]:
        per_si = None if unit.per_si is None else np.broadcast_to(unit.per_si, joints).tolist()
        kind = controller.arithmetic.torque
        return {"type": kind, "field": unit.field, "per_si": per_si, "input": array}

    reported = "applied_torque" if controller.options.torque_report else ""
    return {
        "velocity": signal(own.velocity, "reference_velocity"),
        "acceleration": signal(own.acceleration, "reference_acceleration"),
        "torque": signal(own.torque, reported),
    }


def starts(controller: Controller) -> dict[str, str]:
    """The start values of inputs and parameters, by name, without a digit lost."""
    made = {v.name: "0" for v in variables(controller) if v.role in (Role.INPUT, Role.START)}
    made |= {
        "on_error": str(int(controller.on_error != "hold")),
        "max_lost_ticks": str(controller.max_lost_ticks),
        "anti_windup": str(int(controller.anti_windup)),
    }
    kinds = {field.name: field.type for field in layout(controller).joint_config.fields}
    for i, joint in enumerate(controller.joints):
        for name, value in joint_config_values(controller, joint).items():
            for part, number in _shown(kinds[name], value):
                made[f"joint[{i + 1}].{name}{part}"] = repr(number)
    return made


def _shown(kind: object, value: FieldValue) -> list[tuple[str, float | int]]:
    """A field's value as FMI shows it: what is appended to its name, and a number."""
    if isinstance(value, tuple):
        if kind is Scalar.FIXED_POWER:
            parts = (f".{field.name}" for field in FIXED_POWER.fields)
            return [(part, int(x)) for part, x in zip(parts, value, strict=True)]
        return [("", (1.0 + value[0]) + value[1])]
    return [("", 1.0 + value / 2.0**31 if kind is Scalar.EXPONENT else value)]


def _header(name: str) -> str:
    return resources.files("fmpy").joinpath("c-code", name).read_text(encoding="utf-8")


def _licence(headers: Mapping[str, str]) -> str:
    """Ours, and that of FMI's headers as it stands in each of them."""
    own = (REPOSITORY / "LICENSE").read_text(encoding="utf-8")
    first = headers[HEADERS[0]]
    theirs = first[first.index("Copyright (C)") : first.index("*/")].strip()
    return f"{own}\n\n{', '.join(HEADERS)}:\n\n{theirs}\n"


def _zip(files: Mapping[str, str]) -> bytes:
    """A zip archive in which nothing depends on when or where it was made."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, body in _first(files, "modelDescription.xml"):
            entry = zipfile.ZipInfo(name)  # dated 1980-01-01
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, body.encode("utf-8"))
    return buffer.getvalue()


def _first(files: Mapping[str, str], first: str) -> Sequence[tuple[str, str]]:
    return [(first, files[first]), *sorted((n, b) for n, b in files.items() if n != first)]
