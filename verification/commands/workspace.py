"""`python -m verification workspace`: the eigenvalues of M(q)^-1 Mbar, certified at every q."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from codegen.controller import load
from plant.robot import load_robot
from verification.commands.output import Output
from verification.evidence import Evidence
from verification.experiments import CONTROLLERS
from verification.workspace.certify import (
    LIMIT,
    STAGES,
    Certified,
    WorkspaceError,
    certified_eigenvalues,
)

MEANING = (
    "M is that of the rigid links and the motors, as the robot's file has them. Condition (33) is "
    "for a law that acts without delay; how far below 2 the eigenvalues of a sampled law must "
    "stay is what `sampled-interval` says."
)
ERRORS = (WorkspaceError,)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Whose workspace, and whose Mbar."""
    parser.add_argument("--robot", default="reference", help="a robot's name or file")
    parser.add_argument("--lock-wrist", action="store_true", help="lock the robot's wrist at zero")
    parser.add_argument(
        "--controller",
        type=Path,
        default=CONTROLLERS / "puma3.toml",
        metavar="FILE",
        help="the specification that has Mbar (default: puma3.toml)",
    )
    parser.add_argument(
        "--within-ranges",
        action="store_true",
        help="only inside the joint ranges of the robot's file (default: every joint turns freely)",
    )
    parser.add_argument(
        "--certificate", type=Path, metavar="FILE", help="write what the checker verifies as JSON"
    )


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    robot = load_robot(arguments.robot, lock_wrist=arguments.lock_wrist)
    Mbar = [joint.inertia for joint in load(arguments.controller).joints]
    started = time.perf_counter()
    with output.bar("searching and checking boxes", STAGES) as advance:
        found = certified_eigenvalues(
            robot, Mbar, within_ranges=arguments.within_ranges, advance=advance
        )
    seconds = time.perf_counter() - started
    if arguments.certificate is not None:
        _write(found.certificate, arguments.certificate)
    if not output.as_json:
        _print(found, seconds, output)
    output.leave(_figures(found, robot.name, seconds), "workspace")
    return 0 if found.proved else 1


def _write(certificate: dict[str, Any], path: Path) -> None:
    try:
        path.write_text(json.dumps(certificate) + "\n", encoding="utf-8")
    except OSError as error:
        raise WorkspaceError(
            f"{path}: can't be written ({error.strerror}); choose a file in a folder that exists"
        ) from error


def _figures(found: Certified, robot: str, seconds: float) -> dict[str, Any]:
    return {
        "robot": robot,
        "eigenvalues": [float(found.low), float(found.high)],
        "sampled": found.sampled,
        "tight": found.tight,
        "pessimism": found.pessimism,
        "holds_33": found.holds_33,
        "largest_scaling": float(found.largest_scaling),
        "boxes": found.boxes,
        "time_s": seconds,
        "evidence": Evidence.PROVED.value if found.proved else None,
        "complaints": found.complaints,
        "meaning": MEANING,
    }


def _print(found: Certified, seconds: float, output: Output) -> None:
    table = Table(title="Eigenvalues of M(q)^-1 Mbar", title_justify="left")
    for name in ("", "bound", "sampled"):
        table.add_column(name, no_wrap=True)
    table.add_row("at every q above", f"{float(found.low):.6g}", f"{found.sampled.low:.6g}")
    table.add_row("at every q below", f"{float(found.high):.6g}", f"{found.sampled.high:.6g}")
    say = output.console.print
    say(table)
    if found.proved:
        condition, scaling = (
            f"Condition (33), all below {LIMIT},",
            f"{float(found.largest_scaling):g}",
        )
        if found.holds_33:
            say(f"{condition} holds; also with Mbar {scaling} times as large.")
        elif found.sampled.high >= LIMIT:
            say(f"{condition} fails at a sample; it holds with Mbar {scaling} times as large.")
        else:
            say(f"{condition} stays open; it holds with Mbar {scaling} times as large.")
        say("[green]proved[/green]: the certificate was verified by the independent checker")
        if not found.tight:
            low, high = found.pessimism
            say(
                f"[yellow]coarser[/yellow]: the bounds are at most {low:.1%} (below) and "
                f"{high:.1%} (above) pessimistic; the truth is between them and the samples."
            )
    for complaint in found.complaints:
        say(f"[red]NOT proved[/red]: {escape(complaint)}")
    say(f"{found.boxes} boxes, {seconds:.1f} s. {MEANING}")
