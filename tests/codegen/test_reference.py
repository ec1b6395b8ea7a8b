"""docs/specification.md and docs/c-api.md: current, complete, and true."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

from codegen.__main__ import GENERATED
from codegen.controller import read, resolve
from codegen.emit import REPOSITORY
from codegen.problems import SpecificationError
from codegen.reference import DOCS, pages
from codegen.reference.c_api import parse
from codegen.reference.keys import fields, tables

PUMA3 = REPOSITORY / "controllers" / "puma3.toml"
WITHOUT_PRESETS = REPOSITORY / "examples" / "03_your_own_urdf" / "controller.toml"
KEYS = [(table, key) for table, model in tables().items() for key in fields(model)]


@pytest.fixture(scope="module")
def c_api() -> str:
    return (DOCS / "c-api.md").read_text(encoding="utf-8")


def test_the_committed_pages_are_current() -> None:
    for path, text in pages(GENERATED).items():
        assert path.read_text(encoding="utf-8") == text, "run `python -m codegen reference`"


# --- The keys ----------------------------------------------------------------------------------


def rows() -> dict[tuple[str, str], list[str]]:
    """The cells of each key's row, read back from the page."""
    found: dict[tuple[str, str], list[str]] = {}
    table = ""
    for line in (DOCS / "specification.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            heading = re.match(r"## `\[(\w+)\]`", line)
            table = heading.group(1) if heading else ""
        row = re.match(r"\| `(\w+)` \|", line)
        if row and (table, row.group(1)) in KEYS:
            found[table, row.group(1)] = [cell.strip() for cell in line.split(" | ")]
    return found


def with_value(table: str, key: str, value: Any) -> dict[str, Any]:
    """puma3.toml with another value."""
    data = read(PUMA3)
    if table:
        data[table] = {**data.get(table, {}), key: value}
    else:
        data[key] = value
    return data


def test_every_key_has_a_row_with_meaning_type_default_and_example() -> None:
    assert rows().keys() == set(KEYS)
    for cells in rows().values():
        _, meaning, type_, _, _, default, example = cells
        assert all((meaning, type_, default, example))


@pytest.mark.parametrize(("table", "key"), KEYS)
def test_a_unit_in_a_keys_name_is_the_unit_of_its_row(table: str, key: str) -> None:
    units = {"_kgm2": "kg m^2", "_Nm": "N m", "_rad_per_s2": "rad/s^2", "_rad_per_s": "rad/s",
             "_time_s": "s"}  # fmt: skip
    suffix = next((s for s in units if key.endswith(s)), None)
    if suffix:
        assert rows()[table, key][3] == units[suffix]


@pytest.mark.parametrize(("table", "key"), KEYS)
def test_the_example_of_a_key_is_taken(table: str, key: str) -> None:
    (example,) = fields(tables()[table])[key].examples or []
    resolve(with_value(table, key, example))


@pytest.mark.parametrize(("table", "key"), KEYS)
def test_what_is_out_of_the_range_that_is_told_is_refused_by_that_rule(
    table: str, key: str
) -> None:
    cells = rows()[table, key]
    wrong = 0 if cells[4] == "not 0" else -1
    if "number" in cells[2]:
        rule = cells[4].split("; ")[0]
        assert rule
        with pytest.raises(SpecificationError, match=re.escape(rule)):
            resolve(with_value(table, key, wrong))


@pytest.mark.parametrize(("table", "key"), KEYS)
def test_needed_is_what_can_not_be_left_out(table: str, key: str) -> None:
    data = read(WITHOUT_PRESETS)
    (data.get(table, {}) if table else data).pop(key, None)
    if rows()[table, key][5].startswith("needed"):
        with pytest.raises(SpecificationError, match="this key is needed"):
            resolve(data)
    else:
        resolve(data)


# --- The headers -------------------------------------------------------------------------------


HEADERS = sorted(
    path
    for name in ("puma3", "puma3_precise", "puma3_float64", "puma3_fixed")
    for path in (GENERATED / name).glob("*.h")
)


def declared(header: Path, scratch: Path) -> set[str]:
    """What a compiler finds declared in a header: functions, types, fields, values, macros."""
    source = scratch / "all.c"
    source.write_text(f'#include "{header}"\n', encoding="utf-8")
    listing, objects = scratch / "functions", scratch / "all.o"
    keep = ("-fno-eliminate-unused-debug-types", "-fno-eliminate-unused-debug-symbols")
    subprocess.run(
        ["gcc", "-std=c99", "-g", *keep, "-aux-info", listing, "-c", source, "-o", objects],
        check=True,
    )
    own = f"{header}:"
    functions = {
        match.group(1)
        for line in listing.read_text(encoding="utf-8").splitlines()
        if own in line and (match := re.search(r"(\w+) \(", line.split("*/", 1)[1]))
    }
    entries = subprocess.run(
        ["readelf", "--debug-dump=info", objects], check=True, capture_output=True, text=True
    ).stdout
    kinds = r"DW_TAG_(?:member|enumerator|typedef)"
    named = set(re.findall(rf"{kinds}\)\n.*?DW_AT_name\s+: (?:\(.*?\): )?(\w+)", entries))
    text = header.read_text(encoding="utf-8")
    types = {name for name in named if re.search(rf"\b{name}\b", text)}
    macros = subprocess.run(
        ["gcc", "-std=c99", "-E", "-dD", source], check=True, capture_output=True, text=True
    ).stdout
    inside, defined = False, set()
    for line in macros.splitlines():
        if line.startswith("# "):
            inside = f'"{header}"' in line
        elif inside and (match := re.match(r"#define (TDC_\w+) .", line)):
            defined.add(match.group(1))
    return functions | types | defined


@pytest.mark.parametrize("header", HEADERS, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_everything_that_a_compiler_finds_in_a_header_is_on_the_page(
    header: Path, c_api: str, tmp_path: Path
) -> None:
    found = declared(header, tmp_path)
    assert found
    words = set(re.findall(r"\w+", c_api))
    symbols = parse(header.name, header.read_text(encoding="utf-8")).symbols
    tables_ = [s for s in symbols if s.kind == "structure" and not s.doc]
    inside = {
        re.sub(r"\[.*", "", member.declaration).split()[-1]
        for table in tables_
        for member in table.members
    }
    standard = {name for name in found if re.fullmatch(r"u?int\d+_t", name)}
    # What puma3_precise declares of its own is what puma3 does.
    names = {re.sub("_precise", "", n, flags=re.IGNORECASE) if "puma3" in n.lower() else n
             for n in found - inside - standard}  # fmt: skip
    assert names - words == set()


def test_every_function_of_a_controller_has_a_contract(c_api: str) -> None:
    for function in ("check_config", "init", "step"):
        header = GENERATED / "puma3" / "tdc_puma3.h"
        (symbol,) = (
            s
            for s in parse(header.name, header.read_text(encoding="utf-8")).symbols
            if s.name == f"tdc_puma3_{function}"
        )
        section = c_api.split(f"### `{symbol.name}`\n")[1].split("\n### ")[0]
        plain = section.replace("`", "")
        for sentence in re.split(r"(?<=\.) ", " ".join(symbol.doc.split())):
            last = sentence.split("  ")[-1]
            assert " ".join(last.split()[-4:]) in " ".join(plain.split())


def test_a_header_that_is_not_closed_is_told() -> None:
    with pytest.raises(ValueError, match="isn't closed"):
        parse("x.h", "typedef struct {\n    int a;\n")
