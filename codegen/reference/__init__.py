"""References in docs/ that are made from the model of specifications and from the C's headers.

Nothing here shapes the generated C.
"""

from __future__ import annotations

from pathlib import Path

from codegen.emit import REPOSITORY
from codegen.reference.c_api import c_api_page
from codegen.reference.keys import keys_page

DOCS = REPOSITORY / "docs"


def pages(generated: Path) -> dict[Path, str]:
    """The references by their paths, from the model and the headers below a folder."""
    return {DOCS / "specification.md": keys_page(), DOCS / "c-api.md": c_api_page(generated)}
