"""Processor in the loop: the bits are equal on every board, and where they are not it is told."""

from __future__ import annotations

import json
import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import verification.pil as pil
import verification.target as target_module
from codegen.emit import REPOSITORY
from plant.units import Unit
from verification.firmware import build, emulated_board_names, load_board
from verification.pil import Answer, Flight, Mismatch, first_mismatch, main, run
from verification.target import Target, TargetError

EXP08, FIXED = Flight("puma3", "Exp08"), Flight("puma3_fixed")
DOUBLE = Flight("puma3_float64")
BOARDS = emulated_board_names()
TICKS = 1500
ARM = "mps2-an386"


@pytest.mark.parametrize("flight", [EXP08, FIXED, Flight("puma6")], ids=str)
def test_bits_are_equal_on_every_board(flight: Flight) -> None:
    runs = []
    for name in BOARDS:
        board = load_board(name)
        runs.append(run(board, build(board, flight.controller, "pil"), flight, ticks=TICKS))
    assert [r.ticks for r in runs] == [TICKS] * len(BOARDS)
    assert all(r.equal and r.mismatch is None for r in runs)
    assert len({r.target_sha256 for r in runs} | {r.host_sha256 for r in runs}) == 1
    assert all(0.0 < r.seconds < r.seconds_total for r in runs)


@pytest.mark.parametrize("name", ["mps2-an500", "mps2-an385-m0plus"])
def test_bits_are_equal_in_double(name: str) -> None:
    """By the FPU, and by the compiler's library."""
    board = load_board(name)
    found = run(board, build(board, DOUBLE.controller, "pil"), DOUBLE, ticks=TICKS)
    assert found.equal
    assert found.ticks == TICKS


@pytest.mark.parametrize(
    ("name", "flight"), [(ARM, EXP08), ("riscv-virt", EXP08), ("mps2-an385", FIXED)]
)
def test_by_serial_port(name: str, flight: Flight) -> None:
    board = load_board(name)
    image = build(board, flight.controller, "pil_uart")
    by_uart = run(board, image, flight, ticks=40, link="uart")
    assert by_uart.equal
    assert by_uart.ticks == 40


SPOILT_JOINT = 1


SPOILT = {
    "puma3": ("ACCELERATION_SCALE", "6.391588f"),
    "puma3_fixed": ("MOTION_PER_COUNT", "(MOTION_PER_COUNT + 1)"),
}
"""By what the law multiplies the displacement's change, and the same moved by its last digit."""


def spoilt_constant(tmp_path: Path, name: str = "puma3") -> Path:
    """The generated C with one constant of one joint moved by its last digit."""
    copy = tmp_path / name
    shutil.copytree(REPOSITORY / "generated" / name, copy)
    source = copy / f"tdc_{name}.c"
    text = source.read_text(encoding="utf-8")
    constant, other = SPOILT[name]
    right = f"displacement_change * {constant}"
    wrong = f"displacement_change * ((i == {SPOILT_JOINT}u) ? {other} : {constant})"
    assert text.count(right) == 1
    source.write_text(text.replace(right, wrong), encoding="utf-8")
    return copy


@pytest.mark.parametrize("damage", ["constant", "contraction"])
def test_a_target_that_computes_something_else_is_found_and_named(
    damage: str, tmp_path: Path
) -> None:
    board = load_board(ARM)
    image = build(
        board,
        "puma3",
        "pil",
        generated=spoilt_constant(tmp_path) if damage == "constant" else None,
        output=tmp_path / "out",
        extra_flags="-ffp-contract=fast" if damage == "contraction" else "",
    )
    found = run(board, image, EXP08, ticks=TICKS)
    assert not found.equal
    assert found.target_sha256 != found.host_sha256
    where = found.mismatch
    assert where is not None
    assert where.joint is not None
    assert where.target_bits != where.host_bits
    for value, bits in ((where.target, where.target_bits), (where.host, where.host_bits)):
        assert np.float32(value).view(np.uint32) == int(bits, 16)
    told = str(where)
    for part in (f"tick {where.tick}, joint {where.joint}", where.target, where.host):
        assert part in told
    if damage == "constant":
        assert where.joint == SPOILT_JOINT


def test_a_wrong_constant_in_fixed_point_is_found_and_named(tmp_path: Path) -> None:
    board = load_board("mps2-an385-m0plus")
    copy = spoilt_constant(tmp_path, "puma3_fixed")
    image = build(board, copy.name, "pil", generated=copy, output=tmp_path / "out")
    found = run(board, image, FIXED, ticks=TICKS)
    assert not found.equal
    where = found.mismatch
    assert where is not None
    assert where.joint == SPOILT_JOINT
    # In N m for people; the bits are the integer's.
    units = FIXED.tuned().units.torque
    for value, bits in ((where.target, where.target_bits), (where.host, where.host_bits)):
        assert int(units.stored(np.array(float(value)))) % 2**32 == int(bits, 16)
    assert where.target_bits != where.host_bits
    assert f"tick {where.tick}, joint {SPOILT_JOINT}: {where.target} N m" in str(where)


NEWTON_METRES = Unit("applied_torque_Nm", None)


def outputs(*rows: tuple[list[float], int], kind: str = "<f4") -> list[Answer]:
    return [Answer(np.array(t, dtype=kind), status) for t, status in rows]


def test_the_first_difference_counts() -> None:
    host = outputs(([1.0, 2.0], 0), ([3.0, 4.0], 0), ([5.0, 6.0], 0))
    target = outputs(([1.0, 2.0], 0), ([3.0, 4.5], 0), ([0.0, 0.0], 0))
    assert first_mismatch(host, host, NEWTON_METRES) is None
    found = first_mismatch(target, host, NEWTON_METRES)
    assert found == Mismatch(1, 1, "4.5", "4.0", "0x40900000", "0x40800000")


def test_differences_are_told_in_newton_metres_with_all_bits() -> None:
    half, more = outputs(([0.5], 0), kind="<f8"), outputs(([np.nextafter(0.5, 1.0)], 0), kind="<f8")
    found = first_mismatch(more, half, NEWTON_METRES)
    bits = ("0x3FE0000000000001", "0x3FE0000000000000")
    assert found == Mismatch(0, 0, "0.5000000000000001", "0.5", *bits)
    sixteenths = Unit("applied_torque_q", np.array(16.0))
    found = first_mismatch(
        outputs(([-1], 0), kind="<i4"), outputs(([8], 0), kind="<i4"), sixteenths
    )
    assert found == Mismatch(0, 0, "-0.0625", "0.5", "0xFFFFFFFF", "0x00000008")


def test_bits_are_compared_not_values() -> None:
    zero, negative = outputs(([0.0], 0)), outputs(([-0.0], 0))
    assert first_mismatch(zero, negative, NEWTON_METRES) is not None
    nan = outputs(([np.nan], 0)), outputs(([np.nan], 0))
    assert first_mismatch(*nan, NEWTON_METRES) is None


def test_a_status_is_compared_too() -> None:
    found = first_mismatch(outputs(([1.0], 1)), outputs(([1.0], 0)), NEWTON_METRES)
    assert found == Mismatch(0, None, "1", "0")
    assert str(found) == "tick 0: status 1 on the target, 0 on the host"


# --- The link -----------------------------------------------------------------------------------


@pytest.fixture
def target() -> Iterator[Target]:
    board = load_board(ARM)
    with Target(board, build(board, "puma3", "pil"), EXP08.tuned()) as running:
        yield running


def test_the_emulator_ends_with_its_target(target: Target) -> None:
    process, scratch = target._process, Path(target._scratch.name)
    assert process is not None
    assert process.poll() is None
    target.close()
    assert process.returncode is not None
    assert not scratch.exists()
    target.close()


def test_an_emulator_that_dies_is_noticed(target: Target) -> None:
    assert target._process is not None
    os.kill(target._process.pid, signal.SIGKILL)
    target._process.wait()
    with pytest.raises(TargetError, match=r"mps2-an386.*ended"):
        target.step(b"")


def test_a_wrong_request_is_answered_with_an_error(target: Target) -> None:
    target._numbers["PIL_STEP"] = 99
    assert target.step(b"").status == -1


def test_a_step_before_the_reset_is_refused(target: Target) -> None:
    assert target.step(b"").status == -3


def test_another_controller_on_the_target_is_refused() -> None:
    board = load_board(ARM)
    with pytest.raises(TargetError, match="holds another controller than the host"):
        Target(board, build(board, "puma6", "pil"), EXP08.tuned())


def test_an_image_that_does_not_answer_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(target_module, "SILENCE_S", 0.5)
    board = load_board(ARM)
    with pytest.raises(TargetError, match=r"said nothing for 0\.5 s"):
        Target(board, build(board, "puma3", "app"), EXP08.tuned())


# --- The command --------------------------------------------------------------------------------


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "pil.json"
    words = ["--board", ARM, "--flight", "puma3:Exp01", "--ticks", "50", "--uart-ticks", "5"]
    assert main([*words, "--output", str(output)]) == 0
    assert "bit-equal" in capsys.readouterr().out
    runs = json.loads(output.read_text(encoding="utf-8"))["runs"]
    assert [(r["link"], r["ticks"]) for r in runs] == [("semihosting", 50), ("uart", 5)]
    for r in runs:
        assert r["board"] == ARM
        assert r["core"] == "Cortex-M4F"
        assert (r["controller"], r["experiment"]) == ("puma3", "Exp01")
        assert r["equal"] is True
        assert r["target_sha256"] == r["host_sha256"]
        assert r["seconds"] > 0.0


def test_command_with_a_mismatch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    board = load_board(ARM)
    image = build(
        board, "puma3", "pil", generated=spoilt_constant(tmp_path), output=tmp_path / "out"
    )
    monkeypatch.setattr(pil, "build", lambda *_: image)
    monkeypatch.setenv("COLUMNS", "200")
    words = ["--board", ARM, "--flight", "puma3:Exp08", "--ticks", "300", "--uart-ticks", "0"]
    assert main([*words, "--output", str(tmp_path / "pil.json")]) == 1
    told = capsys.readouterr().out
    assert "DIFFERENT" in told
    assert f"joint {SPOILT_JOINT}" in told


def test_command_without_a_specification(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--board", ARM, "--flight", "nosuch"]) == 2
    assert "nosuch" in capsys.readouterr().err
