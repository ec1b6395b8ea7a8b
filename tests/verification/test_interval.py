"""Enclosures hold what binary32 computes, and are no wider than rounding needs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codegen.law import (
    GAINS,
    SIGNALS,
    LawFunction,
    LawOptions,
    Quantity,
    tde_correction,
    torque_law,
)
from verification.interval import Interval, enclose, kernel_power, point, rounded
from verification.law_graph import UnknownOperationError, evaluate

A, B = SIGNALS["position_error"], SIGNALS["velocity_error"]
FLOATS = st.floats(-(2.0**60), 2.0**60, width=32)


def function(expression: object) -> LawFunction:
    return LawFunction("f", "", (A, B), (Quantity("y", "", "", "", expression),))


def enclosed(f: LawFunction, a: float, b: float) -> Interval:
    return enclose(f, {A.name: point([a]), B.name: point([b])}, 0.0)["y"]


@given(a=FLOATS, b=FLOATS)
@pytest.mark.parametrize("name", ["add", "subtract", "multiply"])
def test_one_rounded_operation_lies_inside(name: str, a: float, b: float) -> None:
    operation = getattr(np, name)
    expression = {"add": A.symbol + B.symbol, "subtract": A.symbol - B.symbol}.get(
        name, A.symbol * B.symbol
    )
    with np.errstate(under="ignore"):
        result = float(operation(np.float32(a), np.float32(b)))
    interval = enclosed(function(expression), a, b)
    assert interval.contains(np.array([result])).all()
    exact = float(operation(np.float64(a), np.float64(b)))
    assert interval.high[0] - interval.low[0] <= 2.0**-22.9 * abs(exact) + 2.0**-146


@given(a=FLOATS)
def test_a_sum_and_a_product_with_zero_stay_exact(a: float) -> None:
    for expression, result in (
        (A.symbol + B.symbol, a),
        (A.symbol - B.symbol, a),
        (B.symbol - A.symbol, -a),
        (A.symbol * B.symbol, 0.0),
    ):
        interval = enclosed(function(expression), a, 0.0)
        assert (interval.low[0], interval.high[0]) == (result, result)


@given(a=FLOATS)
def test_a_rounded_number_lies_inside_and_its_neighbour_does_not(a: float) -> None:
    interval = rounded(point([a]))
    assert interval.contains(np.array([a])).all()
    beyond = a * (1 + 2.0**-22) + np.copysign(2.0**-147, a)
    assert not interval.contains(np.array([beyond])).any()


def test_nan_lies_in_no_interval() -> None:
    assert not point([1.0]).contains(np.array([np.nan])).any()


@given(x=st.floats(-10, 10, width=32), gamma=st.sampled_from([0.0, 0.4, 1.0, 1.5]))
def test_a_power_across_zero_holds_both_signs(x: float, gamma: float) -> None:
    correction = tde_correction(GAINS["lambda"].symbol, A.symbol, GAINS["gamma"].symbol)
    f = LawFunction(
        "f",
        "",
        (GAINS["lambda"], GAINS["gamma"], A),
        (Quantity("y", "", "", "", correction),),
    )
    inputs = {
        "lambda": point([2.0]),
        "gamma": point([gamma]),
        A.name: Interval(np.array([min(x, 0.0) - 1e-3]), np.array([max(x, 0.0) + 1e-3])),
    }
    exact = 2.0 * np.sign(x) * np.abs(x) ** gamma
    for value in (exact, 0.0, -2.0 * 1e-3**gamma, 2.0 * 1e-3**gamma):
        assert enclose(f, inputs, 0.0)["y"].contains(np.array([value])).all()


EXPONENTS = np.array([0.0, 1e-9, 0.015, 0.4, 0.95, 1.0, 1.5, 2.0 - 2.0**-31])


def test_the_kernel_takes_powers_between_tiny_and_huge() -> None:
    x = 2.0 ** np.linspace(-126, 126, 400)[:, None]
    assert np.allclose(kernel_power(x, EXPONENTS), x**EXPONENTS, rtol=1e-12, atol=0.0)


def test_the_kernel_rises_from_zero_and_without_a_step() -> None:
    tiny = np.linspace(0.0, 2.0**-125, 2000)
    x = np.concatenate([tiny, 2.0 ** np.linspace(-125, 128, 2000)])[:, None]
    values = kernel_power(x, EXPONENTS)
    assert np.all(values[0] == 0.0)
    assert np.all(np.diff(values, axis=0) >= -1e-15 * values[1:])
    for edge in (2.0**-126, 2.0**126):
        below, above = (kernel_power(np.array(edge * (1 + e)), EXPONENTS) for e in (-1e-12, 1e-12))
        assert np.allclose(below, above, rtol=1e-11, atol=0.0)


def test_the_kernels_exceptions() -> None:
    smallest = np.array(2.0**-149)
    assert kernel_power(smallest, np.array(0.0)) == pytest.approx(2.0**-22, rel=1e-6)
    assert kernel_power(np.array(2.0**-127), np.array(0.0)) == pytest.approx(2 / 3)
    assert kernel_power(np.array(2.0**127), np.array(0.0)) == 2.0
    assert kernel_power(np.array(2.0**127), np.array(0.5)) == pytest.approx(2.0**63.5)
    assert kernel_power(np.array(np.inf), np.array(0.0)) == np.inf


def test_an_operation_without_a_rounding_rule_is_refused() -> None:
    with pytest.raises(UnknownOperationError, match="OP_DIV"):
        enclosed(function(A.symbol / B.symbol), 1.0, 2.0)


def test_the_walk_gives_the_quantities_of_the_law() -> None:
    law = torque_law(LawOptions())
    values = {i.name: point([1.0]) for i in law.inputs}
    assert list(enclose(law, values, 0.0)) == [q.name for q in law.quantities]
    with pytest.raises(KeyError):
        evaluate(law, {}, {}, float)
