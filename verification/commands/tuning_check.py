"""`python -m verification tuning-check`: is a gain set safe, and how good is it?"""

from __future__ import annotations

import argparse
from pathlib import Path

from codegen.controller import load
from codegen.emit import REPOSITORY
from plant.robot import load_robot
from verification.commands.output import Output, shown
from verification.evidence import RESULTS
from verification.tuning_check.check import TuningCheck, of_specification, on_plant
from verification.tuning_check.present import figures, show, summary
from verification.tuning_check.verdict import Severity

CONTROLLERS = REPOSITORY / "controllers"


class ChoiceError(ValueError):
    """Arguments that do not go together; the message says which do."""


ERRORS = (ChoiceError,)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Whose gains, and on what plant."""
    parser.add_argument(
        "controller",
        nargs="*",
        type=Path,
        metavar="FILE",
        help="a specification, controllers/NAME.toml; all of controllers/ with --summary",
    )
    parser.add_argument(
        "--plant",
        "--robot",
        dest="plant",
        help="a robot's name or file; without it the specification alone is looked at",
    )
    parser.add_argument(
        "--compute-delay",
        type=int,
        choices=(0, 1),
        default=0,
        help="whole samples from reading the encoders to commanding the torques (default: 0, as "
        "the firmware stub does); what the plant's drives are late by comes on top",
    )
    parser.add_argument(
        "--page", type=Path, metavar="FILE", help="where the page goes (default: build/...)"
    )
    parser.add_argument(
        "--summary",
        action="store_true",
        help="a line for each specification and one for each thing against it; no plant, no page, "
        "and unsafe gains are told and not a failure",
    )


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    if arguments.summary:
        return _summary(arguments, output)
    if len(arguments.controller) != 1:
        raise ChoiceError("give one specification, such as controllers/puma3.toml, or --summary")
    checked = _check(arguments, output)
    page = arguments.page or RESULTS / "tuning_check" / f"{checked.controller.name}.html"
    _write(checked, page)
    if not output.as_json:
        show(checked, output.console)
        output.console.print(f"page: {shown(page)}", soft_wrap=True)
    output.leave(figures(checked), f"tuning_check/{checked.controller.name}")
    return 1 if checked.severity is Severity.UNSAFE else 0


def _check(arguments: argparse.Namespace, output: Output) -> TuningCheck:
    controller = load(arguments.controller[0])
    if arguments.plant is None:
        return of_specification(controller, compute_delay=arguments.compute_delay)
    robot = load_robot(arguments.plant)
    with output.status("checking the gains"):
        return on_plant(controller, robot, compute_delay=arguments.compute_delay)


def _write(checked: TuningCheck, path: Path) -> None:
    # The pictures take long to import, and a summary has none.
    from verification.tuning_check.page import write

    try:
        write(checked, path)
    except OSError as error:
        raise ChoiceError(
            f"--page {path}: can't be written ({error.strerror}); choose a file in a folder that "
            "exists"
        ) from error


def _summary(arguments: argparse.Namespace, output: Output) -> int:
    if arguments.plant or arguments.page:
        raise ChoiceError("--summary looks at specifications alone: leave --plant and --page out")
    paths = arguments.controller or sorted(CONTROLLERS.glob("*.toml"))
    checks = [
        of_specification(load(path), compute_delay=arguments.compute_delay, own_resolution=False)
        for path in paths
    ]
    if output.as_json:
        output.leave({"controllers": [figures(each) for each in checks]}, "tuning_check/summary")
        return 0
    output.console.print("the gains, as far as the specification alone says:")
    for each in checks:
        for line in summary(each):
            output.console.print(line, soft_wrap=True)
    if any(each.severity is Severity.UNSAFE for each in checks):
        output.console.print(
            "[bold red]unsafe gains were generated[/]: `make tuning-check` says more"
        )
    return 0
