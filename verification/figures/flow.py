"""Trajectories of the desired error dynamics (17), with the powers of the generated C in them.

    edd + KD sig(ed)^alpha + KP sig(e)^beta = 0

``flow.c`` includes the very header that a controller ships with and integrates in double by a fixed
step. The right-hand side is not smooth on the axes for exponents below 1: the step is much finer
than the order of the method asks for.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np

from codegen.sig_pow import exponent_q31
from plant.native import FLAGS, GENERATED, c_files, library
from verification.figures.chart import Floats

FOLDER = Path(__file__).parent
CONTROLLER = "puma3"
"""Whose powers are flown with: the paper's robot, in float."""

STEP_S = 20e-6


class Equilibrium(Enum):
    """What the origin of the phase plane is."""

    NODE = "node"
    FOCUS = "focus"


@dataclass(frozen=True)
class ErrorDynamics:
    """The gains and exponents of (17), one joint; alpha and beta in (0, 2)."""

    kd: float
    kp: float
    alpha: Fraction
    beta: Fraction

    @property
    def balanced_alpha(self) -> Fraction:
        """2 beta/(1 + beta), where damper, spring and inertia are alike near the origin.

        There the dynamics is homogeneous: (35) solved for alpha.
        """
        return 2 * self.beta / (1 + self.beta)

    @property
    def critical_kd(self) -> float:
        """The least KD for which a balanced dynamics does not oscillate.

        Curves ed = -k sig(e)^(1/(2 - alpha)) are invariant if and only if

            k^2/(2 - alpha) - KD k^alpha + KP = 0

        which has a positive root from KD = 2 KP^(1 - alpha/2) / ((2 - alpha) alpha^(alpha/2)) on.
        """
        alpha = float(self.alpha)
        half = alpha / 2
        return float(2 * self.kp ** (1 - half) / ((2 - alpha) * alpha**half))

    @property
    def equilibrium(self) -> Equilibrium:
        """Node or focus, by the terms that lead near the origin.

        Below the balanced alpha the damper outgrows inertia, and the error creeps along
        KD sig(ed)^alpha = -KP sig(e)^beta; above it the damper vanishes beside spring and inertia,
        and the error oscillates without end.
        """
        if self.alpha == self.balanced_alpha:
            creeps = self.kd >= self.critical_kd
        else:
            creeps = self.alpha < self.balanced_alpha
        return Equilibrium.NODE if creeps else Equilibrium.FOCUS

    def energy(self, states: Floats) -> Floats:
        """V of (20) [rad^2/s^2], shape (rows,), of states of shape (rows, 2)."""
        exponent = float(self.beta) + 1
        energy: Floats = 0.5 * states[:, 1] ** 2 + self.kp / exponent * (
            np.abs(states[:, 0]) ** exponent
        )
        return energy

    def power(self, states: Floats) -> Floats:
        """Vdot of (21) [rad^2/s^3], shape (rows,)."""
        power: Floats = -self.kd * np.abs(states[:, 1]) ** (float(self.alpha) + 1)
        return power


class Gains(ctypes.Structure):
    """``flow_gains``."""

    _fields_ = (
        ("kd", ctypes.c_double),
        ("kp", ctypes.c_double),
        ("alpha_minus_one_q31", ctypes.c_int32),
        ("beta_minus_one_q31", ctypes.c_int32),
    )


@cache
def _flow_library() -> ctypes.CDLL:
    own = {name: (FOLDER / name).read_bytes() for name in ("flow.c", "flow.h")}
    shipped = c_files(GENERATED / CONTROLLER)
    powers = {name: shipped[name] for name in ("tdc.h", "tdc_sig_pow.h", "tdc_sig_pow.c")}
    return ctypes.CDLL(str(library("flow", own | powers, FLAGS)))


def flow(
    dynamics: ErrorDynamics,
    start: tuple[float, float],
    duration_s: float,
    row_s: float,
    step_s: float = STEP_S,
) -> tuple[Floats, Floats]:
    """A trajectory of (17).

    Args:
        dynamics: gains and exponents.
        start: e [rad] and ed [rad/s].
        duration_s: how long.
        row_s: the time between two rows of the answer, a multiple of the step.
        step_s: of the integration.

    Returns:
        Times [s], shape (rows,), and states e [rad], ed [rad/s], shape (rows, 2).

    Raises:
        ValueError: an exponent is outside [0, 2].
        CompilerError: the C can't be compiled.
    """
    rows = round(duration_s / row_s) + 1
    states = np.zeros((rows, 2))
    states[0] = start
    gains = Gains(
        dynamics.kd, dynamics.kp, exponent_q31(dynamics.alpha), exponent_q31(dynamics.beta)
    )
    _flow_library().flow_run(
        ctypes.byref(gains),
        ctypes.c_double(step_s),
        ctypes.c_int64(round(row_s / step_s)),
        ctypes.c_int64(rows),
        ctypes.c_void_p(states.ctypes.data),
    )
    return row_s * np.arange(rows, dtype=np.float64), states


@dataclass(frozen=True)
class HalfTurn:
    """How a focus comes to its first turning point from rest at e = 1 rad.

    Attributes:
        duration_s: until the velocity error is zero again.
        overshoot: the magnitude of the error there, as a share of where it came from.
    """

    duration_s: float
    overshoot: float

    def settling_time_s(self, alpha: Fraction) -> float:
        """Of a balanced dynamics with alpha < 1 from the same rest.

        A half-turn from e is |e|^((1 - alpha)/(2 - alpha)) times as long as one from 1 rad; the
        half-turns are a geometric series.
        """
        ratio = self.overshoot ** float((1 - alpha) / (2 - alpha))
        return float(self.duration_s / (1 - ratio))


def half_turn(dynamics: ErrorDynamics, step_s: float = STEP_S) -> HalfTurn:
    """The first half-turn of a focus from e = 1 rad at rest.

    Raises:
        ValueError: there is none within ten seconds, as with a node.
    """
    time_s, states = flow(dynamics, (1.0, 0.0), 10.0, step_s, step_s)
    turned = np.flatnonzero(states[1:, 1] >= 0)
    if not len(turned):
        raise ValueError(f"{dynamics} does not turn: it is no focus")
    last = int(turned[0])  # the row before the turn: row 0 is the start
    before, after = states[last, 1], states[last + 1, 1]
    share = before / (before - after)
    at = states[last, 0] + share * (states[last + 1, 0] - states[last, 0])
    return HalfTurn(float(time_s[last] + share * step_s), float(abs(at)))
