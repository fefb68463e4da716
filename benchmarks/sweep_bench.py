"""What a sweep costs beside its trials: `python -m benchmarks.sweep_bench`.

Flies the same trials in a child of the fork server and in this process, which has flown them before, by
turns, and prints the ratio of their processor times; then the trials per minute of one and of two workers.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from pathlib import Path

from rich.console import Console

from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.store.records import Status
from uavexp.sweep.agenda import agenda_of
from uavexp.sweep.fork_server import start_fork_server
from uavexp.sweep.job import Allowance, Job, Progress
from uavexp.sweep.local import run_local
from uavexp.sweep.trial_job import TrialJob, fly_job

SEEDS, ROUNDS = "0:8", 3
LIMITS = Allowance(timeout_s=600.0, memory_mb=4096.0)


def fly_timed(trial: TrialJob, progress: Progress) -> float:
    """Fly a trial; the processor time of this process so far, s."""
    fly_job(trial, progress)
    return time.process_time()


def in_a_child(jobs: list[Job]) -> float:
    """Processor time of a child that flies these jobs, with all that a fresh one costs, s."""
    return max(done.answer.value for done in run_local(fly_timed, jobs, n_jobs=1, limits=LIMITS))


def here(jobs: list[Job]) -> float:
    """Processor time of these jobs in this process, s."""
    begin_s = time.process_time()
    for job in jobs:
        fly_job(job.payload, lambda time_s, words: None)
    return time.process_time() - begin_s


def trials_per_minute(jobs: list[Job], n_jobs: int) -> float:
    """Of these jobs with so many workers, by the clock."""
    begin_s = time.perf_counter()
    statuses = {done.answer.status for done in run_local(fly_job, jobs, n_jobs=n_jobs, limits=LIMITS)}
    assert statuses == {Status.OK}
    return 60.0 * len(jobs) / (time.perf_counter() - begin_s)


def main() -> None:
    """Print both figures."""
    console = Console(highlight=False)
    command = Composer().command(parse_settings(["strategy=mcr", f"seed={SEEDS}"]))
    with tempfile.TemporaryDirectory() as folder:
        jobs = list(agenda_of(command, Path(folder)).jobs)
    start_fork_server(["uavexp.sweep.preload"])
    here(jobs), in_a_child(jobs)  # worlds are drawn, kernels loaded
    ratios = [in_a_child(jobs) / here(jobs) for _ in range(ROUNDS)]
    median, spread = statistics.median(ratios), f"{min(ratios):.3f} to {max(ratios):.3f}"
    console.print(
        f"{len(jobs)} trials in a child / in a warm process, processor time: {median:.3f} ({spread})"
    )
    one, two = trials_per_minute(jobs, 1), trials_per_minute(jobs, 2)
    console.print(f"trials per minute: {one:.1f} with one worker, {two:.1f} with two, ratio {two / one:.2f}")


if __name__ == "__main__":
    from benchmarks.sweep_bench import main as importable  # children look their call up by its name

    importable()
