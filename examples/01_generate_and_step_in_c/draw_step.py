"""Draws what main.c printed: python -m examples.01_generate_and_step_in_c.draw_step FILE.csv."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from verification.style import PALETTE, house_style

PICTURE = Path(__file__).parent / "picture.png"
DEG_PER_COUNT = 360.0 / (8192 * 120)


def draw(rows: Path) -> None:
    """Writes the picture: reference, error in counts, torque."""
    table = np.genfromtxt(rows, delimiter=",", names=True)
    reference = table["reference_q8"] / 256.0
    with house_style(printed=True):
        figure = Figure(figsize=(6.5, 4.2), layout="constrained")
        motion, error, torque = figure.subplots(3, 1, sharex=True)
        motion.plot(table["time_s"], DEG_PER_COUNT * reference, color=PALETTE[0])
        motion.set(ylabel="reference [deg]")
        # A reading is the count below; the middle of a count is half of one above.
        error.plot(table["time_s"], reference - table["counts"] - 0.5, color=PALETTE[3], lw=0.8)
        error.set(ylabel="error [counts]")
        torque.plot(table["time_s"], table["torque_Nm"], color=PALETTE[2], lw=0.8)
        torque.set(ylabel="torque [N m]", xlabel="time [s]")
        figure.savefig(PICTURE, dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
