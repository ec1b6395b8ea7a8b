"""What is wrong with a specification, in the user's words."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pydantic_core import PydanticCustomError


@dataclass(frozen=True)
class Problem:
    """One mistake in a specification."""

    key: str
    value: str
    rule: str
    fix: str

    def __str__(self) -> str:
        return f"{self.key} = {self.value}\n    rule: {self.rule}\n    fix:  {self.fix}"


class SpecificationError(Exception):
    """A specification that can't be used, with all that is wrong with it."""

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        self.source = source
        self.problems = tuple(problems)
        super().__init__("\n".join(f"{source}: {problem}" for problem in self.problems))


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word that is most like the given one, or None when none is close."""
    matches = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return matches[0] if matches else None


def show(value: object) -> str:
    """A value as TOML would write it, short enough for a line."""
    if isinstance(value, dict):
        return "{...}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(show(v) for v in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value if len(value) <= 60 else value[:57] + "...")
    return str(value)


def broken(rule: str, fix: str) -> PydanticCustomError:
    """A broken rule for pydantic to collect, with the fix."""
    return PydanticCustomError("rule", "{rule}; {fix}", {"rule": rule, "fix": fix})
