"""One stored trial by its folder, whatever else lies beside it: its flight, and its world if it is there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from uavexp.errors import RecordError
from uavexp.log import TrialLog
from uavexp.store.logs import read_log
from uavexp.store.records import LOG, RECORD, read_record
from uavexp.store.study import TRIALS, WORLDS
from uavexp.store.worlds import read_world
from uavexp.types import World


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredTrial:
    """What is shown and handed on of a flight."""

    name: str  # of its folder
    label: str  # strategy and seed, or the name where no record tells
    log: TrialLog
    world: World | None  # None where its file is not there


def read_trial(folder: Path) -> StoredTrial:
    """Read the trial of a folder; the log alone suffices.

    Raises:
        RecordError: no trial lies there, it is damaged, or it did not take one step.
    """
    folder = folder.absolute()
    if not (folder / LOG).is_file():
        raise RecordError(_no_trial(folder))
    log = read_log(folder / LOG)
    if not log.steps.time_s.size:
        raise RecordError(f"{folder / LOG}: the flight ended before its first step; nothing can be shown")
    label, world = folder.name, None
    if (folder / RECORD).is_file():
        record = read_record(folder)
        label = f"{record['strategy']}, seed {record['seed']}"
        file = folder.parents[1] / WORLDS / f"{record.get('world', {}).get('digest')}.npz"
        world = read_world(file) if file.is_file() else None
    return StoredTrial(name=folder.name, label=label, log=log, world=world)


def _no_trial(folder: Path) -> str:
    """Why a folder is no trial, and which one beside or below it could have been meant."""
    if not folder.is_dir():
        return f"{folder}: there is no such folder; name a trial's, e.g. outputs/0001-mcr-rooms/trials/NAME"
    below = sorted(folder.glob(f"{TRIALS}/*/{LOG}"))
    meant = f"; it is a study of {len(below)} trials, name one, e.g. {below[0].parent}" if below else ""
    return f"{folder} holds no trial: {LOG} is missing{meant}"
