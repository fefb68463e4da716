"""Jobs on this machine: a pool of threads, each of which supervises one child process at a time.

joblib's own process pool loses the whole sweep when one worker dies. Its threads give each
job to a child of a fork server that has the heavy imports and compiled kernels already. A child
does several jobs, one at a time; it is replaced after the first that breaks, so
that a crash, a hang or a hunger for memory costs that job alone.
"""

from __future__ import annotations

import contextlib
import errno
import multiprocessing
import os
import pickle
import signal
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerProcess
from multiprocessing.reduction import send_handle
from typing import IO, Any

from uavexp.store.records import Status
from uavexp.sweep.child import REFUSED, run_child
from uavexp.sweep.faults import death
from uavexp.sweep.fork_server import (
    LOST,
    RefusedError,
    ensure_fork_server,
    kill_fork_server,
    raise_if_refused,
    raise_refused,
    refusals_told,
)
from uavexp.sweep.job import Allowance, Answer, Call, Done, Job

Watch = Callable[[Job, float, str], None]  # job, simulated time s, a few words
Hear = Callable[[str], None]  # text

_PARTING_S = 5.0  # a child that has answered may take so long to end
_DUMP_BYTES = 20_000
_MOST_BYTES = 1_000_000  # of what is printed, passed on at a time
_OWN_REFUSALS = (errno.EMFILE, errno.ENFILE, errno.EAGAIN, errno.ENOMEM)  # of this process, not of the server


def run_local(
    call: Call,
    jobs: Iterable[Job],
    *,
    n_jobs: int,
    limits: Allowance,
    watch: Watch | None = None,
    hear: Hear | None = None,
) -> Generator[Done, None, None]:
    """Run jobs, so many at a time, and yield each when it has ended.

    When the iterator is closed, or the consumer interrupted, the running children are killed.

    Args:
        call: what to call, importable by name.
        jobs: taken one by one, in this order.
        n_jobs: children at a time, >= 1.
        limits: of each job.
        watch: told the progress of every job, from its supervising thread.
        hear: told what the jobs print, whole lines at a time, from there, too.
    """
    from joblib import Parallel, delayed  # 0.2 s that the start of the fork server need not wait for

    supervisor = _Supervisor(call=call, limits=limits, watch=watch, hear=hear)
    pool = Parallel(n_jobs=n_jobs, backend="threading", return_as="generator_unordered", batch_size=1)
    with refusals_told(AttributeError):  # as which a pool that lacks a thread ends
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


@dataclass(slots=True, kw_only=True, eq=False)
class _Child:
    """A process that waits for calls, or makes one."""

    process: ForkServerProcess
    connection: Connection
    printed: IO[bytes]  # what its present call has printed, a crash's frames among it
    heard: int = 0  # bytes of that, which were passed on

    def begin(self, payload: Any) -> None:
        """Give it a call to make; what is not heard, because it died, is found out by who waits."""
        self.printed.seek(0)
        self.printed.truncate()
        self.heard = 0
        with contextlib.suppress(OSError):
            self.connection.send(payload)


@dataclass(slots=True, kw_only=True)
class _Supervisor:
    """Runs jobs in children, from several threads at once."""

    call: Call
    limits: Allowance
    watch: Watch | None
    hear: Hear | None
    # multiprocessing's bookkeeping of children is not made for threads: two that poll one child
    # at the same time may both take its exit code, and one gets a wrong one
    _lock: threading.Lock = field(default_factory=threading.Lock)
    # an interrupt is raised in the main thread, where joblib runs the jobs when they go one at a
    # time; here it finds no child half begun
    _starter: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(max_workers=1))
    _living: set[_Child] = field(default_factory=set)
    _idle: list[_Child] = field(default_factory=list)  # those of them that wait for a call
    _stopped: bool = False

    def run(self, job: Job) -> Done:
        """Run one job to its end, whatever that is.

        Raises:
            RefusedError: the system refuses a process.
        """
        begin_s = time.monotonic()
        with refusals_told():
            taken = self._starter.submit(self._take)
        try:
            child = taken.result(self.limits.timeout_s)
        except TimeoutError:
            kill_fork_server()
            answer = self._hung
        else:
            begin_s = time.monotonic()
            stopped = Answer(status=Status.KILLED, reason="the sweep was stopped")
            answer = stopped if child is None else self._ask(child, job)
        return Done(job=job, answer=answer, wall_s=time.monotonic() - begin_s)

    @property
    def _hung(self) -> Answer:
        return Answer(status=Status.HUNG, reason=f"not done after {self.limits.timeout_s:g} s")

    def stop(self) -> None:
        """Kill every child, wait until it is gone, and let no other start."""
        self._stopped = True
        if not self._lock.acquire(timeout=_PARTING_S):
            kill_fork_server()  # for which a start waits
            self._lock.acquire()
        try:
            for child in self._living:
                _kill(child.process)
            _await_end(*self._living)
            for child in self._living:
                child.process.join()
        finally:
            self._lock.release()

    def _take(self) -> _Child | None:
        """A child that waits for a call, a new one if none does; None when the sweep was stopped."""
        with self._lock:
            if self._stopped:
                return None
            if self._idle:
                return self._idle.pop()
            child = self._start()
            self._living.add(child)
        with contextlib.suppress(OSError, ValueError):  # it is dead already
            send_handle(child.connection, child.printed.fileno(), child.process.pid)
        return child

    def _start(self) -> _Child:
        """A new child; once more with a new fork server, if the one that there is has died."""
        try:
            return self._start_once()
        except RefusedError as refusal:
            if getattr(refusal.__cause__, "errno", None) in _OWN_REFUSALS:
                raise  # the server is well, and others' children hang on it
            raise_if_refused(patience_s=1.0)
            kill_fork_server()
            return self._start_once()

    def _start_once(self) -> _Child:
        context = multiprocessing.get_context("forkserver")
        with refusals_told():
            printed = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115
            ours, theirs = context.Pipe()
            with theirs:
                arguments = (theirs, self.call, self.limits.memory_mb)
                process = context.Process(target=run_child, args=arguments, daemon=True)
                raise_if_refused()
                ensure_fork_server()
                process.start()
        return _Child(process=process, connection=ours, printed=printed)

    def _ask(self, child: _Child, job: Job) -> Answer:
        """Have a child do a job, and keep it for another one if all went well."""
        deadline_s = time.monotonic() + self.limits.timeout_s
        with self._killed_in_time(child):
            child.begin(job.payload)
            answer, last = self._wait(job, child)
            self._pass_on(child, whole_lines=False)
        late = time.monotonic() >= deadline_s
        if answer is not None and not last and not late:
            self._idle.append(child)
            return answer
        with child.connection, child.printed:
            exit_code = self._end(child, grace_s=0.0 if late else _PARTING_S)
            if answer is None and exit_code == REFUSED:
                raise_refused()
            if answer is None and exit_code == LOST:
                raise_if_refused(patience_s=1.0)
            return answer or (self._hung if late else death(exit_code, _tail(child.printed)))

    @contextlib.contextmanager
    def _killed_in_time(self, child: _Child) -> Iterator[None]:
        """Kill a child at its deadline, whatever it and this thread wait for then: one in mid-answer, too."""
        timer = threading.Timer(self.limits.timeout_s, _kill, [child.process])
        timer.daemon = True
        with refusals_told():
            timer.start()
        try:
            yield
        finally:
            timer.cancel()

    def _wait(self, job: Job, child: _Child) -> tuple[Answer | None, bool]:
        """The child's answer, None when it died without one; and whether that was its last."""
        connection, sentinel = child.connection, child.process.sentinel
        while True:
            ready = wait([connection, sentinel])
            if connection not in ready and not connection.poll():
                return None, True
            try:
                message = connection.recv()
            except (EOFError, OSError):
                return None, True
            match message:
                case bytes(pickled), bool(last):
                    return pickle.loads(pickled), last
                case time_s, words:
                    self._pass_on(child)
                    if self.watch is not None:
                        self.watch(job, time_s, words)

    def _pass_on(self, child: _Child, *, whole_lines: bool = True) -> None:
        """Tell what a child has printed since it was last looked at."""
        if self.hear is None:
            return
        new = os.pread(child.printed.fileno(), _MOST_BYTES, child.heard)
        new = new[: new.rfind(b"\n") + 1] if whole_lines else new
        child.heard += len(new)
        if new:
            self.hear(new.decode(errors="replace"))

    def _end(self, child: _Child, grace_s: float) -> int | None:
        """Let a child end, or end it; its exit code."""
        process = child.process
        if not wait([process.sentinel], timeout=grace_s):
            _kill(process)
            _await_end(child)
        with self._lock:
            process.join()
            self._living.discard(child)
            code: int | None = process.exitcode
        return code


def _await_end(*children: _Child) -> None:
    """Wait until killed children are gone; the fork server, which tells of it, may itself be stopped."""
    end_s = time.monotonic() + _PARTING_S
    for child in children:
        if not wait([child.process.sentinel], timeout=max(0.0, end_s - time.monotonic())):
            kill_fork_server()
            return


def _kill(process: ForkServerProcess) -> None:
    """Kill a child and all that it started."""
    pid = process.pid
    if pid is not None:
        for kill in (os.killpg, os.kill):  # it may not lead a group yet
            with contextlib.suppress(ProcessLookupError, PermissionError):
                kill(pid, signal.SIGKILL)


def _tail(printed: IO[bytes]) -> str:
    printed.seek(0, os.SEEK_END)
    printed.seek(max(0, printed.tell() - _DUMP_BYTES))
    return printed.read().decode(errors="replace")
