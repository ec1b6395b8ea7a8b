"""A plant and a generated controller as one shared library, and a run of them in one call.

The library holds ``loop.c``, the plant's dynamics from CasADi, the controller's own C and an
adapter between them. It has no static state: runs in several threads at once share nothing but
code, and ctypes lets other threads run meanwhile.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codegen.controller import Controller
from codegen.emit import untunable
from codegen.rendering import environment
from plant.closed_loop import (
    Beginning,
    ControllerError,
    Floats,
    Plant,
    PlantError,
    PlantState,
    Run,
    beginning,
    diverged,
    substeps,
)
from plant.compiled.dynamics import Structure, dynamics_c, numbers, structure
from plant.compiled.rigid_body import UnsupportedJointError
from plant.controller import GeneratedController, LayoutError
from plant.native import FLAGS, c_files, library, sources_of
from plant.trajectory import Reference, RestToRest
from plant.units import units

FOLDER = Path(__file__).parent

# CasADi's interface has arguments that straight-line code doesn't use.
_FLAGS = (*FLAGS, "-O3", "-Wno-unused-parameter")

# As in loop.h.
MAX_JOINTS = 32
_CONTROLLER_ERROR, _NOT_FINITE = 1, 2


class _Part(ctypes.Structure):
    """``loop_part``."""

    _fields_ = (("count", ctypes.c_int64), ("step_s", ctypes.c_double))


class _Plant(ctypes.Structure):
    """``loop_plant``."""

    _fields_ = (
        ("joints", ctypes.c_int64),
        ("delay", ctypes.c_double),
        ("before", _Part),
        ("after", _Part),
        *(
            (name, ctypes.c_void_p)
            for name in ("torque_limit_Nm", "counts_per_rad", "phase", "offset_counts", "numbers")
        ),
    )


def _pointers(name: str, *fields: str) -> type[ctypes.Structure]:
    """A structure of nothing but pointers."""
    return type(name, (ctypes.Structure,), {"_fields_": [(f, ctypes.c_void_p) for f in fields]})


_State = _pointers("_State", "q", "qd", "friction", "torque_Nm")
_Record = _pointers(
    "_Record",
    "q",
    "qd",
    "counts",
    "torque_commanded",
    "torque_applied_Nm",
    "friction_Nm",
    "status",
)
_Controller = _pointers("_Controller", "config", "state", "input", "holding_torque")


def _addresses(arrays: Mapping[str, NDArray[Any]]) -> dict[str, int]:
    return {name: array.ctypes.data for name, array in arrays.items()}


def _pointed(
    structure: type[ctypes.Structure], arrays: Mapping[str, NDArray[Any]]
) -> ctypes.Structure:
    """A structure of pointers to arrays, which the caller must keep."""
    return structure(**_addresses(arrays))


def adapter_c(specification: Controller) -> str:
    """The C between ``loop.c`` and a controller's own functions."""
    per_Nm = units(specification).torque.per_si
    return (
        environment(FOLDER)
        .get_template("adapter.c.j2")
        .render(
            name=specification.name,
            joints=len(specification.joints),
            torque=specification.arithmetic.torque,
            torque_per_Nm=repr(1.0 if per_Nm is None else float(per_Nm)),
        )
    )


def structure_of(plant: Plant) -> Structure:
    """The structure of a plant.

    Raises:
        PlantError: the plant has a joint or a number of joints that this backend can't do.
    """
    if plant.joints > MAX_JOINTS:
        raise PlantError(f"{plant.name} has {plant.joints} joints, more than {MAX_JOINTS}")
    try:
        return structure(plant)
    except UnsupportedJointError as error:
        raise PlantError(f"{plant.name}: {error}") from error


def compile_loop(plant: Structure, specification: Controller, sources: Path | None = None) -> Path:
    """The shared library of a plant and a controller, compiled once for each content.

    Args:
        plant: its structure.
        specification: of the controller.
        sources: the folder with its C; generated if not given.

    Raises:
        CompilerError: the compiler is missing or reports an error.
    """
    own = {name: (FOLDER / name).read_bytes() for name in ("loop.c", "loop.h")}
    made = {"adapter.c": adapter_c(specification), "dynamics.c": dynamics_c(plant)}
    controller = c_files(sources or sources_of(specification))
    files = own | {name: text.encode() for name, text in made.items()} | controller
    return library(f"loop-{specification.name}", files, _FLAGS, "-lm")


class CompiledLoop:
    """A plant and a controller's C in one library; many runs may go on at once.

    Args:
        plant: from :func:`plant.closed_loop.build_plant`.
        specification: of the controller.
        sources: the folder with the controller's C; generated if not given.

    Attributes:
        specification: as given.
        path: of the library.

    Raises:
        PlantError: the plant has a joint that this backend can't do, or another number of joints
            than the controller.
        CompilerError: the compiler is missing or reports an error.
    """

    def __init__(
        self, plant: Plant, specification: Controller, sources: Path | None = None
    ) -> None:
        if plant.joints != len(specification.joints):
            raise PlantError(
                f"{plant.name} has {plant.joints} joints, controller {specification.name} "
                f"{len(specification.joints)}"
            )
        self._structure = structure_of(plant)
        self.specification = specification
        self.path = compile_loop(self._structure, specification, sources)
        self._run = ctypes.CDLL(str(self.path)).loop_run

    def controller(self) -> GeneratedController:
        """A controller of the library, with a configuration and a state of its own.

        Far quicker made than one that generates its C first: each of many runs can have one.
        """
        return GeneratedController(self.specification, self.path)

    def run(
        self,
        plant: Plant,
        controller: GeneratedController,
        begin: Beginning,
        sample_time_s: float,
        substep_s: float = 1e-4,
        *,
        reset: bool = True,
    ) -> Run:
        """Runs the controller from a state of the plant on, for as long as the reference lasts.

        Args:
            plant: that of this loop, or one of the same structure with other numbers.
            controller: with its configuration, which is only read, and its state, which is left
                as the last tick leaves it. Runs at the same time need one each.
            begin: the first state and the reference.
            sample_time_s: L.
            substep_s: longest step of the integrator.
            reset: whether the controller is switched on; else it goes on from its state, as in
                :func:`plant.closed_loop.run_from`.

        Raises:
            ControllerError: the controller reported an error.
            PlantError: the motion became non-finite; or the plant is of another structure, or
                something hasn't as many numbers as there are joints.
            LayoutError: the controller is another one.
        """
        if structure_of(plant) != self._structure:
            raise PlantError(f"{plant.name} has another structure than the compiled plant")
        if untunable(controller.specification) != untunable(self.specification):
            raise LayoutError(
                f"the loop was compiled for another controller than {controller.specification.name}"
            )
        if begin.reference.position_rad.shape[1] != plant.joints:
            raise PlantError(f"the reference is not for the {plant.joints} joints of {plant.name}")
        record = _record(begin.reference, controller)
        state = _state(begin)
        inputs = controller.inputs(
            begin.reference.position_rad + plant.encoder.zero_rad,
            begin.reference.velocity_rad_per_s,
            begin.reference.acceleration_rad_per_s2,
        )
        held = controller.holding_torque(begin.torque_Nm)
        arrays = _arrays(plant)
        tick, status = ctypes.c_int64(), ctypes.c_int64()
        end = self._run(
            ctypes.byref(_plant(plant, arrays, sample_time_s, substep_s)),
            ctypes.byref(_pointed(_State, state)),
            ctypes.byref(
                _Controller(
                    ctypes.addressof(controller.config),
                    ctypes.addressof(controller.state),
                    inputs.ctypes.data,
                    ctypes.addressof(held) if reset else None,
                )
            ),
            ctypes.byref(_pointed(_Record, record)),
            ctypes.c_int64(len(inputs)),
            ctypes.byref(tick),
            ctypes.byref(status),
        )
        if end == _CONTROLLER_ERROR:
            raise ControllerError(tick.value, status.value)
        if end == _NOT_FINITE:
            raise diverged(plant, tick.value)
        return _told(plant, controller, begin.reference, record, state, sample_time_s)


def _arrays(plant: Plant) -> dict[str, NDArray[Any]]:
    """The plant's numbers by their names in ``loop_plant``."""
    doubles = {
        "torque_limit_Nm": plant.drive.torque_limit_Nm,
        "counts_per_rad": plant.encoder.counts_per_rad,
        "phase": plant.encoder.phase,
    }
    arrays = {name: _vector(x, plant.joints) for name, x in doubles.items()}
    _vector(plant.encoder.offset_counts, plant.joints)
    offset = np.array(plant.encoder.offset_counts, dtype=np.int64)
    return arrays | {"numbers": numbers(plant), "offset_counts": offset}


def _vector(values: ArrayLike, joints: int) -> Floats:
    """A copy for the C, which reads one number a joint whether it is there or not."""
    made = np.array(values, dtype=np.float64)
    if made.shape != (joints,):
        raise PlantError(f"{joints} numbers are needed, one a joint, not shape {made.shape}")
    return made


def _plant(
    plant: Plant, arrays: Mapping[str, NDArray[Any]], sample_time_s: float, substep_s: float
) -> _Plant:
    """The plant for the C; the caller must keep the arrays."""
    delay, parts = plant.drive.delay, []
    for duration in (delay * sample_time_s, (1.0 - delay) * sample_time_s):
        count = substeps(duration, substep_s)
        parts.append(_Part(count, duration / count if count else 0.0))
    return _Plant(plant.joints, delay, *parts, **_addresses(arrays))


def _told(
    plant: Plant,
    controller: GeneratedController,
    reference: Reference,
    record: Mapping[str, NDArray[Any]],
    state: Mapping[str, NDArray[Any]],
    sample_time_s: float,
) -> Run:
    """The record as a run."""
    return Run(
        sample_time_s=sample_time_s,
        time_s=reference.time_s,
        q=record["q"],
        qd=record["qd"],
        q_ref=reference.position_rad,
        qd_ref=reference.velocity_rad_per_s,
        qdd_ref=reference.acceleration_rad_per_s2,
        counts=record["counts"],
        q_encoder=plant.encoder.positions_rad(record["counts"]),
        torque_commanded_Nm=controller.units.torque.physical(record["torque_commanded"]),
        torque_applied_Nm=record["torque_applied_Nm"],
        friction_Nm=record["friction_Nm"],
        status=record["status"],
        end=PlantState(state["q"], state["qd"], state["friction"].tolist()),
    )


def _record(reference: Reference, controller: GeneratedController) -> dict[str, NDArray[Any]]:
    """Room for what happens."""
    shape = reference.position_rad.shape
    doubles = ("q", "qd", "torque_applied_Nm", "friction_Nm")
    return {name: np.zeros(shape) for name in doubles} | {
        "counts": np.zeros(shape, dtype=np.int32),
        "torque_commanded": np.zeros(shape, dtype=controller.types.torque),
        "status": np.zeros(shape[0], dtype=np.int64),
    }


def _state(begin: Beginning) -> dict[str, NDArray[Any]]:
    """A copy of the state, for the C to work on."""
    state = begin.state
    parts: dict[str, ArrayLike] = {
        "q": state.q,
        "qd": state.qd,
        "friction": state.friction,
        "torque_Nm": begin.torque_Nm,
    }
    joints = begin.reference.position_rad.shape[1]
    return {name: _vector(part, joints) for name, part in parts.items()}


def simulate(
    plant: Plant,
    controller: GeneratedController,
    trajectory: RestToRest,
    sample_time_s: float,
    substep_s: float = 1e-4,
    progress: bool | None = None,  # noqa: ARG001 - the interface of plant.closed_loop.simulate
) -> Run:
    """Runs a generated controller on a plant, as :func:`plant.closed_loop.simulate` does.

    Both have one meaning but not the same bits: the rigid-body algorithms round in another order.

    Args:
        plant: from :func:`plant.closed_loop.build_plant`.
        controller: made from sources, not from a library; is reset first.
        trajectory: the reference motion; the run is as long as it.
        sample_time_s: L.
        substep_s: longest step of the integrator.
        progress: there is none.

    Raises:
        ControllerError: the controller reported an error.
        PlantError: as there; or a joint that this backend doesn't know, or a controller without
            sources.
        CompilerError: the compiler is missing or reports an error.
    """
    if controller.sources is None:
        raise PlantError(
            f"controller {controller.specification.name} is a library without its C: the compiled "
            "backend needs the C"
        )
    begin = beginning(plant, trajectory, sample_time_s)
    loop = CompiledLoop(plant, controller.specification, controller.sources)
    return loop.run(plant, controller, begin, sample_time_s, substep_s)
