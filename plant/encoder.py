"""Incremental encoders on motors or joints, read as 32-bit counters that wrap."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

# Both edges of both channels are counted.
COUNTS_PER_PULSE = 4

Mounting = Literal["motor", "joint"]


@dataclass(frozen=True, eq=False)
class Encoder:
    """Encoders of n joints.

    Attributes:
        counts_per_rad: counts per joint angle, shape (n,); negative where the motor turns
            against its joint.
        phase: where between two edges the encoder stands at joint position 0, in counts,
            shape (n,), each in [0, 1).
        offset_counts: what the counter holds at joint position 0, shape (n,).
        mounted: whose angle they count; it matters where joints are flexible.
        noise_counts: standard deviation of the edges' jitter in counts, normal and independent
            from one reading to the next, shape (n,) or one for all.
    """

    counts_per_rad: NDArray[np.float64]
    phase: NDArray[np.float64]
    offset_counts: NDArray[np.int64]
    mounted: Mounting = "motor"
    noise_counts: NDArray[np.float64] | float = 0.0

    @classmethod
    def on_shaft(
        cls,
        turns: NDArray[np.float64],
        counts_per_rev: NDArray[np.float64],
        phase: NDArray[np.float64] | None = None,
        offset_counts: NDArray[np.int64] | None = None,
        mounted: Mounting = "motor",
        noise_counts: NDArray[np.float64] | float = 0.0,
    ) -> Encoder:
        """Encoders on shafts.

        Args:
            turns: of the shaft per joint turn, shape (n,): the gear ratio on motors, 1 on joints.
            counts_per_rev: counts per turn of the shaft (pulses x 4), shape (n,).
            phase: see the class; 0 unless given.
            offset_counts: see the class; 0 unless given.
            mounted: see the class.
            noise_counts: see the class.
        """
        n = len(turns)
        return cls(
            counts_per_rad=turns * counts_per_rev / (2.0 * math.pi),
            phase=np.zeros(n) if phase is None else phase,
            offset_counts=np.zeros(n, dtype=np.int64) if offset_counts is None else offset_counts,
            mounted=mounted,
            noise_counts=noise_counts,
        )

    @property
    def zero_rad(self) -> NDArray[np.float64]:
        """What the counter, taken as an angle, shows at joint position 0, shape (n,)."""
        return self.offset_counts / self.counts_per_rad

    @property
    def resolution_rad(self) -> NDArray[np.float64]:
        """Joint angle of one count, shape (n,)."""
        return 1.0 / np.abs(self.counts_per_rad)

    def exact_counts(
        self, position_rad: NDArray[np.float64], noise: NDArray[np.float64] | float = 0.0
    ) -> NDArray[np.int64]:
        """floor(counts_per_rad q + phase + noise) + offset, not wrapped.

        Args:
            position_rad: joint positions, shape (..., n).
            noise: jitter of the edges [count], shape (..., n).
        """
        edges = np.floor(self.counts_per_rad * position_rad + self.phase + noise)
        exact: NDArray[np.int64] = edges.astype(np.int64) + self.offset_counts
        return exact

    def counts(self, position_rad: NDArray[np.float64]) -> NDArray[np.int32]:
        """The counters' values without noise, two's complement, shape (..., n)."""
        return wrapped(self.exact_counts(position_rad))

    def positions_rad(self, counts: NDArray[np.int32]) -> NDArray[np.float64]:
        """Joint positions as a drive sees them that follows the counter from standstill near 0.

        Args:
            counts: a sequence of samples, shape (ticks, n), fewer than 2^31 counts apart; the
                first within 2^31 counts of the offset.

        Returns:
            Positions [rad], shape (ticks, n), (counts - offset) / counts_per_rad unwrapped.
        """
        start = self.offset_counts.astype(np.uint32).view(np.int32)
        # int32 differences wrap as the counter does.
        moves = np.diff(counts, axis=0, prepend=start[np.newaxis, :].astype(np.int32))
        return np.cumsum(moves, axis=0, dtype=np.int64) / self.counts_per_rad


def wrapped(counts: NDArray[np.int64]) -> NDArray[np.int32]:
    """Counts as a counter of 32 bits shows them, of the same shape."""
    return counts.astype(np.uint32).view(np.int32)
