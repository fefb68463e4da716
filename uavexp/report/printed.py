"""What a paper prints, from `experiments/PAPER/reference.csv` and other files beside it."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass

from uavexp.errors import RecordError
from uavexp.paths import experiments_folder

_FILE = "reference.csv"
_CITATION = "paper.txt"


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
    try:
        return {
            (row["metric"], row["arm"]): Printed(
                mean=float(row["mean"]),
                sd=float(row["sd"] or math.nan),
                source=row["source"],
                notes=row["notes"],
            )
            for row in read_rows(experiment, _FILE)
        }
    except (KeyError, ValueError) as error:
        raise RecordError(f"{_FILE} of {experiment}: damaged ({error})") from error


def citation(experiment: str) -> str:
    """The paper that an experiment belongs to, as it is cited; empty where none is named."""
    paper = experiment.rpartition("/")[0]
    file = experiments_folder() / paper / _CITATION
    return file.read_text(encoding="utf-8").strip() if paper and file.is_file() else ""


def read_rows(experiment: str, file_name: str) -> list[dict[str, str]]:
    """Rows of a file beside the experiments of a paper; none where it is not there."""
    paper = experiment.rpartition("/")[0]
    file = experiments_folder() / paper / file_name
    if not paper or not file.is_file():
        return []
    with file.open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))
