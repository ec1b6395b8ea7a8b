"""Flexible joints: a spring and a damper between each motor and its link.

With motor angles theta as joint angles (divided by the gear ratio) and the reflected motor inertia
J (the armature), after M. W. Spong, Modeling and control of elastic joint robots, Journal of
Dynamic Systems, Measurement, and Control 109(4), 1987:

    M(q) qdd + C(q, qd) qd + g(q) = T + external torque
    J thetadd + F(theta, thetad)  = tau - T
    T                             = K (theta - q) + D (thetad - qd)

M is here without the motors. Friction F is that of motor and gear.

The integrator's step of h takes the spring at the end of the step, linearly implicit as friction
is: with v+ = v + h a and x+ = x + h v+ for both sides,

    T+ = T0 + k (thetadd - qdd),    T0 = K (delta + h deltad) + D deltad,    k = h (h K + D)

where delta = theta - q. The motor's equation, J and friction's h D_F together being its rotor,
gives thetadd = (tau - F - T0 + k qdd)/(rotor + k). What is left for the links is their equation
with an armature and a torque of each joint:

    (M + diag(rotor k/(rotor + k))) qdd = T0 + k/(rotor + k) (tau - F - T0) - nle + external

The step is stable for any stiffness, and that of the rigid joint is its limit for K to infinity.
It damps a vibration of w rad/s by a ratio of about w h/2 more than D does: the step must be so
short that this is little.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

Vector = Any
"""An array of floats, shape (n,), or a CasADi SX vector; CasADi has no types."""


class Links(NamedTuple):
    """What the links feel of their motors over one step, after elimination of the motors.

    Attributes:
        armature_kgm2: adds to the inertia matrix's diagonal, shape (n,).
        torque_Nm: at the joints, shape (n,).
    """

    armature_kgm2: Vector
    torque_Nm: Vector


@dataclass(frozen=True, eq=False)
class Flexibility:
    """The springs and dampers of n joints.

    Attributes:
        stiffness_Nm_per_rad: K > 0 at the joint, shape (n,).
        damping_Nms_per_rad: D >= 0 at the joint, shape (n,).
    """

    stiffness_Nm_per_rad: Vector
    damping_Nms_per_rad: Vector

    def twist(self, torque_Nm: Vector) -> Vector:
        """theta - q [rad] at rest, shape (n,), where the springs carry a torque, shape (n,)."""
        return torque_Nm / self.stiffness_Nm_per_rad

    def over_step(self, twist: Vector, rate: Vector, step_s: Any) -> Coupling:
        """The coupling of motors and links over a step.

        Args:
            twist: theta - q [rad] at the beginning, shape (n,).
            rate: thetad - qd [rad/s] at the beginning, shape (n,).
            step_s: h > 0.
        """
        stiffness, damping = self.stiffness_Nm_per_rad, self.damping_Nms_per_rad
        return Coupling(
            torque_Nm=stiffness * (twist + step_s * rate) + damping * rate,
            gain_kgm2=step_s * (step_s * stiffness + damping),
        )


class Coupling(NamedTuple):
    """A spring and damper over one step: T+ = T0 + k (thetadd - qdd).

    Attributes:
        torque_Nm: T0, shape (n,).
        gain_kgm2: k, shape (n,).
    """

    torque_Nm: Vector
    gain_kgm2: Vector

    def links(self, rotor_kgm2: Vector, torque_Nm: Vector) -> Links:
        """What the links feel.

        Args:
            rotor_kgm2: J + h D_F of each motor, shape (n,).
            torque_Nm: tau - F of each motor, shape (n,).
        """
        share = self.gain_kgm2 / (rotor_kgm2 + self.gain_kgm2)
        return Links(share * rotor_kgm2, self.torque_Nm + share * (torque_Nm - self.torque_Nm))

    def motors(self, rotor_kgm2: Vector, torque_Nm: Vector, qdd: Vector) -> Vector:
        """thetadd [rad/s^2], shape (n,), for the links' qdd; other arguments as for the links."""
        free = torque_Nm - self.torque_Nm + self.gain_kgm2 * qdd
        return free / (rotor_kgm2 + self.gain_kgm2)
