"""A folder of flown trials as tables: what the sweep leaves behind and the report reads.

    study.json        what was asked: experiment, axes, cells, seeds (canonical JSON, no clock, no path)
    run.json          how it ran, each time: command, machine, clock times
    trials.parquet    one row per trial, sorted by cell and seed
    replans.parquet   one row per planning request of every trial
    trials/NAME/      record.json, log.npz, wall.json of one trial; picture.png of one flown alone or failed
    trials/NAME.aside-1/  an earlier try at NAME: failed, or damaged since
    worlds/DIGEST.npz the true geometry, once for all trials flown in it

A record does not know its study: the axes' values of a cell (its labels) stand in study.json,
so that a trial repeated by itself has the same record.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uavexp.errors import RecordError, one_line
from uavexp.log import TrialLog
from uavexp.store.files import json_of, opened
from uavexp.store.logs import read_log
from uavexp.store.parts import REPLANS_NEED, check_study, check_table, is_run, is_wall
from uavexp.store.records import LOG, WALL, canonical_json, cell_digest, read_record, trial_name
from uavexp.store.table import (
    FIRST_OF_REPLANS,
    REPLANS,
    TABLE,
    Row,
    replan_rows,
    row_of,
    with_every_cause,
    write_table,
)
from uavexp.store.worlds import read_world
from uavexp.types import World

if TYPE_CHECKING:
    import pandas as pd

STUDY, RUN = "study.json", "run.json"
TRIALS, WORLDS = "trials", "worlds"
ASIDE = ".aside-"
_TRIAL = re.compile(r"[\w-][\w.-]*", re.ASCII)  # a trial's name (`records.trial_name`)
_MOST_CELLS = 500_000_000  # of a table
_MOST_WORDS = 300  # of what a library says of a bad file
_REPORTED = ("p_trigger_", "p_planner_unknown")  # parameters that figures and notes show


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyCell:
    """One configuration of a study and its place on each axis."""

    digest: str  # `uavexp.store.records.cell_digest`
    labels: dict[str, str]  # axis -> value


@dataclass(frozen=True, kw_only=True)
class Study:
    """A study folder, read when asked.

    `axes` maps the name of each axis of the experiment (a column of `trials`, e.g. `arm`, `scene`)
    to its values in the order of the experiment's file; a command without `experiments=`
    has the one axis `cell`.
    """

    folder: Path
    name: str  # experiment, e.g. "mcr/table1"; "" for a command without one
    title: str
    report: dict[str, Any]  # its tables, figures and claims (`uavexp.report.declared`); none: a summary
    axes: dict[str, tuple[str, ...]]
    seeds: tuple[int, ...]
    settings: dict[str, Any]  # free values of the experiment's file for its report, e.g. primary arm
    cells: tuple[StudyCell, ...] = ()

    @cached_property
    def trials(self) -> pd.DataFrame:
        """One row per trial (columns in `uavexp.store.table`), axes as plain text columns."""
        return self._table(TABLE)

    @cached_property
    def measurements(self) -> pd.DataFrame:
        """The columns of `trials` that reports read: all but the parameters of most groups."""
        return self._table(TABLE, lambda name: not name.startswith("p_") or name.startswith(_REPORTED))

    @cached_property
    def replans(self) -> pd.DataFrame:
        """One row per planning request: trial, axes, seed, and the fields of `types.Replan` but arrays."""
        return self._table(REPLANS)

    def _table(self, name: str, wanted: Callable[[str], bool] = lambda name: True) -> pd.DataFrame:
        table = _read(self.folder / name, wanted)
        check_table(self.folder / name, table, self.axes if name == TABLE else None)
        return table

    def has_log(self, trial: str) -> bool:
        """Whether the log of this trial (column `trial`) lies in the folder."""
        return (self.folder / TRIALS / trial / LOG).is_file()

    def log(self, trial: str) -> TrialLog:
        """Log of a trial.

        Raises:
            RecordError: missing or damaged.
        """
        return read_log(self.folder / TRIALS / trial / LOG)

    def world(self, digest: str) -> World:
        """World that trials were flown in (column `world_digest`).

        Raises:
            RecordError: missing or damaged.
        """
        return read_world(self.folder / WORLDS / f"{digest}.npz")


def read_study(folder: Path) -> Study:
    """Read what a study folder was asked for; its tables are read when used.

    Raises:
        RecordError: no study, or a damaged one.
    """
    file = folder / STUDY
    if not file.exists():
        raise RecordError(f"{folder} holds no study: {STUDY} is missing")
    text = json_of(file)
    check_study(file, text)
    return Study(
        folder=folder,
        name=text["name"],
        title=text["title"],
        report=text["report"],
        axes={name: tuple(values) for name, values in text["axes"]},
        seeds=tuple(text["seeds"]),
        settings=text["settings"],
        cells=tuple(StudyCell(**cell) for cell in text["cells"]),
    )


def study_text(study: Study) -> str:
    """Text of `study.json`, the same for the same study."""
    body = {
        "name": study.name,
        "title": study.title,
        "report": study.report,
        "axes": [[name, list(values)] for name, values in study.axes.items()],
        "seeds": study.seeds,
        "settings": study.settings,
        "cells": [{"digest": cell.digest, "labels": cell.labels} for cell in study.cells],
    }
    return canonical_json(body) + "\n"


def collect(folder: Path) -> list[Row]:
    """Write both tables of a study folder anew, from its records alone.

    Delays that a record does not tell (an earlier version wrote it) come from its log, if that is there.

    Returns:
        The rows of `trials.parquet`.

    Raises:
        RecordError: a record is damaged or of another study, or the tables cannot be written.
    """
    study = read_study(folder)
    place = {cell.digest: (index, cell.labels) for index, cell in enumerate(study.cells)}
    trials: list[tuple[int, int, Row, list[Row]]] = []
    for item in trial_folders(folder):
        record = read_record(item)
        if cell_digest(record) not in place or trial_name(record) != item.name:
            raise RecordError(f"{item} is no trial of this study: move it away")
        index, labels = place[cell_digest(record)]
        record = _with_delays(record, item / LOG)
        row = row_of(record, read_wall(item), labels)
        trials.append((index, record["seed"], row, list(replan_rows(record, labels))))
    trials.sort(key=lambda trial: trial[:2])
    rows = with_every_cause([row for _, _, row, _ in trials])
    write_table(folder / TABLE, rows)
    replans = [row for *_, own in trials for row in own]
    write_table(folder / REPLANS, replans, FIRST_OF_REPLANS if replans else REPLANS_NEED)
    return rows


def _with_delays(record: dict[str, Any], log: Path) -> dict[str, Any]:
    """A record whose planning requests tell their delays, as far as they are known."""
    replans = record.get("replans", [])
    if not replans or "delay_s" in replans[0] or not log.is_file():
        return record
    from uavexp.metrics.replanning import request_delays  # with a whole world of geometry behind it

    delays = request_delays(read_log(log))
    told = [{**replan, **delay._asdict()} for replan, delay in zip(replans, delays, strict=True)]
    return {**record, "replans": told}


def trial_folders(folder: Path) -> Iterator[Path]:
    """Folders of the trials that stand in a study folder, by name; none set aside, half-written or a link."""
    for item in sorted((folder / TRIALS).glob("*")):
        if _TRIAL.fullmatch(item.name) and ASIDE not in item.name and item.is_dir() and not item.is_symlink():
            yield item


def read_wall(trial: Path) -> dict[str, Any]:
    """Clock times and command of a trial; empty when they are not there."""
    wall = _unsealed(trial / WALL)
    return wall if is_wall(wall) else {}


def read_runs(folder: Path) -> list[dict[str, Any]]:
    """Every time a command flew into this folder: command, machine, clock times."""
    runs = _unsealed(folder / RUN).get("runs", [])
    return [run for run in runs if is_run(run)] if isinstance(runs, list) else []


def _unsealed(file: Path) -> dict[str, Any]:
    """A JSON file that no result depends on; empty when missing or damaged."""
    try:
        return json_of(file)
    except RecordError:
        return {}


def _read(file: Path, wanted: Callable[[str], bool] = lambda name: True) -> pd.DataFrame:
    from pyarrow import ArrowException, parquet, types

    try:
        with opened(file) as data, parquet.ParquetFile(data, page_checksum_verification=True) as table:
            columns = [name for name in table.schema_arrow.names if wanted(name)]
            if table.metadata.num_rows * len(columns) > _MOST_CELLS:
                raise RecordError(f"{file}: {table.metadata.num_rows} rows, more than any study has")
            frame: pd.DataFrame = table.read(columns).to_pandas(ignore_metadata=True)
            for item in table.schema_arrow:  # yes or no that not every world asks for: numbers, NaN where not
                if types.is_boolean(item.type) and item.name in frame and frame[item.name].hasnans:
                    frame[item.name] = frame[item.name].astype(float)
            return frame
    except (OSError, ArrowException, ValueError, MemoryError) as error:
        raise RecordError(f"{file}: cannot be read ({one_line(error)[:_MOST_WORDS]})") from error
