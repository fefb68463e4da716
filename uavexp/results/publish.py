"""What of a flown study is committed: tables, claims, figures and rows; the rest is made anew."""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd
import pyarrow
from PIL import Image
from pyarrow import parquet

from uavexp.report.derived import FALSE_TRIGGERS, with_false_triggers
from uavexp.report.make import FIGURES
from uavexp.store.study import RUN, STUDY
from uavexp.store.table import REPLANS, TABLE

COMMITTED = (STUDY, RUN, TABLE, "claims.csv", "claims.md", "tables/*.csv", "tables/*.md", f"{FIGURES}/*.png")
_PACKED = {"compression": "zstd", "compression_level": 19}
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
            elif file.name == TABLE:
                _write_rows(_with_false_triggers(pd.read_parquet(file), flown / REPLANS), copy)
            else:
                shutil.copyfile(file, copy)
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


def _with_false_triggers(trials: pd.DataFrame, replans: Path) -> pd.DataFrame:
    """Rows of trials with what a report reads of the single replans, which are not committed."""
    if FALSE_TRIGGERS.column in trials or not replans.is_file() or "completion_time_s" not in trials:
        return trials
    return with_false_triggers(trials, pd.read_parquet(replans))


def _write_rows(rows: pd.DataFrame, table: Path) -> None:
    """Write rows in half the bytes: what a file says of its columns weighs as much as a study's numbers."""
    columns = pyarrow.Table.from_pandas(rows, preserve_index=False).replace_schema_metadata(None)
    parquet.write_table(columns, table, store_schema=False, write_statistics=False, **_PACKED)
