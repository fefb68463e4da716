"""A trial to fly, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from uavexp.cli.composition import Cell
from uavexp.cli.flight import Trial


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One trial to fly and where its files go."""

    cell: Cell
    seed: int
    folder: str
    command: str  # that repeats it


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What became of a job."""

    job: Job
    row: dict[str, Any]
    trial: Trial | None  # None when it raised
    reason: str = ""
