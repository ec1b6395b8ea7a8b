"""The plants on which all are tried: one to tune on, others that no one was tuned on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from codegen.controller import Controller, read, resolve
from plant.assembly import Plant, build_plant
from plant.closed_loop import Beginning, beginning
from plant.propose import data_of, proposal
from plant.robot import Robot, load_robot
from plant.scenario import EncoderNoiseEvent, Event, PayloadEvent, Scenario
from verification.experiments import CONTROLLERS

CONTROLLER = "puma3_float64"
"""Whose header and law all fly with: in double, so that no one's rounding is in the way."""


@dataclass(frozen=True)
class Trial:
    """A plant, a motion and what happens.

    Attributes:
        name: one or two words.
        meaning: what is other than on the plant that all are tuned on.
        robot: file of the robot; its wrist is locked.
        speed: factor on the robot's trajectory.
        delay: until a command acts, as a fraction of the sample time.
        events: of a scenario.
    """

    name: str
    meaning: str
    robot: str = "reference"
    speed: float = 1.0
    delay: float = 0.0
    events: tuple[Event, ...] = ()


TUNED_ON = Trial("tuned on", "the plant that all are tuned on")
HELD_OUT = (
    Trial("+50 %", "1.5 times as fast", speed=1.5),
    Trial(
        "1 kg",
        "a payload of 1 kg from 4 to 8 s; with 2.5 kg the reference plant's drives are too weak",
        events=(PayloadEvent(kind="payload", at_s=4.0, duration_s=4.0, mass_kg=1.0),),
    ),
    Trial(
        "noise",
        "encoder edges that jitter by 0.5 count (standard deviation)",
        events=(EncoderNoiseEvent(kind="encoder-noise", sigma_counts=0.5),),
    ),
    Trial("0.3 L", "torques that act 0.3 of a sample late", delay=0.3),
    Trial("flexible", "flexible joints, as in reference_flexible", robot="reference_flexible"),
    Trial("PUMA 560", "another robot: PUMA 560 with its published friction", robot="puma560"),
)


@dataclass(frozen=True, eq=False)
class Ground:
    """A trial, ready to fly.

    Attributes:
        trial: which.
        plant: with its encoders at the first phase.
        specification: the shipped controller's with the robot's encoders and drives.
        begins: the plant and how a run of it begins, for each encoder phase.
    """

    trial: Trial
    plant: Plant
    specification: Controller
    begins: tuple[tuple[Plant, Beginning], ...]


def ground(trial: Trial, phases: int = 1, seconds: float | None = None) -> Ground:
    """The plants of a trial, with the encoders at phases spread over a count.

    Args:
        trial: which.
        phases: how many.
        seconds: only so much of the motion.
    """
    robot = load_robot(trial.robot, lock_wrist=True)
    plant, trajectory = build_plant(robot), robot.trajectory
    plant = replace(plant, drive=replace(plant.drive, delay=trial.delay))
    assert trajectory is not None, "every robot of a trial has one"
    specification = _specification(robot)
    sample_time_s = float(specification.sample_time)
    events = Scenario(events=list(trial.events)).script
    begins = []
    for k in range(phases):
        phase = np.full(plant.joints, k / phases)
        turned = replace(plant, encoder=replace(plant.encoder, phase=phase))
        begin = beginning(turned, trajectory.faster(trial.speed), sample_time_s, events)
        if seconds is not None:
            begin = begin.part(0, round(seconds / sample_time_s), begin.state)
        begins.append((turned, begin))
    return Ground(trial, begins[0][0], specification, tuple(begins))


def _specification(robot: Robot) -> Controller:
    """The shipped law told of another robot's encoders and drives, as its user would."""
    own = data_of(proposal(robot))
    shipped = read(CONTROLLERS / f"{CONTROLLER}.toml")
    return resolve({**shipped, **{table: own[table] for table in ("encoder", "drive")}})


def tuned(specification: Controller, gains: Sequence[dict[str, float]]) -> Controller:
    """A specification with other gains, one dictionary a joint; keys are those of ``[law]``."""
    # Python and the specification spell two of them differently.
    joints = []
    for joint, own in zip(specification.joints, gains, strict=True):
        # Python has a keyword where the law has a gain.
        fields: dict[str, Any] = {
            "lambda_" if key == "lambda" else key: Fraction(value) for key, value in own.items()
        }
        joints.append(replace(joint, **fields))
    return replace(specification, joints=tuple(joints))
