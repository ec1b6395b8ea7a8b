"""A plant and a generated controller as one shared library, and a run of them in one call.

The library holds ``loop.c``, the plant's dynamics from CasADi, the controller's own C and an
adapter between them. It has no static state: runs in several threads at once share nothing but
code, and ctypes lets other threads run meanwhile.
"""

from __future__ import annotations

import ctypes
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from codegen.controller import Controller
from codegen.emit import untunable
from codegen.rendering import environment
from plant.assembly import Floats, Plant, PlantError, PlantState
from plant.closed_loop import (
    ENDED_BY,
    NOT_CALLED,
    Beginning,
    ControllerError,
    Events,
    Run,
    beginning,
    diverged,
)
from plant.compiled.dynamics import Structure, dynamics_c, numbers, structure
from plant.compiled.rigid_body import UnsupportedJointError
from plant.controller import GeneratedController, LayoutError
from plant.encoder import Encoder
from plant.integrator import substeps
from plant.native import FLAGS, c_files, library, sources_of
from plant.script import Script, uneventful
from plant.trajectory import Reference, RestToRest
from plant.units import units

FOLDER = Path(__file__).parent

# CasADi's interface has arguments that straight-line code doesn't use.
_FLAGS = (*FLAGS, "-O3", "-Wno-unused-parameter")

# As in loop.h.
MAX_JOINTS = 32
_CONTROLLER_ERROR, _NOT_FINITE = 1, 2


class LoopPart(ctypes.Structure):
    """``loop_part``."""

    _fields_ = (
        ("share", ctypes.c_double),
        ("count", ctypes.c_int64),
        ("step_s", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("decay", "mean", "mean_of_all")),
    )


class LoopTiming(ctypes.Structure):
    """``loop_timing``."""

    _fields_ = (("late", LoopPart), ("delayed", LoopPart), ("prompt", LoopPart))


class LoopPlant(ctypes.Structure):
    """``loop_plant``."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("joints", "coordinates", "read_from")),
        *((name, ctypes.c_void_p) for name in ("counts_per_rad", "phase", "offset_counts")),
    )


class LoopScript(ctypes.Structure):
    """``loop_script``."""

    _fields_ = (
        *(
            (name, ctypes.c_void_p)
            for name in (
                "timings",
                "timing",
                "called",
                "reading",
                "noise_counts",
                "shift_counts",
                "torque_share",
                "torque_limit_Nm",
                "external_Nm",
                "numbers",
            )
        ),
        ("numbers_count", ctypes.c_int64),
        ("model", ctypes.c_void_p),
    )


def _pointers(name: str, *fields: str) -> type[ctypes.Structure]:
    """A structure of nothing but pointers."""
    return type(name, (ctypes.Structure,), {"_fields_": [(f, ctypes.c_void_p) for f in fields]})


LoopState = _pointers("LoopState", "q", "qd", "friction", "command_Nm", "torque_Nm")
LoopRecord = _pointers(
    "LoopRecord",
    "q",
    "qd",
    "counts",
    "torque_commanded",
    "torque_applied_Nm",
    "friction_Nm",
    "status",
)


class LoopController(ctypes.Structure):
    """``loop_controller``."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("config", "state", "input", "holding_torque")),
        ("ends", ctypes.c_void_p),
        ("ends_count", ctypes.c_int64),
    )


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


def structure_of(plant: Plant, models: Sequence[pin.Model] = ()) -> Structure:
    """The structure of a plant, which other rigid bodies may share.

    Raises:
        PlantError: the plant has a joint or a number of joints that this backend can't do.
    """
    if plant.joints > MAX_JOINTS:
        raise PlantError(f"{plant.name} has {plant.joints} joints, more than {MAX_JOINTS}")
    try:
        return structure(plant, models)
    except UnsupportedJointError as error:
        raise PlantError(f"{plant.name}: {error}") from error


def compile_loop(
    plant: Structure,
    specification: Controller,
    sources: Path | None = None,
    libm: Path | None = None,
) -> Path:
    """The shared library of a plant and a controller, compiled once for each content.

    Args:
        plant: its structure.
        specification: of the controller.
        sources: the folder with its C; generated if not given.
        libm: a static library with the sines and exponentials, in place of the system's.

    Raises:
        CompilerError: the compiler is missing or reports an error.
    """
    files = loop_files(plant, specification, sources)
    name = f"loop-{specification.name}"
    if libm is None:
        return library(name, files, _FLAGS, "-lm")
    # Without the flag the dynamic linker would take the functions of the system's libm after all.
    return library(name, files, (*_FLAGS, "-Wl,-Bsymbolic"), str(libm))


def loop_files(
    plant: Structure, specification: Controller, sources: Path | None = None
) -> dict[str, bytes]:
    """All C of a plant and a controller in closed loop, by file name; arguments as above."""
    own = {name: (FOLDER / name).read_bytes() for name in ("loop.c", "loop.h")}
    made = {"adapter.c": adapter_c(specification), "dynamics.c": dynamics_c(plant)}
    controller = c_files(sources or sources_of(specification))
    return own | {name: text.encode() for name, text in made.items()} | controller


class CompiledLoop:
    """A plant and a controller's C in one library; many runs may go on at once.

    Args:
        plant: from :func:`plant.closed_loop.build_plant`.
        specification: of the controller.
        sources: the folder with the controller's C; generated if not given.
        models: other rigid bodies that runs may change to, such as with a payload.
        libm: a static library in place of the system's, see :func:`compile_loop`.

    Attributes:
        specification: as given.
        path: of the library.

    Raises:
        PlantError: the plant has a joint that this backend can't do, or another number of joints
            than the controller.
        CompilerError: the compiler is missing or reports an error.
    """

    def __init__(
        self,
        plant: Plant,
        specification: Controller,
        sources: Path | None = None,
        models: Sequence[pin.Model] = (),
        libm: Path | None = None,
    ) -> None:
        if plant.joints != len(specification.joints):
            raise PlantError(
                f"{plant.name} has {plant.joints} joints, controller {specification.name} "
                f"{len(specification.joints)}"
            )
        self._structure = structure_of(plant, models)
        self.specification = specification
        self.path = compile_loop(self._structure, specification, sources, libm)
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
        substep_s: float | None = None,
        *,
        reset: bool = True,
        ended_by: Collection[int] = ENDED_BY,
    ) -> Run:
        """Runs the controller from a state of the plant on, for as long as the reference lasts.

        Args:
            plant: that of this loop, or one of the same structure with other numbers.
            controller: with its configuration, which is only read, and its state, which is left
                as the last tick leaves it. Runs at the same time need one each.
            begin: the first state, the reference and the script.
            sample_time_s: L.
            substep_s: longest step of the integrator; the plant's own by default.
            reset: whether the controller is switched on; else it goes on from its state, as in
                :func:`plant.closed_loop.run_from`.
            ended_by: the controller's statuses that end the run.

        Raises:
            ControllerError: the controller reported one of them.
            PlantError: the motion became non-finite; or the plant is of another structure, or
                something hasn't as many numbers as there are joints or ticks.
            LayoutError: the controller is another one.
        """
        self._check(plant, controller, begin)
        record = record_arrays(begin.reference, controller, self._structure.coordinates)
        state = state_arrays(plant, begin.state)
        inputs = controller.inputs(
            begin.reference.position_rad + begin.script.encoder.zero_rad,
            begin.reference.velocity_rad_per_s,
            begin.reference.acceleration_rad_per_s2,
        )
        held = controller.holding_torque(begin.state.command_Nm)
        ends = np.array(sorted(ended_by), dtype=np.int64)
        arrays = encoder_arrays(begin.script.encoder, plant.joints)
        timings = _Timings(
            plant, begin.script, sample_time_s, plant.substep_s if substep_s is None else substep_s
        )
        script = script_arrays(plant, begin.script)
        tick, status = ctypes.c_int64(), ctypes.c_int64()
        end = self._run(
            ctypes.byref(_plant(plant, self._structure.coordinates, arrays)),
            ctypes.byref(
                LoopScript(
                    timings=timings.address,
                    numbers_count=script["numbers"].shape[1],
                    **_addresses(script),
                )
            ),
            ctypes.byref(_pointed(LoopState, state)),
            ctypes.byref(
                LoopController(
                    config=ctypes.addressof(controller.config),
                    state=ctypes.addressof(controller.state),
                    input=inputs.ctypes.data,
                    holding_torque=ctypes.addressof(held) if reset else None,
                    ends=ends.ctypes.data,
                    ends_count=len(ends),
                )
            ),
            ctypes.byref(_pointed(LoopRecord, record)),
            ctypes.c_int64(len(inputs)),
            ctypes.byref(tick),
            ctypes.byref(status),
        )
        if end == _CONTROLLER_ERROR:
            raise ControllerError(tick.value, status.value)
        if end == _NOT_FINITE:
            raise diverged(plant, tick.value)
        return _told(controller, begin, record, state, sample_time_s)

    def _check(self, plant: Plant, controller: GeneratedController, begin: Beginning) -> None:
        """What the C takes for granted."""
        found = structure_of(plant, begin.script.models)
        # Numbers that the C doesn't know must be 0; it doesn't mind others that are.
        unknown = [
            known and not zero
            for known, zero in zip(self._structure.zeros, found.zeros, strict=False)
        ]
        if replace(found, zeros=self._structure.zeros) != self._structure or any(unknown):
            raise PlantError(f"{plant.name} has another structure than the compiled plant")
        if untunable(controller.specification) != untunable(self.specification):
            raise LayoutError(
                f"the loop was compiled for another controller than {controller.specification.name}"
            )
        ticks, joints = begin.reference.position_rad.shape
        if joints != plant.joints:
            raise PlantError(f"the reference is not for the {plant.joints} joints of {plant.name}")
        if begin.script.ticks != ticks:
            raise PlantError(
                f"the script is for {begin.script.ticks} ticks, the reference for {ticks}"
            )


def encoder_arrays(encoder: Encoder, joints: int) -> dict[str, NDArray[Any]]:
    """The encoders' numbers by their names in ``loop_plant``."""
    _vector(encoder.offset_counts, joints)
    return {
        "counts_per_rad": _vector(encoder.counts_per_rad, joints),
        "phase": _vector(encoder.phase, joints),
        "offset_counts": np.array(encoder.offset_counts, dtype=np.int64),
    }


def _vector(values: ArrayLike, joints: int) -> Floats:
    """A copy for the C, which reads one number a joint whether it is there or not."""
    made = np.array(values, dtype=np.float64)
    if made.shape != (joints,):
        raise PlantError(f"{joints} numbers are needed, one a joint, not shape {made.shape}")
    return made


def _plant(plant: Plant, coordinates: int, arrays: Mapping[str, NDArray[Any]]) -> LoopPlant:
    """The plant for the C; the caller must keep the arrays."""
    read_from = coordinates - plant.joints if plant.encoder.mounted == "motor" else 0
    return LoopPlant(plant.joints, coordinates, read_from, **_addresses(arrays))


class _Timings:
    """The timings for the C, and the memory that they point to."""

    def __init__(self, plant: Plant, script: Script, sample_time_s: float, substep_s: float):
        self._lags: list[Floats] = []
        _vector(plant.drive.torque_limit_Nm, plant.joints)
        self._timings = (LoopTiming * len(script.timings))(
            *(
                LoopTiming(
                    *(
                        self._part(part_of_tick(plant, share, sample_time_s, substep_s))
                        for share in timing.shares
                    )
                )
                for timing in script.timings
            )
        )

    @property
    def address(self) -> int:
        """Of the first timing."""
        return ctypes.addressof(self._timings)

    def _part(self, part: PartOfTick) -> LoopPart:
        self._lags += part.lag
        addresses = (column.ctypes.data for column in part.lag)
        return LoopPart(part.share, part.count, part.step_s, *addresses)


@dataclass(frozen=True, eq=False)
class PartOfTick:
    """A part of a tick as ``loop_part`` has it.

    Attributes:
        share: of the tick.
        count: of substeps.
        step_s: h.
        lag: decay, mean and mean_of_all, each of shape (n,); empty where the part has no length.
    """

    share: float
    count: int
    step_s: float
    lag: tuple[Floats, ...]


def part_of_tick(plant: Plant, share: float, sample_time_s: float, substep_s: float) -> PartOfTick:
    """A share of a tick, in substeps of at most the given length."""
    duration_s = share * sample_time_s
    count = substeps(duration_s, substep_s)
    if count == 0:
        return PartOfTick(0.0, 0, 0.0, ())
    step = duration_s / count
    return PartOfTick(share, count, step, tuple(plant.drive.lag(step, count)))


def script_arrays(plant: Plant, script: Script) -> dict[str, NDArray[Any]]:
    """The script's arrays by their names in ``loop_script``, as the C takes them."""
    ticks, n = script.ticks, plant.joints
    kinds = {
        "timing": (script.timing, np.int64, (ticks,)),
        "called": (script.called, np.uint8, (ticks,)),
        "reading": (script.reading, np.uint8, (ticks, n)),
        "noise_counts": (script.noise_counts, np.float64, (ticks, n)),
        "shift_counts": (script.shift_counts, np.int64, (ticks, n)),
        "torque_share": (script.torque_share, np.float64, (ticks, n)),
        "torque_limit_Nm": (script.torque_limit_Nm, np.float64, (ticks, n)),
        "external_Nm": (script.external_Nm, np.float64, (ticks, n)),
        "model": (script.model, np.int64, (ticks,)),
    }
    made: dict[str, NDArray[Any]] = {}
    for name, (values, kind, shape) in kinds.items():
        made[name] = np.ascontiguousarray(values, dtype=kind)
        if made[name].shape != shape:
            raise PlantError(f"the script's {name} is of shape {made[name].shape}, not {shape}")
    for name, choices in (("timing", script.timings), ("model", script.models)):
        if ticks and not 0 <= made[name].min() <= made[name].max() < len(choices):
            raise PlantError(f"the script's {name} points beyond its {len(choices)} {name}s")
    rows = [numbers(plant, model) for model in script.models]
    return made | {"numbers": np.array(rows)}


def _told(
    controller: GeneratedController,
    begin: Beginning,
    record: Mapping[str, NDArray[Any]],
    state: Mapping[str, NDArray[Any]],
    sample_time_s: float,
) -> Run:
    """The record as a run."""
    reference, n = begin.reference, controller.joints
    links, motors = slice(None, n), slice(-n, None)
    return Run(
        sample_time_s=sample_time_s,
        time_s=reference.time_s,
        q=record["q"][:, links],
        qd=record["qd"][:, links],
        q_motor=record["q"][:, motors],
        q_ref=reference.position_rad,
        qd_ref=reference.velocity_rad_per_s,
        qdd_ref=reference.acceleration_rad_per_s2,
        counts=record["counts"],
        q_encoder=begin.script.encoder.positions_rad(record["counts"]),
        torque_commanded_Nm=controller.units.torque.physical(record["torque_commanded"]),
        torque_applied_Nm=record["torque_applied_Nm"],
        friction_Nm=record["friction_Nm"],
        status=record["status"],
        end=PlantState(
            q=state["q"][links],
            qd=state["qd"][links],
            q_motor=state["q"][motors],
            qd_motor=state["qd"][motors],
            friction=state["friction"].tolist(),
            command_Nm=state["command_Nm"],
            torque_Nm=state["torque_Nm"],
        ),
    )


def record_arrays(
    reference: Reference, controller: GeneratedController, coordinates: int
) -> dict[str, NDArray[Any]]:
    """Room for what happens."""
    shape = reference.position_rad.shape
    ticks = shape[0]
    return {
        "q": np.zeros((ticks, coordinates)),
        "qd": np.zeros((ticks, coordinates)),
        "counts": np.zeros(shape, dtype=np.int32),
        "torque_commanded": np.zeros(shape, dtype=controller.types.torque),
        "torque_applied_Nm": np.zeros(shape),
        "friction_Nm": np.zeros(shape),
        "status": np.full(ticks, NOT_CALLED, dtype=np.int64),
    }


def state_arrays(plant: Plant, state: PlantState) -> dict[str, NDArray[Any]]:
    """A copy of the state, for the C to work on."""
    parts = {f.name: _vector(getattr(state, f.name), plant.joints) for f in fields(state)}
    motors = {name: parts.pop(f"{name}_motor") for name in ("q", "qd")}
    if plant.flexibility is None:
        return parts
    return parts | {name: np.concatenate((parts[name], motors[name])) for name in motors}


def simulate(
    plant: Plant,
    controller: GeneratedController,
    trajectory: RestToRest,
    sample_time_s: float,
    substep_s: float | None = None,
    progress: bool | None = None,  # noqa: ARG001 - the interface of plant.closed_loop.simulate
    events: Events = uneventful,
) -> Run:
    """Runs a generated controller on a plant, as :func:`plant.closed_loop.simulate` does.

    Both have one meaning but not the same bits: the rigid-body algorithms round in another order.

    Args:
        plant: from :func:`plant.closed_loop.build_plant`.
        controller: made from sources, not from a library; is reset first.
        trajectory: the reference motion; the run is as long as it.
        sample_time_s: L.
        substep_s: longest step of the integrator; the plant's own by default.
        progress: there is none.
        events: what happens beside.

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
    begin = beginning(plant, trajectory, sample_time_s, events)
    loop = CompiledLoop(plant, controller.specification, controller.sources, begin.script.models)
    return loop.run(plant, controller, begin, sample_time_s, substep_s)
