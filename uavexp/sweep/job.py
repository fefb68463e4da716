"""What a sweep runs and what becomes of it; nothing here knows what a job does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from uavexp.errors import require_positive
from uavexp.store.records import Status

Progress = Callable[[float, str], None]  # simulated time s, a few words
Call = Callable[[Any, Progress], Any]  # payload in, picklable value out; importable by name


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One call to make in another process."""

    name: str  # unique in a sweep
    label: str  # what the progress calls it
    payload: Any  # picklable


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowance:
    """What one job may take."""

    timeout_s: float
    memory_mb: float  # on top of what its process has before

    def __post_init__(self) -> None:
        require_positive(timeout_s=self.timeout_s, memory_mb=self.memory_mb)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What came of a call."""

    status: Status
    value: Any = None  # of the call, when its status is ok
    reason: str = ""
    trace: tuple[str, ...] = ()  # frames, without any path of this machine
    mendable: bool = False  # raised a `UavexpError`: what was asked for is at fault


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """A job, its answer and the clock time it took."""

    job: Job
    answer: Answer
    wall_s: float
