"""The bench can fail: broken counters, broken laws and missing tools are noticed."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from codegen.controller import Controller
from codegen.emit import FORMAT_STYLE
from plant.controller import OK, SATURATED, structures
from plant.native import shared_library, sources_of
from plant.units import units
from tests.repository.conftest import ROOT
from verification.bench import __main__ as command_line
from verification.bench.count import replay
from verification.bench.program import build, harness, plugin, prepare, write_data
from verification.bench.recording import (
    Kind,
    Outcome,
    Replayed,
    all_sequences,
    controller_of,
    input_bytes,
    record,
)
from verification.bench.rows import BenchError, measure, spreads
from verification.bench.variants import (
    LINEAR_FLOOR,
    NAIVE_DOUBLE,
    PACKAGE,
    PROJECT,
    PROJECT_LINEAR,
    TARGET,
    VARIANTS,
    WITH_POWERS,
    Variant,
)
from verification.firmware import ToolError, load_board

JOINTS = 3
BOARD = "mps2-an386"


def changed(path: Path, target: Path, old: str, new: str) -> Path:
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{old!r} is not in {path} once"
    target.write_text(text.replace(old, new), encoding="utf-8")
    return target


def rewritten(variant: Variant, file: str, old: str, new: str) -> Variant:
    """The variant with one of its C files changed."""

    def write(controller: Controller, generated: Path, directory: Path) -> tuple[Path, ...]:
        sources = variant.write(controller, generated, directory)
        return tuple(
            changed(path, directory / file, old, new) if path.name == file else path
            for path in sources
        )

    return replace(variant, write=write)


def test_another_law_is_noticed() -> None:
    wrong = rewritten(
        LINEAR_FLOOR, "linear.c", "(joint->lambda * sliding)", "(joint->lambda * -sliding)"
    )
    with pytest.raises(BenchError, match=r"linear-floor .* computes another law"):
        measure([BOARD], [JOINTS], [NAIVE_DOUBLE, PROJECT, PROJECT_LINEAR, wrong])


def test_a_plugin_that_miscounts_is_noticed(tmp_path: Path) -> None:
    board = load_board(BOARD)
    sequences = (record(JOINTS),)
    data = write_data(controller_of(JOINTS), sequences, tmp_path)
    prepared = prepare(LINEAR_FLOOR, JOINTS, tmp_path)
    program = build(board, prepared, harness(board, prepared, data, tmp_path), tmp_path)

    good = replay(program, plugin(tmp_path), data.ticks)
    assert good.disagreements == 0
    # The second reading of the timer, and nothing else, is what the plugin doesn't see.
    assert good.timer_overhead == 1

    skips = changed(
        PACKAGE / "plugin.c",
        tmp_path / "plugin.c",
        "qemu_plugin_register_vcpu_insn_exec_inline(insn, INLINE_ADD_U64, &executed, 1);",
        "qemu_plugin_register_vcpu_insn_exec_inline(insn, INLINE_ADD_U64, &executed, "
        "(address % 64u) != 0u);",
    )
    assert replay(program, plugin(tmp_path, skips), data.ticks).disagreements > 0


def test_a_record_that_lost_instructions_is_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    forgetful = changed(
        PACKAGE / "plugin.c",
        tmp_path / "plugin.c",
        "    ++each->count;\n",
        "    each->count += ((address % 64u) != 0u);\n",
    )
    monkeypatch.setattr("verification.bench.rows.plugin", lambda into: plugin(into, forgetful))
    with pytest.raises(BenchError, match=r"instructions were recorded, \d+ counted"):
        measure([BOARD], [JOINTS], [NAIVE_DOUBLE, PROJECT])


STEP = "(void)controller_step(&controller_default_config, &state, input, torque);"
WASTE = "for (volatile int i = 0; i < 50; ++i) { }"


def test_a_tick_at_a_limit_that_takes_long_is_noticed() -> None:
    slow = rewritten(
        PROJECT,
        "project.c",
        STEP,
        "if (controller_step(&controller_default_config, &state, input, torque) == "
        f"TDC_SATURATED) {{ {WASTE} }}",
    )
    spread = spreads(measure([BOARD], [JOINTS], [NAIVE_DOUBLE, slow]).rows)[0]
    assert spread.usual_fewest == spread.usual_most
    assert spread.worst_relative > 0.6


def test_usual_ticks_whose_time_depends_on_the_data_are_noticed() -> None:
    slow = rewritten(PROJECT, "project.c", STEP, f"{STEP} if (torque[1] < -30.0f) {{ {WASTE} }}")
    spread = spreads(measure([BOARD], [JOINTS], [NAIVE_DOUBLE, slow]).rows)[0]
    assert spread.usual_most > 1.5 * spread.usual_fewest
    assert f"{spread.usual_fewest} to {spread.usual_most}" in spread.statement


@pytest.mark.parametrize(
    ("missing", "package"),
    [
        ("arm-none-eabi-gcc", "gcc-arm-none-eabi"),
        ("riscv64-unknown-elf-size", "binutils-riscv64-unknown-elf"),
        ("qemu-system-arm", "qemu-system-arm"),
        ("qemu-system-riscv32", "qemu-system-misc"),
    ],
)
def test_a_missing_tool_is_named_with_its_package(
    missing: str,
    package: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    which: Callable[[str], str | None] = shutil.which
    monkeypatch.setattr(
        "verification.firmware.shutil.which", lambda name: None if name == missing else which(name)
    )
    assert command_line.main([]) == 2
    message = capsys.readouterr().err
    assert missing in message
    assert f"apt-get install {package}" in message


def test_a_missing_c_library_is_named_with_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    from verification.bench import program

    monkeypatch.setattr(program, "flags", lambda _: ("-nostdinc",))
    with pytest.raises(ToolError, match=r"no newlib: .*libnewlib-arm-none-eabi"):
        program.library_version(load_board(BOARD))


# --- The data ----------------------------------------------------------------------------------


@cache
def compiled(controller: Controller) -> ctypes.CDLL:
    return ctypes.CDLL(str(shared_library(sources_of(controller))))


def statuses(controller: Controller, sequence: Replayed) -> list[int]:
    """What the generated C on this computer says to each tick."""
    library, types, joints = compiled(controller), structures(controller), len(sequence.counts)
    config = types.config.in_dll(library, f"tdc_{controller.name}_default_config")
    state, torque = types.state(), (types.torque * joints)()
    counts = (ctypes.c_int32 * joints)(*sequence.counts)
    stored = units(controller).torque.stored(np.array(sequence.holding_torque))
    holding = (types.torque * joints)(*stored.tolist())
    pointers = ctypes.byref(config), ctypes.byref(state)
    assert library[f"tdc_{controller.name}_init"](*pointers, counts, holding) == OK
    data = input_bytes(controller, (sequence,))
    size = ctypes.sizeof(types.input)
    step = library[f"tdc_{controller.name}_step"]
    return [
        int(step(*pointers, data[first : first + size], torque))
        for first in range(0, len(data), size)
    ]


@pytest.mark.parametrize("variant", WITH_POWERS, ids=lambda v: str(v.name))
@pytest.mark.parametrize("joints", [3, 6])
def test_cases_are_what_they_say(joints: int, variant: Variant) -> None:
    controller = controller_of(joints, None, variant.numbers)
    sequences = all_sequences(controller)
    names = [s.name for s in sequences if s.kind is not Kind.RANDOM]
    assert len(set(names)) == len(names)
    for sequence in sequences:
        found = statuses(controller, sequence)
        assert set(found[:-1]) <= {OK}, "what comes before the last tick is usual"
        if sequence.outcome is Outcome.ERROR:
            assert found[-1] < 0, sequence.name
        elif sequence.outcome is not Outcome.ANY:
            limited = sequence.outcome is Outcome.LIMIT
            assert found[-1] == (SATURATED if limited else OK), sequence.name
    random = [statuses(controller, s)[-1] for s in sequences if s.kind is Kind.RANDOM]
    assert min(random) < 0 <= max(random), "random bits are to reach both ends"


def test_recording_is_the_same_every_time() -> None:
    assert record(JOINTS) == record(JOINTS)


# --- The C ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda v: str(v.name))
def test_written_c_is_in_the_house_style(variant: Variant, tmp_path: Path) -> None:
    prepared = prepare(variant, JOINTS, tmp_path)
    ours = [p for p in prepared.sources if p.name != "naive_law.c"]  # CasADi's own
    subprocess.run(
        [
            ROOT / ".venv/bin/clang-format",
            f"--style=file:{FORMAT_STYLE}",
            "--dry-run",
            "-Werror",
            *ours,
            *TARGET.glob("*.[ch]"),
            PACKAGE / "plugin.c",
        ],
        check=True,
    )
