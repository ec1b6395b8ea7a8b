"""What a controller's own C file is made from, however it computes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from codegen.c99 import Statement
from codegen.controller import Joint
from codegen.structs import Field


class GenerationError(Exception):
    """The C could not be generated or written; nothing was changed."""


@dataclass(frozen=True)
class ControllerSource:
    """The template of a controller's C file and what it is given.

    Attributes:
        template: its name.
        files: of the shared C, those that it needs besides ``tdc.h``.
        statements: the law's quantities in C, in their order.
        context: what the templates are given.
        default_text: a field's default, as the header's comment says it.
    """

    template: str
    files: tuple[str, ...]
    statements: tuple[Statement, ...]
    context: dict[str, Any]
    default_text: Callable[[Field, Joint], str]
