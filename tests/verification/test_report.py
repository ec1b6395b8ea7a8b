"""The page needs nothing but itself, and says the same as its JSON."""

from __future__ import annotations

import base64
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from plotly.offline import get_plotlyjs

from codegen.controller import load
from tests.chromium import Page as Browser
from tests.chromium import chromium
from verification.__main__ import main
from verification.accuracy import ARITHMETICS
from verification.certificates.sig_pow.present import shipped
from verification.certificates.sig_pow.present import verdict as prove_and_check
from verification.commands.output import stoppable
from verification.equivalence import check
from verification.evidence import Evidence, current_json, generated_sha256, write_json
from verification.experiments import CONTROLLERS, Experiment, Outcome
from verification.figures.catalogue import BUILDERS
from verification.figures.page import embedded
from verification.report import certificates
from verification.report.content import Results, law_block, scientific
from verification.report.page import render, write
from verification.report.processor import Processor
from verification.report.studies import NOTHING, found
from verification.style import PAGE_COLOURS
from verification.symbolic import all_proofs
from verification.table2.fly import PLANTS, fly_table
from verification.tuning_check.verdict import Finding, Severity

_CELL = {
    "row": "Exp08",
    "rms_deg": [0.001, 0.002, 0.003],
    "difference": [0.001, -0.002, 0.0],
    "difference_error": [0.004, 0.005, 0.0],
}
ACCURACY = {
    "phases": 4,
    "cells": [{**_CELL, "controller": name} for name in ARITHMETICS],
    "mean_difference": dict.fromkeys(ARITHMETICS, 0.0012),
    "largest_difference": dict.fromkeys(ARITHMETICS, 0.0345),
}

VOID = {"meta", "br", "hr", "img", "link", "input", "path", "use"}


class Page(HTMLParser):
    """Collects identifiers, references, tags and what isn't closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.references: list[str] = []
        self.tags: Counter[str] = Counter()
        self.attributes: list[tuple[str, str]] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Opens an element."""
        self._take(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Takes an element that is closed at once."""
        self._take(tag, attrs)

    def handle_endtag(self, tag: str) -> None:
        """Closes the element that was opened last."""
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def _take(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        for key, value in attrs:
            value = value or ""
            self.attributes.append((key, value))
            if key == "id":
                self.ids.append(value)
            if key in ("href", "xlink:href"):
                self.references.append(value)
            self.references += [f"#{i}" for i in re.findall(r"url\(#([^)]*)\)", value)]


@pytest.fixture(scope="session")
def results(outcomes: Mapping[Experiment, Outcome]) -> Results:
    equivalence = {
        name: (check(load(CONTROLLERS / f"{name}.toml"), 500),) for name in ("puma3", "puma6")
    }
    kernels = [prove_and_check(*kernel, every=False) for kernel in shipped()]
    processor = Processor(None, None, None, None)
    tables = fly_table(PLANTS[::3], phases=1)
    return Results(
        outcomes,
        equivalence,
        all_proofs(),
        500,
        processor,
        kernels,
        ACCURACY,
        tables,
        NOTHING,
        [BUILDERS["convergence"]()],
        certificates.found(),
    )


@pytest.fixture(scope="session")
def html(results: Results) -> str:
    return render(results)


@pytest.fixture(scope="session")
def page(html: str) -> Page:
    return Page(html)


def test_the_page_asks_for_nothing_from_outside(html: str, page: Page) -> None:
    assert not re.findall("https?://", html.replace(get_plotlyjs(), ""))
    assert "default-src 'none'" in html
    assert "@import" not in html.replace(get_plotlyjs(), "")
    assert not {"link", "img", "iframe", "object", "embed"} & page.tags.keys()
    assert not [a for a in page.attributes if a[0] in ("src", "srcset", "data", "poster")]
    assert all(reference.startswith("#") for reference in page.references)
    assert not re.findall(r"url\((?!#)", html.replace(get_plotlyjs(), ""))


def test_every_anchor_resolves_to_one_place(page: Page) -> None:
    assert {reference.removeprefix("#") for reference in page.references} <= set(page.ids)
    assert [i for i, count in Counter(page.ids).items() if count > 1] == []
    assert page.open == []


def test_every_picture_is_inside_with_a_description(html: str, page: Page) -> None:
    assert page.tags["svg"] == page.tags["figure"] == page.tags["figcaption"] == 9
    assert html.replace(get_plotlyjs(), "").count('role="img" aria-label="') == 9
    for label in ("time [s]", "velocity [deg/s]", "|e| [deg]", "RMS error [deg]", "τ [N m]",
                  "friction [N m]", "torque [% of limit]"):  # fmt: skip
        assert label in html


def test_pictures_take_the_pages_colours(html: str) -> None:
    assert "currentColor" in html
    assert "prefers-color-scheme: dark" in html
    stills = re.sub(r'<script type="application/json".*?</script>', "", html, flags=re.DOTALL)
    for stand_in in ("#010203", "#040506"):
        assert stand_in not in stills.replace(embedded(PAGE_COLOURS), "")


def test_the_first_screen_answers_four_questions_with_evidence(html: str) -> None:
    head = html[html.index("<body") : html.index("<main>")]
    assert re.findall(r"<h2>(.*?)</h2>", head) == [
        "What is it?",
        "Is it safe?",
        "How good is it?",
        "What does it cost?",
    ]
    for evidence in ("proved", "measured", "sampled"):
        assert f'<span class="badge {evidence}">' in head
    assert 'name="viewport" content="width=device-width' in html
    assert "key bad" not in head
    assert "run <code>make bench</code>" in head


def test_every_section_is_reached_from_the_first_screen(html: str) -> None:
    head, body = html[html.index("<body") :].split("<main>")
    sections = set(re.findall(r'<section id="([\w-]+)"', body))
    assert sections <= set(re.findall(r'href="#([\w-]+)"', head))


def test_no_time_and_no_machine_is_in_it(html: str) -> None:
    assert not re.search(r"\b20[2-9]\d-\d\d-\d\d\b", html)
    for path in (Path.cwd(), Path.home()):
        assert f"{path}/" not in html


def test_the_same_results_give_the_same_page(results: Results, html: str) -> None:
    assert render(results) == html


def test_what_is_wrong_is_shown(results: Results) -> None:
    failed = tuple(
        type(p)(p.name, p.equation, p.statement, p.steps, "x", False) for p in results.proofs
    )
    bad = render(replace(results, proofs=failed))
    assert "key bad" in bad
    assert "✗" in bad


def a_flight(board: str, equal: bool) -> dict[str, object]:
    return {
        "board": board,
        "core": board.upper(),
        "controller": "puma3",
        "experiment": "Exp08",
        "link": "semihosting",
        "ticks": 12000,
        "equal": equal,
        "seconds": 0.3,
        "seconds_total": 1.5,
        "target_sha256": "ab" * 32,
    }


def test_flights_on_processors_are_shown_with_their_verdict(results: Results) -> None:
    without = render(results)
    assert "<code>make pil</code>" in without
    for equal, verdict in ((True, "2 of 2 flights are bit-equal"), (False, "1 of 2 flights are")):
        flights = [a_flight("one", True), a_flight("two", equal)]
        html = render(replace(results, processor=Processor(flights, None, None, None)))
        assert verdict in " ".join(html.split())
        assert ("key bad" in html) == (not equal)
        assert ("DIFFER" in html) == (not equal)
        assert "<code>make pil</code>," not in html


def test_figures_of_another_c_are_not_shown(tmp_path: Path) -> None:
    left = tmp_path / "pil.json"
    assert current_json(left) is None
    for sha256, shown in ((generated_sha256(), True), ("0" * 64, False)):
        write_json({"generated_sha256": sha256, "runs": []}, left)
        assert (current_json(left) is not None) == shown


def test_page_and_json_are_written_with_the_same_figures(results: Results, tmp_path: Path) -> None:
    path = write(results, tmp_path)
    assert path == tmp_path / "index.html"
    data = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert len(data["proofs"]) == len(results.proofs)
    best = next(r for r in data["table_2"] if r["experiment"] == "Exp08")
    text = path.read_text(encoding="utf-8")
    for value in best["ours_deg"]:
        assert f"{value:.4f}" in text
    keys = [key for answer in data["answers"] for key in answer["keys"]]
    assert {key["evidence"] for key in keys} == {"measured", "sampled", "proved"}


def test_the_block_of_c_holds_every_quantity() -> None:
    quantities, lines = law_block(load(CONTROLLERS / "puma3.toml"))
    text = "\n".join(line.text for line in lines)
    for quantity in quantities:
        assert f"const float {quantity['name']} =" in text
    assert all(line.defines for line in lines if line.equation)
    assert lines[-1].text.rstrip().endswith("*/")


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0"), (0.25, "0.25"), (1.25e-7, "1.2·10⁻⁷"), (3e5, "3.0·10⁵")]
)
def test_small_numbers_are_written_for_a_reader(value: float, text: str) -> None:
    assert scientific(value) == text


# --- The command line --------------------------------------------------------------------------


@pytest.fixture
def scratch(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    return tmp_path


def test_symbolic_leaves_its_json(scratch: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["symbolic", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert json.loads((scratch / "symbolic.json").read_text(encoding="utf-8")) == printed
    assert all(proof["holds"] for proof in printed["proofs"])


@pytest.mark.usefixtures("scratch")
def test_formulas_are_printed_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["symbolic"]) == 0
    assert "s[k+1] - s[k] = L (ε[k]" in " ".join(capsys.readouterr().out.split())


def test_equivalence_leaves_its_json(scratch: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["equivalence", "--steps", "100", "--controller", "puma3"]) == 0
    data = json.loads((scratch / "equivalence.json").read_text(encoding="utf-8"))
    assert data["summaries"][0]["tally"]["steps"] == 24 * 100
    assert "puma3" in capsys.readouterr().out


@pytest.mark.parametrize("steps", ["0", "99", "many", "-5", "1e5"])
def test_a_bad_number_of_steps_is_refused(steps: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["equivalence", "--steps", steps])
    assert stop.value.code == 2
    assert "number of steps" in capsys.readouterr().err


@pytest.mark.usefixtures("scratch")
def test_an_unknown_controller_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["equivalence", "--controller", "puma9"]) == 2
    assert "puma9.toml" in capsys.readouterr().err


def test_ctrl_c_ends_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted() -> int:
        raise KeyboardInterrupt

    assert stoppable(interrupted) == 130
    assert "Interrupted: results are written at the end" in capsys.readouterr().err
    assert stoppable(lambda: 2) == 2


# --- What longer commands left -----------------------------------------------------------------

SHARE = {"count": 19, "of": 20, "share": 0.95, "low": 0.7513, "high": 0.9987}
STANDING = {
    "plants": 20,
    "groups": [{"best_on_both": SHARE, "fine": SHARE}],
    "rows": [{"row": "Exp08", "diverged": SHARE}],
}
CLAIM: dict[str, object] = {
    "vibrating": 0.15,
    "lost_deg": 5.0,
    "rigid": STANDING,
    "flexible": STANDING,
    "safe_map": [
        {
            "row": "Exp08",
            "stiffness_factor": [0.1, 1.0],
            "plants": 7,
            "last_fine": 0.0271,
            "first_not_fine": 0.04,
            "first_diverged": None,
        }
    ],
}
CASES: dict[str, object] = {
    "cases": [
        {
            "case": "hsia",
            "equation": "(9)",
            "proved": False,
            "remark": "says so",
            "comparisons": [
                {"controller": "puma3", "ticks": 77, "lock_step": None, "own_loop": "tick 3"}
            ],
        }
    ]
}

FAULTS: dict[str, object] = {
    "standings": [
        {
            "case": {"name": "LuGre", "meaning": "a plant"},
            "lines": [
                {
                    "fault": fault,
                    "meaning": "not called",
                    "scores": {"default": {"back_seen_s": back_s}},
                }
                for fault, back_s in (("missed 1", 0.01), ("missed 9", "inf"))
            ],
        }
    ],
    "rows": {"LuGre": [["missed 1", "jump 1", "1", "100 90 90", "200 20 8", "0.1 0.1 0", "0"]]},
    "findings": [],
    "notes": [],
}


def test_studies_are_shown_where_they_are_of_todays_c(results: Results, tmp_path: Path) -> None:
    assert found(tmp_path) == NOTHING
    assert "make claim" in render(results)
    for name, data in {"claim": CLAIM, "special_cases": CASES, "faults": FAULTS}.items():
        write_json(data, tmp_path / f"{name}.json")
    (tmp_path / "claim").mkdir()
    (tmp_path / "claim" / "safe_map.svg").write_text("<svg/>", encoding="utf-8")
    studies = found(tmp_path)
    assert studies.missing == ("make rivals",)
    html = render(replace(results, studies=studies))
    for said in (
        "95.0&nbsp;% [75.1, 99.9]",
        "0.027",
        "DIFFERENT",
        "NOT proved",
        "says so",
        "missed 1: not called",
        "jump 1",
        "200 20 8",
        "of 2 faults in motion",
        "not missed 9",
    ):
        assert said in html
    (encoded,) = re.findall(r"data:image/svg\+xml;base64,([\w+/=]+)", html)
    assert base64.b64decode(encoded) == b"<svg/>"


def test_studies_of_another_c_are_not_shown(tmp_path: Path) -> None:
    write_json(CLAIM, tmp_path / "claim.json")
    old = json.loads((tmp_path / "claim.json").read_text(encoding="utf-8"))
    old["generated_sha256"] = "0" * 64
    (tmp_path / "claim.json").write_text(json.dumps(old), encoding="utf-8")
    assert found(tmp_path).claim is None


# --- Certificates ------------------------------------------------------------------------------


def test_what_is_proved_of_gains_is_told(results: Results, html: str) -> None:
    found = results.certificates
    section = html[html.index('<section id="certificates">') :]
    section = section[: section.index("</section>")]
    assert len(found.settling) == len(certificates.ALPHAS)
    for row in found.settling:
        assert row.dynamics.settling_time_s is not None
        low, high = row.dynamics.settling_time_s
        assert high - low < 1e-9
        assert f"{high:.9f}" in section
    for arm in found.arms:
        assert arm.eigenvalues.proved
        assert f"{float(arm.eigenvalues.high):.4f}" in section
    assert "puma3 on reference_flexible" in section
    # The interval of the study's linear law, over the eigenvalues on the reference arm.
    head = html[html.index("<body") : html.index("<main>")]
    assert "÷ 5.81, × 2.82" in head
    settled = next(s for s in found.settling if s.alpha == "0.95").dynamics.settling_time_s
    assert settled is not None
    assert f"{settled[1]:.4f}" in head


def test_a_gain_set_that_is_not_safe_is_shown(results: Results) -> None:
    found = results.certificates
    joints = tuple(
        replace(joint, findings=(Finding(Severity.UNSAFE, "x", "x", "", Evidence.MEASURED),))
        for joint in found.checks[0].joints
    )
    unsafe = replace(found, checks=(replace(found.checks[0], joints=joints), *found.checks[1:]))
    bad = render(replace(results, certificates=unsafe))
    assert "key bad" in bad
    assert 'class="bad">unsafe' in bad


# --- In a browser ------------------------------------------------------------------------------

DESKTOP, PHONE = (1280, 900), (390, 844)


@pytest.fixture(scope="session")
def browser(html: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    folder = tmp_path_factory.mktemp("report")
    path = folder / "index.html"
    path.write_text(html, encoding="utf-8")
    with chromium(folder / "profile") as opened:
        opened.resize(*DESKTOP)
        opened.open(path)
        yield opened
        assert opened.complaints == []
        assert opened.requests == []


def test_a_mouse_has_every_figure_to_zoom_into(browser: Browser) -> None:
    browser.resize(*DESKTOP)
    names = browser.evaluate("[...document.querySelectorAll('.chart')].map((chart) => chart.id)")
    assert len(names) == 8
    for name in names:
        x, y, width, height = browser.box(f"#{name}")
        browser.until(f"document.querySelector('#{name} .infolayer') !== null")
        assert browser.evaluate(f"document.querySelector('#{name}').data.length") > 0
        still = f"document.querySelector('#{name}').parentElement.querySelector('.still')"
        assert browser.evaluate(f"getComputedStyle({still}).display") == "none"
        assert (width, height) > (300, 200)
        assert 0 <= x < DESKTOP[0] - width
        assert y < DESKTOP[1]


def test_a_drag_over_a_figure_enlarges_it(browser: Browser) -> None:
    browser.resize(*DESKTOP)
    x, y, width, height = browser.box("#chart-table-2")
    browser.until("document.querySelector('#chart-table-2 .infolayer') !== null")
    range_now = "document.querySelector('#chart-table-2').layout.xaxis.range"
    before = browser.evaluate(range_now)
    across, middle = (x + 0.4 * width, x + 0.6 * width), y + 0.5 * height
    browser.mouse("mouseMoved", across[0], middle)
    browser.mouse("mousePressed", across[0], middle, buttons=1)
    for k in range(1, 6):
        browser.mouse("mouseMoved", across[0] + k / 5 * (across[1] - across[0]), middle, buttons=1)
    browser.mouse("mouseReleased", across[1], middle)
    browser.until(f"{range_now}[1] - {range_now}[0] < {0.6 * (before[1] - before[0])}")


def test_a_phone_has_still_figures_and_scrolls_downwards_only(browser: Browser) -> None:
    browser.resize(*PHONE, phone=True)
    browser.evaluate("document.documentElement.classList.remove('pointed')")
    try:
        assert browser.evaluate("document.documentElement.scrollWidth") == PHONE[0]
        stills = "[...document.querySelectorAll('.still')]"
        assert browser.evaluate(f"{stills}.every((s) => s.getBoundingClientRect().height > 50)")
        charts = "[...document.querySelectorAll('.chart')]"
        assert browser.evaluate(f"{charts}.every((c) => c.getBoundingClientRect().height === 0)")
    finally:
        browser.evaluate("document.documentElement.classList.add('pointed')")
        browser.resize(*DESKTOP)


def test_paper_has_still_figures_and_all_details(browser: Browser) -> None:
    printed = base64.b64decode(browser.call("Page.printToPDF", preferCSSPageSize=True)["data"])
    assert printed.startswith(b"%PDF")
    assert printed.count(b"/Type /Page\n") >= 10
    browser.call("Emulation.setEmulatedMedia", media="print")
    try:
        stills = "[...document.querySelectorAll('.still')]"
        assert browser.evaluate(f"{stills}.every((s) => s.getBoundingClientRect().height > 50)")
    finally:
        browser.call("Emulation.setEmulatedMedia", media="")


def test_every_anchor_leads_to_what_can_be_seen(browser: Browser) -> None:
    browser.resize(*DESKTOP)
    hidden = browser.evaluate(
        "[...document.querySelectorAll('a[href^=\"#\"]')].map((a) => a.getAttribute('href'))"
        ".filter((href) => !document.querySelector(href)?.getBoundingClientRect().height)"
    )
    assert hidden == []
