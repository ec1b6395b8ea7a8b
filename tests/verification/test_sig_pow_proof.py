"""sig_pow's bounds are proved, and neither proof nor checker accepts a kernel that is damaged."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

from codegen.rendering import environment
from codegen.sig_pow import tables
from codegen.sig_pow_precise import precise_tables
from plant.native import GENERATED
from verification import __main__ as command_line
from verification.certificates.sig_pow import check, exhaustive
from verification.certificates.sig_pow.kernel import (
    PRECISE,
    STANDARD,
    GeneratedKernel,
    KernelError,
    read,
)
from verification.certificates.sig_pow.present import checked, shipped, verdict
from verification.certificates.sig_pow.prove import (
    PER_UNIT,
    PIECES,
    Proof,
    at_most_power_of_two,
    certificate,
    prove,
)
from verification.evidence import Evidence

PUMA3 = GENERATED / "puma3"


@pytest.fixture(scope="session")
def standard() -> Proof:
    return prove(read(STANDARD, PUMA3))


@pytest.fixture(scope="session")
def precise(tmp_path_factory: pytest.TempPathFactory) -> Proof:
    directory = tmp_path_factory.mktemp("precise")
    for name in (PRECISE.header, PRECISE.source):
        template = environment().get_template(f"{name}.j2")
        text = template.render(banner="/* A test's. */", precise_tables=precise_tables())
        (directory / name).write_text(text, encoding="utf-8")
    return prove(read(PRECISE, directory))


@dataclass(frozen=True)
class Case:
    """A certificate and the C that it is of."""

    certificate: dict[str, Any]
    header: str
    source: str

    def complaint(self) -> str | None:
        """The first thing that the checker finds wrong."""
        return next(check.complaints(self.certificate, self.header, self.source), None)


@pytest.fixture(scope="session")
def case(standard: Proof) -> Case:
    made = json.loads(json.dumps(certificate(standard)))
    return Case(made, *((PUMA3 / n).read_text("utf-8") for n in (STANDARD.header, STANDARD.source)))


def failed(proof: Proof) -> set[str]:
    return {s.name for s in proof.statements if not s.holds}


# The proof


def test_every_generated_kernel_is_proved() -> None:
    found = list(shipped())
    assert {name for names, _ in found for name in names} >= {"puma3", "puma6"}
    for names, generated in found:
        result = verdict(names, generated, every=False)
        assert result.holds, [s for s in result.statements if not s.holds]
        assert {s.evidence for s in result.statements} == {Evidence.PROVED}
        assert len({s.name for s in result.statements}) == len(result.statements)


def test_the_precise_kernel_is_proved(precise: Proof) -> None:
    assert precise.holds, failed(precise)
    _, statement = checked(precise)
    assert statement.holds, statement.bound


def test_the_proof_is_of_the_generators_bounds(standard: Proof, precise: Proof) -> None:
    for proof, bounds in ((standard, tables().bounds), (precise, precise_tables().bounds)):
        stated = proof.generated.stated
        assert float(stated.ulp) == bounds.ulp
        assert proof.composition.ulp <= Fraction(bounds.ulp)
        assert proof.composition.relative / 2**24 <= Fraction(bounds.relative)
        assert at_most_power_of_two(Fraction(bounds.relative), stated.relative_log2)


def test_the_bounds_are_no_wider_than_needed(standard: Proof, precise: Proof) -> None:
    assert standard.composition.ulp > 3.9
    assert precise.composition.ulp > 1.85


@pytest.mark.parametrize("name", ["standard", "precise"])
def test_enclosures_hold_at_single_arguments(name: str, request: pytest.FixtureRequest) -> None:
    # Quadratic less function by mpmath, from the words as the header describes them.
    proof: Proof = request.getfixturevalue(name)
    rng = np.random.default_rng(1)
    g = proof.generated
    for stage, words, half in (
        (g.kernel.log2, g.log2, proof.log2),
        (g.kernel.exp2, g.exp2, proof.exp2),
    ):
        tightest = 1.0
        for argument in rng.integers(0, 1 << stage.fraction_bits, 500).tolist():
            segment = argument // stage.width
            d = argument - stage.origin(segment)
            word = words[segment]
            slope = (word % 2**32 + 2**31) % 2**32 - 2**31
            c = word % (1 << stage.curvature_bits)
            high = ((word >> 32) + 2**31) % 2**32 - 2**31
            constant = Fraction(high * 2**32 + (word % 2**32 if stage.tied else 0), 2**32)
            value = constant / (1 << stage.extra_bits) - stage.added
            value += Fraction(d * slope, 2**32)
            value += stage.sign * Fraction(c * d * d, 1 << stage.curvature_scale)
            with mpmath.workprec(100):
                x = (mpmath.mpf(argument) + float(stage.argument_shift)) / 2**stage.fraction_bits
                exact = mpmath.log(1 + x, 2) if stage is g.kernel.log2 else mpmath.power(2, x) - 1
                exact = exact * 2**stage.fraction_bits - argument
                distance = mpmath.mpf(value.numerator) / value.denominator - exact
                piece = argument * PIECES >> stage.fraction_bits
                above = half.high[piece] - float(distance) * PER_UNIT
                below = float(distance) * PER_UNIT - half.low[piece]
            assert above >= 0
            assert below >= 0
            tightest = min(tightest, above / PER_UNIT, below / PER_UNIT)
        assert tightest < 2e-3


def test_the_exponents_rounding_is_rounded_up(standard: Proof) -> None:
    stated = replace(standard.generated.stated, exponent_rounding=Fraction("0.0027"))
    assert failed(prove(replace(standard.generated, stated=stated))) == {"exponent_rounding"}


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"ulp": Fraction(4)}, "ulp"),
        ({"relative_log2": Fraction("-21.77")}, "relative"),
    ],
)
def test_a_better_bound_than_the_kernels_is_not_proved(
    standard: Proof, change: dict[str, Fraction], name: str
) -> None:
    stated = replace(standard.generated.stated, **change)
    assert name in failed(prove(replace(standard.generated, stated=stated)))


def damaged(words: tuple[int, ...], segment: int, change: int) -> tuple[int, ...]:
    return (*words[:segment], (words[segment] + change) % 2**64, *words[segment + 1 :])


@pytest.mark.parametrize("half", ["log2", "exp2"])
@pytest.mark.parametrize("segment", [0, 63])
@pytest.mark.parametrize("change", [-2 << 32, 3, 1 << 20])
def test_a_damaged_table_is_not_proved(
    standard: Proof, half: str, segment: int, change: int
) -> None:
    words = damaged(getattr(standard.generated, half), segment, change)
    whole = standard.generated
    generated = replace(whole, log2=words) if half == "log2" else replace(whole, exp2=words)
    assert failed(prove(generated))


# The C


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        (STANDARD.header, "magnitude >> 18u", "magnitude >> 17u"),
        (STANDARD.header, "log2_slope -", "log2_slope +"),
        (STANDARD.header, "& 0x1FFFFu", "& 0xFFFFu"),
        (STANDARD.header, "return x * multiplier;", "return multiplier * x;"),
        (STANDARD.header, "float tdc_sig_pow(", "float tdc_sig_power("),
        (STANDARD.header, "ulp", "units"),
        (STANDARD.source, "[64]", "[63]"),
        (STANDARD.source, "0x8100000071512FB6u", "0x8100000071512FB6"),
        (STANDARD.source, "tdc_sig_pow_segments[", "segments["),
    ],
)
def test_another_c_is_refused(file: str, old: str, new: str, tmp_path: Path) -> None:
    for name in (STANDARD.header, STANDARD.source):
        text = (PUMA3 / name).read_text("utf-8")
        assert name != file or old in text
        (tmp_path / name).write_text(text.replace(old, new) if name == file else text, "utf-8")
    with pytest.raises(KernelError):
        read(STANDARD, tmp_path)


def test_no_kernel_at_all_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(KernelError):
        list(shipped(tmp_path))


def computed(generated: GeneratedKernel) -> dict[str, exhaustive.Words]:
    """Both halves' corrected fractions at every argument, in numpy's integers."""
    found = {}
    count = np.arange(exhaustive.COUNT, dtype=np.int64)
    for name, sign, argument in (("log2", -1, 2 * count), ("exp2", 1, count)):
        table = np.array(getattr(generated, name), np.uint64).view(np.int64)
        stage = getattr(generated.kernel, name)
        segment = argument // stage.width
        word = table[segment]
        d = argument - (segment + (segment % 2 if name == "log2" else 0)) * stage.width
        slope = ((word & 0xFFFF_FFFF) ^ 0x8000_0000) - 0x8000_0000
        sums = word + d * (slope + sign * (word & 0xFF) * d)
        found[name] = argument + (sums >> 32) - stage.added
    return found


def test_every_argument_is_within_the_bounds(standard: Proof) -> None:
    for name, values in computed(standard.generated).items():
        stage, half = getattr(standard.generated.kernel, name), getattr(standard, name)
        error = exhaustive.errors(stage, values)
        assert exhaustive.inside(stage, half, error)
        # One integer that is off by two is found among eight million.
        worst = int(error.argmax())
        error[worst] += 2
        assert not exhaustive.inside(stage, half, error)
        error[worst] -= 4
        assert error.min() > -1.9


# The checker


def test_the_checker_accepts_what_is_undamaged(case: Case) -> None:
    assert case.complaint() is None


def in_both(case: Case, half: str, segment: int, change: int) -> Case:
    """A word changed in the C and in the certificate alike."""
    made = copy.deepcopy(case.certificate)
    old = made[half]["words"][segment]
    new = f"{(int(old, 16) + change) % 2**64:016X}"
    made[half]["words"][segment] = new
    assert case.source.count(f"0x{old}u") == 1
    return replace(case, certificate=made, source=case.source.replace(f"0x{old}u", f"0x{new}u"))


def in_certificate(case: Case, change: Callable[[dict[str, Any]], object]) -> Case:
    made = copy.deepcopy(case.certificate)
    change(made)
    return replace(case, certificate=made)


def put(value: object, *path: str | int) -> Callable[[dict[str, Any]], None]:
    """A change that puts a value at a place of a certificate."""

    def change(made: dict[str, Any]) -> None:
        at(made, path[:-1])[path[-1]] = value

    return change


def add(value: int, *path: str | int) -> Callable[[dict[str, Any]], None]:
    """A change that adds to a number of a certificate."""

    def change(made: dict[str, Any]) -> None:
        at(made, path[:-1])[path[-1]] += value

    return change


def without(*path: str | int) -> Callable[[dict[str, Any]], None]:
    """A change that leaves something out."""

    def change(made: dict[str, Any]) -> None:
        at(made, path[:-1]).pop(path[-1])

    return change


def apply(edit: Callable[[Any], None], *path: str) -> Callable[[dict[str, Any]], None]:
    """A change of one list."""
    return lambda made: edit(at(made, path))


def at(made: Any, path: tuple[str | int, ...]) -> Any:
    for key in path:
        made = made[key]
    return made


def certificate_changes() -> Iterator[tuple[str, Callable[[dict[str, Any]], None]]]:
    """Damages of the certificate alone, each with a name."""
    for half in ("log2", "exp2"):
        for piece in (0, 1, 20, 60):
            yield f"{half} low of {piece}", add(64, half, "low", piece)
            yield f"{half} high of {piece}", add(-64, half, "high", piece)
        for key in ("words", "low", "high"):
            yield f"{half} without one of {key}", without(half, key, -1)
            yield f"{half} without {key}", without(half, key)
        yield f"{half} high wider", apply(widen, half, "high")
        yield f"{half} swapped", apply(swap, half, "words")
    for key in ("ulp_hundredths", "exact_ulp_hundredths", "relative_hundredths_of_2^-24"):
        yield f"{key} less", add(-1, key)
        yield f"no {key}", without(key)
    yield "ulp more than stated", put(404, "ulp_hundredths")
    for per_unit in (0, 2048, 4000, 8192):
        yield f"per {per_unit}", put(per_unit, "per_unit")
    for name in ("tdc_sig_pow_precise", "powf", None):
        yield f"function {name}", put(name, "function")
    yield "another body", put("0" * 64, "body_sha256")
    for key in ("ulp", "relative_log2", "exponent_rounding"):
        yield f"stated {key}", put("9", "stated", key)


def mutants(case: Case) -> Iterator[tuple[str, Case]]:
    """Damaged certificates, tables and headers, each with a name."""
    for half in ("log2", "exp2"):
        for segment in (0, 1, 2, 5):
            for change in (1 << 32, -1 << 32, 1, -1, 1 << 11, -1 << 11, 1 << 24, 1 << 31):
                yield f"{half} {segment} {change:+}", in_both(case, half, segment, change)
    for name, edit in certificate_changes():
        yield name, in_certificate(case, edit)
    for old, new in (
        ("4.03 ulp", "4.00 ulp"),
        ("2^-21.75", "2^-21.80"),
        ("0.0028 |log2", "0.0027 |log2"),
        ("magnitude >> 18u", "magnitude >> 17u"),
        ("126u * 0x800000u", "127u * 0x800000u"),
    ):
        assert old in case.header
        yield f"header {new}", replace(case, header=case.header.replace(old, new))
    first = "{0x8100000071512FB6u, 0x00800000B1713B7Cu},"
    assert first in case.source
    yield "a segment less", replace(case, source=case.source.replace(first, ""))
    yield "a word less", replace(case, source=case.source.replace("0x00800000B1713B7Cu", ""))
    yield "a bit in the C", replace(case, source=case.source.replace("3B7Cu", "3B7Du"))


def widen(bounds: list[int]) -> None:
    bounds[:] = [bound + PER_UNIT // 8 for bound in bounds]


def swap(words: list[str]) -> None:
    words[3], words[4] = words[4], words[3]


def test_the_checker_rejects_every_damage(case: Case) -> None:
    survivors, count = [], 0
    for name, mutant in mutants(case):
        count += 1
        if mutant.complaint() is None:
            survivors.append(name)
    assert survivors == []
    assert count >= 100


# The command


def test_the_command_leaves_its_statements(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    assert command_line.main(["sig-pow", "--json"]) == 0
    printed = capsys.readouterr().out
    left = json.loads((tmp_path / "sig_pow.json").read_text("utf-8"))
    assert left == json.loads(printed)
    assert left["holds"]
    (kernel, *_) = left["kernels"]
    assert {s["name"] for s in kernel["statements"]} >= {"ulp", "relative", "certificate"}
    text = [(PUMA3 / name).read_text("utf-8") for name in (STANDARD.header, STANDARD.source)]
    assert list(check.complaints(kernel["certificate"], *text)) == []


def test_the_command_fails_where_a_bound_is_not_proved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = tmp_path / "generated" / "puma3"
    directory.mkdir(parents=True)
    for name in (STANDARD.header, STANDARD.source):
        text = (PUMA3 / name).read_text("utf-8")
        (directory / name).write_text(text.replace("4.03 ulp", "3.99 ulp"), "utf-8")
    monkeypatch.setattr("verification.commands.output.RESULTS", tmp_path)
    monkeypatch.setattr("verification.commands.sig_pow.shipped", lambda: shipped(directory.parent))
    assert command_line.main(["sig-pow"]) == 1
