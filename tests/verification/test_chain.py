"""The chain from the exact law to the bits on each target holds, and a broken link is named."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import mpmath
import numpy as np
import pytest

from codegen.controller import load
from codegen.problems import SpecificationError
from plant.native import GENERATED
from tests.toolchain import WARNINGS
from tests.toolchain import run as run_tool
from verification.__main__ import main
from verification.cases import last_memory
from verification.chain.forward_error import (
    DIGITS,
    Bounded,
    _power,
    _sign,
    distance,
    exactly,
)
from verification.chain.links import (
    BAD_ARGUMENT,
    NOT_INITIALISED,
    QUANTITIES,
    Modelled,
    chain,
    double_to_host,
    drawn_by_the_target,
    exact_to_double,
    first_difference,
    float_range,
    host_to_target,
    modelled,
)
from verification.chain.program import (
    FIRST_STATUS,
    STATUSES,
    STEPS,
    TARGET,
    Blocks,
    Host,
    Target,
    image,
)
from verification.chain.vectors import Vectors, case_type, is_refused, recorded
from verification.equivalence import STOPPED, Compiled, compiled
from verification.evidence import Evidence
from verification.experiments import CONTROLLERS
from verification.firmware import STUB, ToolError, board_names, load_board

NAMES, FIXED = ("puma3", "puma6"), "puma3_fixed"
BLOCKS = Blocks(3, 2000)
# A bad configuration is told by init, and nothing but fixed-point has a range.
REACHED = set(STATUSES) - {"bad configuration", "out of range"}
CPU = Path("/proc/cpuinfo")
HOST_HAS_FMA = CPU.exists() and " fma " in CPU.read_text(encoding="utf-8")


@cache
def library_of(name: str) -> Compiled:
    return compiled(load(CONTROLLERS / f"{name}.toml"))


@cache
def host_of(name: str) -> Host:
    return Host(library_of(name))


@cache
def vectors_of(name: str) -> Vectors:
    if name == FIXED:
        return drawn_by_the_target(host_of(name), 300)
    every = recorded(library_of(name), 150).plus(drawn_by_the_target(host_of(name), 300))
    # Six joints differ from three in nothing but their number: a quarter will do.
    return every if name == "puma3" else every.take(np.arange(len(every)) % 4 == 0)


@cache
def model_of(name: str) -> Modelled:
    return modelled(library_of(name), vectors_of(name))


# --- Vectors -----------------------------------------------------------------------------------


def test_the_vectors_are_always_the_same() -> None:
    again = recorded(library_of("puma3"), 20)
    assert again.records.tobytes() == recorded(library_of("puma3"), 20).records.tobytes()
    assert len(again) == len(again.group)


def test_the_vectors_reach_every_edge() -> None:
    vectors = vectors_of("puma3")
    given, joint = vectors.records["input"], last_memory(vectors.records["state"])
    velocity = given["reference_velocity_rad_per_s"]
    tiny, largest = np.finfo(np.float32).smallest_normal, np.finfo(np.float32).max
    assert np.any((np.abs(velocity) > 0) & (np.abs(velocity) < tiny))
    assert {-largest, largest} <= set(velocity.ravel().tolist())
    moved = given["counts"].astype(np.int64) - joint["counts"]
    assert np.any(moved <= -(2**32) + 1000)
    assert np.any(moved >= 2**32 - 1000)
    gamma = vectors.records["config"]["joint"]["gamma"]
    assert {-(2**31), 2**31 - 1} <= set(gamma.ravel().tolist())
    results = host_of("puma3").take(vectors.records)
    reached = {STATUSES[status - FIRST_STATUS] for status in results["status"]}
    assert reached == REACHED
    limit = vectors.records["config"]["joint"]["torque_limit_Nm"]
    for side in (-1.0, 1.0):
        assert np.any(results["torque_Nm"] == side * limit)


@pytest.mark.parametrize("name", NAMES)
def test_no_result_holds_a_nan(name: str) -> None:
    results = [host_of(name).take(vectors_of(name).records), host_of(name).record(1, 5000)[1]]
    for result in results:
        assert not np.isnan(result["torque_Nm"]).any()
        # A refused step leaves all as it found it.
        good = ~np.isin(result["status"], (BAD_ARGUMENT, NOT_INITIALISED, STOPPED))
        for field in ("sliding_integral_rad_per_s", "applied_torque_Nm"):
            assert not np.isnan(last_memory(result["state"])[field][good]).any()


# --- Link 1 ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_casadi_in_double_is_within_its_rounding_of_the_exact_law(name: str) -> None:
    link = exact_to_double(library_of(name), model_of(name))
    assert link.holds, link
    assert link.evidence is Evidence.SAMPLED
    assert link.vectors + sum(link.left_out.values()) == len(vectors_of(name))
    assert [d.quantity for d in link.deviations] == list(QUANTITIES)
    for deviation in link.deviations:
        # Below, the bound would be too wide to say anything.
        assert 0.3 < deviation.worst_share <= 1.0
        assert 0.0 < deviation.rig_worst <= deviation.rig_bound
        assert deviation.rig_worst < 1e-12


@pytest.mark.parametrize("name", QUANTITIES)
def test_a_double_that_is_off_by_a_little_more_is_caught(name: str) -> None:
    model = model_of("puma3")
    exact = {**model.law.exact, name: model.law.exact[name] * (1.0 + 2.0**-44)}
    spoilt = replace(model, law=replace(model.law, exact=exact))
    assert not exact_to_double(library_of("puma3"), spoilt).holds


def test_the_bound_of_a_power_encloses_every_base_within_its_error() -> None:
    rng = np.random.default_rng(1)
    base = 10.0 ** rng.uniform(-30, 20, 400)
    error = base * 10.0 ** rng.uniform(-16, 1, 400)
    exponent = rng.uniform(0.0, 2.0, 400)
    bound = _power(Bounded(exactly(base).value, error), exactly(exponent))
    with mpmath.workdps(DIGITS):
        for k, sign in enumerate(rng.choice([-1, 1], 400)):
            moved = max(mpmath.mpf(base[k]) + int(sign) * mpmath.mpf(error[k]), mpmath.mpf(0))
            assert abs(mpmath.power(moved, exponent[k]) - bound.value[k]) <= bound.error[k]


def test_the_sign_of_what_may_be_zero_is_not_known() -> None:
    unsure = Bounded(exactly([1e-20, -1e-20, 0.0, 3.0]).value, np.array([1e-19, 0.0, 0.0, 1.0]))
    assert _sign(unsure).error.tolist() == [2.0, 0.0, 0.0, 0.0]


def test_distances_are_taken_exactly() -> None:
    third = Bounded(exactly([1.0]).value / 3, np.zeros(1))
    assert distance(third, np.array([1 / 3])) == pytest.approx(2.0**-54 / 3)


# --- Link 2 ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_the_c_on_the_host_lies_in_the_enclosure_of_every_vector(name: str) -> None:
    link = double_to_host(library_of(name), model_of(name), host_of(name), vectors_of(name))
    assert link.holds, link
    assert sum(link.left_out.values()) < 0.03 * link.vectors
    for deviation in link.deviations:
        assert 0.3 < deviation.worst_share <= 1.0


def test_overflow_is_foretold() -> None:
    model = model_of("puma3")
    reach = float_range(library_of("puma3").controller, model.law)
    status = host_of("puma3").take(model.vectors.records)["status"]
    assert not np.any(reach.left & reach.unsure)
    assert reach.left.sum() > 50
    assert np.all(np.isin(status[reach.left], (-5, -4)))


# Each is seen by a directed vector; random steps seldom or never come there.
HOST_MUTANTS = {
    "subnormals dropped": (
        "tdc_sig_pow.h",
        "return x * multiplier;",
        "return (((tdc_bits(x) << 1u) < 0x1000000u) ? 0.0f : x) * multiplier;",
    ),
    "multiplier not kept normal": (
        "tdc_sig_pow.h",
        "(unclamped > 0) ? unclamped : 0",
        "unclamped",
    ),
    "tiny powers of huge x a quarter": (
        "tdc_sig_pow.h",
        "(unclamped > 0) ? unclamped : 0",
        "(unclamped > -0x800000) ? unclamped : -0x800000",
    ),
    "largest exponent clipped": (
        "tdc_sig_pow.h",
        "(int64_t)a.minus_one_q31 * logarithm",
        "(int64_t)(a.minus_one_q31 > 0x7FF00000 ? 0x7FF00000 : a.minus_one_q31) * logarithm",
    ),
    "at the limit is saturated": (
        "tdc_puma3.c",
        "if ((tdc_beyond(gains->torque_limit_Nm, control_torque) >> 31u) != 0u) {",
        "if ((control_torque >= gains->torque_limit_Nm) ||"
        " ((tdc_beyond(gains->torque_limit_Nm, control_torque) >> 31u) != 0u)) {",
    ),
    "one beyond the limit is not looked at": (
        "tdc.h",
        "return tdc_bits(limit) - (tdc_bits(x) & 0x7FFFFFFFu);",
        "return (tdc_bits(limit) + 1u) - (tdc_bits(x) & 0x7FFFFFFFu);",
    ),
    "jump forwards not looked for": (
        "tdc_puma3.c",
        "((uint32_t)limit - (uint32_t)counts) | ((uint32_t)limit + (uint32_t)counts)",
        "((uint32_t)limit + (uint32_t)counts)",
    ),
    "jump backwards not looked for": (
        "tdc_puma3.c",
        "((uint32_t)limit - (uint32_t)counts) | ((uint32_t)limit + (uint32_t)counts)",
        "((uint32_t)limit - (uint32_t)counts)",
    ),
    "phase between start and running taken": (
        "tdc_puma3.c",
        "((state->phase - TDC_PHASE_RUNNING) > 1u)",
        "((state->phase - TDC_PHASE_START - 1u) > 2u)",
    ),
    "counts saturate instead of wrapping": (
        "tdc_puma3.c",
        "displacement_counts = tdc_difference(input->counts[i], last->counts);",
        "displacement_counts = (((int64_t)input->counts[i] - last->counts) > INT32_MAX) ? INT32_MAX"
        " : tdc_difference(input->counts[i], last->counts);",
    ),
    "unfilled memory taken": (
        "tdc_puma3.c",
        "if ((state->phase != TDC_PHASE_START) && ((state->phase - TDC_PHASE_LOST) > 1u)) {",
        "if (state->phase == 0u) {",
    ),
    "torque left unwritten": ("tdc_puma3.c", "} else if (torque_Nm != NULL) {", "} else if (0) {"),
}


def mutated(file: str, old: str, new: str, folder: Path, name: str = "puma3") -> Path:
    """A copy of a controller's C in which one piece of text, spaced in any way, is another."""
    folder.mkdir()
    pattern = r"\s*".join(re.escape(token) for token in re.findall(r"\w+|\S", old))
    for source in (GENERATED / name).iterdir():
        text = source.read_text(encoding="utf-8")
        if source.name == file:
            text, count = re.subn(pattern, lambda _: new, text)
            assert count == 1, f"{old!r} stands {count} times in {file}"
        (folder / source.name).write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("mutant", HOST_MUTANTS)
def test_a_mistake_at_an_edge_is_caught(mutant: str, tmp_path: Path) -> None:
    library = library_of("puma3")
    host = Host(library, mutated(*HOST_MUTANTS[mutant], tmp_path / "puma3"))
    vectors = recorded(library, 2)
    assert not double_to_host(library, modelled(library, vectors), host, vectors).holds


def test_an_unchanged_copy_is_not_caught(tmp_path: Path) -> None:
    library = library_of("puma3")
    same = "state->phase = TDC_PHASE_START;"
    host = Host(library, mutated("tdc_puma3.c", same, same, tmp_path / "puma3"))
    vectors = recorded(library, 2)
    assert double_to_host(library, modelled(library, vectors), host, vectors).holds


UNDEFINED = """
import sys
from codegen.controller import load
from verification.chain.program import Blocks, Host
from verification.equivalence import compiled
from verification.experiments import CONTROLLERS

flags = ("-fsanitize=undefined", "-fno-sanitize-recover=all")
host = Host(compiled(load(CONTROLLERS / f"{sys.argv[1]}.toml")), flags=flags)
print(len(list(host.summaries(Blocks(30, 10000)))))
"""


@pytest.mark.parametrize("name", ["puma3", "puma3_fixed"])
def test_random_steps_do_nothing_undefined(name: str) -> None:
    """Random gains, limits, memories and inputs; in its own process, which a finding ends."""
    runtime = subprocess.run(
        ["cc", "-print-file-name=libubsan.so"], capture_output=True, text=True, check=True
    ).stdout.strip()
    done = subprocess.run(
        [sys.executable, "-c", UNDEFINED, name],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "LD_PRELOAD": runtime},
        cwd=CONTROLLERS.parent,
    )
    assert done.stdout.strip() == "30", done.stderr


# --- Link 3 ------------------------------------------------------------------------------------


@pytest.mark.parametrize("board", board_names())
@pytest.mark.parametrize("name", [*NAMES, FIXED])
def test_every_bit_on_the_target_is_that_of_the_host(name: str, board: str, tmp_path: Path) -> None:
    library = library_of(name)
    target = Target(load_board(board), image(load_board(board), library, None, tmp_path), library)
    told: list[int] = []
    link = host_to_target(library, target, host_of(name), vectors_of(name), BLOCKS, told.append)
    assert link.holds, link
    assert link.mismatch is None
    assert (link.steps, link.blocks, link.equal_blocks) == (6000, 3, 3)
    assert link.host_sha256 == link.target_sha256
    assert sum(told) == 6000
    assert sum(link.statuses.values()) == 6000
    # The random steps are good for something: not all of them are errors or at a limit.
    assert link.statuses["good"] > 0.25 * 6000
    reached = REACHED if name != FIXED else (REACHED | {"out of range"}) - {"not finite"}
    assert min(link.statuses[s] for s in reached) > 5
    assert link.refused_configurations > 20


@pytest.fixture(scope="module", params=["mps2-an386", "riscv-virt"])
def spoilt(request: pytest.FixtureRequest) -> Callable[..., Target]:
    """Builds puma3's program for a board, with other flags or other C."""
    board = load_board(request.param)

    def build(folder: Path, generated: Path | None = None, flags: tuple[str, ...] = ()) -> Target:
        library = library_of("puma3")
        return Target(board, image(board, library, generated, folder, flags), library)

    return build


def only_random(vectors: Vectors) -> Vectors:
    """No recorded vectors, so that the hashes have to find what differs."""
    return vectors.take(np.zeros(len(vectors), np.bool_))


def test_fused_multiply_adds_on_the_target_are_named(
    spoilt: Callable[..., Target], tmp_path: Path
) -> None:
    target = spoilt(tmp_path, flags=("-ffp-contract=fast",))
    vectors = only_random(vectors_of("puma3"))
    link = host_to_target(library_of("puma3"), target, host_of("puma3"), vectors, BLOCKS)
    assert not link.holds
    assert link.equal_blocks == 0
    assert link.mismatch is not None
    assert link.mismatch.block == 0
    assert link.mismatch.joint in (0, 1, 2)
    assert link.mismatch.field in (
        "torque_Nm",
        "applied_torque_Nm",
        "sliding_integral_rad_per_s",
    )
    assert link.mismatch.host_bits != link.mismatch.target_bits
    assert link.mismatch.host_bits in str(link.mismatch)


def test_another_constant_on_the_target_is_named(
    spoilt: Callable[..., Target], tmp_path: Path
) -> None:
    # The neighbour of 0.001f: the least that it can be off.
    other = (
        "tdc_puma3.h",
        "TDC_PUMA3_SAMPLE_TIME_S 0.001f",
        "TDC_PUMA3_SAMPLE_TIME_S 0.00100000012f",
    )
    generated = mutated(*other, tmp_path / "puma3")
    target = spoilt(tmp_path / "out", generated)
    vectors = vectors_of("puma3")
    link = host_to_target(library_of("puma3"), target, host_of("puma3"), vectors, BLOCKS)
    assert not link.holds
    assert link.mismatch is not None
    assert link.mismatch.block is None
    assert link.mismatch.field == "sliding_integral_rad_per_s"
    assert "vector" in str(link.mismatch)
    assert link.mismatch.group in vectors.group


@pytest.mark.skipif(not HOST_HAS_FMA, reason="this computer has no fused multiply-add")
def test_fused_multiply_adds_on_the_host_are_named(tmp_path: Path) -> None:
    library, board = library_of("puma3"), load_board("mps2-an500")
    fused = Host(library, flags=("-ffp-contract=fast", "-mfma"))
    target = Target(board, image(board, library, None, tmp_path), library)
    vectors = only_random(vectors_of("puma3"))
    link = host_to_target(library, target, fused, vectors, BLOCKS)
    assert not link.holds
    assert link.mismatch is not None
    assert link.mismatch.block == 0


def test_another_controllers_program_is_refused(tmp_path: Path) -> None:
    board = load_board("mps2-an386")
    elf = image(board, library_of("puma6"), None, tmp_path)
    with pytest.raises(ToolError, match="no program for this controller"):
        Target(board, elf, library_of("puma3")).take(vectors_of("puma3").records[:1])


@pytest.mark.parametrize("content", [None, b"no program"])
def test_a_program_that_does_not_run_is_told(
    content: bytes | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("verification.chain.program.SILENCE_S", 0.5)
    broken = tmp_path / "chain.elf"
    if content is not None:
        broken.write_bytes(content)
    with pytest.raises(ToolError, match="after 0 of 76 bytes; the emulator says"):
        Target(load_board("riscv-virt"), broken, library_of("puma3")).summaries(Blocks(1, 1))


def test_the_first_difference_is_named_by_field_and_joint() -> None:
    records = vectors_of("puma3").records[:9].copy()
    assert first_difference(records, records) is None
    other = records.copy()
    other["input"]["counts"][4, 2] ^= 1
    other["state"]["joint"]["tick"]["applied_torque_Nm"][4, 1, 0] = -1.5
    found = first_difference(records, other, block=7)
    assert found is not None
    assert (found.block, found.step, found.field) == (7, 4, "applied_torque_Nm")
    assert (found.joint, found.target, found.target_bits) == (1, "-1.5", "0xBFC00000")
    other["missing"][2] = 8
    found = first_difference(records, other)
    assert found is not None
    assert (found.step, found.field, found.joint, found.target) == (2, "missing", None, "8")


def test_a_block_follows_from_its_number_alone() -> None:
    cases, results = host_of("puma3").record(2, BLOCKS.steps)
    assert np.array_equal(host_of("puma3").take(cases)["status"], results["status"])
    assert cases.dtype == case_type(library_of("puma3"))
    three = host_of("puma3").summaries(BLOCKS)
    assert three[:2].tobytes() == host_of("puma3").summaries(Blocks(2, BLOCKS.steps)).tobytes()
    assert len(set(three["hash"].tolist())) == 3
    counted = np.bincount(results["status"] - FIRST_STATUS, minlength=len(STATUSES))
    assert three["statuses"][2].tolist() == counted.tolist()
    refused = STATUSES.index("not initialised"), STATUSES.index("bad argument")
    assert is_refused(cases).sum() == counted[list(refused)].sum()


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("name", ["puma3", "puma3_fixed"])
def test_the_program_compiles_without_a_warning(compiler: str, name: str, tmp_path: Path) -> None:
    flags = [f"-I{path}" for path in (TARGET.parents[2], STUB, GENERATED / name)]
    flags += [f"-DCONTROLLER={name}", f"-DCONTROLLER_UPPER={name.upper()}", "-O2"]
    for source in (*STEPS, "main"):
        file = TARGET / f"{source}.c"
        run_tool(compiler, *WARNINGS, *flags, "-c", file, "-o", tmp_path / "x.o")


def test_an_integer_that_is_off_by_one_on_the_target_is_named(tmp_path: Path) -> None:
    library, board = library_of(FIXED), load_board("mps2-an385-m0plus")
    other = (
        f"tdc_{FIXED}.c",
        "displacement_change * MOTION_PER_COUNT;",
        "displacement_change * 524289;",
    )
    generated = mutated(*other, tmp_path / FIXED, FIXED)
    target = Target(board, image(board, library, generated, tmp_path / "out"), library)
    link = host_to_target(library, target, host_of(FIXED), vectors_of(FIXED), BLOCKS)
    assert not link.holds
    assert link.mismatch is not None
    assert link.mismatch.field == "torque_q"
    value = int(link.mismatch.target_bits, 16)
    assert int(link.mismatch.target) % 2**32 == value


def test_a_fixed_point_controller_has_the_last_link_only() -> None:
    found = chain([library_of(FIXED).controller], [load_board("mps2-an385")], Blocks(1, 500))
    assert found.holds
    assert found.numeric == ()
    assert [link.controller for link in found.bits] == [FIXED]


def test_a_controller_in_double_is_refused() -> None:
    with pytest.raises(SpecificationError, match=r"precision = .*float64"):
        chain([load(CONTROLLERS / "puma3_float64.toml")], [], Blocks(1, 500))


# --- The command -------------------------------------------------------------------------------


@pytest.fixture
def results_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the command leaves its figures, instead of those of a whole run."""
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    monkeypatch.setenv("COLUMNS", "160")
    return tmp_path


def test_the_command_prints_a_table_and_leaves_json(
    results_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["chain", "--steps", "500", "--controller", "puma3", "--board", "mps2-an386"]
    assert main(words) == 0
    shown = capsys.readouterr().out
    assert "Cortex-M4F" in shown
    assert "1/1 equal" in shown
    assert "bound of 2" in shown
    left = json.loads((results_folder / "chain.json").read_text(encoding="utf-8"))
    assert left["holds"] is True
    assert [link["vectors"] > 1000 for link in left["numeric"]] == [True, True]
    (bits,) = left["bits"]
    assert (bits["steps"], bits["equal_blocks"], bits["evidence"]) == (500, 1, "sampled")
    assert re.fullmatch("[0-9a-f]{64}", left["vectors_sha256"]["puma3"])
