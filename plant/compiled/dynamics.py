"""The plant's dynamics in C, generated with CasADi: host code in double, with libm.

Two functions, in the form of CasADi's C interface:

    loop_substep   one step of the integrator, the meaning of :class:`plant.integrator.Integrator`
    loop_terms     M, nle and the acceleration of one state, to compare with Pinocchio

Placements and axes of the joints are constants of the C. All other numbers - masses, motor
inertias, gravity, friction - are given at run time, but for those that are 0: they vanish. One
library therefore serves all plants of the same :class:`Structure`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from plant.assembly import Plant
from plant.compiled.rigid_body import (
    SX,
    Joint,
    Mass,
    bias_torque,
    inertia_matrix,
    joints,
    mass_numbers,
    solve_symmetric,
    tree,
)
from plant.flexibility import Flexibility, Links
from plant.friction import Functions, JointModel

SYMBOLIC = Functions(
    exp=ca.exp,
    expm1=ca.expm1,
    sin=ca.sin,
    tanh=ca.tanh,
    copysign=ca.copysign,
    maximum=ca.fmax,
    where=ca.if_else,
    zero=lambda number: bool(ca.SX(number).is_zero()),
)
"""The functions of CasADi SX expressions, for :mod:`plant.friction`."""

SUBSTEP, TERMS = "loop_substep", "loop_terms"


@dataclass(frozen=True)
class Structure:
    """What the C depends on.

    Attributes:
        joints: of the robot.
        zeros: which of the rigid bodies' numbers are 0.
        friction: of the joints, with 1 for each number that isn't 0.
        flexible: whether motors and links move on their own.
    """

    joints: tuple[Joint, ...]
    zeros: tuple[bool, ...]
    friction: tuple[JointModel, ...]
    flexible: bool

    @property
    def coordinates(self) -> int:
        """Links, and motors where they move on their own."""
        return len(self.joints) * (2 if self.flexible else 1)


def structure(plant: Plant, models: Sequence[pin.Model] = ()) -> Structure:
    """The structure of a plant.

    Args:
        plant: the plant.
        models: other rigid bodies that the C is to serve, too, such as with a payload.

    Raises:
        UnsupportedJointError: see :func:`plant.compiled.rigid_body.joints`.
    """
    rigid = np.array([_rigid_numbers(model) for model in (plant.model, *models)])
    return Structure(
        joints(plant.model),
        tuple((rigid == 0.0).all(axis=0).tolist()),
        tuple(
            _with_numbers(joint, (float(x != 0.0) for x in _numbers(joint)))
            for joint in plant.friction.parameters
        ),
        plant.flexibility is not None,
    )


def numbers(plant: Plant, model: pin.Model | None = None) -> NDArray[np.float64]:
    """All numbers that the C takes at run time, those that are 0 among them.

    Args:
        plant: the plant.
        model: the rigid bodies in place of the plant's own.
    """
    friction = [x for joint in plant.friction.parameters for x in _numbers(joint)]
    rigid = _rigid_numbers(plant.model if model is None else model)
    springs = plant.flexibility
    if springs is None:
        return np.array([*rigid, *friction], dtype=np.float64)
    return np.concatenate(
        (rigid, friction, springs.stiffness_Nm_per_rad, springs.damping_Nms_per_rad)
    )


def _rigid_numbers(model: pin.Model) -> list[float]:
    """Ten of each body, the armature of each joint, and gravity."""
    masses = (x for inertia in list(model.inertias)[1:] for x in mass_numbers(inertia))
    return [*masses, *map(float, model.armature), *map(float, model.gravity.linear)]


def _numbers(part: Any) -> Iterator[float]:
    """The numbers of a dataclass of numbers and such dataclasses, in the order of its fields."""
    for field in fields(part):
        value = getattr(part, field.name)
        if is_dataclass(value):
            yield from _numbers(value)
        else:
            yield value


def _with_numbers(part: Any, given: Iterator[Any]) -> Any:
    """The dataclass with other numbers, in the order of :func:`_numbers`."""
    changed = {}
    for field in fields(part):
        value = getattr(part, field.name)
        changed[field.name] = _with_numbers(value, given) if is_dataclass(value) else next(given)
    return replace(part, **changed)


@dataclass(frozen=True, eq=False)
class Symbols:
    """The numbers of a plant as CasADi symbols.

    Attributes:
        all: shape as :func:`numbers`.
        masses: of the bodies.
        armature: of the joints [kg m^2].
        gravity: shape (3,) [m/s^2].
        friction: of the joints.
        flexibility: of the joints; None where they are rigid.
    """

    all: SX
    masses: tuple[Mass, ...]
    armature: list[SX]
    gravity: SX
    friction: tuple[JointModel, ...]
    flexibility: Flexibility | None


def _symbols(of: Structure) -> Symbols:
    n = len(of.joints)
    patterns = [not zero for zero in of.zeros]
    patterns += [x != 0.0 for joint in of.friction for x in _numbers(joint)]
    patterns += [True] * (2 * n if of.flexible else 0)
    symbols = ca.SX.sym("number", len(patterns))
    known = iter([symbols[i] if there else 0.0 for i, there in enumerate(patterns)])
    return Symbols(
        all=symbols,
        masses=tuple(Mass.of_numbers([next(known) for _ in range(10)]) for _ in range(n)),
        armature=[next(known) for _ in range(n)],
        gravity=ca.SX(ca.vertcat(*(next(known) for _ in range(3)))),
        friction=tuple(_with_numbers(joint, known) for joint in of.friction),
        flexibility=Flexibility(
            *(ca.SX(ca.vertcat(*(next(known) for _ in range(n)))) for _ in range(2))
        )
        if of.flexible
        else None,
    )


def substep_function(of: Structure) -> ca.Function:
    """One step of h, as :meth:`plant.integrator.Integrator.advance` makes it.

    (q, qd, friction, torque, external torque, h, numbers) to (q, qd, friction, friction torque);
    q and qd have an entry for each coordinate: all links, then all motors where joints are
    flexible.
    """
    n, symbols, h = len(of.joints), _symbols(of), ca.SX.sym("h")
    q, qd = (ca.SX.sym(x, of.coordinates) for x in ("q", "qd"))
    friction, torque, external = (ca.SX.sym(x, n) for x in ("friction", "torque", "external"))
    # The first are the links', the last the motors'.
    links, motors = ca.Slice(0, n), ca.Slice(of.coordinates - n, of.coordinates)
    steps = [
        joint.step(q[motors][i], qd[motors][i], friction[i], h, SYMBOLIC)
        for i, joint in enumerate(symbols.friction)
    ]
    state, force, derivative = (ca.vertcat(*column) for column in zip(*steps, strict=True))
    implicit, free = h * derivative, torque - force
    rotor = ca.vertcat(*symbols.armature) + implicit
    if symbols.flexibility is None:
        felt = Links(rotor, free)
    else:
        coupling = symbols.flexibility.over_step(q[motors] - q[links], qd[motors] - qd[links], h)
        felt = coupling.links(rotor, free)
    robot = tree(of.joints, symbols.masses, q[links])
    M = inertia_matrix(robot, ca.vertsplit(felt.armature_kgm2))
    nle = bias_torque(robot, qd[links], symbols.gravity)
    qdd = qdd_motors = solve_symmetric(M, felt.torque_Nm + external - nle)
    if symbols.flexibility is not None:
        qdd_motors = coupling.motors(rotor, free, qdd)
        qdd = ca.vertcat(qdd, qdd_motors)
    qd_new = qd + h * qdd
    outputs = [q + h * qd_new, qd_new, state, force + implicit * qdd_motors]
    arguments = [q, qd, friction, torque, external, h, symbols.all]
    return ca.Function(SUBSTEP, arguments, ca.cse(outputs))


def terms_function(of: Structure) -> ca.Function:
    """(q, qd, torque, numbers) to (M, nle, frictionless qdd)."""
    symbols = _symbols(of)
    q, qd, torque = (ca.SX.sym(x, len(of.joints)) for x in ("q", "qd", "torque"))
    robot = tree(of.joints, symbols.masses, q)
    M = inertia_matrix(robot, symbols.armature)
    nle = bias_torque(robot, qd, symbols.gravity)
    outputs: SX = ca.cse([M, nle, solve_symmetric(M, torque - nle)])
    return ca.Function(TERMS, [q, qd, torque, symbols.all], outputs)


# To make the C takes longer than a short run.
@lru_cache(maxsize=32)
def dynamics_c(of: Structure) -> str:
    """The C of both functions; the same structure always gives the same text."""
    generator = ca.CodeGenerator("dynamics.c")
    generator.add(substep_function(of))
    generator.add(terms_function(of))
    text: str = generator.dump()
    return text
