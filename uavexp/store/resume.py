"""What stands in a study folder, and so what is left to fly."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from pathlib import Path
from typing import Any

from uavexp.errors import RecordError
from uavexp.store.logs import check_packed
from uavexp.store.records import LOG, OtherVersionError, Status, read_record, trial_name
from uavexp.store.study import Study, StudyCell, read_runs, trial_folders


@dataclass(frozen=True, slots=True, kw_only=True)
class Stock:
    """Names of the trials that stand in a folder, by what they are good for."""

    finished: frozenset[str] = frozenset()
    failed: frozenset[str] = frozenset()  # recorded, and to be flown again
    damaged: Mapping[str, str] = field(default_factory=dict)  # name -> what is wrong


class _State(Enum):
    FINISHED = auto()
    FAILED = auto()
    DAMAGED = auto()
    OTHER = auto()


def join_studies(stored: Study, asked: Study, whole: Study | None = None) -> Study:
    """The study of a folder after one more command, with the seeds of both.

    Args:
        stored: what the folder holds.
        asked: what the command asks for.
        whole: of which both are parts; by default the larger of the two.

    Raises:
        RecordError: one of them is no part of it.
    """
    whole = whole or (asked if contains(asked, stored) else stored)
    if asked.name != stored.name or not (contains(whole, asked) and contains(whole, stored)):
        raise RecordError(_other_study(stored))
    there = _places(stored) | _places(asked)
    cells = tuple(cell for cell in whole.cells if _place(cell) in there)
    told = replace(asked, cells=cells, axes=whole.axes)
    return replace(told, seeds=tuple(sorted({*stored.seeds, *asked.seeds})))


def contains(study: Study, other: Study) -> bool:
    """Whether a study has all cells of another, under the same labels."""
    return _places(study) >= _places(other)


def _places(study: Study) -> set[tuple[Any, ...]]:
    return {_place(cell) for cell in study.cells}


def _place(cell: StudyCell) -> tuple[Any, ...]:
    """What makes two cells the same; an axis that a part of an experiment lacks is empty in the whole."""
    return (cell.digest, *sorted(label for label in cell.labels.items() if label[1]))


def _other_study(stored: Study) -> str:
    """What a folder holds and how to go on with it or beside it."""
    runs = read_runs(stored.folder)
    command = shlex.join(runs[-1].get("command", ())) if runs else ""
    holds = f"{stored.folder} holds the trials of an earlier command with other cells"
    return (
        f"{holds}{f' (python -m uavexp {command})' if command else ''}; name another folder with out=DIR, "
        "or type a command that has the earlier cells, too"
    )


def take_stock(folder: Path, version: Mapping[str, Any], *, accept_other_code: bool) -> Stock:
    """Read every record of a study folder.

    Args:
        folder: of the study; need not exist.
        version: what a record must say of the code that wrote it, e.g. `code` and `lock`.
        accept_other_code: count finished trials of another version as finished.

    Raises:
        RecordError: records of another version, which must not be pooled unasked.
    """
    states: dict[str, _State] = {}
    damage: dict[str, str] = {}
    for item in trial_folders(folder):
        states[item.name], damage[item.name] = _judge(item, version)
    others = _named(states, _State.OTHER)
    if others and not accept_other_code:
        raise RecordError(
            f"{folder} holds {len(others)} trials flown by another version of uavexp or of its packages; "
            "name another folder with out=DIR, or keep them among the new ones with "
            "runner.accept_other_code=true"
        )
    return Stock(
        finished=_named(states, _State.FINISHED) | others,
        failed=_named(states, _State.FAILED),
        damaged={name: damage[name] for name in sorted(_named(states, _State.DAMAGED))},
    )


def _judge(trial: Path, version: Mapping[str, Any]) -> tuple[_State, str]:
    try:
        record = read_record(trial)
        if trial_name(record) != trial.name:
            return _State.DAMAGED, "its record is of another trial"
        if record["status"] != Status.OK:
            return _State.FAILED, ""
        check_packed(trial / LOG)
    except OtherVersionError as error:
        raise RecordError(f"{error}; name another folder with out=DIR") from error
    except (RecordError, KeyError, TypeError) as error:
        return _State.DAMAGED, str(error)
    same = all(record.get(name) == value for name, value in version.items())
    return (_State.FINISHED if same else _State.OTHER), ""


def _named(states: Mapping[str, _State], state: _State) -> frozenset[str]:
    return frozenset(name for name, found in states.items() if found is state)
