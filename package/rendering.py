"""How the files of a package are rendered."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from codegen.rendering import environment

TEMPLATES = Path(__file__).parent / "templates"

_ENVIRONMENT = environment(TEMPLATES)
_ENVIRONMENT.filters["thousands"] = lambda x: "–" if x is None else f"{x:,.0f}".replace(",", " ")


def text(template: str, values: dict[str, Any]) -> str:
    """What a template gives; an undefined name is an error."""
    return _ENVIRONMENT.get_template(template).render(values)
