"""Jobs on a Dask cluster: the same children as on this machine, one at a time under each worker.

A worker supervises a child per job (`local`), so that limits, crashes and the bytes of a result
are those of a local sweep. Workers write nothing: results come back over the network, and
whoever runs the sweep stores them. A job whose child takes the worker itself down is tried on
as many workers as the scheduler allows (`distributed.scheduler.allowed-failures`), at last
alone, then counted as killed; the others go on.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib
import logging
import multiprocessing
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from functools import partial
from typing import Any

from uavexp.errors import ConfigError, UavexpError, one_line
from uavexp.store.records import Status
from uavexp.sweep.faults import failure
from uavexp.sweep.fork_server import start_fork_server
from uavexp.sweep.job import Allowance, Answer, Call, Done, Job
from uavexp.sweep.local import run_local

_ALLOWED_FAILURES = 1  # workers that one job may take down beyond the first
_WORKER_MB = 2000  # of a worker itself and its fork server
_ANSWER_S = 10.0  # a scheduler may take so long to answer, and half of it to have a worker
_TRIES = 10  # to find a worker
_PARTING_S = 3.0  # the parting from it
_LOST = "the Dask cluster was lost; start it again, and the same command flies what is left"


class LostError(UavexpError):
    """The cluster is gone."""

    exit_code = 1  # no fault of what was typed


def run_dask(
    call: Call,
    jobs: Iterable[Job],
    *,
    address: str | None,
    queue: str | None,
    n_jobs: int,
    limits: Allowance,
    preload: Sequence[str] = (),
    version: Callable[[], Any] | None = None,
) -> Generator[Done, None, None]:
    """Run jobs on a cluster and yield each when it has ended.

    Closing the iterator cancels what has not begun; workers that were started for this sweep
    are stopped with all they run, those of a cluster that was there before finish their job.

    Args:
        call: what to call, importable by name on the workers.
        jobs: what to run.
        address: of a scheduler; None starts a cluster for this sweep.
        queue: None starts it on this machine, "slurm" through dask-jobqueue.
        n_jobs: workers of a cluster that is started.
        limits: of each job.
        preload: modules that each worker's fork server imports.
        version: must return the same on every worker as here; asked once, before anything is submitted.

    Raises:
        UavexpError: Dask is not installed, the cluster cannot be reached or is lost, or other
            versions run there.
    """
    distributed = _import("distributed")
    with contextlib.ExitStack() as stack:
        stack.enter_context(_no_logging())
        where = address or stack.enter_context(_cluster(distributed, queue, n_jobs, limits))
        client = _client(distributed, where, address)
        stack.callback(client.close, timeout=_PARTING_S)
        _require_same_versions(client, version)
        fly = partial(client.submit, _run_on_worker, call, limits=limits, preload=tuple(preload), pure=False)
        futures = {fly(job, key=job.name): job for job in jobs}
        stack.callback(lambda: _cancel(client, list(futures)))  # those that have not ended
        suspects: list[Job] = []
        for future in distributed.as_completed(list(futures), loop=client.loop):
            job = futures.pop(future)
            done = _done(job, future)
            future.release()  # or its result stays in the memory of a worker
            if done is None:
                suspects.append(job)
            else:
                yield done
        for job in suspects:  # a worker's death is laid to all jobs that it held: now each alone
            future = fly(job, key=f"{job.name} alone")
            stack.callback(_cancel, client, [future])
            yield _done(job, future) or _killed(job)


def _client(distributed: Any, where: Any, address: str | None) -> Any:
    """Who speaks to a cluster."""
    if address is not None:
        _check_scheduler(distributed, address)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", distributed.versions.VersionMismatchWarning)  # told later
        return distributed.Client(where, set_as_default=False)


def _check_scheduler(distributed: Any, address: str) -> None:
    """Refuse an address where no scheduler answers, or one without workers, in seconds.

    A client of Dask's own waits for ever for who accepts and then says nothing.
    """
    try:
        asyncio.run(asyncio.wait_for(_wait_for_worker(distributed, address), _ANSWER_S))
    except _NoWorkerError as error:
        words = f"the scheduler has no worker; start some, dask worker {address}"
        raise ConfigError(f"runner.address={address}: {words}") from error
    except Exception as error:  # whatever speaks at that port, it comes out as anything
        words = one_line(error)[:200] or f"nothing came in {_ANSWER_S:g} s"
        raise ConfigError(f"runner.address={address}: no Dask scheduler answers ({words})") from error


class _NoWorkerError(Exception):
    """A scheduler answers, and has nobody to fly."""


async def _wait_for_worker(distributed: Any, address: str) -> None:
    arguments = distributed.Security().get_connection_args("client")
    async with distributed.core.rpc(address, connection_args=arguments) as scheduler:
        for _ in range(_TRIES):
            if (await scheduler.identity())["workers"]:
                return
            await asyncio.sleep(_ANSWER_S / _TRIES / 2)
    raise _NoWorkerError


def _cancel(client: Any, futures: Sequence[Any]) -> None:
    """Cancel what has not ended; a cluster that was lost has nothing left to cancel."""
    if client.status == "running":
        with contextlib.suppress(Exception):
            client.cancel(futures)


@contextlib.contextmanager
def _no_logging() -> Iterator[None]:
    """Nothing of what Dask logs; what matters of it comes back as the end of a job or of the sweep."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)


def _require_same_versions(client: Any, version: Callable[[], Any] | None) -> None:
    """Refuse a cluster whose scheduler or workers run other packages, or other code by `version`."""
    differing = differing_packages(client.get_versions(check=False))
    if differing:
        raise ConfigError(
            f"the Dask cluster runs other versions than this command: {'; '.join(differing)}; "
            "start it from the same environment"
        )
    # workers that come later are not asked here; what they return is checked by who calls
    answers = client.run(version, on_error="return") if version is not None else {}
    strange = [worker for worker, answer in answers.items() if version is not None and answer != version()]
    if strange:
        raise ConfigError(
            f"{len(strange)} of {len(answers)} Dask workers run another version of uavexp than this command, "
            f"or none ({strange[0]}); install the same there"
        )


def differing_packages(versions: Mapping[str, Any]) -> list[str]:
    """Packages whose version on the scheduler or on a worker is not the client's, each with both.

    Args:
        versions: of `distributed.Client.get_versions`.
    """
    here: Mapping[str, str | None] = versions["client"]["packages"]
    others = [versions["scheduler"], *versions["workers"].values()]
    return [
        f"{name} {', '.join(sorted(found))} there, {wanted} here"
        for name, wanted in here.items()
        if (found := {str(part["packages"].get(name)) for part in others if part} - {str(wanted)})
    ]


def _done(job: Job, future: Any) -> Done | None:
    """What became of a job; None when the workers that held it died."""
    try:
        done: Done = future.result()
    except CancelledError as error:
        raise LostError(_LOST) from error
    except Exception as error:
        if type(error).__name__ == "KilledWorker":
            return None
        return Done(job=job, answer=failure(error), wall_s=0.0)
    return done


def _killed(job: Job) -> Done:
    answer = Answer(status=Status.KILLED, reason="every Dask worker that ran it died")
    return Done(job=job, answer=answer, wall_s=0.0)


def _run_on_worker(call: Call, job: Job, *, limits: Allowance, preload: tuple[str, ...]) -> Done:
    """Supervise one job on a worker."""
    # a worker under Dask's nanny is a daemon, to which multiprocessing denies children; these
    # cannot be left behind, they die with it (`child`)
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    start_fork_server(preload)
    return next(run_local(call, [job], n_jobs=1, limits=limits))


def _cluster(distributed: Any, queue: str | None, n_jobs: int, limits: Allowance) -> Any:
    """A cluster for this sweep, to be closed with it."""
    _import("dask").config.set({"distributed.scheduler.allowed-failures": _ALLOWED_FAILURES})
    if queue is None:
        try:
            return distributed.LocalCluster(
                n_workers=n_jobs,
                threads_per_worker=1,
                dashboard_address=None,
                memory_limit=0,  # each child has its own
                silence_logs=logging.CRITICAL,  # the death of a worker is told as the end of its job
            )
        except Exception as error:  # a worker that dies as it starts comes out as anything
            words = one_line(error)[:200] or type(error).__name__
            raise LostError(f"no Dask workers could be started on this machine ({words})") from error
    cluster = slurm_cluster(limits)
    cluster.scale(n_jobs)
    return cluster


def slurm_cluster(limits: Allowance) -> Any:
    """SLURM jobs of one worker each; partition, account and time come from Dask's `jobqueue.yaml`."""
    memory_mb = int(limits.memory_mb) + _WORKER_MB
    return _import("dask_jobqueue").SLURMCluster(cores=1, processes=1, memory=f"{memory_mb}MB")


def _import(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ConfigError(f"runner.backend=dask needs Dask ({error}): pip install 'uavexp[dask]'") from error
