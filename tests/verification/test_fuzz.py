"""Fuzzing of the generated C: a minute in all finds nothing, and broken C is found broken."""

from __future__ import annotations

import ctypes
import re
import shutil
from pathlib import Path

import pytest

from codegen.controller import load
from codegen.emit import REPOSITORY
from codegen.layout import layout
from codegen.structs import Struct
from plant.controller import structures
from verification.equivalence import variants
from verification.fuzz.program import CORPUS, build, keep, run
from verification.fuzz.tables import Number, numbers

CONTROLLERS = sorted(path.stem for path in (REPOSITORY / "controllers").glob("*.toml"))
GENERATED = REPOSITORY / "generated"

SECONDS = 60.0
"""Of fuzzing in `make test`, for all controllers together."""


@pytest.mark.parametrize("name", CONTROLLERS)
def test_fuzzing_finds_nothing(tmp_path: Path, name: str) -> None:
    fuzzer = build(load(REPOSITORY / f"controllers/{name}.toml"), tmp_path)
    done = run(fuzzer, SECONDS / len(CONTROLLERS))
    assert done.finding is None
    # A fuzzer whose every tick is an error, or whose every configuration is refused, tests little.
    assert done.good > done.steps_taken / 4 > 1000
    assert done.steps["TDC_OK"] > 0
    assert done.steps["TDC_SATURATED"] > 0
    assert min(done.taken, done.refused) > 0


def test_a_structure_with_every_part_of_the_law_is_fuzzed_too(tmp_path: Path) -> None:
    every_part = variants(load(REPOSITORY / "controllers/puma3.toml"))[-1]
    assert every_part.options.torque_report
    assert every_part.options.low_pass
    assert run(build(every_part, tmp_path), 1.0).finding is None


MUTANTS = [
    (
        "puma3",
        "finite &= tdc_is_finite(control_torque);",
        "",
        "a good torque is finite",
    ),
    (
        "puma3",
        "next->applied_torque_Nm = limited_torque;\n            torque_Nm[i] = limited_torque;",
        "next->applied_torque_Nm = limited_torque;",
        "a good torque is within its limit",
    ),
    (
        "puma3",
        "torque_Nm[i] = state->joint[i].tick[state->phase & 1u].applied_torque_Nm;",
        "torque_Nm[i] = 0.5f * state->joint[i].tick[state->phase & 1u].applied_torque_Nm;",
        "after an error the torque is the last good one, if that is asked for",
    ),
    (
        "puma3",
        "torque_Nm[i] = state->joint[i].tick[state->phase & 1u].applied_torque_Nm;",
        "torque_Nm[i] = state->joint[i].tick[0].applied_torque_Nm;",
        # Whether the last torque or the one before it is wrong depends on the tick.
        "the same tick gives the same bits|after an error the torque is the last good one",
    ),
    (
        "puma3",
        "    ++state->lost_ticks;\n",
        "    ++state->lost_ticks;\n    state->saturated_joints = 7u;\n",
        "a lost tick saturates nothing",
    ),
    (
        "puma3",
        "    ++state->lost_ticks;\n",
        "    ++state->lost_ticks;\n"
        "    state->joint[1].tick[state->phase & 1u].sliding_integral_rad_per_s = 7.0f;\n",
        "an error leaves the law's memory as it was",
    ),
    (
        "puma3",
        "good &= is_positive(gains->torque_limit_Nm);",
        "",
        "a configuration that check_config takes keeps every rule",
    ),
    (
        "puma3",
        "good &= is_not_negative(gains->kd);",
        "good &= is_positive(gains->kd);",
        "check_config takes what keeps every rule",
    ),
    (
        "puma3",
        "torque_Nm[TDC_PUMA3_JOINTS])\n{\n    if (config->on_error == TDC_HOLD_TORQUE) {\n"
        "        for (uint32_t i = 0u; i < ",
        "torque_Nm[TDC_PUMA3_JOINTS])\n{\n    if (config->on_error == TDC_HOLD_TORQUE) {\n"
        "        for (uint32_t i = 0u; i <= ",
        "stack-buffer-overflow",
    ),
    (
        "puma3_fixed",
        "if (tdc_outside(input->reference_velocity_q[i], limit) != 0u) {",
        "if (limit < 0) {",
        "signed integer overflow",
    ),
]


@pytest.mark.parametrize(("name", "old", "new", "says"), MUTANTS, ids=[m[3] for m in MUTANTS])
def test_broken_c_is_found(tmp_path: Path, name: str, old: str, new: str, says: str) -> None:
    sources = tmp_path / name
    shutil.copytree(GENERATED / name, sources)
    source = sources / f"tdc_{name}.c"
    text = source.read_text(encoding="utf-8")
    assert old in text, "the C has changed: break it in another way"
    source.write_text(text.replace(old, new, 1), encoding="utf-8")
    fuzzer = build(load(REPOSITORY / f"controllers/{name}.toml"), tmp_path / "fuzz", sources)
    done = run(fuzzer, 10.0)
    assert done.finding is not None
    assert re.search(says, done.finding.says)
    assert done.finding.input.is_file()


@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_field_of_the_description_is_in_the_tables(name: str) -> None:
    controller = load(REPOSITORY / f"controllers/{name}.toml")
    types, described = structures(controller), layout(controller)
    for kind, struct in ((types.config, described.config), (types.state, described.state)):
        found = list(numbers(kind))
        assert {n.path[0] for n in found} == {field.name for field in struct.fields}
        # Side by side, nothing twice, and no room between them but what a double is aligned by.
        starts = [*(n.offset for n in found), ctypes.sizeof(kind)]
        gaps = [b - a for a, b in zip([0, *_ends(found)], starts, strict=True)]
        assert all(0 <= gap < ctypes.alignment(kind) for gap in gaps)
        assert _names(struct) <= {step for n in found for step in n.path}


def _ends(found: list[Number]) -> list[int]:
    return [n.offset + ctypes.sizeof(n.type) for n in found]


def _names(struct: Struct) -> set[str]:
    below = [_names(f.type) for f in struct.fields if isinstance(f.type, Struct)]
    return {f.name for f in struct.fields}.union(*below)


def test_the_kept_corpus_is_small_and_merges(tmp_path: Path) -> None:
    kept = list(CORPUS.iterdir())
    assert len(kept) > 10
    assert sum(path.stat().st_size for path in kept) < 200_000
    fuzzer = build(load(REPOSITORY / "controllers/puma3.toml"), tmp_path)
    shutil.copytree(CORPUS, tmp_path / "corpus")
    assert 0 < keep([fuzzer], tmp_path / "corpus") <= len(kept) + 50
