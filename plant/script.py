"""What happens to a plant in each tick of a run, beyond the controller's doing: plain arrays.

Both backends read the same arrays, so that a fault or a disturbance has one meaning. People write
scenarios instead (:mod:`plant.scenario`), which become a script.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from plant.assembly import Floats, Plant, PlantState
from plant.encoder import Encoder, wrapped
from plant.trajectory import Reference


class Reading(IntEnum):
    """What a reading of an encoder's counter gives; the numbers are those of loop.h."""

    COUNTS = 0
    """The counter's value."""
    ZERO = 1
    """0: nothing answers on the bus."""
    STUCK = 2
    """The last value again, while the counter goes on counting."""
    LOST = 3
    """The last value again: the counter gets no pulses, and misses them ever after."""


class Timing(NamedTuple):
    """When things happen in a tick, as fractions of it; what they leave is the new command's.

    Attributes:
        late: how long after the tick's time the encoders are read and the controller is called.
        delay: how long after that its command acts.
    """

    late: float
    delay: float

    @property
    def shares(self) -> tuple[float, float, float]:
        """Fractions of the tick until the reading, from there to the command's effect, and then."""
        return self.late, self.delay, 1.0 - self.late - self.delay


@dataclass(frozen=True, eq=False)
class Script:
    """A script for so many ticks of a plant with n joints.

    Attributes:
        timings: the different timings of ticks.
        timing: index into them, shape (ticks,).
        called: whether the controller is called, shape (ticks,); without it the command stays.
        reading: a :class:`Reading`, shape (ticks, n).
        noise_counts: jitter of the encoders' edges, shape (ticks, n).
        shift_counts: what the counters hold too much, shape (ticks, n).
        torque_share: of its command that a drive gives, shape (ticks, n).
        torque_limit_Nm: of the drives, >= 0, shape (ticks, n).
        external_Nm: torque on the links, shape (ticks, n).
        encoder: the plant's, or one whose counters begin elsewhere; the reference is given in its
            counts.
        models: the different rigid bodies, such as with and without a payload.
        model: index into them, shape (ticks,).
    """

    timings: tuple[Timing, ...]
    timing: NDArray[np.int64]
    called: NDArray[np.bool_]
    reading: NDArray[np.uint8]
    noise_counts: Floats
    shift_counts: NDArray[np.int64]
    torque_share: Floats
    torque_limit_Nm: Floats
    external_Nm: Floats
    encoder: Encoder
    models: tuple[pin.Model, ...]
    model: NDArray[np.int64]

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return len(self.timing)

    def rows(self, first: int, count: int) -> Script:
        """So many ticks of the script."""
        part = slice(first, first + count)
        arrays = {
            f.name: getattr(self, f.name)[part]
            for f in fields(self)
            if f.name not in ("timings", "encoder", "models")
        }
        return replace(self, **arrays)


def uneventful(plant: Plant, reference: Reference, seed: int = 0) -> Script:
    """The script of a run in which nothing happens but the encoders' own noise.

    Args:
        plant: the plant.
        reference: of the run.
        seed: of the noise.
    """
    shape = reference.position_rad.shape
    ticks = shape[0]
    sigma = np.broadcast_to(plant.encoder.noise_counts, shape)
    # Named, because numpy may change its default.
    normal = np.random.Generator(np.random.PCG64(seed)).standard_normal if np.any(sigma) else None
    return Script(
        timings=(Timing(0.0, plant.drive.delay),),
        timing=np.zeros(ticks, dtype=np.int64),
        called=np.ones(ticks, dtype=np.bool_),
        reading=np.full(shape, Reading.COUNTS, dtype=np.uint8),
        noise_counts=np.zeros(shape) if normal is None else sigma * normal(shape),
        shift_counts=np.zeros(shape, dtype=np.int64),
        torque_share=np.ones(shape),
        torque_limit_Nm=np.tile(plant.drive.torque_limit_Nm, (ticks, 1)),
        external_Nm=np.zeros(shape),
        encoder=plant.encoder,
        models=(plant.model,),
        model=np.zeros(ticks, dtype=np.int64),
    )


class Counters:
    """The encoders' counters as a run's controller reads them, faults and all.

    Args:
        script: of the run.
        begin: the state at its beginning, from which the first reading comes.
    """

    def __init__(self, script: Script, begin: PlantState) -> None:
        self._encoder, self._script = script.encoder, script
        self._lost = np.zeros(len(begin.q), dtype=np.int64)
        self._last = self._exact(begin)
        if script.ticks:
            self._last = self._last + script.shift_counts[0]

    def _exact(self, state: PlantState, noise: Floats | float = 0.0) -> NDArray[np.int64]:
        seen = state.q_motor if self._encoder.mounted == "motor" else state.q
        return self._encoder.exact_counts(seen, noise)

    @property
    def first(self) -> NDArray[np.int32]:
        """The reading at switch-on, shape (n,)."""
        return wrapped(self._last)

    def read(self, tick: int, state: PlantState) -> NDArray[np.int32]:
        """The reading of a tick; the ticks come in their order."""
        script = self._script
        exact = self._exact(state, script.noise_counts[tick]) + script.shift_counts[tick]
        exact -= self._lost
        kind = script.reading[tick]
        self._lost += np.where(kind == Reading.LOST, exact - self._last, 0)
        held = (kind == Reading.LOST) | (kind == Reading.STUCK)
        shown = np.where(held, self._last, exact)
        silent = kind == Reading.ZERO
        self._last = np.where(silent, self._last, shown)
        return wrapped(np.where(silent, 0, shown))
