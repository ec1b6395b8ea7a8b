"""The printer: float-only C for what it knows, an error for everything else."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from typing import Any

import casadi as ca
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codegen.c99 import print_law
from codegen.law import Home, Input, LawFunction, LawOptions, Quantity, sig, torque_law
from codegen.literals import UnprintableError, float_literal

X = Input("x", Home.SIGNAL, "", "a signal")
Y = Input("y", Home.SIGNAL, "", "another signal")
A = Input("a", Home.GAIN, "", "an exponent")


def printed(*expressions: Any) -> list[str]:
    quantities = tuple(Quantity(f"q{i}", "", "", "", e) for i, e in enumerate(expressions))
    function = LawFunction("f", "", (X, Y, A), quantities)
    return [s.expression for s in print_law(function, lambda i: i.name)]


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (X.symbol + Y.symbol - A.symbol, "(x + y) - a"),
        (X.symbol - (Y.symbol - A.symbol), "x - (y - a)"),
        (X.symbol * Y.symbol + A.symbol, "(x * y) + a"),
        (-(X.symbol + Y.symbol) / A.symbol, "-((x + y) / a)"),
        (0.5 * X.symbol, "0.5f * x"),
        (ca.fmin(X.symbol, -Y.symbol), "tdc_min(x, -y)"),
        (sig(X.symbol, A.symbol), "tdc_sig_pow(x, a)"),
        (ca.fabs(X.symbol) ** A.symbol * ca.sign(X.symbol), "tdc_sig_pow(x, a)"),
        (3 * sig(X.symbol - Y.symbol, A.symbol), "3.0f * tdc_sig_pow(x - y, a)"),
    ],
)
def test_expressions(expression: Any, expected: str) -> None:
    assert printed(expression) == [expected]


@pytest.mark.parametrize(
    "make",
    [ca.sin, ca.exp, ca.sqrt, ca.fabs, ca.sign, lambda x: x**A.symbol, lambda x: ca.fabs(x) ** 1.5],
    ids=["sin", "exp", "sqrt", "fabs", "sign", "pow", "constpow"],
)
def test_an_operation_without_float_only_c_is_refused(make: Callable[[Any], Any]) -> None:
    with pytest.raises(UnprintableError, match="OP_"):
        printed(make(X.symbol))


def test_sig_of_two_different_things_is_no_sig_pow() -> None:
    with pytest.raises(UnprintableError, match="OP_"):
        printed(ca.sign(Y.symbol) * ca.fabs(X.symbol) ** A.symbol)


def test_a_named_quantity_is_used_by_name_and_an_unnamed_one_is_refused() -> None:
    total = X.symbol + Y.symbol
    assert printed(total, total * (A.symbol - total)) == ["x + y", "q0 * (a - q0)"]
    with pytest.raises(UnprintableError, match="name it as a Quantity"):
        printed(total * (A.symbol - total))


def test_a_constant_that_binary32_lacks_is_refused() -> None:
    with pytest.raises(UnprintableError, match="make it an input"):
        printed(0.1 * X.symbol)


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_literals_are_floats_that_round_trip(value: float) -> None:
    literal = float_literal(value)
    assert re.fullmatch(r"-?(\d+\.\d+|\d+(\.\d+)?e[+-]?\d+)f", literal)
    assert struct.pack("<f", float(literal[:-1])) == struct.pack("<f", value)


def test_literals_are_short() -> None:
    assert float_literal(struct.unpack("<f", struct.pack("<f", 0.1))[0]) == "0.1f"
    assert float_literal(20.0) == "20.0f"


def test_every_quantity_of_the_law_keeps_its_name_and_equation() -> None:
    statements = {
        s.name: s for s in print_law(torque_law(LawOptions(low_pass=True)), lambda i: i.name)
    }
    assert statements["sliding_variable"].equation == "(26)"
    assert statements["nonlinear_input"].equation == "(23)"
    assert statements["control_torque"].expression == (
        "(inertia * (nonlinear_input + correction)) + time_delay_estimate"
    )
    assert statements["filtered_torque"].equation == "(43)"
