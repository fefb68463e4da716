"""The child's side: one call in a process that cannot outlive its supervisor."""

from __future__ import annotations

import ctypes
import faulthandler
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

from uavexp.store.records import Status
from uavexp.sweep.faults import failure
from uavexp.sweep.job import Answer, Call

_PR_SET_PDEATHSIG = 1
_SIZE = Path("/proc/self/statm")


def run_child(connection: Connection, call: Call, payload: Any, memory_mb: float) -> None:
    """Make one call and send its answer; progress goes the same way before.

    Args:
        connection: to the supervisor, who sends the descriptor of a file for what the child
            prints; tuples sent back are progress, bytes the pickled answer.
        call: what to call.
        payload: its argument.
        memory_mb: address space that it may take beyond what this process has now, MB.
    """
    os.setsid()  # the terminal's Ctrl-C is the supervisor's to handle
    try:
        _redirect_output(recv_handle(connection))
    except (EOFError, OSError):
        os._exit(1)  # the sweep was stopped meanwhile
    die_with_parent()
    _die_with_supervisor()
    _limit_memory(memory_mb)
    try:
        value = call(payload, lambda time_s, words: connection.send((time_s, words)))
        answer = pickle.dumps(Answer(status=Status.OK, value=value))
    except BaseException as error:
        _lift_memory_limit()  # or there is no room to tell
        answer = pickle.dumps(failure(error))
    connection.send(answer)


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
    faulthandler.enable(file=2, all_threads=False)


def _limit_memory(memory_mb: float) -> None:
    if _SIZE.exists():
        pages = int(_SIZE.read_text().split()[0])
        limit = pages * resource.getpagesize() + int(memory_mb * 1e6)
        resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _lift_memory_limit() -> None:
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (hard, hard))
