"""Jobs that end in every way a job can end; importable, as a sweep's children need it."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np

from uavexp.errors import ConfigError
from uavexp.sweep.job import Progress


def act(payload: tuple[str, Any], report: Progress) -> Any:
    """Do what the payload says and return its argument's double, if it is a number."""
    deed, argument = payload
    report(0.0, "begun")
    DEEDS[deed](argument)
    report(1.0, "done")
    return 2 * argument if isinstance(argument, float) else None


def _note(folder: Path) -> None:
    """Leave word that this process ran: its number."""
    (folder / str(os.getpid())).touch()


def _raise(_: Any) -> None:
    raise ZeroDivisionError("no such luck")


def _raise_bad_input(_: Any) -> None:
    raise ConfigError("no such device")


def _segfault(_: Any) -> None:
    ctypes.string_at(0)


def _hog(_: Any) -> None:
    blocks = [np.ones((64, 1024, 1024)) for _ in range(64)]  # 32 GB, half a GB at a time
    assert blocks


def _hog_a_little(_: Any) -> None:
    assert np.empty((64, 1024, 1024)).nbytes > 5e8  # address space, not touched


_KEPT: list[Any] = []


def _grow(_: Any) -> None:
    _KEPT.append(np.empty((64, 1024, 1024)))  # half a GB of address space, held for good


def _print_frame(_: Any) -> None:
    os.write(2, b'  File "/somewhere/printed.py", line 7 in long_ago\n')


def _note_and_sleep(folder: Path) -> None:
    _note(folder)
    time.sleep(60.0)


def _note_and_spin(folder: Path) -> None:
    _note(folder)
    _spin(60.0)


def _kill_oneself(_: Any) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def _kill_supervisor(_: Any) -> None:
    supervisor = multiprocessing.parent_process()
    assert supervisor is not None
    os.kill(supervisor.pid, signal.SIGKILL)
    time.sleep(60.0)


def _answer_half(_: Any) -> None:
    """Write the head of a message of 1 MB to the supervisor's pipe, a byte of it, and stop."""
    for name in os.listdir("/proc/self/fd"):
        with contextlib.suppress(OSError):
            if os.readlink(f"/proc/self/fd/{name}").startswith("socket:"):
                os.write(int(name), (1_000_000).to_bytes(4, "big") + b"x")
    os.kill(os.getpid(), signal.SIGSTOP)


def _stop_parent_and_sleep(_: Any) -> None:
    os.kill(os.getppid(), signal.SIGSTOP)
    time.sleep(60.0)


def _spin(seconds: float) -> None:
    """Hold the interpreter in C code: no Python thread of this process runs meanwhile."""
    ctypes.PyDLL(None).usleep(int(seconds * 1e6))


def _leave(_: Any) -> None:
    os._exit(3)


def _print(_: Any) -> None:
    os.write(1, b"noise\n")
    os.write(2, b"noise\n")


_PRINTED: list[str] = []


def _print_once(_: Any) -> None:
    """As a component would, in Python: a line, and one that does not end."""
    if not _PRINTED:
        _PRINTED.append("first line")
        print("first line\nhalf a line", end="")


DEEDS = {
    "nothing": lambda _: None,
    "sleep": time.sleep,
    "spin": _spin,
    "raise": _raise,
    "raise_bad_input": _raise_bad_input,
    "segfault": _segfault,
    "hog": _hog,
    "kill": _kill_oneself,
    "kill_supervisor": _kill_supervisor,
    "leave": _leave,
    "print": _print,
    "print_once": _print_once,
    "hog_a_little": _hog_a_little,
    "note": _note,
    "grow": _grow,
    "print_frame": _print_frame,
    "note_and_sleep": _note_and_sleep,
    "note_and_spin": _note_and_spin,
    "answer_half": _answer_half,
    "stop_parent_and_sleep": _stop_parent_and_sleep,
}
