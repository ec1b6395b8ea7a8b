"""The gains that are tuned, as exact numbers that a specification can hold."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from decimal import Decimal
from fractions import Fraction
from typing import Any

from codegen.controller import Controller


class TuningError(ValueError):
    """A tuning that can't be done or written; the message says why and what to do."""


@dataclass(frozen=True)
class Gains:
    """What the procedure III-E tunes. beta follows from alpha by (35); KD and KP stay.

    As in the paper, Mbar is tuned for each joint, the others are common to all.

    Attributes:
        inertia: Mbar [kg m^2], one a joint.
        lambda_: of the correction (31).
        gamma: exponent of the sliding variable.
        alpha: exponent of the velocity error, at most 1.
    """

    inertia: tuple[Fraction, ...]
    lambda_: Fraction = Fraction(0)
    gamma: Fraction = Fraction(1)
    alpha: Fraction = Fraction(1)

    @property
    def beta(self) -> Fraction:
        """alpha/(2 - alpha) (35), which is 1 for the linear error dynamics."""
        return self.alpha / (2 - self.alpha)

    def of(self, controller: Controller) -> Controller:
        """The controller with these gains."""
        joints = [
            replace(
                joint,
                inertia=inertia,
                lambda_=self.lambda_,
                gamma=self.gamma,
                alpha=self.alpha,
                beta=self.beta,
            )
            for joint, inertia in zip(controller.joints, self.inertia, strict=True)
        ]
        return replace(controller, joints=tuple(joints))

    def plain(self) -> dict[str, Any]:
        """As plain data, Mbar a list."""
        numbers = {f.name.rstrip("_"): getattr(self, f.name) for f in fields(self)}
        inertia = [float(x) for x in numbers.pop("inertia")]
        return {"inertia_kgm2": inertia} | {key: float(x) for key, x in numbers.items()}


def rounded(value: float | Fraction, digits: int = 4) -> Fraction:
    """The value to so many significant digits: exact, and short in a file."""
    return Fraction(Decimal(f"{float(value):.{digits}g}"))


def decimal(value: Fraction) -> str:
    """An exact number as a specification writes it, a fraction where no decimal ends."""
    written = f"{float(value):.12g}"
    if "e" not in written and Fraction(written) == value:
        return written
    return f'"{value}"'
