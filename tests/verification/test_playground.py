"""The playground in a browser: its C has the host's bits, and its sliders do what they say."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from codegen.controller import Controller, load
from codegen.sig_pow import exponent_q31
from codegen.status import Status
from plant.closed_loop import Run
from plant.compiled import loop
from plant.native import GENERATED, CompilerError, shared_library
from plant.units import units
from tests.chromium import BrowserError, Page, chromium
from verification.chain.vectors import recorded
from verification.equivalence import compiled, run
from verification.error_dynamics.classes import approach, classify
from verification.error_dynamics.model import Parameters, finite_time_beta
from verification.error_dynamics.phase_plane import equilibrium
from verification.experiments import CONTROLLERS
from verification.figures.flow import FOLDER as FLOW_FOLDER
from verification.figures.flow import ErrorDynamics, flow
from verification.playground import flight as flights
from verification.playground import page as playground
from verification.playground import vectors, wasm
from verification.playground.memory import structures

Gains = Mapping[str, Fraction]

NAMES = tuple(path.stem for path in sorted(CONTROLLERS.glob("*.toml")))
PHONE, DESKTOP = (390, 844), (1280, 900)


@pytest.fixture(scope="session")
def html(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return playground.write(tmp_path_factory.mktemp("playground") / "index.html")


@pytest.fixture(scope="session")
def browser(html: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with chromium(tmp_path_factory.mktemp("chromium")) as page:
        page.resize(*DESKTOP)
        page.open(html)
        page.evaluate("playground.then(() => 0)")
        yield page


@pytest.fixture
def page(browser: Page) -> Iterator[Page]:
    """The page at its beginning; it may not complain, nor ask for anything."""
    browser.resize(*DESKTOP)
    browser.click("#reset")
    yield browser
    assert browser.complaints == []
    assert browser.requests == []


@pytest.fixture(scope="session")
def flight() -> flights.Flight:
    return flights.flight()


def decoded(base64_text: str, like: NDArray[Any]) -> NDArray[Any]:
    return np.frombuffer(base64.b64decode(base64_text), like.dtype).reshape(like.shape)


def js(gains: Gains) -> str:
    return json.dumps({name: [x.numerator, x.denominator] for name, x in gains.items()})


def tuned(specification: Controller, gains: Gains) -> Controller:
    """The gains as a specification: the independent way from a slider to the C."""
    own = {"lambda_" if name == "lambda" else name: x for name, x in gains.items()}
    mbar = own.pop("mbar")
    joints = (replace(j, **own, inertia=j.inertia * mbar) for j in specification.joints)  # type: ignore[arg-type]
    return replace(specification, joints=tuple(joints))


def slid(page: Page) -> dict[str, Fraction]:
    """What the page has its sliders say."""
    found: dict[str, list[int]] = page.evaluate("state.gains")
    return {name: Fraction(*x) for name, x in found.items()}


BASE64 = """
function base64(array) {
  const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
  let text = "";
  for (let i = 0; i < bytes.length; i += 8192) {
    text += String.fromCharCode(...bytes.subarray(i, i + 8192));
  }
  return btoa(text);
}
"""


def records(page: Page, expression: str) -> dict[str, Any]:
    """A flight of the page: how it ended, and its records in Base64."""
    found: dict[str, Any] = page.evaluate(
        f"(async () => {{ {BASE64} const f = await {expression};"
        "return { end: f.end, ticks: f.ticks, status: f.status, record: Object.fromEntries("
        "Object.entries(f.record).map(([name, array]) => [name, base64(array)])) }; })()"
    )
    return found


def assert_flown_alike(found: dict[str, Any], host: Run) -> None:
    """Torques, counts, statuses and the motion itself, bit for bit."""
    for name, own in {
        "torque_commanded": host.torque_commanded_Nm,
        "counts": host.counts,
        "status": host.status,
        "q": host.q,
        "qd": host.qd,
        "torque_applied_Nm": host.torque_applied_Nm,
        "friction_Nm": host.friction_Nm,
    }.items():
        assert base64.b64decode(found["record"][name]) == np.ascontiguousarray(own).tobytes(), name


# --- The C -------------------------------------------------------------------------------------


def c_name(structure: str) -> str:
    """The C's name of a structure that the page knows."""
    if structure == "Gains":
        return "flow_gains"
    if structure.startswith("Loop"):
        return f"loop_{structure.removeprefix('Loop').lower()}"
    return f"tdc_puma3_{structure}"


def test_the_compiler_agrees_with_the_layout(flight: flights.Flight) -> None:
    lines = ["#include <stddef.h>", '#include "loop.h"', '#include "flow.h"',
             '#include "tdc_puma3.h"', "void nothing(void) {}"]  # fmt: skip
    for name, structure in flights.layouts(flight).items():
        own = c_name(name)
        lines.append(f'_Static_assert(sizeof({own}) == {structure["size"]}, "");')
        for field, (_, offset, _) in structure["fields"].items():
            lines.append(f'_Static_assert(offsetof({own}, {field}) == {offset}, "");')
    assert len(lines) > 70
    folders = (loop.FOLDER, FLOW_FOLDER, GENERATED / "puma3")
    headers = {p.name: p.read_bytes() for folder in folders for p in folder.glob("*.h")}
    source = "\n".join(lines) + "\n"
    wasm.module("layout", {**headers, "layout.c": source.encode()}, ["nothing"])
    right = "offsetof(loop_script, timings) == 0"
    wrong = source.replace(right, right.replace("0", "4"))
    assert wrong != source
    with pytest.raises(CompilerError, match="static assertion failed"):
        wasm.module("layout", {**headers, "layout.c": wrong.encode()}, ["nothing"])


def test_missing_compiler_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(CompilerError, match=r"ziglang.*make setup"):
        wasm.module("nothing", {}, [])


def test_modules_import_nothing(page: Page) -> None:
    recorded_ones = [f"JSON.parse(byId('recorded').textContent)[{k}].wasm" for k in range(5)]
    for text in ("byId('wasm').textContent", *recorded_ones):
        script = f"WebAssembly.Module.imports(new WebAssembly.Module(bytesOf({text}))).length"
        assert page.evaluate(script) == 0


def test_the_page_finds_the_bits_of_the_host(page: Page) -> None:
    answers = page.evaluate("playground.then((begun) => begun.answers)")
    assert [answer["name"] for answer in answers] == [*NAMES, "robot and controller"]
    assert [answer["different"] for answer in answers] == [[]] * 6
    assert [answer["ticks"] for answer in answers] == [1200] * 5 + [12000]
    cells = page.evaluate(
        "[...document.querySelectorAll('#proof tbody tr')].map((row) => row.lastChild.textContent)"
    )
    assert cells == ["yes, all"] * 6


def test_the_page_would_find_a_wrong_bit(page: Page) -> None:
    told = page.evaluate(
        "(() => { const one = JSON.parse(byId('recorded').textContent)[1];"
        "const torque = bytesOf(one.torque); torque[12 * 700 + 3] ^= 1;"
        "one.torque = btoa(String.fromCharCode(...torque)); return repeat(one).different; })()"
    )
    assert told == [700]


def spoiled(specification: Controller, rng: np.random.Generator) -> vectors.Recording:
    """A recorded flight with random gains, in which every tenth tick has some random bits."""
    # Within what a controller in integers was made for.
    gains = {
        "kd": Fraction(int(rng.integers(5, 20))),
        "kp": Fraction(int(rng.integers(10, 100))),
        "lambda": Fraction(int(rng.integers(0, 20))),
        "alpha": Fraction(int(rng.integers(80, 95)), 100),
        "beta": Fraction(int(rng.integers(60, 90)), 100),
        "gamma": Fraction(int(rng.integers(10, 40)), 100),
        "mbar": Fraction(int(rng.integers(5, 20)), 20),
    }
    recording = vectors.record(specification, specification, speed=20.0 / 3.0)
    host, inputs = recording.controller, recording.inputs.copy()
    host.set_gains(tuned(specification, gains))
    host.config.max_lost_ticks = 1023
    rows = np.flatnonzero(rng.random(len(inputs)) < 0.1)
    for row in rows:
        name = rng.choice(inputs.dtype.names or ())
        joint = rng.integers(host.joints)
        width = inputs[name].dtype.itemsize
        inputs[name][row, joint] = np.frombuffer(rng.bytes(width), inputs[name].dtype)[0]
    held = units(specification).torque.physical(recording.holding_torque).astype(np.float64)
    return vectors.repeated(host, recording.counts, held, inputs)


@pytest.mark.parametrize("name", NAMES)
def test_other_gains_and_broken_inputs_give_the_host_s_bits(page: Page, name: str) -> None:
    rng = np.random.default_rng(sum(name.encode()))
    recording = spoiled(load(CONTROLLERS / f"{name}.toml"), rng)
    assert (recording.status < 0).sum() > 50
    assert (recording.status >= 0).sum() > 500
    assert len(np.unique(recording.torque[:, 0])) > 200
    told = page.evaluate(f"repeat({json.dumps(vectors.for_page(recording))})")
    assert told == {"name": name, "ticks": len(recording.status), "different": []}


CASES = """
((given) => {
  const module = new Module(bytesOf(given.wasm), given.structures);
  const step = module.exports[`tdc_${given.name}_step`];
  const parts = ["config", "state", "input"].map((part) => module.copy(bytesOf(given[part])));
  const sizes = ["config", "state", "input"].map((part) => module.sizeOf(part));
  const torque = module.reserve(4 * given.joints * given.count);
  const status = Int32Array.from({ length: given.count }, (_, k) =>
    step(...parts.map((part, i) => part + k * sizes[i]), torque + 4 * given.joints * k));
  return {
    status: base64(status),
    torque: base64(module.view("f32", torque, given.joints * given.count)),
    state: base64(module.view("u8", parts[1], sizes[1] * given.count)),
  };
})
"""


@pytest.mark.parametrize("name", ["puma3", "puma3_precise", "puma6"])
def test_the_chain_s_vectors_give_the_host_s_bits(page: Page, name: str) -> None:
    specification = load(CONTROLLERS / f"{name}.toml")
    library = compiled(specification, shared_library(GENERATED / name))
    cases = recorded(library, 300).cases
    given = {
        "name": name,
        "joints": len(specification.joints),
        "count": len(cases),
        "wasm": base64.b64encode(vectors.wasm(specification)).decode(),
        "structures": structures(library.types.config, library.types.state, library.types.input),
        **{
            part: base64.b64encode(getattr(cases, part).tobytes()).decode()
            for part in ("config", "state", "input")
        },
    }
    told = page.evaluate(f"(() => {{ {BASE64} return {CASES.strip()}({json.dumps(given)}); }})()")
    state = np.ascontiguousarray(cases.state)
    own = replace(cases, config=np.ascontiguousarray(cases.config), state=state,
                  input=np.ascontiguousarray(cases.input))  # fmt: skip
    torque, status = run(library, own)
    assert len(np.unique(status)) >= 5
    assert (decoded(told["status"], status.astype(np.int32)) == status).all()
    assert base64.b64decode(told["torque"]) == torque.tobytes()
    assert base64.b64decode(told["state"]) == state.tobytes()


# --- Gains and flights -------------------------------------------------------------------------


def grid() -> Iterator[dict[str, Fraction]]:
    """Gains over all sliders, ends included."""
    rng = np.random.default_rng(7)
    for k in range(200):
        yield {
            s.name: s.low
            + s.step
            * (
                int((s.high - s.low) / s.step) * (k % 2)
                if k < 2
                else int(rng.integers(0, int((s.high - s.low) / s.step) + 1))
            )
            for s in playground.SLIDERS
        }


def test_sliders_fill_the_configuration_as_a_specification_does(
    page: Page, flight: flights.Flight
) -> None:
    sets = list(grid())
    sets += [{**gains, "beta": finite_time_beta(gains["alpha"])} for gains in sets]
    texts = page.evaluate(
        f"(() => {{ {BASE64} return [{','.join(map(js, sets))}].map((gains) => {{"
        "const verdict = robot.tune(gains); return [verdict, base64(robot.module.view('u8',"
        "robot.config, robot.module.sizeOf('config')))]; }); })()"
    )
    host = vectors.shipped(flight.specification)
    for gains, (verdict, text) in zip(sets, texts, strict=True):
        host.set_gains(tuned(flight.specification, gains))
        assert base64.b64decode(text) == bytes(host.config), gains
        assert verdict == host.check_config() == 0, gains


def test_exponents_are_rounded_as_codegen_does(page: Page) -> None:
    exponents = [
        Fraction(n, d) for d in (1, 3, 7, 200, 381, 2**32) for n in (0, 1, d - 1, d, d + 1)
    ]
    exponents += [Fraction(2**31 + 1, 2**32), Fraction(2**31 + 3, 2**32), Fraction(2)]
    found = page.evaluate(
        f"{json.dumps([[x.numerator, x.denominator] for x in exponents])}.map(exponentQ31)"
    )
    assert found == [exponent_q31(x) for x in exponents]


def test_whole_flights_have_the_host_s_bits(page: Page, flight: flights.Flight) -> None:
    enhanced = {name: Fraction(*x) for name, x in playground.presets()[-1]["gains"].items()}
    changes: list[dict[str, Fraction]] = [
        {},
        {"alpha": Fraction(4, 5), "beta": Fraction(2, 3), "gamma": Fraction(0)},
        {"alpha": Fraction(6, 5), "beta": Fraction(6, 5), "lambda": Fraction(0), "kd": Fraction(7)},
        {"mbar": Fraction(1, 10), "kp": Fraction(400)},
    ]
    for change in changes:
        gains = enhanced | change
        found = records(page, f"robot.fly({js(gains)})")
        assert (found["end"], found["ticks"]) == (0, 12000)
        assert_flown_alike(found, flights.flown(flight, tuned(flight.specification, gains)))


def test_trajectories_have_the_host_s_bits(page: Page) -> None:
    for kd, alpha, beta in ((20, "19/20", "19/21"), (35, "1/2", "1/3"), (5, "13/10", "1/2")):
        dynamics = ErrorDynamics(kd, 100.0, Fraction(alpha), Fraction(beta))
        gains = {"kd": Fraction(kd), "kp": Fraction(100), "alpha": Fraction(alpha),
                 "beta": Fraction(beta)}  # fmt: skip
        _, own = flow(dynamics, (0.7, -3.0), 1.0, 1e-3, 1e-4)
        text = page.evaluate(
            f"(() => {{ {BASE64} return base64(robot.flow({js(gains)}, [0.7, -3], 1e-4, 10, 1001));"
            " })()"
        )
        assert base64.b64decode(text) == own.tobytes()


def test_classes_are_those_of_the_error_dynamics(page: Page) -> None:
    exponents = [Fraction(n, 20) for n in range(4, 38, 3)] + [Fraction(1), Fraction(19, 21)]
    cases = []
    for alpha in exponents:
        for beta in {*exponents, finite_time_beta(alpha)}:
            for kd, stiffness in ((20, 100), (3, 40), (50, 625), (21, 100), (22, 100)):
                cases.append(Parameters(Fraction(kd), Fraction(stiffness), alpha, beta))
    # KD = KD* exactly, or all but.
    critical = [(Fraction(10), Fraction(25), Fraction(1), Fraction(1))]
    for k in (Fraction(1), Fraction(3), *(Fraction(n, 7) for n in range(3, 30, 5))):
        critical.append((Fraction(8, 3) * k**3, 2 * k**4, Fraction(1, 2), Fraction(1, 3)))
    for least, kp, alpha, beta in critical:
        for off in (0, Fraction(1, 10**12), -Fraction(1, 10**12)):
            cases.append(Parameters(least + off, kp, alpha, beta))
    given = [
        {n: [getattr(p, s).numerator, getattr(p, s).denominator]
         for n, s in (("kd", "KD"), ("kp", "KP"), ("alpha", "alpha"), ("beta", "beta"))}
        for p in cases
    ]  # fmt: skip
    found = page.evaluate(
        f"{json.dumps(given)}.map((g) => [classOf(g.alpha, g.beta),"
        " originOf(g.kd, g.kp, g.alpha, g.beta)])"
    )
    own = []
    for p in cases:
        origin = approach(p) or equilibrium(p)
        own.append([classify(p).kind.value, origin.value])
    assert found == own
    assert {kind for kind, _ in own} == {"finite-time", "exponential", "asymptotic"}
    assert {origin for _, origin in own} == {"node", "critical node", "focus"}


# --- The page under a hand ---------------------------------------------------------------------


def share(name: str, value: Fraction) -> float:
    """Where a slider's thumb is for a value."""
    (s,) = (s for s in playground.SLIDERS if s.name == name)
    return float((value - s.low) / (s.high - s.low))


def test_dragged_sliders_fly_the_host_s_flight(page: Page, flight: flights.Flight) -> None:
    before = slid(page)
    for name, target in (("kd", "45"), ("alpha", "0.8"), ("gamma", "0.6"), ("mbar", "0.5"),
                         ("kp", "300"), ("lambda", "40")):  # fmt: skip
        page.drag(f"#slider-{name}", share(name, before[name]), share(name, Fraction(target)))
    gains = slid(page)
    assert gains["beta"] == finite_time_beta(gains["alpha"]), "tied"
    page.drag("#slider-beta", share("beta", gains["beta"]), share("beta", Fraction("0.9")))
    gains = slid(page)
    assert not page.evaluate("byId('tie').checked"), "a hand on beta unties it"
    wanted = {"kd": 45.0, "alpha": 0.8, "gamma": 0.6, "mbar": 0.5, "beta": 0.9}
    for name, value in wanted.items():
        assert gains[name] != before[name], name
        assert float(gains[name]) == pytest.approx(value, rel=0.08), name
    found = records(page, "settled().then(() => shown.now.flight)")
    host = flights.flown(flight, tuned(flight.specification, gains))
    assert_flown_alike(found, host)
    texts = page.evaluate(
        "['class', 'origin', 'rms', 'activity'].map((id) => byId(id).textContent)"
    )
    kind = classify(Parameters(*(gains[n] for n in ("kd", "kp", "alpha", "beta")))).kind
    assert texts[0] == playground.CLASSES[kind][0]
    assert float(texts[2]) == pytest.approx(1e3 * host.rms_error_deg()[0], rel=0.06)
    steps = np.diff(host.torque_applied_Nm[:, 0])
    assert float(texts[3]) == pytest.approx(np.sqrt(np.mean(steps**2)), rel=0.06)


def test_presets_set_their_gains_and_reset_goes_back(page: Page, flight: flights.Flight) -> None:
    first = slid(page)
    for preset in playground.presets():
        page.click(f"[data-preset={preset['name']}]")
        gains = load(CONTROLLERS / "puma3.toml", experiment=preset["name"]).joints[0]
        now = slid(page)
        assert (now["kd"], now["alpha"], now["gamma"]) == (gains.kd, gains.alpha, gains.gamma)
        assert (now["kp"], now["beta"], now["lambda"]) == (gains.kp, gains.beta, gains.lambda_)
        pressed = page.evaluate(
            "[...document.querySelectorAll('[aria-pressed=true]')].map((b) => b.dataset.preset)"
        )
        assert pressed == [preset["name"]]
    page.click("[data-preset=hsia]")
    page.click("#reset")
    assert slid(page) == first
    found = records(page, "settled().then(() => shown.now.flight)")
    assert_flown_alike(found, flights.flown(flight, flight.specification))


def test_dynamics_are_drawn_from_where_the_hand_presses(page: Page) -> None:
    x, y, width, height = page.box("#phase")
    page.mouse("mouseMoved", x + width / 2, y + height / 3)
    page.mouse("mousePressed", x + width / 2, y + height / 3, buttons=1)
    page.mouse("mouseMoved", x + width / 4, y + height / 3, buttons=1)
    page.mouse("mouseReleased", x + width / 4, y + height / 3)
    e, rate = page.evaluate("state.start")
    assert e < -0.4
    assert rate > 2
    assert page.evaluate("charts.settle.shown.lines.at(-1).y[0]") == pytest.approx(-e)


@pytest.mark.parametrize(
    ("unsafe", "says"),
    [
        ({"mbar": [5, 1]}, "so violent"),
        ({"kd": [6, 1], "kp": [255, 1], "beta": [13, 40], "alpha": [169, 200]}, "at its limit"),
    ],
)
def test_unsafe_gains_say_so(page: Page, unsafe: dict[str, list[int]], says: str) -> None:
    assert page.evaluate("settled().then(() => byId('alarm').hidden)")
    page.evaluate(
        f"(() => {{ choose({{ ...state.gains, ...{json.dumps(unsafe)} }}); return settled(); }})()"
    )
    assert page.evaluate("!byId('alarm').hidden")
    assert says in page.evaluate("byId('alarm').textContent")


def test_what_is_kept_is_drawn_in_grey(page: Page) -> None:
    hsia = page.evaluate("settled().then(() => (globalThis.before = shown.kept).rms)")
    page.click("[data-preset=jin]")
    page.evaluate("settled()")
    page.click("#keep")
    page.click("#reset")
    kept, name = page.evaluate("settled().then(() => [shown.kept.rms,"
                               "document.querySelector('.kept-name').textContent])")  # fmt: skip
    assert name == "kept"
    assert (np.array(kept) < np.array(hsia)).all(), "Jin's is better than Hsia's, as in Table II"
    drawn = page.evaluate("Array.from(charts.error.shown.lines[0].y.slice(3200, 3300))")
    assert drawn == page.evaluate(
        "Array.from(shown.kept.error[0].slice(3200, 3300), (e) => 1e3 * e)"
    )
    page.evaluate("keep(before, 'Hsia’s linear TDC')")


def test_the_pointer_reads_values(page: Page) -> None:
    page.evaluate("settled()")
    x, y, width, height = page.box("#error")
    page.mouse("mouseMoved", x + width / 2, y + height / 2)
    told = page.evaluate("charts.error.reading.textContent")
    found = re.fullmatch(r"([\d.]+) s, grey (\S+), now (\S+)", told)
    assert found is not None, told
    tick = round(float(found[1]) * 1000)
    for text, which in ((found[2], "kept"), (found[3], "now")):
        own = page.evaluate(f"shown.{which}.error[0][{tick}]")
        assert float(text.replace("−", "-")) == pytest.approx(1000 * own, rel=0.01)
    page.mouse("mouseMoved", 2, 2)
    assert page.evaluate("charts.error.reading.hidden")


def test_how_a_flight_ended_is_said(page: Page) -> None:
    assert page.evaluate("alarmOf({ end: 0, ticks: 12000, status: 0 }, 0, 0)") == ""
    stopped = page.evaluate("alarmOf({ end: 1, ticks: 1234, status: -7 }, 0, 20)")
    assert "1.234 s" in stopped
    assert f"TDC_STOPPED: {Status.STOPPED.meaning}" in stopped
    assert "all bounds" in page.evaluate("alarmOf({ end: 2, ticks: 1, status: 0 }, 0, 0)")


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("size", [PHONE, (320, 640), (768, 1024), DESKTOP])
def test_no_page_is_wider_than_its_window(page: Page, size: tuple[int, int], dark: bool) -> None:
    page.resize(*size, dark=dark, phone=size[0] < 600)
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (int(re.findall(r"\d+", background)[0]) < 60) is dark


def test_charts_are_drawn_in_every_tab_of_a_phone(page: Page) -> None:
    page.resize(*PHONE, phone=True)
    for tab in ("error", "torque", "motion", "phase", "settle"):
        page.evaluate(f"document.querySelector('[name=tab][value={tab}]').click()")
        page.evaluate("new Promise((r) => requestAnimationFrame(() => setTimeout(r, 50)))")
        inked = page.evaluate(
            f"(() => {{ const c = byId('{tab}'); const d = c.getContext('2d').getImageData(0, 0,"
            "c.width, c.height).data; let n = 0; for (let i = 3; i < d.length; i += 4)"
            "{ n += d[i] > 0; } return [n, c.clientWidth]; })()"
        )
        assert inked[0] > 2000, tab
        assert inked[1] > 300, tab


def test_every_axis_has_a_name_and_a_unit(page: Page) -> None:
    labels = page.evaluate("Object.values(charts).flatMap((chart) => [chart.x, chart.y])")
    assert len(labels) == 10
    for label in labels:
        assert re.fullmatch(r".+ \[(10⁻³ deg|deg|s|N m|rad|rad/s)\]", label), label


def test_without_webassembly_the_page_says_so(html: Path, tmp_path: Path) -> None:
    with chromium(tmp_path) as page:
        page.call("Page.enable")
        page.call("Page.addScriptToEvaluateOnNewDocument", source="delete globalThis.WebAssembly")
        page.open(html)
        assert "no WebAssembly" in page.evaluate("byId('fatal').innerText")
        assert page.evaluate("byId('main').hidden")
        assert page.complaints == []


def test_the_page_names_no_address(html: Path) -> None:
    text = html.read_text(encoding="utf-8")
    assert not re.search(r"https?:", text)
    assert not re.search(r"<(?:link|img|iframe|object|embed)\b|\bsrc=|@import|url\(", text)
    assert "default-src 'none'" in text
    assert len(text) < 3_000_000


def test_a_missing_browser_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BrowserError, match=r"apt-get install .*chromium"), chromium(tmp_path):
        pass
