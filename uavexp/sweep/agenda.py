"""What a command asks of its folder: which study, which trials, and which of them are left to fly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavexp.config.composition import CommandLine, Composer
from uavexp.config.overrides import Setting
from uavexp.errors import ConfigError
from uavexp.flight import repeat_command
from uavexp.store.outputs import identity
from uavexp.store.records import cell_digest, trial_name
from uavexp.store.resume import Stock, contains, join_studies, take_stock
from uavexp.store.study import STUDY, WORLDS, Study, StudyCell, read_study
from uavexp.store.table import is_ours
from uavexp.sweep.job import Job
from uavexp.sweep.trial_job import TrialJob, version


@dataclass(frozen=True, slots=True, kw_only=True)
class Agenda:
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


def agenda_of(
    command: CommandLine, folder: Path, user_folder: Path | None = None, *, accept_other_code: bool = False
) -> Agenda:
    """Compare a command with its folder; nothing is written.

    Raises:
        RecordError: the folder holds another study, or trials of another version.
        ConfigError: the experiment names a table, figure, judge or metric that does not exist.
    """
    identities = [identity(cell) for cell in command.cells]
    study = _study(command, folder, identities)
    for axis in study.axes:
        if is_ours(axis):
            raise ConfigError(f"an axis may not be called {axis}: a column of the trials is; rename the axis")
    if command.experiment is not None:
        from uavexp.report.declared import declared  # pandas and matplotlib, needed by no other command

        declared(study)  # a report that cannot be made is refused before the first flight
    if (folder / STUDY).exists():
        study = _joined(read_study(folder), study, command, user_folder)
    ours = version()
    return Agenda(
        study=study,
        jobs=_jobs(command, folder, identities, ours, user_folder),
        stock=take_stock(folder, ours, accept_other_code=accept_other_code),
    )


def _joined(stored: Study, asked: Study, command: CommandLine, user_folder: Path | None) -> Study:
    """The study of a folder after one more command: the larger of two, or two parts of one experiment.

    Parts are told by the command typed with the entries of both: it must have the cells of both.

    Raises:
        RecordError: they do not belong together.
    """
    if contains(asked, stored) or contains(stored, asked) or not _is_part(command, stored):
        return join_studies(stored, asked)
    whole = _with_entries_of(stored, command, user_folder)
    cells = [identity(cell) for cell in whole.cells]
    return join_studies(stored, asked, whole=_study(whole, stored.folder, cells))


def _is_part(command: CommandLine, stored: Study) -> bool:
    """Whether a command's experiment is the stored one's and still has the entries that were flown."""
    experiment = command.experiment
    return (
        experiment is not None
        and experiment.name == stored.name
        and all(set(stored.axes.get(axis, ())) <= set(entries) for axis, entries in experiment.axes.items())
    )


def _with_entries_of(stored: Study, command: CommandLine, user_folder: Path | None) -> CommandLine:
    """The command as if the entries flown before had been picked, too."""
    axes = command.experiment.axes if command.experiment else {}
    picked = [
        Setting(key=axis, values=tuple(dict.fromkeys((*command.axes[axis], *stored.axes[axis]))))
        for axis in axes
    ]
    others = [setting for setting in command.settings if setting.key not in axes]
    return Composer(user_folder=user_folder).command([*others, *picked])


def _jobs(
    command: CommandLine,
    folder: Path,
    identities: list[dict[str, Any]],
    code: Mapping[str, Any],
    user_folder: Path | None,
) -> tuple[Job, ...]:
    """Cells x seeds, all cells of a seed together: an interrupted study is a balanced one."""
    return tuple(
        Job(
            name=trial_name({**whole, "seed": seed}),
            label=f"{' '.join(cell.labels.values()) or cell.strategy} seed {seed}",
            payload=TrialJob(
                cell=cell,
                seed=seed,
                identity={**whole, "seed": seed},
                version=dict(code),
                command=repeat_command(cell, seed, user_folder),
                worlds=folder / WORLDS,
                picture=len(command.cells) * len(command.seeds) == 1,
            ),
        )
        for seed in sorted(command.seeds)
        for cell, whole in zip(command.cells, identities, strict=True)
    )


def _study(command: CommandLine, folder: Path, identities: list[dict[str, Any]]) -> Study:
    experiment = command.experiment
    return Study(
        folder=folder,
        name=experiment.name if experiment else "",
        title=experiment.title if experiment else "",
        report=dict(experiment.report) if experiment else {},
        axes=command.axes,
        seeds=tuple(sorted(command.seeds)),
        settings=dict(experiment.settings) if experiment else {},
        cells=tuple(
            StudyCell(digest=cell_digest(whole), labels=cell.labels)
            for cell, whole in zip(command.cells, identities, strict=True)
        ),
    )
