"""How much a controller vibrates, by the torque that it commands.

A law that estimates by time delay adds to its last torque, by (31),

    tau(t) - tau(t-L) = Mbar (u(t) - qdd(t-L))

and takes the acceleration qdd for the second difference of encoder counts. A count is delta wide;
while a joint moves over the edges, the error of a reading is uniform within a count and
independent from one to the next, with the variance delta^2/12. Its second difference has
(1 + 4 + 1) times as much. So the counts alone, on a joint that does nothing but follow its
reference, make torque increments whose mean square is

    (Mbar delta / L^2)^2 / 2

The measure is the mean square of the torque increments at frequencies that can be heard, in this
unit. Counts alone give 1, at any Mbar, on any joint; what a loop adds to that is its own doing:
oscillation at the margin of stability, springs that ring, chatter of lambda sig(s)^gamma. A measure
of 2 says that the loop shakes the motors as much again as the counts do.

On the reference plants it is 1.0 to 1.1 wherever Mbar, lambda are small and gamma, alpha are 1
(joints 1 and 2), and grows by orders of magnitude within a factor of 1.5 of Mbar beyond the margin.
Two other measures were looked at and left: the share of ticks at which the increment changes its
sign is 0.53 for counts alone and not far from it in the worst vibration, and energy above a cutoff
in N m needs a limit of its own for each joint and each Mbar.

What it doesn't see: slow oscillation of the error, such as a too small alpha brings at about 10 Hz,
which the RMS error shows; and anything in a drive at its torque limit, where increments are no
longer the law's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

AUDIBLE_HZ = 20.0
"""Where hearing begins. The torque of a robot's motion lies below."""


def vibration(
    torque_Nm: Floats, inertia_kgm2: Floats, resolution_rad: Floats, sample_time_s: float
) -> Floats:
    """Mean square of the audible torque increments, 1 for the encoder's counts alone.

    Args:
        torque_Nm: commanded, of a motion from rest to rest, shape (ticks, n).
        inertia_kgm2: Mbar, times w'/(1 + w') where a low-pass (43) is in the law; shape (n,).
        resolution_rad: joint angle of a count, shape (n,).
        sample_time_s: L.

    Returns:
        Without unit, shape (n,).
    """
    increments = np.diff(torque_Nm, axis=0)
    count = len(increments)
    spectrum = np.abs(np.fft.rfft(increments, axis=0)) ** 2
    # Each frequency stands for its negative, too, but for 0 and half of the sampling frequency.
    spectrum[1 : (count + 1) // 2] *= 2.0
    heard = np.fft.rfftfreq(count, sample_time_s) >= AUDIBLE_HZ
    mean_square = spectrum[heard].sum(axis=0) / count**2
    by_counts = (inertia_kgm2 * resolution_rad / sample_time_s**2) ** 2 / 2.0
    measure: Floats = mean_square / by_counts
    return measure
