"""``python -m verification error-bound``: how large s and e can be under a bounded TDE error."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from verification.commands.output import Output
from verification.error_bound.analysis import Bound, ErrorBound, error_bound
from verification.error_dynamics.model import FINITE_TIME, ErrorDynamicsError, show

_NAMES = {
    "by_sliding": "|e| from the bound of |s|",
    "by_sliding_rate": "|e| from |sdot| <= 2 xi",
    "uncorrected": "|e| without correction, same xi",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's options; numbers stay text, so that 0.95 is 19/20 exactly."""
    for name, says in (
        ("--kd", "damping gain KD"),
        ("--kp", "stiffness gain KP"),
        ("--alpha", "exponent of the velocity error"),
        ("--beta", f'exponent of the position error, or "{FINITE_TIME}": alpha/(2 - alpha)'),
        ("--lambda", "gain of the correction of the TDE error; 0 for none"),
        ("--gamma", "exponent of the correction"),
        ("--tde-error", "xi, bound of the TDE error |eps|, in rad/s^2"),
    ):
        parser.add_argument(name, required=True, metavar="NUMBER", help=says)
    parser.add_argument(
        "--certificate", type=Path, metavar="FILE", help="write the certificate of the bounds there"
    )


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Finds the bounds, prints them, and leaves the figures beside what it prints.

    Raises:
        ErrorDynamicsError: a number is out of range, or there is no certificate to write.
    """
    with output.status("barriers, and their check"):
        found = error_bound(
            arguments.kd,
            arguments.kp,
            arguments.alpha,
            arguments.beta,
            getattr(arguments, "lambda"),
            arguments.gamma,
            tde_error=arguments.tde_error,
        )
    if arguments.certificate is not None:
        _write_certificate(found, arguments.certificate)
    if not output.as_json:
        output.console.print(table_of(found))
        for note in notes(found):
            output.console.print(escape(note))
    output.leave(found.summary(), "error_bound")
    return 0


def _write_certificate(found: ErrorBound, path: Path) -> None:
    if found.certificate is None:
        raise ErrorDynamicsError(
            "no certificate: no bound was verified; see why without --certificate"
        )
    path.write_text(json.dumps(found.certificate, indent=1) + "\n", encoding="utf-8")


def table_of(found: ErrorBound) -> Table:
    """One row for each bound."""
    p = found.parameters
    table = Table(
        title=f"KD = {show(p.KD)}, KP = {show(p.KP)}, alpha = {show(p.alpha)}, "
        f"beta = {show(p.beta)}, lambda = {show(found.lambda_)}, gamma = {show(found.gamma)}, "
        f"xi = {show(found.tde_error)} rad/s^2",
        title_justify="left",
    )
    for name in ("quantity", "at most", "holds", "evidence"):
        table.add_column(name)
    if found.sliding_bound_rad_per_s is not None:
        s = f"{found.sliding_bound_rad_per_s:.6g} rad/s"
        table.add_row("|s| (38)", s, "from s(0) = 0 on, and in the end", found.sliding_kind)
    for name, says in _NAMES.items():
        bound: Bound | None = getattr(found, name)
        if bound is not None:
            error = f"{bound.error_rad:.6g} rad"
            table.add_row(escape(says), error, _HOLDS[bound.scope], bound.kind)
    return table


_HOLDS = {
    "ultimate": "from e = ed = 0 on, and in the end from any start",
    "invariant": "from e = ed = 0 on",
}


def notes(found: ErrorBound) -> Iterator[str]:
    """What the figures mean, one sentence or two each."""
    if found.error is None:
        yield f"no bound of |e| for these gains: {found.reason}"
    else:
        yield f"with these gains |e| is at most {found.error.error_rad:.6g} rad."
    for name, why in found.not_given.items():
        yield f"no {_NAMES.get(name, 'bound of |s|')}: {why}"
    if found.error is not None and found.error.scope == "invariant":
        yield (
            "off the pair beta = alpha/(2 - alpha) barriers do not scale: nothing is said of "
            "motions that begin outside."
        )
    yield (
        "proved: a certificate that an independent checker verified. Of the closed loop (32) in "
        "continuous time, where |eps| <= xi is given: no sampling, no encoder, no saturation."
    )
