"""Draws what the program printed.

Usage: .venv/bin/python -m examples.06_embed_in_a_cmake_project.draw_torque FILE.csv
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from codegen.status import LOST
from verification.style import PALETTE, house_style

PICTURE = Path(__file__).parent / "picture.png"


def draw(rows: Path) -> None:
    """Writes the picture: the torque of each joint, and which ticks were lost."""
    table = np.genfromtxt(rows, delimiter=",", names=True)
    lost = table["tick"][np.isin(table["status"], list(LOST))]
    with house_style(printed=True):
        figure = Figure(figsize=(6.5, 2.8), layout="constrained")
        axes = figure.subplots()
        for colour, joint in zip(PALETTE, ("waist", "shoulder", "elbow"), strict=False):
            axes.step(table["tick"], table[f"{joint}_Nm"], where="post", color=colour, label=joint)
        label = "lost ticks: the torque is held"
        axes.axvspan(lost.min(), lost.max() + 1, color=PALETTE[3], alpha=0.25, label=label)
        axes.set(xlabel="tick [ms]", ylabel="torque [N m]")
        figure.legend(loc="outside upper left", ncols=4)
        figure.savefig(PICTURE, dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
