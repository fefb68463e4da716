"""How a command ends: bad input, Ctrl-C and SIGTERM are one line and an exit code, at any moment."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from types import FrameType

from uavexp.errors import UavexpError, one_line

_SIGNALS = (signal.SIGINT, signal.SIGTERM)  # SIGTERM would lose the table of what has flown


def exit_code_of(command: Callable[[], int]) -> int:
    """Run a command; its own exit code, or 1 or 2 for what the user can mend, or 130 when interrupted."""
    try:
        return command()
    except UavexpError as error:
        sys.stderr.write(f"error: {one_line(error)}\n")
        return error.exit_code
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        return 130


def leave_at_once() -> None:
    """Until something is begun that must be ended well, a signal ends the process itself.

    An exception would not do: raised inside an import, it comes out as something else (a missing
    library, a class that cannot be made). A job started with & ignores SIGINT: not so here.
    """
    for number in _SIGNALS:
        signal.signal(number, _leave)


def raise_from_now_on() -> None:
    """Something is begun: a signal raises `KeyboardInterrupt`, if `leave_at_once` was called before."""
    for number in _SIGNALS:
        if signal.getsignal(number) is _leave:
            signal.signal(number, signal.default_int_handler)


def _leave(number: int, frame: FrameType | None) -> None:
    os.write(2, b"interrupted\n")
    os._exit(130)
