"""From CasADi SX to C99: a printer that walks the instruction list.

CasADi's own C generator is not used: with ``casadi_real=float`` it still prints double literals
and calls ``pow``, so that a single-precision FPU computes in software. This printer knows a small
table of operations, prints every constant as a literal of the number that the C computes with,
recognises |x|^a sgn(x) as one power, keeps the law's names, and refuses what it doesn't know.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca

from codegen.arithmetic import FLOAT32, Real
from codegen.law import Input, LawFunction
from codegen.literals import UnprintableError


@dataclass(frozen=True)
class Statement:
    """One C definition, ``const TYPE name = expression;``, and what it means."""

    name: str
    expression: str
    equation: str
    unit: str
    meaning: str

    @property
    def comment(self) -> str:
        """Equation number and unit, for the end of the line."""
        return " ".join(filter(None, (self.equation, f"[{self.unit}]" if self.unit else "")))


_OP_NAMES = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}

_INFIX = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_CALL = {ca.OP_FMIN: "tdc_min", ca.OP_FMAX: "tdc_max"}
# sign, fabs and pow exist only as parts of sig(x)^a, which becomes a single call.
_SIG_PARTS = (ca.OP_SIGN, ca.OP_FABS, ca.OP_POW, ca.OP_CONSTPOW)


@dataclass(frozen=True)
class Node:
    """A value of the expression graph in static single assignment form."""

    op: int
    arguments: tuple[int, ...] = ()
    input: Input | None = None
    constant: float = 0.0


@dataclass(frozen=True)
class Graph:
    """The instructions of a law function.

    Attributes:
        nodes: its values, each after those that it is made from.
        outputs: the node of each quantity of the law function.
    """

    nodes: tuple[Node, ...]
    outputs: tuple[int, ...]

    def sig(self, index: int) -> tuple[int, int] | None:
        """Base and exponent where the node is sgn(x) |x|^a, in either order of the factors.

        Raises:
            UnprintableError: the exponent is a constant.
        """
        node = self.nodes[index]
        if node.op != ca.OP_MUL:
            return None
        for sign, power in (node.arguments, node.arguments[::-1]):
            if self.nodes[sign].op != ca.OP_SIGN:
                continue
            if self.nodes[power].op not in (ca.OP_POW, ca.OP_CONSTPOW):
                continue
            magnitude, exponent = self.nodes[power].arguments
            base = self.nodes[sign].arguments[0]
            if self.nodes[magnitude].op == ca.OP_FABS:
                if self.nodes[magnitude].arguments[0] != base:
                    continue
                if self.nodes[exponent].input is None:
                    raise UnprintableError("the exponent of sig() must be an input of the law")
                return base, exponent
        return None


def print_law(
    function: LawFunction, spelling: Callable[[Input], str], real: Real = FLOAT32
) -> tuple[Statement, ...]:
    """The C definitions of a law function's quantities, in their order.

    Args:
        function: the law.
        spelling: how C spells each input, such as ``gains->kd``.
        real: the numbers that the C computes with.

    Raises:
        UnprintableError: an operation without float-only C, or a value that is used twice
            without being a named quantity.
    """
    graph = instruction_graph(function)
    spelled = {n.input.name: spelling(n.input) for n in graph.nodes if n.input is not None}
    statements: list[Statement] = []
    names: dict[int, str] = {}
    # sig(x)^a holds x in sign and in fabs, and is still one use of x: fabs isn't counted.
    uses = Counter(a for n in graph.nodes if n.op != ca.OP_FABS for a in n.arguments)
    for quantity, node in zip(function.quantities, graph.outputs, strict=True):
        printer = _Expression(graph, names, spelled, uses, f"{function.name}.{quantity.name}", real)
        statements.append(
            Statement(
                quantity.name,
                printer.definition(node),
                quantity.equation,
                quantity.unit,
                quantity.meaning,
            )
        )
        names[node] = quantity.name
    return tuple(statements)


def instruction_graph(function: LawFunction) -> Graph:
    """The instruction list of the CasADi function as a graph.

    CasADi's instructions share work registers; each write starts a new node here.
    """
    casadi_function = function.casadi_function()
    nodes: list[Node] = []
    register: dict[int, int] = {}
    outputs: dict[int, int] = {}
    inputs: dict[str, int] = {}
    for k in range(casadi_function.n_instructions()):
        op = casadi_function.instruction_id(k)
        source = casadi_function.instruction_input(k)
        target = casadi_function.instruction_output(k)
        if op == ca.OP_OUTPUT:
            outputs[target[0]] = register[source[0]]
            continue
        if op == ca.OP_INPUT:
            parameter = function.inputs[source[0]]
            if parameter.name not in inputs:
                inputs[parameter.name] = len(nodes)
                nodes.append(Node(op, input=parameter))
            register[target[0]] = inputs[parameter.name]
            continue
        if op == ca.OP_CONST:
            nodes.append(Node(op, constant=casadi_function.instruction_constant(k)))
        else:
            nodes.append(Node(op, tuple(register[s] for s in source)))
        register[target[0]] = len(nodes) - 1
    return Graph(tuple(nodes), tuple(outputs[i] for i in range(len(outputs))))


@dataclass(frozen=True)
class _Expression:
    """Prints nodes as C expressions; named nodes by their name, all others in place."""

    graph: Graph
    names: Mapping[int, str]
    spelled: Mapping[str, str]
    uses: Mapping[int, int]
    where: str
    real: Real

    def definition(self, index: int) -> str:
        """The expression that defines a node, even where an earlier quantity names it."""
        return self.names[index] if index in self.names else self._inline(index)

    def _operand(self, index: int) -> str:
        """A node as an operand: parenthesised unless it is a name, a call or a literal."""
        node = self.graph.nodes[index]
        text = self._reference(index)
        infix = index not in self.names and self.graph.sig(index) is None
        return f"({text})" if infix and node.op in (*_INFIX, ca.OP_NEG) else text

    def _reference(self, index: int) -> str:
        if index in self.names:
            return self.names[index]
        node = self.graph.nodes[index]
        if self.uses[index] > 1 and node.op not in (ca.OP_INPUT, ca.OP_CONST, *_SIG_PARTS):
            raise UnprintableError(
                f"{self.where}: a value of {_OP_NAMES[node.op]} is used {self.uses[index]} times; "
                "name it as a Quantity before its first use"
            )
        return self._inline(index)

    def _inline(self, index: int) -> str:
        node = self.graph.nodes[index]
        if node.input is not None:
            return self.spelled[node.input.name]
        if node.op == ca.OP_CONST:
            return self.real.literal(node.constant)
        sig = self.graph.sig(index)
        if sig is not None:
            base, exponent = sig
            return f"{self.real.power}({self._reference(base)}, {self._reference(exponent)})"
        if node.op in _INFIX:
            left, right = (self._operand(a) for a in node.arguments)
            return f"{left} {_INFIX[node.op]} {right}"
        if node.op in _CALL:
            arguments = ", ".join(self._reference(a) for a in node.arguments)
            return f"{_CALL[node.op]}{self.real.suffix}({arguments})"
        if node.op == ca.OP_NEG:
            return f"-{self._operand(node.arguments[0])}"
        raise UnprintableError(
            f"{self.where}: {_OP_NAMES.get(node.op, node.op)} has no float-only C in this printer"
        )
