"""The fork server of this process: started, ended when it does not answer, and what the system refuses of it.

Its socket lies in a folder of multiprocessing's. That one is named by the process here, so that the next
command removes what a killed one has left.
"""

from __future__ import annotations

import contextlib
import errno
import multiprocessing
import os
import re
import shutil
import signal
import tempfile
import time
from collections.abc import Iterator, Sequence
from multiprocessing import forkserver, process, resource_tracker, util
from pathlib import Path

from uavexp.errors import UavexpError
from uavexp.sweep.child import REFUSED

LOST = 255  # exit code that multiprocessing gives a child whose fork server has ended

_TETHER = "uavexp.sweep.tether"
_FOLDER = "uavexp-{}-"  # of the process of that number
_LEFT = re.compile(r"uavexp-(\d+)-\w+")
_SHORT = Path("/tmp")  # where a socket's name is not too long
_LONGEST = 107 - len("/uavexp-4194304-12345678/listener-12345678")  # bytes of a folder: a socket's has 107


def start_fork_server(preload: Sequence[str] = ()) -> None:
    """Start the fork server, if none runs; call it from the main thread, with whose end it dies.

    Args:
        preload: modules that it imports once, for all children.
    """
    multiprocessing.get_context("forkserver").set_forkserver_preload([_TETHER, *preload])
    _take_folder()
    ensure_fork_server()


def ensure_fork_server() -> None:
    """Start the fork server, if none runs, with what it is to import known."""
    with refusals_told():
        resource_tracker.ensure_running()  # else the server starts it, which unblocks the signal
        # the server inherits the mask: Ctrl-C is the supervisor's to handle, right after this
        ours = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, ours)


def kill_fork_server() -> None:
    """Kill a fork server that does not answer; who waits for it hears its end, a new one is started."""
    pid = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]
    if pid is not None:
        with contextlib.suppress(ProcessLookupError, ChildProcessError):
            os.kill(pid, signal.SIGKILL)
            os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)  # dead, for multiprocessing to find


def raise_if_refused(patience_s: float = 0.0) -> None:
    """Tell what became of a fork server that has ended because the system refused it a file or a process.

    Args:
        patience_s: how long to wait for its end: its files are closed a moment before.

    Raises:
        RefusedError: that was its end.
    """
    end_s = time.monotonic() + patience_s
    pid = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]
    ended = None
    with contextlib.suppress(ChildProcessError):
        while pid is not None:
            ended = os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT | os.WNOHANG)
            if ended or time.monotonic() >= end_s:
                break
            time.sleep(0.01)
    if ended and ended.si_code == os.CLD_EXITED and ended.si_status == REFUSED:
        raise_refused()


def raise_refused() -> None:
    """Tell that the system refuses a process, which another process has found.

    Raises:
        RefusedError: always.
    """
    with refusals_told():
        raise OSError(errno.EAGAIN, os.strerror(errno.EAGAIN))


class RefusedError(UavexpError):
    """The system refuses a process, a thread or an open file."""

    exit_code = 1  # no fault of what was typed


@contextlib.contextmanager
def refusals_told(*others: type[Exception]) -> Iterator[None]:
    """Say in one line what the system refuses.

    Args:
        others: errors that it comes out as, besides those of Python itself.

    Raises:
        RefusedError: it does; or the fork server, refused a process, has ended.
    """
    kinds: tuple[type[Exception], ...] = (OSError, EOFError, RuntimeError, *others)
    try:
        yield
    except kinds as error:
        words = getattr(error, "strerror", None) or error
        raise RefusedError(
            f"no process can be started for a trial ({words}); fly fewer at a time, runner.n_jobs=1, or "
            "raise what the system allows (ulimit -n files, ulimit -u processes)"
        ) from error


def _take_folder() -> None:
    """Give multiprocessing a folder named by this process, and remove those of processes that are gone."""
    config = process.current_process()._config  # type: ignore[attr-defined]
    if config.get("tempdir") is not None:
        return
    root = Path(tempfile.gettempdir())
    root = root if len(os.fsencode(root)) <= _LONGEST else _SHORT
    for folder in root.glob(_FOLDER.format("*") + "*"):
        match = _LEFT.fullmatch(folder.name)
        with contextlib.suppress(OSError):
            if match and folder.lstat().st_uid == os.getuid() and not _is_running(int(match[1])):
                shutil.rmtree(folder, ignore_errors=True)
    with refusals_told():
        config["tempdir"] = tempfile.mkdtemp(prefix=_FOLDER.format(os.getpid()), dir=root)
    util.Finalize(None, shutil.rmtree, args=[config["tempdir"], True], exitpriority=-100)


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # somebody else's
        return True
    return True
