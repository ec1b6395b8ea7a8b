"""Draws picture.png: the elbow's error with the proposal and with the tuned controller.

Usage: .venv/bin/python -m examples.03_your_own_urdf.picture [FILE]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from codegen.controller import load, resolve
from plant.assembly import build_plant
from plant.closed_loop import Run
from plant.compiled.loop import simulate
from plant.controller import GeneratedController
from plant.propose import data_of, proposal
from plant.robot import load_robot

FOLDER = Path(__file__).parent
PICTURE = FOLDER / "picture.png"
ELBOW = 2


def runs() -> dict[str, Run]:
    """The flights of the proposal and of the tuned controller."""
    robot = load_robot(FOLDER / "my_ur5.toml")
    assert robot.trajectory is not None
    plant = build_plant(robot)
    controllers = {
        "as proposed": resolve(data_of(proposal(robot))),
        "tuned": load(FOLDER / "controller.toml"),
    }
    return {
        name: simulate(plant, GeneratedController(x), robot.trajectory, float(x.sample_time))
        for name, x in controllers.items()
    }


def draw(file: Path) -> None:
    """Writes the picture."""
    mpl.rcParams.update({"font.size": 9, "axes.grid": True, "grid.alpha": 0.3})
    figure, (motion, error) = plt.subplots(
        2, 1, sharex=True, figsize=(7.0, 4.2), height_ratios=(1, 2), layout="constrained"
    )
    flown = runs()
    for name, colour in zip(flown, ("tab:orange", "tab:blue"), strict=True):
        run = flown[name]
        print(f"RMS error [deg], {name}:", *(f"{each:.4f}" for each in run.rms_error_deg()))
        rms = run.rms_error_deg()[ELBOW]
        error.plot(
            run.time_s,
            np.rad2deg(run.error_rad[:, ELBOW]),
            color=colour,
            linewidth=0.8,
            label=f"{name}, RMS {rms:.4f}°",
        )
    motion.plot(run.time_s, np.rad2deg(run.q_ref[:, ELBOW]), color="black", linewidth=1.0)
    motion.set_ylabel("reference [deg]")
    error.set(xlabel="time [s]", ylabel="tracking error [deg]")
    error.legend(loc="lower right")
    motion.set_title("the elbow of the UR5, by its encoder", loc="left")
    figure.savefig(file, dpi=130, metadata={"Software": None})


if __name__ == "__main__":
    draw(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE)
