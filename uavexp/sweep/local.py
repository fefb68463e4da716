"""Jobs on this machine: a pool of threads, each of which supervises one child process at a time.

joblib's own process pool loses the whole sweep when one worker dies. Its threads start each
job as a fresh child of a fork server that has the heavy imports and compiled kernels
already, so that a crash, a hang or a hunger for memory costs that job alone.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import forkserver
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerProcess
from multiprocessing.reduction import send_handle
from typing import IO

from uavexp.store.records import Status
from uavexp.sweep.child import run_child
from uavexp.sweep.faults import death
from uavexp.sweep.job import Allowance, Answer, Call, Done, Job

Watch = Callable[[Job, float, str], None]  # job, simulated time s, a few words

_PARTING_S = 5.0  # a child that has answered may take so long to end
_DUMP_BYTES = 20_000
_TETHER = "uavexp.sweep.tether"


def start_fork_server(preload: Sequence[str] = ()) -> None:
    """Start the fork server, if none runs; call it from the main thread, with whose end it dies.

    Args:
        preload: modules that it imports once, for all children.
    """
    multiprocessing.get_context("forkserver").set_forkserver_preload([_TETHER, *preload])
    forkserver.ensure_running()


def run_local(
    call: Call,
    jobs: Iterable[Job],
    *,
    n_jobs: int,
    limits: Allowance,
    watch: Watch | None = None,
) -> Generator[Done, None, None]:
    """Run jobs, so many at a time, and yield each when it has ended.

    When the iterator is closed, or the consumer interrupted, the running children are killed.

    Args:
        call: what to call, importable by name.
        jobs: taken one by one, in this order.
        n_jobs: children at a time, >= 1.
        limits: of each job.
        watch: told the progress of every job, from its supervising thread.
    """
    from joblib import Parallel, delayed  # 0.2 s that the start of the fork server need not wait for

    supervisor = _Supervisor(call=call, limits=limits, watch=watch)
    pool = Parallel(n_jobs=n_jobs, backend="threading", return_as="generator_unordered", batch_size=1)
    results = pool(delayed(supervisor.run)(job) for job in jobs)
    try:
        # not `yield from`: when closed, the children must be killed before joblib waits for them
        for done in results:  # noqa: UP028
            yield done
    finally:
        supervisor.stop()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # joblib's advice about tasks that were cut short
            results.close()


@dataclass(slots=True, kw_only=True)
class _Supervisor:
    """Runs jobs in children, from several threads at once."""

    call: Call
    limits: Allowance
    watch: Watch | None
    # multiprocessing's bookkeeping of children is not made for threads: two that poll one child
    # at the same time may both take its exit code, and one gets a wrong one
    _lock: threading.Lock = field(default_factory=threading.Lock)
    # an interrupt is raised in the main thread, where joblib runs the jobs when they go one at a
    # time; here it finds no child half begun
    _starter: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(max_workers=1))
    _living: set[ForkServerProcess] = field(default_factory=set)
    _stopped: bool = False

    def run(self, job: Job) -> Done:
        """Run one job to its end, whatever that is."""
        begin_s = time.monotonic()
        with tempfile.TemporaryFile() as errors:
            answer = self._answer(job, errors)
        return Done(job=job, answer=answer, wall_s=time.monotonic() - begin_s)

    def stop(self) -> None:
        """Kill every child, wait until it is gone, and let no other start."""
        with self._lock:
            self._stopped = True
            for child in self._living:
                _kill(child)
            for child in self._living:
                child.join(_PARTING_S)

    def _answer(self, job: Job, errors: IO[bytes]) -> Answer:
        deadline_s = time.monotonic() + self.limits.timeout_s
        started = self._starter.submit(self._start, job, errors).result()
        if started is None:
            return Answer(status=Status.KILLED, reason="the sweep was stopped")
        child, connection = started
        with connection:
            answer = self._wait(job, child, connection, deadline_s)
            hung = answer is not None and answer.status is Status.HUNG
            exit_code = self._end(child, grace_s=0.0 if hung else _PARTING_S)
        return answer if answer is not None else death(exit_code, _tail(errors))

    def _start(self, job: Job, errors: IO[bytes]) -> tuple[ForkServerProcess, Connection] | None:
        context = multiprocessing.get_context("forkserver")
        ours, theirs = context.Pipe()
        with self._lock, theirs:
            if self._stopped:
                return None
            arguments = (theirs, self.call, job.payload, self.limits.memory_mb)
            child = context.Process(target=run_child, args=arguments, daemon=True)
            child.start()
            self._living.add(child)
        with contextlib.suppress(OSError, ValueError):  # it is dead already, or its job was given up
            send_handle(ours, errors.fileno(), child.pid)
        return child, ours

    def _wait(
        self, job: Job, child: ForkServerProcess, connection: Connection, deadline_s: float
    ) -> Answer | None:
        """The child's answer; None when it died without one."""
        while (left_s := deadline_s - time.monotonic()) > 0.0:
            ready = wait([connection, child.sentinel], timeout=left_s)
            if connection not in ready and ready and not connection.poll():
                return None
            try:
                message = connection.recv() if ready else None
            except (EOFError, OSError):
                return None
            if isinstance(message, bytes):
                answer: Answer = pickle.loads(message)
                return answer
            if message is not None and self.watch is not None:
                self.watch(job, *message)
        return Answer(status=Status.HUNG, reason=f"not done after {self.limits.timeout_s:g} s")

    def _end(self, child: ForkServerProcess, grace_s: float) -> int | None:
        """Let a child end, or end it; its exit code."""
        wait([child.sentinel], timeout=grace_s)
        if not wait([child.sentinel], timeout=0.0):
            _kill(child)
            wait([child.sentinel])
        with self._lock:
            child.join()
            self._living.discard(child)
            code: int | None = child.exitcode
        return code


def _kill(child: ForkServerProcess) -> None:
    """Kill a child and all that it started."""
    pid = child.pid
    if pid is not None:
        for kill in (os.killpg, os.kill):  # it may not lead a group yet
            with contextlib.suppress(ProcessLookupError, PermissionError):
                kill(pid, signal.SIGKILL)


def _tail(errors: IO[bytes]) -> str:
    errors.seek(0, os.SEEK_END)
    errors.seek(max(0, errors.tell() - _DUMP_BYTES))
    return errors.read().decode(errors="replace")
