"""docs/equations.md: all equations, nothing that doesn't exist, no word that isn't earned."""

from __future__ import annotations

import ast
import functools
import operator
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from importlib import import_module
from pathlib import Path

import pytest

from codegen.emit import REPOSITORY
from verification import equations as eq
from verification import symbolic
from verification.__main__ import COMMANDS, main
from verification.commands import equations as command
from verification.commands.equations import Row, file_of, is_current, page, rows
from verification.equations import COUNT, EQUATIONS, Equation, numbers, proved_by
from verification.error_dynamics.model import finite_time_beta
from verification.evidence import Evidence


@functools.cache
def all_rows() -> tuple[Row, ...]:
    return rows()


@functools.cache
def functions_of(path: str) -> frozenset[str]:
    tree = ast.parse((REPOSITORY / path).read_text(encoding="utf-8"))
    return frozenset(node.name for node in tree.body if isinstance(node, ast.FunctionDef))


def complaints(row: Row) -> list[str]:
    """What an entry names that doesn't exist, or claims that isn't there."""
    equation, found = row.equation, []
    for test in equation.tests:
        path, _, function = test.partition("::")
        if not function.startswith("test_"):
            found.append(f"{test} is no test")
        elif not (REPOSITORY / path).is_file() or function not in functions_of(path):
            found.append(f"no test {test}")
    for symbol in (*equation.code, *equation.certified):
        module = import_module(symbol.__module__)
        try:
            same = operator.attrgetter(symbol.__qualname__)(module) is symbol
        except AttributeError:
            same = False
        if not same or not (REPOSITORY / file_of(symbol)).is_file():
            found.append(f"no {symbol.__qualname__} in {symbol.__module__}")
    found += [f"no command {name}" for name in equation.commands if name not in COMMANDS]
    if not all(proof.holds for proof in row.links.proofs):
        found.append("a proof doesn't hold")
    if not equation.finding or not equation.says:
        found.append("says nothing")
    if equation.evidence is Evidence.PROVED:
        # Who is proved by certificate names maker, checker, and the tests that make it again.
        if not row.links.proofs and not (len(equation.certified) == 2 and equation.tests):
            found.append("proved by nothing")
    elif equation.evidence is not None and not equation.tests:
        found.append(f"{equation.evidence.value} by nothing")
    return found


def test_every_equation_is_there_once_and_in_order() -> None:
    assert [equation.number for equation in EQUATIONS] == list(range(1, COUNT + 1))
    assert COUNT == 62


@pytest.mark.parametrize("number", range(1, COUNT + 1))
def test_all_that_is_named_exists_and_every_word_is_earned(number: int) -> None:
    assert complaints(all_rows()[number - 1]) == []


def _missing() -> None:
    """A function that its module doesn't have under this name."""


_missing.__qualname__ = "nobody"

_WRONG: dict[str, tuple[int, Callable[[Equation], Equation], str]] = {
    "test": (1, lambda e: replace(e, tests=("tests/plant/test_model.py::test_x",)), "no test"),
    "file": (1, lambda e: replace(e, tests=("tests/plant/test_x.py::test_x",)), "no test"),
    "helper": (1, lambda e: replace(e, tests=("tests/plant/test_model.py::x",)), "is no test"),
    "symbol": (1, lambda e: replace(e, code=(_missing,)), "no nobody in"),
    "command": (31, lambda e: replace(e, commands=("prove-it",)), "no command"),
    "proved": (45, lambda e: replace(e, evidence=Evidence.PROVED), "proved by nothing"),
    "step only": (29, lambda e: replace(e, evidence=Evidence.PROVED), "proved by nothing"),
    "no checker": (18, lambda e: replace(e, certified=e.certified[:1]), "proved by nothing"),
    "sampled": (1, lambda e: replace(e, tests=()), "sampled by nothing"),
}


@pytest.mark.parametrize("name", _WRONG)
def test_a_wrong_entry_is_refused(name: str) -> None:
    number, change, says = _WRONG[name]
    row = all_rows()[number - 1]
    assert any(says in c for c in complaints(replace(row, equation=change(row.equation))))


def test_the_page_is_current() -> None:
    assert is_current(page(all_rows()), command.PAGE), (
        "write it with `python -m verification equations`"
    )


def test_a_change_makes_the_page_stale(tmp_path: Path) -> None:
    text = page(all_rows())
    other = tmp_path / "equations.md"
    assert not is_current(text, other)
    other.write_text(text, encoding="utf-8")
    assert is_current(text, other)
    other.write_text(text.replace("### (62)", "### (63)"), encoding="utf-8")
    assert not is_current(text, other)


def test_the_command_writes_and_checks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    written = tmp_path / "equations.md"
    monkeypatch.setattr(command, "PAGE", written)
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    assert main(["equations", "--check"]) == 1
    assert "stale" in capsys.readouterr().out
    assert not written.exists()
    assert main(["equations"]) == 0
    assert main(["equations", "--check"]) == 0
    assert "stale" not in capsys.readouterr().out


def test_a_proof_that_does_not_hold_stops_the_page(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = symbolic.closed_loop(lambda t: symbolic.inclusive_law(t) + symbolic.M)
    assert not broken.holds
    monkeypatch.setattr(command, "all_proofs", lambda: (broken,))
    assert main(["equations", "--check"]) == 2
    assert "closed_loop is not proved" in capsys.readouterr().err


def test_links_in_the_page_lead_to_files() -> None:
    text = page(all_rows())
    links = {part.split(")")[0] for part in text.split("](../")[1:]}
    assert len(links) > 20
    assert all((REPOSITORY / link).is_file() for link in links)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(31)", {31}),
        ("(9)(10)", {9, 10}),
        ("(60)-(62)", {60, 61, 62}),
        ("", set()),
        ("III-C4", set()),
    ],
)
def test_numbers_are_read(text: str, expected: set[int]) -> None:
    assert numbers(text) == expected


def test_what_the_code_numbers_is_found() -> None:
    found = {row.equation.number: row.links for row in all_rows()}
    assert [name for name, _ in found[17].quantities] == ["damping", "stiffness", "restoring"]
    assert [maker.__name__ for _, maker in found[10].quantities] == ["hsia"]
    assert [name for name, _ in found[43].quantities] == ["filtered_torque"]
    assert found[41].presets == ("terminal-sliding",)
    assert [proof.name for proof in found[30].proofs] == ["ideal_velocity"]
    assert [proof.name for proof in found[29].steps] == ["ideal_velocity"]
    # Nothing that the code numbers is lost.
    numbered = frozenset().union(*map(proved_by, eq.all_proofs()))
    assert numbered == {number for number, links in found.items() if links.proofs}


def test_the_exponents_of_appendix_a_are_one_pair() -> None:
    """(46)(47) and (54)-(56), exactly: rho1 is beta, rho2 is alpha."""
    for k in range(1, 101):
        alpha = Fraction(k, 101)
        rho1 = finite_time_beta(alpha)
        rho2 = 2 * rho1 / (1 + rho1)
        assert rho2 == alpha
        assert rho1 == rho2 / (2 - rho2)
        assert 0 < rho1 < 1
        assert 0 < rho2 < 1
    # Beyond the lemma's range the pair leaves it on both sides at once.
    assert finite_time_beta(Fraction(1)) == 1
    assert finite_time_beta(Fraction(0)) == 0
