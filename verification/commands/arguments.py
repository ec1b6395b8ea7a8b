"""Arguments that several commands share."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from codegen.controller import Controller, load
from verification.experiments import CONTROLLERS

LEAST_STEPS = 100
"""Fewer may hold no step that succeeds, and say nothing."""
NAMES = ("puma3", "puma6")
"""The controllers in floating point that all structures of the law are checked on."""


def add_controllers(parser: argparse.ArgumentParser) -> None:
    """Which controllers."""
    parser.add_argument(
        "--controller", action="append", metavar="NAME", help="of controllers/; again for more"
    )


def controllers(names: Sequence[str]) -> list[Controller]:
    """The repository's controllers of these names."""
    return [load(CONTROLLERS / f"{name}.toml") for name in names]


def add_steps(parser: argparse.ArgumentParser, default: int, says: str) -> None:
    """How many random steps."""
    parser.add_argument("--steps", type=_steps, default=default, help=says)


def _steps(text: str) -> int:
    if not text.isdecimal() or not LEAST_STEPS <= int(text) <= 10**9:
        raise argparse.ArgumentTypeError(
            f"a number of steps from {LEAST_STEPS} to 10^9, not {text!r}"
        )
    return int(text)
