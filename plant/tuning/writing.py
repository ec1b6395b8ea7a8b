"""Tuned gains written into a specification: the file's own text, with other gains.

Only the values of the gains change. Comments stay; that of a line whose value changes was written
for the old one and stays behind a note that says so.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from codegen.controller import Controller, resolve
from codegen.exact import FINITE_TIME
from codegen.problems import SpecificationError
from plant.propose import data_of
from plant.tuning.gains import Gains, TuningError, decimal

_HEADER = re.compile(r"\s*\[")
_LAW = re.compile(r"\s*\[\s*law\s*\]\s*(#.*)?$")


def tuned_text(text: str, gains: Gains, controller: Controller, how: str) -> str:
    """The specification with other gains.

    Args:
        text: the specification's TOML.
        gains: to write.
        controller: what the text specifies.
        how: by what they were tuned, one line for the top of the file.

    Raises:
        TuningError: the text is written in a way that can't be changed line by line.
    """
    lines = [line.rstrip("\r") for line in text.rstrip("\n").split("\n")]
    values = _values(gains)
    kept = _with_law(lines, values)
    own = {"kd": [j.kd for j in controller.joints], "kp": [j.kp for j in controller.joints]}
    free = _with_law(
        _without_preset(lines),
        {key: _column([decimal(x) for x in column]) for key, column in own.items()} | values,
    )
    wanted = gains.of(controller)
    # A preset that stands against the gains has to go; what else it gave is then written out.
    for changed in (kept, free):
        # Editors look for a schema in the first line.
        top = 1 if changed[0].startswith("#:") else 0
        written = "\n".join([*changed[:top], f"# {how}", *changed[top:]]) + "\n"
        with suppress(SpecificationError, tomllib.TOMLDecodeError):
            if resolve(data_of(written)) == wanted:
                return written
    raise TuningError(
        "the gains can't be written into the file line by line: write its gains as keys of a table "
        "[law], one on each line"
    )


def write_new(path: Path, text: str) -> None:
    """Writes a file that is not there yet, whole or not at all.

    Raises:
        TuningError: it is there already, or can't be written.
    """
    check_new(path)
    try:
        with path.open("x", encoding="utf-8") as file:
            try:
                file.write(text)
            except BaseException:
                path.unlink()
                raise
    except OSError as error:
        raise TuningError(f"{path} can't be written: {error.strerror}") from error


def check_new(path: Path) -> None:
    """Raises a TuningError if the file is there: better before a long tuning than after it."""
    if path.exists():
        raise TuningError(f"{path} is there already: remove it or name another with --output")
    if not path.parent.is_dir():
        raise TuningError(f"{path.parent} is no folder: make it or name another with --output")


def _values(gains: Gains) -> dict[str, str]:
    """The keys of ``[law]`` in TOML."""
    return {
        "inertia_kgm2": _column([decimal(x) for x in gains.inertia]),
        "lambda": decimal(gains.lambda_),
        "alpha": decimal(gains.alpha),
        "beta": f'"{FINITE_TIME}"' if gains.alpha < 1 else "1",
        "gamma": decimal(gains.gamma),
    }


def _column(written: list[str]) -> str:
    return written[0] if len(set(written)) == 1 else f"[{', '.join(written)}]"


def _law(lines: list[str]) -> tuple[int, int]:
    """The first line below ``[law]``, and the one after its last key."""
    headers = [i for i, line in enumerate(lines) if _LAW.match(line)]
    if len(headers) != 1:
        raise TuningError("the gains can't be written into a file without a table [law]")
    first = end = headers[0] + 1
    while end < len(lines) and not _HEADER.match(lines[end]):
        _, end = _entry(lines, end)
    while end > first and (not lines[end - 1].strip() or lines[end - 1].lstrip().startswith("#")):
        end -= 1
    return first, end


def _entry(lines: list[str], at: int) -> tuple[str | None, int]:
    """The key that a line gives a value to, and the line after the value's last."""
    for end in range(at + 1, len(lines) + 1):
        with suppress(tomllib.TOMLDecodeError):
            keys = list(tomllib.loads("\n".join(lines[at:end])))
            return (keys[0] if keys else None), end
    raise TuningError(f"line {at + 1} is no key with its value: {lines[at].strip()}")


def _without_preset(lines: list[str]) -> list[str]:
    first, end = _law(lines)
    at = first
    while at < end:
        key, after = _entry(lines, at)
        if key == "preset":
            note = f"# {lines[at].strip()}: not the tuned gains"
            return [*lines[:at], note, *lines[after:]]
        at = after
    return lines


def _with_law(lines: list[str], values: Mapping[str, str]) -> list[str]:
    """The lines with other values of keys of ``[law]``; those that are not there are added."""
    first, end = _law(lines)
    made: list[str] = []
    left = dict(values)
    at = first
    while at < end:
        key, after = _entry(lines, at)
        value = left.pop(key, None) if key else None
        old = lines[at:after]
        made += old if value is None else _changed(str(key), value, old)
        at = after
    added = [f"{key} = {value} # tuned" for key, value in left.items()]
    return [*lines[:first], *made, *added, *lines[end:]]


def _changed(key: str, value: str, old: list[str]) -> list[str]:
    """The lines of a key with another value; as they are if it is the same."""
    text = "\n".join(old)
    if tomllib.loads(text) == tomllib.loads(f"{key} = {value}"):
        return old
    before, comment = _split(old[-1]) if len(old) == 1 else (text, "")
    was = re.sub(r"\s+", " ", before.partition("=")[2]).strip()
    note = f"# tuned, was {was}" if len(old) == 1 else "# tuned"
    return [f"{key} = {value} {note}" + (f": {comment}" if comment else "")]


def _split(line: str) -> tuple[str, str]:
    """What a line says, and its comment without the ``#``."""
    for at in (i for i, character in enumerate(line) if character == "#"):
        with suppress(tomllib.TOMLDecodeError):
            tomllib.loads(line[:at])
            return line[:at], line[at + 1 :].strip()
    return line, ""
