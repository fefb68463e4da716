"""What of a flown study is committed: tables, claims, figures and rows; the rest is made anew."""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd
from PIL import Image

from uavexp.report.derived import FALSE_TRIGGERS, with_false_triggers
from uavexp.report.make import FIGURES
from uavexp.store.records import write_atomically
from uavexp.store.study import RUN, STUDY
from uavexp.store.table import REPLANS, TABLE

COMMITTED = (STUDY, RUN, TABLE, "claims.csv", "claims.md", "tables/*.csv", "tables/*.md", f"{FIGURES}/*.png")
_COLOURS = 256  # of a figure: a fourth of the bytes, and nothing that the eye sees


def publish(flown: Path, committed: Path) -> None:
    """Put what is committed of a study's folder in place of what was committed of it before.

    Args:
        flown: the folder, with its report.
        committed: made anew; may be the same folder.
    """
    beside = committed.with_name(f".{committed.name}.part")
    shutil.rmtree(beside, ignore_errors=True)
    for pattern in COMMITTED:
        for file in sorted(flown.glob(pattern)):
            copy = beside / file.relative_to(flown)
            copy.parent.mkdir(parents=True, exist_ok=True)
            if file.suffix == ".png":
                _smaller(file, copy)
            else:
                shutil.copyfile(file, copy)
    _keep_false_triggers(flown / REPLANS, beside / TABLE)
    shutil.rmtree(committed, ignore_errors=True)
    beside.rename(committed)


def _smaller(picture: Path, copy: Path) -> None:
    """A picture with a palette; one that has it already as it is."""
    drawn = Image.open(picture)
    if drawn.mode == "P":
        shutil.copyfile(picture, copy)
        return
    few = drawn.convert("RGB").quantize(_COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    few.save(copy, "png", optimize=True)


def _keep_false_triggers(replans: Path, table: Path) -> None:
    """Enter into the rows of trials what a report reads of the single replans, which are not committed."""
    trials = pd.read_parquet(table)
    if FALSE_TRIGGERS.column in trials or not replans.is_file() or "completion_time_s" not in trials:
        return
    counted = with_false_triggers(trials, pd.read_parquet(replans))
    write_atomically(table, lambda file: counted.to_parquet(file, index=False))
