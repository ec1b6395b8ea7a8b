"""The application of the firmware on this computer, with a fake board below it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess, run

import numpy as np
import pytest

from codegen.controller import load
from codegen.emit import REPOSITORY
from plant.native import GENERATED
from plant.units import units
from verification.firmware import STUB, common_facts

HERE = Path(__file__).parent
CHECKS = re.findall(r"CHECK\((\w+)\),", (HERE / "app_checks.c").read_text(encoding="utf-8"))
CONTROLLERS = ("puma3", "puma6", "puma3_fixed", "puma3_float64")
APPLICATION = (STUB / "app.c", STUB / "telemetry.c")


def compiled(
    controller: str, sanitizer: str, sources: tuple[Path, ...], output: Path
) -> CompletedProcess[str]:
    facts, directory = common_facts(), GENERATED / controller
    command = [
        *("gcc", *facts["C_FLAGS"].split(), *facts["WARNING_FLAGS"].split()),
        *("-g", f"-fsanitize={sanitizer}", "-fno-sanitize-recover=all"),
        *(f"-DCONTROLLER={controller}", f"-DCONTROLLER_UPPER={controller.upper()}"),
        *(f"-I{REPOSITORY}", f"-I{directory}"),
        *map(str, (*sources, *sorted(directory.glob("*.c")))),
        *("-lpthread", "-o", str(output)),
    ]
    return run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def checks_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The program of `app_checks.c` for a controller, compiled once."""
    made: dict[str, Path] = {}

    def program(controller: str) -> Path:
        if controller not in made:
            output = tmp_path_factory.mktemp(controller) / "app_checks"
            sources = (HERE / "app_checks.c", HERE / "fake_hal.c", *APPLICATION)
            done = compiled(controller, "address,undefined", sources, output)
            assert done.returncode == 0, done.stderr
            made[controller] = output
        return made[controller]

    return program


def test_there_are_checks() -> None:
    assert len(CHECKS) > 30
    assert len(set(CHECKS)) == len(CHECKS)


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("check", CHECKS)
def test_application(check: str, controller: str, checks_of: Callable[[str], Path]) -> None:
    done = run([checks_of(controller), check], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_every_check_is_in_the_program(checks_of: Callable[[str], Path]) -> None:
    listed = run([checks_of("puma3")], capture_output=True, text=True, check=True).stdout
    assert listed.split() == CHECKS


@pytest.mark.parametrize("name", ["puma3", "puma3_fixed", "puma3_float64"])
def test_the_stub_takes_the_units_of_the_generator(name: str, tmp_path: Path) -> None:
    program = tmp_path / "units"
    done = compiled(name, "address,undefined", (HERE / "units.c",), program)
    assert done.returncode == 0, done.stderr
    said = run([program], capture_output=True, text=True, check=True).stdout
    told = np.loadtxt(said.splitlines())
    controller = load(REPOSITORY / "controllers" / f"{name}.toml")
    expected, every = units(controller), np.ones(len(controller.joints))
    signals = (expected.velocity, 0.25), (expected.acceleration, -8.0), (expected.torque, -2.5)
    limit = np.array([float(joint.torque_limit) for joint in controller.joints])
    inertia = np.array([float(joint.inertia) for joint in controller.joints])
    columns = [*(unit.stored(value * every) for unit, value in signals), limit, inertia]
    np.testing.assert_allclose(told[:, :5], np.transpose(columns), rtol=1e-6)
    np.testing.assert_allclose(told[:, 5], limit * 1000.0, atol=1.0)


def raced(telemetry: Path, output: Path) -> CompletedProcess[str]:
    done = compiled("puma3", "thread", (HERE / "ring_race.c", telemetry), output)
    assert done.returncode == 0, done.stderr
    done = run([output], capture_output=True, text=True, check=False)
    if "FATAL: ThreadSanitizer" in done.stderr:
        # Kernels with much address randomisation are too much for older sanitizers.
        done = run(["setarch", "-R", output], capture_output=True, text=True, check=False)
    if "FATAL: ThreadSanitizer" in done.stderr or "setarch:" in done.stderr:
        pytest.skip("ThreadSanitizer does not run on this kernel")
    return done


def test_the_telemetry_ring_has_no_data_race(tmp_path: Path) -> None:
    done = raced(STUB / "telemetry.c", tmp_path / "race")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("order", ["ACQUIRE", "RELEASE"])
def test_a_data_race_would_be_found(order: str, tmp_path: Path) -> None:
    text = (STUB / "telemetry.c").read_text(encoding="utf-8")
    text = text.replace('"telemetry.h"', '"firmware_stub/telemetry.h"')
    spoilt = tmp_path / "telemetry.c"
    spoilt.write_text(text.replace(f"__ATOMIC_{order}", "__ATOMIC_RELAXED"), encoding="utf-8")
    done = raced(spoilt, tmp_path / "race")
    assert "data race" in done.stderr
