"""A controller to start from: ``python -m plant propose ROBOT`` writes it as a specification.

It is where the paper's tuning procedure III-E begins: linear error dynamics without correction
(lambda = 0), which leaves Mbar to be raised first.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import tomllib
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from rich.console import Console

from codegen.controller import resolve
from plant.model import build_model
from plant.robot import Robot, load_robot
from plant.trajectory import RestToRest

Floats = NDArray[np.float64]

SAMPLE_TIME_S = "0.001"
LARGEST_EIGENVALUE = 0.5
"""Of M^-1 Mbar along the trajectory."""

_POSTURES_S = 0.05
# As on the paper's robot: ten times the fastest motion is an encoder jump.
_SPEED_MARGIN = 10


class ProposalError(ValueError):
    """A specification that can't be proposed or written; the message says why and what to do."""


def proposal(robot: Robot) -> str:
    """The starting specification of a robot, as TOML.

    Raises:
        ProposalError: the robot's file lacks a part.
        SpecificationError: the robot has numbers that no controller takes.
    """
    if robot.encoder is None or robot.drive is None or robot.trajectory is None:
        missing = [p for p in ("encoder", "drive", "trajectory") if getattr(robot, p) is None]
        raise ProposalError(f"robot {robot.name} has no {', '.join(missing)}: add it to its file")
    counts, gear_ratio = _counts(robot.encoder.counts_per_rad, robot.gear_ratio)
    reference = robot.trajectory.sampled(float(SAMPLE_TIME_S))
    fastest = float(np.abs(reference.velocity_rad_per_s).max())
    text = f"""\
# Where to start on {robot.name}: linear error dynamics without correction.
# Tune in this order (III-E): raise inertia_kgm2, raise lambda, lower gamma, lower alpha.
name = {json.dumps(_name(robot.name))}
description = {json.dumps(robot.description, ensure_ascii=False)}
joint_names = {json.dumps(_joint_names(robot.joint_names))}
sample_time_s = {SAMPLE_TIME_S}

[law]
# No eigenvalue of M^-1 Mbar is above {LARGEST_EIGENVALUE} along the robot's trajectory; the \
stability condition (33)
# allows 2.
inertia_kgm2 = {_column(starting_inertia(robot, robot.trajectory))}
kd = 20
kp = 100
lambda = 0
alpha = 1
beta = 1
gamma = 1

[encoder]
counts_per_rev = {_column(counts)}
gear_ratio = {_column(gear_ratio)}

[drive]
torque_limit_Nm = {_column(robot.drive.torque_limit_Nm)}

[safety]
max_speed_rad_per_s = {math.ceil(10 * _SPEED_MARGIN * fastest) / 10:g} \
# {_SPEED_MARGIN} times the trajectory's fastest motion
on_error = "hold"
"""
    resolve(data_of(text), f"the proposal for {robot.name}")
    return text


def data_of(text: str) -> dict[str, Any]:
    """A specification's TOML as plain data with exact decimals."""
    return tomllib.loads(text, parse_float=Decimal)


def starting_inertia(robot: Robot, trajectory: RestToRest) -> Floats:
    """Mbar to start from [kg m^2], shape (n,).

    Time delay control is known to be stable where ||I - M^-1 Mbar|| < 1, (33) of Jin et al. 2017. M
    and Mbar being symmetric and positive definite, the eigenvalues of M^-1 Mbar are real, and the
    condition keeps them between 0 and 2. The rule:

    1. Mbar is in proportion to the smallest effective inertia of each joint along the trajectory,
       1 / (M^-1)_ii: what its motor feels while all other joints are free.
    2. The factor makes 1/2 of the largest eigenvalue of M^-1 Mbar along the trajectory, a quarter
       of the limit. The rest is for what the model doesn't know: payload, friction, elasticity.

    Args:
        robot: its links and motors.
        trajectory: of its moving joints.
    """
    model = build_model(robot)
    data = model.createData()
    times = np.arange(0.0, trajectory.duration_s + _POSTURES_S, _POSTURES_S)
    inverses = [np.linalg.inv(pin.crba(model, data, q)) for q in trajectory.at(times).position_rad]
    effective = np.min([1.0 / np.diag(inverse) for inverse in inverses], axis=0)
    # As symmetric matrices with the same eigenvalues: Mbar^1/2 M^-1 Mbar^1/2.
    root = np.sqrt(effective)
    largest = max(np.linalg.eigvalsh(root[:, np.newaxis] * x * root)[-1] for x in inverses)
    return _rounded_down(effective * LARGEST_EIGENVALUE / largest)


def _rounded_down(values: Floats) -> Floats:
    """To three digits, so that a person can read them."""
    digit = 10.0 ** (np.floor(np.log10(values)) - 2)
    rounded: Floats = np.floor(values / digit) * digit
    return rounded


def _counts(counts_per_rad: Floats, gear_ratio: Floats) -> tuple[Floats, Floats]:
    """Counts a revolution of the encoder's shaft, and revolutions of it a joint revolution."""
    counts = 2.0 * math.pi * counts_per_rad / gear_ratio
    whole = np.rint(counts)
    if np.all(whole > 0) and np.allclose(counts, whole, rtol=1e-12, atol=0):
        return whole, gear_ratio
    # An encoder that isn't on the motor.
    return np.abs(2.0 * math.pi * counts_per_rad), np.sign(counts_per_rad)


def _column(values: Floats) -> str:
    """A per-joint key's value in TOML; one number if all are the same."""
    written = [f"{value:.12g}" for value in values.tolist()]
    return written[0] if len(set(written)) == 1 else f"[{', '.join(written)}]"


def _name(robot: str) -> str:
    """A robot's name as one of a controller."""
    name = re.sub(r"[^a-z0-9_]", "_", robot.lower())[:24]
    return name if re.match("[a-z]", name) else f"robot_{name}"[:24]


def _joint_names(names: Sequence[str]) -> list[str]:
    """The joints' names where a controller takes them, else numbers."""
    fit = all(re.fullmatch(r"[A-Za-z][A-Za-z0-9 _-]{0,31}", name) for name in names)
    return [*names] if fit else [f"joint {i}" for i in range(1, len(names) + 1)]


def _propose(arguments: argparse.Namespace, console: Console) -> int:
    text = proposal(load_robot(arguments.robot, urdf=arguments.urdf))
    output: Path | None = arguments.output
    if output is None:
        print(text, end="")
        return 0
    try:
        with output.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise ProposalError(f"{output} is there already: remove it or name another") from error
    except OSError as error:
        raise ProposalError(f"{output} can't be written: {error.strerror}") from error
    command = f"python -m plant simulate {output} --robot {arguments.robot}"
    if arguments.urdf is not None:
        command += f" --urdf {arguments.urdf}"
    console.print(f"{output} written; fly it: {command}", soft_wrap=True)
    return 0


def add_propose(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the command."""
    parser = commands.add_parser(
        "propose",
        help="write a controller to start from, for a robot",
        description="Writes the specification with which the tuning of a robot's controller "
        "begins: gears, counts and torque limits of the robot, linear error dynamics without "
        "correction, and an Mbar that is small enough for the robot's inertia along its own "
        "trajectory. No file is overwritten.",
        epilog="example: python -m plant propose ur5 --output ur5_controller.toml",
    )
    parser.add_argument("robot", help="a robot's name or file")
    parser.add_argument("--urdf", type=Path, help="another URDF than that of the robot's file")
    parser.add_argument("--output", type=Path, help="the file to write; printed if not given")
    parser.set_defaults(run=_propose)
