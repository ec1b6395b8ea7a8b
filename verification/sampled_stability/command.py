"""`python -m verification sampled-interval`: its options, its answer, and the answer for people."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any, get_args

from rich.markup import escape
from rich.table import Table

from codegen.law import AccelerationEstimate, VelocityError
from verification.evidence import Evidence
from verification.sampled_stability.check import complaints
from verification.sampled_stability.intervals import Analysis, Interval, analyse, certificate
from verification.sampled_stability.loop import Loop, LoopError, low_pass_ratio

MEANING = (
    "Stable: every motion of the loop dies out. It is one joint with the linear law (alpha = beta "
    "= gamma = 1) without saturation, M(q) frozen, no friction, torque held between the samples. "
    "Of a robot with the same KD, KP and lambda at all joints every eigenvalue of M(q)^-1 Mbar is "
    "such an r, at every q."
)
CONTINUOUS = "(33), |1 - Mbar/M| < 1, knows neither samples nor their delay and would say (0, 2)."

_NUMBER = r"\d{1,18}(\.\d{1,18})?([eE][+-]?\d{1,2})?"
_CUTOFF = "rad/s"
_SHOWN_DIGITS = 6


def _rational(text: str) -> Fraction:
    """A decimal number or a fraction, exactly; short enough to compute with."""
    plain = re.fullmatch(rf"[+-]?({_NUMBER}|\d{{1,18}}/0*[1-9]\d{{0,17}})", text)
    if plain is None:
        raise argparse.ArgumentTypeError(f"a number such as 20, 0.001 or 1/1000, not {text!r}")
    return Fraction(text)


def _low_pass(text: str) -> tuple[Fraction, bool]:
    """A number, and whether it is a cutoff."""
    return _rational(text.removesuffix(_CUTOFF).strip()), text.endswith(_CUTOFF)


def add_options(parser: argparse.ArgumentParser) -> None:
    """The options of the command, without ``--json``."""
    number: dict[str, Any] = {"type": _rational, "metavar": "NUMBER"}
    parser.add_argument("--kd", required=True, help="KD [1/s]", **number)
    parser.add_argument("--kp", required=True, help="KP [1/s^2]", **number)
    parser.add_argument(
        "--lambda", dest="lambda_", required=True, help="lambda [1/s], 0 for none", **number
    )
    parser.add_argument("--sample-time", required=True, help="L [s], such as 1/1000", **number)
    parser.add_argument(
        "--acceleration",
        choices=get_args(AccelerationEstimate),
        default="current",
        help="the second difference that estimates qdd(t-L) (default: %(default)s)",
    )
    parser.add_argument(
        "--velocity-error",
        choices=get_args(VelocityError),
        default="reference-rate",
        help="how ed is formed; all have the same interval, since they differ in the reference",
    )
    parser.add_argument(
        "--compute-delay",
        type=int,
        choices=(0, 1),
        default=0,
        help="whole samples until the torque is commanded (default: %(default)s)",
    )
    parser.add_argument(
        "--torque-delay",
        default=Fraction(0),
        help="further part of a sample until it acts, 0 to 1 (default: %(default)s)",
        **number,
    )
    parser.add_argument(
        "--low-pass",
        type=_low_pass,
        metavar="RATIO|CUTOFF",
        help=f"of the low-pass (43): its ratio w'/(1+w'), or its cutoff w such as 500{_CUTOFF}",
    )
    parser.add_argument(
        "--reports-torque",
        action="store_true",
        help="tau(t-L) is the mean torque that the drive applied in the last sample",
    )
    parser.add_argument(
        "--certificate", type=Path, metavar="FILE", help="write what the checker verifies as JSON"
    )


@dataclass(frozen=True)
class Answer:
    """What the command found.

    Attributes:
        analysis: of the loop.
        complaints: of the independent checker; none if the certificate is verified.
    """

    analysis: Analysis
    complaints: tuple[str, ...]

    @property
    def verified(self) -> bool:
        """Whether the independent checker agrees."""
        return not self.complaints

    def figures(self) -> dict[str, Any]:
        """The answer as plain data; enclosures and certificate are exact, as text."""
        exact = certificate(self.analysis)
        intervals = self.analysis.intervals
        return {
            "intervals": [[float(i.low), float(i.high)] for i in intervals],
            "enclosures": exact["intervals"],
            "oscillation_Hz": [
                [self._frequency(i, False), self._frequency(i, True)] for i in intervals
            ],
            "meaning": MEANING,
            "evidence": Evidence.PROVED.value if self.verified else None,
            "complaints": list(self.complaints),
            "certificate": exact,
        }

    def shown(self) -> Iterator[Table | str]:
        """The answer for people."""
        intervals = self.analysis.intervals
        if intervals:
            table = Table(title="Stable r = Mbar/M", title_justify="left")
            for name in ("end", "r"):
                table.add_column(name, no_wrap=True)
            table.add_column("what it means")
            for k, interval in enumerate(intervals):
                table.add_row("lower", f"{float(interval.low):.10f}", self._below(interval, k == 0))
                last = k == len(intervals) - 1
                table.add_row("upper", f"{float(interval.high):.10f}", self._above(interval, last))
                table.add_section()
            yield table
        else:
            yield "[bold]Stable r = Mbar/M: none.[/bold] No Mbar > 0 makes this loop stable."
            yield _why_none(self.analysis)
        for interval in intervals:
            least, most = _inward(interval)
            yield f"Mbar between {least:f} M and {most:f} M is inside."
        yield MEANING
        yield CONTINUOUS
        if self.verified:
            yield "[green]proved[/green], and the certificate verified by the independent checker"
        for complaint in self.complaints:
            yield f"[red]NOT proved[/red]: {escape(complaint)}"

    def _frequency(self, interval: Interval, upper: bool) -> float | None:
        end = interval.high if upper else interval.low
        return self.analysis.frequency_hz(end) if end.below > 0 else None

    def _below(self, interval: Interval, first: bool) -> str:
        frequency = self._frequency(interval, False)
        if frequency is None:
            return "no end: the loop is stable for any smaller Mbar"
        grows = f"below it a swing of about {frequency:.3g} Hz grows"
        if not first:
            return grows
        return (
            f"{grows}: with so small an Mbar a sample corrects so little that the "
            "torque comes too late for KD, KP and lambda"
        )

    def _above(self, interval: Interval, last: bool) -> str:
        grows = f"above it a vibration of about {self._frequency(interval, True):.3g} Hz grows"
        if not last:
            return grows
        return f"{grows}: a sample corrects more than was missing in the one before"


def _inward(interval: Interval) -> tuple[Decimal, Decimal]:
    """The ends with few digits, rounded so that they lie inside."""
    ends = ((interval.low.above, ROUND_CEILING), (interval.high.below, ROUND_FLOOR))
    least, most = (
        Context(prec=_SHOWN_DIGITS, rounding=rounding).divide(
            Decimal(end.numerator), Decimal(end.denominator)
        )
        for end, rounding in ends
    )
    return least, most


def _why_none(analysis: Analysis) -> str:
    loop = analysis.loop
    if loop.kp == 0:
        return "With KP = 0 nothing brings the joint back: give KP > 0."
    if not analysis.boundaries and loop.reports_torque:
        return (
            "A torque reported a whole sample late lets torques of alternating sign go on for "
            "ever, unseen in the samples: use the commanded torque, or shorten the delay."
        )
    return (
        "Shorten the sample time or the delays, use the current acceleration, or lower the gains."
    )


def answer(arguments: argparse.Namespace) -> Answer:
    """Finds the intervals, checks them, and writes the certificate if asked for.

    Raises:
        LoopError: the loop can't be, or the certificate can't be written.
    """
    ratio = None
    if arguments.low_pass is not None:
        number, is_cutoff = arguments.low_pass
        if is_cutoff and number <= 0:
            raise LoopError(f"low-pass cutoff = {number} {_CUTOFF}: must be > 0; write w of (43)")
        ratio = low_pass_ratio(number, arguments.sample_time) if is_cutoff else number
    analysis = analyse(
        Loop(
            arguments.kd,
            arguments.kp,
            arguments.lambda_,
            arguments.sample_time,
            arguments.acceleration,
            arguments.velocity_error,
            arguments.compute_delay,
            arguments.torque_delay,
            ratio,
            arguments.reports_torque,
        )
    )
    made = certificate(analysis)
    if arguments.certificate is not None:
        _write(made, arguments.certificate)
    return Answer(analysis, tuple(complaints(made)))


def _write(made: dict[str, Any], path: Path) -> None:
    try:
        path.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise LoopError(
            f"{path}: can't be written ({error.strerror}); choose a file in a folder that exists"
        ) from error
