"""One step of the generated C against the law in double precision, with a justified bound.

Every random step sets gains, state and input of the C directly, calls ``tdc_NAME_step`` once, and
compares with two models that share nothing with the C printer:

- the ``casadi.Function`` of ``codegen.law``, evaluated in double with the binary32 gains and the
  exact exponents that the C holds;
- an interval enclosure of the same instruction list (``verification.interval``), in which every
  operation is widened by the rounding of binary32. The C must lie inside, at every step.

What the C does in integers (differences of wrapping counts, the memory it leaves, status and
saturation bits) is modelled in Python integers and must agree exactly.
"""

from __future__ import annotations

import ctypes
import itertools
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from codegen.controller import Controller
from codegen.exact import DISPLACEMENT_MAX, binary32
from codegen.law import (
    GAINS,
    AccelerationEstimate,
    LawFunction,
    LawOptions,
    VelocityError,
    measurement,
    switch_on,
    torque_law,
)
from codegen.layout import layout
from codegen.sig_pow import tables
from codegen.status import Status
from plant.controller import GeneratedController, Structures, structures
from plant.native import shared_library, sources_of
from verification.cases import (
    PHASE_LOST,
    PHASE_RUNNING,
    REGIMES,
    RESUMES_FROM,
    STARTS_FROM,
    Cases,
    Records,
    Regime,
    draw,
    has,
    is_running,
    is_starting,
    last_memory,
    latest_counts,
    shipped_scales,
    wrap,
)
from verification.evidence import Evidence
from verification.interval import Interval, enclose, point, rounded

Doubles = NDArray[np.float64]
Flags = NDArray[np.bool_]

OK, SATURATED, STOPPED = Status.OK, Status.SATURATED, Status.STOPPED
ENCODER_JUMP, NOT_FINITE = Status.ENCODER_JUMP, Status.NOT_FINITE
HOLD_TORQUE = 0
SEED = 20170
BATCH = 10_000
LOW_PASS_CUTOFF_L = Fraction(3, 10)
"""w' = w L of the variants with a low-pass, 300 rad/s at 1 ms."""


# --- Variants ----------------------------------------------------------------------------------


def variants(controller: Controller) -> tuple[Controller, ...]:
    """The controller in every structure that the law has; its own one keeps its name."""
    structures_of_law = itertools.product(
        get_args(VelocityError), get_args(AccelerationEstimate), (False, True), (False, True)
    )
    return tuple(variant(controller, LawOptions(*options)) for options in structures_of_law)


def variant(controller: Controller, options: LawOptions) -> Controller:
    """The controller with another structure of the law, under a name of its own."""
    if options == controller.options:
        return controller
    code = (
        {"reference-rate": "rr", "error-difference": "ed", "half-sample": "hs"}[
            options.velocity_error
        ],
        {"current": "c", "delayed": "d"}[options.acceleration],
        "f" if options.low_pass else "",
        "t" if options.torque_report else "",
    )
    ratio = LOW_PASS_CUTOFF_L / (1 + LOW_PASS_CUTOFF_L) if options.low_pass else None
    name = f"{controller.name}_{''.join(code)}"
    return replace(controller, name=name, options=options, low_pass_ratio=ratio)


def describe(options: LawOptions) -> str:
    """The structure of a law in words."""
    parts = [options.velocity_error, f"{options.acceleration} acceleration"]
    parts += ["low-pass"] if options.low_pass else []
    parts += ["torque report"] if options.torque_report else []
    return ", ".join(parts)


# --- Results -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Deviation:
    """How far one output of the C is from the law in double, over many steps.

    Attributes:
        median: of the distances, in the output's unit.
        worst: the largest distance.
        worst_share: largest distance as a share of the way to the edge of the enclosure; at
            most 1 when every step lies inside.
    """

    median: float
    worst: float
    worst_share: float


@dataclass(frozen=True)
class Violation:
    """A check that failed: how often, and the first step that shows it."""

    check: str
    steps: int
    example: str


@dataclass(frozen=True)
class Tally:
    """What kinds of steps there were.

    Attributes:
        steps: all of them.
        saturated: steps with at least one joint cut to its limit.
        jumps: steps with an encoder jump.
        not_finite: steps whose torque or sliding integral isn't finite.
        stopped: steps after too many lost ones.
        undecided: steps whose enclosure reaches across a torque limit, so that either status
            is right.
    """

    steps: int = 0
    saturated: int = 0
    jumps: int = 0
    not_finite: int = 0
    stopped: int = 0
    undecided: int = 0

    def plus(self, other: Tally) -> Tally:
        """The sum of two."""
        return Tally(
            *(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True))
        )


@dataclass(frozen=True)
class Equivalence:
    """The outcome for one controller.

    Attributes:
        controller: its name.
        structure: its law's structure in words.
        tally: what kinds of steps there were.
        torque_Nm: deviation of the torque [N m] by regime.
        sliding_integral_rad_per_s: deviation of the next s - ed [rad/s] by regime.
        violations: every check that failed.
        evidence: always sampled.
    """

    controller: str
    structure: str
    tally: Tally
    torque_Nm: dict[str, Deviation]
    sliding_integral_rad_per_s: dict[str, Deviation]
    violations: tuple[Violation, ...]
    evidence: Evidence = Evidence.SAMPLED

    @property
    def holds(self) -> bool:
        """Whether no check failed."""
        return not self.violations


# --- The C -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Compiled:
    """A controller's compiled C, ready to be called with addresses."""

    controller: Controller
    types: Structures
    default_config: ctypes.Structure
    step: Callable[[int, int, int, int], int]


def compiled(controller: Controller, library: Path | None = None) -> Compiled:
    """Generates and compiles the C of a controller, unless a library is given."""
    path = library or shared_library(sources_of(controller))
    checked = GeneratedController(controller, path)  # refuses another specification's library
    step = ctypes.CDLL(str(path))[f"tdc_{controller.name}_step"]
    step.argtypes = [ctypes.c_void_p] * 4
    step.restype = ctypes.c_int
    return Compiled(controller, structures(controller), checked.config, step)


def run(library: Compiled, cases: Cases) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Calls the C once for each case; states change in place.

    Returns:
        Torques [N m], shape (steps, joints), and statuses, shape (steps,).
    """
    torque = np.full((len(cases), len(library.controller.joints)), np.nan, dtype=np.float32)

    def addresses(array: NDArray[Any]) -> Iterable[int]:
        return range(array.ctypes.data, array.ctypes.data + array.nbytes, array.strides[0])

    statuses = map(
        library.step,
        addresses(cases.config),
        addresses(cases.state),
        addresses(cases.input),
        addresses(torque),
    )
    return torque, np.fromiter(statuses, dtype=np.int64, count=len(cases))


# --- The models --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Integers:
    """What the C computes in integers, each of shape (steps, joints).

    ``since_good`` is the way from the last good tick, and ``change`` zero where ticks were lost.
    """

    since_good: NDArray[np.int64]
    displacement: NDArray[np.int64]
    change: NDArray[np.int64]
    error_q8: NDArray[np.int64]
    error_change_q8: NDArray[np.int64]
    displacement_change: NDArray[np.int64]


def integers(cases: Cases, running: Flags) -> Integers:
    """Differences of wrapping positions; after lost ticks, and at first, of an even motion."""
    joint = last_memory(cases.state)

    def column(name: str) -> NDArray[np.int64]:
        if not has(joint, name):
            return np.zeros(counts.shape, np.int64)
        values: NDArray[np.int64] = joint[name].astype(np.int64)
        return values

    counts = cases.input["counts"].astype(np.int64)
    reference = cases.input["reference_position_q8"].astype(np.int64)
    on = running[:, None]
    since_good = wrap(counts - column("counts"))
    displacement = np.where(on, since_good, wrap(counts - latest_counts(cases.state)))
    change = np.where(on, wrap(displacement - column("displacement")), 0)
    error = wrap(reference - 256 * counts)
    error_change = np.where(on, wrap(error - column("error_q8")), 0)
    delayed = has(joint, "displacement_change")
    used = np.where(on, column("displacement_change"), 0) if delayed else change
    return Integers(since_good, displacement, change, error, error_change, used)


def stops(cases: Cases) -> Flags:
    """Steps before which too many ticks in a row were lost, shape (steps,)."""
    stopped: Flags = ~is_running(cases.state) & (
        cases.state["lost_ticks"] >= cases.config["max_lost_ticks"]
    )
    return stopped


def jumps(cases: Cases, whole: Integers) -> Flags:
    """Steps whose counts aren't plausible, and which aren't stopped, shape (steps,)."""
    joint = cases.config["joint"]
    limit = joint["max_displacement"].astype(np.int64)
    running = is_running(cases.state)[:, None]
    ticks = cases.state["lost_ticks"].astype(np.int64)[:, None] + 1
    reach = np.where(limit < 2**20, limit * ticks, DISPLACEMENT_MAX)
    jump = np.abs(whole.displacement) > limit
    jump |= running & (np.abs(whole.change) > joint["max_displacement_change"])
    jump |= ~running & (np.abs(whole.since_good) > reach)
    found: Flags = jump.any(axis=1) & ~stops(cases)
    return found


@dataclass(frozen=True)
class Outputs:
    """The law's outputs in double and their enclosures, by name, shape (steps, joints)."""

    exact: dict[str, Doubles]
    enclosed: dict[str, Interval]


Sources = dict[str, Doubles]


def _sources(cases: Cases, controller: Controller, whole: Integers, running: Flags) -> Sources:
    """The value of every input of the law that is no quantity of it, in double."""
    joint, given = last_memory(cases.state), cases.input
    shape = whole.displacement.shape
    struct = layout(controller).joint_config
    names = {f.quantity: f.name for f in struct.fields if f.quantity}
    values: Sources = {}
    for gain in GAINS:
        if gain in names:
            raw = cases.config["joint"][names[gain]].astype(np.float64)
            exponent = gain in ("alpha", "beta", "gamma")
            values[gain] = 1.0 + raw / 2.0**31 if exponent else raw
    for name, scale in shipped_scales(controller).items():
        values[name] = np.broadcast_to(scale, shape)
    values["sample_time"] = np.full(shape, binary32(controller.sample_time))
    reference_velocity = given["reference_velocity_rad_per_s"].astype(np.float64)
    last = reference_velocity
    if has(joint, "reference_velocity_rad_per_s"):
        remembered = joint["reference_velocity_rad_per_s"].astype(np.float64)
        last = np.where(running[:, None], remembered, reference_velocity)
    reports = has(given, "applied_torque_Nm")
    torque = given["applied_torque_Nm"] if reports else joint["applied_torque_Nm"]
    return values | {
        "error_q8": whole.error_q8.astype(np.float64),
        "error_change_q8": whole.error_change_q8.astype(np.float64),
        "displacement": whole.displacement.astype(np.float64),
        "displacement_change": whole.displacement_change.astype(np.float64),
        "reference_velocity": reference_velocity,
        "last_reference_velocity": last,
        "reference_acceleration": given["reference_acceleration_rad_per_s2"].astype(np.float64),
        "last_torque": torque.astype(np.float64),
    }


def _converted(integer: Interval) -> Interval:
    """What binary32 makes of known integers: only those beyond 2^24 may need rounding."""
    inexact, large = rounded(integer), np.abs(integer.low) > 2.0**24
    return Interval(
        np.where(large, inexact.low, integer.low), np.where(large, inexact.high, integer.high)
    )


_FROM_INTEGERS = ("error_q8", "error_change_q8", "displacement", "displacement_change")


def _in_double(function: LawFunction, values: Sources) -> Sources:
    """The quantities of the law's ``casadi.Function``, evaluated in double."""
    shape = np.broadcast_shapes(*(values[i.name].shape for i in function.inputs))
    rows = [np.broadcast_to(values[i.name], shape).reshape(1, -1) for i in function.inputs]
    mapped = function.casadi_function().map(rows[0].size)
    results = mapped.call([np.ascontiguousarray(row) for row in rows])
    return {
        q.name: np.array(r, dtype=np.float64).reshape(shape)
        for q, r in zip(function.quantities, results, strict=True)
    }


def outputs(cases: Cases, controller: Controller, whole: Integers, running: Flags) -> Outputs:
    """The law on these cases, in double and as enclosures of what binary32 can make of it."""
    remembered = last_memory(cases.state)["sliding_integral_rad_per_s"].astype(np.float64)
    on = ~is_starting(cases.state)[:, None]
    exact = _sources(cases, controller, whole, running)
    enclosed = {name: point(value) for name, value in exact.items()}
    # Integers beyond 2^24 are rounded when the C converts them to float.
    enclosed |= {name: _converted(enclosed[name]) for name in _FROM_INTEGERS}

    kernel = tables().bounds.relative
    measure, start, law = (
        measurement(controller.options),
        switch_on(),
        torque_law(controller.options),
    )
    exact |= _in_double(measure, exact)
    enclosed |= enclose(measure, enclosed, kernel)
    first = _in_double(start, exact)["sliding_integral"]
    first_enclosed = enclose(start, enclosed, kernel)["sliding_integral"]
    exact["sliding_integral"] = np.where(on, remembered, first)
    enclosed["sliding_integral"] = Interval(
        np.where(on, remembered, first_enclosed.low), np.where(on, remembered, first_enclosed.high)
    )
    exact |= _in_double(law, exact)
    enclosed |= enclose(law, enclosed, kernel)
    return Outputs(exact, enclosed)


# --- The comparison ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Batch:
    """Everything known of a batch of steps, before and after the C ran.

    ``stopped``, ``jump`` and ``good`` say which steps must end so or in an encoder jump, and which
    must succeed; all others must end as not finite.
    """

    cases: Cases
    after: Records
    torque: NDArray[np.float32]
    status: NDArray[np.int64]
    whole: Integers
    outputs: Outputs
    stopped: Flags
    jump: Flags
    good: Flags


def _is_finite(out: Outputs, low_pass: bool) -> Flags:
    torque = out.exact["filtered_torque" if low_pass else "control_torque"]
    integral = out.exact["next_sliding_integral"]
    finite: Flags = np.all(np.isfinite(torque) & np.isfinite(integral), axis=1)
    return finite


def _same_bits(a: NDArray[Any], b: NDArray[Any]) -> Flags:
    """Whether records are equal byte for byte, shape (steps,)."""
    left, right = (np.ascontiguousarray(x).view(np.uint8).reshape(len(x), -1) for x in (a, b))
    same: Flags = (left == right).all(axis=1)
    return same


def _limit(batch: Batch) -> Doubles:
    limit: Doubles = batch.cases.config["joint"]["torque_limit_Nm"].astype(np.float64)
    return limit


def _cut_by_law(batch: Batch, low_pass: bool) -> tuple[Flags, Flags]:
    """Joints whose demanded torque is beyond a limit for certain, and those where it may be.

    A torque exactly at the limit is not beyond it.
    """
    demanded = batch.outputs.enclosed["filtered_torque" if low_pass else "control_torque"]
    limit = _limit(batch)
    must: Flags = (demanded.low > limit) | (demanded.high < -limit)
    may: Flags = (demanded.high > limit) | (demanded.low < -limit)
    return must, may


def cut_joints(batch: Batch) -> Flags:
    """Joints that the C says to be at their limits, shape (steps, joints)."""
    bits = batch.after["saturated_joints"].astype(np.int64)
    cut: Flags = (bits[:, None] >> np.arange(batch.torque.shape[1]) & 1).astype(np.bool_)
    return cut


def frozen_joints(batch: Batch) -> Flags:
    """Those of them whose sliding variable doesn't integrate, shape (steps, joints)."""
    anti_windup: Flags = (batch.cases.config["anti_windup"] == 1)[:, None]
    return cut_joints(batch) & anti_windup


def _counts_as_lost(batch: Batch) -> Flags:
    """Whether the state says that this tick was lost, and has its reading, shape (steps,)."""
    before, after = batch.cases.state, batch.after
    running = is_running(before)
    right: Flags = after["phase"] == before["phase"] + running * (PHASE_LOST - PHASE_RUNNING)
    right &= after["lost_ticks"] == np.where(running, 0, before["lost_ticks"]) + 1
    right &= after["saturated_joints"] == before["saturated_joints"]
    right &= (latest_counts(after) == batch.cases.input["counts"]).all(axis=1)
    return right


def _keeps_memory(batch: Batch) -> Flags:
    """Whether a lost tick leaves, bit for bit, what the next one takes from the memory."""
    before, after = batch.cases.state, batch.after
    then, now = last_memory(before), last_memory(after)
    starting = is_starting(before)
    # A tick that resumes takes the latest reading for that of the last tick, good or not.
    resumes = ~is_running(before) & ~batch.jump
    then["counts"] = np.where(resumes[:, None], latest_counts(before), then["counts"])
    same: Flags = np.ones(len(before), np.bool_)
    for name in then.dtype.names or ():
        read = (name in STARTS_FROM) | ((name in RESUMES_FROM) & ~starting)
        same &= ~read | _same_bits(then[name], now[name])
    return same


def checks(batch: Batch, low_pass: bool) -> Iterator[tuple[str, Flags]]:
    """Every check with the steps that fail it, shape (steps,)."""
    good, lost = batch.good, ~batch.good & ~batch.stopped
    before, after = batch.cases.state, batch.after
    then, now = last_memory(before), last_memory(after)
    torque = batch.torque.astype(np.float64)
    limit = _limit(batch)

    def on_good(right: Flags) -> Flags:
        return good & ~(right.all(axis=1) if right.ndim == 2 else right)

    yield (
        "torque lies in the enclosure",
        on_good(batch.outputs.enclosed["limited_torque"].contains(torque)),
    )
    integral = now["sliding_integral_rad_per_s"].astype(np.float64)
    yield (
        "next sliding integral lies in the enclosure",
        on_good(
            frozen_joints(batch)
            | batch.outputs.enclosed["next_sliding_integral"].contains(integral)
        ),
    )
    yield (
        "sliding integral of a saturated joint stays",
        on_good(
            ~frozen_joints(batch) | batch.outputs.enclosed["sliding_integral"].contains(integral)
        ),
    )
    yield (
        "applied torque is remembered bit for bit",
        good & ~_same_bits(now["applied_torque_Nm"], batch.torque),
    )
    yield "torque is within the limits", on_good(np.abs(torque) <= limit)
    yield "counts are remembered", on_good(now["counts"] == batch.cases.input["counts"])
    yield (
        "displacement is exact modulo 2^32",
        on_good(now["displacement"] == batch.whole.displacement),
    )
    if has(now, "displacement_change"):
        yield (
            "second difference is exact modulo 2^32",
            on_good(now["displacement_change"] == batch.whole.change),
        )
    if has(now, "error_q8"):
        yield (
            "position error is exact modulo 2^32",
            on_good(now["error_q8"] == batch.whole.error_q8),
        )
    if has(now, "reference_velocity_rad_per_s"):
        yield (
            "reference velocity is remembered",
            good
            & ~_same_bits(
                now["reference_velocity_rad_per_s"],
                batch.cases.input["reference_velocity_rad_per_s"],
            ),
        )
    yield (
        "phase is running, and the memory's index the other one",
        on_good(after["phase"] == PHASE_RUNNING + 1 - (before["phase"] & 1)),
    )

    cut = cut_joints(batch)
    yield (
        "no other saturation bit is set",
        on_good(after["saturated_joints"].astype(np.int64) < 2 ** limit.shape[1]),
    )
    yield "torque of a saturated joint is its limit", on_good(~cut | (np.abs(torque) == limit))
    must, may = _cut_by_law(batch, low_pass)
    yield "saturation is that of the law", on_good((cut | ~must) & (~cut | may))
    expected = np.where(cut.any(axis=1), SATURATED, OK)
    expected = np.where(good, expected, np.where(batch.jump, ENCODER_JUMP, NOT_FINITE))
    yield "status", batch.status != np.where(batch.stopped, STOPPED, expected)
    yield "a lost tick is counted, and its reading kept", lost & ~_counts_as_lost(batch)
    yield "a lost tick leaves the memory", lost & ~_keeps_memory(batch)
    yield "a stopped controller keeps its state", batch.stopped & ~_same_bits(before, after)
    hold = (batch.cases.config["on_error"] == HOLD_TORQUE)[:, None]
    fallback = np.where(hold, then["applied_torque_Nm"], np.float32(0.0))
    yield "torque of a lost tick is the configured one", lost & ~_same_bits(fallback, batch.torque)
    yield "a stopped controller has no torque", batch.stopped & (batch.torque != 0.0).any(axis=1)


def _distances(batch: Batch, name: str, values: Doubles, among: Flags) -> tuple[Doubles, Doubles]:
    """Distances of the C from the double law, in units and as shares.

    Args:
        batch: of steps.
        name: of the law's output.
        values: what the C made of it, shape (steps, joints).
        among: of which joints of which steps, shape (steps, joints).
    """
    exact = np.broadcast_to(batch.outputs.exact[name], values.shape)[among]
    enclosed = batch.outputs.enclosed[name]
    low, high = (np.broadcast_to(end, values.shape)[among] for end in (enclosed.low, enclosed.high))
    difference = values[among] - exact
    room = np.where(difference > 0.0, high - exact, exact - low)
    distance = np.abs(difference)
    # A room of zero, as at a torque limit, lets a wrong C's share be infinite.
    share = np.divide(distance, room, out=np.zeros_like(distance), where=distance > 0.0)
    return distance.ravel(), share.ravel()


def _deviation(batches: Sequence[tuple[Doubles, Doubles]]) -> Deviation:
    distance, share = (np.concatenate(each) for each in zip(*batches, strict=True))
    if distance.size == 0:
        return Deviation(0.0, 0.0, 0.0)  # no step that must succeed was drawn
    return Deviation(float(np.median(distance)), float(distance.max()), float(share.max()))


def _evaluate(library: Compiled, cases: Cases) -> Batch:
    """Runs the C and the models on the cases."""
    before = Cases(cases.config, cases.state.copy(), cases.input)
    torque, status = run(library, cases)
    running = is_running(before.state)
    whole = integers(before, running)
    with np.errstate(all="ignore"):  # some cases hold NaN and infinities on purpose
        out = outputs(before, library.controller, whole, running)
        low_pass = library.controller.options.low_pass
        stopped, jump = stops(before), jumps(before, whole)
        good = _is_finite(out, low_pass) & ~jump & ~stopped
    return Batch(before, cases.state, torque, status, whole, out, stopped, jump, good)


def _example(batch: Batch, check: str, row: int) -> str:
    """One failing step in words."""
    names = ("limited_torque", "next_sliding_integral")
    enclosures = {
        name: [
            f"[{low:.9g}, {high:.9g}]"
            for low, high in zip(
                batch.outputs.enclosed[name].low[row],
                batch.outputs.enclosed[name].high[row],
                strict=True,
            )
        ]
        for name in names
    }
    integral = last_memory(batch.after)["sliding_integral_rad_per_s"][row].tolist()
    return (
        f"{check}: status {batch.status[row]}, torque {batch.torque[row].tolist()} in "
        f"{enclosures['limited_torque']}, next integral {integral} in "
        f"{enclosures['next_sliding_integral']}"
    )


def check(
    controller: Controller,
    steps: int,
    library: Path | None = None,
    advance: Callable[[int], None] = lambda _: None,
) -> Equivalence:
    """Compares random steps of a controller's C with the law.

    Args:
        controller: the specification.
        steps: how many steps, at least 2; half of each regime.
        library: the compiled C; generated and compiled if not given.
        advance: told how many steps were done after each batch.
    """
    c = compiled(controller, library)
    rng = np.random.default_rng([SEED, zlib.crc32(controller.name.encode())])
    low_pass = controller.options.low_pass
    torque: dict[str, list[tuple[Doubles, Doubles]]] = {regime: [] for regime in REGIMES}
    integral: dict[str, list[tuple[Doubles, Doubles]]] = {regime: [] for regime in REGIMES}
    violations: dict[str, Violation] = {}
    tally = Tally()
    for regime, size in _batches(steps):
        batch = _evaluate(c, draw(controller, c.types, c.default_config, size, regime, rng))
        with np.errstate(invalid="ignore", divide="ignore"):
            after = last_memory(batch.after)["sliding_integral_rad_per_s"].astype(np.float64)
            commanded = batch.torque.astype(np.float64)
            good = np.broadcast_to(batch.good[:, None], commanded.shape)
            torque[regime].append(_distances(batch, "limited_torque", commanded, good))
            integral[regime].append(
                _distances(batch, "next_sliding_integral", after, good & ~frozen_joints(batch))
            )
            for name, failed in checks(batch, low_pass):
                rows = np.flatnonzero(failed)
                if rows.size:
                    known = violations.get(name, Violation(name, 0, _example(batch, name, rows[0])))
                    violations[name] = replace(known, steps=known.steps + int(rows.size))
            tally = tally.plus(_tally(batch, low_pass))
        advance(size)
    return Equivalence(
        controller.name,
        describe(controller.options),
        tally,
        {regime: _deviation(each) for regime, each in torque.items()},
        {regime: _deviation(each) for regime, each in integral.items()},
        tuple(violations.values()),
    )


def _batches(steps: int) -> Iterator[tuple[Regime, int]]:
    """Regimes in turn, with the steps of each batch."""
    done = 0
    for regime in itertools.cycle(REGIMES):
        if done >= steps:
            return
        size = min(BATCH, max(1, steps // 2), steps - done)
        yield regime, size
        done += size


def _tally(batch: Batch, low_pass: bool) -> Tally:
    must, may = _cut_by_law(batch, low_pass)
    undecided = (may & ~must).any(axis=1) & batch.good
    return Tally(
        len(batch.status),
        int((batch.status == SATURATED).sum()),
        int((batch.status == ENCODER_JUMP).sum()),
        int((batch.status == NOT_FINITE).sum()),
        int((batch.status == STOPPED).sum()),
        int(undecided.sum()),
    )


def check_all(
    controllers: Sequence[Controller],
    steps: int,
    advance: Callable[[int], None] = lambda _: None,
    processes: int | None = None,
) -> dict[str, tuple[Equivalence, ...]]:
    """Every variant of the controllers, in parallel processes.

    Args:
        controllers: the shipped ones.
        steps: for each variant.
        advance: told how many steps were done after each variant.
        processes: how many at a time; one for each core by default.

    Returns:
        By the shipped controller's name, in the order of :func:`variants`.
    """
    with ProcessPoolExecutor(processes) as pool:
        futures = {c.name: [pool.submit(check, v, steps) for v in variants(c)] for c in controllers}
        for future in as_completed(f for each in futures.values() for f in each):
            future.result()  # an error shows at once, and not after all the others
            advance(steps)
        return {name: tuple(f.result() for f in each) for name, each in futures.items()}


@dataclass(frozen=True)
class Summary:
    """All variants of one controller together.

    Attributes:
        controller: the shipped controller's name.
        variants: how many structures of the law.
        tally: what kinds of steps there were.
        torque_Nm: deviation of the torque: the largest median and the worst of the rig regime,
            the worst share of both regimes.
        sliding_integral_rad_per_s: likewise for the next s - ed.
        violations: failed checks, over all variants and steps.
        count_torque_Nm: what one encoder count moves the shipped law's torque by, Mbar c / L^2,
            of the joint where that is least: the measure for a deviation.
        evidence: always sampled.
    """

    controller: str
    variants: int
    tally: Tally
    torque_Nm: Deviation
    sliding_integral_rad_per_s: Deviation
    violations: int
    count_torque_Nm: float
    evidence: Evidence = Evidence.SAMPLED


def summary(controller: Controller, results: Sequence[Equivalence]) -> Summary:
    """What the variants of a controller have in common."""

    def worst(deviations: Iterable[dict[str, Deviation]]) -> Deviation:
        each = list(deviations)
        return Deviation(
            max(d["rig"].median for d in each),
            max(d["rig"].worst for d in each),
            max(d[regime].worst_share for d in each for regime in REGIMES),
        )

    tally = Tally()
    for result in results:
        tally = tally.plus(result.tally)
    sample_time = float(controller.sample_time)
    return Summary(
        controller.name,
        len(results),
        tally,
        worst(r.torque_Nm for r in results),
        worst(r.sliding_integral_rad_per_s for r in results),
        sum(v.steps for r in results for v in r.violations),
        min(float(j.inertia) * abs(j.rad_per_count) / sample_time**2 for j in controller.joints),
    )
