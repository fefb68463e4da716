"""A trial to fly as a job of a sweep: what goes to the child, and what comes back."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavexp.config.composition import Cell
from uavexp.errors import RecordError
from uavexp.flight import Trial, check_world, fly_cell
from uavexp.store.outputs import failure_files, trial_files
from uavexp.store.records import PICTURE, code_digest, lock_digest
from uavexp.store.world_cache import kept
from uavexp.store.worlds import is_whole, world_bytes
from uavexp.sweep.job import Answer, Job, Progress
from uavexp.world.base import WorldGenerator


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialJob:
    """One trial to fly; the payload of its job."""

    cell: Cell
    seed: int
    identity: dict[str, Any]  # what makes it this trial (`outputs.identity`), and the seed
    version: dict[str, Any]  # code and lock digests
    command: str  # that repeats it
    worlds: Path  # where worlds are kept that need not be sent again
    picture: bool  # draw it also when it succeeds

    def keep_world(self, generator: WorldGenerator) -> WorldGenerator:
        """The generator of its world, which draws it once for all trials in it."""
        config = self.identity["config"]
        layout = self.seed if config["world_seed"] is None else config["world_seed"]
        return kept(generator, config["world"], layout, self.version)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldCheck:
    """The world of a trial, made before any flight in it counts; the payload of its job."""

    trial: TrialJob


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """A flown trial as the files that it becomes."""

    files: dict[str, bytes]
    world: tuple[str, bytes | None]  # digest; content, if it is not kept yet
    outcome: str
    success: bool
    reason: str


def do_job(asked: TrialJob | WorldCheck, progress: Progress) -> Flown | None:
    """Fly a trial or make a world, in a process that may die of a stranger's file."""
    if isinstance(asked, WorldCheck):
        check_world(asked.trial.cell, asked.trial.seed, asked.trial.keep_world)
        return None
    return fly_job(asked, progress)


def fly_job(asked: TrialJob, progress: Progress) -> Flown:
    """Fly one trial and return its files; nothing is written here."""
    begin_s = time.perf_counter()
    trial = fly_cell(asked.cell, asked.seed, progress, asked.keep_world)
    wall = {"command": asked.command, "wall_trial_s": time.perf_counter() - begin_s}
    digest, success = trial.world.digest, bool(trial.metrics["success"])
    known = is_whole(asked.worlds / f"{digest}.npz")
    files = trial_files(trial, {**asked.identity, **asked.version}, wall)
    return Flown(
        files=files | (_picture(trial, asked) if asked.picture or not success else {}),
        world=(digest, None if known else world_bytes(trial.world)),
        outcome=str(trial.log.outcome),
        success=success,
        reason=trial.log.reason,
    )


def _picture(trial: Trial, asked: TrialJob) -> dict[str, bytes]:
    from uavexp.report.picture_files import picture_png  # matplotlib, which most flights do without

    shown = {**asked.identity, "metrics": trial.metrics}
    return {PICTURE: picture_png(trial.world, trial.log, shown, asked.command)}


def version() -> dict[str, Any]:
    """What a record says of the code that wrote it: digests of uavexp and of its lock file."""
    return {"code": code_digest(), "lock": lock_digest()}


def do_job_elsewhere(asked: TrialJob | WorldCheck, progress: Progress) -> Flown | None:
    """The same on a worker, which must run the version that the record will name.

    Raises:
        RecordError: it runs another one.
    """
    trial = asked.trial if isinstance(asked, WorldCheck) else asked
    if version() != trial.version:
        raise RecordError("this Dask worker runs another version of uavexp than the command")
    return do_job(asked, progress)


def files_of(job: Job, answer: Answer, wall_s: float) -> dict[str, bytes]:
    """Files that a trial leaves behind, flown or not."""
    if isinstance(answer.value, Flown):
        return answer.value.files
    asked: TrialJob = job.payload
    wall = {"command": asked.command, "wall_trial_s": wall_s}
    head = {**asked.identity, **asked.version}
    return failure_files(answer.status, answer.reason, answer.trace, head, wall)
