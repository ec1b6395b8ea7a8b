"""The units of a generated controller's signals: what it is given, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.controller import Controller
from codegen.fixed_point import formats


@dataclass(frozen=True)
class Unit:
    """How a signal is stored in one field of the interface.

    Attributes:
        field: its name in C.
        per_si: stored units of one SI unit, shape (n,) or (); None where it is stored in SI units.
    """

    field: str
    per_si: NDArray[np.float64] | None

    def stored(self, value: NDArray[np.float64]) -> NDArray[Any]:
        """SI units as the C takes them; integers are rounded to nearest and kept in 32 bits."""
        if self.per_si is None:
            return np.asarray(value)
        rounded = np.rint(value * self.per_si)
        return np.clip(rounded, -(2**31), 2**31 - 1).astype(np.int64)

    def physical(self, stored: NDArray[Any]) -> NDArray[np.floating[Any]]:
        """What the C answers in SI units."""
        return stored if self.per_si is None else stored / self.per_si


@dataclass(frozen=True)
class Units:
    """The units of all signals but positions, which are counts in every controller."""

    velocity: Unit
    acceleration: Unit
    torque: Unit


def units(controller: Controller) -> Units:
    """The units of a controller's interface."""
    if controller.arithmetic.kind == "floating-point":
        return Units(
            Unit("reference_velocity_rad_per_s", None),
            Unit("reference_acceleration_rad_per_s2", None),
            Unit("applied_torque_Nm", None),
        )
    chosen = formats(controller)
    counts_per_rad = np.array([1.0 / joint.rad_per_count for joint in controller.joints])
    tick = float(controller.sample_time)
    motion = counts_per_rad * 2.0**chosen.fraction_bits
    return Units(
        Unit("reference_velocity_q", motion * tick),
        Unit("reference_acceleration_q", motion * tick**2),
        Unit("applied_torque_q", np.array(2.0**chosen.torque_bits)),
    )
