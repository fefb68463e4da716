"""Imported by the fork server alone: ties it to the supervisor's life, and has it fork patiently."""

import os
import sys
import time
from types import TracebackType

from uavexp.sweep.child import REFUSED, die_with_parent

_TRIES, _PAUSE_S = 20, 0.1
_fork = os.fork


def _fork_patiently() -> int:
    """Fork; the system may refuse for a moment, when many processes are there."""
    for _ in range(_TRIES):
        try:
            return _fork()
        except OSError:
            time.sleep(_PAUSE_S)
    return _fork()


def _end(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """End without a word, which is the supervisor's: by this exit code it knows what to say."""
    os._exit(REFUSED if isinstance(error, OSError) else 1)


die_with_parent()
os.fork = _fork_patiently
sys.excepthook = _end
