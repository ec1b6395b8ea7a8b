"""The bench's rows: every variant on every core, for three and for six joints."""

from __future__ import annotations

import math
import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from codegen.controller import Controller
from codegen.emit import REPOSITORY
from plant.native import BUILD
from verification.bench import cycles, parts
from verification.bench.count import Replay, emulator_version, replay
from verification.bench.program import (
    Data,
    Harness,
    Prepared,
    Program,
    build,
    compiler_version,
    flags,
    harness,
    library,
    library_version,
    plugin,
    prepare,
    prepare_for,
    require_tools,
    write_data,
)
from verification.bench.recording import (
    ROBOTS,
    TICKS,
    Kind,
    Outcome,
    Replayed,
    all_sequences,
    controller_of,
    recording_for,
)
from verification.bench.variants import (
    NAIVE_DOUBLE,
    PROJECT,
    PROJECT_LINEAR,
    TARGET,
    VARIANTS,
    WITH_POWERS,
    Variant,
    variant_of,
)
from verification.disassembly import Program as Code
from verification.disassembly import disassemble
from verification.evidence import Evidence, current_json, write_json
from verification.firmware import Board, board_names, load_board

JOINTS = tuple(ROBOTS)
RESULT = BUILD / "bench" / "step.json"
RECORD = REPOSITORY / "docs" / "what-a-tick-costs.json"
"""The figures that come with the repository."""


class BenchError(Exception):
    """What was measured can't be right, so that no figure is given."""


@dataclass(frozen=True)
class Case:
    """The instructions of one special tick.

    Attributes:
        name: what is special.
        outcome: what this project's step answers to it.
        instructions: of that tick.
    """

    name: str
    outcome: Outcome
    instructions: int


@dataclass(frozen=True)
class Row:
    """What a variant costs on a core.

    Attributes:
        variant: name of the variant (see :mod:`verification.bench.variants`).
        core: the processor.
        board: the emulated board.
        joints: number of joints n.
        instructions_per_step: mean over the recorded motion, the call and its return included.
        instructions_min: fewest in the recorded motion.
        instructions_max: most in the recorded motion.
        usual_fewest: fewest in any usual tick: not the first, at no torque limit and no error.
        usual_most: most in any usual tick.
        fewest_instructions: fewest in any tick, special cases and random bits included.
        worst_instructions: most in any tick.
        worst_case: what that tick was.
        random_bits_instructions: most in the ticks of random bits.
        special_cases: each directed case.
        flash_bytes: code, tables and initial values, those of the C library included.
        stack_bytes: deepest stack of any tick.
        cross_checked_ticks: ticks counted both by the plugin and by the guest's timer.
        disagreements: ticks in which the two counts differ.
        torque_difference_Nm: largest difference from the torques of the variant that it is
            compared with, over the recorded motion; 0 for that variant itself [N m].
        times_the_project: instructions_per_step over those of this project's step.
        estimated_cycles: mean over the recorded motion, by Arm's tables and not measured (see
            :mod:`verification.bench.cycles`); None for a core without a table.
        parts: instructions_per_step by what they are for (see :mod:`verification.bench.parts`);
            empty but for this project's step.
    """

    variant: str
    core: str
    board: str
    joints: int
    instructions_per_step: float
    instructions_min: int
    instructions_max: int
    usual_fewest: int
    usual_most: int
    fewest_instructions: int
    worst_instructions: int
    worst_case: str
    random_bits_instructions: int
    special_cases: tuple[Case, ...]
    flash_bytes: int
    stack_bytes: int
    cross_checked_ticks: int
    disagreements: int
    torque_difference_Nm: float
    times_the_project: float
    estimated_cycles: float | None = None
    parts: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Spread:
    """How far the time of this project's step depends on the data.

    Attributes:
        variant: title of the variant.
        core: the processor.
        joints: number of joints.
        mean: instructions of a tick over the recorded motion.
        usual_fewest: fewest in a usual tick: not the first, at no torque limit and no error.
        usual_most: most in a usual tick.
        worst: most in any tick, random bits included.
        worst_case: what that tick was.
    """

    variant: str
    core: str
    joints: int
    mean: float
    usual_fewest: int
    usual_most: int
    worst: int
    worst_case: str

    @property
    def is_constant(self) -> bool:
        """Whether all usual ticks are equally long."""
        return self.usual_fewest == self.usual_most

    @property
    def worst_relative(self) -> float:
        """How much longer the longest tick is than the mean one."""
        return self.worst / self.mean - 1.0

    @property
    def statement(self) -> str:
        """What to budget; the tests hold the step to it."""
        usual = (
            f"every usual tick takes {self.usual_most} instructions"
            if self.is_constant
            else f"a usual tick takes {self.usual_fewest} to {self.usual_most} instructions, "
            f"{self.mean:.0f} on average"
        )
        return (
            f"{self.core}, n = {self.joints}, {self.variant}: {usual}; the worst "
            f"{self.worst} ({self.worst_relative:.0%} more): {self.worst_case}."
        )


@dataclass(frozen=True)
class Conditions:
    """With what a core's rows were measured."""

    core: str
    compiler: str
    flags: str
    library: str
    emulator: str


@dataclass(frozen=True)
class Result:
    """All that the bench found."""

    rows: tuple[Row, ...]
    spreads: tuple[Spread, ...]
    conditions: tuple[Conditions, ...]
    evidence: Evidence = Evidence.MEASURED


_FIRST = "first tick"

# Which variant's torques a variant must reproduce: the one that computes the same law.
_REFERENCE = {
    variant.name: PROJECT_LINEAR.name if variant.experiment else NAIVE_DOUBLE.name
    for variant in VARIANTS
}
TORQUE_TOLERANCE_NM = 1e-2
"""Float against double over the recorded motion; another law would differ by newton metres."""


def measure(
    boards: Iterable[str] | None = None,
    joints: Iterable[int] = JOINTS,
    variants: Sequence[Variant] = VARIANTS,
    advance: Callable[[], None] = lambda: None,
) -> Result:
    """Writes, compiles, runs and counts; always everything anew.

    Args:
        boards: names of boards, all of them by default.
        joints: numbers of joints.
        variants: must contain this project's step and the naive one, which the others are
            compared with.
        advance: called after each program.

    Raises:
        BenchError: the two ways to count disagree, or a variant computes another law.
        verification.firmware.ToolError: a tool is missing or failed.
    """
    chosen = [load_board(name) for name in (boards or board_names())]
    for board in chosen:
        require_tools(board)
    with tempfile.TemporaryDirectory(prefix="bench-") as scratch:
        directory = Path(scratch)
        counter = plugin(directory)
        jobs = []
        with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
            for n in joints:
                prepared = [prepare(variant, n, directory) for variant in variants]
                inputs = _all_inputs(prepared, directory)
                jobs += [
                    pool.submit(_measure_board, b, prepared, inputs, counter, directory, advance)
                    for b in chosen
                ]
            rows = tuple(row for job in jobs for row in job.result())
    return Result(rows, spreads(rows), tuple(map(_conditions, chosen)))


def measure_controller(controller: Controller, boards: Iterable[str] | None = None) -> Result:
    """The same for one controller's own C, on all cores that its numbers are for.

    Args:
        controller: any specification.
        boards: names of boards, all of them by default.

    Raises:
        BenchError: the two ways to count disagree.
        verification.firmware.ToolError: a tool is missing or failed.
    """
    variant = variant_of(controller)
    chosen = [b for b in map(load_board, boards or board_names()) if variant.fits(b)]
    for board in chosen:
        require_tools(board)
    with tempfile.TemporaryDirectory(prefix="bench-") as scratch:
        directory = Path(scratch)
        counter = plugin(directory)
        prepared = prepare_for(controller, variant, directory)
        sequences = all_sequences(controller, recording_for(controller))
        data = write_data(controller, sequences, directory)

        def on(board: Board) -> Row:
            common = harness(board, prepared, data, directory)
            program = build(board, prepared, common, directory)
            recorded = len(sequences[0].ticks)
            return _row(program, replay(program, counter, data.ticks, recorded), sequences)

        with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
            rows = tuple(pool.map(on, chosen))
    for row in rows:
        _check(row)
    return Result(rows, spreads(rows), tuple(map(_conditions, chosen)))


@dataclass(frozen=True)
class _Inputs:
    """What variants with the same numbers replay."""

    sequences: tuple[Replayed, ...]
    data: Data


def _all_inputs(prepared: Sequence[Prepared], directory: Path) -> dict[str, _Inputs]:
    """The inputs for each kind of numbers."""
    made: dict[str, _Inputs] = {}
    for each in prepared:
        if each.numbers not in made:
            # The gains of another experiment would change what is plausible: not for inputs.
            controller = controller_of(each.joints, None, each.variant.numbers)
            sequences = all_sequences(controller)
            made[each.numbers] = _Inputs(sequences, write_data(controller, sequences, directory))
    return made


def _measure_board(
    board: Board,
    prepared: Sequence[Prepared],
    inputs: Mapping[str, _Inputs],
    counter: Path,
    directory: Path,
    advance: Callable[[], None],
) -> list[Row]:
    commons: dict[str, Harness] = {}
    replays: dict[str, Replay] = {}
    rows: list[Row] = []
    for each in prepared:
        if each.variant.fits(board):
            given = inputs[each.numbers]
            if each.numbers not in commons:
                commons[each.numbers] = harness(board, each, given.data, directory)
            program = build(board, each, commons[each.numbers], directory)
            found = replay(program, counter, given.data.ticks, TICKS)
            replays[each.variant.name] = found
            rows.append(_row(program, found, given.sequences))
        advance()
    rows = [replace(r, torque_difference_Nm=_difference(r, replays)) for r in rows]
    project = next(r for r in rows if r.variant == PROJECT.name).instructions_per_step
    rows = [replace(r, times_the_project=r.instructions_per_step / project) for r in rows]
    for row in rows:
        _check(row)
    return rows


def _row(program: Program, found: Replay, sequences: tuple[Replayed, ...]) -> Row:
    counts = found.instructions
    recorded: list[int] = []
    random: list[int] = []
    usual: list[int] = []
    cases: list[Case] = []
    names: list[str] = []
    for sequence in sequences:
        first = len(names)
        names += [_FIRST, *[sequence.name] * (len(sequence.ticks) - 1)]
        last = counts[len(names) - 1]
        # Behind the first tick all are usual but perhaps the last.
        usual += counts[first + 1 : len(names) - (sequence.outcome is not Outcome.USUAL)]
        if sequence.kind is Kind.RECORDED:
            recorded += counts[first : len(names)]
        elif sequence.kind is Kind.RANDOM:
            random.append(last)
        else:
            cases.append(Case(sequence.name, sequence.outcome, last))
    worst = max(counts)
    code = disassemble(program.board, program.elf)
    executed = _executed(program, code, found, sum(recorded))
    core = cycles.CORES.get(program.board.core)
    return Row(
        variant=program.prepared.variant.name,
        core=program.board.core,
        board=program.board.name,
        joints=program.prepared.joints,
        instructions_per_step=math.fsum(recorded) / len(recorded),
        instructions_min=min(recorded),
        instructions_max=max(recorded),
        usual_fewest=min(usual),
        usual_most=max(usual),
        fewest_instructions=min(counts),
        worst_instructions=worst,
        worst_case=names[counts.index(worst)],
        random_bits_instructions=max(random),
        special_cases=tuple(cases),
        flash_bytes=program.flash_bytes,
        stack_bytes=max(found.stack_bytes),
        cross_checked_ticks=len(counts),
        disagreements=found.disagreements,
        torque_difference_Nm=0.0,
        times_the_project=1.0,
        estimated_cycles=None
        if core is None
        else cycles.estimate(core, code, found.runs) / len(recorded),
        parts=_parts(program, executed, len(recorded)),
    )


def _executed(program: Program, code: Code, found: Replay, instructions: int) -> Counter[int]:
    """How often each instruction was executed in the recorded ticks, by its address.

    Raises:
        BenchError: what was recorded are not the instructions that were counted.
    """
    executed: Counter[int] = Counter()
    for (address, _), count in cycles.transitions(code, found.runs).items():
        executed[address] += count
    if executed.total() != instructions:
        raise BenchError(
            f"{program.elf}: {executed.total()} instructions were recorded, {instructions} counted"
        )
    return executed


def _parts(program: Program, executed: Mapping[int, int], ticks: int) -> dict[str, float]:
    """Instructions of a recorded tick by what they are for, in this project's step."""
    prepared = program.prepared
    if prepared.variant.name not in {variant.name for variant in WITH_POWERS}:
        return {}
    own = {path.name for folder in (prepared.generated, TARGET) for path in folder.iterdir()}
    found = parts.parts(program.board, program.elf, own, executed)
    return {part: count / ticks for part, count in found.items()}


def _difference(row: Row, replays: dict[str, Replay]) -> float:
    """Largest torque difference to the reference, over the recorded ticks, which come first."""
    mine = replays[row.variant].torque_Nm[:TICKS]
    reference = replays[_REFERENCE[row.variant]].torque_Nm[:TICKS]
    return max(
        abs(a - b)
        for ours, theirs in zip(mine, reference, strict=True)
        for a, b in zip(ours, theirs, strict=True)
    )


def _check(row: Row) -> None:
    where = f"{row.variant} on {row.core}, n = {row.joints}"
    if row.disagreements:
        raise BenchError(
            f"{where}: plugin and timer disagree in {row.disagreements} of "
            f"{row.cross_checked_ticks} ticks"
        )
    # Written so that NaN fails as well.
    if not row.torque_difference_Nm <= TORQUE_TOLERANCE_NM:
        raise BenchError(
            f"{where}: the torque differs by {row.torque_difference_Nm:.3g} N m from that of "
            f"{_REFERENCE[row.variant]}: it computes another law"
        )


def spreads(rows: Iterable[Row]) -> tuple[Spread, ...]:
    """How far the time of this project's step depends on the data, for each core."""
    titles = {variant.name: variant.title for variant in WITH_POWERS}
    return tuple(
        Spread(
            titles[row.variant],
            row.core,
            row.joints,
            row.instructions_per_step,
            row.usual_fewest,
            row.usual_most,
            row.worst_instructions,
            row.worst_case,
        )
        for row in rows
        if row.variant in titles
    )


def row_of(rows: Iterable[Row], variant: Variant, core: str, joints: int) -> Row:
    """The row of a variant on a core.

    Raises:
        KeyError: there is none.
    """
    for row in rows:
        if (row.variant, row.core, row.joints) == (variant.name, core, joints):
            return row
    raise KeyError(f"no row for {variant.name} on {core}, n = {joints}")


def _conditions(board: Board) -> Conditions:
    return Conditions(
        board.core,
        f"{board.toolchain}gcc {compiler_version(board)}",
        " ".join(flags(board)),
        f"{library(board).name} {library_version(board)}",
        f"{emulator_version(board)}, {board.name}",
    )


def record(result: Result, path: Path = RECORD) -> Path:
    """Writes the figures beside the page of them, without each special case."""
    rows = tuple(replace(row, special_cases=()) for row in result.rows)
    return save(replace(result, rows=rows), path)


def save(result: Result, path: Path = RESULT) -> Path:
    """Writes the figures as JSON."""
    return write_json(
        {
            "rows": result.rows,
            "step_time": [{**vars(s), "statement": s.statement} for s in result.spreads],
            "conditions": result.conditions,
            "variants": {v.name: {"title": v.title, "meaning": v.meaning} for v in VARIANTS},
            "evidence": result.evidence,
            "estimated_cycles": cycles.NOTE,
        },
        path,
    )


def measured_or_recorded() -> Result | None:
    """The figures of this build folder, or those that come with the repository, of today's C."""
    return load() or load(RECORD)


def load(path: Path = RESULT) -> Result | None:
    """The figures that :func:`save` left, or None if there are none of today's generated C."""
    left = current_json(path)
    try:
        return None if left is None else _result(left)
    except (KeyError, TypeError, ValueError):
        return None  # as another version of the bench wrote it


def _result(left: Mapping[str, Any]) -> Result:
    rows = (
        Row(**{**row, "special_cases": tuple(map(_case, row["special_cases"]))})
        for row in left["rows"]
    )
    spreads = (
        Spread(**{k: v for k, v in spread.items() if k != "statement"})
        for spread in left["step_time"]
    )
    conditions = (Conditions(**each) for each in left["conditions"])
    return Result(tuple(rows), tuple(spreads), tuple(conditions))


def _case(left: Mapping[str, Any]) -> Case:
    return Case(**{**left, "outcome": Outcome(left["outcome"])})
