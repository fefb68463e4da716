"""The report command: files, bytes, and what it says about a wrong folder."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pytest
from PIL import Image
from pyarrow import parquet

from tests.studies import copy_of, shipped
from tests.unit.report.test_report_tables import BAD, GOOD, WORST, trials_of
from uavexp.errors import RecordError
from uavexp.report import make
from uavexp.report.__main__ import main
from uavexp.store.records import RECORD
from uavexp.store.study import Study
from uavexp.store.table import FIRST_OF_REPLANS, REPLANS, TABLE

REPLAN_COLUMNS = [*FIRST_OF_REPLANS, "arm", "scene", "status", "path_change_m"]


def write_study(folder: Path, **changes: object) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    trials = trials_of({"SSP": WORST, "TBR": BAD, "MCR": GOOD}, seeds=2)
    text = {
        "name": "mcr/table1",
        "title": "Made-up",
        "report": shipped("mcr/table1"),
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
        (lambda folder: write_study(folder, report="table1"), "damaged"),  # of an earlier version
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


def test_files_of_an_earlier_report_go_and_no_others(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    before = {str(file.relative_to(folder)) for file in make.make_report(folder)}
    kept = [folder / "tables" / "mine.csv", folder / "figures" / "mine.png", folder / "mine.txt"]
    for file in kept:
        file.write_text("mine")
    with (folder / make.MANIFEST).open("a") as manifest:
        manifest.write("mine.txt\n../../outside\ntrials.parquet\n")  # not a report's to remove
    write_study(folder, report={})
    after = {str(file.relative_to(folder)) for file in make.make_report(folder)}
    assert {"tables/table1.csv", "claims.md", "figures/figure_6.pdf"} <= before - after
    assert not any((folder / name).exists() for name in before - after)
    assert all(file.is_file() for file in (*kept, folder / TABLE, *(folder / name for name in after)))


@pytest.mark.parametrize("deed", ["cut", "gone"])
def test_a_damaged_world_costs_its_figures_alone_and_is_told(
    flown: Study,
    deed: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Used to end the whole report."""
    study = copy_of(flown, tmp_path / "study")
    first = study.trials[study.trials["scene"] == study.axes["scene"][0]]
    for digest in set(first["world_digest"]):
        world = study.folder / "worlds" / f"{digest}.npz"
        if deed == "cut":
            world.write_bytes(world.read_bytes()[:1000])
        else:
            world.unlink()
    assert main([str(study.folder)]) == 0
    out = capsys.readouterr().out
    page = (study.folder / "report.html").read_text()
    for name in ("figure_3", "figure_5", "figure_8"):
        (line,) = [line for line in out.splitlines() if f"{name} is left out" in line]
        assert ("worlds/" in line and "damaged" in line) if deed == "cut" else "hold no world" in line
        assert f"{name} is left out" in page
        assert not (study.folder / "figures" / f"{name}.png").exists()
    assert "a flight in 3D is left out" in page
    assert str(study.folder) not in page
    assert (study.folder / "figures" / "figure_6.png").is_file()


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


def test_a_figure_whose_logs_are_gone_is_kept_and_says_so(tmp_path: Path) -> None:
    """Used to vanish from the page, though its file lay in the folder."""
    folder = write_study(tmp_path / "study")  # without a log
    (folder / make.FIGURES).mkdir()
    png = folder / make.FIGURES / "figure_3.png"
    Image.new("RGB", (400, 200)).save(png, dpi=(200, 200))
    before = png.read_bytes()
    assert png in make.make_report(folder)
    page = (folder / make.PAGE).read_text()
    assert png.read_bytes() == before
    assert base64.b64encode(before).decode() in page
    assert "the flights it shows are not whole in this folder any more" in page
    assert "figure_3 is left out" not in page
    assert "figure_4 is left out" in page
    assert png in make.make_report(folder)  # nor does the next report take it for its own and remove it
