"""A folder of flown trials as tables: what the sweep leaves behind and the report reads.

    study.json        what was asked: experiment, axes, seeds, digests (canonical JSON, no clock, no path)
    run.json          how it ran: command, machine, clock times
    trials.parquet    one row per trial, sorted by cell and seed
    replans.parquet   one row per planning request of every trial
    trials/NAME/      record.json, log.npz, wall.json, picture.png of one trial
    worlds/DIGEST.npz the true geometry, once for all trials flown in it
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from uavexp.errors import RecordError
from uavexp.logs import read_log
from uavexp.records import LOG
from uavexp.table import TABLE
from uavexp.types import TrialLog

STUDY, RUN, REPLANS = "study.json", "run.json", "replans.parquet"
TRIALS, WORLDS = "trials", "worlds"


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
    report: str  # which report is made of it: table1, tradeoff, policies, robustness, "" (a summary)
    axes: dict[str, tuple[str, ...]]
    seeds: tuple[int, ...]
    settings: dict[str, Any]  # free values of the experiment's file for its report, e.g. primary arm

    @cached_property
    def trials(self) -> pd.DataFrame:
        """One row per trial (columns in `uavexp.table`), axes as plain text columns."""
        return _read(self.folder / TABLE)

    @cached_property
    def replans(self) -> pd.DataFrame:
        """One row per planning request: trial, axes, seed, and the fields of `types.Replan` but arrays."""
        return _read(self.folder / REPLANS)

    def has_log(self, trial: str) -> bool:
        """Whether the log of this trial (column `trial`) lies in the folder."""
        return (self.folder / TRIALS / trial / LOG).is_file()

    def log(self, trial: str) -> TrialLog:
        """Log of a trial.

        Raises:
            RecordError: missing or damaged.
        """
        return read_log(self.folder / TRIALS / trial / LOG)


def read_study(folder: Path) -> Study:
    """Read what a study folder was asked for; its tables are read when used.

    Raises:
        RecordError: no study, or a damaged one.
    """
    file = folder / STUDY
    try:
        text = json.loads(file.read_text(encoding="utf-8"))
        return Study(
            folder=folder,
            name=text["name"],
            title=text["title"],
            report=text["report"],
            axes={name: tuple(values) for name, values in text["axes"]},
            seeds=tuple(text["seeds"]),
            settings=text["settings"],
        )
    except OSError as error:
        raise RecordError(f"{folder} holds no study: {STUDY} cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError) as error:
        raise RecordError(f"{file}: damaged ({error})") from error


def _read(file: Path) -> pd.DataFrame:
    from pyarrow import ArrowException, parquet

    try:
        return parquet.read_table(file, page_checksum_verification=True).to_pandas()
    except (OSError, ArrowException) as error:
        raise RecordError(f"{file}: cannot be read ({error})") from error
