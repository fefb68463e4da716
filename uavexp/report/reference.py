"""The paper's numbers, from `experiments/PAPER/reference.csv`."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

from uavexp.errors import RecordError
from uavexp.paths import experiments_folder

FILE = "reference.csv"


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """A number as a paper prints it."""

    mean: float
    sd: float  # NaN where none is printed
    source: str
    notes: str


Reference = dict[tuple[str, str], Printed]  # metric column, arm -> number


def read_reference(experiment: str) -> Reference:
    """The numbers of the paper an experiment belongs to; empty where none are printed.

    Args:
        experiment: its name, e.g. "mcr/table1": the folder before the stroke is the paper.

    Raises:
        RecordError: the file is damaged.
    """
    paper = experiment.rpartition("/")[0]
    file = experiments_folder() / paper / FILE
    return _read(file) if paper and file.is_file() else {}


def _read(file: Path) -> Reference:
    try:
        with file.open(encoding="utf-8", newline="") as text:
            return {
                (row["metric"], row["arm"]): Printed(
                    mean=float(row["mean"]),
                    sd=float(row["sd"] or math.nan),
                    source=row["source"],
                    notes=row["notes"],
                )
                for row in csv.DictReader(text)
            }
    except (KeyError, ValueError) as error:
        raise RecordError(f"{file}: damaged ({error})") from error
