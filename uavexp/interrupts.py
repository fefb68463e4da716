"""How a command ends: bad input, Ctrl-C, SIGTERM and SIGHUP are one line and an exit code, at any moment."""

from __future__ import annotations

import argparse
import errno
import os
import resource
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

from uavexp.errors import ConfigError, UavexpError, one_line

_FILES, _FEWEST_FILES = 4096, 64  # open at a time
_REFUSALS = (
    errno.EAGAIN, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOSPC, errno.EDQUOT, errno.EIO,
    errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.ESTALE,
)  # fmt: skip
# SIGTERM, and SIGHUP of a terminal that closes, would lose the table of what has flown
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Parser(argparse.ArgumentParser):
    """Takes a command line apart; a wrong one is bad input like any other."""

    def error(self, message: str) -> NoReturn:
        """Refuse what was typed."""
        raise ConfigError(f"{message}; see --help")


def exit_code_of(command: Callable[[], int]) -> int:
    """Run a command; its own exit code, or 1 or 2 for what the user can mend, or 130 when interrupted."""
    heard = signal.getsignal(signal.SIGTERM)
    try:
        _allow_files()
        return command()
    except UavexpError as error:
        sys.stderr.write(f"error: {one_line(error)}\n")
        return 1 if _is_refused(error.__cause__) else error.exit_code
    except OSError as error:
        if not _is_refused(error):
            raise
        sys.stderr.write(f"error: the system refuses what is needed: {one_line(error)}\n")
        return 1
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        return 130
    finally:
        if heard is _leave:  # what was begun has ended
            leave_at_once()


def _is_refused(error: BaseException | None) -> bool:
    """Whether the system, not what was typed, is at fault."""
    return isinstance(error, OSError) and error.errno in _REFUSALS


def _allow_files() -> None:
    """Let this process open as many files as it may, at most a few thousand.

    Raises:
        UavexpError: those are too few.
    """
    allowed, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    if allowed < _FILES and (most == resource.RLIM_INFINITY or most > allowed):
        allowed = _FILES if most == resource.RLIM_INFINITY else min(_FILES, most)
        resource.setrlimit(resource.RLIMIT_NOFILE, (allowed, most))
    if allowed < _FEWEST_FILES:
        words = f"only {allowed} files may be open at a time, a command needs {_FEWEST_FILES}: ulimit -n 1024"
        raise UavexpError(words) from OSError(errno.EMFILE, os.strerror(errno.EMFILE))


def leave_at_once() -> None:
    """Until something is begun that must be ended well, a signal ends the process itself.

    An exception would not do: raised inside an import, it comes out as something else (a missing
    library, a class that cannot be made). A job started with & ignores SIGINT: not so here.
    """
    for number in _SIGNALS:
        if not (number == signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN):  # under nohup
            signal.signal(number, _leave)


def raise_from_now_on() -> None:
    """Something is begun: a signal raises `KeyboardInterrupt`, if `leave_at_once` was called before."""
    for number in _SIGNALS:
        if signal.getsignal(number) is _leave:
            signal.signal(number, signal.default_int_handler)


def _leave(number: int, frame: FrameType | None) -> None:
    os.write(2, b"interrupted\n")
    os._exit(130)
