"""What a command asks of its folder: which study, which trials, and which of them are left to fly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavexp.cli.composition import Command
from uavexp.cli.flight import repeat_command
from uavexp.cli.job import Task
from uavexp.cli.outputs import identity
from uavexp.records import cell_digest, code_digest, lock_digest, trial_name
from uavexp.study import STUDY, WORLDS, Study, StudyCell, read_study
from uavexp.sweep.job import Job
from uavexp.sweep.resume import Stock, join_studies, take_stock


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A command's trials against what its folder holds."""

    study: Study  # with the cells and seeds that were there before
    jobs: tuple[Job, ...]  # all trials of the command
    stock: Stock  # what stands in the folder

    @property
    def left(self) -> tuple[Job, ...]:
        """Trials to fly: missing, failed or damaged."""
        return tuple(job for job in self.jobs if job.name not in self.stock.finished)

    @property
    def again(self) -> int:
        """How many of them failed before."""
        return sum(job.name in self.stock.failed for job in self.jobs)


def plan_of(
    command: Command, folder: Path, user_folder: Path | None = None, *, accept_other_code: bool = False
) -> Plan:
    """Compare a command with its folder; nothing is written.

    Raises:
        RecordError: the folder holds another study, or trials of another version.
    """
    version = {"code": code_digest(), "lock": lock_digest()}
    identities = [identity(cell) for cell in command.cells]
    study = _study(command, folder, identities)
    if (folder / STUDY).exists():
        study = join_studies(read_study(folder), study)
    return Plan(
        study=study,
        jobs=_jobs(command, folder, identities, version, user_folder),
        stock=take_stock(folder, version, accept_other_code=accept_other_code),
    )


def _jobs(
    command: Command,
    folder: Path,
    identities: list[dict[str, Any]],
    version: Mapping[str, Any],
    user_folder: Path | None,
) -> tuple[Job, ...]:
    """Cells x seeds, all cells of a seed together: an interrupted study is a balanced one."""
    return tuple(
        Job(
            name=trial_name({**whole, "seed": seed}),
            label=f"{' '.join(cell.labels.values()) or cell.strategy} seed {seed}",
            payload=Task(
                cell=cell,
                seed=seed,
                identity={**whole, "seed": seed},
                version=dict(version),
                command=repeat_command(cell, seed, user_folder),
                worlds=folder / WORLDS,
            ),
        )
        for seed in sorted(command.seeds)
        for cell, whole in zip(command.cells, identities, strict=True)
    )


def _study(command: Command, folder: Path, identities: list[dict[str, Any]]) -> Study:
    experiment = command.experiment
    return Study(
        folder=folder,
        name=experiment.name if experiment else "",
        title=experiment.title if experiment else "",
        report=experiment.report if experiment else "",
        axes=command.axes,
        seeds=tuple(sorted(command.seeds)),
        settings=dict(experiment.settings) if experiment else {},
        cells=tuple(
            StudyCell(digest=cell_digest(whole), labels=cell.labels)
            for cell, whole in zip(command.cells, identities, strict=True)
        ),
    )
