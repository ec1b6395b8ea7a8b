"""The FMU of a package in FMPy: valid, compiled, and flown as its controller was."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from package.contents import FMU, Package
from package.recording import Recording
from package.tools import CheckError, run
from verification.firmware import tool


def build_fmu(archive: Path, directory: Path) -> Path:
    """Validates an FMU and compiles it into a folder, which it returns.

    Raises:
        CheckError: it is not valid, or doesn't compile without a warning.
    """
    import fmpy
    from fmpy.validation import validate_fmu

    problems = validate_fmu(str(archive))
    if problems:
        raise CheckError(f"{archive.name} is no valid FMU:\n" + "\n".join(problems))
    folder = directory / "fmu"
    fmpy.extract(str(archive), unzipdir=str(folder))
    # In a process of its own: it prints as it likes, and finds CMake in PATH.
    program = (
        "import sys; from fmpy.build import build_platform_binary;"
        "build_platform_binary(sys.argv[1], all_warnings=True, cmake_options="
        "{'CMAKE_C_FLAGS:STRING': '-Werror -ffp-contract=off'})"
    )
    tool("c++", "g++")
    run([sys.executable, "-c", program, folder], directory)
    return folder


class Simulation:
    """A compiled FMU in FMPy, switched on by :meth:`start`; a context manager.

    Args:
        folder: with the compiled FMU.

    Attributes:
        slave: FMPy's handle.
        said: what the FMU logged.
    """

    def __init__(self, folder: Path) -> None:
        import fmpy
        from fmpy.fmi3 import FMU3Slave

        self._description = fmpy.read_model_description(str(folder))
        self._references = {v.name: v for v in self._description.modelVariables}
        self.said: list[str] = []
        self.slave = FMU3Slave(
            guid=self._description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=self._description.coSimulation.modelIdentifier,
            instanceName=folder.name,
        )
        self.slave.instantiate(logMessage=self._log)

    def _log(self, _environment: object, _status: int, _category: bytes, text: bytes) -> None:
        self.said.append(text.decode("utf-8"))

    def __enter__(self) -> Self:
        """The simulation itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Frees the instance and the library."""
        self.slave.freeInstance()

    def names(self, array: str) -> list[str]:
        """The scalar variables of an array."""
        return [name for name in self._references if name.startswith(f"{array}[")]

    def set(self, name: str | Sequence[str], value: ArrayLike) -> None:
        """Sets one variable, or several of one type.

        Raises:
            fmpy.fmi1.FMICallException: the FMU refuses it.
        """
        names = [name] if isinstance(name, str) else list(name)
        variables = [self._references[each] for each in names]
        values = np.atleast_1d(np.asarray(value)).tolist()
        getattr(self.slave, f"set{variables[0].type}")(
            [v.valueReference for v in variables], values
        )

    def get(self, name: str | Sequence[str]) -> list[float]:
        """The values of one variable, or of several of one type."""
        names = [name] if isinstance(name, str) else list(name)
        variables = [self._references[each] for each in names]
        found: list[float] = getattr(self.slave, f"get{variables[0].type}")(
            [v.valueReference for v in variables]
        )
        return found

    def start(self, counts: ArrayLike, holding_torque_Nm: ArrayLike) -> None:
        """Switches the controller on."""
        self.set(self.names("counts"), counts)
        self.set(self.names("holding_torque"), holding_torque_Nm)
        self.slave.enterInitializationMode(startTime=0.0)
        self.slave.exitInitializationMode()

    def fly(self, recording: Recording, first: int = 0, last: int | None = None) -> Answers:
        """Gives it what a flight's controller was given, in some ticks of it."""
        tick = recording.sample_time_s
        given = [
            (self.names(array), getattr(recording, column).tolist())
            for array, column in GIVEN.items()
        ]
        torque, answers, statuses = self.names("torque"), [], []
        for k in range(first, len(recording.counts) if last is None else last):
            for names, rows in given:
                self.set(names, rows[k])
            self.slave.doStep(currentCommunicationPoint=k * tick, communicationStepSize=tick)
            answers.append(self.get(torque))
            statuses += self.get("status")
        return Answers(np.array(answers), np.array(statuses, dtype=np.int64))


GIVEN = {
    "counts": "counts",
    "reference_position": "position_rad",
    "reference_velocity": "velocity_rad_per_s",
    "reference_acceleration": "acceleration_rad_per_s2",
}
"""The inputs of an FMU, and what of a recording they are."""


@dataclass(frozen=True, eq=False)
class Answers:
    """What an FMU answered; row k belongs to tick k.

    Attributes:
        torque_Nm: shape (ticks, n).
        status: shape (ticks,).
    """

    torque_Nm: NDArray[np.float64]
    status: NDArray[np.int64]


def check_fmu(folder: Path, package: Package, recording: Recording) -> None:
    """Validates, compiles and simulates the FMU; its torques must have the flight's bits.

    Raises:
        CheckError: one of that doesn't work.
    """
    with tempfile.TemporaryDirectory(prefix="fmu-") as scratch:
        built = build_fmu(folder / FMU.format(package.prefix), Path(scratch))
        with Simulation(built) as simulation:
            simulation.start(recording.first_counts, recording.holding_torque_Nm)
            answers = simulation.fly(recording)
    compare(answers, recording)


def compare(answers: Answers, recording: Recording) -> None:
    """Compares an FMU's answers with a flight, bit for bit.

    Raises:
        CheckError: they differ; with the first tick in which they do.
    """
    torque, wanted = answers.torque_Nm, recording.torque_Nm.astype(np.float64)
    if torque.shape != wanted.shape:
        raise CheckError(f"the FMU made {len(torque)} ticks, not {len(wanted)}")
    # As integers: -0 is not 0.
    differs = (torque.view(np.uint64) != wanted.view(np.uint64)).any(axis=1)
    differs |= answers.status != recording.status
    if differs.any():
        k = int(np.argmax(differs))
        raise CheckError(
            f"the FMU differs from the C in {int(differs.sum())} of {len(wanted)} ticks, first in "
            f"tick {k}: {torque[k].tolist()} N m, status {answers.status[k]}, not "
            f"{wanted[k].tolist()} N m, status {recording.status[k]}"
        )
