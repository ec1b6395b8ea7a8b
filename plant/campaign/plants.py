"""Random plants: what is drawn, and the plant and the motion that follow from it.

Plant k of a campaign depends on the specification and on k alone: its numbers come from a
``numpy.random.SeedSequence`` of its own, whose spawn key is (k,); those of a seed s of plant k
from one with the key (k, s). Which worker draws it, and when, changes no bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from plant.assembly import Floats, Plant
from plant.campaign.specification import PlantsTable
from plant.flexibility import Flexibility
from plant.friction import (
    CoulombStribeck,
    CoulombStribeckJoint,
    FrictionModel,
    LuGre,
    LuGreJoint,
    StribeckCurve,
)
from plant.robot import FrictionName
from plant.trajectory import RestToRest


@dataclass(frozen=True, eq=False)
class Draw:
    """What is random in a plant with n joints.

    Attributes:
        friction_model: its name.
        friction_factor: times the nominal friction, shape (n,).
        inertia_factor: times the links' nominal mass and inertia, shape (n,).
        torque_delay: as a fraction of the sample time; None: the nominal one.
        amplitude_deg: see :func:`scaled`; None: the nominal motion.
        stiffness_factor: times the springs' nominal stiffness; None: the nominal one, if any.
    """

    friction_model: FrictionName
    friction_factor: Floats
    inertia_factor: Floats
    torque_delay: float | None
    amplitude_deg: float | None
    stiffness_factor: float | None


def draw(
    table: PlantsTable, friction_models: tuple[FrictionName, ...], joints: int, plant: int
) -> Draw:
    """The random numbers of a plant.

    Args:
        table: between which ends.
        friction_models: to choose from.
        joints: n.
        plant: its index, from 0.
    """
    rng = _generator(table.root_seed, plant)
    # Everything is drawn, used or not: a range that is added changes no other number.
    choice, delay, amplitude = rng.random(), rng.random(), rng.random()
    friction, inertia = rng.random(joints), rng.random(joints)
    stiffness = rng.random()
    return Draw(
        friction_model=friction_models[int(choice * len(friction_models))],
        friction_factor=_between(table.friction_factor, friction),
        inertia_factor=_between(table.inertia_factor, inertia),
        torque_delay=table.torque_delay and float(_between(table.torque_delay, delay)),
        amplitude_deg=table.amplitude_deg and float(_between(table.amplitude_deg, amplitude)),
        stiffness_factor=table.stiffness_factor
        and _between_logarithms(table.stiffness_factor, stiffness),
    )


def encoder_phase(table: PlantsTable, joints: int, plant: int, seed: int) -> Floats | None:
    """Where between two edges the encoders stand [count], shape (n,); None: the nominal phase."""
    if table.encoder_phase is None:
        return None
    rng = _generator(table.root_seed, plant, seed)
    return _between(table.encoder_phase, rng.random(joints))


def _generator(root_seed: int, *key: int) -> np.random.Generator:
    # Named, because numpy may change its default.
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(root_seed, spawn_key=key)))


def _between(ends: tuple[float, float], fraction: Floats | float) -> Floats:
    low, high = ends
    return np.asarray(low + (high - low) * fraction, dtype=np.float64)


def _between_logarithms(ends: tuple[float, float], fraction: float) -> float:
    low, high = ends
    return low * math.pow(high / low, fraction)


def with_draw(nominal: Plant, drawn: Draw) -> Plant:
    """The plant of a draw, made from the nominal plant with the same friction model."""
    delay = nominal.drive.delay if drawn.torque_delay is None else drawn.torque_delay
    return replace(
        nominal,
        model=with_inertia(nominal.model, drawn.inertia_factor),
        friction=with_friction(nominal.friction, drawn.friction_factor),
        drive=replace(nominal.drive, delay=delay),
        flexibility=with_stiffness(nominal.flexibility, drawn.stiffness_factor),
    )


def with_phase(plant: Plant, phase: Floats | None) -> Plant:
    """The plant with other phases [count] of its encoders, shape (n,); None: as it is."""
    if phase is None:
        return plant
    return replace(plant, encoder=replace(plant.encoder, phase=phase))


def with_inertia(model: pin.Model, factor: Floats) -> pin.Model:
    """The model with other masses; centres of mass, armature and placements stay.

    Args:
        model: left as it is.
        factor: times mass and inertia of the body that each joint moves, shape (n,), > 0.
    """
    scaled_model = pin.Model(model)
    for joint, times in enumerate(factor.tolist(), start=1):
        body = model.inertias[joint]
        scaled_model.inertias[joint] = pin.Inertia(
            times * body.mass, body.lever, times * body.inertia
        )
    return scaled_model


def with_stiffness(springs: Flexibility | None, factor: float | None) -> Flexibility | None:
    """Springs that are so many times as stiff; the damping ratio of each stays.

    Args:
        springs: None where joints are rigid, and stay so.
        factor: > 0; None: as they are.
    """
    if springs is None or factor is None:
        return springs
    # The ratio is D / (2 sqrt(K J)).
    return Flexibility(
        factor * springs.stiffness_Nm_per_rad, math.sqrt(factor) * springs.damping_Nms_per_rad
    )


def with_friction(friction: FrictionModel, factor: Floats) -> FrictionModel:
    """Friction that is so many times as large at any motion; presliding distances stay.

    Args:
        friction: of n joints.
        factor: shape (n,), > 0.
    """
    times = factor.tolist()
    if isinstance(friction, LuGre):
        return LuGre(tuple(map(_lugre, friction.parameters, times)))
    if isinstance(friction, CoulombStribeck):
        return CoulombStribeck(tuple(map(_coulomb_stribeck, friction.parameters, times)))
    raise TypeError(f"no way to scale a {type(friction).__name__}")


def _lugre(joint: LuGreJoint, times: float) -> LuGreJoint:
    return LuGreJoint(
        _curve(joint.curve, times),
        times * joint.stiffness_Nm_per_rad,
        times * joint.bristle_damping_Nms_per_rad,
        times * joint.viscous_Nms_per_rad,
    )


def _coulomb_stribeck(joint: CoulombStribeckJoint, times: float) -> CoulombStribeckJoint:
    viscous = times * joint.viscous_Nms_per_rad
    return replace(joint, curve=_curve(joint.curve, times), viscous_Nms_per_rad=viscous)


def _curve(curve: StribeckCurve, times: float) -> StribeckCurve:
    return replace(
        curve,
        coulomb_positive_Nm=times * curve.coulomb_positive_Nm,
        coulomb_negative_Nm=times * curve.coulomb_negative_Nm,
    )


def amplitude_deg(motion: RestToRest) -> float:
    """How far the joint that moves most gets from the first posture [deg]."""
    return float(np.rad2deg(np.abs(motion.postures_rad - motion.start_rad).max()))


def scaled(motion: RestToRest, to_deg: float) -> RestToRest:
    """The motion with another :func:`amplitude_deg` > 0, all its strokes in proportion."""
    strokes = motion.postures_rad - motion.start_rad
    factor = to_deg / amplitude_deg(motion)
    return replace(motion, postures_rad=motion.start_rad + factor * strokes)
