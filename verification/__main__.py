"""Checks the generated C, flies the paper's experiments, and writes the report."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from codegen.controller import Controller, load
from codegen.literals import UnprintableError
from codegen.problems import SpecificationError
from codegen.source import GenerationError
from plant.assembly import PlantError
from plant.closed_loop import ControllerError
from plant.controller import LayoutError
from plant.native import BUILD, CompilerError
from plant.robot import RobotError
from verification.accuracy import ARITHMETICS, PHASES, measure
from verification.certificates.sig_pow.kernel import KernelError
from verification.certificates.sig_pow.present import Verdict, shipped, verdict
from verification.chain.links import BLOCK_STEPS, blocks_of, chain
from verification.chain.present import failures, notes, table_of
from verification.equivalence import check_all, summary, variants
from verification.evidence import RESULTS, current_json, plain, write_json
from verification.experiments import (
    ALL,
    CONTROLLERS,
    beside_the_paper,
    conduct_all,
    improvements,
    rank_correlation,
)
from verification.figures import present as figures
from verification.figures.catalogue import BUILDERS
from verification.firmware import ToolError, board_names, load_board
from verification.paper import table_2
from verification.report.content import Results
from verification.report.page import write
from verification.report.processor import found
from verification.special_cases import present as special
from verification.special_cases.laws import CASES
from verification.symbolic import Proof, all_proofs

REPORT = BUILD / "report"
DEFAULT_STEPS = 100_000
CHAIN_STEPS = 1_000_000
REPORT_STEPS = 20_000
"""Of the report: 48 structures make about a million steps, in half a minute."""
LEAST_STEPS = 100
"""Fewer may hold no step that succeeds, and say nothing."""
NAMES = ("puma3", "puma6")
CHAIN_NAMES = (*NAMES, "puma3_fixed")
"""In fixed-point the chain has its last link: the bits on the targets."""

_BAD_INPUT = (
    SpecificationError,
    GenerationError,
    UnprintableError,
    RobotError,
    PlantError,
    LayoutError,
    CompilerError,
    ToolError,
    KernelError,
    OSError,
)


@contextmanager
def _bar(console: Console, says: str, total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar on standard error; yields what moves it on."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(says, total=total)
        yield lambda done: progress.advance(task, done)


def _shown(path: Path) -> Path:
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


def _leave(data: Any, name: str, as_json: bool, console: Console) -> None:
    """Writes a command's figures beside what it prints."""
    path = write_json(data, RESULTS / f"{name}.json")
    if as_json:
        print(path.read_text(encoding="utf-8"), end="")
    else:
        console.print(f"figures: {_shown(path)}")


# --- Commands ----------------------------------------------------------------------------------


def _proofs(progress: Console) -> tuple[Proof, ...]:
    with progress.status("computer algebra"):
        return all_proofs()


def _symbolic(arguments: argparse.Namespace, console: Console, progress: Console) -> int:
    proofs = _proofs(progress)
    if not arguments.json:
        for proof in proofs:
            verdict = "[green]proved[/green]" if proof.holds else "[red]NOT proved[/red]"
            console.print(f"{verdict}  {proof.equation:10} {escape(proof.statement)}")
            if not proof.holds:
                console.print(f"  residual: {proof.residual}", style="red", markup=False)
    _leave({"proofs": list(proofs)}, "symbolic", arguments.json, console)
    return 0 if all(proof.holds for proof in proofs) else 1


def _kernels(progress: Console, exhaustive: bool = False) -> list[Verdict]:
    with progress.status("interval arithmetic"):
        return [verdict(*kernel, exhaustive) for kernel in shipped()]


def _sig_pow(arguments: argparse.Namespace, console: Console, progress: Console) -> int:
    verdicts = _kernels(progress, arguments.exhaustive)
    if not arguments.json:
        for found in verdicts:
            console.print(f"{found.function} of {', '.join(found.controllers)}", markup=False)
            for s in found.statements:
                word = s.evidence.value if s.holds else f"NOT {s.evidence.value}"
                colour = "green" if s.holds else "red"
                console.print(f"  [{colour}]{word:10}[/{colour}]  {escape(s.says)}")
                console.print(f"              {s.bound}", style="dim", markup=False)
    holds = all(found.holds for found in verdicts)
    _leave({"holds": holds, "kernels": verdicts}, "sig_pow", arguments.json, console)
    return 0 if holds else 1


def _controllers(names: Sequence[str]) -> list[Controller]:
    return [load(CONTROLLERS / f"{name}.toml") for name in names]


def _equivalence(arguments: argparse.Namespace, console: Console, progress: Console) -> int:
    controllers = _controllers(arguments.controller or NAMES)
    total = sum(len(variants(c)) for c in controllers) * arguments.steps
    with _bar(progress, "steps of the C", total) as advance:
        results = check_all(controllers, arguments.steps, advance)
    summaries = [summary(c, results[c.name]) for c in controllers]
    if not arguments.json:
        table = Table(
            "controller", "laws", "steps", "violations", "torque in N m", "s - ed in rad/s"
        )
        table.caption = "worst deviation near a rig's signals; worst share of the bound, all steps"
        for s in summaries:
            table.add_row(
                s.controller,
                str(s.variants),
                f"{s.tally.steps:,}".replace(",", " "),
                str(s.violations),
                *(
                    f"{d.worst:.1e} {d.worst_share:.1%}"
                    for d in (s.torque_Nm, s.sliding_integral_rad_per_s)
                ),
            )
        console.print(table)
        for each in results.values():
            for result in each:
                for violation in result.violations:
                    console.print(
                        f"{result.controller}: {violation.steps} steps: {violation.example}",
                        style="red",
                        markup=False,
                    )
    _leave({"summaries": summaries, "variants": results}, "equivalence", arguments.json, console)
    return 0 if all(s.violations == 0 for s in summaries) else 1


def _chain(arguments: argparse.Namespace, console: Console, progress: Console) -> int:
    controllers = _controllers(arguments.controller or CHAIN_NAMES)
    boards = [load_board(name) for name in arguments.board or board_names()]
    blocks = blocks_of(arguments.steps)
    total = blocks.count * blocks.steps * len(boards) * len(controllers)
    with _bar(progress, "steps on the targets", total) as advance:
        result = chain(controllers, boards, blocks, advance)
    if not arguments.json:
        console.print(table_of(result))
        for note in notes():
            console.print(note, markup=False)
        for failure in failures(result):
            console.print(failure, style="red", markup=False)
    _leave({"holds": result.holds, **plain(result)}, "chain", arguments.json, console)
    return 0 if result.holds else 1


def _special_cases(arguments: argparse.Namespace, console: Console, progress: Console) -> int:
    names = arguments.controller or special.NAMES
    with _bar(progress, "special cases", len(names) * len(CASES)) as advance:
        result = special.examine(names, arguments.ticks, advance=advance)
    if not arguments.json:
        console.print(special.table_of(result))
        console.print()
        console.print(special.roundings_of(result))
        for note in special.notes(result):
            console.print(note, markup=False)
        for failure in special.failures(result):
            console.print(failure, style="red", markup=False)
    _leave(special.figures(result), "special_cases", arguments.json, console)
    return 0 if result.holds else 1


def _experiments(arguments: argparse.Namespace, console: Console, progress: Console) -> int:
    with _bar(progress, "closed loops", len(ALL)) as advance:
        outcomes = conduct_all(advance=lambda _: advance(1))
    rows = beside_the_paper(outcomes)
    if not arguments.json:
        table = Table("row", "RMS in deg, joints 1 2 3", "paper in deg", "ratio")
        for row in rows:
            table.add_row(
                row.experiment,
                " ".join(f"{v:.4f}" for v in row.ours_deg),
                " ".join(f"{v:.4f}" for v in row.paper_deg),
                " ".join(f"{v:.2f}" for v in row.ratio),
            )
        console.print(table)
    data = {
        "experiments": [outcome.summary() for outcome in outcomes.values()],
        "table_2": [{**plain(row), "ratio": row.ratio} for row in rows],
        "rms_over_exp08": improvements(rows),
        "rank_correlation": rank_correlation(rows),
    }
    _leave(data, "experiments", arguments.json, console)
    return 0


def _accuracy(arguments: argparse.Namespace, console: Console, progress: Console) -> int:
    total = len(table_2()) * len(ARITHMETICS)
    with _bar(progress, "rows of Table II", total) as advance:
        result = measure(phases=arguments.phases, advance=advance)
    if not arguments.json:
        table = Table("row", *ARITHMETICS.values())
        table.caption = (
            f"RMS in deg, joints 1 2 3; mean over {result.phases} encoder phases; difference from "
            "float64 in per cent"
        )
        for row in table_2():
            cells = [cell for cell in result.cells if cell.row == row]
            table.add_row(
                row,
                *(
                    "\n".join(
                        f"{rms:.5f} {100 * off:+.1f}"
                        for rms, off in zip(cell.rms_deg, cell.difference, strict=True)
                    )
                    for cell in cells
                ),
            )
        console.print(table)
        for name, says in ARITHMETICS.items():
            console.print(
                f"{says}: {result.mean_difference[name]:+.2%} from float64 over all cells, at most "
                f"{result.largest_difference[name]:.2%} in one"
            )
    _leave(plain(result), "accuracy", arguments.json, console)
    return 0


def _figures(arguments: argparse.Namespace, console: Console, progress: Console) -> int:
    names = arguments.only or list(BUILDERS)
    with _bar(progress, "figures", len(names)) as advance:
        made = figures.make(names, RESULTS / "figures", advance)
    if not arguments.json:
        console.print(figures.table_of(made))
        console.print(f"page: {_shown(RESULTS / 'figures' / 'index.html')}")
    _leave(figures.numbers_of(made), "figures", arguments.json, console)
    return 0


def _report(arguments: argparse.Namespace, console: Console, progress: Console) -> int:
    controllers = _controllers(NAMES)
    proofs = _proofs(progress)
    kernels = _kernels(progress)
    with _bar(progress, "closed loops", len(ALL)) as advance:
        outcomes = conduct_all(advance=lambda _: advance(1))
    total = sum(len(variants(c)) for c in controllers) * arguments.steps
    with _bar(progress, "steps of the C", total) as advance:
        equivalence = check_all(controllers, arguments.steps, advance)
    with progress.status("pictures"):
        page = write(
            Results(
                outcomes,
                equivalence,
                proofs,
                arguments.steps,
                found(),
                kernels,
                current_json(RESULTS / "accuracy.json"),
            ),
            arguments.output,
        )
    console.print(f"report: {_shown(page)}")
    good = (
        all(p.holds for p in proofs)
        and all(k.holds for k in kernels)
        and all(r.holds for e in equivalence.values() for r in e)
    )
    if not good:
        console.print("Some checks failed; the report says which.", style="red")
    return 0 if good else 1


# --- Command line ------------------------------------------------------------------------------


def _steps(text: str) -> int:
    if not text.isdecimal() or not LEAST_STEPS <= int(text) <= 10**9:
        raise argparse.ArgumentTypeError(
            f"a number of steps from {LEAST_STEPS} to 10^9, not {text!r}"
        )
    return int(text)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m verification", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)

    def command(name: str, run: Callable[..., int], says: str) -> argparse.ArgumentParser:
        added = commands.add_parser(name, help=says, description=says)
        added.set_defaults(run=run)
        return added

    def with_json(added: argparse.ArgumentParser) -> None:
        added.add_argument("--json", action="store_true", help="print JSON instead of a table")

    def with_steps(added: argparse.ArgumentParser, default: int) -> None:
        added.add_argument(
            "--steps",
            type=_steps,
            default=default,
            help=f"random steps for each structure of the law, {default} by default",
        )

    report = command("report", _report, "run everything and write build/report/index.html")
    with_steps(report, REPORT_STEPS)
    report.add_argument("--output", type=Path, default=REPORT, help="directory of the report")

    equivalence = command("equivalence", _equivalence, "the generated C against the law in double")
    with_steps(equivalence, DEFAULT_STEPS)
    equivalence.add_argument(
        "--controller", action="append", metavar="NAME", help="of controllers/; again for more"
    )
    with_json(equivalence)

    says = "the exact law, CasADi in double, the C on the host and on each emulated target"
    linked = command("chain", _chain, says)
    linked.add_argument(
        "--steps",
        type=_steps,
        default=CHAIN_STEPS,
        help=f"random steps on each target, in blocks of {BLOCK_STEPS} (default: %(default)s)",
    )
    linked.add_argument(
        "--board", action="append", choices=board_names(), help="one of them; again for more"
    )
    linked.add_argument(
        "--controller", action="append", metavar="NAME", help="of controllers/; again for more"
    )
    with_json(linked)

    says = "each special case of the law, written by itself, against the inclusive C: the bits"
    cases = command("special-cases", _special_cases, says)
    special.add_arguments(cases)
    with_json(cases)

    says = "Table II flown in float32, float64 and fixed-point, several times each"
    accuracy = command("accuracy", _accuracy, says)
    accuracy.add_argument(
        "--phases", type=int, default=PHASES, help="encoder phases (default: %(default)s)"
    )
    with_json(accuracy)

    says = "the error of sig_pow for every float and every exponent, proved and checked"
    kernel = command("sig-pow", _sig_pow, says)
    kernel.add_argument(
        "--exhaustive",
        action="store_true",
        help="also run the compiled integer halves at every argument",
    )
    with_json(kernel)
    paper = command(
        "figures", _figures, "the paper's figures as SVG and PDF, and as a page to zoom"
    )
    figures.add_arguments(paper)
    with_json(paper)
    with_json(command("experiments", _experiments, "Table II and more, flown on the plant"))
    with_json(command("symbolic", _symbolic, "the proofs in computer algebra"))
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; returns 0, 1 where a check failed, 2 for bad input."""
    options = _parser().parse_args(arguments)
    progress = Console(stderr=True)
    try:
        return int(options.run(options, Console(highlight=False, soft_wrap=False), progress))
    except ControllerError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except _BAD_INPUT as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
