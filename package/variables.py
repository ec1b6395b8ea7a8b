"""The variables of a controller's FMU: one table for its modelDescription.xml and for its C.

Parameters are the fields of the C's configuration, from the table that the header is made from,
widened to FMI's common types: a float to Float64, an exponent to its value. Positions, velocities,
accelerations and torques are in SI units for every controller, fixed-point too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

from codegen.controller import Controller
from codegen.layout import layout
from codegen.structs import Field, Scalar, Struct
from plant.units import units

FIXED_POWER = Struct(
    "tdc_fixed_power",
    "A gain and its power.",
    (
        Field("exponent_q31", Scalar.UINT32, "exponent, in 2^-31"),
        Field("scale_q24", Scalar.INT32, "log2 of the gain in the C's units, in 2^-24"),
    ),
)
"""What of ``tdc_fixed_power`` can be tuned."""


class FmiType(Enum):
    """The types of FMI that a variable may have."""

    FLOAT64 = "Float64"
    INT32 = "Int32"
    UINT32 = "UInt32"


class Role(Enum):
    """Causality and variability in FMI."""

    TIME = ("independent", "continuous")
    INPUT = ("input", "discrete")
    OUTPUT = ("output", "discrete")
    START = ("parameter", "fixed")
    TUNABLE = ("parameter", "tunable")

    @property
    def causality(self) -> str:
        """In FMI's words."""
        return self.value[0]

    @property
    def variability(self) -> str:
        """In FMI's words."""
        return self.value[1]


_FMI_TYPES = {
    Scalar.FLOAT: FmiType.FLOAT64,
    Scalar.DOUBLE: FmiType.FLOAT64,
    Scalar.EXPONENT: FmiType.FLOAT64,
    Scalar.EXPONENT64: FmiType.FLOAT64,
    Scalar.INT32: FmiType.INT32,
    Scalar.UINT32: FmiType.UINT32,
}

# FMI's names of units, by those of the law; gains whose unit hangs on an exponent have none.
UNITS = {
    "s": "s",
    "rad": "rad",
    "rad/s": "rad/s",
    "rad/s^2": "rad/s2",
    "N m": "N.m",
    "kg m^2": "kg.m2",
}


@dataclass(frozen=True)
class Variable:
    """A scalar variable; its value reference is its place in the table.

    Attributes:
        name: in FMI's structured naming, joints counted from 1.
        role: causality and variability.
        stored: how the C keeps it.
        place: its member of the C's structure ``model``.
        doc: a plain sentence.
        unit: as the law writes it, empty for a pure number.
    """

    name: str
    role: Role
    stored: Scalar
    place: str
    doc: str
    unit: str = ""

    @property
    def type(self) -> FmiType:
        """Its type in FMI."""
        return _FMI_TYPES[self.stored]

    @property
    def fmi_unit(self) -> str:
        """Its unit in FMI, empty for one that FMI has no need of."""
        return UNITS.get(self.unit, "")

    @property
    def description(self) -> str:
        """The sentence, with a unit that FMI does not show by itself."""
        hidden = self.unit and not self.fmi_unit
        return f"{self.doc} [{self.unit}]" if hidden else self.doc


def variables(controller: Controller) -> tuple[Variable, ...]:
    """All variables, in the order of their value references."""
    return (
        Variable("time", Role.TIME, Scalar.DOUBLE, "time_s", "simulated time", "s"),
        *_signals(controller),
        Variable(
            "status", Role.OUTPUT, Scalar.INT32, "status", "tdc_status of the last tick; see tdc.h"
        ),
        *_parameters(controller),
    )


def _signals(controller: Controller) -> Iterator[Variable]:
    rows = [
        ("counts", Role.INPUT, Scalar.INT32, "measured position; may wrap", "count"),
        ("reference_position", Role.INPUT, Scalar.DOUBLE, "reference; count 0 is 0 rad", "rad"),
        ("reference_velocity", Role.INPUT, Scalar.DOUBLE, "qd_d(t)", "rad/s"),
        ("reference_acceleration", Role.INPUT, Scalar.DOUBLE, "qdd_d(t)", "rad/s^2"),
    ]
    if controller.options.torque_report:
        doc = "torque that the drive reports for the last tick"
        rows.append(("applied_torque", Role.INPUT, Scalar.DOUBLE, doc, "N m"))
    rows += [
        ("torque", Role.OUTPUT, Scalar.DOUBLE, f"torque{_scaling(controller)}", "N m"),
        ("holding_torque", Role.START, Scalar.DOUBLE, "what holds the robot at the start", "N m"),
    ]
    for name, role, stored, doc, unit in rows:
        for i, joint in enumerate(controller.joints):
            yield Variable(
                f"{name}[{i + 1}]", role, stored, f"{name}[{i}]", f"{joint.name}: {doc}", unit
            )


def _scaling(controller: Controller) -> str:
    per_Nm = units(controller).torque.per_si
    return "" if per_Nm is None else f", the C's integer over {per_Nm:.0f}"


def _parameters(controller: Controller) -> Iterator[Variable]:
    structures = layout(controller)
    for field in structures.config.fields:
        # The identity says which C a configuration is for: it isn't tuned.
        if isinstance(field.type, Scalar) and field.name != "specification":
            yield _parameter(field.name, f"config.{field.name}", field, "")
    for i, joint in enumerate(controller.joints):
        for field in structures.joint_config.fields:
            name, place = f"joint[{i + 1}].{field.name}", f"config.joint[{i}].{field.name}"
            if field.type is not Scalar.FIXED_POWER:
                yield _parameter(name, place, field, f"{joint.name}: ")
                continue
            for part in FIXED_POWER.fields:
                doc = f"{joint.name}: {field.doc}: "
                yield _parameter(f"{name}.{part.name}", f"{place}.{part.name}", part, doc)


def _parameter(name: str, place: str, field: Field, before: str) -> Variable:
    assert isinstance(field.type, Scalar)
    rule = f"; {field.range.value}" if field.range else ""
    doc = f"{before}{field.doc}{rule}"
    return Variable(name, Role.TUNABLE, field.type, place, doc, field.unit)
