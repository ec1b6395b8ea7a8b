"""Packages: their FMU against flights of the same C, their manifests against their readers."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from codegen.controller import read, resolve
from codegen.emit import generate
from codegen.sig_pow64 import exponent64
from codegen.source import GenerationError
from codegen.status import Status
from package import __main__, making
from package.checks import Label, check_cmake, parts
from package.contents import FMU, Package, files, package_of
from package.figures import Figures, figures
from package.manifests import check_arduino, check_esp_idf, check_platformio, check_zephyr
from package.recording import Recording, record
from package.simulation import GIVEN, Answers, Simulation, compare
from package.tools import CheckError
from package.variables import Role, variables
from plant.controller import Exponent64, GeneratedController
from tests.package.subjects import (
    M4F,
    Subject,
    contents_of,
    controller,
    fmu_of,
    library_of,
    packaged,
)
from tests.toolchain import WARNINGS, run

ROOT = Path(__file__).parents[2]
NAMES = sorted(path.stem for path in (ROOT / "controllers").glob("*.toml"))


def write(package: Package, folder: Path) -> Path:
    for path, body in contents_of(package).items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(body)
    return folder


@pytest.fixture(scope="session")
def puma3() -> Package:
    return packaged("puma3")


@pytest.fixture
def folder(puma3: Package, tmp_path: Path) -> Path:
    """A package to damage."""
    return write(puma3, tmp_path / "tdc_puma3")


@pytest.fixture
def flown(subject: Subject) -> Iterator[Simulation]:
    """An instance that is switched on."""
    with Simulation(subject.fmu) as simulation:
        simulation.start(subject.recording.first_counts, subject.recording.holding_torque_Nm)
        yield simulation


# --- The FMU has the bits of the C -------------------------------------------------------------


def set_every_start_value(simulation: Simulation, fmu: Path) -> None:
    """As importers may: none of them may lose a digit of the specification."""
    for variable in fmpy.read_model_description(str(fmu)).modelVariables:
        if variable.causality == "parameter":
            number = float if variable.type == "Float64" else int
            simulation.set(variable.name, number(variable.start))


def test_the_fmu_flies_a_whole_run_as_the_c_did(subject: Subject) -> None:
    recording = subject.recording
    with Simulation(subject.fmu) as simulation:
        simulation.start(recording.first_counts, recording.holding_torque_Nm)
        answers = simulation.fly(recording)
    assert len(answers.status) == 12000
    compare(answers, recording)


@pytest.mark.parametrize("name", NAMES)
def test_every_controller_s_fmu_flies_as_its_c_did(
    name: str, subject: Subject, tmp_path: Path
) -> None:
    package = packaged(name)
    # So fast that joints reach their limits.
    recording = record(package.controller, speed=6.0, library=library_of(name))
    fmu = subject.fmu if name == "puma3" else fmu_of(package, tmp_path)
    with Simulation(fmu) as simulation:
        set_every_start_value(simulation, fmu)
        simulation.start(recording.first_counts, recording.holding_torque_Nm)
        compare(simulation.fly(recording), recording)
        if name == "puma3_float64":
            tuned_exponents_are_exact(simulation, recording)


def tuned_exponents_are_exact(simulation: Simulation, recording: Recording) -> None:
    """An exponent in two doubles holds every double that FMI gives."""
    c = GeneratedController(controller("puma3_float64"), library_of("puma3_float64"))
    c.config.joint[0].alpha = Exponent64(*exponent64(0.3))
    c.reset(recording.first_counts, recording.holding_torque_Nm)
    simulation.slave.reset()
    simulation.set("joint[1].alpha", 0.3)
    assert simulation.get("joint[1].alpha") == [0.3]
    simulation.start(recording.first_counts, recording.holding_torque_Nm)
    answers = simulation.fly(recording, last=100)
    rows = (tuple(getattr(recording, column)[k] for column in GIVEN.values()) for k in range(100))
    assert answers.torque_Nm.tolist() == [c.step(*row).torque_Nm.tolist() for row in rows]


def test_fmpy_s_own_importer_gets_them_too(subject: Subject) -> None:
    recording, ticks, tick = subject.recording, 400, subject.recording.sample_time_s
    columns = {
        f"{array}[{i + 1}]": getattr(recording, column)[:ticks, i]
        for array, column in GIVEN.items()
        for i in range(3)
    }
    kinds: list[tuple[str, Any]] = [("time", float), *((n, c.dtype) for n, c in columns.items())]
    signals = np.zeros(ticks, dtype=kinds)
    signals["time"] = tick * np.arange(ticks)
    for name, column in columns.items():
        signals[name] = column
    holding = {f"holding_torque[{i + 1}]": recording.holding_torque_Nm[i] for i in range(3)}
    torque = [f"torque[{i + 1}]" for i in range(3)]
    found = fmpy.simulate_fmu(
        str(subject.fmu),
        stop_time=ticks * tick,
        output_interval=tick,
        start_values=holding,
        input=signals,
        output=torque,
    )
    # The first row is of the start, before any tick.
    answered = np.stack([found[name][1:] for name in torque], axis=1)
    assert answered.tolist() == recording.torque_Nm[:ticks].tolist()
    assert [found[name][0] for name in torque] == pytest.approx(recording.holding_torque_Nm)


def test_a_single_bit_is_noticed(subject: Subject) -> None:
    torque = subject.recording.torque_Nm.astype(np.float64)
    torque[17, 1] = np.nextafter(torque[17, 1], np.inf)
    with pytest.raises(CheckError, match=r"in 1 of \d+ ticks, first in tick 17"):
        compare(Answers(torque, subject.recording.status), subject.recording)


def test_a_controller_without_a_robot_is_led(tmp_path: Path) -> None:
    data = read(ROOT / "controllers" / "puma3.toml")
    data = {**data, "name": "two", "joint_names": ["a", "b"], "description": ""}
    data["law"] = {**data["law"], "inertia_kgm2": [1]}
    data["drive"] = {"torque_limit_Nm": [50], "reports_torque": True}
    own = resolve(data, "two.toml")
    recording = record(own)
    assert "without a robot" in recording.source
    assert set(recording.status.tolist()) <= {Status.OK, Status.SATURATED}
    with Simulation(fmu_of(package_of(own, generate(own)), tmp_path)) as simulation:
        simulation.start(recording.first_counts, recording.holding_torque_Nm)
        compare(simulation.fly(recording), recording)
        # What the drives report takes the place of what was commanded.
        simulation.slave.reset()
        c = GeneratedController(own)
        c.reset(recording.first_counts, recording.holding_torque_Nm)
        simulation.start(recording.first_counts, recording.holding_torque_Nm)
        for reported in ([1.5, -2.25], [7.0, 0.1]):
            c.input.applied_torque_Nm[:] = reported
            simulation.set(simulation.names("applied_torque"), reported)
            answers = simulation.fly(recording, 0, 1)
            wanted = c.step(*(getattr(recording, column)[0] for column in GIVEN.values()))
            assert answers.torque_Nm[0].tolist() == wanted.torque_Nm.tolist()
            assert abs(wanted.torque_Nm[0] - reported[0]) < 1e-6
    row = figures(own, [M4F]).cost.rows[0]
    assert row.joints == 2
    assert 200 < row.instructions_per_step < 461  # less than three joints take


# --- What an importer may do -------------------------------------------------------------------


def test_tuned_parameters_act_as_in_the_c(subject: Subject, flown: Simulation) -> None:
    recording = subject.recording
    c = GeneratedController(controller("puma3"), library_of("puma3"))
    c.reset(recording.first_counts, recording.holding_torque_Nm)
    half = 100
    before = flown.fly(recording, last=half)
    flown.set(["joint[1].kd", "joint[2].inertia_kgm2"], [31.7, 0.25])
    flown.set("joint[3].alpha", 0.75)
    flown.set("anti_windup", 0)
    after = flown.fly(recording, half, 3 * half)
    columns = (recording.counts, recording.position_rad, recording.velocity_rad_per_s,
               recording.acceleration_rad_per_s2)  # fmt: skip
    wanted = []
    for k in range(3 * half):
        if k == half:
            c.config.joint[0].kd, c.config.joint[1].inertia_kgm2 = 31.7, 0.25
            c.config.joint[2].alpha = -(2**29)  # 0.75 - 1 in Q31
            c.config.anti_windup = 0
        wanted.append(c.step(*(column[k] for column in columns)).torque_Nm)
    answered = np.concatenate([before.torque_Nm, after.torque_Nm])
    assert answered.tolist() == np.array(wanted, dtype=np.float64).tolist()
    assert answered[half:].tolist() != recording.torque_Nm[half : 3 * half].tolist()


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("joint[1].kd", -1.0),
        ("joint[1].kd", float("nan")),
        ("joint[2].inertia_kgm2", 0.0),
        ("joint[2].inertia_kgm2", 1e39),
        ("joint[3].alpha", 2.0),
        ("joint[3].alpha", 0.0),
        ("joint[1].max_displacement", 0),
        ("on_error", 2),
        ("max_lost_ticks", 0),
    ],
)
def test_a_refused_parameter_leaves_all_as_it_was(
    flown: Simulation, subject: Subject, name: str, bad: float
) -> None:
    old = flown.get(name)
    with pytest.raises(FMICallException, match="discard"):
        flown.set(name, bad)
    assert flown.get(name) == old
    assert flown.said
    assert flown.said[-1].startswith(f"{name}: refused")
    recording = subject.recording
    answers = flown.fly(recording, last=50)
    assert answers.torque_Nm.tolist() == recording.torque_Nm[:50].tolist()


def test_of_several_parameters_none_is_taken_if_one_is_refused(flown: Simulation) -> None:
    names = ["joint[1].kd", "joint[1].kp"]
    with pytest.raises(FMICallException):
        flown.set(names, [25.0, -1.0])
    assert flown.get(names) == [20.0, 100.0]


def test_fixed_point_is_tuned_in_the_c_s_integers() -> None:
    table = {v.name: v for v in variables(controller("puma3_fixed"))}
    c = GeneratedController(controller("puma3_fixed"), library_of("puma3_fixed"))
    shown = table["joint[2].stiffness.scale_q24"]
    assert (shown.role, shown.place) == (Role.TUNABLE, "config.joint[1].stiffness.scale_q24")
    assert "2^-24" in shown.doc
    assert hasattr(c.config.joint[1].stiffness, "scale_q24")
    assert "over 65536" in table["torque[1]"].doc


@pytest.mark.parametrize("step", [0.0005, 0.002, 0.00100001, -0.001, float("nan")])
def test_only_the_sample_time_is_a_step(flown: Simulation, subject: Subject, step: float) -> None:
    with pytest.raises(FMICallException, match="discard"):
        flown.slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=step)
    assert "0.001 s" in flown.said[-1]
    assert flown.fly(subject.recording, last=9).status.tolist() == [0] * 9


def test_a_lost_tick_is_told_and_survived(subject: Subject, flown: Simulation) -> None:
    recording = subject.recording
    flown.fly(recording, last=10)
    held = flown.get(flown.names("torque"))
    jumped = replace(recording, counts=recording.counts + 100_000)
    lost = flown.fly(jumped, 10, 11)
    assert lost.status.tolist() == [Status.ENCODER_JUMP]
    assert lost.torque_Nm.tolist() == [held]
    assert flown.said == [f"TDC_ENCODER_JUMP: {Status.ENCODER_JUMP.meaning}"]


def test_instances_and_reset_share_nothing(subject: Subject, flown: Simulation) -> None:
    recording = subject.recording
    with Simulation(subject.fmu) as other:
        other.set("joint[1].kd", 5.0)
        other.start(recording.first_counts, recording.holding_torque_Nm)
        for k in range(0, 90, 30):
            mine = flown.fly(recording, k, k + 30)
            other.fly(recording, k, k + 30)
            assert mine.torque_Nm.tolist() == recording.torque_Nm[k : k + 30].tolist()
        other.slave.reset()
        assert other.get("joint[1].kd") == [20.0]
        other.start(recording.first_counts, recording.holding_torque_Nm)
        assert other.fly(recording, last=30).torque_Nm.tolist() == recording.torque_Nm[:30].tolist()


def test_a_state_is_saved_and_goes_on(subject: Subject, flown: Simulation) -> None:
    recording = subject.recording
    flown.fly(recording, last=40)
    state = flown.slave.getFMUState()
    as_bytes = flown.slave.serializeFMUState(state)
    first = flown.fly(recording, 40, 80)
    flown.set("joint[1].kd", 5.0)
    flown.slave.setFMUState(state)
    assert flown.fly(recording, 40, 80).torque_Nm.tolist() == first.torque_Nm.tolist()
    with Simulation(subject.fmu) as other:
        other.slave.setFMUState(other.slave.deserializeFMUState(as_bytes))
        assert other.fly(recording, 40, 80).torque_Nm.tolist() == first.torque_Nm.tolist()
        foreign = bytes(4) + as_bytes[4:]
        with pytest.raises(FMICallException):
            other.slave.deserializeFMUState(foreign)
        assert other.said == ["a state of another FMU"]
    flown.slave.freeFMUState(state)


def test_what_cannot_be_set_or_started_is_refused(subject: Subject, flown: Simulation) -> None:
    with pytest.raises(FMICallException):
        flown.set("torque[1]", 1.0)
    with pytest.raises(FMICallException):
        flown.set("holding_torque[1]", 1.0)
    assert flown.said[-1].startswith("holding_torque[1]: can't be set, or not now")
    with Simulation(subject.fmu) as other:
        with pytest.raises(FMICallException):
            other.start(subject.recording.first_counts, [np.nan, 0.0, 0.0])
        with pytest.raises(FMICallException):
            other.slave.doStep(0.0, 0.001)


def test_the_fmu_is_the_same_whenever_it_is_made(puma3: Package) -> None:
    first = contents_of(puma3)[FMU.format("tdc_puma3")]
    assert files(puma3)[FMU.format("tdc_puma3")] == first
    with zipfile.ZipFile(io.BytesIO(first)) as archive:
        licence = archive.read("documentation/licenses/license.txt").decode()
        assert "Apache License" in licence
        assert "Redistribution and use in source and binary forms" in licence
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


# --- CMake and the manifests -------------------------------------------------------------------


def test_cmake_installs_finds_and_refuses(puma3: Package, tmp_path: Path) -> None:
    newer = replace(puma3, version="2.3.0")
    assert newer.other_majors == ("1.0.0", "3.0.0")
    made = write(newer, tmp_path / "package")
    check_cmake(made, newer)
    listed = made / "CMakeLists.txt"
    text = listed.read_text(encoding="utf-8")
    listed.write_text(text.replace("SameMajorVersion", "AnyNewerVersion"), encoding="utf-8")
    with pytest.raises(CheckError, match=r"refuse version 1\.0\.0"):
        check_cmake(made, newer)


def test_an_example_that_moves_the_robot_fails(puma3: Package, folder: Path) -> None:
    main = folder / "examples" / "minimal" / "main.c"
    text = main.read_text(encoding="utf-8")
    assert ".counts = {0}" in text
    main.write_text(text.replace(".counts = {0}", ".counts = {0}, .reference_position_q8 = {9}"))
    with pytest.raises(CheckError, match="minimal"):
        check_cmake(folder, puma3)


CHECKS = [check_platformio, check_esp_idf, check_zephyr, check_arduino]


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_a_manifest_is_accepted(
    puma3: Package, folder: Path, check: Callable[[Path, Package], None]
) -> None:
    check(folder, puma3)


@pytest.mark.parametrize(
    ("check", "file", "old", "new"),
    [
        (check_platformio, "library.json", '"version": "0.1.0"', '"version": ""'),
        (check_platformio, "library.json", '"frameworks": "*"', '"frameworks": 3'),
        (check_esp_idf, "idf_component.yml", '"0.1.0"', '"one"'),
        (check_esp_idf, "CMakeLists.txt", '"src/tdc_puma3.c"', '"src/tdc_puma4.c"'),
        (check_zephyr, "zephyr/module.yml", "kconfig:", "config:"),
        (check_zephyr, "zephyr/module.yml", "cmake: zephyr", "cmake: 3"),
        (check_zephyr, "zephyr/CMakeLists.txt", "../src/tdc_puma3.c", "tdc_puma3.c"),
        (check_zephyr, "zephyr/Kconfig", "config TDC_PUMA3", "config TDC"),
        (check_arduino, "library.properties", "url=http", "url=ftp"),
        (check_arduino, "library.properties", "paragraph=", "paragraphs="),
        (check_arduino, "library.properties", "category=Device Control", "category=Robots"),
        (check_arduino, "src/tdc_puma3.h", 'extern "C" {', 'extern "C"'),
    ],
)
def test_a_damaged_manifest_is_refused(
    puma3: Package,
    folder: Path,
    check: Callable[[Path, Package], None],
    file: str,
    old: str,
    new: str,
) -> None:
    text = (folder / file).read_text(encoding="utf-8")
    assert old in text
    (folder / file).write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(CheckError):
        check(folder, puma3)


# --- The README --------------------------------------------------------------------------------


def test_the_figures_are_those_of_the_page(figures_of_fixed: Figures, subject: Subject) -> None:
    page = (ROOT / "docs" / "what-a-tick-costs.md").read_text(encoding="utf-8")
    core = page.split("### Cortex-M4F")[1]
    found = re.search(r"^\| this project, fixed-point \| (.*) \|$", core, re.MULTILINE)
    assert found
    three_joints = [cell.split(" / ")[0] for cell in found[1].split(" | ")]
    text = making.readme(packaged("puma3_fixed"), subject.recording, figures_of_fixed)
    plain = [cell.replace("\N{NARROW NO-BREAK SPACE}", " ") for cell in three_joints]
    assert f"| Cortex-M4F | {' | '.join(plain)} |" in text
    # The paper's gains: the enclosure that `error-dynamics` gives, and the specification's limits.
    assert "| waist | 2.386 s | 1.048 s |" in text
    assert "| elbow | 38.28 | 5 |" in text


@pytest.mark.parametrize("name", ["puma3", "puma3_fixed"])
def test_ten_lines_are_enough(
    name: str, figures_of_fixed: Figures, subject: Subject, tmp_path: Path
) -> None:
    package = packaged(name)
    text = making.readme(package, subject.recording, figures_of_fixed)
    block = re.search(r"^```c\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert block
    assert block[1].count("\n") <= 10
    example = tmp_path / "example.c"
    kind = package.controller.arithmetic.torque
    torque = "torque_q" if kind == "int32_t" else "torque_Nm"
    prototypes = (
        f"tdc_status start(const int32_t counts[3], const {kind} holding_{torque}[3]);\n"
        f"tdc_status tick(const {package.prefix}_input *input, {kind} {torque}[3]);\n"
    )
    lines = block[1].splitlines(keepends=True)
    example.write_text("".join([lines[0], prototypes, *lines[1:]]), encoding="utf-8")
    for path, body in contents_of(package).items():
        if path.startswith("src/"):
            (tmp_path / Path(path).name).write_bytes(body)
    run("gcc", *WARNINGS, "-c", example, "-o", tmp_path / "example.o")


def test_every_part_is_labelled(puma3: Package, subject: Subject) -> None:
    labels = {part.title: part.label for part in parts(puma3, subject.recording)}
    built = {title for title, label in labels.items() if label is Label.BUILT}
    assert built == {"CMake", "FMI 3.0"}
    assert set(labels) - built == {"PlatformIO", "ESP-IDF", "Zephyr", "Arduino"}


# --- All or nothing ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("trouble", "told"),
    [
        (KeyboardInterrupt(), KeyboardInterrupt),
        (CheckError("broken"), CheckError),
        (OSError(28, "full"), GenerationError),
    ],
)
def test_trouble_leaves_the_old_package_whole(
    trouble: BaseException,
    told: type[BaseException],
    subject: Subject,
    figures_of_fixed: Figures,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    old = tmp_path / "puma3"
    old.mkdir()
    (old / "README.md").write_text("old", encoding="utf-8")
    monkeypatch.setattr(making, "generate", lambda _: packaged("puma3").generated)
    monkeypatch.setattr(making, "files", contents_of)
    monkeypatch.setattr(making, "record", lambda _: subject.recording)
    monkeypatch.setattr(making, "figures", lambda *_: figures_of_fixed)

    def fails(folder: Path, *_: object) -> None:
        assert (folder / "README.md").is_file()
        raise trouble

    monkeypatch.setattr(making, "check", fails)
    with pytest.raises(told):
        making.make(controller("puma3"), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["puma3"]
    assert [path.name for path in old.iterdir()] == ["README.md"]

    monkeypatch.setattr(making, "check", lambda *_: None)
    made = making.make(controller("puma3"), tmp_path)
    assert made.folder == old
    assert {p.relative_to(old).as_posix() for p in old.rglob("*") if p.is_file()} == {
        "README.md",
        *contents_of(packaged("puma3")),
    }
    assert [path.name for path in tmp_path.iterdir()] == ["puma3"]
    assert json.loads((old / "library.json").read_text(encoding="utf-8"))["name"] == "tdc_puma3"


def test_bad_input_is_told_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert __main__.main([str(tmp_path / "none.toml")]) == 2
    assert "none.toml" in capsys.readouterr().err
