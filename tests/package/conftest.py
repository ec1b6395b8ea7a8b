"""What takes long is made once for all workers of a run."""

from __future__ import annotations

import fcntl
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from package.figures import Figures, figures
from package.recording import record
from tests.package.subjects import M4F, Subject, controller, fmu_of, library_of, packaged


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], Any]], Any]:
    base = tmp_path_factory.getbasetemp()
    # The workers of one run share the folder above their own.
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def made(name: str, make: Callable[[Path], Any]) -> Any:
        folder = shared / name
        with (shared / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not (folder / "done").exists():
                folder.mkdir(exist_ok=True)
                (folder / "done").write_bytes(pickle.dumps(make(folder)))
        return pickle.loads((folder / "done").read_bytes())

    return made


@pytest.fixture(scope="session")
def subject(once: Callable[..., Subject]) -> Subject:
    def made(folder: Path) -> Subject:
        flight = record(controller("puma3"), library=library_of("puma3"))
        return Subject(fmu_of(packaged("puma3"), folder), flight)

    return once("package-subject", made)


@pytest.fixture(scope="session")
def figures_of_fixed(once: Callable[..., Figures]) -> Figures:
    return once("package-figures", lambda _: figures(controller("puma3_fixed"), [M4F]))
