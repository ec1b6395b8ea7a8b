"""``python -m verification error-dynamics``: how the error ends, when, and what is proved."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from verification.commands.output import Output
from verification.error_dynamics.analysis import RESOLUTION_RAD, ErrorDynamics, analyse
from verification.error_dynamics.balls import Enclosure
from verification.error_dynamics.classes import Approach, Kind
from verification.error_dynamics.model import FINITE_TIME, ErrorDynamicsError, show

_DIGITS = 9


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's options; numbers stay text, so that 0.95 is 19/20 exactly."""
    for name, says in (
        ("--kd", "damping gain KD"),
        ("--kp", "stiffness gain KP"),
        ("--alpha", "exponent of the velocity error"),
        ("--beta", f'exponent of the position error, or "{FINITE_TIME}": alpha/(2 - alpha)'),
    ):
        parser.add_argument(name, required=True, metavar="NUMBER", help=says)
    for name, default, says in (
        ("--e0", "1", "position error at the start, in rad"),
        ("--ed0", "0", "velocity error at the start, in rad/s"),
        ("--resolution", str(float(RESOLUTION_RAD)), "of the encoder at the joint, in rad"),
    ):
        parser.add_argument(
            name, default=default, metavar="NUMBER", help=f"{says} (default: %(default)s)"
        )
    parser.add_argument(
        "--certificate", type=Path, metavar="FILE", help="write the Lyapunov certificate there"
    )


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Analyses, prints, and leaves the figures beside what it prints.

    Raises:
        ErrorDynamicsError: a number is out of range, or there is no certificate to write.
    """
    found = analyse(
        arguments.kd,
        arguments.kp,
        arguments.alpha,
        arguments.beta,
        e0=arguments.e0,
        ed0=arguments.ed0,
        resolution_rad=arguments.resolution,
    )
    if arguments.certificate is not None:
        _write_certificate(found, arguments.certificate)
    if not output.as_json:
        output.console.print(table_of(found))
        for note in notes(found):
            output.console.print(escape(note))
    output.leave(found.summary(), "error_dynamics")
    return 0


def _write_certificate(found: ErrorDynamics, path: Path) -> None:
    made = found.lyapunov.certificate
    if made is None:
        raise ErrorDynamicsError(
            "no certificate: only the linear dynamics and the pairs beta = alpha/(2 - alpha) with "
            f"alpha < 1 have a strict function here; write --beta {FINITE_TIME} or leave "
            "--certificate out"
        )
    path.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")


# --- For people --------------------------------------------------------------------------------

ENDS = {
    Kind.FINITE_TIME: "finite time: exactly zero after the settling time",
    Kind.EXPONENTIAL: "exponential: never exactly zero, a share per time",
    Kind.ASYMPTOTIC: "asymptotic: to zero, but slower than any exponential",
    Kind.SLIDING: "sliding: exactly zero after the settling time, held by switching",
    Kind.STICTION: "stiction: stops, but not at zero",
    Kind.NOT_CONVERGENT: "does not converge",
}
LOOKS = {
    Approach.NODE: "node: straight in, along a curve",
    Approach.CRITICAL: "node, critically damped",
    Approach.FOCUS: "focus: turns around zero",
    Approach.BAND: "a band of equilibria",
}


def table_of(found: ErrorDynamics) -> Table:
    """One row for each quantity that there is."""
    p = found.parameters
    table = Table(
        title=f"KD = {show(p.KD)}, KP = {show(p.KP)}, alpha = {show(p.alpha)}, "
        f"beta = {show(p.beta)}",
        title_justify="left",
    )
    for name in ("quantity", "value", "evidence"):
        table.add_column(name)
    for row in _rows(found):
        table.add_row(*(escape(cell) for cell in row))
    return table


def _rows(found: ErrorDynamics) -> Iterator[tuple[str, str, str]]:
    enclosed = "enclosed"
    yield "the error ends", ENDS[found.kind], found.evidence
    if found.equilibrium is not None:
        by_value = enclosed if found.kd_star else "hand proof"
        yield "the origin is a", LOOKS[found.equilibrium], by_value
    start = f"from e = {show(found.start[0])} rad, ed = {show(found.start[1])} rad/s"
    for name, value, write in (
        ("a node from KD =", found.kd_star, _number),
        ("may stop at |e| up to", found.stiction_band_rad, lambda v: _number(v, " rad")),
        ("|e| after a half-turn", found.overshoot_per_half_turn, _share),
        (
            f"below {show(found.resolution_rad)} rad for good, {start}",
            found.time_to_resolution_s,
            lambda v: _number(v, " s"),
        ),
        (f"exactly zero, {start}", found.settling_time_from_start_s, lambda v: _number(v, " s")),
    ):
        if value is not None:
            yield name, write(value), enclosed
    yield from _lyapunov_rows(found)


def _lyapunov_rows(found: ErrorDynamics) -> Iterator[tuple[str, str, str]]:
    lyapunov = found.lyapunov
    yield "Lyapunov function", lyapunov.function, lyapunov.kind
    yield "falls by", lyapunov.decrease, lyapunov.kind
    for name, value in lyapunov.values.items():
        yield f"  {name}", f"{float(Fraction(value)):.7g}", lyapunov.kind
    if lyapunov.settling_time_bound_s is not None:
        bound = f"{lyapunov.settling_time_bound_s:.6g} s from e = 1 rad at rest"
        yield "  zero at the latest after", bound, lyapunov.kind


def _number(value: Enclosure, unit: str = "") -> str:
    low, high = (f"{end:.{_DIGITS}g}" for end in value)
    return f"{low}{unit}" if low == high else f"{value[0]!r} to {value[1]!r}{unit}"


def _share(value: Enclosure) -> str:
    if value[1] == 0:
        return "none: no overshoot from rest"
    return f"{value[1]:.4g} of what it was, on the other side"


def notes(found: ErrorDynamics) -> Iterator[str]:
    """What the figures mean, one sentence or two each."""
    yield f"why: {found.reason}"
    yield f"the Lyapunov function proves {found.lyapunov.proves}."
    settled, seen = found.settling_time_from_start_s, found.time_to_resolution_s
    if settled and seen and settled[1] > 0:
        share = 1 - seen[1] / settled[0]
        yield (
            "the theory's settling time is the moment of e = 0 exactly; the last "
            f"{share:.0%} of it passes below the encoder's resolution, unseen by the controller."
        )
    for name, why in found.not_given.items():
        yield f"no {name}: {why}"
    if found.time_to_resolution_s is not None:
        yield (
            "enclosed: rigorous bounds by ball arithmetic (Arb) that agree in all digits shown; "
            "proved: a certificate that an independent checker verified. Both are of the ideal "
            "dynamics (17): no sampling, no TDE error."
        )
