"""Incremental encoders on the motor shafts, read as 32-bit counters that wrap."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Both edges of both channels are counted.
COUNTS_PER_PULSE = 4


@dataclass(frozen=True, eq=False)
class Encoder:
    """Encoders of n joints.

    Attributes:
        counts_per_rad: counts per joint angle, shape (n,); negative where the motor turns
            against its joint.
        phase: where between two edges the encoder stands at joint position 0, in counts,
            shape (n,), each in [0, 1).
        offset_counts: what the counter holds at joint position 0, shape (n,).
    """

    counts_per_rad: NDArray[np.float64]
    phase: NDArray[np.float64]
    offset_counts: NDArray[np.int64]

    @classmethod
    def at_motor(
        cls,
        gear_ratio: NDArray[np.float64],
        counts_per_rev: NDArray[np.float64],
        phase: NDArray[np.float64] | None = None,
        offset_counts: NDArray[np.int64] | None = None,
    ) -> Encoder:
        """Encoders on the motors.

        Args:
            gear_ratio: motor turns per joint turn, shape (n,).
            counts_per_rev: counts per motor turn (pulses x 4), shape (n,).
            phase: see the class; 0 unless given.
            offset_counts: see the class; 0 unless given.
        """
        n = len(gear_ratio)
        return cls(
            counts_per_rad=gear_ratio * counts_per_rev / (2.0 * math.pi),
            phase=np.zeros(n) if phase is None else phase,
            offset_counts=np.zeros(n, dtype=np.int64) if offset_counts is None else offset_counts,
        )

    @property
    def zero_rad(self) -> NDArray[np.float64]:
        """What the counter, taken as an angle, shows at joint position 0, shape (n,)."""
        return self.offset_counts / self.counts_per_rad

    @property
    def resolution_rad(self) -> NDArray[np.float64]:
        """Joint angle of one count, shape (n,)."""
        return 1.0 / np.abs(self.counts_per_rad)

    def counts(self, position_rad: NDArray[np.float64]) -> NDArray[np.int32]:
        """Counter values floor(counts_per_rad q + phase) + offset, wrapped to 32 bits.

        Args:
            position_rad: joint positions, shape (..., n).

        Returns:
            Two's complement counts of the same shape.
        """
        exact = np.floor(self.counts_per_rad * position_rad + self.phase).astype(np.int64)
        return (exact + self.offset_counts).astype(np.uint32).view(np.int32)

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
