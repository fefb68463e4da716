"""A limit on the clock for what must never hang."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from types import FrameType


@contextlib.contextmanager
def in_time(limit_s: float) -> Iterator[None]:
    """Fail what takes longer, whatever it waits for; in the main thread."""

    def fail(number: int, frame: FrameType | None) -> None:
        raise AssertionError(f"not done after {limit_s:g} s")

    before = signal.signal(signal.SIGALRM, fail)
    signal.setitimer(signal.ITIMER_REAL, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
