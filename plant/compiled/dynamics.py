"""The plant's dynamics in C, generated with CasADi: host code in double, with libm.

Two functions, in the form of CasADi's C interface:

    loop_substep   one step of the integrator, the meaning of :class:`plant.closed_loop.Integrator`
    loop_terms     M, nle and the acceleration of one state, to compare with Pinocchio
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from plant.closed_loop import Plant
from plant.compiled.rigid_body import (
    SX,
    bias_torque,
    bodies,
    inertia_matrix,
    placements,
    solve_symmetric,
)
from plant.friction import Functions

SYMBOLIC = Functions(
    exp=ca.exp,
    expm1=ca.expm1,
    sin=ca.sin,
    tanh=ca.tanh,
    copysign=ca.copysign,
    maximum=ca.fmax,
    where=ca.if_else,
)
"""The functions of CasADi SX expressions, for :mod:`plant.friction`."""

SUBSTEP, TERMS = "loop_substep", "loop_terms"


def substep_function(plant: Plant) -> ca.Function:
    """One step of h: (q, qd, friction, torque, h) to (q, qd, friction, friction torque).

    Solves (M + h D) qdd = torque - nle - F, then qd+ = qd + h qdd and q+ = q + h qd+; the friction
    torque is F + h D qdd, that of the step.

    Raises:
        UnsupportedJointError: see :func:`plant.compiled.rigid_body.bodies`.
    """
    n = plant.joints
    q, qd, friction, torque = (ca.SX.sym(x, n) for x in ("q", "qd", "friction", "torque"))
    h = ca.SX.sym("h")
    steps = [
        joint.step(q[i], qd[i], friction[i], h, SYMBOLIC)
        for i, joint in enumerate(plant.friction.parameters)
    ]
    state, force, derivative = (ca.vertcat(*column) for column in zip(*steps, strict=True))
    M, nle = _inertia_and_bias(plant, q, qd)
    implicit = h * derivative
    qdd = solve_symmetric(M + ca.diag(implicit), torque - force - nle)
    qd_new = qd + h * qdd
    outputs = [q + h * qd_new, qd_new, state, force + implicit * qdd]
    return ca.Function(SUBSTEP, [q, qd, friction, torque, h], ca.cse(outputs))


def terms_function(plant: Plant) -> ca.Function:
    """(q, qd, torque) to (M, nle, qdd): inertia matrix, bias torques and frictionless acceleration.

    Raises:
        UnsupportedJointError: see :func:`plant.compiled.rigid_body.bodies`.
    """
    q, qd, torque = (ca.SX.sym(x, plant.joints) for x in ("q", "qd", "torque"))
    M, nle = _inertia_and_bias(plant, q, qd)
    outputs = [M, nle, solve_symmetric(M, torque - nle)]
    return ca.Function(TERMS, [q, qd, torque], ca.cse(outputs))


def _inertia_and_bias(plant: Plant, q: SX, qd: SX) -> tuple[SX, SX]:
    model, chain = plant.model, bodies(plant.model)
    frames = placements(chain, q)
    gravity = np.array(model.gravity.linear)
    return (
        inertia_matrix(chain, frames, np.array(model.armature)),
        bias_torque(chain, frames, qd, gravity),
    )


def dynamics_c(plant: Plant) -> str:
    """The C of both functions; the same plant always gives the same text."""
    generator = ca.CodeGenerator("dynamics.c")
    generator.add(substep_function(plant))
    generator.add(terms_function(plant))
    text: str = generator.dump()
    return text
