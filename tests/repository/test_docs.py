"""Every link of every page leads somewhere; every block of code is run, or says why not.

A block that needs something else has a comment right above it::

    <!-- run by tests/...: -->      another test runs it, which names the page
    <!-- checked only: WHY -->      make targets and command lines are checked, nothing is run
    <!-- not run: WHY -->           nothing is checked

``make`` is never run, but asked for what it would do.
"""

from __future__ import annotations

import argparse
import importlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from decimal import Decimal
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from codegen.controller import read, resolve
from codegen.presets import LAW_PRESETS
from codegen.problems import SpecificationError
from plant.campaign.specification import read as read_campaign
from plant.flight import ROBOT_KEYS
from plant.robot import read_robot_file
from plant.scenario import read_scenario
from tests.repository.conftest import PYTHON, ROOT, source_files
from tests.repository.markdown import Block, Page, parse, project_pages, slug
from verification.evidence import Evidence

PAGES = project_pages()
BLOCKS = [block for page in PAGES.values() for block in page.blocks]
CHECKED = ("sh", "python", "c", "toml")
AS_THEY_STAND = ("text", "cmake")
COMPILE = ("gcc", "-std=c99", "-fsyntax-only", "-x", "c", "-Wall", "-Wextra", "-Wstrict-prototypes",
           "-Werror")  # fmt: skip


def of(*languages: str) -> list[Any]:
    """The blocks of some languages that are to be run here, as parameters."""
    return [
        pytest.param(block, id=str(block))
        for block in BLOCKS
        if block.language in languages and block.mark not in ("run by", "not run")
    ]


# --- Links -------------------------------------------------------------------------------------


@cache
def places() -> frozenset[Path]:
    """All files of the repository, and all folders that have some."""
    files = {path.relative_to(ROOT) for path in source_files()}
    return frozenset(files | {parent for path in files for parent in path.parents})


def broken_links(page: Page, pages: dict[Path, Page]) -> Iterator[str]:
    """What is wrong with a page's links, a line each."""
    for link in page.links:
        parts = urlsplit(link)
        if parts.scheme or parts.netloc:
            if parts.scheme != "https" or "." not in parts.netloc:
                yield f"{page.path}: {link}: neither a file nor an https address"
            continue
        target = page.path
        if parts.path:
            target = Path(os.path.normpath(page.path.parent / parts.path))
        if target not in places():
            yield f"{page.path}: {link}: the repository has no {target}"
        elif parts.fragment and parts.fragment not in getattr(pages.get(target), "anchors", ()):
            yield f"{page.path}: {link}: {target} has no heading #{parts.fragment}"


@pytest.mark.parametrize("page", PAGES.values(), ids=lambda page: str(page.path))
def test_every_link_leads_somewhere(page: Page) -> None:
    assert list(broken_links(page, PAGES)) == []


@pytest.mark.parametrize(
    ("link", "says"),
    [
        ("quick-start.md", "the repository has no quick-start.md"),
        ("README.md#no-such-heading", "has no heading #no-such-heading"),
        ("#nor-here", "has no heading #nor-here"),
        ("Makefile#all", "has no heading #all"),
        ("http://example.org", "neither a file nor an https address"),
        ("build", "the repository has no build"),
    ],
)
def test_a_broken_link_is_found(link: str, says: str) -> None:
    page = parse(Path("new.md"), f"# New\n\n| a |\n|---|\n| [x]({link}) |\n")
    (found,) = (
        broken_links(page, {**PAGES, page.path: page})
        if link[0] != "#"
        else broken_links(
            Page(Path("README.md"), page.links, page.anchors, ()), {Path("README.md"): page}
        )
    )
    assert says in found


@pytest.mark.parametrize(
    ("heading", "anchor"),
    [
        ("The two commands", "the-two-commands"),
        ("Table II (make table2)", "table-ii-make-table2"),
        ("tdc_puma3_init", "tdc_puma3_init"),
        ("II-A, II-B: the robot", "ii-a-ii-b-the-robot"),
        ('In double: precision = "float64"', "in-double-precision--float64"),
    ],
)
def test_slug_is_that_of_github(heading: str, anchor: str) -> None:
    assert slug(heading) == anchor


def test_equal_headings_are_counted() -> None:
    assert parse(Path("x.md"), "# A `b`\n## A b\n## C\n").anchors == {"a-b", "a-b-1", "c"}


def test_the_words_of_evidence_mean_what_the_code_means() -> None:
    text = (ROOT / "docs" / "what-is-proved.md").read_text(encoding="utf-8")
    for evidence in Evidence:
        assert f"| {evidence.value} | {evidence.meaning} |" in text


# --- Blocks: what stands above them ------------------------------------------------------------


@pytest.mark.parametrize("block", BLOCKS, ids=str)
def test_every_block_has_a_language_and_a_good_reason_not_to_be_run(block: Block) -> None:
    assert block.language in (*CHECKED, *AS_THEY_STAND), "name the language behind the fence"
    if block.mark == "run by":
        runner = ROOT / block.reason
        assert runner.is_file()
        assert block.page.parent.name in runner.read_text(encoding="utf-8") or (
            block.page.name in runner.read_text(encoding="utf-8")
        ), f"{block.reason} doesn't know {block.page}"
    assert block.mark == "run by" or block.language != "cmake"


# --- Shell -------------------------------------------------------------------------------------


def _arguments_are_good(module: str, arguments: Sequence[str]) -> str:
    """What a command line's own parser says against arguments; empty if nothing."""
    parser: argparse.ArgumentParser
    if module == "verification":
        parser = importlib.import_module("verification.__main__")._parser(arguments[0])
    else:
        name = (
            module
            if importlib.util.find_spec(f"{module}.__main__") is None
            else (f"{module}.__main__")
        )
        parser = importlib.import_module(name)._parser()
    try:
        parser.parse_args(arguments)
    except SystemExit as leaves:
        return "" if leaves.code == 0 else f"python -m {module} refuses {' '.join(arguments)}"
    return ""


def against(command: Sequence[str], root: Path = ROOT) -> str:
    """What is wrong with a command, as far as that shows without running it."""
    if command[0] == "make":
        asked = subprocess.run(
            ["make", "-n", *command[1:]], cwd=root, capture_output=True, text=True, check=False
        )
        return asked.stderr if asked.returncode else ""
    if list(command[:2]) == [PYTHON, "-m"]:
        return _arguments_are_good(command[2], command[3:])
    return "" if shutil.which(command[0]) else f"{command[0]}: there is no such command"


@pytest.mark.parametrize("block", of("sh"))
def test_make_targets_and_arguments_are_there(block: Block) -> None:
    for command in block.commands:
        if command[0] in ("make", PYTHON) or block.mark == "checked only":
            assert against(command) == ""


@pytest.mark.parametrize(
    "command",
    [
        "make no-such-target",
        ".venv/bin/python -m codegen generat",
        ".venv/bin/python -m plant simulate x.toml --no-such-option",
        ".venv/bin/python -m verification error-dynamics --kd 20 --kp many",
        "no-such-command -v",
    ],
)
def test_what_is_not_there_is_found(command: str) -> None:
    (words,) = Block(Path("x.md"), 1, "sh", command).commands
    assert against(words)


@pytest.mark.parametrize("block", [p for p in of("sh") if p.values[0].mark != "checked only"])
def test_commands_run_as_they_stand(block: Block, copy: Path) -> None:
    lines = block.text.replace("\\\n", " ").splitlines()
    script = "\n".join(line for line in lines if line.split()[:1] != ["make"])
    done = subprocess.run(
        ["sh", "-eu", "-c", script], cwd=copy, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("block", of("python"))
def test_python_runs_as_it_stands(block: Block, copy: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", block.text], cwd=copy, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


# --- C and TOML --------------------------------------------------------------------------------


def _header_of(text: str) -> str:
    """The generated header that declares what C speaks of."""
    names = sorted((path.name for path in (ROOT / "generated").iterdir()), key=len, reverse=True)
    files = [
        *(f"{name}/tdc_{name}.h" for name in names),
        "puma3_precise/tdc_sig_pow_precise.h",
        "puma3_float64/tdc_sig_pow64.h",
        "puma3_float64/tdc64.h",
        "puma3_fixed/tdc_fixed.h",
        "puma3/tdc_sig_pow.h",
        "puma3/tdc.h",
    ]
    word = re.search(r"\b(tdc_\w+)\(", text) or re.search(r"\b(tdc_\w+)(?:\[\w+\])?;", text)
    for file in files:
        header = (ROOT / "generated" / file).read_text(encoding="utf-8")
        if word and re.search(rf"\b{word.group(1)}\b", header):
            return file
    raise AssertionError(f"no header declares what this speaks of:\n{text}")


@pytest.mark.parametrize("block", of("c"))
def test_c_compiles_without_a_warning(block: Block, tmp_path: Path) -> None:
    source = tmp_path / "block.c"
    own = "" if "#include" in block.text else f'#include "{_header_of(block.text)}"\n'
    source.write_text(own + block.text, encoding="utf-8")
    folders = [f"-I{ROOT / 'generated'}", f"-I{ROOT / 'generated' / 'puma3'}"]
    done = subprocess.run(
        [*COMPILE, *folders, str(source)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("block", of("toml"))
def test_toml_is_taken(block: Block, tmp_path: Path) -> None:
    data = tomllib.loads(block.text, parse_float=Decimal)
    file = tmp_path / "block.toml"
    file.write_text(block.text, encoding="utf-8")
    if "events" in data:
        read_scenario(str(file))
    elif "gains" in data:
        read_campaign(file)
    elif data.keys() & ROBOT_KEYS:
        read_robot_file(file)
    else:
        resolve(_whole(data), str(block))


def _whole(part: dict[str, Any]) -> dict[str, Any]:
    """puma3's specification with another part; gains without a preset beside Exp08's."""
    whole = read(ROOT / "controllers" / "puma3.toml")
    exp08 = {**LAW_PRESETS["Exp08"].fixed, "inertia_kgm2": 1}
    for key, value in part.items():
        if key == "law":
            whole[key] = value if "preset" in value else {**exp08, **value}
        else:
            whole[key] = {**whole.get(key, {}), **value} if isinstance(value, dict) else value
    return whole


def test_toml_with_an_unknown_key_is_refused() -> None:
    with pytest.raises(SpecificationError, match="did you mean"):
        resolve(_whole({"safety": {"max_lost_tick": 3}}))
