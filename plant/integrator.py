"""The equation of motion over a held command: semi-implicit Euler, friction linearly implicit."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from plant.assembly import Floats, Plant, PlantState


class Advance(NamedTuple):
    """What holding a command for some time leads to.

    Attributes:
        state: at the end.
        friction_Nm: of the first substep, opposing motion, shape (n,).
        torque_Nm: the mean of what the drives gave, shape (n,).
    """

    state: PlantState
    friction_Nm: Floats
    torque_Nm: Floats


class Integrator:
    """Integrates the equation of motion of one plant; owns the working memory for it.

    Args:
        plant: the plant.
        model: the rigid bodies in place of the plant's own, such as with a payload.
    """

    def __init__(self, plant: Plant, model: pin.Model | None = None) -> None:
        self._plant = plant
        # A copy, because the friction's derivative is added to its armature for each step.
        self._model = pin.Model(plant.model if model is None else model)
        self._data = self._model.createData()
        self._armature = self._model.armature.copy()
        # A run has few different parts of ticks, and many ticks.
        self._lag = lru_cache(maxsize=16)(plant.drive.lag)

    def advance(
        self,
        state: PlantState,
        command_Nm: Floats,
        duration_s: float,
        substep_s: float,
        external_Nm: Floats | float = 0.0,
    ) -> Advance:
        """The state after holding a command for some time.

        Each of the equal substeps of h <= ``substep_s`` solves, for rigid joints,
        (M + h D) qdd = torque + external - nle - F by the articulated-body algorithm: h D is
        diagonal and adds to the armature. For flexible joints see :mod:`plant.flexibility`. The
        current loop's torque enters by its mean over the substep.

        Args:
            state: at the beginning; left as it is.
            command_Nm: to the drives, within their limits, shape (n,).
            duration_s: >= 0.
            substep_s: longest substep > 0.
            external_Nm: on the links, shape (n,).
        """
        steps = substeps(duration_s, substep_s)
        if steps == 0:
            return Advance(
                replace(state, command_Nm=command_Nm), np.zeros_like(state.q), command_Nm
            )
        h, plant = duration_s / steps, self._plant
        lag = self._lag(h, steps)
        mean = command_Nm + (state.torque_Nm - command_Nm) * lag.mean_of_all
        q, qd = state.q.copy(), state.qd.copy()
        # Where joints are rigid, both names stand for the same arrays.
        rigid = plant.flexibility is None
        q_motor, qd_motor = (q, qd) if rigid else (state.q_motor.copy(), state.qd_motor.copy())
        friction, drives = state.friction, state.torque_Nm
        first = np.zeros_like(q)
        for k in range(steps):
            friction, force, derivative = plant.friction.step(
                q_motor.tolist(), qd_motor.tolist(), friction, h
            )
            implicit = h * np.array(derivative)
            torque = command_Nm + (drives - command_Nm) * lag.mean - force
            drives = command_Nm + (drives - command_Nm) * lag.decay
            rotor = self._armature + implicit
            if plant.flexibility is None:
                qdd = qdd_motor = self._links(q, qd, rotor, torque + external_Nm)
            else:
                coupling = plant.flexibility.over_step(q_motor - q, qd_motor - qd, h)
                links = coupling.links(rotor, torque)
                qdd = self._links(q, qd, links.armature_kgm2, links.torque_Nm + external_Nm)
                qdd_motor = coupling.motors(rotor, torque, qdd)
                qd_motor += h * qdd_motor
                q_motor += h * qd_motor
            if k == 0:
                first = force + implicit * qdd_motor
            qd += h * qdd
            q += h * qd
        end = PlantState(q, qd, q_motor, qd_motor, friction, command_Nm, drives)
        return Advance(end, first, mean)

    def _links(self, q: Floats, qd: Floats, armature: Floats, torque_Nm: Floats) -> Floats:
        """The links' acceleration [rad/s^2] with another armature."""
        self._model.armature = armature
        acceleration: Floats = pin.aba(self._model, self._data, q, qd, torque_Nm)
        return acceleration


def substeps(duration_s: float, substep_s: float) -> int:
    """The least number of equal steps of at most ``substep_s``; rounding errors don't add one."""
    return math.ceil(duration_s / substep_s * (1.0 - 1e-9))
