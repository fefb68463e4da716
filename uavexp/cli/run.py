"""Flies the trials of a command that are not there yet and leaves a study folder."""

from __future__ import annotations

import contextlib
import multiprocessing
import platform
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import uavexp
from uavexp.cli import kernels
from uavexp.cli.composition import Command
from uavexp.cli.flight import check_world, fly_cell
from uavexp.cli.folders import folder_of, opened
from uavexp.cli.head_start import PRELOAD
from uavexp.cli.job import Task, files_of, fly_task, fly_task_elsewhere
from uavexp.cli.plan import Plan, plan_of
from uavexp.cli.runner import Backend, Runner, cores, read_runner
from uavexp.cli.terminal import Terminal
from uavexp.errors import ConfigError, RecordError, UavexpError
from uavexp.records import canonical_json, write_text
from uavexp.study import RUN, STUDY, collect, read_runs, study_text
from uavexp.sweep.dask import run_dask
from uavexp.sweep.faults import failure, reason_of
from uavexp.sweep.folder import put_trial, put_world, remove_unfinished, set_aside
from uavexp.sweep.job import Answer, Done, Job, Status
from uavexp.sweep.local import Watch, run_local, start_fork_server

_WARM_UP_S = 3.0  # simulated: by then every kernel of a flight has been called


def execute(
    command: Command, terminal: Terminal, user_folder: Path | None = None, typed: Sequence[str] = ()
) -> int:
    """Fly a command's trials and leave their folder.

    Args:
        command: what to fly.
        terminal: who is told.
        user_folder: of `--config-dir`.
        typed: the command line, for the folder's own record of it.

    Returns:
        Exit code: 0, or 1 when some trial did not run to its end.

    Raises:
        UavexpError: bad input, told before anything was written; or a full disk.
    """
    runner = read_runner(command.runner)
    folder = folder_of(command)
    look = partial(plan_of, command, folder, user_folder, accept_other_code=runner.accept_other_code)
    if runner.dry_run:
        terminal.listing(look(), folder)
        return 0
    with opened(folder):
        plan = look()
        if plan.left:
            _prepare(plan, runner, terminal)
        return _fly_plan(plan, command, runner, terminal, typed)


def _prepare(plan: Plan, runner: Runner, terminal: Terminal) -> None:
    """Have kernels compiled and the fork server started."""
    alone = len(plan.jobs) == 1
    if not kernels.is_compiled():
        terminal.say("first run: compiling kernels takes about a minute")
        if not alone:
            _compile_kernels(plan.left[0])
    if not alone and runner.backend == Backend.LOCAL:
        start_fork_server([PRELOAD])


def _fly_plan(plan: Plan, command: Command, runner: Runner, terminal: Terminal, typed: Sequence[str]) -> int:
    folder, began, failed = plan.study.folder, datetime.now(UTC), 0
    kept = 0
    with (
        terminal.progress(plan),
        _worlds_checked(plan) as wait_for_worlds,
        contextlib.closing(_fly(plan, runner, terminal.watch)) as flying,
    ):
        try:
            for done in flying:
                if not kept:
                    wait_for_worlds()
                    _begin(plan)
                _keep(folder, done)
                kept += 1
                failed += done.answer.status is not Status.OK
                terminal.finished(done)
        except (KeyboardInterrupt, UavexpError):
            with contextlib.suppress(RecordError):
                if (folder / STUDY).exists():
                    collect(folder)
            terminal.stopped(folder, kept, len(plan.left), again=bool(command.out or command.experiment))
            raise
    if not plan.left:
        _begin(plan)
    rows = collect(folder)
    asked = [word for word in typed if not word.startswith("out=")]  # the folder may move
    _note_run(folder, {"command": asked, "began": began, "flown": kept}, runner)
    terminal.summary(rows, plan)
    if command.experiment is not None:
        from uavexp.report.make import make_report

        terminal.say("writing the report ...")
        terminal.files(make_report(folder, terminal.say), folder)
    terminal.say(str(folder))
    return 1 if failed else 0


def _fly(plan: Plan, runner: Runner, watch: Watch) -> Generator[Done, None, None]:
    """Fly what is left: each trial in a process of its own, here a trial that is all of a local command."""
    if len(plan.jobs) == 1 and runner.backend == Backend.LOCAL:
        return (_fly_here(job, watch) for job in plan.left)
    workers = min(runner.workers, max(1, len(plan.left)))
    if runner.backend == Backend.DASK:
        return run_dask(
            fly_task_elsewhere,
            plan.left,
            address=runner.address,
            queue=runner.queue,
            n_jobs=workers,
            limits=runner.limits,
            preload=[PRELOAD],
        )
    return run_local(fly_task, plan.left, n_jobs=workers, limits=runner.limits, watch=watch)


def _fly_here(job: Job, watch: Watch) -> Done:
    begin_s = time.monotonic()
    try:
        answer = Answer(status=Status.OK, value=fly_task(job.payload, partial(watch, job)))
    except UavexpError:
        raise  # bad input, and nothing is written yet
    except Exception as error:
        answer = failure(error)
    return Done(job=job, answer=answer, wall_s=time.monotonic() - begin_s)


def _begin(plan: Plan) -> None:
    """Say what the folder is about, and put away what was found broken in it."""
    folder = plan.study.folder
    remove_unfinished(folder)
    for name in plan.stock.damaged:
        set_aside(folder, name)
    write_text(folder / STUDY, study_text(plan.study))


def _keep(folder: Path, done: Done) -> None:
    """Write a trial; its world first, so that the record vouches for it."""
    if done.answer.status is Status.OK:
        digest, data = done.answer.value.world
        if data is not None:
            put_world(folder, digest, data)
    put_trial(folder, done.job.name, files_of(done.job, done.answer, done.wall_s))


def _note_run(folder: Path, run: dict[str, Any], runner: Runner) -> None:
    """Add this run to the folder's own history."""
    began = run.pop("began")
    run |= {
        "began": began.isoformat(timespec="seconds"),
        "wall_s": (datetime.now(UTC) - began).total_seconds(),
        "backend": runner.backend,
        "n_jobs": runner.workers,
        "uavexp": uavexp.__version__,
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {cores()} cores",
    }
    write_text(folder / RUN, canonical_json({"runs": [*read_runs(folder), run]}) + "\n")


@contextlib.contextmanager
def _worlds_checked(plan: Plan) -> Iterator[Callable[[], None]]:
    """Check the worlds beside the first flights, of which none is kept before this has ended well."""
    tasks = [job.payload for job in plan.left] if len(plan.jobs) > 1 else []
    with ThreadPoolExecutor(max_workers=1) as pool:
        yield pool.submit(_check_worlds, tasks).result


def _check_worlds(tasks: Sequence[Task]) -> None:
    """Make the first seed of each distinct world, so that a bad one is told before anything is kept."""
    checked: list[Any] = []
    for task in tasks:
        world = task.cell.config["world"], task.cell.config["world_seed"]
        if world not in checked:
            checked.append(world)
            try:
                check_world(task.cell, task.seed)
            except UavexpError:
                raise
            except Exception as error:
                raise ConfigError(f"world={task.cell.options['world']}: {reason_of(error)}") from error


def _compile_kernels(job: Job) -> None:
    """Fly the first seconds of a trial in a process of its own, which leaves its kernels in the cache."""
    process = multiprocessing.get_context("spawn").Process(target=_warm_up, args=(job.payload,), daemon=True)
    process.start()
    process.join()


def _warm_up(task: Task) -> None:
    def stop(time_s: float, _: str) -> None:
        if time_s >= _WARM_UP_S:
            raise SystemExit

    fly_cell(task.cell, task.seed, stop)
