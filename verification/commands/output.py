"""What every command has: where it prints, how it shows progress, and the JSON that it leaves."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from verification.evidence import RESULTS, write_json


def stoppable(main: Callable[[], int]) -> int:
    """Runs a command line; Ctrl-C ends it in words, with the exit code that shells give it."""
    try:
        return main()
    except KeyboardInterrupt:
        print(
            "\nInterrupted: results are written at the end, and those from before are as they "
            "were. The same command starts again.",
            file=sys.stderr,
        )
        return 130


@dataclass(frozen=True)
class Output:
    """Where a command's output goes.

    Attributes:
        as_json: prints the JSON that is left in place of tables.
        console: for people.
        progress: standard error, for what is seen while it lasts.
    """

    as_json: bool
    console: Console
    progress: Console

    @contextmanager
    def bar(self, says: str, total: int | None) -> Iterator[Callable[[int], None]]:
        """A progress bar, endless where there is no total; yields what moves it on.

        A file or a pipe gets a line at its beginning instead.
        """
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
        )
        seen = self._begun(says)
        with Progress(
            *columns, console=self.progress, transient=True, disable=not seen
        ) as progress:
            task = progress.add_task(says, total=total)
            yield lambda done: progress.advance(task, done)

    def status(self, says: str) -> AbstractContextManager[object]:
        """Shows that something goes on."""
        return self.progress.status(says) if self._begun(says) else nullcontext()

    def _begun(self, says: str) -> bool:
        """Whether there is a terminal to show progress on."""
        if not self.progress.is_terminal:
            self.progress.print(f"  {says}")
        return self.progress.is_terminal

    def leave(self, data: Any, name: str) -> None:
        """Writes a command's figures beside what it prints."""
        path = write_json(data, RESULTS / f"{name}.json")
        if self.as_json:
            print(path.read_text(encoding="utf-8"), end="")
        else:
            self.console.print(f"figures: {shown(path)}")


def shown(path: Path) -> Path:
    """A path as a person in the current folder writes it."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
