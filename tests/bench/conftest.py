"""What the tests of the bench share: it runs once, on all cores."""

from __future__ import annotations

import fcntl
import os
import pickle

import pytest

from verification.bench.rows import Result, measure


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return measure()
    # The workers of one run share the folder above their own: the first one measures for all.
    shared = tmp_path_factory.getbasetemp().parent / "bench.pickle"
    with shared.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not shared.exists():
            shared.write_bytes(pickle.dumps(measure()))
        found = pickle.loads(shared.read_bytes())
    assert isinstance(found, Result)
    return found
