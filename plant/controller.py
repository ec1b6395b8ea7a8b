"""The generated C through ctypes: the controller that flies in the closed loop is the shipped one.

The structures are built from :mod:`codegen.layout`, the same table that the C header is made
from; no layout is typed here.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.controller import Controller
from codegen.emit import identity, untunable
from codegen.floating_point import FieldValue
from codegen.layout import joint_config_values, layout
from codegen.status import Status
from codegen.structs import Scalar, Struct
from plant.closed_loop import ControllerOutput
from plant.native import shared_library, sources_of
from plant.units import units

OK, SATURATED = Status.OK, Status.SATURATED


class FixedPower(ctypes.Structure):
    """``tdc_fixed_power``: an exponent in Q31 and a gain's logarithm in Q24."""

    _fields_ = (("exponent_q31", ctypes.c_uint32), ("scale_q24", ctypes.c_int32))


class Exponent64(ctypes.Structure):
    """``tdc_exponent64``: a - 1 as the sum of two doubles."""

    _fields_ = (("high", ctypes.c_double), ("low", ctypes.c_double))


_C_TYPES: dict[Scalar, Any] = {
    Scalar.FLOAT: ctypes.c_float,
    Scalar.DOUBLE: ctypes.c_double,
    Scalar.INT32: ctypes.c_int32,
    Scalar.UINT32: ctypes.c_uint32,
    # A structure of one int32_t lies in memory like the int32_t.
    Scalar.EXPONENT: ctypes.c_int32,
    Scalar.EXPONENT64: Exponent64,
    Scalar.FIXED_POWER: FixedPower,
}


class LayoutError(Exception):
    """The library was not made for this specification."""


@dataclass(frozen=True)
class Structures:
    """The ctypes structures of a controller."""

    config: type[ctypes.Structure]
    state: type[ctypes.Structure]
    input: type[ctypes.Structure]
    torque: Any


def structures(controller: Controller) -> Structures:
    """The ctypes structures that lie in memory like the generated C's."""
    made: dict[str, type[ctypes.Structure]] = {}

    def c_type(kind: Scalar | Struct) -> Any:
        return _C_TYPES[kind] if isinstance(kind, Scalar) else made[kind.name]

    joints = layout(controller)
    for struct in joints.public:
        fields = [
            (f.name, c_type(f.type) * f.count if f.count is not None else c_type(f.type))
            for f in struct.fields
        ]
        made[struct.name] = type(struct.name, (ctypes.Structure,), {"_fields_": fields})
    return Structures(
        made["config"], made["state"], made["input"], _C_TYPES[Scalar(controller.arithmetic.torque)]
    )


class GeneratedController:
    """A controller's compiled C with its own configuration and state.

    Fulfils :class:`plant.closed_loop.Controller`.

    Args:
        controller: the specification that the C was generated from.
        library: the compiled C; generated and compiled if not given.

    Attributes:
        specification: as given.
        sources: the folder with its C; None where a library was given.
        config: the running configuration, as the C reads it.
        state: as the C keeps it.
        input: of the last tick.
        types: its structures.
        units: what its numbers mean.

    Raises:
        LayoutError: the library holds another specification's controller.
    """

    def __init__(self, controller: Controller, library: Path | None = None) -> None:
        self.specification = controller
        self.sources = sources_of(controller) if library is None else None
        compiled = library if self.sources is None else shared_library(self.sources)
        self._library = ctypes.CDLL(str(compiled))
        self.types = structures(controller)
        prefix = f"tdc_{controller.name}"
        try:
            self._init = self._library[f"{prefix}_init"]
            self._step = self._library[f"{prefix}_step"]
            self._check_config = self._library[f"{prefix}_check_config"]
            default = self.types.config.in_dll(self._library, f"{prefix}_default_config")
        except (AttributeError, ValueError) as error:
            raise LayoutError(f"{library}: no controller {controller.name} in it") from error
        self.config = self.types.config.from_buffer_copy(default)
        self.state = self.types.state()
        self.input = self.types.input()
        self._torque = (self.types.torque * len(controller.joints))()
        self._pointers = tuple(
            ctypes.byref(x) for x in (self.config, self.state, self.input, self._torque)
        )
        # The default configuration of the library, read through our layout, must be ours.
        if self.config.specification != identity(controller) or not self._has_gains(controller):
            raise LayoutError(
                f"the compiled controller {controller.name} was made from another specification: "
                "run `make codegen` and compile again"
            )
        self._counts_per_rad = np.array([1.0 / j.rad_per_count for j in controller.joints])
        self.units = units(controller)

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.specification.joints)

    @property
    def torque(self) -> NDArray[Any]:
        """What the last step wrote, as it stands in memory: in the C's own numbers and unit."""
        return np.array(self._torque)

    @property
    def last_memory(self) -> tuple[ctypes.Structure, ...]:
        """What each joint remembers of the last tick: its ``joint_state`` in the state."""
        return tuple(joint.tick[self.state.phase & 1] for joint in self.state.joint)

    def _has_gains(self, controller: Controller) -> bool:
        return all(
            _value(self.config.joint[i], name) == value
            for i, joint in enumerate(controller.joints)
            for name, value in joint_config_values(controller, joint).items()
        )

    def set_gains(self, controller: Controller) -> None:
        """Tunes the running configuration to another specification's gains.

        Raises:
            LayoutError: that specification differs in more than gains.
        """
        if untunable(controller) != untunable(self.specification):
            raise LayoutError("only gains and exponents can be tuned without new C")
        for i, joint in enumerate(controller.joints):
            for name, value in joint_config_values(self.specification, joint).items():
                setattr(self.config.joint[i], name, value)

    def check_config(self) -> int:
        """The status of ``tdc_NAME_check_config`` on the running configuration."""
        return int(self._check_config(self._pointers[0]))

    def reset(
        self,
        counts: NDArray[np.int32],
        holding_torque_Nm: NDArray[np.float64],
    ) -> int:
        """Calls ``tdc_NAME_init``; returns its status."""
        c_counts = (ctypes.c_int32 * self.joints)(*map(int, counts))
        c_torque = self.holding_torque(holding_torque_Nm)
        return int(self._init(*self._pointers[:2], c_counts, c_torque))

    def holding_torque(self, torque_Nm: NDArray[np.float64]) -> ctypes.Array[Any]:
        """A holding torque, shape (n,), as ``tdc_NAME_init`` takes it."""
        stored = self.units.torque.stored(torque_Nm)
        array: ctypes.Array[Any] = (self.types.torque * self.joints)(*stored.tolist())
        return array

    def inputs(
        self,
        position_rad: NDArray[np.float64],
        velocity_rad_per_s: NDArray[np.float64],
        acceleration_rad_per_s2: NDArray[np.float64],
    ) -> NDArray[np.void]:
        """The input structures of many ticks, as :meth:`step` fills them, with counts of 0.

        Args:
            position_rad: see :meth:`step`; here and below of shape (ticks, n).
            velocity_rad_per_s: reference.
            acceleration_rad_per_s2: reference.

        Returns:
            An array of the C's structures, shape (ticks,).
        """
        made = np.zeros(len(position_rad), dtype=np.dtype(self.types.input))
        made["reference_position_q8"] = self.position_q8(position_rad)
        made[self.units.velocity.field] = self.units.velocity.stored(velocity_rad_per_s)
        acceleration = self.units.acceleration
        made[acceleration.field] = acceleration.stored(acceleration_rad_per_s2)
        return made

    def position_q8(self, position_rad: NDArray[np.float64]) -> NDArray[np.int32]:
        """Joint positions, shape (n,) or (ticks, n), in 1/256 count, wrapped to 32 bits."""
        q8 = np.rint(position_rad * self._counts_per_rad * 256.0).astype(np.int64)
        wrapped: NDArray[np.int32] = q8.astype(np.uint32).astype(np.int32)
        return wrapped

    def step(
        self,
        counts: NDArray[np.int32],
        position_rad: NDArray[np.float64],
        velocity_rad_per_s: NDArray[np.float64],
        acceleration_rad_per_s2: NDArray[np.float64],
    ) -> ControllerOutput:
        """One tick of ``tdc_NAME_step``; all arguments have shape (n,)."""
        given, units = self.input, self.units
        given.counts[:] = counts.tolist()
        given.reference_position_q8[:] = self.position_q8(position_rad).tolist()
        for unit, value in (
            (units.velocity, velocity_rad_per_s),
            (units.acceleration, acceleration_rad_per_s2),
        ):
            getattr(given, unit.field)[:] = unit.stored(value).tolist()
        status = int(self._step(*self._pointers))
        return ControllerOutput(units.torque.physical(self.torque), status)

    def step_raw(self, given: bytes) -> int:
        """One tick with the bytes of an input structure; returns the status of the C."""
        ctypes.memmove(self._pointers[2], given, ctypes.sizeof(self.types.input))
        return int(self._step(*self._pointers))


def _value(struct: ctypes.Structure, name: str) -> FieldValue:
    """A field's value as `codegen.layout.joint_config_values` gives it."""
    value = getattr(struct, name)
    if isinstance(value, ctypes.Structure):
        return tuple(getattr(value, field[0]) for field in value._fields_)
    number: float | int = value
    return number
