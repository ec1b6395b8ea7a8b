"""Sizes and stack: the static bound holds in a run; a call graph that is no bound is refused."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from verification.disassembly import parse
from verification.firmware import emulated_board_names
from verification.size import (
    CallGraph,
    Code,
    Stack,
    StackError,
    _checked,
    add_library,
    deepest,
    main,
    read_call_graph,
    stack_below,
)

GRAPH = """graph: { title: "a.c"
node: { title: "start" label: "start\\na.c:1:1\\n16 bytes (static)" }
node: { title: "a.c:left" label: "left\\na.c:2:1\\n100 bytes (static)" }
node: { title: "right" label: "right\\nb.h:1:1" shape : ellipse }
edge: { sourcename: "start" targetname: "a.c:left" label: "a.c:3:1" }
edge: { sourcename: "start" targetname: "right" label: "a.c:4:1" }
}
"""
OTHER = """graph: { title: "b.c"
node: { title: "right" label: "right\\nb.c:1:1\\n40 bytes (static)" }
node: { title: "leaf" label: "leaf\\nb.c:2:1\\n80 bytes (static)" }
edge: { sourcename: "right" targetname: "leaf" label: "b.c:3:1" }
}
"""


def written(tmp_path: Path, *texts: str) -> list[Path]:
    files = [tmp_path / f"{i}.ci" for i in range(len(texts))]
    for file, text in zip(files, texts, strict=True):
        file.write_text(text, encoding="utf-8")
    return files


def test_the_deepest_path_goes_across_files(tmp_path: Path) -> None:
    path = deepest(read_call_graph(written(tmp_path, GRAPH, OTHER)), "start")
    assert path.size == 16 + 40 + 80
    assert path.functions == ("start", "right", "leaf")


@pytest.mark.parametrize(
    ("texts", "told"),
    [
        ([GRAPH], "right, called by start, has no known frame"),
        ([GRAPH, OTHER.replace('"leaf" label: "b', '"start" label: "b')], "recursion: start"),
        ([GRAPH.replace("100 bytes (static)", "100 bytes (dynamic)"), OTHER], "no constant size"),
        ([GRAPH.replace('"right"', '"__indirect_call"')], "__indirect_call"),
        ([], "not built with -fcallgraph-info"),
    ],
)
def test_what_is_no_bound_is_refused(texts: list[str], told: str, tmp_path: Path) -> None:
    with pytest.raises(StackError, match=told):
        deepest(read_call_graph(written(tmp_path, *texts)), "start")


def test_a_run_that_took_more_than_the_bound_is_an_error() -> None:
    assert _checked(Stack(100, 100, ("f",)), "it").painted == 100
    with pytest.raises(StackError, match="it touched 101 bytes of stack"):
        _checked(Stack(100, 101, ("f",)), "it")


# --- Functions of the compiler's library, which have no call graph ------------------------------

LISTING = """
00000100 <caller>:
     100:\tb51f      \tpush\t{r0, r1, r2, r3, r4, lr}
     102:\tb084      \tsub\tsp, #16
     104:\td002      \tbeq.n\t10c <caller+0xc>
     106:\tf000 f803 \tbl\t110 <leaf>
     10a:\tb004      \tadd\tsp, #16
     10c:\tb004      \tadd\tsp, #16
     10e:\tbd1f      \tpop\t{r0, r1, r2, r3, r4, pc}

00000110 <leaf>:
     110:\tf84d ed08 \tstr.w\tlr, [sp, #-8]!
     114:\t9b01      \tldr\tr3, [sp, #4]
     116:\tf85d fb08 \tldr.w\tpc, [sp], #8
     11a:\tbf00      \tnop

0000011c <table>:
     11c:\tb510      \tpush\t{r4, lr}
     11e:\t469f      \tmov\tpc, r3
     120:\tb4f0      \tpush\t{r4-r7}
     122:\tbcf0      \tpop\t{r4-r7}
     124:\tbd10      \tpop\t{r4, pc}
     126:\t0000      \t.short\t0x0000

00000128 <loop>:
     128:\tb401      \tpush\t{r0}
     12a:\te7fd      \tb.n\t128 <loop>

0000012c <alloca>:
     12c:\t4685      \tmov\tsp, r0
     12e:\t4770      \tbx\tlr

00000130 <recursive>:
     130:\tb510      \tpush\t{r4, lr}
     132:\tf7ff fffd \tbl\t130 <recursive>
     136:\tbd10      \tpop\t{r4, pc}

00000138 <pointer>:
     138:\tb510      \tpush\t{r4, lr}
     13a:\t4798      \tblx\tr3
     13c:\tbd10      \tpop\t{r4, pc}
"""
CODE = Code(
    parse(LISTING),
    {
        name: int(address, 16)
        for address, name in re.findall(r"^(\w+) <(\w+)>:$", LISTING, re.MULTILINE)
    },
)


@pytest.mark.parametrize(
    ("function", "size"), [("leaf", 8), ("caller", 24 + 16 + 8), ("table", 8 + 16)]
)
def test_stack_is_read_from_the_instructions(function: str, size: int) -> None:
    assert stack_below(CODE, CODE.symbols[function]) == size


@pytest.mark.parametrize(
    ("function", "told"),
    [
        ("loop", "no bound for the stack of the function at 0x128"),
        ("alloca", "moves by no constant: mov sp, r0 at 0x12c"),
        ("recursive", "recursion at 0x130"),
        ("pointer", "call through a register: blx r3 at 0x13a"),
    ],
)
def test_stack_without_a_bound_is_refused(function: str, told: str) -> None:
    with pytest.raises(StackError, match=told):
        stack_below(CODE, CODE.symbols[function])


def test_a_library_completes_the_call_graph() -> None:
    graph = CallGraph({"main": 4}, {"main": {"caller", "__aeabi_idiv"}})
    add_library(graph, CODE)
    assert deepest(graph, "main").size == 4 + 48
    pointer = CallGraph({"main": 4}, {"main": {"__indirect_call"}})
    add_library(pointer, CODE)
    with pytest.raises(StackError, match="__indirect_call"):
        deepest(pointer, "main")


@pytest.mark.parametrize(
    ("board", "controller"),
    [
        *((name, "puma3") for name in emulated_board_names()),
        ("mps2-an385", "puma3_fixed"),
        ("mps2-an385-m0plus", "puma3_fixed"),
    ],
)
def test_sizes(
    board: str, controller: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "size.json"
    assert main(["--board", board, "--controller", controller, "--output", str(output)]) == 0
    assert controller in capsys.readouterr().out
    (size,) = json.loads(output.read_text(encoding="utf-8"))["sizes"]
    assert size["board"] == board
    assert 1000 < size["controller_memory"]["flash"] < 5000
    assert size["controller_memory"]["flash"] < size["application_memory"]["flash"] < 20000
    # Nothing but the state: 3 words, and 2 ticks of 4 words for each joint.
    assert size["controller_memory"]["ram"] == 4 * (3 + 3 * 2 * 4)
    for stack in (size["controller_stack"], size["application_stack"]):
        # The bound is not a lot more than what was seen, or it would bound nothing.
        assert 0.5 * stack["static"] < stack["painted"] <= stack["static"]
    assert size["application_stack"]["static"] < size["stack_reserved"]
    # The step, or the check of a configuration at the start.
    assert any(name.startswith(f"tdc_{controller}_") for name in size["application_stack"]["path"])
