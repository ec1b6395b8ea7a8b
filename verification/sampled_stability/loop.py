"""The sampled closed loop of the law's linear case on a double integrator, exactly.

With alpha = beta = gamma = 1 and no saturation the law is linear. One joint is M qdd = tau with a
zero-order hold between the samples; Mbar stands in the loop only as r = Mbar/M. The controller is
not written down here once more: its step is the generator's own expression graph
(``codegen.law``), evaluated in exact fractions at the unit vectors of the state. What comes out is
the matrix of one sample, of which the characteristic polynomial is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, get_args

import casadi as ca
from flint import fmpq, fmpq_mat, fmpq_poly

from codegen.law import AccelerationEstimate, LawOptions, VelocityError, measurement, torque_law
from verification.law_graph import evaluate

SAMPLE_TIME_MAX_S = 1
"""As in a specification."""
_ZERO, _ONE = Fraction(0), Fraction(1)


class LoopError(ValueError):
    """A loop that can't be, or a file of one that can't be written; the message names the fix."""


@dataclass(frozen=True)
class Loop:
    """One joint with its sampled controller.

    Attributes:
        kd: KD [1/s].
        kp: KP [1/s^2].
        lambda_: lambda [1/s]; 0 leaves the sliding variable out of the loop.
        sample_time_s: L.
        acceleration: which second difference estimates qdd(t-L).
        velocity_error: how ed is formed; the forms differ in the reference alone.
        compute_delay: whole samples from reading the encoder to commanding the torque, 0 or 1.
        torque_delay: further time until a command acts, as a fraction of L in [0, 1].
        low_pass_ratio: w'/(1+w') of the low-pass (43); None for a law without it.
        reports_torque: whether tau(t-L) is what the drive applied, on average over the last
            sample, and not what was commanded one sample ago.

    Raises:
        LoopError: a number lies where there is no such loop.
    """

    kd: Fraction
    kp: Fraction
    lambda_: Fraction
    sample_time_s: Fraction
    acceleration: AccelerationEstimate = "current"
    velocity_error: VelocityError = "reference-rate"
    compute_delay: int = 0
    torque_delay: Fraction = _ZERO
    low_pass_ratio: Fraction | None = None
    reports_torque: bool = False

    def __post_init__(self) -> None:
        for name, gain in (("KD", self.kd), ("KP", self.kp), ("lambda", self.lambda_)):
            _require(gain >= 0, name, gain, "0 or greater", "write the gain without a sign")
        within = 0 < self.sample_time_s <= SAMPLE_TIME_MAX_S
        rule = f"greater than 0 and at most {SAMPLE_TIME_MAX_S} s"
        _require(within, "sample time", self.sample_time_s, rule, "write it in seconds")
        _require(
            self.acceleration in get_args(AccelerationEstimate),
            "acceleration",
            self.acceleration,
            f"one of {', '.join(get_args(AccelerationEstimate))}",
            "write one of them",
        )
        _require(
            self.velocity_error in get_args(VelocityError),
            "velocity error",
            self.velocity_error,
            f"one of {', '.join(get_args(VelocityError))}",
            "write one of them",
        )
        _require(
            self.compute_delay in (0, 1),
            "compute delay",
            self.compute_delay,
            "0 or 1 whole samples",
            "give a part of a sample as torque delay",
        )
        _require(
            0 <= self.torque_delay <= 1,
            "torque delay",
            self.torque_delay,
            "a fraction of the sample time, from 0 to 1",
            "divide the delay by the sample time",
        )
        ratio = self.low_pass_ratio
        _require(
            ratio is None or 0 < ratio <= 1,
            "low-pass ratio",
            ratio,
            "greater than 0 and at most 1",
            "the ratio is w'/(1+w') with w' = w L; give a cutoff w with its unit, as 100rad/s",
        )

    @property
    def options(self) -> LawOptions:
        """The structure of the law."""
        return LawOptions(
            self.velocity_error,
            self.acceleration,
            self.low_pass_ratio is not None,
            self.reports_torque,
        )


def low_pass_ratio(cutoff_rad_per_s: Fraction, sample_time_s: Fraction) -> Fraction:
    """w'/(1+w') of the low-pass (43), w' = w L, as the generator puts it into the C."""
    per_sample = cutoff_rad_per_s * sample_time_s
    return per_sample / (1 + per_sample)


def _require(holds: bool, name: str, value: object, rule: str, fix: str) -> None:
    if not holds:
        raise LoopError(f"{name} = {value}: must be {rule}; {fix}")


# --- One sample --------------------------------------------------------------------------------


@dataclass(frozen=True)
class State:
    """What a sample hands to the next; torques are divided by M.

    Attributes:
        positions: q(t), q(t-L), q(t-2L), q(t-3L) [rad]; count 0 and the reference are 0.
        velocity: qd(t) [rad/s].
        commands: the torques commanded at t-L, t-2L, t-3L [rad/s^2].
        integral: s - ed, the integral part of (26) [rad/s].
    """

    positions: tuple[Fraction, ...] = (_ZERO,) * 4
    velocity: Fraction = _ZERO
    commands: tuple[Fraction, ...] = (_ZERO,) * 3
    integral: Fraction = _ZERO

    @property
    def vector(self) -> tuple[Fraction, ...]:
        """All of it in one order."""
        return (*self.positions, self.velocity, *self.commands, self.integral)

    @classmethod
    def of(cls, vector: tuple[Fraction, ...]) -> State:
        """The state with a given :attr:`vector`."""
        return cls(vector[:4], vector[4], vector[5:8], vector[8])


_OPERATIONS: dict[int, Callable[..., Fraction]] = {
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a - b,
    ca.OP_MUL: lambda a, b: a * b,
    ca.OP_NEG: lambda a: -a,
    ca.OP_SIGN: lambda a: Fraction((a > 0) - (a < 0)),
    ca.OP_FABS: abs,
    ca.OP_POW: lambda a, b: a**b,  # the exponents are 1, which Fraction keeps exact
    ca.OP_FMIN: min,
    ca.OP_FMAX: max,
}


def _commanded(loop: Loop, ratio: Fraction, state: State) -> tuple[Fraction, Fraction]:
    """The law's torque over M before saturation, and its next integral, for reference 0."""
    q = state.positions
    late = 1 if loop.acceleration == "delayed" else 0
    per_s = 1 / loop.sample_time_s
    # One count is 1 rad here: the law is linear, and exact numbers need no fine encoder.
    difference_units = 256 if loop.velocity_error == "error-difference" else 1
    measured = _quantities(
        measurement(loop.options),
        {
            "position": Fraction(1, 256),
            "velocity": per_s / difference_units,
            "acceleration": per_s**2,
            "error_q8": -256 * q[0],
            "error_change_q8": -256 * (q[0] - q[1]),
            "displacement": q[0] - q[1],
            "displacement_change": q[late] - 2 * q[late + 1] + q[late + 2],
            "reference_velocity": _ZERO,
            "last_reference_velocity": _ZERO,
        },
    )
    applied_last = sum(_held(loop, state.commands), _ZERO)
    law = _quantities(
        torque_law(loop.options),
        {
            **measured,
            "inertia": ratio,
            "kd": loop.kd,
            "kp": loop.kp,
            "lambda": loop.lambda_,
            "alpha": _ONE,
            "beta": _ONE,
            "gamma": _ONE,
            "torque_limit": _ONE,
            "low_pass_ratio": loop.low_pass_ratio or _ONE,
            "reference_acceleration": _ZERO,
            "last_torque": applied_last if loop.reports_torque else state.commands[0],
            "sliding_integral": state.integral,
            "sample_time": loop.sample_time_s,
        },
    )
    demanded = "control_torque" if loop.low_pass_ratio is None else "filtered_torque"
    return law[demanded], law["next_sliding_integral"]


def _quantities(function: Any, inputs: dict[str, Fraction]) -> dict[str, Fraction]:
    return evaluate(function, inputs, _OPERATIONS, Fraction)


def _held(loop: Loop, commands: tuple[Fraction, ...]) -> tuple[Fraction, Fraction]:
    """What two commands contribute to the mean torque of a sample; the latest one comes first.

    The older acts until the torque delay is over, the newer from then on.
    """
    newer, older = commands[loop.compute_delay : loop.compute_delay + 2]
    return loop.torque_delay * older, (1 - loop.torque_delay) * newer


def sample(loop: Loop, ratio: Fraction, state: State) -> State:
    """The state one sample later, with r = ``ratio`` and reference 0; nothing is rounded."""
    command, integral = _commanded(loop, ratio, state)
    commands = (command, *state.commands)
    early, late = _held(loop, commands)
    dt, d = loop.sample_time_s, loop.torque_delay
    # Each part of a constant torque moves q by its velocity times the time from its middle.
    moved = dt**2 * (early * (1 - d / 2) + late * (1 - d) / 2)
    return State(
        (state.positions[0] + dt * state.velocity + moved, *state.positions[:-1]),
        state.velocity + dt * (early + late),
        commands[:-1],
        integral,
    )


# --- The characteristic polynomial -------------------------------------------------------------


@dataclass(frozen=True)
class Characteristic:
    """p(z; r) = ``constant``(z) + r ``ratio``(z), monic of degree n in z.

    The loop is Schur stable, that is every motion of it dies out, iff all n roots lie in |z| < 1.
    """

    constant: fmpq_poly
    ratio: fmpq_poly

    @property
    def degree(self) -> int:
        """n, the same for every r."""
        return int(self.constant.degree())

    def at(self, ratio: Fraction) -> fmpq_poly:
        """The polynomial in z for one r."""
        return self.constant + rational(ratio) * self.ratio


def rational(value: Fraction) -> fmpq:
    """A fraction in FLINT."""
    return fmpq(value.numerator, value.denominator)


def fraction(value: fmpq) -> Fraction:
    """A fraction from FLINT."""
    return Fraction(int(value.p), int(value.q))


def characteristic(loop: Loop) -> Characteristic:
    """The characteristic polynomial of the loop, without roots at z = 0, which are stable.

    It is affine in r: r multiplies nothing but the acceleration that the law demands, and one
    scalar in the loop changes the matrix of a sample by rank one.

    With lambda = 0 nothing reads the integral part of s: it is left out, since it would only be a
    counter beside the loop.
    """
    without, with_one = (_sample_matrix(loop, r).charpoly() for r in (_ZERO, _ONE))
    constant, ratio = fmpq_poly(without), fmpq_poly(with_one) - fmpq_poly(without)
    deadbeat = next(k for k in range(constant.degree() + 1) if constant[k] != 0 or ratio[k] != 0)
    return Characteristic(constant.right_shift(deadbeat), ratio.right_shift(deadbeat))


def _sample_matrix(loop: Loop, ratio: Fraction) -> fmpq_mat:
    rest = State()
    size = len(rest.vector) - (1 if loop.lambda_ == 0 else 0)
    columns = [
        sample(loop, ratio, State.of((*rest.vector[:k], _ONE, *rest.vector[k + 1 :]))).vector
        for k in range(size)
    ]
    entries = [rational(columns[j][i]) for i in range(size) for j in range(size)]
    return fmpq_mat(size, size, entries)
