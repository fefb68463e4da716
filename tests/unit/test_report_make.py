"""The report command: files, bytes, and what it says about a wrong folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

from tests.unit.test_report_tables import BAD, GOOD, WORST, trials_of
from uavexp.errors import RecordError
from uavexp.records import RECORD
from uavexp.report import make
from uavexp.report.__main__ import main
from uavexp.table import FIRST_OF_REPLANS, REPLANS, TABLE

REPLAN_COLUMNS = [*FIRST_OF_REPLANS, "arm", "scene", "status", "path_change_m"]


def write_study(folder: Path, **changes: object) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    trials = trials_of({"SSP": WORST, "TBR": BAD, "MCR": GOOD}, seeds=2)
    text = {
        "name": "mcr/table1",
        "title": "Made-up",
        "report": "table1",
        "axes": [[axis, list(trials[axis].drop_duplicates())] for axis in ("arm", "scene")],
        "seeds": [0, 1],
        "settings": {"primary": "MCR", "time_based": "TBR"},
        "cells": [],
    }
    (folder / "study.json").write_text(json.dumps(text | changes))
    for name, table in (
        (TABLE, trials),
        (REPLANS, pd.DataFrame(columns=REPLAN_COLUMNS, dtype=float)),
    ):
        arrow = pa.Table.from_pandas(table, preserve_index=False)
        parquet.write_table(arrow, folder / name, write_page_checksum=True)
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    folder = write_study(tmp_path_factory.mktemp("one") / "study")
    return folder, make.make_report(folder)


def test_every_table_is_there_in_three_forms_and_every_figure_in_two(
    reported: tuple[Path, list[Path]],
) -> None:
    folder, files = reported
    assert all(file.is_file() for file in files)
    assert len(set(files)) == len(files)
    names = {str(file.relative_to(folder)) for file in files}
    for table in ("table1", "paired_tests", "further", "scenes", "contradictions"):
        assert {f"tables/{table}.{suffix}" for suffix in ("csv", "md", "tex")} <= names
    assert {"tables/values.csv", "claims.md", "claims.csv", "report.html"} <= names
    figures = {Path(name).stem for name in names if name.startswith("figures/")}
    assert figures
    assert {f"figures/{stem}.{suffix}" for stem in figures for suffix in ("png", "pdf")} <= names
    assert files[-1].name == "report.html"


def test_same_trials_same_bytes(reported: tuple[Path, list[Path]], tmp_path: Path) -> None:
    """Another folder, another process, another day: hash seed and clock must not show."""
    folder, _ = reported
    again = write_study(tmp_path / "study")
    environment = {**os.environ, "PYTHONHASHSEED": "7", "TZ": "Asia/Tokyo", "OMP_NUM_THREADS": "2"}
    command = [sys.executable, "-m", "uavexp.report", str(again)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == str(again / "report.html")
    first, second = contents(folder), contents(again)
    assert first.keys() == second.keys()
    differing = [name for name in first if first[name] != second[name]]
    assert differing == []


@pytest.mark.parametrize(
    ("break_it", "words"),
    [
        (lambda folder: (folder / "study.json").unlink(), "holds no study"),
        (lambda folder: (folder / "study.json").write_text("{"), "damaged"),
        (lambda folder: (folder / TABLE).unlink(), "cannot be read"),
        (lambda folder: (folder / TABLE).write_bytes(b"PAR1 nonsense"), "cannot be read"),
    ],
)
def test_a_wrong_folder_is_one_line_and_exit_2(
    break_it: object, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_study(tmp_path / "study")
    break_it(folder)  # type: ignore[operator]
    assert main([str(folder)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert words in error
    assert error.count("\n") == 1


def test_no_folder_named_is_exit_2_and_help_is_0(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert "usage:" in capsys.readouterr().err
    assert main(["--help"]) == 0
    assert "usage:" in capsys.readouterr().out


def test_a_study_without_a_trial_says_so(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    empty = parquet.read_table(folder / TABLE).slice(0, 0)
    parquet.write_table(empty, folder / TABLE, write_page_checksum=True)
    with pytest.raises(RecordError, match="no trial yet"):
        make.make_report(folder)


def test_tables_older_than_a_record_are_collected_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_study(tmp_path / "study")
    record = folder / "trials" / "one" / RECORD
    record.parent.mkdir(parents=True)
    record.write_text("{}")
    lines: list[str] = []
    hour_s = 3600.0
    os.utime(record, (time.time() - hour_s, time.time() - hour_s))
    make._bring_up_to_date(make.read_study(folder), lines.append)
    assert lines == []
    os.utime(record, (time.time() + hour_s, time.time() + hour_s))
    with pytest.raises(RecordError, match="damaged"):  # the record is read: it holds nothing
        make._bring_up_to_date(make.read_study(folder), lines.append)
    assert lines == ["collecting 1 records"]
