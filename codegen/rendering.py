"""The environment in which templates of C are rendered."""

from __future__ import annotations

import re
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from codegen.status import LOST, Status

TEMPLATES = Path(__file__).parent / "templates"


def environment(folder: Path = TEMPLATES) -> Environment:
    """A jinja2 environment for C: an undefined name is an error, blank lines stay as written."""
    made = Environment(
        loader=FileSystemLoader(folder),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    made.filters["hexadecimal"] = _hexadecimal
    made.globals |= {"statuses": tuple(Status), "lost": sorted(LOST, reverse=True)}
    return made


def _hexadecimal(value: float) -> str:
    """A double as C reads and clang-format keeps it: 0x1.8p+0."""
    return re.sub(r"\.?0*p", "p", value.hex())
