"""Flies the trials of a command that are not there yet and leaves a study folder."""

from __future__ import annotations

import contextlib
import errno
import multiprocessing
import signal
import time
from collections.abc import Callable, Generator, Sequence
from functools import partial
from pathlib import Path

from uavexp.config.composition import CommandLine
from uavexp.errors import ConfigError, RecordError, UavexpError, one_line
from uavexp.flight import fly_cell
from uavexp.interrupts import raise_from_now_on
from uavexp.store.folder import folder_of, opened, put_trial, put_world, remove_unfinished, set_aside
from uavexp.store.history import FLYING, Run
from uavexp.store.records import Status, canonical_json, write_text
from uavexp.store.study import STUDY, collect, study_text
from uavexp.sweep import kernels
from uavexp.sweep.agenda import Agenda, agenda_of
from uavexp.sweep.audience import Audience
from uavexp.sweep.child import die_with_parent
from uavexp.sweep.dask import run_dask
from uavexp.sweep.fork_server import start_fork_server
from uavexp.sweep.head_start import PRELOAD
from uavexp.sweep.job import Answer, Done, Job
from uavexp.sweep.local import run_local
from uavexp.sweep.runner import Backend, Runner, read_runner
from uavexp.sweep.trial_job import TrialJob, WorldCheck, do_job, do_job_elsewhere, files_of, version

Fly = Callable[[Sequence[Job]], Generator[Done, None, None]]

_WARM_UP_S = 3.0  # simulated: by then every kernel of a flight has been called


def execute(
    command: CommandLine,
    audience: Audience,
    user_folder: Path | None = None,
    typed: Sequence[str] = (),
    *,
    here: bool = False,
) -> int:
    """Fly a command's trials and leave their folder.

    Args:
        command: what to fly.
        audience: who is told.
        user_folder: of `--config-dir`.
        typed: the command line, for the folder's own record of it.
        here: fly in this process, for a debugger; what a component raises is raised.

    Returns:
        Exit code: 0, or 1 when some trial did not run to its end.

    Raises:
        UavexpError: bad input, told before anything was written; or a full disk.
    """
    runner = read_runner(command.runner)
    if here and runner.backend is not Backend.LOCAL:
        raise ConfigError("--debug flies in this process: leave runner=dask away")
    look = partial(agenda_of, command, user_folder=user_folder, accept_other_code=runner.accept_other_code)
    if runner.dry_run:
        folder = folder_of(command)
        audience.listing(look(folder), folder)
        return 0
    with opened(command) as folder:
        agenda = look(folder)
        if agenda.left:
            _prepare(agenda, runner, audience, here=here)
        fly = partial(_fly_here, audience) if here else partial(_fly, runner, audience)
        try:
            return _fly_agenda(agenda, command, audience, Run(typed=typed, how=runner.how), fly)
        except KeyboardInterrupt:
            exec("")  # one that came through exec (importing a dataclass) makes CPython end by the signal
            raise


def _prepare(agenda: Agenda, runner: Runner, audience: Audience, *, here: bool) -> None:
    """Have kernels compiled and the fork server started."""
    if not kernels.is_compiled():
        audience.say("first run: compiling kernels takes about a minute")
        _compile_kernels(agenda.left[0])
    if runner.backend == Backend.LOCAL and not here:
        start_fork_server([PRELOAD])


def _fly_agenda(agenda: Agenda, command: CommandLine, audience: Audience, run: Run, fly: Fly) -> int:
    raise_from_now_on()
    folder, kept, failed = agenda.study.folder, 0, 0
    checks = _world_checks(agenda)
    unchecked, waiting = len(checks), list[Done]()
    with (
        audience.progress(agenda),
        contextlib.closing(fly([*checks, *agenda.left])) as flying,
    ):
        try:
            for done in flying:
                if isinstance(done.job.payload, WorldCheck):
                    _refuse_bad_world(done)
                    unchecked -= 1
                else:
                    waiting.append(done)
                while waiting and not unchecked:  # nothing is kept of a command that is refused
                    done = waiting.pop(0)
                    if not kept:
                        _refuse_bad_input(agenda, done)
                        _begin(agenda, run)
                    _keep(folder, done)
                    kept += 1
                    failed += done.answer.status is not Status.OK
                    audience.finished(done)
        except (KeyboardInterrupt, UavexpError) as error:
            with contextlib.suppress(RecordError):
                if (folder / STUDY).exists():
                    run.note(folder, _ending(error, folder), kept, failed)
                    collect(folder)
            audience.stopped(
                folder,
                kept if (folder / STUDY).exists() else 0,
                len(agenda.left),
                again=bool(command.out or command.experiment),
            )
            raise
    if not agenda.left:
        _begin(agenda, run)
    rows = collect(folder)
    run.note(folder, "finished", kept, failed)
    audience.flown(agenda, rows)
    return 1 if failed else 0


def _ending(error: BaseException, folder: Path) -> str:
    """How a run ended that did not finish, without the place of its folder."""
    if isinstance(error, KeyboardInterrupt):
        return "interrupted"
    return f"failed: {one_line(error).replace(str(folder), folder.name)}"


def _world_checks(agenda: Agenda) -> list[Job]:
    """A job for each distinct world, with its first seed; none for a trial alone, which tells by itself."""
    first: dict[str, Job] = {}
    for job in agenda.left if len(agenda.jobs) > 1 else ():
        config = job.payload.cell.config
        first.setdefault(canonical_json([config["world"], config["world_seed"]]), job)
    return [
        Job(name=f"world of {job.name}", label=f"world of {job.label}", payload=WorldCheck(trial=job.payload))
        for job in first.values()
    ]


def _fly(runner: Runner, audience: Audience, jobs: Sequence[Job]) -> Generator[Done, None, None]:
    """Make the worlds and fly what is left, in other processes; what a single trial prints is passed on."""
    workers = min(runner.workers, max(1, len(jobs)))
    if runner.backend == Backend.DASK:
        return run_dask(
            do_job_elsewhere,
            jobs,
            address=runner.address,
            queue=runner.queue,
            n_jobs=workers,
            limits=runner.limits,
            preload=[PRELOAD],
            version=version,
        )
    hear = audience.printed if len(jobs) == 1 else None
    return run_local(do_job, jobs, n_jobs=workers, limits=runner.limits, watch=audience.watch, hear=hear)


def _fly_here(audience: Audience, jobs: Sequence[Job]) -> Generator[Done, None, None]:
    """Do jobs in this process, where a debugger can be; what one raises is raised."""
    for job in jobs:
        begin_s = time.monotonic()
        value = do_job(job.payload, partial(audience.watch, job))
        answer = Answer(status=Status.OK, value=value)
        yield Done(job=job, answer=answer, wall_s=time.monotonic() - begin_s)


def _refuse_bad_world(done: Done) -> None:
    """End a command of which a world cannot be made, whatever its making came to."""
    if done.answer.mendable:
        raise ConfigError(done.answer.reason.partition(": ")[2])
    if done.answer.status is not Status.OK:
        world = done.job.payload.trial.cell.options["world"]
        raise ConfigError(f"world={world} cannot be made: {done.answer.reason}")


def _refuse_bad_input(agenda: Agenda, done: Done) -> None:
    """End a command of one trial that cannot be flown as asked, before anything is kept."""
    if len(agenda.jobs) == 1 and done.answer.mendable:
        raise ConfigError(done.answer.reason.partition(": ")[2])


def _begin(agenda: Agenda, run: Run) -> None:
    """Say what the folder is about and who flies into it, and put away what was found broken in it."""
    folder = agenda.study.folder
    remove_unfinished(folder)
    for name in agenda.stock.damaged:
        set_aside(folder, name)
    write_text(folder / STUDY, study_text(agenda.study))
    run.note(folder, FLYING)


def _keep(folder: Path, done: Done) -> None:
    """Write a trial; its world first, so that the record vouches for it.

    Raises:
        RecordError: it cannot be written, or the folder is no longer there.
    """
    if not (folder / STUDY).exists():
        words = f"{folder} was deleted or moved while this command flew; the same command begins it anew"
        raise RecordError(words) from OSError(errno.ESTALE, "deleted or moved")
    if done.answer.status is Status.OK:
        digest, data = done.answer.value.world
        if data is not None:
            put_world(folder, digest, data)
    put_trial(folder, done.job.name, files_of(done.job, done.answer, done.wall_s))


def _compile_kernels(job: Job) -> None:
    """Fly the first seconds of a trial in a process of its own, which leaves its kernels in the cache."""
    process = multiprocessing.get_context("spawn").Process(target=_warm_up, args=(job.payload,), daemon=True)
    process.start()
    process.join()


def _warm_up(trial: TrialJob) -> None:
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal's Ctrl-C is the parent's to handle

    def stop(time_s: float, _: str) -> None:
        if time_s >= _WARM_UP_S:
            raise SystemExit

    with contextlib.suppress(Exception):  # the trial itself tells what is wrong
        fly_cell(trial.cell, trial.seed, stop)
