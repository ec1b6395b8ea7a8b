"""The commands ``python -m plant tune`` and ``python -m plant autotune``."""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import track
from rich.table import Table
from rich.text import Text

from codegen.controller import Controller
from plant.assembly import Plant
from plant.native import BUILD
from plant.robot import robot_names
from plant.tuning.comparison import Comparison, fly_all
from plant.tuning.gains import Gains, TuningError
from plant.tuning.optimiser import Attempt, optimise, score, training
from plant.tuning.pictures import comparison_picture, step_picture
from plant.tuning.procedure import STEPS, VIBRATION_LIMIT, Chosen, Trial, tune
from plant.tuning.rig import Rig, open_rig
from plant.tuning.writing import check_new, tuned_text, write_new

FOLDER = BUILD / "plant" / "tuning"

DRAWN = 40
"""Random plants from which the optimiser's training plants are chosen."""
# Seeds of other plants than any training seed draws.
_HELD_OUT_SEED = 2**32

_INTERRUPTED = 130


@dataclass(frozen=True)
class _Job:
    """A tuning: what is tuned on what, and where it goes."""

    path: Path
    robot: str | None
    output: Path | None
    rig: Rig

    @property
    def controller(self) -> Controller:
        return self.rig.controller

    @property
    def title(self) -> str:
        return f"{self.controller.name} on {self.rig.plant.name}"

    @property
    def joint_names(self) -> list[str]:
        return [joint.name for joint in self.controller.joints]

    @property
    def folder(self) -> Path:
        return FOLDER / f"{self.controller.name}_on_{self.rig.plant.name}"

    def plain(self) -> dict[str, Any]:
        """What every JSON begins with."""
        return {
            "controller": self.controller.name,
            "robot": self.rig.plant.name,
            "joint_names": self.joint_names,
            "specified_inertia_kgm2": [float(joint.inertia) for joint in self.controller.joints],
        }


def _job(arguments: argparse.Namespace) -> _Job:
    path: Path = arguments.controller
    output: Path | None = arguments.output
    if output is not None:
        check_new(output)
    rig = open_rig(path, arguments.robot, arguments.speed)
    return _Job(path, arguments.robot, output, rig)


def _write(job: _Job, text: str, figures: dict[str, Any], files: Mapping[str, str]) -> Path:
    """Writes a tuning's files, each whole or not at all; gives where the specification is.

    Without ``--output`` it stands in the tuning's own folder, where it replaces the last one.
    """
    folder = job.folder
    output = job.output if job.output is not None else folder / f"{figures['by']}.toml"
    if output.resolve() == job.path.resolve():
        raise TuningError(f"{output} is what is tuned: name another file with --output")
    folder.mkdir(parents=True, exist_ok=True)
    figures["output"] = str(output)
    contents = {**files, f"{figures['by']}.json": json.dumps(figures, indent=2) + "\n"}
    if job.output is None:
        contents[output.name] = text
    for name, content in contents.items():
        unfinished = folder / f".{name}.{os.getpid()}"
        try:
            unfinished.write_text(content, encoding="utf-8")
            unfinished.replace(folder / name)
        finally:
            unfinished.unlink(missing_ok=True)
    if job.output is not None:
        write_new(output, text)
    return output


def _tune(arguments: argparse.Namespace, console: Console) -> int:
    job = _job(arguments)
    log = _Log(job, console, shown=not arguments.json)
    with _interruptible():
        chosen = _procedure(job, log)
        gains = chosen[-1].gains
        how = f"Tuned by the procedure III-E on {job.rig.plant.name}: {_STALE}"
        text = tuned_text(job.path.read_text(encoding="utf-8"), gains, job.controller, how)
        figures = job.plain() | {
            "by": "tune",
            "steps": [_step_figures(c) for c in chosen],
            "tuned": gains.plain(),
            "inertia_over_specified": _over_specified(job, chosen[-1]),
            "trials": [trial.plain() for trial in log.trials],
        }
        names = {c.step.number: f"tune-step-{c.step.number}-{c.step.symbol}.svg" for c in chosen}
        pictures = {
            names[c.step.number]: step_picture(
                c, before, [t for t in log.trials if t.step == c.step.number], job.joint_names
            )
            for before, c in zip((None, *chosen), chosen, strict=False)
        }
        output = _write(job, text, figures, pictures | {"tune.log": log.text()})
    if arguments.json:
        print(json.dumps(figures))
        return 0
    console.print(_chosen_table(job, chosen))
    ratios = ", ".join(f"{x:.3g}" for x in figures["inertia_over_specified"])
    console.print(f"Mbar over the file's: {ratios}; {len(log.trials)} trials")
    _tell_files(job, output, console)
    return 0


_STALE = "comments beside gains may speak of those before."


def _procedure(job: _Job, log: _Log) -> list[Chosen]:
    inertia = [joint.inertia for joint in job.controller.joints]
    return tune(inertia, job.rig.fly, log)


def _step_figures(chosen: Chosen) -> dict[str, Any]:
    return {
        "step": chosen.step.number,
        "quantity": chosen.step.symbol,
        "vibration_limit": chosen.step.vibration_limit,
        "gains": chosen.gains.plain(),
        **chosen.outcome.plain(),
    }


def _over_specified(job: _Job, chosen: Chosen) -> list[float]:
    pairs = zip(chosen.gains.inertia, job.controller.joints, strict=True)
    return [float(tuned / joint.inertia) for tuned, joint in pairs]


class _Log:
    """Tells of each trial in a line that a person can follow."""

    def __init__(self, job: _Job, console: Console, *, shown: bool) -> None:
        self.trials: list[Trial] = []
        self._names, self._console, self._shown = job.joint_names, console, shown
        self._lines: list[str] = []
        self._tell(f"[bold]{escape(job.title)}[/bold]: the tuning procedure III-E")

    def __call__(self, trial: Trial) -> None:
        """Keeps the trial and tells of it."""
        if not self.trials or self.trials[-1].step != trial.step:
            step = STEPS[trial.step - 1]
            self._tell("")
            self._tell(
                f"[bold]step {step.number}: {step.symbol}[/bold], vibration at most "
                f"{step.vibration_limit:g}"
            )
        self.trials.append(trial)
        self._tell(escape(self._line(trial)))

    def text(self) -> str:
        """All lines, plain."""
        return "".join(f"{Text.from_markup(line).plain.rstrip()}\n" for line in self._lines)

    def _tell(self, line: str) -> None:
        self._lines.append(line)
        if self._shown:
            self._console.print(line, soft_wrap=True)

    def _line(self, trial: Trial) -> str:
        step = STEPS[trial.step - 1]
        values = getattr(trial.gains, step.quantity)
        tried = values if isinstance(values, tuple) else (values,)
        value = " ".join(f"{float(x):<6.4g}" for x in tried)
        rms = " ".join(f"{1e3 * x:<6.4g}" for x in trial.outcome.rms_deg)
        shaking = " ".join(f"{x:<5.3g}" for x in trial.outcome.vibration)
        return (
            f"  {trial.stage:8}{step.symbol} {value}  error {rms} mdeg  vibration {shaking}  "
            f"{self._decision(trial)}"
        )

    def _decision(self, trial: Trial) -> str:
        """What was decided and why; joints of which the same is said together."""
        said: dict[str, list[str]] = {}
        for name, verdict in zip(self._names, trial.verdicts, strict=False):
            if verdict is not None:
                text = f"{'yes' if verdict.good else 'NO'}: {verdict.reason}"
                said.setdefault(text, []).append(name)
        if len(trial.verdicts) == 1 or (len(said) == 1 and None not in trial.verdicts):
            return next(iter(said))
        return "; ".join(f"{', '.join(names)} {text}" for text, names in said.items())


def _chosen_table(job: _Job, chosen: Sequence[Chosen]) -> Table:
    table = Table(title=f"after each step; joints: {escape(', '.join(job.joint_names))}")
    table.title_justify = "left"
    columns = ("step", "Mbar [kg m²]", "lambda", "gamma", "alpha", "error [mdeg]", "vibration")
    for name in columns:
        table.add_column(escape(name), justify="right")
    for c in chosen:
        table.add_row(
            f"{c.step.number}: {c.step.symbol}",
            _numbers(c.gains.inertia),
            *(f"{float(x):g}" for x in (c.gains.lambda_, c.gains.gamma, c.gains.alpha)),
            _numbers(1e3 * c.outcome.rms_deg, 3),
            _numbers(c.outcome.vibration, 3),
        )
    return table


def _numbers(values: Iterable[Any], digits: int = 4) -> str:
    return " ".join(f"{float(x):.{digits}g}" for x in values)


def _tell_files(job: _Job, output: Path, console: Console) -> None:
    console.print(f"log, JSON and pictures: {job.folder}", soft_wrap=True)
    fly = f"python -m plant simulate {output}"
    if job.robot is not None:
        fly += f" --robot {job.robot}"
    console.print(f"tuned specification: {output}; fly it: {fly}", soft_wrap=True)


def _autotune(arguments: argparse.Namespace, console: Console) -> int:
    job = _job(arguments)
    with _interruptible():
        tuned = _search(job, arguments)
        how = f"Tuned by an optimiser on relatives of {job.rig.plant.name}: {_STALE}"
        text = tuned_text(
            job.path.read_text(encoding="utf-8"), tuned.best.gains, job.controller, how
        )
        comparisons = _compare(job, arguments, tuned)
        sets = tuned.gain_sets
        figures = job.plain() | {
            "by": "autotune",
            "seed": arguments.seed,
            "vibration_limit": VIBRATION_LIMIT,
            "training_plants": len(tuned.plants),
            "training": tuned.best.score.plain(),
            "gains": {name: gains.plain() for name, gains in sets.items()},
            "nominal": {name: job.rig.fly(gains).plain() for name, gains in sets.items()},
            "held_out": {name: c.figures() for name, c in comparisons.items()},
            "attempts": [attempt.plain() for attempt in tuned.attempts],
        }
        pictures = {
            f"autotune-{name}.svg": comparison_picture(comparison, _TUNED_ON[name])
            for name, comparison in comparisons.items()
        }
        output = _write(job, text, figures, pictures)
    if arguments.json:
        print(json.dumps(figures))
        return 0
    _tell_comparison(job, figures, console)
    _tell_files(job, output, console)
    return 0


_TUNED_ON = {"nominal": "the nominal plant", "hardest": "the hardest relative"}
"""The plants on which the procedure is carried out, to compare with: the robot's own, and that of
the training plants which vibrates most, as an engineer would choose who knows the family."""


@dataclass(frozen=True)
class _Tuned:
    """What an optimiser found, and the procedure's gains to compare with."""

    procedures: dict[str, Gains]
    best: Attempt
    attempts: list[Attempt]
    plants: list[Plant]

    @property
    def gain_sets(self) -> dict[str, Gains]:
        return {**self.procedures, "optimiser": self.best.gains}


def _search(job: _Job, arguments: argparse.Namespace) -> _Tuned:
    rig = job.rig
    inertia = [joint.inertia for joint in job.controller.joints]

    def procedure(plant: Plant) -> Gains:
        return tune(inertia, lambda gains: rig.fly(gains, plant), lambda _: None)[-1].gains

    nominal = procedure(rig.plant)
    drawn = rig.relatives(arguments.seed, max(DRAWN, arguments.plants))
    plants = training(nominal, rig.fly, drawn, arguments.plants)
    procedures = {"nominal": nominal, "hardest": procedure(plants[0])}
    attempts: list[Attempt] = []
    with _bar("optimising", arguments.evaluations) as advance:

        def watch(attempt: Attempt) -> None:
            attempts.append(attempt)
            advance()

        best = optimise(
            nominal,
            lambda gains: score(gains, rig.fly, plants),
            arguments.evaluations,
            arguments.seed,
            watch,
        )
    return _Tuned(procedures, best, attempts, plants)


def _compare(job: _Job, arguments: argparse.Namespace, tuned: _Tuned) -> dict[str, Comparison]:
    """The optimiser's gains with each of the procedure's, on plants that none was tuned on."""
    plants = job.rig.relatives(_HELD_OUT_SEED + arguments.seed, arguments.held_out)
    with _bar("comparing", len(plants) * len(tuned.gain_sets)) as advance:
        flown = {
            name: fly_all(gains, job.rig.fly, plants, advance)
            for name, gains in tuned.gain_sets.items()
        }
    optimiser = flown.pop("optimiser")
    return {name: Comparison(procedure, optimiser) for name, procedure in flown.items()}


def _tell_comparison(job: _Job, figures: dict[str, Any], console: Console) -> None:
    held_out = figures["held_out"]
    by_set = {name: of["procedure"] for name, of in held_out.items()}
    by_set["optimiser"] = held_out["nominal"]["optimiser"]
    count = held_out["nominal"]["plants"]
    table = Table(title=f"{escape(job.title)}: {count} plants held out of the tuning")
    table.title_justify = "left"
    for title in ("", *(f"III-E on {words}" for words in _TUNED_ON.values()), "optimiser"):
        table.add_column(title, justify="right" if title else "left")
    for key in ("inertia_kgm2", "lambda", "gamma", "alpha"):
        title = "Mbar [kg m²]" if key == "inertia_kgm2" else key
        table.add_row(escape(title), *(_show(figures["gains"][name][key]) for name in by_set))
    for title, key, unit in (
        ("RMS error [mdeg], median", "median_rms_deg", 1e3),
        ("RMS error [mdeg], largest", "largest_rms_deg", 1e3),
        ("vibration, median", "median_vibration", 1.0),
        ("vibration, largest", "largest_vibration", 1.0),
        (f"plants with at most {VIBRATION_LIMIT:g}", "quiet", 1.0),
    ):
        table.add_row(escape(title), *(_show(of[key], unit) for of in by_set.values()))
    nominal = (figures["nominal"][name]["rms_deg"] for name in by_set)
    table.add_row(escape("nominal plant, RMS error [mdeg]"), *(_show(x, 1e3) for x in nominal))
    console.print(table)
    for name, words in _TUNED_ON.items():
        of = held_out[name]
        line = (
            f"beside III-E on {words}, the optimiser's error is smaller on "
            f"{of['share_won']:.0%} of the plants, {_show(of['mean_ratio'])} times in the "
            "geometric mean"
        )
        if of["both_quiet"]:
            line += (
                f"; on the {of['both_quiet']} where both are quiet: "
                f"{of['share_won_both_quiet']:.0%}, {_show(of['mean_ratio_both_quiet'])} times"
            )
        console.print(line, soft_wrap=True)


def _show(value: Any, unit: float = 1.0) -> str:
    if isinstance(value, list):
        return " ".join(_show(x, unit) for x in value)
    return "beyond bounds" if value is None else f"{unit * value:.4g}"


@contextmanager
def _bar(what: str, total: int) -> Iterator[Callable[[], None]]:
    """A progress bar on a terminal; gives what advances it."""
    shown = sys.stderr.isatty()
    steps = iter(track(range(total + 1), what, console=Console(stderr=True), disable=not shown))
    next(steps)
    yield lambda: (next(steps, None), None)[1]
    # A bar that isn't at its end would stay on the screen.
    for _ in steps:
        pass


@contextmanager
def _interruptible() -> Iterator[None]:
    """Ctrl-C ends with a line instead of a traceback; files are written whole at the end."""
    try:
        yield
    except KeyboardInterrupt:
        print("\nInterrupted: no specification was written.", file=sys.stderr)
        raise SystemExit(_INTERRUPTED) from None


def add_tuning(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers both commands."""
    tuning = commands.add_parser(
        "tune",
        help="carry out the paper's tuning procedure on a plant",
        description="Tunes a specification's gains by the paper's procedure III-E in closed loops "
        "of its generated C: raises Mbar, raises lambda, lowers gamma, lowers alpha, "
        "each until the error no longer falls or a joint vibrates. Tells each trial, and writes "
        "log, JSON, pictures and the tuned specification into build/plant/tuning/.",
        epilog="example: python -m plant tune controllers/puma3.toml --robot reference_flexible",
    )
    _add_common(tuning)
    tuning.set_defaults(run=_tune)
    automatic = commands.add_parser(
        "autotune",
        help="optimise the gains over random plants",
        description="Searches the gains with the least mean RMS error over random relatives of a "
        "plant, under the same limit of vibration as the last step of `tune`, and compares them "
        "with the procedure's gains on other random plants: those of `tune`, and those of the "
        "procedure on the relative that vibrates most.",
        epilog="example: python -m plant autotune controllers/puma3.toml --robot reference",
    )
    _add_common(automatic)
    automatic.add_argument(
        "--evaluations", type=_count(30), default=300, help="gain sets that are tried, 300"
    )
    automatic.add_argument(
        "--plants", type=_count(2), default=5, help="random plants that are tuned on, 5"
    )
    automatic.add_argument(
        "--held-out", type=_count(1), default=24, help="random plants for the comparison, 24"
    )
    automatic.add_argument("--seed", type=_count(0), default=0, help="of plants and search, 0")
    automatic.set_defaults(run=_autotune)


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "controller", type=Path, metavar="file", help="a specification, controllers/NAME.toml"
    )
    parser.add_argument(
        "--robot",
        help=f"one of {', '.join(robot_names())}, or a file; by the number of joints if not given",
    )
    parser.add_argument(
        "--output",
        type=Path,
        help="where to write the tuned specification; an existing file is left alone",
    )
    parser.add_argument(
        "--speed", type=_speed, default=1.0, help="how many times as fast, 1 by default"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def _count(least: int) -> Callable[[str], int]:
    """An integer of at least so much, for argparse."""

    def count(text: str) -> int:
        number = int(text)
        if not least <= number < 2**31:
            raise argparse.ArgumentTypeError(f"{text} is not an integer from {least} on")
        return number

    return count


def _speed(text: str) -> float:
    number = float(text)
    if not (math.isfinite(number) and number > 0.0):
        raise argparse.ArgumentTypeError(f"{text} is not greater than 0")
    return number
