"""Certificates are verified, damaged ones are not, and the checker's formulas are the dynamics'."""

from __future__ import annotations

import ast
import copy
import json
import math
import random
import sys
from collections.abc import Callable, Iterator
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import pytest

from verification.certificates.error_dynamics import check
from verification.certificates.error_dynamics.prove import NotProvedError, certificate
from verification.error_dynamics.model import Parameters, parameters

NAMES = ("KD", "KP", "alpha", "beta")
FACES = ("e=1", "v=1", "v=-1")
Made = dict[str, Any]


def made_of(p: Parameters) -> Made:
    made: Made = json.loads(json.dumps(certificate(p)))
    return made


def gains(p: Parameters) -> dict[str, Fraction]:
    return {name: getattr(p, name) for name in NAMES}


def complaint(made: Any, p: Parameters) -> str | None:
    return next(check.complaints(made, gains(p)), None)


PAPER = parameters(20, 100, ".8", "finite-time")
LINEAR = parameters(25, 100, 1, 1)


@pytest.fixture(scope="module")
def made() -> Made:
    return made_of(PAPER)


# Valid ones


@pytest.mark.parametrize("alpha", [".98", ".95", ".8", ".6", ".5"])
def test_the_papers_gains_are_verified(alpha: str) -> None:
    p = parameters(20, 100, alpha, "finite-time")
    assert complaint(made_of(p), p) is None


@pytest.mark.parametrize("seed", range(12))
def test_random_gains_are_verified(seed: int) -> None:
    rng = random.Random(seed)
    KD = Fraction(round(10 ** rng.uniform(0, 2) * 100), 100)
    KP = Fraction(round(10 ** rng.uniform(0, 3) * 100), 100)
    alpha = Fraction(rng.randint(20, 970), 1000)
    p = parameters(KD, KP, alpha, "finite-time")
    assert complaint(made_of(p), p) is None


@pytest.mark.parametrize("KD", ["3", "19.999", "20", "20.001", "250"])
def test_the_linear_dynamics_is_verified(KD: str) -> None:
    p = parameters(KD, 100, 1, 1)
    made = made_of(p)
    assert complaint(made, p) is None
    # No quadratic function falls faster than the slower motion.
    damping = float(KD)
    slower = damping / 2 - math.sqrt(max(damping**2 / 4 - 100, 0.0))
    assert 0.89 * 2 * slower < float(Fraction(made["c"])) <= 2 * slower


def test_no_certificate_off_the_pairs() -> None:
    for alpha, beta in ((".95", ".95"), ("1.2", "1.5"), ("0", "0")):
        with pytest.raises(NotProvedError):
            certificate(parameters(20, 100, alpha, beta))


# The checker's formulas and intervals


def derivative_along_the_dynamics(p: Parameters, delta: Fraction, e: Any, v: Any) -> Any:
    """W, and its derivative by differences along the vector field, in 40 digits."""
    KD, KP, a, b, d = (
        mpmath.mpf(x.numerator) / x.denominator for x in (p.KD, p.KP, p.alpha, p.beta, delta)
    )

    def function(e: Any, v: Any) -> Any:
        V = v**2 / 2 + KP * abs(e) ** (b + 1) / (b + 1)
        return (2 * V) ** ((3 - a) / 2) + d * (KP * (2 - a)) ** (1 - a / 2) * e * v

    def sig(x: Any, exponent: Any) -> Any:
        return mpmath.sign(x) * abs(x) ** exponent

    rate = -KD * sig(v, a) - KP * sig(e, b)
    return function(e, v), mpmath.diff(lambda t: function(e + t * v, v + t * rate), 0)


def function_of(delta: Fraction, c: Fraction) -> check._Function:
    p = PAPER
    potential = check._exactly((2 - p.alpha) * p.KP)
    weight = check._exactly(delta) * potential ** (1 - p.alpha / 2)
    return check._Function(p.KD, p.KP, p.alpha, p.beta, potential, weight, c)


@pytest.mark.parametrize("face", FACES)
def test_the_checkers_formulas_are_the_dynamics(face: str, made: Made) -> None:
    delta, c = Fraction(made["delta"]), Fraction(made["c"])
    function = function_of(delta, c)
    for place in (Fraction(1, 7), Fraction(3, 2), Fraction(6)):
        for sign in (1, -1) if face == "e=1" else (1,):
            at = check._exactly(sign * place)
            excess = function.at(face, at, check._ONE)
            assert excess is not None
            with mpmath.workdps(40):
                free = mpmath.mpf(sign * place.numerator) / place.denominator
                e, v = (1, free) if face == "e=1" else (free, 1 if face == "v=1" else -1)

                def excess_at(u: Any, e: Any = e, v: Any = v) -> Any:
                    moved = (e, u) if face == "e=1" else (u, v)
                    value, rate = derivative_along_the_dynamics(PAPER, delta, *moved)
                    power = 2 / (3 - mpmath.mpf(8) / 10)
                    return rate + mpmath.mpf(c.numerator) / c.denominator * value**power

                low, high = (mpmath.mpf(str(end)) for end in (excess.value.low, excess.value.high))
                exact = excess_at(free)
                assert abs(low - exact) <= 1e-15 * (1 + abs(exact))
                assert high - low <= 1e-20 * (1 + abs(exact))
                slope = mpmath.diff(excess_at, free, h=mpmath.mpf("1e-9"))
                assert mpmath.mpf(str(excess.slope.low)) == pytest.approx(slope, rel=1e-6)


def test_the_checkers_powers_enclose() -> None:
    rng = random.Random(3)
    for _ in range(300):
        base = Decimal(repr(10 ** rng.uniform(-12, 3)))
        exponent = Fraction(rng.randint(1, 3000), 1000)
        found = check._power(base, exponent)
        with mpmath.workdps(60):
            exact = mpmath.mpf(str(base)) ** (mpmath.mpf(exponent.numerator) / exponent.denominator)
            assert mpmath.mpf(str(found.low)) < exact < mpmath.mpf(str(found.high))
            assert mpmath.mpf(str(found.high)) / mpmath.mpf(str(found.low)) - 1 < 1e-25


def test_a_box_with_a_wrong_place_fails_on_its_own(made: Made) -> None:
    # The whole circle is in use: where W falls slowest c cannot be 0.5 % larger.
    larger = function_of(Fraction(made["delta"]), Fraction(made["c"]) * Fraction(1005, 1000))
    boxes = [(f, Fraction(a), Fraction(b)) for f in FACES for a, b in made["boxes"][f]]
    failed = [(f, a, b) for f, a, b in boxes if not check._verified(larger, f, a, b, 8)]
    assert 0 < len(failed) < len(boxes) / 2


def test_no_box_with_a_counterexample_holds(made: Made) -> None:
    delta, c = Fraction(made["delta"]), Fraction(made["c"])
    boxes = [(f, Fraction(a), Fraction(b)) for f in FACES for a, b in made["boxes"][f]]
    # So fast it falls nowhere, and neither does what touches an axis.
    assert not any(function_of(delta, 40 * c).holds(*box) for box in boxes)
    # Somewhere W is not positive: a wide box around such a place does not hold for any c.
    indefinite = function_of(Fraction(4), Fraction(1, 1000))
    assert not indefinite.holds("e=1", Fraction(-12), Fraction(-1))
    # Around a place where it falls too slowly, no box holds, however wide.
    larger = function_of(delta, c * Fraction(105, 100))
    narrow = [box for box in boxes if not check._verified(larger, *box, 8)]
    assert narrow
    for face, low, high in narrow:
        for widening in (0, 1, 4, 20):
            wide = low - widening * (high - low), high + widening * (high - low)
            if low >= 0:
                wide = max(wide[0], low / 100), wide[1]
            else:
                wide = wide[0], min(wide[1], high / 100)
            assert not larger.holds(face, *wide)


# Damaged ones


def bound_of(c: Fraction, p: Parameters) -> str:
    """The settling bound that follows from c, rounded up."""
    with mpmath.workdps(40):
        a = mpmath.mpf(p.alpha.numerator) / p.alpha.denominator
        KP, rate = (mpmath.mpf(x.numerator) / x.denominator for x in (p.KP, c))
        bound = (3 - a) / ((1 - a) * rate) * ((2 - a) * KP) ** ((1 - a) / 2)
        return str(Fraction(int(mpmath.ceil(bound * 10**12)), 10**12))


def scaled(made: Made, key: str, factor: Fraction | int) -> Made:
    return {**made, key: str(Fraction(made[key]) * factor)}


def with_boxes(made: Made, face: str, change: Callable[[list[Any]], Any]) -> Made:
    changed = copy.deepcopy(made)
    boxes = changed["boxes"][face]
    result = change(boxes)
    changed["boxes"][face] = boxes if result is None else result
    return changed


def damages(made: Made) -> Iterator[tuple[str, Made]]:
    """Every damage by its name."""
    keys = sorted(made)
    for key in keys:
        yield f"no {key}", {k: v for k, v in made.items() if k != key}
        wrong: tuple[Any, ...] = (None, 1.5, True, ["1"], "", {})
        for instead in wrong:
            yield f"{key} {instead!r}", {**made, key: instead}
    yield "one key more", {**made, "note": "1"}
    yield "another claim", {**made, "claim": "exponential"}
    yield "another format", {**made, "format": "error-dynamics-lyapunov-2"}
    numbers = [k for k in keys if k not in ("format", "claim", "boxes")]
    for key in numbers:
        value = Fraction(made[key])
        yield f"{key} negative", scaled(made, key, -1)
        yield f"{key} zero", {**made, key: "0"}
        yield (
            f"{key} not lowest",
            {
                **made,
                key: f"{2 * value.numerator}/{2 * value.denominator}",
            },
        )
        yield f"{key} decimal", {**made, key: str(float(value) + 1e-3)}
        yield f"{key} nan", {**made, key: "nan"}
        yield f"{key} over zero", {**made, key: "1/0"}
    for key in (*NAMES, "delta"):
        for factor in (Fraction(97, 100), Fraction(103, 100), Fraction(2)):
            yield f"{key} times {factor}", scaled(made, key, factor)
    for factor in (Fraction(1002, 1000), Fraction(102, 100), Fraction(2)):
        c = Fraction(made["c"]) * factor
        yield f"c times {factor} alone", scaled(made, "c", factor)
        yield (
            f"c times {factor} with its bound",
            {
                **scaled(made, "c", factor),
                "settling_time_bound_s": bound_of(c, PAPER),
            },
        )
    yield "c smaller alone", scaled(made, "c", Fraction(999, 1000))
    for factor in (Fraction(10**6 - 1, 10**6), Fraction(10**5 + 1, 10**5), Fraction(1, 2)):
        yield f"bound times {factor}", scaled(made, "settling_time_bound_s", factor)
    for face in FACES:
        without = {name: boxes for name, boxes in made["boxes"].items() if name != face}
        yield f"no {face}", {**made, "boxes": without}
        yield f"{face} empty", {**made, "boxes": {**made["boxes"], face: []}}
        yield f"{face} renamed", {**made, "boxes": {**without, "e=2": made["boxes"][face]}}
        count = len(made["boxes"][face])
        for index in sorted({0, 1, count // 3, count // 2, count - 2, count - 1}):

            def drop(boxes: list[Any], index: int = index) -> None:
                del boxes[index]

            def twice(boxes: list[Any], index: int = index) -> None:
                boxes.insert(index, boxes[index])

            def swap(boxes: list[Any], index: int = index) -> None:
                other = index - 1 if index else 1
                boxes[index], boxes[other] = boxes[other], boxes[index]

            def reverse(boxes: list[Any], index: int = index) -> None:
                boxes[index].reverse()

            def longer(boxes: list[Any], index: int = index) -> None:
                low, high = map(Fraction, boxes[index])
                boxes[index][1] = str(high + (high - low) / 2)

            def shorter(boxes: list[Any], index: int = index) -> None:
                low, high = map(Fraction, boxes[index])
                boxes[index][1] = str(high - (high - low) / 1000)

            def third(boxes: list[Any], index: int = index) -> None:
                boxes[index].append(boxes[index][1])

            def words(boxes: list[Any], index: int = index) -> None:
                boxes[index][0] = "zero"

            for change in (drop, twice, swap, reverse, shorter, third, words):
                yield f"{face} {index} {change.__name__}", with_boxes(made, face, change)
            if index < count - 1:  # the last may be longer
                yield f"{face} {index} longer", with_boxes(made, face, longer)
        yield f"{face} reversed", with_boxes(made, face, lambda boxes: boxes[::-1])
        yield f"{face} a dict", with_boxes(made, face, lambda boxes: dict(boxes))
    yield "one box over zero", with_boxes(made, "e=1", lambda boxes: [[boxes[0][0], boxes[-1][1]]])


def test_damaged_certificates_are_refused(made: Made) -> None:
    assert complaint(made, PAPER) is None
    tried, accepted = 0, []
    for name, damaged in damages(made):
        assert damaged != made, name
        tried += 1
        if complaint(damaged, PAPER) is None:
            accepted.append(name)
    assert not accepted
    assert tried >= 200


@pytest.mark.parametrize("value", [None, [], {}, "text", 3, [1, 2], {"claim": []}])
def test_what_is_no_certificate_is_refused(value: Any) -> None:
    assert complaint(value, PAPER) is not None


def test_a_claim_for_less_damping_is_refused_by_its_boxes(made: Made) -> None:
    # Consistent throughout: only that W falls fast enough is false.
    weaker = parameters(Fraction(19), 100, ".8", "finite-time")
    claimed = {**made, "KD": "19"}
    found = complaint(claimed, weaker)
    assert found is not None
    assert "does not fall" in found


def test_damaged_linear_certificates_are_refused() -> None:
    made = made_of(LINEAR)
    assert complaint(made, LINEAR) is None
    changes = [
        *((key, factor) for key in ("c", "d") for factor in ("1001/1000", "2", "-1", "0")),
        ("d", "999/1000"),
        *(("error_factor_squared", factor) for factor in ("999999/1000000", "2", "0")),
        *((name, "2") for name in NAMES),
    ]
    for key, factor in changes:
        assert complaint(scaled(made, key, Fraction(factor)), LINEAR) is not None, (key, factor)
    for key in made:
        assert complaint({k: v for k, v in made.items() if k != key}, LINEAR) is not None
    assert complaint(made, PAPER) is not None


# As a program


def test_the_checker_is_a_program(
    made: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "certificate.json"
    path.write_text(json.dumps(made))
    assert check.main([str(path)]) == 0
    assert "verified: finite-time for KD = 20" in capsys.readouterr().out
    path.write_text(json.dumps(scaled(made, "c", Fraction(11, 10))))
    assert check.main([str(path)]) == 1
    assert "settling time" in capsys.readouterr().out
    for text in ("", "[]", "{"):
        path.write_text(text)
        assert check.main([str(path)]) == 2
    assert check.main([str(tmp_path / "none.json")]) == 2
    assert check.main([]) == 2


def test_the_checker_needs_the_standard_library_alone() -> None:
    tree = ast.parse(Path(check.__file__).read_text(encoding="utf-8"))
    imported = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    imported |= {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    assert {str(name).split(".")[0] for name in imported} <= sys.stdlib_module_names
