"""What a specification alone says of a joint.

The law is linear only for alpha = beta = gamma = 1, and so is what the intervals are proved of.
Where errors are as small as the encoder shows them, sig(x)^a with a < 1 acts like a gain of
|x|^(a-1), which is largest at one count: at one count of position, delta, and one count a tick of
speed, delta/L, the law is as steep as the linear one with

    KD (delta/L)^(alpha-1),    KP delta^(beta-1),    lambda (delta/L)^(gamma-1).

If that one is not stable, the encoder's grain can feed an oscillation. It is a rule of thumb (one
amplitude of a describing function), no proof.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from codegen.controller import Controller, Joint
from verification.error_dynamics.analysis import ErrorDynamics, analyse
from verification.error_dynamics.model import ErrorDynamicsError
from verification.sampled_stability import check, intervals
from verification.sampled_stability.intervals import Analysis, Interval
from verification.sampled_stability.loop import Loop

Floats = NDArray[np.float64]

_GRAIN_DIGITS = 6
"""Of the gains at one count, which are exact for no encoder."""


@dataclass(frozen=True)
class Timing:
    """How late a torque acts.

    Attributes:
        compute_delay: whole samples from reading the encoder to commanding the torque, 0 or 1.
        torque_delay: further time until the command acts, as a fraction of L in [0, 1].
    """

    compute_delay: int = 0
    torque_delay: Fraction = Fraction(0)


@dataclass(frozen=True)
class Sampled:
    """For which r = Mbar/M the sampled law is stable; rigid joints, see `sampled-interval`.

    Attributes:
        loop: the linear one.
        analysis: of the loop.
        proved: whether the independent checker verified the intervals.
        at_one_count: the intervals of the linear law that is as steep as this one at one count of
            the encoder: a rule of thumb. Those of the loop where the law is linear.
    """

    loop: Loop
    analysis: Analysis
    proved: bool
    at_one_count: tuple[Interval, ...]

    @property
    def intervals(self) -> tuple[Interval, ...]:
        """Stable, in ascending order; none where no Mbar is."""
        return self.analysis.intervals


@dataclass(frozen=True)
class Noise:
    """What the encoder's counts alone do to a joint's torque [N m].

    A reading is off by up to half a count, and its second difference up to two counts; but tau =
    tau(t-L) - Mbar qdd(t-L) + ... adds second differences up, and what is left of their errors is
    a first difference: at most one count, with a variance of 2/12 of its square.

    Attributes:
        worst_Nm: Mbar delta/L^2, of one count; with a low-pass (43) times w'/(1+w').
        limit_Nm: of the torque.
    """

    worst_Nm: float
    limit_Nm: float

    @property
    def rms_Nm(self) -> float:  # noqa: N802 - the unit
        """Root mean square, of errors that are uniform in a count and independent."""
        return self.worst_Nm / math.sqrt(6.0)

    @property
    def worst_step_Nm(self) -> float:  # noqa: N802 - the unit
        """From one tick to the next: a second difference."""
        return 2.0 * self.worst_Nm

    @property
    def rms_step_Nm(self) -> float:  # noqa: N802 - the unit
        """Its root mean square, 1/2 being the variance of a second difference."""
        return self.worst_Nm / math.sqrt(2.0)

    @property
    def share(self) -> float:
        """The worst over the limit."""
        return self.worst_Nm / self.limit_Nm


@dataclass(frozen=True)
class Specified:
    """A joint as far as its specification alone says.

    Attributes:
        joint: its exact numbers.
        dynamics: the desired error dynamics; None where there is none that brings the error back.
        no_dynamics: why.
        sampled: stability of the sampled law.
        noise: of the encoder.
    """

    joint: Joint
    dynamics: ErrorDynamics | None
    no_dynamics: str | None
    sampled: Sampled
    noise: Noise

    @property
    def resolution_rad(self) -> float:
        """Joint angle of one count."""
        return abs(self.joint.rad_per_count)


def specified(
    controller: Controller, timing: Timing, *, resolution_rad: Fraction | None = None
) -> tuple[Specified, ...]:
    """All joints of a controller.

    Args:
        controller: the specification.
        timing: how late a torque acts.
        resolution_rad: to which the settling time is told; each joint's own encoder's by default.
    """
    return tuple(_specified(controller, j, timing, resolution_rad) for j in controller.joints)


def _specified(
    controller: Controller, joint: Joint, timing: Timing, resolution_rad: Fraction | None
) -> Specified:
    count = abs(joint.rad_per_count)
    dynamics, problem = _dynamics(
        joint.kd, joint.kp, joint.alpha, joint.beta, resolution_rad or Fraction(repr(count))
    )
    loop = Loop(
        joint.kd,
        joint.kp,
        joint.lambda_,
        controller.sample_time,
        controller.options.acceleration,
        controller.options.velocity_error,
        timing.compute_delay,
        timing.torque_delay,
        controller.low_pass_ratio,
        controller.options.torque_report,
    )
    low_pass = 1.0 if controller.low_pass_ratio is None else float(controller.low_pass_ratio)
    worst = low_pass * float(joint.inertia) * count / float(controller.sample_time) ** 2
    return Specified(
        joint,
        dynamics,
        problem,
        _sampled(loop, at_one_count(joint, loop)),
        Noise(worst, float(joint.torque_limit)),
    )


def at_one_count(joint: Joint, loop: Loop) -> Loop:
    """The linear loop that is as steep as the law at one count of the encoder."""
    count = abs(joint.rad_per_count)
    speed = count / float(loop.sample_time_s)
    return replace(
        loop,
        kd=_steepness(joint.kd, speed, joint.alpha),
        kp=_steepness(joint.kp, count, joint.beta),
        lambda_=_steepness(joint.lambda_, speed, joint.gamma),
    )


def _steepness(gain: Fraction, x: float, exponent: Fraction) -> Fraction:
    """gain |x|^(exponent - 1), the chord of gain sig(x)^exponent."""
    if exponent == 1:
        return gain
    return Fraction(f"{float(gain) * x ** (float(exponent) - 1.0):.{_GRAIN_DIGITS}g}")


# Joints often have the same gains, and exact answers take their time.
@functools.cache
def _dynamics(
    KD: Fraction, KP: Fraction, alpha: Fraction, beta: Fraction, resolution_rad: Fraction
) -> tuple[ErrorDynamics | None, str | None]:
    try:
        return analyse(KD, KP, alpha, beta, resolution_rad=resolution_rad), None
    except ErrorDynamicsError as error:
        return None, str(error)


@functools.cache
def _sampled(loop: Loop, steepest: Loop) -> Sampled:
    analysis = _analysis(loop)
    complaints = list(check.complaints(intervals.certificate(analysis)))
    return Sampled(loop, analysis, not complaints, _analysis(steepest).intervals)


@functools.cache
def _analysis(loop: Loop) -> Analysis:
    return intervals.analyse(loop)
