"""What of a study is committed, and that it tells what the whole told."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image

from tests.folders import DATA, ROOT
from uavexp.paths import experiments_folder
from uavexp.report.contents import Report
from uavexp.report.derived import FALSE_TRIGGERS
from uavexp.report.make import make_report
from uavexp.report.table_formats import to_csv
from uavexp.results.publish import publish
from uavexp.store.study import read_study

MOST_BYTES = 12_000_000


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("flown") / "study"
    shutil.copytree(DATA / "study", folder)
    study = json.loads((folder / "study.json").read_text())
    study["report"]["figures"] = ["success", "minimum_clearance"]
    (folder / "study.json").write_text(json.dumps(study))
    make_report(folder)
    return folder


def test_rows_tables_claims_and_figures_stay_and_nothing_else(flown: Path, tmp_path: Path) -> None:
    publish(flown, tmp_path / "there")
    kinds = {file.suffix for file in (tmp_path / "there").rglob("*") if file.is_file()}
    assert kinds <= {".json", ".parquet", ".csv", ".md", ".png"}
    assert (tmp_path / "there/trials.parquet").is_file()
    for file in (flown / "tables").glob("*.csv"):
        assert (tmp_path / "there/tables" / file.name).read_bytes() == file.read_bytes()


def test_what_was_there_before_is_gone_and_publishing_again_changes_nothing(
    flown: Path, tmp_path: Path
) -> None:
    there = tmp_path / "there"
    (there / "tables").mkdir(parents=True)
    (there / "tables/old.csv").write_text("stale")
    publish(flown, there)
    assert not (there / "tables/old.csv").exists()
    before = {file.name: file.read_bytes() for file in there.rglob("*") if file.is_file()}
    publish(there, there)
    assert before == {file.name: file.read_bytes() for file in there.rglob("*") if file.is_file()}


def test_rows_are_the_same_in_half_the_bytes(flown: Path, tmp_path: Path) -> None:
    publish(flown, tmp_path / "there")
    whole, kept = flown / "trials.parquet", tmp_path / "there/trials.parquet"
    rows = pd.read_parquet(whole)
    pd.testing.assert_frame_equal(pd.read_parquet(kept)[rows.columns], rows)
    assert kept.stat().st_size < 0.6 * whole.stat().st_size


def test_false_triggers_are_told_without_the_single_replans(flown: Path, tmp_path: Path) -> None:
    publish(flown, tmp_path / "there")
    rows = pd.read_parquet(tmp_path / "there/trials.parquet")
    replans = pd.read_parquet(flown / "replans.parquet")
    one = rows[rows["replans"].astype(float) > 0].iloc[0]
    mine = replans[(replans["trial"] == one["trial"]) & (replans["number"] > 0) & (replans["cause"] == "map")]
    wasted = ((mine["path_change_m"] <= 0.1) & (mine["effective_s"] <= one["completion_time_s"])).sum()
    assert one[FALSE_TRIGGERS.column] == pytest.approx(60.0 * wasted / one["completion_time_s"])


def test_a_report_of_the_committed_rows_says_the_same(flown: Path, tmp_path: Path) -> None:
    publish(flown, tmp_path / "there")
    texts = [
        {table.name: to_csv(table) for table in Report(study=read_study(folder)).tables}
        for folder in (flown, tmp_path / "there")
    ]
    assert texts[0] == texts[1]


def test_a_figure_keeps_its_size_and_its_looks(flown: Path, tmp_path: Path) -> None:
    publish(flown, tmp_path / "there")
    for file in (tmp_path / "there/figures").glob("*.png"):
        drawn, few = (Image.open(one).convert("L") for one in (flown / "figures" / file.name, file))
        assert few.size == drawn.size
        far = [abs(a - b) > 24 for a, b in zip(drawn.tobytes(), few.tobytes(), strict=True)]
        assert sum(far) / len(far) < 0.001


def test_committed_results_are_small_and_hold_no_page() -> None:
    listed = subprocess.run(
        ["git", "ls-files", "-z", "experiments"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode:
        pytest.skip("no checkout")
    files = [ROOT / name for name in listed.stdout.split("\0") if "/results/" in name]
    files = [file for file in files if file.is_file()]
    assert sum(file.stat().st_size for file in files) <= MOST_BYTES
    assert {file.suffix for file in files} <= {".json", ".parquet", ".csv", ".md", ".png"}
    assert experiments_folder() == ROOT / "experiments"


def test_what_an_interrupted_publishing_left_is_not_published(flown: Path, tmp_path: Path) -> None:
    left = tmp_path / ".there.part" / "tables"
    left.mkdir(parents=True)
    (left / "old.csv").write_text("stale")
    publish(flown, tmp_path / "there")
    assert not (tmp_path / "there/tables/old.csv").exists()
