"""The links of the chain, each with what it compares, how far apart the ends are, and its bound.

1. the law over exact numbers - the ``casadi.Function`` in double (a rounding bound of 2^-53)
2. the ``casadi.Function`` in double - the generated C on the host (enclosures of binary32)
3. the generated C on the host - the same C on each target (equal bits)

A fixed-point controller has the last link only: its integers are followed by ``codegen``.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codegen.arithmetic import FLOAT64
from codegen.controller import Controller
from codegen.law import LawFunction, measurement, switch_on, torque_law
from codegen.problems import Problem, SpecificationError
from codegen.sig_pow import tables
from verification.cases import Cases, Records, is_running, is_starting, last_memory
from verification.chain.forward_error import Bounded, distance, exact_law, exactly
from verification.chain.program import (
    STATUSES,
    UNWRITTEN,
    Blocks,
    Host,
    Target,
    image,
)
from verification.chain.vectors import (
    DRAWN,
    FLOAT_MAX,
    Vectors,
    float_inputs,
    is_refused,
    recorded,
)
from verification.equivalence import (
    Batch,
    Compiled,
    Flags,
    Integers,
    Outputs,
    checks,
    compiled,
    frozen_joints,
    integers,
    jumps,
    outputs,
    stops,
)
from verification.evidence import Evidence
from verification.firmware import Board
from verification.interval import Interval, point, rules
from verification.law_graph import evaluate

Doubles = NDArray[np.float64]
_Ends = tuple[Doubles, Doubles]
"""How far two ends are apart, and the bound of that, shape (vectors, joints)."""

BLOCK_STEPS = 10_000
BAD_ARGUMENT, NOT_INITIALISED, ENCODER_JUMP = -1, -3, -4

QUANTITIES = {"limited_torque": "N m", "next_sliding_integral": "rad/s"}
"""The outputs of a step that floating point computes, with their units."""

EXACT_TO_DOUBLE = "exact law -> CasADi double"
DOUBLE_TO_HOST = "CasADi double -> C on host"
HOST_TO_TARGET = "C on host -> "

WHY = {
    EXACT_TO_DOUBLE: (
        "running error analysis: 2^-53 an operation, 2^-52 for pow (one unit in the last place, "
        "the C library's own bound), carried through the law at each vector"
    ),
    DOUBLE_TO_HOST: (
        "interval enclosure at each vector: 2^-24 an operation, the bound of sig_pow's "
        "kernel, and one unit of 2^-149 where a result is subnormal (four for the kernel); widest "
        "where s is next to zero, because sig(s)^gamma is steepest there"
    ),
}
WHY_BITS = (
    "no deviation: IEEE 754 fixes each operation to nearest, the kernel is integers, and "
    "-ffp-contract=off keeps compilers from fusing two of them"
)


# --- Results -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Deviation:
    """How far the two ends of a link are apart in one output.

    Attributes:
        quantity: name of the output in the law.
        unit: its unit.
        values: how many were compared.
        rig_worst: the largest distance on the vectors drawn near what a rig sees.
        rig_bound: the bound at that vector.
        worst_share: the largest distance as a share of its bound, over all vectors; 1 is allowed.
        worst_group: what the vector with that share is there for.
    """

    quantity: str
    unit: str
    values: int
    rig_worst: float
    rig_bound: float
    worst_share: float
    worst_group: str


@dataclass(frozen=True)
class NumericLink:
    """A link whose ends may differ by rounding.

    Attributes:
        link: its two ends.
        controller: name of the controller.
        vectors: how many were compared.
        left_out: vectors that the link says nothing of, by reason.
        deviations: of each output.
        violations: checks that failed, with the first vector.
        why: where the bound comes from.
        evidence: always sampled; what is proved is the bound at each vector.
    """

    link: str
    controller: str
    vectors: int
    left_out: dict[str, int]
    deviations: tuple[Deviation, ...]
    violations: tuple[str, ...]
    why: str
    evidence: Evidence = Evidence.SAMPLED

    @property
    def holds(self) -> bool:
        """Whether every deviation is within its bound, and no check failed."""
        return not self.violations and all(d.worst_share <= 1.0 for d in self.deviations)


@dataclass(frozen=True)
class Mismatch:
    """The first step where target and host differ.

    Attributes:
        block: of the random steps, or None for a recorded vector.
        step: in the block, or the vector's number.
        group: what a recorded vector is there for, or empty.
        field: which word of the result (or of the step itself).
        joint: from 0, or None where the word belongs to no joint.
        host: value on the host.
        target: value on the target.
        host_bits: its 32 bits.
        target_bits: its 32 bits.
    """

    block: int | None
    step: int
    group: str
    field: str
    joint: int | None
    host: str
    target: str
    host_bits: str
    target_bits: str

    def __str__(self) -> str:
        """One line for a person."""
        place = f"block {self.block}, step {self.step}"
        if self.block is None:
            place = f"vector {self.step} ({self.group})"
        place += "" if self.joint is None else f", joint {self.joint}"
        return (
            f"{place}: {self.field} is {self.target} ({self.target_bits}) on the target, "
            f"{self.host} ({self.host_bits}) on the host"
        )


@dataclass(frozen=True)
class BitLink:
    """The C on the host and on one target, which may not differ at all.

    Attributes:
        board: name of the board.
        core: its processor.
        controller: name of the controller.
        vectors: recorded vectors whose results were compared.
        host_sha256: of the results of all recorded vectors.
        target_sha256: likewise.
        steps: random steps taken on both sides.
        blocks: into how many hashes they went.
        equal_blocks: how many of these are equal.
        host_blocks_sha256: of all block summaries.
        target_blocks_sha256: likewise.
        statuses: how many random steps ended in which status.
        refused_configurations: random configurations that check_config and init refused.
        seconds: what the random steps took on the target, the emulator's start included.
        mismatch: the first difference, or None.
        why: why there may be none.
        evidence: always sampled.
    """

    board: str
    core: str
    controller: str
    vectors: int
    host_sha256: str
    target_sha256: str
    steps: int
    blocks: int
    equal_blocks: int
    host_blocks_sha256: str
    target_blocks_sha256: str
    statuses: dict[str, int]
    refused_configurations: int
    seconds: float
    mismatch: Mismatch | None
    why: str = WHY_BITS
    evidence: Evidence = Evidence.SAMPLED

    @property
    def holds(self) -> bool:
        """Whether all results are bit-equal."""
        return (
            self.host_sha256 == self.target_sha256
            and self.equal_blocks == self.blocks
            and self.host_blocks_sha256 == self.target_blocks_sha256
        )


@dataclass(frozen=True)
class Chain:
    """All links of all controllers.

    Attributes:
        numeric: links 1 and 2 of each floating-point controller.
        bits: link 3 of each controller on each target.
        vectors_sha256: of the recorded vectors, by controller.
    """

    numeric: tuple[NumericLink, ...]
    bits: tuple[BitLink, ...]
    vectors_sha256: dict[str, str]

    @property
    def holds(self) -> bool:
        """Whether every link holds."""
        return all(n.holds for n in self.numeric) and all(b.holds for b in self.bits)


# --- The law on vectors ------------------------------------------------------------------------


@dataclass(frozen=True)
class Modelled:
    """Vectors that the controller must not refuse, with the models' view of them.

    Attributes:
        vectors: in the group ``encoder jump`` or ``stopped`` where that is so, whatever they are
            there for.
        refused: how many others there were, which the controller must refuse.
        stopped: whether too many ticks were lost, shape (steps,).
        jump: whether there is one, shape (steps,).
        whole: what the C computes in integers.
        law: in double and as enclosures.
    """

    vectors: Vectors
    refused: int
    stopped: Flags
    jump: Flags
    whole: Integers
    law: Outputs


def modelled(library: Compiled, vectors: Vectors) -> Modelled:
    """The law in double and as enclosures, on the vectors that the controller must not refuse."""
    accepted = vectors.take(~is_refused(vectors.records))
    cases = accepted.cases
    running = is_running(cases.state)
    whole = integers(cases, running)
    stopped, jump = stops(cases), jumps(cases, whole)
    with np.errstate(all="ignore"):  # some vectors hold NaN and infinities on purpose
        law = outputs(cases, library.controller, whole, running)
    group = np.where(stopped, "stopped", np.where(jump, "encoder jump", accepted.group))
    return Modelled(
        Vectors(accepted.records, group), len(vectors) - len(accepted), stopped, jump, whole, law
    )


def _finite_inputs(cases: Cases) -> Flags:
    finite = np.ones(len(cases), np.bool_)
    for name in float_inputs(cases.input):
        finite &= np.isfinite(cases.input[name]).all(axis=1)
    return finite


def _deviations(group: NDArray[np.str_], ends: dict[str, _Ends]) -> tuple[Deviation, ...]:
    """The worst of each output."""
    found = []
    for name, (apart, bound) in ends.items():
        # A bound of zero lets any distance at all be infinitely much of it.
        with np.errstate(divide="ignore"):
            share = np.divide(apart, bound, out=np.zeros_like(apart), where=apart > 0.0)
        rig = np.where((group == "rig")[:, None], apart, 0.0)
        at_rig = np.unravel_index(rig.argmax(), rig.shape)
        worst = np.unravel_index(share.argmax(), share.shape)
        found.append(
            Deviation(
                name,
                QUANTITIES[name],
                apart.size,
                float(rig[at_rig]),
                float(bound[at_rig]),
                float(share[worst]),
                str(group[worst[0]]),
            )
        )
    return tuple(found)


# --- Link 1: the exact law and CasADi in double ------------------------------------------------


def exact_to_double(library: Compiled, model: Modelled) -> NumericLink:
    """The law over exact numbers against the ``casadi.Function`` in double.

    Both start from the numbers that the C holds: binary32 gains and conversion factors, exponents
    in Q31, integers. A NaN or an infinity is no number, and its vector left out.
    """
    finite = _finite_inputs(model.vectors.cases)
    cases = model.vectors.take(finite).cases
    doubles = {name: value[finite] for name, value in _full(model.law).items()}
    exact = _exact(library.controller, cases, doubles)
    ends = {name: (distance(exact[name], doubles[name]), exact[name].error) for name in QUANTITIES}
    return NumericLink(
        EXACT_TO_DOUBLE,
        library.controller.name,
        int(finite.sum()),
        {"an input is not finite": int((~finite).sum()), "no step is taken": model.refused},
        _deviations(model.vectors.group[finite], ends),
        (),
        WHY[EXACT_TO_DOUBLE],
    )


def _full(law: Outputs) -> dict[str, Doubles]:
    shape = law.exact["limited_torque"].shape
    return {name: np.broadcast_to(value, shape) for name, value in law.exact.items()}


def _exact(controller: Controller, cases: Cases, doubles: dict[str, Doubles]) -> dict[str, Bounded]:
    """All quantities of the law over exact numbers; only its inputs are taken from the doubles."""
    parts = (measurement(controller.options), switch_on(), torque_law(controller.options))
    computed = {quantity.name for part in parts for quantity in part.quantities}
    needed = {i.name for part in parts for i in part.inputs} - computed
    known = {name: exactly(doubles[name]) for name in needed}
    measure, start, law = parts
    known |= exact_law(measure, known)
    first = exact_law(start, known)["sliding_integral"]
    goes_on = ~is_starting(cases.state)[:, None]
    # A first tick's memory may hold any bits there, which are no number and not used.
    integral = last_memory(cases.state)["sliding_integral_rad_per_s"]
    remembered = exactly(np.where(goes_on, integral, np.float32(0.0)))
    known["sliding_integral"] = Bounded(
        np.where(goes_on, remembered.value, first.value), np.where(goes_on, 0.0, first.error)
    )
    return known | exact_law(law, known)


# --- Link 2: CasADi in double and the C on the host --------------------------------------------


@dataclass(frozen=True)
class Range:
    """Whether binary32 can hold a step, shape (steps,).

    Attributes:
        left: an intermediate result certainly overflows.
        unsure: one may.
    """

    left: Flags
    unsure: Flags


def float_range(controller: Controller, law: Outputs) -> Range:
    """Which steps leave binary32, by the enclosures of every intermediate result."""
    shape = law.exact["limited_torque"].shape
    left, unsure = np.zeros(shape, np.bool_), np.zeros(shape, np.bool_)

    def noted(rule: Callable[..., Interval]) -> Callable[..., Interval]:
        def apply(*operands: Interval) -> Interval:
            result = rule(*operands)
            nearest = np.maximum(np.maximum(result.low, -result.high), 0.0)
            farthest = np.maximum(np.abs(result.low), np.abs(result.high))
            np.logical_or(left, nearest > FLOAT_MAX, out=left)
            np.logical_or(unsure, ~(farthest <= FLOAT_MAX), out=unsure)
            return result

        return apply

    watched = {code: noted(rule) for code, rule in rules(tables().bounds.relative).items()}
    parts: tuple[LawFunction, ...] = (
        measurement(controller.options),
        torque_law(controller.options),
    )
    with np.errstate(all="ignore"):
        for part in parts:
            evaluate(part, law.enclosed, watched, point)
    certain: Flags = np.any(left, axis=1)
    possible: Flags = np.any(unsure, axis=1) & ~certain
    return Range(certain, possible)


def double_to_host(library: Compiled, model: Modelled, host: Host, vectors: Vectors) -> NumericLink:
    """The ``casadi.Function`` in double against the C on the host, and all that the C does besides.

    Args:
        library: the controller.
        model: the models' view of the vectors.
        host: the C.
        vectors: all of them, those that the controller must refuse included.
    """
    cases = model.vectors.cases
    lost = model.stopped | model.jump
    reach = float_range(library.controller, model.law)
    finite = _finite_inputs(cases)
    decided = lost | ~finite | ~reach.unsure
    results = host.take(model.vectors.records)
    batch = Batch(
        cases,
        results["state"],
        results["torque_Nm"],
        results["status"].astype(np.int64),
        model.whole,
        model.law,
        model.stopped,
        model.jump,
        finite & ~lost & ~reach.left,
    )
    violations = [*_violations(batch, decided, library), *_refusals(vectors, host)]
    compared = batch.good & decided
    # Saturation brings two torques closer, never further apart: the bound is that before it.
    demanded = "filtered_torque" if library.controller.options.low_pass else "control_torque"
    integral = last_memory(results["state"])["sliding_integral_rad_per_s"]
    apart, room = _apart(batch, "next_sliding_integral", "next_sliding_integral", integral)
    ends = {
        "limited_torque": _apart(batch, "limited_torque", demanded, results["torque_Nm"]),
        # That of a saturated joint doesn't follow the law, and is looked at among the violations.
        "next_sliding_integral": (np.where(frozen_joints(batch), 0.0, apart), room),
    }
    return NumericLink(
        DOUBLE_TO_HOST,
        library.controller.name,
        len(vectors) - int((~decided).sum()),
        {"may overflow binary32": int((~decided).sum())},
        _deviations(
            model.vectors.group[compared],
            {name: (apart[compared], room[compared]) for name, (apart, room) in ends.items()},
        ),
        tuple(violations),
        WHY[DOUBLE_TO_HOST],
    )


def _apart(batch: Batch, name: str, bound_of: str, values: NDArray[np.float32]) -> _Ends:
    """Distances of the C from the law in double, and of an enclosure's edge from the law."""
    exact, enclosed = batch.outputs.exact, batch.outputs.enclosed[bound_of]
    with np.errstate(invalid="ignore"):
        difference = values.astype(np.float64) - exact[name]
        edge = np.where(difference > 0.0, enclosed.high, enclosed.low)
        return np.abs(difference), np.abs(edge - exact[bound_of])


def _violations(batch: Batch, decided: Flags, library: Compiled) -> Iterator[str]:
    with np.errstate(invalid="ignore"):
        for name, failed in checks(batch, library.controller.options.low_pass):
            rows = np.flatnonzero(failed & decided)
            if rows.size:
                row = rows[0]
                yield (
                    f"{name}: fails at {rows.size} vectors, the first with status "
                    f"{batch.status[row]} and torque {batch.torque[row].tolist()} N m"
                )


def _refusals(vectors: Vectors, host: Host) -> Iterator[str]:
    """Steps that the C must refuse: without an argument, or with memory that nobody filled."""
    records = vectors.records[is_refused(vectors.records)]
    results = host.take(records)
    missing = records["missing"]
    expected = np.where(missing != 0, BAD_ARGUMENT, NOT_INITIALISED)
    torque = np.where((missing & 8) != 0, np.float32(UNWRITTEN), np.float32(0.0))[:, None]
    if np.any(results["status"] != expected):
        yield "a step that must be refused is not, or for another reason"
    if np.any(results["torque_Nm"] != torque):
        yield "the torque of a refused step is not zero"
    if results["state"].tobytes() != np.ascontiguousarray(records["state"]).tobytes():
        yield "a refused step leaves a trace in the state"


# --- Link 3: the C on the host and on a target -------------------------------------------------


def host_to_target(
    library: Compiled,
    target: Target,
    host: Host,
    vectors: Vectors,
    blocks: Blocks,
    advance: Callable[[int], None] = lambda _: None,
) -> BitLink:
    """The C on the host against the C on a target, bit by bit.

    Args:
        library: the controller.
        target: its program on an emulated board.
        host: the same on this computer.
        vectors: recorded vectors.
        blocks: random steps.
        advance: told how many more random steps the target took.

    Raises:
        verification.firmware.ToolError: the emulator is missing, or the program failed.
    """
    mine, theirs = host.take(vectors.records), target.take(vectors.records)
    my_blocks = host.summaries(blocks)
    start = time.perf_counter()
    their_blocks = target.summaries(blocks, advance)
    seconds = time.perf_counter() - start
    equal = np.array(
        [a.tobytes() == b.tobytes() for a, b in zip(my_blocks, their_blocks, strict=True)]
    )
    mismatch = first_difference(mine, theirs, group=vectors.group)
    if mismatch is None and not equal.all():
        block = int(np.flatnonzero(~equal)[0])
        mismatch = _in_block(host, target, block, blocks.steps)
    return BitLink(
        target.board.name,
        target.board.core,
        library.controller.name,
        len(vectors),
        _sha256(mine),
        _sha256(theirs),
        blocks.count * blocks.steps,
        blocks.count,
        int(equal.sum()),
        _sha256(my_blocks),
        _sha256(their_blocks),
        dict(zip(STATUSES, their_blocks["statuses"].sum(axis=0).tolist(), strict=True)),
        int(their_blocks["refused"].sum()),
        seconds,
        mismatch,
    )


def _sha256(records: Records) -> str:
    return hashlib.sha256(np.ascontiguousarray(records).tobytes()).hexdigest()


def _in_block(host: Host, target: Target, block: int, steps: int) -> Mismatch | None:
    """The first difference of a block, by taking it once more on both sides."""
    my_cases, mine = host.record(block, steps)
    their_cases, theirs = target.record(block, steps)
    found = [first_difference(my_cases, their_cases, block), first_difference(mine, theirs, block)]
    differences = [each for each in found if each is not None]
    # A step is drawn before it is taken, and the next one starts from its result.
    return min(differences, key=lambda m: m.step, default=None)


def first_difference(
    host: Records,
    target: Records,
    block: int | None = None,
    group: NDArray[np.str_] | None = None,
) -> Mismatch | None:
    """The first record that differs, and in it the first word.

    Args:
        host: records of 32-bit words.
        target: the same from the other side.
        block: which block they are, if any.
        group: what each is there for, if they are recorded vectors.
    """
    words = host.dtype.itemsize // 4
    mine, theirs = (np.ascontiguousarray(r).view("<u4").reshape(-1, words) for r in (host, target))
    rows = np.flatnonzero((mine != theirs).any(axis=1))
    if rows.size == 0:
        return None
    row = int(rows[0])
    word = int(np.flatnonzero(mine[row] != theirs[row])[0])
    name, joint, kind = _word(host.dtype, 4 * word)
    here, there = mine[row, word], theirs[row, word]
    return Mismatch(
        block,
        row,
        "" if group is None else str(group[row]),
        name,
        joint,
        str(here.view(kind)),
        str(there.view(kind)),
        f"0x{int(here):08X}",
        f"0x{int(there):08X}",
    )


def _word(kind: np.dtype[np.void], offset: int) -> tuple[str, int | None, np.dtype[np.generic]]:
    """Name, joint and type of the word at an offset of a structure."""
    for name in reversed(kind.names or ()):
        assert kind.fields is not None
        field, start = kind.fields[name][:2]
        if offset < start:
            continue
        element, inner = field.base, offset - start
        joint = inner // element.itemsize if field.shape else None
        if element.names is None:
            return name, joint, element
        deeper, deeper_joint, word = _word(element, inner % element.itemsize)
        return deeper, deeper_joint if joint is None else joint, word
    raise ValueError(f"no word at offset {offset} of {kind}")


# --- The chain ---------------------------------------------------------------------------------


def chain(
    controllers: Sequence[Controller],
    boards: Sequence[Board],
    blocks: Blocks,
    advance: Callable[[int], None] = lambda _: None,
) -> Chain:
    """All links of all controllers.

    Args:
        controllers: the shipped ones.
        boards: the targets; their programs are built here.
        blocks: random steps of each controller on each target.
        advance: told how many more random steps a target took.

    Raises:
        SpecificationError: a controller computes in double, for which there are no links.
        verification.firmware.ToolError: a compiler or an emulator is missing or failed.
        plant.native.CompilerError: the host's compiler is missing or failed.
    """
    for controller in controllers:
        _refuse_double(controller)
    numeric: list[NumericLink] = []
    bits: list[BitLink] = []
    sha256 = {}
    for controller in controllers:
        library = compiled(controller)
        host = Host(library)
        rounds = controller.arithmetic.kind == "floating-point"
        vectors = drawn_by_the_target(host)
        if rounds:
            vectors = recorded(library).plus(vectors)
        sha256[controller.name] = _sha256(vectors.records)

        def on(
            board: Board,
            library: Compiled = library,
            host: Host = host,
            vectors: Vectors = vectors,
        ) -> BitLink:
            target = Target(board, image(board, library), library)
            return host_to_target(library, target, host, vectors, blocks, advance)

        # The emulators are processes of their own: threads that wait for them suffice.
        with ThreadPoolExecutor() as pool:
            waiting = [pool.submit(on, board) for board in boards]
            if rounds:
                model = modelled(library, vectors)
                numeric.append(exact_to_double(library, model))
                numeric.append(double_to_host(library, model, host, vectors))
            bits += [future.result() for future in waiting]
    return Chain(tuple(numeric), tuple(bits), sha256)


def _refuse_double(controller: Controller) -> None:
    if controller.arithmetic.kind == "floating-point" and controller.arithmetic.real is FLOAT64:
        raise SpecificationError(
            controller.name,
            [
                Problem(
                    "precision",
                    controller.arithmetic.precision,
                    "the chain knows the rounding of float32, and the bits of fixed-point",
                    "compare its bits in flight: python -m verification.pil",
                )
            ],
        )


def drawn_by_the_target(host: Host, steps: int = DRAWN) -> Vectors:
    """Random steps as the program draws them on host and target, so that all links see some."""
    records, _ = host.record(0, steps)
    return Vectors(records, np.full(steps, "random steps"))


def blocks_of(steps: int) -> Blocks:
    """So many steps or a few more, in blocks of ``BLOCK_STEPS``, or in one smaller block."""
    size = min(steps, BLOCK_STEPS)
    return Blocks(-(-steps // size), size)
