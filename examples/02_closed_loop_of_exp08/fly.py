"""Flies rows of Table II on the reference plant: python -m examples.02_closed_loop_of_exp08.fly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from plant.flight import Flight, fly
from verification.paper import table_2
from verification.style import PALETTE, house_style

FOLDER = Path(__file__).parent
CONTROLLER = FOLDER.parents[1] / "controllers" / "puma3.toml"
EXPERIMENTS = {"Exp01": "Hsia's law", "Exp05": "terminal sliding", "Exp08": "the whole law"}


def draw(flights: dict[str, Flight]) -> None:
    """Writes the picture: the reference of each joint, and the shoulder's error with each law."""
    with house_style(printed=True):
        figure = Figure(figsize=(6.5, 4.2), layout="constrained")
        motion, large, small = figure.subplots(3, 1, sharex=True)
        run = flights["Exp08"].run
        motion.plot(run.time_s, np.rad2deg(run.q_ref[:, 1]), color="black")
        for colour, (name, flight) in zip(PALETTE[1::2], flights.items(), strict=False):
            millidegrees = 1e3 * np.rad2deg(flight.run.error_rad[:, 1])
            label = f"{name}, {EXPERIMENTS[name]}"
            error = large if name == "Exp01" else small
            error.plot(run.time_s, millidegrees, color=colour, lw=0.6, label=label)
        small.set(xlabel="time [s]")
        figure.supylabel("shoulder: tracking error [0.001 deg], reference [deg]", fontsize=8)
        figure.legend(loc="outside lower center", ncols=3)
        figure.savefig(FOLDER / "picture.png", dpi=110, metadata={"Software": None})


def main() -> None:
    """Flies, prints the errors beside the paper's, and draws."""
    paper = table_2()
    flights = {name: fly(CONTROLLER, experiment=name, backend="compiled") for name in EXPERIMENTS}
    print("RMS error of joints 1 to 3 [deg]: here, and on the paper's robot")
    for name, flight in flights.items():
        ours = " ".join(f"{error:.4f}" for error in flight.run.rms_error_deg())
        print(f"{name}  {ours}   {' '.join(f'{error:.4f}' for error in paper[name].rms_deg)}")
    draw(flights)


if __name__ == "__main__":
    main()
