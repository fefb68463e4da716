"""Flies the trials of a command one after another and writes what they leave behind."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from uavexp.cli.composition import Command
from uavexp.cli.flight import check_world, fly_cell, repeat_command
from uavexp.cli.job import Job, Result
from uavexp.cli.outputs import folder_name, laps, output_folder, reason_of, write_failure, write_trial
from uavexp.cli.rows import failed_row, flown_row
from uavexp.cli.terminal import Terminal
from uavexp.errors import ConfigError, RecordError, UavexpError
from uavexp.kernel_cache import has_kernels
from uavexp.records import code_digest, lock_digest
from uavexp.table import TABLE, write_table

Fly = Callable[[Job], Result]


def run_all(jobs: Iterable[Job], fly: Fly) -> Iterator[Result]:
    """Fly every job, one after another, yielding results as they come."""
    for job in jobs:
        yield fly(job)


def jobs_of(command: Command, user_folder: Path | None = None) -> list[Job]:
    """Cells x seeds, sorted by cell and seed."""
    return [
        Job(
            cell=cell,
            seed=seed,
            folder=folder_name(cell, seed),
            command=repeat_command(cell, seed, user_folder),
        )
        for cell in command.cells
        for seed in sorted(command.seeds)
    ]


def execute(command: Command, terminal: Terminal, user_folder: Path | None = None) -> int:
    """Fly a command's trials and leave an output folder.

    Returns:
        Exit code: 0, or 1 when some trial raised.

    Raises:
        UavexpError: bad input, told before anything was written.
    """
    jobs = jobs_of(command, user_folder)
    if len(jobs) > 1:
        _check_worlds(command)
    run = {"code": code_digest(), "lock": lock_digest()}
    results: list[Result] = []
    with (
        output_folder(command.out, _prefix(command)) as root,
        terminal.progress(len(jobs), cold=not has_kernels()),
    ):
        try:
            for result in run_all(jobs, lambda job: _fly_job(job, root, run, terminal, bool(results))):
                results.append(result)
                terminal.finished(result)
        finally:  # also when interrupted: what has flown keeps its table
            if results:
                write_table(root / TABLE, [result.row for result in results])
    terminal.summary(results, root)
    return 0 if all(result.trial is not None for result in results) else 1


def _fly_job(job: Job, root: Path, run: dict[str, Any], terminal: Terminal, others_flown: bool) -> Result:
    """Fly one trial and write its files; a trial that raises costs that trial alone."""
    begin_s = time.perf_counter()
    folder = root / job.folder
    try:
        trial = fly_cell(job.cell, job.seed, terminal.flying(job))
        wall_s = time.perf_counter() - begin_s
        _make_folder(folder)
        write_trial(trial, folder, run, _wall(job, wall_s))
    except Exception as error:
        if isinstance(error, RecordError) or (isinstance(error, UavexpError) and not others_flown):
            raise  # a full disk; or bad input, and nothing is written yet
        wall_s = time.perf_counter() - begin_s
        _make_folder(folder)
        write_failure(job.cell, job.seed, folder, run, _wall(job, wall_s), error)
        row = failed_row(job.cell, job.seed, wall_s, job.folder)
        return Result(job=job, row=row, trial=None, reason=reason_of(error))
    row = flown_row(trial, laps(trial), wall_s, job.folder)
    return Result(job=job, row=row, trial=trial, reason=trial.log.reason)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise RecordError(f"{folder}: cannot be made ({error.strerror})") from error


def _wall(job: Job, wall_s: float) -> dict[str, Any]:
    return {"command": job.command, "wall_trial_s": wall_s}


def _check_worlds(command: Command) -> None:
    """Make each distinct world once, so that a bad one is told before the first flight."""
    seed = min(command.seeds)
    checked: list[Any] = []
    for cell in command.cells:
        if cell.config["world"] not in checked:
            checked.append(cell.config["world"])
            try:
                check_world(cell, seed)
            except UavexpError:
                raise
            except Exception as error:
                raise ConfigError(f"world={cell.options['world']}: {reason_of(error)}") from error


def _prefix(command: Command) -> str:
    names = dict.fromkeys(cell.strategy for cell in command.cells)
    worlds = dict.fromkeys(cell.options["world"] for cell in command.cells)
    return "-".join([*names, *worlds])[:60]
