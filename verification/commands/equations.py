"""`python -m verification equations`: writes docs/equations.md, or says that it is stale."""

from __future__ import annotations

import argparse
import inspect
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from codegen.emit import REPOSITORY
from verification.commands.output import Output, shown
from verification.equations import EQUATIONS, SECTIONS, Equation, Links, Symbol, all_proofs, links
from verification.evidence import Evidence
from verification.symbolic import Proof

PAGE = REPOSITORY / "docs" / "equations.md"

_HEAD = """\
# The paper's equations

Every numbered equation of Jin, Kang, Chang and Lee (2017): where it is in the code, what checks it,
and how strong the evidence is. `.venv/bin/python -m verification equations` makes this page from
`verification/equations.py` and from the numbers that the law, the presets and the proofs carry
themselves; a test fails where it is stale, or names something that doesn't exist.

A *quantity* of codegen/law.py keeps its name in the generated C; those of the special cases are in
the C that they are compared by. A *proof* is one of computer algebra, in
[verification/symbolic.py](../verification/symbolic.py) or
[verification/special_cases/proofs.py](../verification/special_cases/proofs.py); a *certificate* is
found by one program and verified by another. Tests make both again. The word of evidence is about
what its brackets say, which may be less than the equation. An equation without a check says so.

Names: q, q_d, e = q_d - q are positions, reference and error, `ed` and `edd` rates of e; tau is the
torque, L the sample time and the delay, sig(x)^a = |x|^a sgn(x).
"""


class UnprovedError(Exception):
    """A proof doesn't hold, so that the page would claim what is wrong."""


ERRORS = (UnprovedError,)


@dataclass(frozen=True)
class Row:
    """An equation with all that the code says of it."""

    equation: Equation
    links: Links


def rows(equations: Iterable[Equation] = EQUATIONS) -> tuple[Row, ...]:
    """Equations with their links.

    Raises:
        UnprovedError: a proof doesn't hold.
    """
    proofs = all_proofs()
    for proof in proofs:
        if not proof.holds:
            raise UnprovedError(
                f"{proof.name} is not proved; see `python -m verification symbolic`"
            )
    return tuple(Row(equation, links(equation.number, proofs)) for equation in equations)


def file_of(symbol: Symbol) -> Path:
    """The source file of a symbol, from the root of the repository."""
    return Path(inspect.getfile(symbol)).relative_to(REPOSITORY)


def _link(path: Path | str) -> str:
    return f"[{path}](../{path})"


def _by_file(pairs: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Names with their files, each file once."""
    files: dict[str, list[str]] = {}
    for path, name in pairs:
        files.setdefault(path, []).append(f"`{name}`")
    yield from (f"{', '.join(names)} in {_link(path)}" for path, names in files.items())


def _symbols(symbols: Iterable[Symbol]) -> Iterator[str]:
    return _by_file((file_of(symbol).as_posix(), symbol.__qualname__) for symbol in symbols)


def _tests(tests: Iterable[str]) -> Iterator[str]:
    return _by_file((path, function) for path, function in (test.split("::") for test in tests))


def _names(proofs: Sequence[Proof]) -> str:
    # The sampled loop has one proof for each way to form its signals: one name for all.
    names = ("sampled_*" if p.name.startswith("sampled_") else p.name for p in proofs)
    return ", ".join(f"`{name}`" for name in dict.fromkeys(names))


def _code(row: Row) -> Iterator[str]:
    by_maker: dict[Symbol, list[str]] = {}
    for name, maker in row.links.quantities:
        by_maker.setdefault(maker, []).append(f"`{name}`")
    for maker, names in by_maker.items():
        word = "quantity" if len(names) == 1 else "quantities"
        yield f"{word} {', '.join(names)} of {', '.join(_symbols((maker,)))}"
    for preset in row.links.presets:
        yield f"preset `{preset}` in {_link('codegen/presets.py')}"
    yield from _symbols(row.equation.code)


def _checks(row: Row) -> Iterator[str]:
    if row.links.proofs:
        word = "proof" if len(row.links.proofs) == 1 else "proofs"
        yield f"{word} {_names(row.links.proofs)}"
    if row.equation.certified:
        yield "certificate by " + ", verified by ".join(_symbols(row.equation.certified))
    yield from _tests(row.equation.tests)
    yield from (f"`python -m verification {name}`" for name in row.equation.commands)
    if row.links.steps:
        word = "proof" if len(row.links.steps) == 1 else "proofs"
        yield f"a step of the {word} {_names(row.links.steps)}"


def _listed(title: str, lines: Sequence[str]) -> Iterator[str]:
    if len(lines) < 2:
        yield f"- {title}: {lines[0] if lines else '-'}"
    else:
        yield f"- {title}:"
        yield from (f"  - {line}" for line in lines)


def _word(evidence: Evidence | None) -> str:
    return evidence.value if evidence else "-"


def _entry(row: Row) -> Iterator[str]:
    equation = row.equation
    yield f"### ({equation.number})"
    yield ""
    yield equation.says
    yield ""
    yield from _listed("code", tuple(_code(row)))
    yield from _listed("checks", tuple(_checks(row)))
    yield f"- evidence: **{_word(equation.evidence)}** ({equation.finding})"
    yield ""


_CERTIFIED = (
    f"{Evidence.PROVED.value}, by certificate",
    "holds for the gains or the kernels that the entry names",
)
_NONE = (_word(None), "none: the entry says why")


def _kind(equation: Equation) -> tuple[str, str]:
    """The word for an equation's evidence, and what it means."""
    if equation.evidence is None:
        return _NONE
    if equation.evidence is Evidence.PROVED and equation.certified:
        return _CERTIFIED
    return equation.evidence.value, equation.evidence.meaning


def _summary() -> Iterator[str]:
    yield "| evidence | equations | what the word means |"
    yield "|---|---|---|"
    proved, *weaker = ((e.value, e.meaning) for e in Evidence)
    for kind in (proved, _CERTIFIED, *weaker, _NONE):
        found = [f"({equation.number})" for equation in EQUATIONS if _kind(equation) == kind]
        if found:
            yield f"| {kind[0]} | {' '.join(found)} | {kind[1]} |"
    yield ""


def page(of: Iterable[Row]) -> str:
    """docs/equations.md."""
    by_number = {row.equation.number: row for row in of}
    lines = [_HEAD, *_summary()]
    for section in SECTIONS:
        lines += [f"## {section.name}", ""]
        for equation in section.equations:
            lines += _entry(by_number[equation.number])
    return "\n".join(lines).rstrip("\n") + "\n"


def is_current(text: str, path: Path) -> bool:
    """Whether a file is what the command would write."""
    return path.is_file() and path.read_text(encoding="utf-8") == text


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command's own arguments."""
    parser.add_argument("--check", action="store_true", help="write nothing; 1 if it is stale")


def run(arguments: argparse.Namespace, output: Output) -> int:
    """Runs the command; see :mod:`verification.__main__`."""
    with output.status("computer algebra"):
        made = rows()
    text = page(made)
    current = is_current(text, PAGE)
    if not arguments.check:
        PAGE.write_text(text, encoding="utf-8")
    if not output.as_json:
        stale = "stale; write it with `python -m verification equations`"
        state = ("current" if current else stale) if arguments.check else "written"
        output.console.print(f"{shown(PAGE)}: {state}", markup=False)
    output.leave({"equations": [_plain(row) for row in made]}, "equations")
    return 1 if arguments.check and not current else 0


def _plain(row: Row) -> dict[str, object]:
    equation = row.equation
    return {
        "number": equation.number,
        "says": equation.says,
        "evidence": equation.evidence,
        "finding": equation.finding,
        "code": [f"{file_of(s).as_posix()}:{s.__qualname__}" for s in equation.code],
        "quantities": [name for name, _ in row.links.quantities],
        "presets": row.links.presets,
        "proofs": [proof.name for proof in row.links.proofs],
        "certified": [f"{file_of(s).as_posix()}:{s.__qualname__}" for s in equation.certified],
        "tests": equation.tests,
        "commands": equation.commands,
    }
