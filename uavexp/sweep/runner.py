"""How trials are run: the `runner` group, checked. No part of what is flown."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Any

from uavexp.errors import require
from uavexp.parameters import Constraint, Positive, check_value, parameter_types
from uavexp.sweep.job import Limits


class Backend(StrEnum):
    """Where the processes are."""

    LOCAL = "local"
    DASK = "dask"


class Queue(StrEnum):
    """What starts Dask's workers on other machines."""

    SLURM = "slurm"


@dataclass(frozen=True, slots=True, kw_only=True)
class Runner:
    """The parameters of `conf/runner/*.yaml`."""

    backend: Backend
    n_jobs: Annotated[int, Constraint("-1 or >= 1", lambda n_jobs: n_jobs == -1 or n_jobs >= 1)]
    timeout_s: Positive
    memory_mb: Positive
    dry_run: bool
    accept_other_code: bool
    address: str | None
    queue: Queue | None

    def __post_init__(self) -> None:
        if self.queue is not None:
            require(self.n_jobs >= 1, "runner.queue=slurm needs runner.n_jobs=N, the workers to ask for")
            require(
                self.address is None,
                "give runner.address or runner.queue, not both: a cluster or a way to one",
            )
        if self.backend != Backend.DASK:
            require(self.address is None and self.queue is None, "runner.address and queue need runner=dask")

    @property
    def workers(self) -> int:
        """Trials at a time."""
        return self.n_jobs if self.n_jobs > 0 else cores()

    @property
    def limits(self) -> Limits:
        """What one trial may take."""
        return Limits(timeout_s=self.timeout_s, memory_mb=self.memory_mb)

    @property
    def how(self) -> dict[str, Any]:
        """What a study's history tells of it."""
        machine = f"{platform.system()} {platform.machine()}, {cores()} cores"
        return {"backend": self.backend, "n_jobs": self.workers, "machine": machine}


def read_runner(tree: Mapping[str, Any]) -> Runner:
    """The runner of a composed configuration.

    Raises:
        ConfigError: a value of the wrong type or out of range.
    """
    kinds = parameter_types(Runner)
    return Runner(**{name: check_value(f"runner.{name}", value, kinds[name]) for name, value in tree.items()})


def cores() -> int:
    """Cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on Linux
        return os.cpu_count() or 1
