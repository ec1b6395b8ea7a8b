"""Proofs of the error dynamics, the sampled law and the workspace, as the report shows them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, get_args

from codegen.controller import Controller, load
from codegen.law import AccelerationEstimate
from plant.robot import load_robot
from verification.energy.audit import RowEnergy, fly_rows
from verification.energy.present import PICTURED
from verification.energy.present import figures as figures_of_energy
from verification.error_dynamics.analysis import ErrorDynamics, analyse
from verification.error_dynamics.command import ENDS, LOOKS
from verification.error_dynamics.model import FINITE_TIME
from verification.experiments import CONTROLLERS
from verification.sampled_stability.intervals import Interval, stable_intervals
from verification.sampled_stability.loop import Loop
from verification.tuning_check.check import TuningCheck, on_plant
from verification.tuning_check.present import figures as figures_of_check
from verification.workspace.certify import Certified, certified_eigenvalues

KD, KP, LAMBDA = 20, 100, 20
"""Of Table II."""
ALPHAS = ("0.98", "0.95", "0.8", "0.6", "0.5")
CHECKED = (("puma3", "reference"), ("puma3", "reference_flexible"))
ARMS = (("reference", "puma3", False), ("puma560", "puma3", True), ("puma560", "puma6", False))
"""Robot, the controller whose Mbar it is, and whether the wrist is locked."""
STEPS = len(ALPHAS) + len(CHECKED) + len(ARMS) + len(PICTURED) + 1


@dataclass(frozen=True)
class Settling:
    """The desired error dynamics (17) with beta = alpha/(2 - alpha)."""

    alpha: str
    dynamics: ErrorDynamics

    @property
    def ends(self) -> str:
        """How the error ends, in words."""
        return ENDS[self.dynamics.kind]

    @property
    def looks(self) -> str:
        """What the origin looks like in the phase plane, in words."""
        return LOOKS[self.dynamics.equilibrium] if self.dynamics.equilibrium else "–"


@dataclass(frozen=True)
class Sampled:
    """For which Mbar/M the linear sampled law is stable."""

    acceleration: str
    compute_delay: int
    lambda_: int
    intervals: tuple[Interval, ...]


@dataclass(frozen=True)
class Arm:
    """Eigenvalues of M(q)^-1 Mbar over a robot's whole workspace."""

    robot: str
    controller: str
    joints: int
    eigenvalues: Certified


@dataclass(frozen=True, eq=False)
class Certificates:
    """What is proved of gains, and the energy along the closed loop beside it.

    Attributes:
        settling: by alpha.
        sampled: by acceleration estimate, delay and lambda.
        arms: with their eigenvalues.
        checks: of shipped gains on plants.
        energy: of rows of Table II on the reference plant.
    """

    settling: tuple[Settling, ...]
    sampled: tuple[Sampled, ...]
    arms: tuple[Arm, ...]
    checks: tuple[TuningCheck, ...]
    energy: tuple[RowEnergy, ...]

    @property
    def hold(self) -> bool:
        """Whether every checker agreed."""
        settled = all(s.dynamics.evidence == "proved" for s in self.settling)
        return settled and all(arm.eigenvalues.proved for arm in self.arms)


def found(advance: Callable[[], None] = lambda: None) -> Certificates:
    """All of it, made and checked anew, which takes about twenty seconds.

    Args:
        advance: called :data:`STEPS` times.
    """

    def told(value: Any) -> Any:
        advance()
        return value

    settling = tuple(told(Settling(a, analyse(KD, KP, a, FINITE_TIME))) for a in ALPHAS)
    sampled = told(tuple(_sampled()))
    arms = tuple(told(_arm(*arm)) for arm in ARMS)
    checks = tuple(told(on_plant(_controller(c), load_robot(robot))) for c, robot in CHECKED)
    return Certificates(settling, sampled, arms, checks, fly_rows(PICTURED, advance))


def _controller(name: str) -> Controller:
    return load(CONTROLLERS / f"{name}.toml")


def _sampled() -> list[Sampled]:
    made = []
    for acceleration in get_args(AccelerationEstimate):
        for delay in (0, 1):
            for lambda_ in (0, LAMBDA):
                loop = Loop(
                    Fraction(KD),
                    Fraction(KP),
                    Fraction(lambda_),
                    Fraction(1, 1000),
                    acceleration=acceleration,
                    compute_delay=delay,
                )
                made.append(Sampled(acceleration, delay, lambda_, stable_intervals(loop)))
    return made


def _arm(name: str, controller: str, lock_wrist: bool) -> Arm:
    robot = load_robot(name, lock_wrist=lock_wrist)
    inertia = [joint.inertia for joint in _controller(controller).joints]
    return Arm(name, controller, robot.joints, certified_eigenvalues(robot, inertia))


def as_json(certificates: Certificates) -> dict[str, Any]:
    """The same as plain data."""
    return {
        "error_dynamics": [s.dynamics.summary() for s in certificates.settling],
        "sampled": [
            {
                "acceleration": s.acceleration,
                "compute_delay": s.compute_delay,
                "lambda": s.lambda_,
                "intervals": _ends(s.intervals),
            }
            for s in certificates.sampled
        ],
        "workspace": [
            {
                "robot": arm.robot,
                "controller": arm.controller,
                "joints": arm.joints,
                "eigenvalues": [float(arm.eigenvalues.low), float(arm.eigenvalues.high)],
                "largest_scaling": float(arm.eigenvalues.largest_scaling),
                "tight": arm.eigenvalues.tight,
                "proved": arm.eigenvalues.proved,
                "boxes": arm.eigenvalues.boxes,
            }
            for arm in certificates.arms
        ],
        "tuning_checks": [figures_of_check(check) for check in certificates.checks],
        "energy": figures_of_energy(certificates.energy),
    }


def _ends(intervals: Sequence[Interval]) -> list[list[float]]:
    return [[float(i.low), float(i.high)] for i in intervals]
