"""Sizes and stack: the static bound holds in a run; a call graph that is no bound is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from verification.firmware import emulated_board_names
from verification.size import (
    Stack,
    StackError,
    _checked,
    deepest,
    main,
    read_call_graph,
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


@pytest.mark.parametrize("board", emulated_board_names())
def test_sizes(board: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "size.json"
    assert main(["--board", board, "--controller", "puma3", "--output", str(output)]) == 0
    assert "puma3" in capsys.readouterr().out
    (size,) = json.loads(output.read_text(encoding="utf-8"))["sizes"]
    assert size["board"] == board
    assert 1000 < size["controller_memory"]["flash"] < 5000
    assert size["controller_memory"]["flash"] < size["application_memory"]["flash"] < 20000
    # Nothing but the state: 2 words, and 4 for each joint.
    assert size["controller_memory"]["ram"] == 4 * (2 + 3 * 4)
    for stack in (size["controller_stack"], size["application_stack"]):
        # The bound is not a lot more than what was seen, or it would bound nothing.
        assert 0.5 * stack["static"] < stack["painted"] <= stack["static"]
    assert size["application_stack"]["static"] < size["stack_reserved"]
    assert "tdc_puma3_step" in size["application_stack"]["path"]
