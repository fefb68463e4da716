"""How trials are run: the `runner` group, checked. No part of what is flown."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any

from uavexp.errors import require
from uavexp.parameters import Constraint, between, check_value, option, parameter_types
from uavexp.sweep.job import Allowance

_ADDRESS = re.compile(r"(tcp|tls)://([\w.-]+|\[[0-9a-fA-F:.]+\]):(?P<port>\d{1,5})", re.ASCII)


class Backend(StrEnum):
    """Where the processes are."""

    LOCAL = "local"
    DASK = "dask"


class Queue(StrEnum):
    """What starts Dask's workers on other machines."""

    SLURM = "slurm"


Jobs = Annotated[int, Constraint("-1 or 1 to 10000", lambda jobs: jobs == -1 or 1 <= jobs <= 10_000)]


@option(frozen=True)
class Runner:
    """Every trial in a process of its own on this machine."""

    backend: Backend = Backend.LOCAL  # local | dask
    n_jobs: Jobs = -1  # trials at a time, with backend dask workers to start; -1: as many as
    # there are cores
    timeout_s: Annotated[float, between(1e-3, 1e6)] = 900.0  # s of clock time after which a trial
    # counts as hung and is ended
    memory_mb: Annotated[float, between(1, 1e7)] = 4096.0  # MB that one trial may take on top of
    # a fresh process
    dry_run: bool = False  # list what would be flown and fly nothing
    accept_other_code: bool = False  # keep finished trials of another version of uavexp or its packages
    # among the new ones
    address: str | None = None  # with backend dask: tcp://HOST:8786 of a running scheduler;
    # null: start n_jobs workers
    queue: Queue | None = None  # with backend dask and no address: where they start; null:
    # on this machine | slurm (partition, account and time from Dask's jobqueue.yaml)

    def __post_init__(self) -> None:
        if self.queue is not None:
            require(self.n_jobs >= 1, "runner.queue=slurm needs runner.n_jobs=N, the workers to ask for")
            require(
                self.address is None,
                "give runner.address or runner.queue, not both: a cluster or a way to one",
            )
        if self.backend is not Backend.DASK:
            require(self.address is None and self.queue is None, "runner.address and queue need runner=dask")
        if self.address is not None:
            match = _ADDRESS.fullmatch(self.address)
            require(
                match is not None and 0 < int(match["port"]) < 65536,
                f"runner.address must be tcp://HOST:PORT or tls://HOST:PORT, got {self.address[:100]!r}",
            )

    @property
    def workers(self) -> int:
        """Trials at a time."""
        return self.n_jobs if self.n_jobs > 0 else cores()

    @property
    def limits(self) -> Allowance:
        """What one trial may take."""
        return Allowance(timeout_s=self.timeout_s, memory_mb=self.memory_mb)

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
