"""Failures in words that may stand in a record: no path of this machine, no address."""

from __future__ import annotations

import re
import signal

from uavexp.errors import UavexpError, one_line
from uavexp.frames import portable_file, portable_trace
from uavexp.store.records import Status
from uavexp.sweep.job import Answer

_DUMPED = re.compile(r'^\s*File "(?P<file>[^"]+)", line (?P<line>\d+) in (?P<name>.+)$', re.MULTILINE)
_OUT_OF_MEMORY = ("std::bad_alloc", "MemoryError")
_MOST_FRAMES = 20


def reason_of(error: BaseException) -> str:
    """Type and message of an error in one line."""
    return f"{type(error).__name__}: {one_line(error)}"


def failure(error: BaseException) -> Answer:
    """Answer of a call that raised."""
    status = Status.MEMORY if isinstance(error, MemoryError) else Status.RAISED
    return Answer(
        status=status,
        reason=reason_of(error),
        trace=portable_trace(error),
        mendable=isinstance(error, UavexpError),
    )


def death(exit_code: int | None, dump: str) -> Answer:
    """Answer of a process that died without one.

    Args:
        exit_code: negative: the signal that killed it.
        dump: what it wrote to its standard error, the fault handler's frames among it.
    """
    status = Status.MEMORY if any(word in dump for word in _OUT_OF_MEMORY) else Status.KILLED
    frames = [
        f"{portable_file(match['file'])}:{match['line']} {match['name']}" for match in _DUMPED.finditer(dump)
    ]
    return Answer(status=status, reason=_ending(exit_code), trace=tuple(frames[:_MOST_FRAMES]))


def _ending(exit_code: int | None) -> str:
    if exit_code is None or exit_code >= 0:
        return f"the process ended with exit code {exit_code} and without an answer"
    try:
        name = signal.Signals(-exit_code).name
    except ValueError:
        name = "unknown"
    hint = "; the system does so when its memory runs out" if -exit_code == signal.SIGKILL else ""
    return f"the process was killed by signal {-exit_code} ({name}){hint}"
