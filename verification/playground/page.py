"""The page: one file with the C as WebAssembly in it, that asks for nothing from outside."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from codegen.controller import Controller, Joint, load
from codegen.layout import layout
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
from verification.report.style import pages

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


SLIDERS = (
    Slider("kd", "KD", "damping of the error", "", Fraction(1), Fraction(100), Fraction(1)),
    Slider("kp", "KP", "stiffness of the error", "", Fraction(5), Fraction(1000), Fraction(5)),
    Slider("alpha", "α", "exponent of the velocity error", "",
           Fraction(1, 2), Fraction(13, 10), Fraction(1, 200)),
    Slider("beta", "β", "exponent of the position error", "",
           Fraction(3, 10), Fraction(19, 10), Fraction(1, 200)),
    Slider("lambda", "λ", "correction of what the delay misses", "",
           Fraction(0), Fraction(100), Fraction(1)),
    Slider("gamma", "γ", "exponent of the correction", "",
           Fraction(0), Fraction(3, 2), Fraction(1, 50)),
    Slider("mbar", "M̄", "the law’s inertia, times the paper’s", "",
           Fraction(1, 20), Fraction(5, 2), Fraction(1, 20)),
)  # fmt: skip


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
    Kind.FINITE_TIME: ("in finite time", "exactly zero after a while, and not just nearly"),
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
    wanted = {slider.name for slider in SLIDERS} - {"mbar"} | {"inertia"}
    return {
        field.quantity: {"field": field.name, "exponent": field.range in _EXPONENTS}
        for field in layout(controller).joint_config.fields
        if field.quantity in wanted
    }


def data_of(flight: flights.Flight) -> dict[str, Any]:
    """All that the page's scripts need to fly."""
    controller = flight.specification
    return {
        "controller": controller.name,
        "joint_names": [joint.name for joint in controller.joints],
        "inertia": [exact(joint.inertia) for joint in controller.joints],
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
                "steps": int((s.high - s.low) / s.step),
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
