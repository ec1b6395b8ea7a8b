"""Flies what is missing of a campaign: through joblib in processes, threads or a Dask cluster."""

from __future__ import annotations

import logging
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

import joblib
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from plant.campaign.results import Folder
from plant.campaign.runs import Campaign, CampaignError, Row, fly_plants

Pool = Literal["loky", "threading", "dask"]

BATCH_RUNS = 64
"""About as many runs are a batch: a few seconds, which is what an interruption costs."""

_SCHEDULER_TIMEOUT_S = 20.0


@dataclass(frozen=True)
class Workers:
    """Who flies.

    Attributes:
        pool: processes of this machine (loky), its threads, or a Dask cluster.
        jobs: how many at once; None for one a processor. Not for a scheduler's own workers.
        scheduler: address of a Dask scheduler; None starts processes of this machine, reachable
            from it alone.
    """

    pool: Pool = "loky"
    jobs: int | None = None
    scheduler: str | None = None

    @property
    def count(self) -> int:
        """How many fly at once."""
        return self.jobs or int(joblib.cpu_count())


def fly_missing(
    folder: Folder,
    workers: Workers,
    batch: int | None = None,
    progress: bool | None = None,
) -> None:
    """Flies all plants that are missing and writes each batch as it is finished.

    An exception, Ctrl-C among them, leaves what is finished for the next call.

    Args:
        folder: of the campaign.
        workers: who flies; the rows are the same whoever it is.
        batch: plants in a batch; by default about :data:`BATCH_RUNS` runs.
        progress: shows a progress bar; by default on a terminal only.

    Raises:
        CampaignError: there is no Dask, or its scheduler doesn't answer, or a worker would
            compile other C.
    """
    campaign = folder.campaign
    batches = folder.missing(batch or max(1, BATCH_RUNS // campaign.runs_per_plant))
    if not batches:
        return
    with _bar(campaign, len(folder.finished()), progress) as advance, _backend(workers) as jobs:
        # A task is a whole batch: joblib need not make larger ones.
        parallel = joblib.Parallel(jobs, return_as="generator_unordered", batch_size=1)
        tasks = (joblib.delayed(_fly)(campaign, plants) for plants in batches)
        finished = parallel(tasks)
        try:
            for plants, rows in finished:
                folder.add(plants, rows)
                advance(len(rows))
        finally:
            _close(finished)


def _close(finished: Generator[Any, None, None]) -> None:
    """Stops what is still being flown, if anything is."""
    with warnings.catch_warnings():
        # joblib regrets the batches that nobody will take.
        warnings.simplefilter("ignore", UserWarning)
        finished.close()


def _fly(campaign: Campaign, plants: range) -> tuple[range, list[Row]]:
    return plants, fly_plants(campaign, plants)


@contextmanager
def _backend(workers: Workers) -> Iterator[int]:
    """Makes a pool joblib's backend; gives the number of jobs."""
    if workers.pool == "dask":
        with _dask(workers), joblib.parallel_config("dask"):
            yield -1
    else:
        with joblib.parallel_config(workers.pool):
            yield workers.count


@contextmanager
def _dask(workers: Workers) -> Iterator[None]:
    """A client of the given scheduler, or of processes of this machine."""
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise CampaignError(
            "the package distributed is not installed: make installs it, or pip install distributed"
        ) from error
    if workers.scheduler is not None:
        try:
            client = Client(workers.scheduler, timeout=_SCHEDULER_TIMEOUT_S)
        except (OSError, ValueError) as error:
            raise CampaignError(
                f"no Dask scheduler answers at {workers.scheduler}: start one with `dask "
                "scheduler`, and workers with `dask worker ADDRESS`"
            ) from error
        with client:
            yield
        return
    with _interrupts_ignored():
        cluster = LocalCluster(
            n_workers=workers.count,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            # Batches that are given up at the end are no news.
            silence_logs=logging.ERROR,
        )
    with cluster, Client(cluster):
        yield


@contextmanager
def _interrupts_ignored() -> Iterator[None]:
    """Processes that are started meanwhile leave Ctrl-C to this one, which then ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _bar(
    campaign: Campaign, finished: int, progress: bool | None
) -> Iterator[Callable[[int], None]]:
    """A progress bar of runs; gives what advances it."""
    if progress is None:
        progress = sys.stderr.isatty()
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("runs,"),
        TimeElapsedColumn(),
        TextColumn("gone,"),
        TimeRemainingColumn(),
        TextColumn("to go"),
    )
    with Progress(*columns, console=Console(stderr=True), disable=not progress) as bar:
        done = finished * campaign.runs_per_plant
        task = bar.add_task(f"flying {campaign.shipped.name}", total=campaign.runs, completed=done)
        yield lambda runs: bar.advance(task, runs)
