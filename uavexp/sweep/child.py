"""The child's side: one call after another in a process that cannot outlive its supervisor."""

from __future__ import annotations

import ctypes
import faulthandler
import gc
import io
import multiprocessing
import os
import pickle
import resource
import signal
import sys
import threading
from multiprocessing.connection import Connection, wait
from multiprocessing.reduction import recv_handle
from pathlib import Path
from typing import Any

from uavexp.errors import UavexpError
from uavexp.store.records import Status
from uavexp.sweep.faults import failure
from uavexp.sweep.job import Answer, Call

REFUSED = os.EX_TEMPFAIL  # exit code of a child to which the system refuses its second thread
_PR_SET_PDEATHSIG = 1
_SIZE = Path("/proc/self/statm")
_MOST_CALLS = 30  # of one child: so many share what a fresh one costs
_GROWTH_MB = 300.0  # address space: a child that its calls have made so much larger is replaced


def run_child(connection: Connection, call: Call, memory_mb: float) -> None:
    """Make calls and send their answers, until one breaks or this process has done its share.

    Args:
        connection: to the supervisor, who sends the descriptor of a file for what the child prints, then
            one payload after another; sent back are progress (simulated time s, words), and of each
            call its pickled answer with whether it was this child's last.
        call: what to call.
        memory_mb: address space that a call may take beyond what this process has before it, MB.
    """
    os.setsid()  # the terminal's Ctrl-C is the supervisor's to handle
    try:
        _redirect_output(recv_handle(connection))
        die_with_parent()
        try:
            _die_with_supervisor()
        except RuntimeError:
            os._exit(REFUSED)
        most_mb = _size_mb() + _GROWTH_MB
        for left in reversed(range(_MOST_CALLS)):
            went_well, answer = _answer(call, connection.recv(), connection, memory_mb)
            gc.collect()  # what a flight leaves hangs in circles
            last = not went_well or not left or _size_mb() > most_mb
            connection.send((answer, last))
            if last:
                return
    except (EOFError, OSError):
        os._exit(1)  # the sweep was stopped meanwhile


def _answer(call: Call, payload: Any, connection: Connection, memory_mb: float) -> tuple[bool, bytes]:
    """Make one call; whether this process is as good as before, and its pickled answer."""
    _limit_memory(memory_mb)
    try:
        value = call(payload, lambda time_s, words: connection.send((time_s, words)))
        return True, pickle.dumps(Answer(status=Status.OK, value=value))
    except BaseException as error:
        _lift_memory_limit()  # or there is no room to tell
        return isinstance(error, UavexpError), pickle.dumps(failure(error))  # a refusal breaks nothing


def die_with_parent() -> None:
    """Ask the kernel to kill this process when the thread that started it ends (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _die_with_supervisor() -> None:
    """Die when the supervisor does, by the end of its pipe.

    The parent is the fork server, which dies with the supervisor by `die_with_parent`; this
    covers other systems, and a supervisor that was gone before that was asked for.
    """
    supervisor = multiprocessing.parent_process()
    if supervisor is None:
        return

    def watch() -> None:
        wait([supervisor.sentinel])
        os.kill(os.getpid(), signal.SIGKILL)

    threading.Thread(target=watch, daemon=True).start()


def _redirect_output(descriptor: int) -> None:
    """Send what libraries print, and the frames of a crash, to the supervisor's file."""
    for stream in (1, 2):
        os.dup2(descriptor, stream)
    os.close(descriptor)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # a line printed is there, whatever comes after it
    faulthandler.enable(file=2, all_threads=False)


def _size_mb() -> float:
    """Address space of this process, MB; 0 where the system does not tell."""
    if not _SIZE.exists():
        return 0.0
    return int(_SIZE.read_text().split()[0]) * resource.getpagesize() / 1e6


def _limit_memory(memory_mb: float) -> None:
    if size_mb := _size_mb():
        limit = int((size_mb + memory_mb) * 1e6)
        resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _lift_memory_limit() -> None:
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (hard, hard))
