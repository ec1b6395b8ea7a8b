"""The specification of a controller: what the user writes, read into one validated model.

``load(path)`` reads a TOML file and returns a :class:`Controller`, in which presets are applied,
every per-joint key has one value a joint and every number is exact (:class:`fractions.Fraction`).
Whatever is wrong is a :class:`SpecificationError` that names the key, the value, the rule and
the fix, for all mistakes at once.
"""

from __future__ import annotations

import contextlib
import difflib
import json
import math
import re
import struct
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    WithJsonSchema,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from codegen.law import AccelerationEstimate, LawOptions, VelocityError
from codegen.presets import LAW_PRESETS, ROBOT_PRESETS, LawPreset

FINITE_TIME = "finite-time"
EXPONENT_MAX = Fraction(2)
"""Exponents lie below 2: sig_pow keeps a - 1 as a signed fraction of 31 bits."""

_BINARY32_MIN = Fraction(1, 2**126)
_BINARY32_MAX = Fraction(2**24 - 1) * 2**104
_MAX_DISPLACEMENT = 2**30


# --- Errors ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Problem:
    """One mistake in a specification."""

    key: str
    value: str
    rule: str
    fix: str

    def __str__(self) -> str:
        return f"{self.key} = {self.value}\n    rule: {self.rule}\n    fix:  {self.fix}"


class SpecificationError(Exception):
    """A specification that can't be used, with all that is wrong with it."""

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        self.source = source
        self.problems = tuple(problems)
        super().__init__("\n".join(f"{source}: {problem}" for problem in self.problems))


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word that is most like the given one, or None when none is close."""
    matches = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return matches[0] if matches else None


def _show(value: object) -> str:
    """A value as TOML would write it, short enough for a line."""
    if isinstance(value, dict):
        return "{...}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_show(v) for v in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value if len(value) <= 60 else value[:57] + "...")
    return str(value)


def _broken(rule: str, fix: str) -> PydanticCustomError:
    return PydanticCustomError("rule", "{rule}; {fix}", {"rule": rule, "fix": fix})


# --- Exact numbers ---------------------------------------------------------------------------

_NUMBER_RULE = 'a finite number, or a fraction as text such as "95/105"'


def _rational(value: object) -> Fraction:
    """An exact number from a TOML integer, decimal or fraction text."""
    if isinstance(value, str) and re.fullmatch(r"[+-]?\d{1,40}/\d{1,40}|[+-]?\d*\.?\d+", value):
        with contextlib.suppress(ZeroDivisionError):
            return _representable(Fraction(value))
    if isinstance(value, int | Fraction) and not isinstance(value, bool):
        return _representable(Fraction(value))
    if isinstance(value, Decimal | float) and math.isfinite(value):
        return _representable(Fraction(value))
    raise _broken(_NUMBER_RULE, f"write a number instead of {_show(value)}")


def _representable(value: Fraction) -> Fraction:
    if value and not _BINARY32_MIN <= abs(value) <= _BINARY32_MAX:
        raise _broken(
            "the generated C computes in binary32: 0, or a magnitude from 1.2e-38 to 3.4e38",
            "check the value's unit",
        )
    return value


def _rule(holds: Callable[[Fraction], bool], rule: str, fix: str) -> AfterValidator:
    def check(value: Fraction) -> Fraction:
        if not holds(value):
            raise _broken(rule, fix)
        return value

    return AfterValidator(check)


def _finite_time_or_rational(value: object) -> Fraction | str:
    if value == FINITE_TIME:
        return FINITE_TIME
    if isinstance(value, str) and not re.search(r"\d", value):
        raise _broken(
            f'a number, or "{FINITE_TIME}", which is alpha/(2 - alpha) (35)',
            f'write "{FINITE_TIME}" or a number',
        )
    return _rational(value)


def _beta_range(value: Fraction | str) -> Fraction | str:
    if isinstance(value, Fraction) and not 0 < value < EXPONENT_MAX:
        raise _broken(*_exponent_rule("beta"))
    return value


def _exponent_rule(name: str) -> tuple[str, str]:
    return (
        f"0 < {name} < {EXPONENT_MAX}",
        "1 is linear, the paper's best is 95/100; without restoring force (0) nothing converges",
    )


def _as_list(value: object) -> object:
    return value if isinstance(value, list | tuple) else [value]


_FRACTION = {"type": "string", "pattern": r"^[+-]?[0-9]+/[0-9]+$"}
_NUMBER_SCHEMA: dict[str, Any] = {"anyOf": [{"type": "number"}, _FRACTION]}
_BETA_SCHEMA: dict[str, Any] = {"anyOf": [*_NUMBER_SCHEMA["anyOf"], {"const": FINITE_TIME}]}


def _per_joint_schema(item: dict[str, Any]) -> WithJsonSchema:
    return WithJsonSchema(
        {"anyOf": [*item["anyOf"], {"type": "array", "items": item, "minItems": 1}]}
    )


Rational = Annotated[Fraction, BeforeValidator(_rational), WithJsonSchema(_NUMBER_SCHEMA)]
Positive = Annotated[Rational, _rule(lambda v: v > 0, "greater than 0", "write a positive number")]
NotNegative = Annotated[
    Rational, _rule(lambda v: v >= 0, "0 or greater", "write 0 or a positive number")
]
NotZero = Annotated[
    Rational,
    _rule(lambda v: v != 0, "not 0", "write the ratio; negative where the motor turns backwards"),
]
Alpha = Annotated[Rational, _rule(lambda v: 0 < v < EXPONENT_MAX, *_exponent_rule("alpha"))]
Gamma = Annotated[
    Rational,
    _rule(
        lambda v: 0 <= v < EXPONENT_MAX,
        f"0 <= gamma < {EXPONENT_MAX}",
        "1 is linear, 0 is sliding mode, the paper's best is 0.4",
    ),
]
Beta = Annotated[
    Fraction | str, BeforeValidator(_finite_time_or_rational), AfterValidator(_beta_range)
]

_PerJointNumber = (BeforeValidator(_as_list), _per_joint_schema(_NUMBER_SCHEMA))
PerJointPositive = Annotated[tuple[Positive, ...], *_PerJointNumber]
PerJointNotNegative = Annotated[tuple[NotNegative, ...], *_PerJointNumber]
PerJointNotZero = Annotated[tuple[NotZero, ...], *_PerJointNumber]
PerJointAlpha = Annotated[tuple[Alpha, ...], *_PerJointNumber]
PerJointGamma = Annotated[tuple[Gamma, ...], *_PerJointNumber]
PerJointBeta = Annotated[
    tuple[Beta, ...], BeforeValidator(_as_list), _per_joint_schema(_BETA_SCHEMA)
]


# --- The model -------------------------------------------------------------------------------


class _Table(BaseModel):
    model_config = ConfigDict(
        extra="forbid", frozen=True, arbitrary_types_allowed=True, validate_default=True
    )


class LawTable(_Table):
    """``[law]``: the gains of the inclusive law. A per-joint key takes one number or a list."""

    preset: str | None = Field(
        None, description="A special case of the paper or a row of Table II; sets gains."
    )
    inertia_kgm2: PerJointPositive = Field(
        description="Mbar [kg m^2], diagonal: raise it until the error no longer falls (III-E)."
    )
    kd: PerJointNotNegative = Field(description="KD, damping of the desired error dynamics (17).")
    kp: PerJointNotNegative = Field(description="KP, stiffness of the desired error dynamics (17).")
    lambda_: PerJointNotNegative = Field(
        alias="lambda", description="lambda, correction of the time delay estimation error (31)."
    )
    alpha: PerJointAlpha = Field(description="Exponent of the velocity error, 0 < alpha < 2.")
    beta: PerJointBeta = Field(
        description='Exponent of the position error, 0 < beta < 2, or "finite-time" (35).'
    )
    gamma: PerJointGamma = Field(description="Exponent of the sliding variable, 0 <= gamma < 2.")
    velocity_error: VelocityError = Field(
        "reference-rate",
        description="How ed is formed: reference-rate (the paper's), error-difference or "
        "half-sample.",
    )
    acceleration: AccelerationEstimate = Field(
        "current", description="Which second difference of the position estimates qdd(t-L)."
    )
    low_pass_rad_per_s: Positive | None = Field(
        None, description="Cutoff w of the low-pass (43) [rad/s]; without it there is none."
    )


class EncoderTable(_Table):
    """``[encoder]``: from counts to radians at the joint."""

    counts_per_rev: PerJointPositive = Field(
        description="Counts a motor revolution AFTER quadrature decoding: 4 x pulses (lines)."
    )
    gear_ratio: PerJointNotZero = Field(
        description="Motor revolutions a joint revolution; negative if they turn opposite ways."
    )


class DriveTable(_Table):
    """``[drive]``: what the drive can do."""

    torque_limit_Nm: PerJointPositive = Field(  # noqa: N815 (N m is a unit)
        description="Largest torque at the joint [N m] (motor torque times gear ratio)."
    )
    reports_torque: bool = Field(
        False, description="Whether the drive reports the torque that it applied in the last tick."
    )


class SafetyTable(_Table):
    """``[safety]``: what counts as implausible, and what happens then."""

    max_speed_rad_per_s: PerJointPositive = Field(
        description="Joint speed [rad/s] above which a change of counts is an encoder jump."
    )
    on_error: Literal["hold", "zero"] = Field(
        "hold", description="Torque after an error: the last one held, or zero."
    )


class Specification(_Table):
    """A controller as the user specifies it (see the tables for the keys)."""

    name: Annotated[
        str,
        AfterValidator(
            lambda v: (
                v
                if re.fullmatch(r"[a-z][a-z0-9_]{0,23}", v)
                else _raise(
                    _broken(
                        "a lower-case C identifier of at most 24 characters, as in tdc_NAME_step",
                        'write a name such as "puma3"',
                    )
                )
            )
        ),
        WithJsonSchema({"type": "string", "pattern": "^[a-z][a-z0-9_]{0,23}$"}),
    ] = Field(description="Name of the controller, used in file and function names.")
    description: str = Field("", description="One sentence on the robot, for the C header.")
    robot: str | None = Field(None, description="A robot preset: its own numbers, where not given.")
    joint_names: Annotated[
        tuple[Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9 _-]{0,31}$")], ...],
        Field(min_length=1, max_length=32),
    ] = Field(description="The joints' names in order; their number is the number of joints.")
    sample_time_s: Annotated[
        Positive, _rule(lambda v: v <= 1, "at most 1 s", "write the sample time in seconds")
    ] = Field(description="L, sample time and time delay [s].")
    law: LawTable
    encoder: EncoderTable
    drive: DriveTable
    safety: SafetyTable


def _raise(error: Exception) -> Any:
    raise error


# --- The controller, presets applied, a value a joint ----------------------------------------


@dataclass(frozen=True)
class Joint:
    """The exact numbers of one joint.

    Units: inertia [kg m^2], torque_limit [N m], max_displacement [count a tick]; kd, kp and
    lambda in the units that (17) and (31) give them.
    """

    name: str
    inertia: Fraction
    kd: Fraction
    kp: Fraction
    lambda_: Fraction
    alpha: Fraction
    beta: Fraction
    gamma: Fraction
    torque_limit: Fraction
    counts_per_joint_rev: Fraction
    max_displacement: int

    @property
    def rad_per_count(self) -> float:
        """Joint angle of one count [rad], negative where the motor turns the other way."""
        return 2.0 * math.pi / float(self.counts_per_joint_rev)


@dataclass(frozen=True)
class Controller:
    """A validated specification: presets applied, exact numbers, one value a joint."""

    name: str
    description: str
    sample_time: Fraction
    options: LawOptions
    low_pass_ratio: Fraction | None
    on_error: Literal["hold", "zero"]
    joints: tuple[Joint, ...]

    def canonical(self) -> dict[str, Any]:
        """The controller as plain data with exact numbers as text: what its hash is made of."""

        def plain(value: object) -> Any:
            if isinstance(value, Fraction):
                return str(value)
            if isinstance(value, Joint | LawOptions):
                return {k: plain(v) for k, v in vars(value).items()}
            if isinstance(value, tuple):
                return [plain(v) for v in value]
            return value

        return {key: plain(value) for key, value in vars(self).items()}


def read(path: Path) -> dict[str, Any]:
    """The TOML file as a dictionary with exact decimals.

    Raises:
        SpecificationError: the file can't be read or is no TOML.
    """
    try:
        text = path.read_bytes().decode("utf-8")
    except OSError as error:
        reason = error.strerror or "unreadable"
        raise _file_error(path, f"a readable file ({reason})", "check path and rights") from error
    except UnicodeDecodeError as error:
        raise _file_error(path, "UTF-8 text", f"byte {error.start} isn't UTF-8") from error
    try:
        return tomllib.loads(text, parse_float=Decimal)
    except tomllib.TOMLDecodeError as error:
        raise _file_error(path, "TOML (toml.io)", str(error)) from error
    except (ValueError, ArithmeticError) as error:
        raise _file_error(path, "TOML whose numbers can be read", str(error)) from error


def _file_error(path: Path, rule: str, fix: str) -> SpecificationError:
    return SpecificationError(str(path), [Problem("file", str(path), rule, fix)])


def load(path: Path, *, experiment: str | None = None) -> Controller:
    """The controller that a TOML file specifies.

    Args:
        path: the file.
        experiment: a row of Table II or another law preset, whose gains replace the file's.

    Raises:
        SpecificationError: with everything that is wrong.
    """
    return resolve(read(path), str(path), experiment=experiment)


def resolve(
    raw: Mapping[str, Any], source: str = "specification", *, experiment: str | None = None
) -> Controller:
    """The controller that plain TOML data specifies; arguments and errors as in :func:`load`."""
    data = {**raw}
    if experiment is not None:
        data["law"] = _with_experiment(data.get("law"), experiment, source)
    expanded, preset = _expand(data, source)
    try:
        specification = Specification.model_validate(expanded)
    except ValidationError as error:
        problems = [_problem(detail, expanded) for detail in error.errors()]
        raise SpecificationError(source, problems) from error
    controller, problems = _controller(specification)
    problems += _preset_problems(controller, preset) if not problems else []
    if problems:
        raise SpecificationError(source, problems)
    return controller


def _with_experiment(law: Any, experiment: str, source: str) -> Any:
    """``[law]`` with the gains that the experiment fixes or proposes instead of the file's."""
    preset = _lookup("experiment", experiment, LAW_PRESETS, source)
    if not isinstance(law, dict):
        return law
    gains = {**preset.fixed, **preset.proposed}
    return {**{k: v for k, v in law.items() if k not in gains}, "preset": experiment}


def _lookup(key: str, name: object, known: Mapping[str, Any], source: str) -> Any:
    if isinstance(name, str) and name in known:
        return known[name]
    near = nearest(str(name), known)
    fix = f'did you mean "{near}"?' if near else "write one of them"
    rule = "one of " + ", ".join(known)
    raise SpecificationError(source, [Problem(key, _show(name), rule, fix)])


def _expand(raw: dict[str, Any], source: str) -> tuple[dict[str, Any], LawPreset | None]:
    """The data with the presets' values filled in below the user's own."""
    data = dict(raw)
    if data.get("robot") is not None:
        data = _merge(_lookup("robot", data["robot"], ROBOT_PRESETS, source).tables, data)
    law = data.get("law")
    if not isinstance(law, dict) or law.get("preset") is None:
        return data, None
    preset: LawPreset = _lookup("law.preset", law["preset"], LAW_PRESETS, source)
    own = raw["law"] if isinstance(raw.get("law"), dict) else {}
    clashes = [
        Problem(
            f"law.{key}",
            _show(own[key]),
            f'preset "{preset.name}" {preset.equation} fixes {key} = {value}',
            f'remove {key}, or use preset "enhanced" (or none), which leaves it free',
        )
        for key, value in preset.fixed.items()
        if key in own and not _same(own[key], value)
    ]
    if clashes:
        raise SpecificationError(source, clashes)
    # The special case's own values go before a robot's, the user's before both.
    data["law"] = {**law, **preset.proposed, **own, **preset.fixed}
    return data, preset


def _same(mine: object, fixed: object) -> bool:
    try:
        return all(_rational(v) == _rational(fixed) for v in _as_list(mine))  # type: ignore[attr-defined]
    except PydanticCustomError:
        return mine == fixed


def _merge(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    merged = {**below, **above}
    for key, value in below.items():
        if isinstance(value, dict) and isinstance(above.get(key), dict):
            merged[key] = {**value, **above[key]}
    return merged


def _preset_problems(controller: Controller, preset: LawPreset | None) -> list[Problem]:
    if preset is None:
        return []
    return [
        Problem(
            f"law.{key}",
            str(value),
            f'preset "{preset.name}" {preset.equation} needs {interval.rule(key)}',
            f"change {key}, or choose another preset",
        )
        for key, interval in preset.needs.items()
        for value in dict.fromkeys(
            getattr(joint, "lambda_" if key == "lambda" else key) for joint in controller.joints
        )
        if value not in interval
    ]


def _controller(specification: Specification) -> tuple[Controller, list[Problem]]:
    """One value a joint for every per-joint key, and what stands against it."""
    names = specification.joint_names
    problems: list[Problem] = []

    def per_joint(table: str, key: str, values: tuple[Any, ...]) -> tuple[Any, ...]:
        if len(values) in (1, len(names)):
            return values * (len(names) // len(values))
        problems.append(
            Problem(
                f"{table}.{key}",
                _show([str(v) for v in values]).replace('"', ""),
                f"one number, or one for each of the {len(names)} joints; here are {len(values)}",
                f"give {len(names)} values in the order of joint_names, or a single one",
            )
        )
        return (values[0],) * len(names) if values else (None,) * len(names)

    if len(set(names)) < len(names):
        problems.append(
            Problem("joint_names", _show(names), "every name once", "rename the double one")
        )
    law, encoder, drive, safety = (
        specification.law,
        specification.encoder,
        specification.drive,
        specification.safety,
    )
    columns = {
        "inertia": per_joint("law", "inertia_kgm2", law.inertia_kgm2),
        "kd": per_joint("law", "kd", law.kd),
        "kp": per_joint("law", "kp", law.kp),
        "lambda_": per_joint("law", "lambda", law.lambda_),
        "alpha": per_joint("law", "alpha", law.alpha),
        "beta": per_joint("law", "beta", law.beta),
        "gamma": per_joint("law", "gamma", law.gamma),
        "counts": per_joint("encoder", "counts_per_rev", encoder.counts_per_rev),
        "gear": per_joint("encoder", "gear_ratio", encoder.gear_ratio),
        "torque_limit": per_joint("drive", "torque_limit_Nm", drive.torque_limit_Nm),
        "speed": per_joint("safety", "max_speed_rad_per_s", safety.max_speed_rad_per_s),
    }
    placeholder = Controller(
        specification.name,
        specification.description,
        specification.sample_time_s,
        LawOptions(
            law.velocity_error,
            law.acceleration,
            law.low_pass_rad_per_s is not None,
            drive.reports_torque,
        ),
        _low_pass_ratio(law.low_pass_rad_per_s, specification.sample_time_s),
        safety.on_error,
        (),
    )
    if problems:
        return placeholder, problems
    rows = [
        dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)
    ]
    joints = [
        _joint(name, row, specification.sample_time_s, problems)
        for name, row in zip(names, rows, strict=True)
    ]
    return replace(placeholder, joints=tuple(joints)), problems


def _low_pass_ratio(cutoff: Fraction | None, sample_time: Fraction) -> Fraction | None:
    """w'/(1 + w') with w' = w L (43)."""
    return None if cutoff is None else cutoff * sample_time / (1 + cutoff * sample_time)


def _joint(name: str, row: dict[str, Any], sample_time: Fraction, problems: list[Problem]) -> Joint:
    beta = row["beta"]
    if beta == FINITE_TIME:
        if row["alpha"] >= 1:
            problems.append(
                Problem(
                    "law.beta",
                    f'"{FINITE_TIME}" (joint {name}, alpha = {row["alpha"]})',
                    "beta = alpha/(2 - alpha) converges in finite time for 0 < alpha < 1 (34)(35)",
                    "lower alpha below 1, or write beta as a number",
                )
            )
            beta = Fraction(1)
        else:
            beta = row["alpha"] / (2 - row["alpha"])
    counts_per_joint_rev = row["counts"] * row["gear"]
    counts_a_tick = row["speed"] * sample_time * abs(counts_per_joint_rev) / Fraction(2 * math.pi)
    max_displacement = math.ceil(counts_a_tick)
    if max_displacement > _MAX_DISPLACEMENT:
        problems.append(
            Problem(
                "safety.max_speed_rad_per_s",
                str(row["speed"]),
                f"at most 2^30 counts a tick, so that counts may wrap; here {max_displacement}",
                "check counts_per_rev, gear_ratio and the unit of the speed",
            )
        )
    return Joint(
        name,
        row["inertia"],
        row["kd"],
        row["kp"],
        row["lambda_"],
        row["alpha"],
        beta,
        row["gamma"],
        row["torque_limit"],
        counts_per_joint_rev,
        max_displacement,
    )


# --- pydantic's findings in the user's words -------------------------------------------------


def _problem(detail: ErrorDetails, data: Mapping[str, Any]) -> Problem:
    """One pydantic finding as key, value, rule and fix."""
    location = [part for part in detail["loc"] if part not in ("constrained-str",)]
    key = _key(location, data)
    kind, context = detail["type"], detail.get("ctx", {})
    if kind == "rule":
        return Problem(key, _show(detail["input"]), str(context["rule"]), str(context["fix"]))
    if kind == "extra_forbidden":
        known = _known_keys(location[:-1])
        near = nearest(str(location[-1]), known)
        fix = f'did you mean "{near}"?' if near else "remove it"
        return Problem(key, _show(detail["input"]), "a known key: " + ", ".join(known), fix)
    if kind == "missing":
        meaning = _description(location)
        return Problem(key, "(missing)", "this key is needed", f"add it: {meaning}")
    rule = detail["msg"].replace("Input should be ", "").replace("'", '"')
    return Problem(key, _show(detail["input"]), rule, _description(location) or "correct it")


def _key(location: Sequence[int | str], data: Mapping[str, Any]) -> str:
    """The dotted key; an index only where the user wrote a list."""
    key, here = "", data
    for part in location:
        if isinstance(part, int):
            key += f"[{part}]" if isinstance(here, list | tuple) else ""
            here = here[part] if isinstance(here, list | tuple) and part < len(here) else here
        else:
            key += f".{part}" if key else part
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


def binary32(value: Fraction | float) -> float:
    """The nearest binary32 number (round to even), as a Python float.

    Raises:
        OverflowError: the value lies beyond binary32.
    """
    return float(struct.unpack("<f", struct.pack("<f", float(value)))[0])
