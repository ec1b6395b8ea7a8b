"""What a model-based rival takes for the robot: its rigid bodies and friction, each number off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from plant.assembly import Plant
from plant.compiled.rigid_body import SX, Joint, Mass, joints, mass_numbers

Floats = NDArray[np.float64]

SIGN_WIDTH_RAD_PER_S = 0.01
"""Coulomb friction of the model changes its sign over this reference velocity, by a tanh."""

# Mass, first moment and inertia of a body: what is off together among its ten numbers.
_GROUPS = (0, 1, 1, 1, 2, 2, 2, 2, 2, 2)


@dataclass(frozen=True, eq=False)
class Friction:
    """Coulomb and viscous friction; shape (n,).

    Attributes:
        positive_Nm: level in positive motion.
        negative_Nm: level in negative motion, > 0.
        viscous_Nms_per_rad: per velocity.
    """

    positive_Nm: Floats
    negative_Nm: Floats
    viscous_Nms_per_rad: Floats


@dataclass(frozen=True, eq=False)
class Model:
    """A robot as a controller knows it.

    Attributes:
        joints: where they stand; the geometry is never off.
        masses: of the bodies.
        armature: of the motors [kg m^2], n entries.
        gravity: in the base's frame [m/s^2], shape (3,).
        friction: without the presliding, the Stribeck curve and the ripple of the plant.
    """

    joints: tuple[Joint, ...]
    masses: tuple[Mass, ...]
    armature: tuple[float, ...]
    gravity: SX
    friction: Friction

    def friction_torque(self, velocity: SX) -> SX:
        """Friction [N m] at a velocity [rad/s], opposing motion; shape (n,)."""
        f, way = self.friction, ca.tanh(velocity / SIGN_WIDTH_RAD_PER_S)
        level = (f.positive_Nm + f.negative_Nm) / 2.0 * way
        return (
            level
            + (f.positive_Nm - f.negative_Nm) / 2.0 * way**2
            + (f.viscous_Nms_per_rad * velocity)
        )


Factors = Callable[[int], Floats]
"""So many factors, for numbers that are off by one each."""


def uniform(error: float) -> Factors:
    """All numbers are off by the same part, such as 0.2 for 20 % too large."""
    return lambda count: np.full(count, 1.0 + error)


def random_signs(error: float, seed: int) -> Factors:
    """Each number is off by the same part, too large or too small by a coin's throw."""
    # Named, because numpy may change its default.
    coin = np.random.Generator(np.random.PCG64(seed))
    return lambda count: 1.0 + error * coin.choice((-1.0, 1.0), count)


def model_of(plant: Plant, factors: Factors) -> Model:
    """The plant's own numbers, each times a factor.

    These are mass, first moment and inertia of each body, motor inertia, Coulomb and viscous
    friction of each joint. Geometry and gravity are exact.

    Args:
        plant: the robot.
        factors: asked for as many as there are numbers, in this order.
    """
    n, inertias = plant.joints, list(plant.model.inertias)[1:]
    masses = tuple(
        Mass.of_numbers((np.array(mass_numbers(inertia)) * factors(3)[[*_GROUPS]]).tolist())
        for inertia in inertias
    )
    armature = tuple((plant.model.armature * factors(n)).tolist())
    coulomb, viscous = factors(n), factors(n)
    parameters: Sequence[Any] = plant.friction.parameters
    return Model(
        joints(plant.model),
        masses,
        armature,
        ca.SX(plant.model.gravity.linear),
        Friction(
            coulomb * np.array([joint.curve.coulomb_positive_Nm for joint in parameters]),
            coulomb * np.array([joint.curve.coulomb_negative_Nm for joint in parameters]),
            viscous * np.array([joint.viscous_Nms_per_rad for joint in parameters]),
        ),
    )
