"""The simulated robots: what they are made of, and their rigid-body dynamics."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from codegen.problems import SpecificationError
from codegen.source import GenerationError
from plant.assembly import FLEXIBLE_SUBSTEP_S, RIGID_SUBSTEP_S, PlantError
from plant.campaign.execution import Pool, Workers, fly_missing
from plant.campaign.results import Folder, open_folder, summarise
from plant.campaign.runs import CampaignError, prepare
from plant.campaign.specification import read
from plant.closed_loop import ControllerError
from plant.controller import LayoutError
from plant.flight import Backend, fly
from plant.model import build_model, dynamics
from plant.native import BUILD, CompilerError
from plant.pace import CONTROLLERS, measure
from plant.picture import PictureError, draw, save
from plant.propose import ProposalError, add_propose
from plant.robot import FrictionName, Robot, RobotError, load_robot, robot_names
from plant.scenario import read_scenario, scenario_names
from plant.script import uneventful
from plant.tuning.command import add_tuning
from plant.tuning.gains import TuningError


class UsageError(Exception):
    """An argument that cannot be used; the message says what would do."""


def _numbers(option: str, text: str) -> NDArray[np.float64]:
    """Comma-separated finite numbers, shape (n,)."""
    numbers = []
    for word in text.split(","):
        try:
            number = float(word)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise UsageError(f"{option}: {word.strip()!r} is not a finite number")
        numbers.append(number)
    return np.array(numbers)


def _robot_for(name: str, values: int) -> Robot:
    """The robot with as many moving joints: all of them, or its wrist locked at zero."""
    robot = load_robot(name)
    if values == robot.joints:
        return robot
    wanted = f"{robot.joints} numbers"
    if any(joint - 1 in robot.moving for joint in robot.body.wrist):
        locked = load_robot(name, lock_wrist=True)
        if values == locked.joints:
            return locked
        wanted += f", or {locked.joints} for a wrist locked at zero"
    raise UsageError(f"--q: {robot.name} needs {wanted}, not {values}")


def _dynamics(arguments: argparse.Namespace, console: Console) -> int:
    q = _numbers("--q", arguments.q)
    robot = _robot_for(arguments.robot, len(q))
    rates = []
    for option in ("qd", "qdd"):
        text = getattr(arguments, option)
        rate = np.zeros_like(q) if text is None else _numbers(f"--{option}", text)
        if len(rate) != len(q):
            raise UsageError(f"--{option}: has {len(rate)} numbers, --q has {len(q)}")
        rates.append(rate)
    qd, qdd = rates
    terms = dynamics(build_model(robot), q, qd, qdd)
    if arguments.json:
        vectors = {"q": q, "qd": qd, "qdd": qdd}
        matrices = {"M": terms.M, "C": terms.C, "g": terms.g, "tau": terms.tau}
        arrays = {key: value.tolist() for key, value in (vectors | matrices).items()}
        print(json.dumps({"robot": robot.name} | arrays))
        return 0
    console.print(f"[bold]{robot.name}[/bold]: {escape(robot.description)}")
    if robot.locked_names:
        console.print(f"locked at zero: {', '.join(robot.locked_names)}")
    console.print(
        _table(
            "M qdd + C qd + g = tau, friction left out",
            robot.joint_names,
            {
                "q [rad]": q,
                "qd [rad/s]": qd,
                "qdd [rad/s²]": qdd,
                "g [N m]": terms.g,
                "tau [N m]": terms.tau,
            },
        )
    )
    for name, unit, matrix in (("M", "kg m²", terms.M), ("C", "N m s", terms.C)):
        columns = dict(zip(robot.joint_names, matrix.T, strict=True))
        console.print(_table(f"{name} [{unit}]", robot.joint_names, columns))
    return 0


def _table(title: str, rows: Sequence[str], columns: dict[str, NDArray[np.float64]]) -> Table:
    table = Table(title=escape(title), title_justify="left")
    table.add_column("joint")
    for name in columns:
        table.add_column(escape(name), justify="right")
    for i, row in enumerate(rows):
        # Rounding errors of cos(90 deg) are no information for a reader.
        table.add_row(row, *(f"{round(column[i], 12) + 0.0:.6g}" for column in columns.values()))
    return table


def _robots(_: argparse.Namespace, console: Console) -> int:
    for name in robot_names():
        robot = load_robot(name)
        can = "dynamics" if robot.friction is None else "dynamics, simulation"
        console.print(f"[bold]{name}[/bold]: {escape(robot.description)}")
        console.print(f"  {robot.joints} joints: {', '.join(robot.joint_names)} ({can})")
        table = Table(box=None, pad_edge=False, padding=(0, 2), show_header=False)
        for part, source in robot.sources:
            table.add_row(f"  {part}", escape(source))
        console.print(table)
        console.print()
    return 0


def _simulate(arguments: argparse.Namespace, console: Console) -> int:
    scenario = read_scenario(arguments.scenario) if arguments.scenario else None
    flight = fly(
        arguments.controller,
        experiment=arguments.experiment,
        robot=arguments.robot,
        urdf=arguments.urdf,
        friction=arguments.friction,
        speed=arguments.speed,
        substep_s=arguments.substep,
        backend=arguments.backend,
        events=scenario.script if scenario else uneventful,
    )
    if arguments.picture:
        save(draw(flight, scenario), arguments.picture)
    figures = flight.figures()
    if arguments.json:
        print(json.dumps(figures))
        return 0
    what = (
        f"{figures['controller']} on {figures['robot']}, {figures['experiment'] or 'as specified'}"
    )
    columns = {
        "RMS error [deg]": "rms_deg",
        "of the joint itself": "rms_true_deg",
        "peak error [deg]": "peak_error_deg",
        "peak torque [N m]": "peak_torque_Nm",
        "RMS torque step [N m]": "rms_torque_step_Nm",
    }
    if flight.proposed:
        console.print(
            f"{figures['robot']} names no controller: flown with the one to start from that "
            f"`python -m plant propose {arguments.controller}` writes",
            soft_wrap=True,
        )
    columns_ = {title: np.array(figures[key]) for title, key in columns.items()}
    console.print(_table(what, figures["joint_names"], columns_))
    console.print(
        f"{figures['ticks']} ticks of {figures['sample_time_s']} s, "
        f"{figures['saturated_ticks']} with a joint at its torque limit, "
        f"{figures['lost_ticks']} lost"
    )
    return 0


def _bench(arguments: argparse.Namespace, console: Console) -> int:
    figures = []
    for name in CONTROLLERS:
        figures.append(measure(name, arguments.substep, arguments.rounds).figures())
    file = BUILD / "plant" / "pace.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    if arguments.json:
        print(json.dumps(figures))
        return 0
    rows = {
        "pinocchio, s": [row["pinocchio"]["wall_s"] for row in figures],
        "compiled, s": [row["compiled"]["wall_s"] for row in figures],
        "pinocchio, times real time": [row["pinocchio_times_real_time"] for row in figures],
        "compiled, times real time": [row["compiled_times_real_time"] for row in figures],
        "compiled in all threads": [row["together_times_real_time"] for row in figures],
        "MuJoCo's bare steps, over compiled": [
            row["compiled_times_mujoco"] or math.nan for row in figures
        ],
        "compiled, times pinocchio": [row["compiled_times_pinocchio"] for row in figures],
        "the same by CPU time": [row["compiled_times_pinocchio_cpu"] for row in figures],
    }
    table = Table(title="one run with its generated C", title_justify="left")
    table.add_column("")
    for row in figures:
        table.add_column(f"{row['controller']} on {row['robot']}", justify="right")
    for title, values in rows.items():
        table.add_row(title, *(f"{value:.3g}" for value in values))
    console.print(table)
    console.print(
        f"runs of {figures[0]['simulated_s']:g} s, steps of at most {arguments.substep:g} s; "
        f"medians of {arguments.rounds} in turns, without compiling; "
        f"{figures[0]['threads']} threads"
    )
    return 0


def _add_bench(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "bench",
        help="measure how fast both backends are",
        description="Flies puma3 and puma6 on both backends in turns and tells simulated seconds "
        "in a second, for one run at a time and for a run in each of the processor's threads. "
        "Writes build/plant/pace.json as well.",
    )
    parser.add_argument(
        "--substep", type=_positive, default=1e-4, help="longest integration step [s], 1e-4"
    )
    parser.add_argument("--rounds", type=_count, default=5, help="runs of each backend, 5")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(run=_bench)


def _campaign(arguments: argparse.Namespace, console: Console) -> int:
    if arguments.scheduler is not None and arguments.backend != "dask":
        raise UsageError("--scheduler: is for --backend dask")
    path: Path = arguments.specification
    campaign = prepare(read(path), path.parent)
    output = arguments.output or BUILD / "plant" / "campaigns" / path.stem
    folder = open_folder(output, campaign)
    workers = Workers(arguments.backend, arguments.jobs, arguments.scheduler)
    try:
        fly_missing(folder, workers, arguments.batch)
    except KeyboardInterrupt:
        return _interrupted(folder)
    table = folder.finish()
    summary = summarise(table)
    if arguments.json:
        print(json.dumps({"folder": str(output), "runs": len(table), "gain_sets": summary}))
        return 0
    console.print(_campaign_table(f"{campaign.shipped.name}: {len(table)} runs", summary))
    console.print(f"one row a run: {output / 'results.parquet'}", soft_wrap=True)
    return 0


def _interrupted(folder: Folder) -> int:
    """Says what is finished and how to go on."""
    finished, count = len(folder.finished()), folder.campaign.specification.plants.count
    print(
        f"\nInterrupted: {finished} of {count} plants are finished and kept in {folder.path}; "
        "the same command goes on with the others.",
        file=sys.stderr,
    )
    return 130


def _campaign_table(title: str, summary: Sequence[dict[str, Any]]) -> Table:
    """By gain set: counts, and figures of the worst joint over the runs that did not diverge."""
    rows = {
        "runs": "runs",
        "diverged": "diverged",
        "reached a torque limit": "runs_with_saturation",
        "lost a tick": "runs_with_lost_ticks",
        "RMS error [deg], median": "median_rms_error_deg",
        "RMS error [deg], 95 % below": "95_percent_rms_error_deg",
        "RMS error [deg], largest": "largest_rms_error_deg",
        "peak error [deg], largest": "largest_peak_error_deg",
        "RMS torque step [N m], median": "median_rms_torque_step_Nm",
    }
    table = Table(title=escape(title), title_justify="left")
    table.add_column("")
    for of_gains in summary:
        table.add_column(of_gains["gain_set"], justify="right")
    for name, key in rows.items():
        numbers = (of_gains.get(key) for of_gains in summary)
        table.add_row(escape(name), *("-" if x is None else f"{x:.4g}" for x in numbers))
    return table


def _add_campaign(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "campaign",
        help="fly thousands of random plants, gain sets and seeds",
        description="Flies each random plant of a campaign with each gain set and each seed, and "
        "writes one row of figures a run to results.parquet. Finished batches are kept: after an "
        "interruption, or with more plants, the same command goes on. A folder that holds runs of "
        "another specification or other C is refused.",
        epilog="example: python -m plant campaign plant/campaigns/random_plants.toml",
    )
    parser.add_argument("specification", type=Path, help="a campaign, plant/campaigns/NAME.toml")
    parser.add_argument(
        "--output", type=Path, help="folder of the results, build/plant/campaigns/NAME by default"
    )
    parser.add_argument(
        "--backend",
        choices=get_args(Pool),
        default="loky",
        help="processes (loky, the default), threads, or a Dask cluster",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of Dask, such as tcp://10.0.0.1:8786; without it worker processes of this machine",
    )
    parser.add_argument("--jobs", type=_count, help="runs at once, one a processor by default")
    parser.add_argument("--batch", type=_count, help="plants a batch, about 64 runs by default")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(run=_campaign)


def _count(text: str) -> int:
    """An integer greater than 0, for argparse."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is not greater than 0")
    return number


def _add_simulate(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "simulate",
        help="fly a specification's C in closed loop",
        description="Generates and compiles a specification's C (the committed C where it is the "
        "same) and flies it along the robot's own trajectory.",
        epilog="example: python -m plant simulate controllers/puma3.toml --experiment Exp08 --json",
    )
    parser.add_argument(
        "controller",
        type=Path,
        metavar="file",
        help="a specification, controllers/NAME.toml, or a robot file: with the controller that it "
        "names, or the one that `propose` writes for it",
    )
    parser.add_argument(
        "--experiment", help="gains of a row of Table II or of a special case instead of the file's"
    )
    parser.add_argument(
        "--robot", help="a robot's name or file; by the number of joints if not given"
    )
    parser.add_argument("--urdf", type=Path, help="another URDF than that of the robot's file")
    parser.add_argument(
        "--friction",
        choices=get_args(FrictionName),
        help="friction model, with the parameters of the robot's file; the file's by default",
    )
    parser.add_argument(
        "--scenario",
        help="faults, disturbances and payloads: a file of them, or one of "
        + ", ".join(scenario_names()),
    )
    parser.add_argument(
        "--picture", type=Path, metavar="FILE", help="draws the run into a .svg, .pdf or .png file"
    )
    parser.add_argument(
        "--speed", type=_positive, default=1.0, help="how many times as fast, 1 by default"
    )
    parser.add_argument(
        "--substep",
        type=_positive,
        help=f"longest integration step [s], {RIGID_SUBSTEP_S:g} or, where joints are flexible, "
        f"{FLEXIBLE_SUBSTEP_S:g}",
    )
    parser.add_argument(
        "--backend",
        choices=get_args(Backend),
        default="pinocchio",
        help="pinocchio, the reference in Python, or compiled, the same loop in C",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(run=_simulate)


def _positive(text: str) -> float:
    """A finite number greater than 0, for argparse."""
    number = float(text)
    if not (math.isfinite(number) and number > 0.0):
        raise argparse.ArgumentTypeError(f"{text} is not greater than 0")
    return number


def _add_dynamics(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "dynamics",
        help="M, C, g and the frictionless torque of a robot in one state",
        description="Terms of M(q) qdd + C(q, qd) qd + g(q) = tau, motor inertia included, "
        "friction left out. With numbers for fewer joints the wrist is locked at zero.",
        epilog="example: python -m plant dynamics --robot puma560 --q=0,0.8,-1.6 --json",
    )
    parser.add_argument("--robot", required=True, help=f"one of {', '.join(robot_names())}")
    parser.add_argument("--q", required=True, help="joint positions [rad], --q=0.1,-0.2,...")
    parser.add_argument("--qd", help="joint velocities [rad/s], 0 by default")
    parser.add_argument("--qdd", help="joint accelerations [rad/s^2], 0 by default")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(run=_dynamics)


def _add_robots(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser("robots", help="list the robots, their joints and sources")
    parser.set_defaults(run=_robots)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m plant", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    _add_simulate(commands)
    add_propose(commands)
    add_tuning(commands)
    _add_bench(commands)
    _add_campaign(commands)
    _add_dynamics(commands)
    _add_robots(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; returns the exit code: 0, or 2 for bad input."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options, Console(highlight=False)))
    except (
        UsageError,
        RobotError,
        PlantError,
        SpecificationError,
        GenerationError,
        CompilerError,
        LayoutError,
        ControllerError,
        CampaignError,
        PictureError,
        ProposalError,
        TuningError,
    ) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
