"""What a sweep costs beside its trials: `python -m benchmarks.sweep_bench`.

Calls the same trials in this process and in children of the fork server, in turns, and
prints the ratio of the times; then the trials per minute of one and of two workers.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from pathlib import Path

from rich.console import Console

from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.sweep.agenda import agenda_of
from uavexp.sweep.job import Allowance, Job
from uavexp.sweep.local import run_local, start_fork_server
from uavexp.sweep.trial_job import fly_job

SEEDS = "0:8"
LIMITS = Allowance(timeout_s=600.0, memory_mb=4096.0)


def seconds(jobs: list[Job], n_jobs: int) -> float:
    """Clock time of these jobs with so many workers."""
    begin = time.perf_counter()
    statuses = [done.answer.status for done in run_local(fly_job, jobs, n_jobs=n_jobs, limits=LIMITS)]
    assert {str(status) for status in statuses} == {"ok"}
    return time.perf_counter() - begin


def here(job: Job) -> float:
    """Clock time of one job in this process."""
    begin = time.perf_counter()
    fly_job(job.payload, lambda time_s, words: None)
    return time.perf_counter() - begin


def main() -> None:
    """Print both figures."""
    console = Console()
    command = Composer().command(parse_settings(["strategy=mcr", f"seed={SEEDS}"]))
    with tempfile.TemporaryDirectory() as folder:
        jobs = list(agenda_of(command, Path(folder)).jobs)
    start_fork_server(["uavexp.sweep.preload"])
    here(jobs[0]), seconds(jobs[:1], 1)  # first calls are not measurements
    ratios = [seconds([job], 1) / here(job) for job in jobs]
    median = statistics.median(ratios)
    console.print(f"a trial in a child / in this process: {median:.3f} (median of {len(jobs)})")
    one, two = seconds(jobs, 1), seconds(jobs, 2)
    rate_one, rate_two = 60 * len(jobs) / one, 60 * len(jobs) / two
    console.print(f"trials per minute: {rate_one:.1f} with one worker, {rate_two:.1f} with two")
    console.print(f"two workers / one: {one / two:.2f}")


if __name__ == "__main__":
    main()
