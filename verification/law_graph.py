"""The law's expression graph evaluated over any algebra: SymPy expressions, intervals, doubles.

The walk reads the instruction list of the ``casadi.Function`` and shares no code with the C
printer, so that a mistake of the printer can't hide in the check.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import casadi as ca

from codegen.law import LawFunction

Value = TypeVar("Value")
Operations = Mapping[int, Callable[..., Any]]
"""What each CasADi operation does to values of the algebra, by operation code."""


class UnknownOperationError(Exception):
    """The law holds an operation that the algebra does not know."""


_NAMES = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}


def evaluate(
    function: LawFunction,
    inputs: Mapping[str, Value],
    operations: Operations,
    constant: Callable[[float], Value],
) -> dict[str, Value]:
    """The quantities of a law function, computed in another algebra.

    Args:
        function: the law, or a part of it.
        inputs: the value of each of its inputs, by name; others are ignored.
        operations: how the algebra does each operation.
        constant: how the algebra spells a number.

    Raises:
        UnknownOperationError: an operation is missing.
        KeyError: an input is missing.
    """
    given = [inputs[q.name] for q in function.inputs]
    try:
        values = walk(function.casadi_function(), given, operations, constant)
    except UnknownOperationError as error:
        raise UnknownOperationError(f"{function.name}: {error}") from error
    return {q.name: value for q, value in zip(function.quantities, values, strict=True)}


def walk(
    function: Any,
    inputs: Sequence[Value],
    operations: Operations,
    constant: Callable[[float], Value],
) -> list[Value]:
    """The outputs of a ``casadi.Function`` of scalars, computed in another algebra.

    Args:
        function: of SX, with scalar inputs and outputs.
        inputs: their values, in order.
        operations: how the algebra does each operation.
        constant: how the algebra spells a number.

    Raises:
        UnknownOperationError: an operation is missing.
    """
    register: dict[int, Value] = {}
    outputs: dict[int, Value] = {}
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source = function.instruction_input(k)
        target = function.instruction_output(k)
        if operation == ca.OP_INPUT:
            register[target[0]] = inputs[source[0]]
        elif operation == ca.OP_OUTPUT:
            outputs[target[0]] = register[source[0]]
        elif operation == ca.OP_CONST:
            register[target[0]] = constant(function.instruction_constant(k))
        elif operation in operations:
            register[target[0]] = operations[operation](*(register[s] for s in source))
        else:
            raise UnknownOperationError(f"no rule for {_NAMES.get(operation, str(operation))}")
    return [outputs[i] for i in range(function.n_out())]
