"""The plant's dynamics in C, generated with CasADi: host code in double, with libm.

Two functions, in the form of CasADi's C interface:

    loop_substep   one step of the integrator, the meaning of :class:`plant.closed_loop.Integrator`
    loop_terms     M, nle and the acceleration of one state, to compare with Pinocchio

Placements and axes of the joints are constants of the C. All other numbers - masses, motor
inertias, gravity, friction - are given at run time, but for those that are 0: they vanish. One
library therefore serves all plants of the same :class:`Structure`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from plant.closed_loop import Plant
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
    """

    joints: tuple[Joint, ...]
    zeros: tuple[bool, ...]
    friction: tuple[JointModel, ...]


def structure(plant: Plant) -> Structure:
    """The structure of a plant.

    Raises:
        UnsupportedJointError: see :func:`plant.compiled.rigid_body.joints`.
    """
    return Structure(
        joints(plant.model),
        tuple(number == 0.0 for number in _rigid_numbers(plant)),
        tuple(
            _with_numbers(joint, (float(x != 0.0) for x in _numbers(joint)))
            for joint in plant.friction.parameters
        ),
    )


def numbers(plant: Plant) -> NDArray[np.float64]:
    """All numbers that the C takes at run time, those that are 0 among them."""
    friction = (x for joint in plant.friction.parameters for x in _numbers(joint))
    return np.array([*_rigid_numbers(plant), *friction], dtype=np.float64)


def _rigid_numbers(plant: Plant) -> list[float]:
    """Ten of each body, the armature of each joint, and gravity."""
    model = plant.model
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
    """

    all: SX
    masses: tuple[Mass, ...]
    armature: list[SX]
    gravity: SX
    friction: tuple[JointModel, ...]


def _symbols(of: Structure) -> Symbols:
    n = len(of.joints)
    patterns = [not zero for zero in of.zeros]
    patterns += [x != 0.0 for joint in of.friction for x in _numbers(joint)]
    symbols = ca.SX.sym("number", len(patterns))
    known = iter([symbols[i] if there else 0.0 for i, there in enumerate(patterns)])
    return Symbols(
        all=symbols,
        masses=tuple(Mass.of_numbers([next(known) for _ in range(10)]) for _ in range(n)),
        armature=[next(known) for _ in range(n)],
        gravity=ca.SX(ca.vertcat(*(next(known) for _ in range(3)))),
        friction=tuple(_with_numbers(joint, known) for joint in of.friction),
    )


def substep_function(of: Structure) -> ca.Function:
    """One step of h: (q, qd, friction, torque, h, numbers) to (q, qd, friction, friction torque).

    Solves (M + h D) qdd = torque - nle - F, then qd+ = qd + h qdd and q+ = q + h qd+; the friction
    torque is F + h D qdd, that of the step.
    """
    n, symbols, h = len(of.joints), _symbols(of), ca.SX.sym("h")
    q, qd, friction, torque = (ca.SX.sym(x, n) for x in ("q", "qd", "friction", "torque"))
    steps = [
        joint.step(q[i], qd[i], friction[i], h, SYMBOLIC)
        for i, joint in enumerate(symbols.friction)
    ]
    state, force, derivative = (ca.vertcat(*column) for column in zip(*steps, strict=True))
    M, nle = _inertia_and_bias(of, symbols, q, qd)
    implicit = h * derivative
    qdd = solve_symmetric(M + ca.diag(implicit), torque - force - nle)
    qd_new = qd + h * qdd
    outputs = [q + h * qd_new, qd_new, state, force + implicit * qdd]
    return ca.Function(SUBSTEP, [q, qd, friction, torque, h, symbols.all], ca.cse(outputs))


def terms_function(of: Structure) -> ca.Function:
    """(q, qd, torque, numbers) to (M, nle, frictionless qdd)."""
    symbols = _symbols(of)
    q, qd, torque = (ca.SX.sym(x, len(of.joints)) for x in ("q", "qd", "torque"))
    M, nle = _inertia_and_bias(of, symbols, q, qd)
    outputs = [M, nle, solve_symmetric(M, torque - nle)]
    return ca.Function(TERMS, [q, qd, torque, symbols.all], ca.cse(outputs))


def _inertia_and_bias(of: Structure, symbols: Symbols, q: SX, qd: SX) -> tuple[SX, SX]:
    robot = tree(of.joints, symbols.masses, q)
    return inertia_matrix(robot, symbols.armature), bias_torque(robot, qd, symbols.gravity)


# To make the C takes longer than a short run.
@lru_cache(maxsize=32)
def dynamics_c(of: Structure) -> str:
    """The C of both functions; the same structure always gives the same text."""
    generator = ca.CodeGenerator("dynamics.c")
    generator.add(substep_function(of))
    generator.add(terms_function(of))
    text: str = generator.dump()
    return text
