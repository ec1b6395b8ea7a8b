"""The specification of a controller: what the user writes, as a validated model of tables.

:func:`validate` turns plain TOML data into a :class:`Specification`; whatever is wrong is a
:class:`~codegen.problems.SpecificationError` that names key, value, rule and fix, for all
mistakes at once. :mod:`codegen.controller` applies presets and gives every joint its values.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    WithJsonSchema,
)
from pydantic_core import ErrorDetails

from codegen.arithmetic import Accuracy, Kind, Precision
from codegen.exact import (
    LOST_TICKS_MAX,
    PerJointAlpha,
    PerJointBeta,
    PerJointGamma,
    PerJointNotNegative,
    PerJointNotZero,
    PerJointPositive,
    Positive,
    in_range,
)
from codegen.law import AccelerationEstimate, VelocityError
from codegen.problems import Problem, SpecificationError, nearest, show


class _Table(BaseModel):
    model_config = ConfigDict(
        extra="forbid", frozen=True, arbitrary_types_allowed=True, validate_default=True
    )


class LawTable(_Table):
    """``[law]``: the gains of the inclusive law. A per-joint key takes one number or a list."""

    preset: str | None = Field(
        None,
        description="A special case of the paper or a row of Table II; sets gains.",
        examples=["enhanced"],
    )
    inertia_kgm2: PerJointPositive = Field(
        description="Mbar [kg m^2], diagonal: raise it until the error no longer falls (III-E).",
        examples=[[0.3818, 0.30545, 0.15296]],
    )
    kd: PerJointNotNegative = Field(
        description="KD [rad^(1-alpha) s^(alpha-2)], damping of the desired error dynamics (17).",
        examples=[20],
    )
    kp: PerJointNotNegative = Field(
        description="KP [rad^(1-beta) s^-2], stiffness of the desired error dynamics (17).",
        examples=[100],
    )
    lambda_: PerJointNotNegative = Field(
        alias="lambda",
        description="lambda [rad^(1-gamma) s^(gamma-2)], correction of the time delay estimation "
        "error (31).",
        examples=[20],
    )
    alpha: PerJointAlpha = Field(
        description="Exponent of the velocity error; 1 is linear.", examples=["95/100"]
    )
    beta: PerJointBeta = Field(
        description='Exponent of the position error, or "finite-time": alpha/(2 - alpha) (35).',
        examples=["finite-time"],
    )
    gamma: PerJointGamma = Field(
        description="Exponent of the sliding variable; 0 is its sign, 1 is linear.", examples=[0.4]
    )
    velocity_error: VelocityError = Field(
        "reference-rate",
        description="How ed is formed: reference-rate (the paper's), error-difference or "
        "half-sample.",
        examples=["half-sample"],
    )
    acceleration: AccelerationEstimate = Field(
        "current",
        description="Which second difference of the position estimates qdd(t-L): the one that ends "
        "at q(t), or the one a tick older.",
        examples=["delayed"],
    )
    low_pass_rad_per_s: Positive | None = Field(
        None,
        description="Cutoff w of the low-pass (43) [rad/s]; without it there is none.",
        examples=[300],
    )


class EncoderTable(_Table):
    """``[encoder]``: from counts to radians at the joint."""

    counts_per_rev: PerJointPositive = Field(
        description="Counts a motor revolution AFTER quadrature decoding [count]: 4 x pulses "
        "(lines).",
        examples=[8192],
    )
    gear_ratio: PerJointNotZero = Field(
        description="Motor revolutions a joint revolution; negative if they turn opposite ways.",
        examples=[[120, -120, 120]],
    )


class DriveTable(_Table):
    """``[drive]``: what the drive can do."""

    torque_limit_Nm: PerJointPositive = Field(
        description="Largest torque at the joint [N m] (motor torque times gear ratio).",
        examples=[[76.44, 76.44, 38.28]],
    )
    reports_torque: bool = Field(
        False,
        description="Whether the drive reports the torque that it applied in the last tick.",
        examples=[True],
    )


class SafetyTable(_Table):
    """``[safety]``: what counts as implausible, and what happens then."""

    max_speed_rad_per_s: PerJointPositive = Field(
        description="Joint speed [rad/s] above which a change of counts is an encoder jump.",
        examples=[5],
    )
    max_acceleration_rad_per_s2: PerJointPositive | None = Field(
        None,
        description="Joint acceleration [rad/s^2] above which a change of speed is an encoder "
        "jump; by default what the torque limit gives Mbar.",
        examples=[150],
    )
    max_lost_ticks: Annotated[int, Field(ge=1, le=LOST_TICKS_MAX)] = Field(
        20,
        description="Lost ticks in a row after which the controller stops with zero torque.",
        examples=[5],
    )
    anti_windup: bool = Field(
        True,
        description="Whether the sliding variable of a saturated joint stops integrating.",
        examples=[False],
    )
    on_error: Literal["hold", "zero"] = Field(
        "hold",
        description="Torque of a lost tick: the last one held, or zero.",
        examples=["zero"],
    )


class Specification(_Table):
    """A controller as the user specifies it (see the tables for the keys)."""

    name: Annotated[
        str,
        in_range(
            lambda v: re.fullmatch(r"[a-z][a-z0-9_]{0,23}", v) is not None,
            "a lower-case C identifier of at most 24 characters, as in tdc_NAME_step",
            'write a name such as "puma3"',
        ),
        WithJsonSchema({"type": "string", "pattern": "^[a-z][a-z0-9_]{0,23}$"}),
    ] = Field(
        description="Name of the controller, used in file and function names.", examples=["puma3"]
    )
    description: str = Field(
        "",
        description="One sentence on the robot, for the C header.",
        examples=["a UR5 on a bench"],
    )
    robot: str | None = Field(
        None,
        description="A robot preset: its own numbers, where not given.",
        examples=["faraman-at2"],
    )
    joint_names: Annotated[
        tuple[Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9 _-]{0,31}$")], ...],
        Field(min_length=1, max_length=32),
    ] = Field(
        description="The joints' names in order; their number is the number of joints.",
        examples=[["waist", "shoulder", "elbow"]],
    )
    sample_time_s: Annotated[
        Positive, in_range(lambda v: v <= 1, "at most 1 s", "write the sample time in seconds")
    ] = Field(description="L, sample time and time delay [s].", examples=[0.001])
    arithmetic: Kind = Field(
        "floating-point",
        description="What the C computes with; fixed-point is for cores without an FPU "
        "(Cortex-M0+, M3).",
        examples=["fixed-point"],
    )
    precision: Precision = Field(
        "float32",
        description="The floating-point number; float64 is for cores with a double FPU "
        "(Cortex-M7).",
        examples=["float64"],
    )
    accuracy: Accuracy = Field(
        "standard",
        description="Of the powers in float32: standard to 2^-21.75, precise to 2 units in the "
        "last place at a fifth more instructions.",
        examples=["precise"],
    )
    law: LawTable
    encoder: EncoderTable
    drive: DriveTable
    safety: SafetyTable


def validate(data: Mapping[str, Any], source: str) -> Specification:
    """The model of plain data, presets already applied.

    Raises:
        SpecificationError: with everything that breaks a rule of a single key.
    """
    try:
        return Specification.model_validate(data)
    except ValidationError as error:
        problems = [_problem(detail, data) for detail in error.errors()]
        raise SpecificationError(source, problems) from error


# --- pydantic's findings in the user's words -------------------------------------------------


def _problem(detail: ErrorDetails, data: Mapping[str, Any]) -> Problem:
    """One pydantic finding as key, value, rule and fix."""
    location = [part for part in detail["loc"] if part not in ("constrained-str",)]
    key = _key(location, data)
    kind, context = detail["type"], detail.get("ctx", {})
    if kind == "rule":
        return Problem(key, show(detail["input"]), str(context["rule"]), str(context["fix"]))
    if kind == "extra_forbidden":
        known = _known_keys(location[:-1])
        near = nearest(str(location[-1]), known)
        fix = f'did you mean "{near}"?' if near else "remove it"
        return Problem(key, show(detail["input"]), "a known key: " + ", ".join(known), fix)
    if kind == "missing":
        meaning = _description(location)
        return Problem(key, "(missing)", "this key is needed", f"add it: {meaning}")
    rule = detail["msg"].replace("Input should be ", "").replace("'", '"')
    return Problem(key, show(detail["input"]), rule, _description(location) or "correct it")


def _key(location: Sequence[int | str], data: Mapping[str, Any]) -> str:
    """The dotted key; an index only where the user wrote a list."""
    key, here = "", data
    for part in location:
        if isinstance(part, int):
            key += f"[{part}]" if isinstance(here, list | tuple) else ""
            here = here[part] if isinstance(here, list | tuple) and part < len(here) else here
        else:
            name = part if re.fullmatch("[A-Za-z0-9_-]+", part) else show(part)
            key += f".{name}" if key else name
            here = here.get(part, {}) if isinstance(here, Mapping) else {}
    return key


def _table(location: Sequence[int | str]) -> type[BaseModel] | None:
    model: type[BaseModel] | None = Specification
    for part in location:
        annotation = model.model_fields[str(part)].annotation if model else None
        model = (
            annotation
            if isinstance(annotation, type) and issubclass(annotation, BaseModel)
            else None
        )
    return model


def _known_keys(location: Sequence[int | str]) -> list[str]:
    model = _table(location)
    return [f.alias or name for name, f in model.model_fields.items()] if model else []


def _description(location: Sequence[int | str]) -> str:
    path = [part for part in location if isinstance(part, str)]
    model = _table(path[:-1]) if len(path) <= 2 else None
    for name, info in (model.model_fields if model else {}).items():
        if (info.alias or name) == path[-1]:
            return info.description or f"a table, [{path[-1]}]"
    return ""


def json_schema() -> str:
    """The JSON Schema of a specification, for editors, as text that ends in a newline.

    Keys that a preset may provide are not required by the schema; the loader asks for them.
    """
    schema = Specification.model_json_schema(by_alias=True)
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    for table in (schema, *schema["$defs"].values()):
        table.pop("required", None)
    schema["required"] = ["name", "joint_names", "safety"]
    return json.dumps(schema, indent=2) + "\n"
