"""docs/specification.md: every table and key of a specification, from the model itself."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from fractions import Fraction
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from codegen.emit import REPOSITORY
from codegen.exact import InRange
from codegen.presets import LAW_PRESETS, ROBOT_PRESETS, Gain
from codegen.problems import show
from codegen.specification import Specification

_EXAMPLE = REPOSITORY / "controllers" / "puma3.toml"

_HEAD = """\
# The keys of a specification

A specification is a TOML file: one table for what belongs to all, then `[law]`, `[encoder]`,
`[drive]` and `[safety]`. `.venv/bin/python -m codegen reference` makes this page from the model
that checks every file, `codegen/specification.py`; `make check-generated` fails where it is stale.
Editors that know JSON Schema complete the keys with
[specification.schema.json](../controllers/specification.schema.json).

- **Numbers are exact.** `0.4` is 4/10, not the nearest double; fractions are text: `"95/105"`.
- **A number for each joint** is a list in the order of `joint_names`, or a single one for all.
- **Needed** keys must be given, by you or by a [preset](#presets-of-the-law). What you write
  goes before what a preset proposes; what a preset *fixes* can't be changed.
- **Anything else is refused** with key, value, rule and fix, before a file is written: an unknown
  key, a number out of range, gains that fixed-point numbers can't hold.

A whole one, [puma3.toml](../controllers/puma3.toml):
"""


def _prose(type_: Any) -> str:
    """A type in words: what TOML would call it."""
    if get_origin(type_) is Annotated:
        return _prose(get_args(type_)[0])
    if get_origin(type_) is Literal:
        return " or ".join(f"`{show(word)}`" for word in get_args(type_))
    if get_origin(type_) in (UnionType, Union):
        words = {_prose(part): None for part in get_args(type_) if part is not NoneType}
        return " or ".join(words)
    if get_origin(type_) is tuple:
        item = _prose(get_args(type_)[0])
        return f"{item}, or a list of them" if "number" in item else "list of texts"
    return {bool: "true or false", int: "integer", str: "text", Fraction: "number"}[type_]


def _metadata(type_: Any) -> Iterator[Any]:
    """All that a type is annotated with, from outside inwards."""
    if get_origin(type_) is Annotated:
        yield from type_.__metadata__
    for part in get_args(type_):
        if get_origin(type_) is not Literal:
            yield from _metadata(part)


def _range(field: FieldInfo) -> str:
    """The rules that a value is checked by, in words."""
    rules: dict[str, None] = {}
    bounds: dict[str, Any] = {}
    for each in (*field.metadata, *_metadata(field.annotation)):
        # A Field() inside an annotation keeps its own list.
        for part in each.metadata if isinstance(each, FieldInfo) else (each,):
            if isinstance(part, InRange):
                rules[part.rule] = None
            bounds |= {
                name: getattr(part, name)
                for name in ("ge", "le", "min_length", "max_length", "pattern")
                if getattr(part, name, None) is not None
            }
    if "ge" in bounds:
        rules[f"{bounds['ge']} to {bounds['le']}"] = None
    if "min_length" in bounds:
        rules[f"{bounds['min_length']} to {bounds['max_length']} names, all different"] = None
    if "pattern" in bounds:
        rules[f"each like `{bounds['pattern']}`"] = None
    return "; ".join(rules)


def _unit(field: FieldInfo) -> str:
    """What stands in square brackets in the description."""
    found = re.search(r"\[(.+?)\]", field.description or "")
    return found.group(1) if found else ""


def _default(table: str, key: str, field: FieldInfo) -> str:
    if not field.is_required():
        default = field.get_default()
        return "none" if default is None else f"`{show(default)}`"
    robots = [
        f"`{robot.name}`"
        for robot in ROBOT_PRESETS.values()
        if key in (robot.tables.get(table, {}) if table else robot.tables)
    ]
    given = [f"robot {' or '.join(robots)} gives it"] if robots else []
    if table == "law" and any(key in p.fixed or key in p.proposed for p in LAW_PRESETS.values()):
        given = ["presets give it"]
    return ", ".join(["needed", *given])


def _example(field: FieldInfo) -> str:
    """A line as TOML writes it, without the key."""
    (example,) = field.examples or [None]
    return f"`{show(example)}`"


def _cells(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") or " " for cell in cells) + " |"


def fields(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """The keys of a table as the user writes them; tables in it are left out."""
    return {
        field.alias or name: field
        for name, field in model.model_fields.items()
        if not (isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel))
    }


def tables() -> dict[str, type[BaseModel]]:
    """The tables by name; that without a name is the file's own."""
    inner = {
        name: field.annotation
        for name, field in Specification.model_fields.items()
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel)
    }
    return {"": Specification, **inner}


def _table(name: str, model: type[BaseModel]) -> Iterator[str]:
    heading = f"## `[{name}]`" if name else "## Of the whole controller"
    says = re.sub(r"^``\[\w+\]``: ", "", (model.__doc__ or "").split("\n")[0])
    yield heading
    yield ""
    yield says[0].upper() + says[1:] if name else "Above the first table."
    yield ""
    yield _cells(("key", "meaning", "type", "unit", "range", "default", "example"))
    yield "|---|---|---|---|---|---|---|"
    for key, field in fields(model).items():
        meaning = re.sub(r" \[.+?\]", "", field.description or "")
        yield _cells(
            (
                f"`{key}`",
                meaning,
                _prose(field.annotation),
                _unit(field),
                _range(field),
                _default(name, key, field),
                _example(field),
            )
        )
    yield ""


def _gains(gains: dict[str, Gain]) -> str:
    return ", ".join(f"{key} = {value}" for key, value in gains.items())


def _presets() -> Iterator[str]:
    yield "## Presets of the law"
    yield ""
    yield "For `law.preset`, with the paper's equation or table."
    yield ""
    yield _cells(("preset", "paper", "meaning", "fixes", "proposes", "needs"))
    yield "|---|---|---|---|---|---|"
    for preset in LAW_PRESETS.values():
        needs = ", ".join(interval.rule(key) for key, interval in preset.needs.items())
        yield _cells(
            (
                f"`{preset.name}`",
                preset.equation,
                preset.meaning,
                _gains(preset.fixed),
                _gains(preset.proposed),
                needs,
            )
        )
    yield ""
    yield "## Presets of robots"
    yield ""
    yield "For `robot`: numbers that the robot has anyway. What you write goes before them."
    yield ""
    for robot in ROBOT_PRESETS.values():
        yield f"`{robot.name}`: {robot.source} It gives:"
        yield ""
        yield "```toml"
        yield from _toml(robot.tables)
        yield "```"


def _toml(tables_: dict[str, Any]) -> Iterator[str]:
    """Numbers as the reader of TOML takes them; presets keep exact ones as text."""

    def value(given: Any) -> str:
        if isinstance(given, list):
            return "[" + ", ".join(map(value, given)) + "]"
        exact = isinstance(given, str) and re.fullmatch(r"[\d.]+", given)
        return given if exact else json.dumps(given)

    plain = {key: given for key, given in tables_.items() if not isinstance(given, dict)}
    yield from (f"{key} = {value(given)}" for key, given in plain.items())
    for name, table in tables_.items():
        if name not in plain:
            yield ""
            yield f"[{name}]"
            yield from (f"{key} = {value(given)}" for key, given in table.items())


def keys_page() -> str:
    """The page as text that ends in a newline."""
    lines = [_HEAD, "```toml", _EXAMPLE.read_text(encoding="utf-8").rstrip("\n"), "```", ""]
    for name, model in tables().items():
        lines += _table(name, model)
    lines += _presets()
    return "\n".join(lines) + "\n"
