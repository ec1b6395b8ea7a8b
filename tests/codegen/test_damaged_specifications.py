"""Damaged specifications: a controller, or words about each mistake; nothing else is raised."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from codegen.__main__ import main
from codegen.controller import load, read, resolve
from codegen.emit import generate
from codegen.literals import UnprintableError
from codegen.presets import LAW_PRESETS, ROBOT_PRESETS
from codegen.problems import Problem, SpecificationError
from codegen.specification import json_schema
from tests.damaged_toml import UNREADABLE, damaged_files

CONTROLLERS = sorted((Path(__file__).parents[2] / "controllers").glob("*.toml"))
SLOW = (HealthCheck.too_slow, HealthCheck.function_scoped_fixture)


def keys_of_the_schema() -> list[tuple[str, ...]]:
    """Every key that a specification may have, behind those of the tables that it is in."""
    schema = json.loads(json_schema())
    keys: list[tuple[str, ...]] = []

    def walk(node: Mapping[str, Any], path: tuple[str, ...]) -> None:
        if "$ref" in node:
            walk(schema["$defs"][node["$ref"].rsplit("/", 1)[1]], path)
        for name, inner in node.get("properties", {}).items():
            keys.append((*path, name))
            walk(inner, (*path, name))

    walk(schema, ())
    return keys


KEYS = keys_of_the_schema()

_PLAUSIBLE = st.sampled_from(
    [
        *(0, 1, 2, -1, -100, 10**6, 2**31, "1/3", "7/5", Decimal("0.5"), Decimal("1e-5")),
        *(Decimal(f"1e{power}") for power in (-320, -40, -12, -9, 9, 20, 300)),
        *("fixed-point", "float64", "precise", "half-sample", "error-difference", "delayed"),
        *("zero", "hold", "finite-time", True, False),
    ]
)
_NUMBERS = st.one_of(
    st.integers(),
    st.floats(),
    st.decimals(),
    st.sampled_from([Decimal("1e-400"), Decimal("1e400"), Decimal("sNaN"), 2**63, 10**400]),
)
_WORDS = st.one_of(
    st.text(max_size=40),
    st.sampled_from(["1/0", "-1/3", "1e400", "nan", *LAW_PRESETS, *ROBOT_PRESETS]),
)
_NEW_KEYS = st.text(st.characters(categories=["L", "N", "P", "S"]), min_size=1, max_size=6)
_ANYTHING = st.recursive(
    st.none() | st.booleans() | _NUMBERS | _WORDS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(_NEW_KEYS, inner, max_size=2),
    max_leaves=6,
)


@st.composite
def changed_data(
    draw: st.DrawFn, values: st.SearchStrategy[Any], most: int, may_remove: bool = True
) -> dict[str, Any]:
    """Shipped data with some keys changed, added or taken away."""
    data = read(draw(st.sampled_from(CONTROLLERS)))
    for _ in range(draw(st.integers(1, most))):
        *tables, last = draw(st.sampled_from(KEYS))
        here: Any = data
        for table in tables:
            here = here.setdefault(table, {}) if isinstance(here, dict) else None
        if isinstance(here, dict) and may_remove and last in here and draw(st.booleans()):
            del here[last]
        elif isinstance(here, dict):
            here[last] = draw(values)
    return data


def is_refused(attempt: Callable[[], object]) -> bool:
    """Whether there are mistakes; each must have a key, a value, a rule and a fix, of a line."""
    problems: tuple[Problem, ...] | None = None
    try:
        attempt()
    except SpecificationError as error:
        problems = error.problems
    except UnprintableError:
        return True
    assert problems != ()
    for problem in problems or ():
        for words in (problem.key, problem.value, problem.rule, problem.fix):
            assert words
            assert "\n" not in words
    return problems is not None


@settings(max_examples=200, deadline=None, suppress_health_check=SLOW)
@given(content=damaged_files([path.read_bytes() for path in CONTROLLERS]))
def test_a_damaged_file_is_refused_in_words_and_writes_nothing(
    tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(content)
    if is_refused(lambda: load(path)):
        output = tmp_path / "generated"
        assert main(["generate", str(path), "--output", str(output)]) == 2
        assert not output.exists()


@settings(max_examples=300, deadline=None, suppress_health_check=SLOW)
@given(data=changed_data(_PLAUSIBLE | _ANYTHING, 5))
def test_damaged_data_is_taken_or_refused_in_words(data: dict[str, Any]) -> None:
    is_refused(lambda: resolve(data))


@settings(max_examples=60, deadline=None, suppress_health_check=SLOW)
@given(data=changed_data(_PLAUSIBLE, 2, may_remove=False))
def test_what_is_taken_becomes_c_or_is_refused_in_words(data: dict[str, Any]) -> None:
    is_refused(lambda: generate(resolve(data)))


@pytest.mark.parametrize("content", UNREADABLE.values(), ids=UNREADABLE.keys())
def test_what_is_no_toml_is_refused_in_words(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(content)
    assert is_refused(lambda: load(path))


def test_a_key_is_shown_in_one_line() -> None:
    data = read(CONTROLLERS[0])
    data["safety"]["\n"] = 1
    assert is_refused(lambda: resolve(data))


def test_a_gain_beyond_what_fixed_point_can_scale_is_refused_in_words() -> None:
    data = read(next(path for path in CONTROLLERS if path.stem == "puma3_fixed"))
    data["law"]["lambda"] = Decimal("1e38")
    assert is_refused(lambda: generate(resolve(data)))
