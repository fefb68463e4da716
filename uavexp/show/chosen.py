"""Which flights are shown of a folder: the trial's own, or those of several arms in one world."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from uavexp.errors import RecordError
from uavexp.store.records import LOG
from uavexp.store.stored_trial import StoredTrial, read_trial
from uavexp.store.study import STUDY, TRIALS, read_study


@dataclass(frozen=True, slots=True, kw_only=True)
class Chosen:
    """Flights in one world, and what they are together."""

    title: str
    trials: tuple[StoredTrial, ...]  # at least one


def chosen(folder: Path) -> Chosen:
    """The flights shown of a folder; of a study the first world that its arms share.

    Raises:
        RecordError: no flight is stored there, or it is damaged.
    """
    if not (folder / STUDY).is_file():
        trial = read_trial(folder)
        return Chosen(title=trial.label, trials=(trial,))
    logs = sorted((folder / TRIALS).glob(f"*/{LOG}"))
    if len(logs) == 1:
        trial = read_trial(logs[0].parent)
        return Chosen(title=trial.label, trials=(trial,))
    if not logs:
        raise RecordError(f"{folder}: no trial there has a log: its folder {TRIALS}/ was not kept")
    return _arms(folder)


def _arms(folder: Path) -> Chosen:
    from uavexp.report import flights  # pandas, a second
    from uavexp.report.results import Results

    results = Results(study=read_study(folder))
    shared = flights.shared_world(results, flights.three_arms(results), flights.scene_at(results, "first"))
    trials = tuple(
        StoredTrial(name=shared.trials[arm], label=arm, log=log, world=shared.world)
        for arm, log in shared.logs.items()
    )
    return Chosen(title=f"{results.study.title or folder.name}: {shared.where}", trials=trials)
