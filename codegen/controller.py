"""The controller that a specification describes: presets applied, one value a joint, exact.

``load(path)`` reads a TOML file and returns a :class:`Controller`, in which every number is a
:class:`fractions.Fraction`; the generator and everything downstream work from it.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

from pydantic_core import PydanticCustomError

from codegen.arithmetic import Arithmetic
from codegen.exact import COUNT_NOISE, DISPLACEMENT_MAX, FINITE_TIME, as_list, rational
from codegen.law import LawOptions
from codegen.presets import LAW_PRESETS, ROBOT_PRESETS, LawPreset
from codegen.problems import Problem, SpecificationError, nearest, show
from codegen.specification import Specification, validate


@dataclass(frozen=True)
class Joint:
    """The exact numbers of one joint.

    Units: inertia [kg m^2], torque_limit [N m], max_displacement [count a tick],
    max_acceleration [rad/s^2] or None for what follows from Mbar; kd, kp and lambda in the units
    that (17) and (31) give them.
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
    max_acceleration: Fraction | None

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
    arithmetic: Arithmetic
    options: LawOptions
    low_pass_ratio: Fraction | None
    on_error: Literal["hold", "zero"]
    max_lost_ticks: int
    anti_windup: bool
    joints: tuple[Joint, ...]

    def max_displacement_change(self, joint: Joint) -> int:
        """Change of a joint's displacement from tick to tick that is still plausible [count].

        By default that of the acceleration which the torque limit gives Mbar: tuned gains keep well
        below it, and a tick that is missed in fast motion doesn't. Two counts of noise in each
        reading come to eight.
        """
        acceleration = joint.max_acceleration or joint.torque_limit / joint.inertia
        counts_per_rad = abs(joint.counts_per_joint_rev) / Fraction(2 * math.pi)
        counts = math.ceil(acceleration * self.sample_time**2 * counts_per_rad) + COUNT_NOISE
        return min(counts, DISPLACEMENT_MAX)

    def canonical(self) -> dict[str, Any]:
        """The controller as plain data with exact numbers as text: what its hash is made of."""

        def plain(value: object) -> Any:
            if isinstance(value, Fraction):
                return str(value)
            if isinstance(value, Joint | LawOptions | Arithmetic):
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
    except RecursionError as error:
        rule = "TOML of a few tables and lists"
        raise _file_error(path, rule, "take out what is nested so deeply") from error


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
    controller, problems = _controller(validate(expanded, source))
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
    raise SpecificationError(source, [Problem(key, show(name), rule, fix)])


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
            show(own[key]),
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
        return all(rational(v) == rational(fixed) for v in as_list(mine))  # type: ignore[attr-defined]
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
                show([str(v) for v in values]).replace('"', ""),
                f"one number, or one for each of the {len(names)} joints; here are {len(values)}",
                f"give {len(names)} values in the order of joint_names, or a single one",
            )
        )
        return (values[0],) * len(names) if values else (None,) * len(names)

    if len(set(names)) < len(names):
        problems.append(
            Problem("joint_names", show(names), "every name once", "rename the double one")
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
        "acceleration": per_joint(
            "safety", "max_acceleration_rad_per_s2", safety.max_acceleration_rad_per_s2 or (None,)
        ),
    }
    placeholder = Controller(
        specification.name,
        specification.description,
        specification.sample_time_s,
        _arithmetic(specification, problems),
        LawOptions(
            law.velocity_error,
            law.acceleration,
            law.low_pass_rad_per_s is not None,
            drive.reports_torque,
        ),
        _low_pass_ratio(law.low_pass_rad_per_s, specification.sample_time_s),
        safety.on_error,
        safety.max_lost_ticks,
        safety.anti_windup,
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


def _arithmetic(specification: Specification, problems: list[Problem]) -> Arithmetic:
    """What the C computes with, and which choices don't go together."""
    asked = Arithmetic(specification.arithmetic, specification.precision, specification.accuracy)
    clashes = {
        "precision": asked.kind == "fixed-point" and asked.precision != "float32",
        "accuracy": asked.accuracy != "standard"
        and (asked.kind == "fixed-point" or asked.precision == "float64"),
    }
    reasons = {
        "precision": "fixed-point C has no floating-point numbers",
        "accuracy": "there is a choice for floating-point C in float32 only",
    }
    problems += [
        Problem(
            key,
            show(getattr(asked, key)),
            reasons[key],
            f"remove {key}, or choose another arithmetic or precision",
        )
        for key, clash in clashes.items()
        if clash
    ]
    return asked


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
    if max_displacement > DISPLACEMENT_MAX:
        problems.append(
            Problem(
                "safety.max_speed_rad_per_s",
                str(row["speed"]),
                f"less than 2^30 counts a tick, so that counts may wrap; here {max_displacement}",
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
        row["acceleration"],
    )
