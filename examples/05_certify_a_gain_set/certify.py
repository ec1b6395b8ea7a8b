"""Certifies gain sets on a robot: python -m examples.05_certify_a_gain_set.certify FILE...

Returns 1 where one is unsafe or nothing could be proved of it.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from codegen.controller import load
from plant.robot import load_robot
from verification.sampled_stability.intervals import Interval
from verification.style import PALETTE, house_style
from verification.tuning_check.joint import Timing, specified
from verification.workspace.certify import Certified, certified_eigenvalues

FOLDER = Path(__file__).parent
ROBOT = "reference"


@dataclass(frozen=True)
class Finding:
    """What is proved of a gain set.

    Attributes:
        name: of its file.
        stable: intervals of Mbar/M in which the sampled linear law is stable, in exact arithmetic.
        eigenvalues: bounds of all eigenvalues of M(q)^-1 Mbar, at every posture.
        proved: whether the independent checkers verified both.
    """

    name: str
    stable: tuple[Interval, ...]
    eigenvalues: Certified
    proved: bool

    @property
    def safe(self) -> bool:
        """Whether every eigenvalue lies in one stable interval, and that is proved."""
        found = self.eigenvalues
        return self.proved and any(x.contains(found.low, found.high) for x in self.stable)


def certify(file: Path) -> Finding:
    """Both proofs for a specification on the reference robot."""
    controller = load(file)
    joints = specified(controller, Timing())
    sampled = joints[0].sampled
    assert len({joint.sampled.loop for joint in joints}) == 1, "gains differ from joint to joint"
    found = certified_eigenvalues(load_robot(ROBOT), [joint.joint.inertia for joint in joints])
    return Finding(file.stem, sampled.intervals, found, sampled.proved and found.proved)


def draw(findings: Sequence[Finding]) -> None:
    """Writes the picture: stable intervals, and the eigenvalues in them or not."""
    with house_style(printed=True):
        figure = Figure(figsize=(6.5, 2.2), layout="constrained")
        axes = figure.subplots()
        for row, finding in enumerate(findings):
            for x in finding.stable:
                low, high = float(x.low), float(x.high)
                axes.barh(row, high - low, left=low, height=0.5, color=PALETTE[2], label="stable")
            low, high = float(finding.eigenvalues.low), float(finding.eigenvalues.high)
            label = "eigenvalues of $M^{-1}\\bar{M}$, all postures"
            axes.plot([low, high], [row, row], color=PALETTE[3], lw=6.0, label=label)
            axes.text(high, row + 0.38, "safe" if finding.safe else "unsafe", ha="right")
        axes.set_yticks(range(len(findings)), [finding.name for finding in findings])
        axes.set(xlabel="$\\bar{M}/M$", ylim=(-0.6, len(findings) - 0.3))
        by_label = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
        figure.legend(by_label.values(), by_label.keys(), loc="outside upper left", ncols=2)
        figure.savefig(FOLDER / "picture.png", dpi=110, metadata={"Software": None})


def main(files: Sequence[Path]) -> int:
    """Certifies, prints the verdicts, and draws."""
    findings = [certify(file) for file in files]
    for finding in findings:
        stable = ", ".join(f"({float(x.low):.4f}, {float(x.high):.4f})" for x in finding.stable)
        low, high = float(finding.eigenvalues.low), float(finding.eigenvalues.high)
        verdict = "safe" if finding.safe else "UNSAFE"
        print(f"{finding.name}: {verdict}; eigenvalues in [{low:.4f}, {high:.4f}], stable {stable}")
    draw(findings)
    return 0 if all(finding.safe for finding in findings) else 1


if __name__ == "__main__":
    sys.exit(main([Path(file) for file in sys.argv[1:]]))
