"""Pairs on Dask workers: processes of this machine, or a cluster that somebody else has started.

Import this module only to run something: Dask takes a second to load.
"""

from __future__ import annotations

import contextlib
import logging
import queue
import signal
import tempfile
import threading
import time
import uuid
from collections.abc import Iterator
from concurrent.futures import CancelledError
from typing import Any, Final

import dask
from dask.system import CPU_COUNT
from distributed import Client, Future, KilledWorker, LocalCluster, WorkerPlugin
from distributed.system import MEMORY_LIMIT

from app.batch.case import Case, CaseOutcome
from app.batch.fingerprint import application_version
from app.batch.work import prepare_process, run_case_on_one_core
from core.errors import InputError, WorkError

BYTES_PER_WORKER: Final = 1_500_000_000
"""What a worker should have to itself (docs/cohorts.md has the measured need)."""

_SHARE_OF_MEMORY: Final = 0.9
_CONNECT_S: Final = 30
_NO_WORKER_S: Final = 300
_LOOK_AGAIN_S: Final = 2.0
_ATTEMPTS: Final = 4

_LOCAL_SETTINGS: Final = {
    # a pair whose worker died is tried once more
    "distributed.scheduler.allowed-failures": 1,
    # no pair waits at a worker, where it would be suspected when that worker dies
    "distributed.scheduler.worker-saturation": 1.0,
    # nothing is written to disk, and a worker that holds much memory is ended, never paused
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    # no pages for browsers, no profiling
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    "distributed.worker.profile.enabled": False,
}

_ONE_THREAD: Final = dict.fromkeys(
    ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


class Preparation(WorkerPlugin):
    """Prepares every worker process once, also those that replace one that died."""

    name = "geoderm"

    def __init__(self) -> None:
        self._version = application_version()

    def setup(self, worker: Any) -> None:
        """Load kernels and tracker; refuse to work for another version of the application."""
        if self._version != application_version():
            raise RuntimeError(f"GeoDerm {application_version()} here, {self._version} asks")
        if threading.current_thread() is threading.main_thread():
            # Ctrl+C reaches every process of a terminal; the run itself decides when its workers end
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        prepare_process()

    def teardown(self, worker: Any) -> None:
        """Close the tracker before the process ends."""
        from devices.trackers import close_trackers

        close_trackers()


def default_workers() -> int:
    """Workers for this machine: one for each core, as far as its memory goes."""
    by_memory = int(_SHARE_OF_MEMORY * MEMORY_LIMIT // BYTES_PER_WORKER)
    return max(1, min(CPU_COUNT, by_memory))


class DaskRunner:
    """Hands pairs to Dask workers, no more at once than there are threads.

    Parameters
    ----------
    client : Client
    died : str
        What to say of a pair whose worker died again and again.
    """

    def __init__(self, client: Client, died: str) -> None:
        self._client = client
        self._died = died
        self._finished: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._cases: dict[Any, Case] = {}
        # futures of several runs may live in one scheduler
        self._run = f"geoderm-{uuid.uuid4().hex}"
        self._count = 0
        self._threads = 0
        self._looked = self._with_workers = time.monotonic()
        self._resources = contextlib.ExitStack()
        _prepare(client)
        self._look()

    @classmethod
    def on_this_machine(cls, workers: int, memory_bytes: int | None = None) -> DaskRunner:
        """Start worker processes of this machine, one thread each.

        Parameters
        ----------
        workers : int
        memory_bytes : int, optional
            A worker that holds more is ended. By default an equal share of the machine's memory.
        """
        share = int(_SHARE_OF_MEMORY * MEMORY_LIMIT / workers)
        limit = share if memory_bytes is None else memory_bytes
        died = f"Its worker process died twice (killed, or it needed more than {limit / 1e9:.1f} GB)."
        with contextlib.ExitStack() as resources:
            scratch = resources.enter_context(
                tempfile.TemporaryDirectory(prefix="geoderm-workers-", ignore_cleanup_errors=True)
            )
            resources.enter_context(dask.config.set({**_LOCAL_SETTINGS, "temporary-directory": scratch}))
            resources.enter_context(_quiet())
            cluster = resources.enter_context(_local_cluster(workers, limit, scratch))
            client = resources.enter_context(Client(cluster, set_as_default=False))
            runner = cls(client, died)
            runner._resources = resources.pop_all()
        return runner

    @classmethod
    def on_cluster(cls, address: str) -> DaskRunner:
        """Use the workers of a running Dask scheduler.

        Parameters
        ----------
        address : str
            Such as ``tcp://host:8786`` or ``tls://host:8786``; certificates come from Dask's configuration.
        """
        died = "Its workers died again and again (killed, or out of memory)."
        with contextlib.ExitStack() as resources:
            resources.enter_context(_quiet())
            try:
                client = resources.enter_context(Client(address, timeout=_CONNECT_S, set_as_default=False))
            except (ValueError, TypeError) as error:
                raise InputError(
                    f'--scheduler: "{address}" is no address of a scheduler ({error}).'
                ) from error
            except OSError as error:
                raise WorkError(
                    f"--scheduler: nothing answers at {address}.",
                    "Start the scheduler, or check the address.",
                ) from error
            runner = cls(client, died)
            runner._resources = resources.pop_all()
        return runner

    def capacity(self) -> int:
        """Threads of all workers, looked up every few seconds."""
        if time.monotonic() - self._looked > _LOOK_AGAIN_S:
            self._look()
        return self._threads

    def submit(self, case: Case) -> None:
        """Hand a pair to the scheduler."""
        self._count += 1
        key = (self._run, self._count)
        self._cases[key] = case
        future = self._client.submit(run_case_on_one_core, case, key=key, pure=False)
        future.add_done_callback(self._finished.put)

    def collect(self, timeout_s: float) -> CaseOutcome | None:
        """The outcome of a pair, the first that is ready."""
        try:
            future = self._finished.get(timeout=timeout_s)
        except queue.Empty:
            self._check()
            return None
        case = self._cases.pop(future.key)
        try:
            outcome: CaseOutcome = future.result()
        except KilledWorker:
            return CaseOutcome(case.name, reason=self._died)
        except (CancelledError, OSError) as error:
            raise self._broken() from error
        except Exception as error:  # noqa: BLE001 - what a worker cannot load or hand back costs its pair alone
            return CaseOutcome(case.name, reason=f"The worker could not do it ({type(error).__name__}).")
        return outcome

    def close(self) -> None:
        """End the workers of this machine, or let go of the cluster; pairs under way are given up."""
        with contextlib.suppress(OSError, CancelledError, RuntimeError):
            for key in list(self._cases):
                Future(key, self._client).cancel()
        self._cases.clear()
        self._resources.close()

    def _look(self) -> None:
        now = self._looked = time.monotonic()
        try:
            self._threads = sum(self._client.nthreads().values())
        except (OSError, RuntimeError, CancelledError) as error:
            raise self._broken() from error
        if self._threads:
            self._with_workers = now

    def _check(self) -> None:
        if self._client.status in ("closed", "closing"):
            raise self._broken()
        if time.monotonic() - self._looked > _LOOK_AGAIN_S:
            self._look()
        if time.monotonic() - self._with_workers > _NO_WORKER_S:
            raise WorkError(
                f"No worker has been there for {_NO_WORKER_S // 60} minutes.",
                "Start workers and the same command again: it goes on where it stopped.",
            )

    def _broken(self) -> WorkError:
        return WorkError(
            "The connection to the workers broke off.",
            "Start the same command again: it goes on where it stopped.",
        )


def _local_cluster(workers: int, memory_bytes: int, scratch: str) -> LocalCluster:
    for attempt in range(_ATTEMPTS):
        try:
            return LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                memory_limit=memory_bytes,
                host="127.0.0.1",
                dashboard_address=None,
                scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                silence_logs=logging.CRITICAL,
                local_directory=scratch,
                env=_ONE_THREAD,
            )
        except (OSError, RuntimeError) as error:  # a worker may be killed while it starts, too
            if attempt + 1 == _ATTEMPTS:
                raise WorkError(f"The worker processes could not be started ({error}).") from error
    raise AssertionError("unreachable")


def _prepare(client: Client) -> None:
    """Have every worker prepare itself, those that are there and those to come."""
    for attempt in range(_ATTEMPTS):
        try:
            client.register_plugin(Preparation(), name=Preparation.name)
        except OSError as error:  # a worker was lost meanwhile; the one that replaces it prepares itself
            if attempt + 1 == _ATTEMPTS:
                raise WorkError(f"The workers are lost while they prepare themselves ({error}).") from error
        except Exception as error:
            # whatever the workers lack: the application, its version, a library of it
            raise WorkError(
                f"The workers cannot be prepared ({type(error).__name__}: {error}).",
                "They need the same GeoDerm, installed in their environment.",
            ) from error
        else:
            return


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep what Dask has to say of its own affairs (workers that come and go) off the terminal."""
    loggers = [logging.getLogger(name) for name in ("distributed", "tornado", "asyncio")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
