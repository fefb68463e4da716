"""Short flights of any options with parameters far from the usual: flown, or refused in one line."""

from __future__ import annotations

import io
import json
import math
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz.commands import drawn, faults_of
from tests.sweeps import QUICK
from uavexp.config.composition import Composer
from uavexp.flight import fly_cell
from uavexp.store.logs import unpack
from uavexp.store.outputs import trial_files
from uavexp.store.records import Status
from uavexp.sweep.agenda import agenda_of
from uavexp.sweep.fork_server import start_fork_server
from uavexp.sweep.head_start import PRELOAD
from uavexp.sweep.job import Allowance, Done, Job, Progress
from uavexp.sweep.local import run_local
from uavexp.sweep.trial_job import TrialJob, fly_job

LIMITS = Allowance(timeout_s=120.0, memory_mb=4000.0)
_DRAWN_EACH = 10  # a picture costs more than its flight
_SHORT = 0.1  # s, and s a metre, square metre or viewpoint
_DURATIONS = {
    "explore": ("time_base_s", "time_per_area_spm2"),
    "inspect": ("time_base_s", "time_per_viewpoint_s", "time_per_path_spm"),
}
_FINITE = (
    "time_s", "position_m", "velocity_mps", "quaternion_wxyz", "estimated_position_m", "clearance_m",
    "reference_position_m", "reference_acceleration_mps2", "tick_s", "mapped_m", "goals_m",
)  # fmt: skip


def jobs(composer: Composer, count: int, seed: int, place: Path) -> Iterator[Job]:
    """So many jobs of flights that compose."""
    chance = random.Random(seed)
    made = 0
    while made < count:
        words = drawn(composer, chance, wild=False)
        taken = {word.split("=")[0].lstrip("+") for word in words}
        mission = next((word.split("=")[1] for word in words if word.startswith("mission=")), "goto")
        short = [f"mission.{key}" for key in _DURATIONS.get(mission, ())]
        words += [f"{key}={_SHORT}" for key in short if key not in taken]
        taken |= set(short)
        quick = [word for word in QUICK if word.split("=")[0] not in taken and not _clashes(word, taken)]
        command, _ = faults_of(composer, [*quick, *words, *([] if "seed" in taken else [f"seed={made % 7}"])])
        if command is None or command.out or command.experiment:
            continue
        try:
            job = agenda_of(command, place).jobs[0]
        except Exception:  # refused: the composer's part of the fuzzer looks at that
            continue
        payload = (job.payload, made % _DRAWN_EACH == 0)
        yield Job(name=f"{made} {job.name}", label=" ".join(words), payload=payload)
        made += 1


def _clashes(word: str, taken: set[str]) -> bool:
    """Whether a parameter's group has another option than the quick one's."""
    return word.split("=")[0].split(".")[0] in taken


def fly_one(asked: tuple[TrialJob, bool], progress: Progress) -> dict[str, bytes]:
    """Fly as a sweep does, with a picture or without one; the files of the trial."""
    trial_job, drawn = asked
    if drawn:
        return fly_job(trial_job, progress).files
    trial = fly_cell(trial_job.cell, trial_job.seed, progress, trial_job.keep_world)
    return trial_files(trial, {**trial_job.identity, **trial_job.version}, {})


def fly(
    composer: Composer, count: int, seed: int, place: Path, n_jobs: int = 2
) -> Iterator[tuple[str, list[str]]]:
    """Fly; the status of each, and what ended as nothing may end."""
    start_fork_server([PRELOAD, "tests.fuzz.flights"])
    for done in run_local(fly_one, jobs(composer, count, seed, place), n_jobs=n_jobs, limits=LIMITS):
        yield str(done.answer.status), list(_faults(done))


def _faults(done: Done) -> Iterator[str]:
    answer = done.answer
    if answer.status is Status.OK:
        yield from (f"{done.job.label}: {fault}" for fault in _not_finite(answer.value))
    elif not answer.mendable:
        yield f"{done.job.label}: {answer.status}: {answer.reason} {answer.trace[-2:]}"
    elif not answer.reason or "\n" in answer.reason:
        yield f"{done.job.label}: refused in no line"


def _not_finite(files: dict[str, bytes]) -> Iterator[str]:
    arrays = unpack(io.BytesIO(files["log.npz"]))
    for name in _FINITE:
        if not np.isfinite(arrays[name]).all():
            yield f"{name} is not finite"
    metrics: dict[str, Any] = json.loads(files["record.json"])["metrics"]
    for name, value in metrics.items():
        if value in ("inf", "-inf") or (isinstance(value, float) and not math.isfinite(value)):
            yield f"{name} is {value}"
