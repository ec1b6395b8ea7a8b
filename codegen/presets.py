"""Gain sets with a name: the paper's special cases, its experiments and its robot.

A law preset says which keys of ``[law]`` it fixes (they define the special case, and giving
another value is an error), which it only proposes, and which ranges it needs. Values are exact:
integers, decimals or fractions as text, as in a specification.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

Gain = int | str
"""An exact gain as a specification would write it."""


@dataclass(frozen=True)
class Open:
    """An open interval that a preset needs a gain to lie in; ``high`` None is unbounded."""

    low: Fraction
    high: Fraction | None

    def __contains__(self, value: Fraction) -> bool:
        return self.low < value and (self.high is None or value < self.high)

    def rule(self, key: str) -> str:
        """The interval as a sentence, such as ``0 < gamma < 1``."""
        return f"{self.low} < {key}" + (f" < {self.high}" if self.high is not None else "")


POSITIVE = Open(Fraction(0), None)
UNIT = Open(Fraction(0), Fraction(1))


@dataclass(frozen=True)
class LawPreset:
    """A named special case of the law.

    Attributes:
        name: what a specification writes as ``law.preset``.
        equation: the paper's equation or table row.
        meaning: one sentence for the reader.
        fixed: keys of ``[law]`` that define the case.
        proposed: keys that the specification may set otherwise.
        needs: open intervals, by key, that make it this case and no other.
    """

    name: str
    equation: str
    meaning: str
    fixed: dict[str, Gain]
    proposed: dict[str, Gain] = field(default_factory=dict)
    needs: dict[str, Open] = field(default_factory=dict)


_LINEAR_DED: dict[str, Gain] = {"alpha": 1, "beta": 1}
_PAPER_GAINS: dict[str, Gain] = {"kd": 20, "kp": 100}
_CORRECTION: dict[str, Gain] = {"lambda": 20}
_TWISTED_DED: dict[str, Gain] = {"alpha": "95/100", "beta": "finite-time"}

SPECIAL_CASES = (
    LawPreset(
        "hsia",
        "(9)(10)",
        "Hsia's time delay control: linear error dynamics, no correction.",
        {**_LINEAR_DED, "lambda": 0, "gamma": 1},
        _PAPER_GAINS,
    ),
    LawPreset(
        "jin",
        "(39)",
        "Jin's enhanced law: linear error dynamics, linear correction.",
        {**_LINEAR_DED, "gamma": 1},
        {**_PAPER_GAINS, **_CORRECTION},
        {"lambda": POSITIVE},
    ),
    LawPreset(
        "sliding-mode",
        "(40)",
        "Time delay estimation with integral sliding mode: correction by the sign of s.",
        {**_LINEAR_DED, "gamma": 0},
        {**_PAPER_GAINS, **_CORRECTION},
        {"lambda": POSITIVE},
    ),
    LawPreset(
        "terminal-sliding",
        "(41)",
        "Jin's terminal sliding mode: linear error dynamics, correction with 0 < gamma < 1.",
        _LINEAR_DED,
        {**_PAPER_GAINS, **_CORRECTION, "gamma": "4/10"},
        {"lambda": POSITIVE, "gamma": UNIT},
    ),
    LawPreset(
        "nonlinear-ded",
        "(24)",
        "Finite-time error dynamics without correction.",
        {"lambda": 0, "gamma": 1},
        {**_PAPER_GAINS, **_TWISTED_DED},
        {"alpha": UNIT},
    ),
    LawPreset(
        "enhanced",
        "(31)",
        "The whole law: finite-time error dynamics and terminal sliding correction.",
        {},
        {**_PAPER_GAINS, **_CORRECTION, **_TWISTED_DED, "gamma": "4/10"},
        {"lambda": POSITIVE, "alpha": UNIT, "gamma": UNIT},
    ),
)

_EXPERIMENT_KEYS = ("lambda", "alpha", "beta", "gamma")
# Table II; without correction (lambda = 0) the paper prints no gamma, and it has no effect.
_EXPERIMENT_GAINS: dict[str, tuple[Gain, Gain, Gain, Gain]] = {
    "Exp01": (0, 1, 1, 1),
    "Exp02": (20, 1, 1, 1),
    "Exp03": (20, 1, 1, "0.8"),
    "Exp04": (20, 1, 1, "0.6"),
    "Exp05": (20, 1, 1, "0.4"),
    "Exp06": (20, "98/100", "98/102", "0.4"),
    "Exp07": (20, "98/100", "98/102", 1),
    "Exp08": (20, "95/100", "95/105", "0.4"),
    "Exp09": (0, "95/100", "95/105", 1),
    "Exp10": (20, "95/100", "95/105", "0.8"),
    "Exp11": (20, "1.2", "1.2", 1),
    "Exp12": (0, "1.2", "1.2", 1),
    "Exp13": (0, "1.5", "1.5", 1),
}

EXPERIMENTS = tuple(
    LawPreset(
        name,
        "Table II",
        f"Row {name} of Table II.",
        {**_PAPER_GAINS, **dict(zip(_EXPERIMENT_KEYS, gains, strict=True))},
    )
    for name, gains in _EXPERIMENT_GAINS.items()
)

LAW_PRESETS = {preset.name: preset for preset in (*SPECIAL_CASES, *EXPERIMENTS)}


@dataclass(frozen=True)
class RobotPreset:
    """A robot's own numbers, as tables of a specification, with their source."""

    name: str
    source: str
    tables: dict[str, Any]


ROBOT_PRESETS = {
    preset.name: preset
    for preset in (
        RobotPreset(
            "faraman-at2",
            "Samsung Faraman-AT2, section IV-A of the paper: joints 1 to 3, gears 120:1, 2048 "
            "pulses a revolution read fourfold, motor torques 0.637, 0.637 and 0.319 N m.",
            {
                "sample_time_s": "0.001",
                "law": {
                    "inertia_kgm2": ["0.3818", "0.30545", "0.15296"],
                    **_PAPER_GAINS,
                },
                "encoder": {"counts_per_rev": 4 * 2048, "gear_ratio": 120},
                "drive": {"torque_limit_Nm": ["76.44", "76.44", "38.28"]},
            },
        ),
    )
}
