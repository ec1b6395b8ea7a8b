"""A campaign as the user specifies it: which C, on which robot, with which gains and plants."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    FiniteFloat,
    ValidationError,
)
from pydantic_core import ErrorDetails

from codegen.presets import LAW_PRESETS
from codegen.problems import Problem, SpecificationError, broken, nearest, show
from plant.flight import Backend
from plant.robot import FrictionName

AS_SPECIFIED = "as-specified"
"""The gain set of the controller's own file, among the names of experiments."""


def _ends(value: object) -> tuple[float, float]:
    """Both ends of a range; one number is a range without width."""
    ends = list(value) if isinstance(value, list | tuple) else [value, value]
    numbers = [float(x) for x in ends if isinstance(x, int | float) and not isinstance(x, bool)]
    if len(ends) != 2 or len(numbers) != 2 or not all(map(math.isfinite, numbers)):
        raise broken("a finite number, or two of them in a list", "write such as [0.5, 0.75]")
    low, high = numbers
    if low > high:
        raise broken("the lower end first", f"write [{high:g}, {low:g}]")
    return low, high


def _positive_ends(value: object) -> tuple[float, float]:
    low, high = _ends(value)
    if low <= 0.0:
        raise broken("greater than 0", "write a lower end such as 0.5")
    return low, high


def _fraction_ends(value: object) -> tuple[float, float]:
    low, high = _ends(value)
    if low < 0.0 or high > 1.0:
        raise broken("within 0 and 1", "write fractions such as [0, 0.5]")
    return low, high


def _known(experiment: str) -> str:
    known = (AS_SPECIFIED, *LAW_PRESETS)
    if experiment in known:
        return experiment
    near = nearest(experiment, known)
    raise broken(
        "one of " + ", ".join(known), f'did you mean "{near}"?' if near else "write one of them"
    )


def _names(value: object) -> object:
    if not isinstance(value, list | tuple) or not value:
        raise broken("a list of at least one name", 'write such as ["NAME"]')
    return value


def _without_repetition(names: tuple[str, ...]) -> tuple[str, ...]:
    again = sorted({name for name in names if names.count(name) > 1})
    if again:
        raise broken("each name once", "remove the second " + ", ".join(again))
    return names


# Strict: "2" is a mistake, not 2.
_Positive = Annotated[FiniteFloat, Field(strict=True, gt=0)]
_Count = Annotated[int, Field(strict=True, gt=0, lt=2**31)]
_PositiveRange = Annotated[tuple[float, float], BeforeValidator(_positive_ends)]
_FractionRange = Annotated[tuple[float, float], BeforeValidator(_fraction_ends)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)


class PlantsTable(_Table):
    """``[plants]``: how many, and between which ends each number is drawn uniformly."""

    count: _Count = Field(description="how many plants are drawn")
    root_seed: Annotated[int, Field(strict=True, ge=0)] = Field(
        0, description="the number that all plants follow from"
    )
    seeds: _Count = Field(
        1, description="how often each plant is flown, each time with another encoder phase"
    )
    friction_models: (
        Annotated[
            tuple[FrictionName, ...],
            BeforeValidator(_names),
            AfterValidator(_without_repetition),
        ]
        | None
    ) = Field(None, description="the robot file's friction model if not given")
    friction_factor: _PositiveRange = Field(
        (1.0, 1.0), description="times the friction of the robot file, drawn for each joint"
    )
    inertia_factor: _PositiveRange = Field(
        (1.0, 1.0), description="times mass and inertia of the links, drawn for each joint"
    )
    torque_delay: _FractionRange | None = Field(
        None, description="until a command acts, as a fraction of L; the robot file's if not given"
    )
    amplitude_deg: _PositiveRange | None = Field(
        None, description="largest distance from the first posture; the robot file's if not given"
    )
    stiffness_factor: _PositiveRange | None = Field(
        None,
        description="times the springs' stiffness, one for all joints, its logarithm uniform; the "
        "robot file's if not given",
    )
    encoder_phase: _FractionRange | None = Field(
        None, description="fraction of a count, for each joint; the robot file's if not given"
    )


class CampaignSpecification(_Table):
    """A campaign: each plant is flown with each gain set and each seed."""

    controller: str = Field(
        min_length=1, description="the controller's file, seen from this file's folder"
    )
    robot: str | None = Field(
        None, description="a robot's name or file; by the number of joints if not given"
    )
    experiments: Annotated[
        tuple[Annotated[str, AfterValidator(_known)], ...],
        BeforeValidator(_names),
        AfterValidator(_without_repetition),
    ] = Field(
        (AS_SPECIFIED,), description="gain sets: rows of Table II, special cases or as-specified"
    )
    speed: _Positive = Field(1.0, description="how many times as fast the motion is")
    substep_s: Annotated[_Positive, Field(le=1e-2)] | None = Field(
        None, description="longest step of the integrator [s]; the plant's own if not given"
    )
    backend: Backend = Field("compiled", description="compiled, or pinocchio for the reference")
    plants: PlantsTable = Field(description="the random plants, [plants]")


def read(path: Path) -> CampaignSpecification:
    """Reads and validates a campaign's file.

    Raises:
        SpecificationError: there is no such file, it is no TOML, or it breaks rules; all of them
            are told.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        problem = Problem("the file", str(path), "it can be read", f"{error.strerror}: check it")
        raise SpecificationError(str(path), [problem]) from error
    except (ValueError, RecursionError) as error:
        # Also bytes that aren't UTF-8, numbers of too many digits, and nests that are too deep.
        problem = Problem("the file", str(path), "valid TOML", str(error))
        raise SpecificationError(str(path), [problem]) from error
    return validate(data, str(path))


def validate(data: Mapping[str, Any], source: str) -> CampaignSpecification:
    """The model of plain data.

    Raises:
        SpecificationError: with everything that breaks a rule.
    """
    try:
        return CampaignSpecification.model_validate(data)
    except ValidationError as error:
        raise SpecificationError(source, [_problem(detail) for detail in error.errors()]) from error


def _problem(detail: ErrorDetails) -> Problem:
    """One of pydantic's findings as key, value, rule and fix."""
    location, value = detail["loc"], show(detail["input"])
    key = _key(location)
    if detail["type"] == "rule":
        return Problem(key, value, str(detail["ctx"]["rule"]), str(detail["ctx"]["fix"]))
    inside = location[0] == "plants" and len(location) > 1
    table: type[_Table] = PlantsTable if inside else CampaignSpecification
    name = str(location[1 if inside else 0])
    if detail["type"] == "extra_forbidden":
        near = nearest(name, table.model_fields)
        fix = f'did you mean "{near}"?' if near else "remove it"
        return Problem(key, value, "a known key: " + ", ".join(table.model_fields), fix)
    meaning = str(table.model_fields[name].description)
    if detail["type"] == "missing":
        return Problem(key, "(missing)", "this key is needed", f"add it: {meaning}")
    if detail["type"] == "model_type":
        return Problem(key, value, "a table", f"write [{key}], and its keys below")
    rule = detail["msg"].replace("Input should be ", "").replace("'", '"')
    return Problem(key, value, rule, meaning)


def _key(location: Iterable[int | str]) -> str:
    """The dotted key."""
    key = ""
    for part in location:
        key += f"[{part}]" if isinstance(part, int) else f".{part}" if key else part
    return key
