"""The page: one file with the C as WebAssembly in it, that asks for nothing from outside."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from codegen.controller import Controller, Joint, load
from codegen.floating_point import FieldValue
from codegen.layout import joint_config_values, layout
from codegen.presets import SPECIAL_CASES
from codegen.status import Status
from codegen.structs import Range
from verification.error_dynamics.analysis import RESOLUTION_RAD
from verification.error_dynamics.classes import Kind
from verification.experiments import CONTROLLERS
from verification.figures.page import embedded
from verification.paper import PAPER
from verification.playground import flight as flights
from verification.playground import vectors
from verification.playground.memory import text
from verification.style import pages

TEMPLATES = Path(__file__).parent / "templates"
SCRIPTS = ("memory", "rational", "dynamics", "robot", "vectors", "charts", "playground")
"""The page's own JavaScript, in the order in which it is read."""

_EXPONENTS = (Range.RESTORING_EXPONENT, Range.EXPONENT)


@dataclass(frozen=True)
class Slider:
    """A gain that the page can change.

    Attributes:
        name: of the gain in the page.
        label: its symbol.
        meaning: in plain words.
        unit: of its number.
        low, high, step: the range.
    """

    name: str
    label: str
    meaning: str
    unit: str
    low: Fraction
    high: Fraction
    step: Fraction

    @property
    def steps(self) -> int:
        """How many steps it is from end to end."""
        return int((self.high - self.low) / self.step)


SLIDERS = (
    Slider("kd", "KD", "damping of the error", "1/s if α = 1", *map(Fraction, ("1", "100", "1"))),
    Slider("kp", "KP", "stiffness", "1/s² if β = 1", *map(Fraction, ("5", "1000", "5"))),
    Slider("alpha", "α", "exponent of ė", "", *map(Fraction, ("1/2", "13/10", "1/200"))),
    Slider("beta", "β", "exponent of e", "", *map(Fraction, ("3/10", "19/10", "1/200"))),
    Slider("lambda", "λ", "correction", "1/s if γ = 1", *map(Fraction, ("0", "100", "1"))),
    Slider("gamma", "γ", "exponent of s", "", *map(Fraction, ("0", "3/2", "1/50"))),
    Slider("mbar", "M̄", "inertia", "", *map(Fraction, ("1/20", "5", "1/20"))),
)

GROUPS = (
    ("Error dynamics", ("kd", "kp", "alpha", "beta")),
    ("Correction of the delay’s error", ("lambda", "gamma")),
    ("Inertia", ("mbar",)),
)
"""Of the sliders."""

TITLES = {
    "hsia": "Hsia’s linear TDC",
    "jin": "Jin’s",
    "sliding-mode": "sliding mode",
    "terminal-sliding": "terminal sliding",
    "nonlinear-ded": "finite-time error",
    "enhanced": "enhanced inclusive",
}
"""Of the presets."""
FIRST, COMPARED = "enhanced", "hsia"
"""What the page begins with, and what it compares with."""

CLASSES = {
    Kind.FINITE_TIME: ("in finite time", "exactly zero, after a while"),
    Kind.EXPONENTIAL: ("exponentially", "a share per time: never exactly zero"),
    Kind.ASYMPTOTIC: ("asymptotically", "slower than any exponential near zero"),
}
"""How an error ends that a page's gains can have, in a word and in a sentence."""


def exact(value: Fraction) -> list[int]:
    """A fraction for the page."""
    return [value.numerator, value.denominator]


def gains_of(joint: Joint) -> dict[str, list[int]]:
    """The gains of a joint that the page's sliders have, Mbar as a factor of its own."""
    names = ("kd", "kp", "alpha", "beta", "gamma")
    own = {name: exact(getattr(joint, name)) for name in names}
    return own | {"lambda": exact(joint.lambda_), "mbar": [1, 1]}


def presets() -> list[dict[str, Any]]:
    """The law's special cases as gains for the sliders."""
    specification = CONTROLLERS / f"{flights.CONTROLLER}.toml"
    return [
        {
            "name": preset.name,
            "title": TITLES[preset.name],
            "meaning": preset.meaning,
            "equation": preset.equation,
            "gains": gains_of(load(specification, experiment=preset.name).joints[0]),
        }
        for preset in SPECIAL_CASES
    ]


def _gain_fields(controller: Controller) -> dict[str, Any]:
    """The fields of a joint's configuration that hold the law's gains, by the gain's name."""
    return {
        field.quantity: {"field": field.name, "exponent": field.range in _EXPONENTS}
        for field in layout(controller).joint_config.fields
        if field.quantity in {slider.name for slider in SLIDERS}
    }


def _inertias(controller: Controller) -> list[dict[str, list[FieldValue]]]:
    """What a joint's configuration has otherwise at each place of the slider of Mbar.

    That is Mbar itself, and what the guard takes for plausible, which follows from it.
    """
    (slider,) = (slider for slider in SLIDERS if slider.name == "mbar")
    made = []
    for k in range(slider.steps + 1):
        factor = slider.low + k * slider.step
        each = [
            joint_config_values(controller, replace(joint, inertia=factor * joint.inertia))
            for joint in controller.joints
        ]
        made.append({name: [values[name] for values in each] for name in each[0]})
    changing = [name for name in made[0] if made[0][name] != made[-1][name]]
    return [{name: values[name] for name in changing} for values in made]


def data_of(flight: flights.Flight) -> dict[str, Any]:
    """All that the page's scripts need to fly."""
    controller = flight.specification
    return {
        "controller": controller.name,
        "joint_names": [joint.name for joint in controller.joints],
        "inertias": _inertias(controller),
        "torque_limit_Nm": [float(joint.torque_limit) for joint in controller.joints],
        "rad_per_count": [joint.rad_per_count for joint in controller.joints],
        "resolution_rad": float(RESOLUTION_RAD),
        "gains": _gain_fields(controller),
        "structures": flights.layouts(flight),
        "arguments": flights.arguments(flight),
        "statuses": {int(status): [status.name, status.meaning] for status in Status},
        "sliders": [
            {
                "name": s.name,
                "low": exact(s.low),
                "step": exact(s.step),
                "steps": s.steps,
            }
            for s in SLIDERS
        ],
        "presets": presets(),
        "first": FIRST,
        "compared": COMPARED,
        "classes": {kind.value: says for kind, says in CLASSES.items()},
    }


def recordings() -> list[vectors.Recording]:
    """A recording of each shipped controller, with the gains of its specification."""
    return [vectors.record(each, each) for each in map(load, sorted(CONTROLLERS.glob("*.toml")))]


def first_torque(flight: flights.Flight) -> NDArray[Any]:
    """Torques of the page's first flight, by the host, shape (ticks, n)."""
    tuned = load(CONTROLLERS / f"{flights.CONTROLLER}.toml", experiment=FIRST)
    return flights.flown(flight, tuned).torque_commanded_Nm


def render() -> str:
    """The page; the same C gives the same bytes."""
    flight = flights.flight()
    recorded = recordings()
    return (
        pages(TEMPLATES)
        .get_template("playground.html.j2")
        .render(
            scripts=[f"{name}.js" for name in SCRIPTS],
            data=embedded(data_of(flight)),
            wasm=text(flights.wasm(flight)),
            recorded=embedded([vectors.for_page(one) for one in recorded]),
            first_torque=text(first_torque(flight).tobytes()),
            recorded_count=len(recorded),
            recorded_ticks=len(recorded[0].status),
            sliders=SLIDERS,
            groups=GROUPS,
            presets=presets(),
            ends=CLASSES.values(),
            joint_names=[joint.name for joint in flight.specification.joints],
            duration_s=round(len(flight.begin.reference.time_s) * flight.sample_time_s),
            paper=PAPER,
        )
    )


def write(path: Path) -> Path:
    """Writes the page."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(render(), encoding="utf-8")
    return path
