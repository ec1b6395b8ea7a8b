"""Reference trajectories: rest-to-rest fifth-order polynomials through given postures."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Reference:
    """A sampled reference; k-th rows belong to the time k L.

    Attributes:
        time_s: shape (ticks,).
        position_rad: q_d, shape (ticks, n).
        velocity_rad_per_s: shape (ticks, n).
        acceleration_rad_per_s2: shape (ticks, n).
    """

    time_s: NDArray[np.float64]
    position_rad: NDArray[np.float64]
    velocity_rad_per_s: NDArray[np.float64]
    acceleration_rad_per_s2: NDArray[np.float64]

    def rows(self, first: int, count: int) -> Reference:
        """At most so many ticks of the reference."""
        part = slice(first, first + count)
        return Reference(*(getattr(self, f.name)[part] for f in fields(self)))


@dataclass(frozen=True, eq=False)
class RestToRest:
    """Rest at each of several postures, fifth-order polynomials of time between them.

    Attributes:
        postures_rad: shape (segments + 1, n).
        segment_s: the time from each posture to the next, shape (segments,).
    """

    postures_rad: NDArray[np.float64]
    segment_s: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.postures_rad.shape[0] != len(self.segment_s) + 1 or not np.all(self.segment_s > 0):
            raise ValueError("m segments need m + 1 postures and durations > 0")

    @property
    def duration_s(self) -> float:
        """The time of all segments."""
        return float(np.sum(self.segment_s))

    @property
    def start_rad(self) -> NDArray[np.float64]:
        """The first posture, shape (n,)."""
        first: NDArray[np.float64] = self.postures_rad[0]
        return first

    def faster(self, factor: float) -> RestToRest:
        """The same path, so many times as fast."""
        return replace(self, segment_s=self.segment_s / factor)

    def at(self, time_s: NDArray[np.float64]) -> Reference:
        """The reference at any times; before the start and after the end it rests.

        Within a segment of duration T from a to b, with r = t / T,

            q_d = a + (b - a) (10 r^3 - 15 r^4 + 6 r^5)

        the one quintic with zero velocity and acceleration at both ends.

        Args:
            time_s: shape (ticks,).
        """
        knots = np.concatenate(([0.0], np.cumsum(self.segment_s)))
        segment = np.clip(
            np.searchsorted(knots, time_s, side="right") - 1, 0, len(self.segment_s) - 1
        )
        duration = self.segment_s[segment]
        r = np.clip((time_s - knots[segment]) / duration, 0.0, 1.0)
        start, stroke = self.postures_rad[segment], np.diff(self.postures_rad, axis=0)[segment]
        shape = r**3 * (10.0 - 15.0 * r + 6.0 * r**2)
        slope = 30.0 * r**2 * (1.0 - r) ** 2 / duration
        curvature = 60.0 * r * (1.0 - r) * (1.0 - 2.0 * r) / duration**2
        return Reference(
            time_s=time_s,
            position_rad=start + stroke * shape[:, np.newaxis],
            velocity_rad_per_s=stroke * slope[:, np.newaxis],
            acceleration_rad_per_s2=stroke * curvature[:, np.newaxis],
        )

    def sampled(self, sample_time_s: float) -> Reference:
        """The reference at every tick of the whole motion, k L for 0 <= k < duration / L."""
        ticks = round(self.duration_s / sample_time_s)
        return self.at(sample_time_s * np.arange(ticks, dtype=np.float64))


def to_and_fro(
    start_rad: NDArray[np.float64],
    amplitude_rad: NDArray[np.float64],
    via: NDArray[np.float64],
    segment_s: float,
) -> RestToRest:
    """All joints together through start + via x amplitude, in segments of equal duration.

    Args:
        start_rad: shape (n,).
        amplitude_rad: shape (n,).
        via: shape (segments + 1,), for example (0, 1, 0, -1, 0).
        segment_s: duration of each segment.
    """
    return RestToRest(
        postures_rad=start_rad + np.outer(via, amplitude_rad),
        segment_s=np.full(len(via) - 1, segment_s),
    )
