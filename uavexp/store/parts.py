"""What records, studies and tables must hold, whoever wrote them: checked once, where they are read."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from uavexp.errors import ConfigError, RecordError
from uavexp.metrics.evaluate import METRICS
from uavexp.parameters import Constraint, Whole, check_value

if TYPE_CHECKING:
    import pandas as pd

_MOST_WORDS = 300  # of a part, that an error repeats
_TEXTS = {"outcome", "scene_kind"}  # metrics that are no numbers
_NUMBERS = {metric.column for metric in METRICS} - _TEXTS

Number = float | Literal["inf", "-inf"] | None  # as canonical JSON has it
Scalar = bool | Number | str
_NAME = re.compile(r"[^/.\0][^/\0]*")  # of one file or folder, in place
Name = Annotated[str, Constraint("a name", lambda name: bool(_NAME.fullmatch(name)))]
_Point = tuple[Number, Number, Number]
_Options = Annotated[dict[str, str], Constraint("with a world", lambda options: "world" in options)]

_RECORD_PARTS: dict[str, Any] = {
    "strategy": str,
    "options": _Options,
    "config": dict[str, Any],
    "seed": Whole,
    "status": str,
    "outcome": str | None,
    "reason": str,
    "code": str,
    "lock": str | None,
    "metrics": dict[str, Scalar],
    "replans": list[dict[str, Any]] | None,
    "world": dict[str, Any] | None,
    "traceback": list[str] | None,
}
_REPLAN_PARTS: dict[str, Any] = {
    **dict.fromkeys(("time_s", "effective_s", "score", "path_change_m", "iterations", "expansions"), Number),
    **dict.fromkeys(("blocked_since_s", "delay_s"), Number),
    **dict.fromkeys(("cause", "status"), str | None),
    **dict.fromkeys(("position_m", "goal_m"), _Point),
}
_WORLD_PARTS: dict[str, Any] = {
    "digest": Name,
    **dict.fromkeys(("clutter_density", "narrowest_gap_m", "straight_line_m"), Number),
}
_STUDY_PARTS: dict[str, Any] = {
    "name": str,
    "title": str,
    "report": dict[Literal["tables", "figures", "claims"], list[Any]],
    "axes": list[tuple[str, list[str]]],
    "seeds": list[Whole],
    "settings": dict[str, Any],
    "cells": list[dict[Literal["digest", "labels"], Any]],
}
_CELL_PARTS: dict[str, Any] = {"digest": str, "labels": dict[str, str]}
_TEXT_COLUMNS = (
    "strategy",
    "world",
    "outcome",
    "status",
    "trial",
    "reason",
    "world_digest",
    "code",
    "lock",
    "cause",
)
_NUMBER_COLUMNS = (*_NUMBERS, "seed", "number", "effective_s", "path_change_m")
_TRIALS_NEED = ("trial", "seed", "outcome", "success", "completion_time_s")
REPLANS_NEED = ("trial", "number", "effective_s", "cause", "status", "path_change_m")
_NEVER_EMPTY = ("trial", "seed")
_FILE_COLUMNS = ("trial", "world_digest")  # which name files


def check_parts(path: Path, content: Mapping[str, Any], kinds: Mapping[str, Any]) -> None:
    """Refuse content of which a part is missing or of another kind.

    Args:
        path: it stands there.
        content: of a file.
        kinds: type of each part, as of a parameter; one that may be missing allows None.

    Raises:
        RecordError: names the part and what it must be.
    """
    for name, kind in kinds.items():
        try:
            check_value(name, content.get(name), kind)
        except (ConfigError, RecursionError) as error:
            raise RecordError(f"{path}: damaged ({str(error)[:_MOST_WORDS]})") from error


def check_record(path: Path, record: Mapping[str, Any]) -> None:
    """Refuse a record that is none of a trial.

    Raises:
        RecordError: names the part and what it must be.
    """
    check_parts(path, record, _RECORD_PARTS)
    check_parts(path, record["metrics"], dict.fromkeys(_NUMBERS & record["metrics"].keys(), bool | Number))
    check_parts(path, record["metrics"], dict.fromkeys(_TEXTS & record["metrics"].keys(), str))
    for replan in record.get("replans") or ():
        check_parts(path, replan, _REPLAN_PARTS)
    if record.get("world") is not None:
        check_parts(path, record["world"], _WORLD_PARTS)


def check_study(path: Path, study: Mapping[str, Any]) -> None:
    """Refuse a study whose parts are of another kind than those that are written.

    Raises:
        RecordError: names the part and what it must be.
    """
    check_parts(path, study, _STUDY_PARTS)
    for cell in study["cells"]:
        check_parts(path, cell, _CELL_PARTS)


def is_run(entry: Any) -> bool:
    """Whether an entry of a history, on which no result depends, is one."""
    return isinstance(entry, dict) and _has(entry, {"command": list[str] | None})


def is_wall(wall: Mapping[str, Any]) -> bool:
    """Whether clock times, on which no result depends, are such."""
    times = {name: Number for name in wall if name.startswith("wall_")}
    return _has(wall, {**times, "command": str | None, "laps": dict[str, dict[str, Number]] | None})


def _has(content: Mapping[str, Any], kinds: Mapping[str, Any]) -> bool:
    try:
        check_parts(Path(), content, kinds)
    except RecordError:
        return False
    return True


def check_table(path: Path, table: pd.DataFrame, axes: Mapping[str, Any] | None) -> None:
    """Refuse a table whose columns are of another kind than those that are written.

    Args:
        path: of the table.
        table: as read.
        axes: of its study, of which each is a column of text; None for the table of replans.

    Raises:
        RecordError: names the column and what it must be.
    """
    from pandas.api.types import is_bool_dtype, is_numeric_dtype

    def refuse(column: str, words: str) -> None:
        raise RecordError(f"{path}: damaged (the column {column} {words})")

    for column in table.columns[table.columns.duplicated()]:
        refuse(column, "is there twice")
    for column in REPLANS_NEED if axes is None else (*_TRIALS_NEED, *(axes if len(table) else ())):
        if column not in table:
            refuse(column, "is missing")
    for column in {*_NEVER_EMPTY} & {*table.columns}:
        if table[column].isna().any():
            refuse(column, "is empty in places")
    for column in {*_NUMBER_COLUMNS} & {*table.columns}:
        known = table[column].dropna().infer_objects()  # truths that some trials lack are read as objects
        if len(known) and not (is_numeric_dtype(known) or is_bool_dtype(known)):
            refuse(column, "must hold numbers")
    for column in {*_TEXT_COLUMNS, *(axes or ())} & {*table.columns}:
        known = table[column].dropna().infer_objects()  # truths that some trials lack are read as objects
        if len(known) and (known.dtype == "category" or not all(isinstance(text, str) for text in known)):
            refuse(column, "must hold text")
    for column in {*_FILE_COLUMNS} & {*table.columns}:
        if not all(_NAME.fullmatch(name) for name in table[column].dropna()):
            refuse(column, "must hold names")
