"""``python -m codegen``: generate a controller's C, check what is committed, show presets."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from codegen.controller import Controller, load
from codegen.emit import (
    REPOSITORY,
    GeneratedFiles,
    differences,
    generate,
    write,
)
from codegen.literals import UnprintableError
from codegen.presets import LAW_PRESETS, ROBOT_PRESETS
from codegen.problems import SpecificationError
from codegen.reference import pages
from codegen.specification import json_schema

CONTROLLERS = REPOSITORY / "controllers"
GENERATED = REPOSITORY / "generated"
SCHEMA = CONTROLLERS / "specification.schema.json"


def _committed() -> list[Path]:
    """The specifications in controllers/, in the order of their names."""
    return sorted(CONTROLLERS.glob("*.toml"))


def _load_all(paths: Sequence[Path]) -> list[Controller]:
    """All controllers, or one error with what is wrong in any of them."""
    controllers, errors = [], []
    for path in paths:
        try:
            controllers.append(load(path))
        except SpecificationError as error:
            errors.append(error)
    if errors:
        raise UnusableSpecificationsError(errors)
    return controllers


class UnusableSpecificationsError(Exception):
    """Several specifications that can't be used."""

    def __init__(self, errors: Sequence[SpecificationError]) -> None:
        super().__init__("\n".join(map(str, errors)))


def _generate(arguments: argparse.Namespace, console: Console) -> int:
    # Every specification is read, and every file made, before the first one is written.
    generated = [generate(c) for c in _load_all(arguments.specification or _committed())]
    for files in generated:
        target = write(files, arguments.output)
        console.print(f"[bold]{files.controller}[/bold]: {_summary(files)} in {_shown(target)}/")
    return 0


def _summary(files: GeneratedFiles) -> str:
    lines = sum(text.count("\n") for name, text in files.files.items() if name != "manifest.json")
    return f"{len(files.files)} files, {lines} lines of C"


def _shown(path: Path) -> Path:
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


def _check(_: argparse.Namespace, console: Console) -> int:
    """Generates every committed controller twice and compares with what is committed."""
    controllers = _load_all(_committed())
    findings = []
    for controller in controllers:
        first, second = generate(controller), generate(controller)
        if first != second:
            findings.append(f"{controller.name}: two generations differ")
        findings += differences(first, GENERATED)
    names = {c.name for c in controllers}
    findings += [
        f"{path}: no specification in controllers/ makes this"
        for path in sorted(GENERATED.iterdir())
        if path.is_dir() and path.name not in names and not path.name.startswith(".")
    ]
    if not SCHEMA.exists() or SCHEMA.read_text(encoding="utf-8") != json_schema():
        findings.append(f"{SCHEMA}: differs; run `python -m codegen schema`")
    findings += [
        f"{path}: differs; run `python -m codegen reference`"
        for path, text in pages(GENERATED).items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    ]
    for finding in findings:
        console.print(finding, style="red", soft_wrap=True)
    if findings:
        console.print("Run `make codegen` and look at the difference; don't edit generated files.")
        return 1
    console.print(f"{len(controllers)} controllers: generated twice, no byte differs.")
    return 0


def _schema(_: argparse.Namespace, console: Console) -> int:
    SCHEMA.write_text(json_schema(), encoding="utf-8")
    console.print(f"{_shown(SCHEMA)} written")
    return 0


def _reference(_: argparse.Namespace, console: Console) -> int:
    for path, text in pages(GENERATED).items():
        path.write_text(text, encoding="utf-8")
        console.print(f"{_shown(path)} written")
    return 0


def _presets(_: argparse.Namespace, console: Console) -> int:
    table = Table("preset", "paper", "meaning", "fixes", "proposes")
    for preset in LAW_PRESETS.values():
        gains = (
            ", ".join(f"{k} = {v}" for k, v in g.items()) for g in (preset.fixed, preset.proposed)
        )
        table.add_row(preset.name, preset.equation, preset.meaning, *gains)
    console.print(table)
    for robot in ROBOT_PRESETS.values():
        console.print(f"[bold]{robot.name}[/bold]: {robot.source}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m codegen", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    generate_ = commands.add_parser("generate", help="write generated/NAME/ for specifications")
    generate_.add_argument(
        "specification", nargs="*", type=Path, help="TOML files (all of controllers/ by default)"
    )
    generate_.add_argument("--output", type=Path, default=GENERATED, help="directory to write to")
    generate_.set_defaults(run=_generate)
    check = commands.add_parser("check", help="compare generated/ with a fresh generation")
    check.set_defaults(run=_check)
    schema = commands.add_parser("schema", help="write the JSON Schema of specifications")
    schema.set_defaults(run=_schema)
    reference = commands.add_parser(
        "reference", help="write docs/specification.md and docs/c-api.md"
    )
    reference.set_defaults(run=_reference)
    presets = commands.add_parser("presets", help="list the presets of the paper")
    presets.set_defaults(run=_presets)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; returns the exit code: 0, 1 for differences, 2 for bad input."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options, Console(highlight=False)))
    except (
        SpecificationError,
        UnusableSpecificationsError,
        UnprintableError,
    ) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
