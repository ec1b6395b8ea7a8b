"""Tunes a controller on a plant by the paper's procedure: python -m examples.04_tune.tune.

Returns 1 where the tuned gains are no better than those of the file.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from plant.__main__ import main as plant
from plant.flight import fly
from plant.native import BUILD
from verification.style import PALETTE, house_style

FOLDER = Path(__file__).parent
CONTROLLER = FOLDER.parents[1] / "controllers" / "puma3.toml"
TUNED = BUILD / "plant" / "tuning" / "puma3_on_reference"


def draw(log: dict[str, Any]) -> None:
    """Writes the picture: error and vibration of each joint at every trial."""
    trials = log["trials"]
    with house_style(printed=True):
        figure = Figure(figsize=(6.5, 4.2), layout="constrained")
        error, shaking = figure.subplots(2, 1, sharex=True)
        for joint, name in enumerate(log["joint_names"]):
            look: Any = {"color": PALETTE[joint], "marker": ".", "lw": 0.8}
            error.plot([1e3 * t["rms_deg"][joint] for t in trials], label=name, **look)
            shaking.plot([t["vibration"][joint] for t in trials], **look)
        for step in log["steps"]:
            inside = [k for k, trial in enumerate(trials) if trial["step"] == step["step"]]
            for axes in (error, shaking):
                axes.axvline(inside[0] - 0.5, color="black", lw=0.8, ls=":")
            shaking.hlines(step["vibration_limit"], inside[0], inside[-1], color="black", ls="--")
            shaking.text(inside[0], step["vibration_limit"] + 0.1, step["quantity"])
        error.set(yscale="log", ylabel="RMS error [0.001 deg]")
        shaking.set(ylabel="vibration and its limit", xlabel="trial", ylim=(0.8, 5.6))
        figure.legend(loc="outside lower center", ncols=3)
        figure.savefig(FOLDER / "picture.png", dpi=110, metadata={"Software": None})


def main() -> int:
    """Tunes, flies both gain sets, and draws."""
    plant(["tune", str(CONTROLLER), "--robot", "reference"])
    log = json.loads((TUNED / "tune.json").read_text(encoding="utf-8"))
    before, after = (
        fly(file, backend="compiled").run for file in (CONTROLLER, TUNED / "tune.toml")
    )
    draw(log)
    print("RMS error [0.001 deg] as specified:", (1e3 * before.rms_error_deg()).round(3))
    print("RMS error [0.001 deg] tuned:       ", (1e3 * after.rms_error_deg()).round(3))
    return 0 if all(after.rms_error_deg() < before.rms_error_deg()) else 1


if __name__ == "__main__":
    sys.exit(main())
