"""The recorded vectors that every link of the chain is given: drawn ones and directed ones.

They follow from the specification and fixed seeds alone. The drawn ones are those of
``verification.cases``; the directed ones stand where binary32 and the C's own branches have their
edges. A NaN that a step reads appears in inputs only, with one payload: neither init nor step lets
one into the last tick's memory, so that no output holds one, and payloads, which processors choose
differently, are compared nowhere. What a step must not read of the memory holds random bits.
"""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from codegen.sig_pow import exponent_q31
from verification.cases import (
    PHASE_LOST,
    PHASE_RUNNING,
    PHASE_START,
    REGIMES,
    Cases,
    Records,
    disperse,
    draw,
    first_index,
    is_filled,
    wrap,
)
from verification.equivalence import Compiled

DRAWN = 600
"""Vectors of each regime of ``verification.cases``."""

FLOAT_MAX = float(np.finfo(np.float32).max)
_TINY, _SMALLEST_NORMAL = 2.0**-149, 2.0**-126

EXPONENTS = ("1/5", "2/5", "1/2", "19/21", "19/20", "1", "6/5", "3/2", "199/100", "2")
_LINE_FROM = 2.0**126
"""From here on sig_pow follows a line for the tiniest exponents."""
_TINY_EXPONENTS = ("1/1000000000", "1/100", "1/64", "1/60")
_LAST_TICK_COUNTS = (2**31 - 1, 2**31 - 5, -(2**31), 3 - 2**31, 0)
_ERRORS_Q8 = (0, 1, -1, 255, -(2**15), 2**24 + 1, 2**31 - 1, -(2**31))
_NOT_FINITE = (np.nan, np.inf, -np.inf)


@dataclass(frozen=True)
class Vectors:
    """Steps with all that the controller is given.

    Attributes:
        records: the C's ``step_case`` structures (``target/steps.h``), shape (steps,).
        group: what each vector is there for, shape (steps,).
    """

    records: Records
    group: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.records)

    @property
    def cases(self) -> Cases:
        """Views of the arguments."""
        return Cases(self.records["config"], self.records["state"], self.records["input"])

    def plus(self, others: Vectors) -> Vectors:
        """These and others of the same controller."""
        return Vectors(
            np.concatenate([self.records, others.records]),
            np.concatenate([self.group, others.group]),
        )

    def take(self, rows: NDArray[np.bool_]) -> Vectors:
        """Some of the vectors, copied."""
        return Vectors(self.records[rows], self.group[rows])


def case_type(library: Compiled) -> np.dtype[np.void]:
    """The C's ``step_case``."""
    types = library.types
    return np.dtype(
        [
            ("missing", "<u4"),
            ("config", np.dtype(types.config)),
            ("state", np.dtype(types.state)),
            ("input", np.dtype(types.input)),
        ]
    )


def recorded(library: Compiled, drawn: int = DRAWN) -> Vectors:
    """The vectors of a controller, always the same.

    Args:
        library: the controller.
        drawn: how many of each regime of ``verification.cases``.
    """
    groups = [*_drawn(library, drawn), *_directed(library)]
    return Vectors(
        np.concatenate([records for _, records in groups]),
        np.concatenate([np.full(len(records), name) for name, records in groups]),
    )


def _drawn(library: Compiled, steps: int) -> Iterator[tuple[str, Records]]:
    controller = library.controller
    rng = np.random.default_rng([zlib.crc32(controller.name.encode()), steps])
    for regime in REGIMES:
        cases = draw(controller, library.types, library.default_config, steps, regime, rng)
        records = np.zeros(steps, case_type(library))
        records["config"], records["state"], records["input"] = (
            cases.config,
            cases.state,
            cases.input,
        )
        yield regime, records


# --- Directed ----------------------------------------------------------------------------------

_Group = Callable[[Compiled], Iterable[Records]]


def _directed(library: Compiled) -> Iterator[tuple[str, Records]]:
    groups: dict[str, _Group] = {
        "saturation": _saturation,
        "wrap-around": _wrap_around,
        "exponents": _exponents,
        "largest": _largest,
        "subnormal": _subnormal,
        "gains": _gains,
        "first tick": _first_tick,
        "lost ticks": _lost_ticks,
        "not finite": _not_finite,
        "refused": _refused,
    }
    rng = np.random.default_rng(zlib.crc32(library.controller.name.encode()))
    for name, group in groups.items():
        records = np.concatenate(list(group(library)))
        disperse(records["state"], rng)
        yield name, records


def _standstill(library: Compiled) -> Records:
    """One step of a robot at rest at zero, with the shipped gains; the joints are alike.

    Its memory has index 0 until it is dispersed.
    """
    record = np.zeros(1, case_type(library))
    record["config"] = np.frombuffer(bytes(library.default_config), record.dtype["config"])[0]
    record["state"]["phase"] = PHASE_RUNNING
    return record


def _memory(record: Records) -> Records:
    return first_index(record["state"])


def _without_feedback(library: Compiled) -> Records:
    record = _standstill(library)
    for gain in ("kd", "kp", "lambda"):
        record["config"]["joint"][gain] = 0.0
    return record


def _both_signs(joints: int) -> NDArray[np.float64]:
    """Neighbouring joints on opposite sides."""
    return np.where(np.arange(joints) % 2, -1.0, 1.0)


def _saturation(library: Compiled) -> Iterator[Records]:
    """Below, at and beyond the limit on both sides, by the last torque and by the reference."""
    limit = np.frombuffer(bytes(library.default_config), np.dtype(library.types.config))["joint"][
        "torque_limit_Nm"
    ][0]
    below, above = (np.nextafter(limit, end) / limit for end in (np.float32(0), np.float32(np.inf)))
    side = _both_signs(limit.size)
    # A joint at its limit beside one beyond it.
    mixed = np.where(np.arange(limit.size) % 2, 2.0, 1.0)
    factors = (0.5, below, 1.0, above, 2.0, 1e6, mixed)
    for factor, sign in itertools.product(factors, (side, -side)):
        by_torque = _without_feedback(library)
        _memory(by_torque)["applied_torque_Nm"] = factor * sign * limit
        yield by_torque
        by_reference = _standstill(library)
        inertia = by_reference["config"]["joint"]["inertia_kgm2"]
        by_reference["input"]["reference_acceleration_rad_per_s2"] = factor * sign * limit / inertia
        yield by_reference


def _wrap_around(library: Compiled) -> Iterator[Records]:
    """Counts and reference across the seam of the 32-bit circle, and jumps of all sizes."""
    largest = library.controller.joints[0].max_displacement
    moves = (0, 1, -1, 7, largest, -largest, largest + 1, -largest - 1, 2**30, 2**31 - 1, -(2**31))
    for counts, moved, error in itertools.product(_LAST_TICK_COUNTS, moves, _ERRORS_Q8):
        record = _standstill(library)
        now = wrap(np.array(counts + moved))
        _memory(record)["counts"] = counts
        _memory(record)["displacement"] = wrap(np.array(-moved)) if error % 2 else moved
        record["input"]["counts"] = now
        record["input"]["reference_position_q8"] = wrap(wrap(now * 256) + error)
        # As the limit ships, and as wide as it may be set.
        yield record.copy()
        for limit in ("max_displacement", "max_displacement_change"):
            record["config"]["joint"][limit] = 2**30 - 1
        record["config"]["joint"]["torque_limit_Nm"] = FLOAT_MAX
        yield record


def _lost_ticks(library: Compiled) -> Iterator[Records]:
    """Readings at and beyond what is plausible after a lost tick, and after too many."""
    largest = library.controller.joints[0].max_displacement
    change = library.controller.max_displacement_change(library.controller.joints[0])
    for moved in (change, -change, change + 1, -change - 1):
        record = _standstill(library)
        record["input"]["counts"] = moved
        yield record
    ways = itertools.product((1, -1), (0, 1), (0, 1), (PHASE_START, PHASE_LOST), (0, 1, 2, 3))
    for side, beyond, beyond_all, phase, lost in ways:
        record = _standstill(library)
        record["config"]["max_lost_ticks"] = 3
        record["state"]["phase"], record["state"]["lost_ticks"] = phase, lost
        _memory(record)["sliding_integral_rad_per_s"] = 0.125
        # The latest reading is a tick's way from this one, the last good one several ticks'.
        record["input"]["counts"] = side * (largest * (lost + 1) + beyond_all)
        latest = side * (largest * lost + beyond_all - beyond)
        record["state"]["joint"]["tick"]["counts"][..., 1] = latest
        yield record.copy()
        record["config"]["joint"]["max_displacement"] = 2**20
        yield record


def _with_exponents(record: Records, raw: int) -> Records:
    for name in ("alpha", "beta", "gamma"):
        record["config"]["joint"][name] = raw
    return record


def _exponents(library: Compiled) -> Iterator[Records]:
    """Every size of error under every size of exponent, the smallest and the largest included."""
    shared = [exponent_q31(Fraction(a)) for a in EXPONENTS]
    sizes = (0.0, _TINY, 3e-41, _SMALLEST_NORMAL, 1e-20, 1e-6, 1e-3, 0.3, 1.0, 2.0, 1e3, 1e10, 1e20)
    joints = len(library.controller.joints)
    for k, (raw, size) in enumerate(itertools.product([1 - 2**31, *shared], sizes)):
        record = _with_exponents(_standstill(library), raw)
        if raw == 1 - 2**31:
            record["config"]["joint"]["gamma"] = -(2**31)  # sliding mode, sgn(s)
        record["config"]["joint"]["torque_limit_Nm"] = FLOAT_MAX
        record["input"]["reference_velocity_rad_per_s"] = size * _both_signs(joints)
        record["input"]["reference_position_q8"] = _ERRORS_Q8[k % len(_ERRORS_Q8)]
        yield record.copy()
        # The same error, but s next to zero.
        _memory(record)["sliding_integral_rad_per_s"] = -np.nextafter(
            record["input"]["reference_velocity_rad_per_s"], np.float32(0)
        )
        yield record


def _largest(library: Compiled) -> Iterator[Records]:
    """References up to the largest float, where sums overflow and tiny powers follow a line."""
    sizes = (1e15, 2.0**105, 2.0**125, _LINE_FROM, 1e38, 2.0**127, FLOAT_MAX)
    joints = len(library.controller.joints)
    fields = ("reference_velocity_rad_per_s", "reference_acceleration_rad_per_s2")
    for size, a, field in itertools.product(sizes, (*_TINY_EXPONENTS, *EXPONENTS), fields):
        record = _with_exponents(_standstill(library), exponent_q31(Fraction(a)))
        record["input"][field] = size * _both_signs(joints)
        yield record.copy()
        record["config"]["joint"]["torque_limit_Nm"] = FLOAT_MAX
        yield record


def _subnormal(library: Compiled) -> Iterator[Records]:
    """Torques, integrals and references of a few subnormal units, and both zeros."""
    sizes = (0.0, -0.0, _TINY, -3 * _TINY, _SMALLEST_NORMAL - _TINY, -_SMALLEST_NORMAL)
    for velocity, integral, torque in itertools.product(sizes, repeat=3):
        record = _standstill(library)
        record["input"]["reference_velocity_rad_per_s"] = velocity
        record["input"]["reference_acceleration_rad_per_s2"] = torque
        _memory(record)["sliding_integral_rad_per_s"] = integral
        _memory(record)["applied_torque_Nm"] = torque
        yield record.copy()
        # Feedback alone; nothing larger hides the subnormal terms.
        for gain in ("kd", "kp", "lambda"):
            record["config"]["joint"][gain] = 1.0
        yield _with_exponents(record, exponent_q31(Fraction(1)))


def _gains(library: Compiled) -> Iterator[Records]:
    """Every gain from the smallest float to the largest."""
    names = ("inertia_kgm2", "kd", "kp", "lambda", "torque_limit_Nm")
    for name, size in itertools.product(names, (_TINY, _SMALLEST_NORMAL, 1e-6, 1e6, FLOAT_MAX)):
        record = _standstill(library)
        record["config"]["joint"][name] = size
        record["input"]["reference_velocity_rad_per_s"] = 0.25
        record["input"]["reference_position_q8"] = 1000
        record["input"]["reference_acceleration_rad_per_s2"] = -2.0
        yield record


def _first_tick(library: Compiled) -> Iterator[Records]:
    """Switched on at rest and in motion: s starts from zero, and no second difference is taken."""
    for moved, velocity, integral in itertools.product((0, 5, -700), (0.0, 1.5, -3.0), (0.0, 9.0)):
        record = _standstill(library)
        record["state"]["phase"] = PHASE_START
        _memory(record)["displacement"] = 123
        _memory(record)["sliding_integral_rad_per_s"] = integral
        _memory(record)["applied_torque_Nm"] = 4.5
        record["input"]["counts"] = moved
        record["input"]["reference_position_q8"] = 256 * moved + 40
        record["input"]["reference_velocity_rad_per_s"] = velocity
        yield record


def _not_finite(library: Compiled) -> Iterator[Records]:
    """NaN and infinities in each float of the input, with and without an encoder jump."""
    joints = len(library.controller.joints)
    fields = float_inputs(_standstill(library)["input"])
    for field, value, joint, jump in itertools.product(
        fields, _NOT_FINITE, range(joints), (False, True)
    ):
        record = _standstill(library)
        _memory(record)["applied_torque_Nm"] = 1.25
        record["input"][field][:, joint] = value
        record["config"]["on_error"] = joint % 2
        if jump:
            record["input"]["counts"][:, -1] = 2**20
        yield record


def _refused(library: Compiled) -> Iterator[Records]:
    """Missing arguments, and memory that nobody initialised."""
    moving = _standstill(library)
    _memory(moving)["applied_torque_Nm"] = 1.25
    moving["input"]["reference_velocity_rad_per_s"] = 0.5
    for missing in range(1, 16):
        record = moving.copy()
        record["missing"] = missing
        yield record
    for phase in (0, PHASE_START - 1, PHASE_START + 1, PHASE_LOST + 2, 2**32 - 1):
        record = moving.copy()
        record["state"]["phase"] = phase
        yield record


def float_inputs(given: Records) -> list[str]:
    """The fields of an input structure that are floats."""
    return [name for name in given.dtype.names or () if given[name].dtype == np.float32]


def is_refused(records: Records) -> NDArray[np.bool_]:
    """Steps that the controller must not take: an argument is missing, or the state is unfilled."""
    refused: NDArray[np.bool_] = (records["missing"] != 0) | ~is_filled(records["state"])
    return refused
