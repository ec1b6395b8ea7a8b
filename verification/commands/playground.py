"""`python -m verification playground`: the shipped C as WebAssembly, in a page with sliders."""

from __future__ import annotations

import argparse

from plant.native import BUILD
from verification.commands.output import Output, shown
from verification.playground.page import write

PAGE = BUILD / "playground" / "index.html"


def run(arguments: argparse.Namespace, output: Output) -> int:  # noqa: ARG001 - has no options
    """Runs the command; see :mod:`verification.__main__`."""
    with output.status("compiling to WebAssembly, recording what the host answers"):
        page = write(PAGE)
    size = page.stat().st_size
    if not output.as_json:
        output.console.print(f"page: {shown(page)} ({size / 1e6:.1f} MB; it needs no network)")
    output.leave({"page_bytes": size}, "playground")
    return 0
