"""A study flown anew against the committed one: what changed, and whether by more than chance."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from uavexp.paths import experiments_folder
from uavexp.results import __main__ as command
from uavexp.results.changes import changes, is_the_same, verdict_changes
from uavexp.results.listed import listed
from uavexp.store.records import code_digest

COMMITTED = experiments_folder() / "mcr" / "results" / "table1"
ARM, OTHER = "TBR", "MCR"


def altered(folder: Path, **columns: object) -> Path:
    """A copy of the study in which one arm has other numbers."""
    shutil.copytree(COMMITTED, folder)
    rows = pd.read_parquet(folder / "trials.parquet")
    for name, change in columns.items():
        rows.loc[rows["arm"] == ARM, name] = change(rows.loc[rows["arm"] == ARM, name])  # type: ignore[operator]
    rows.to_parquet(folder / "trials.parquet")
    return folder


def part_of(folder: Path, rows: Callable[[pd.DataFrame], pd.Series]) -> Path:
    """The study in which only some of the flights were flown."""
    trials = pd.read_parquet(folder / "trials.parquet")
    trials[rows(trials)].to_parquet(folder / "trials.parquet")
    return folder


def one_study(folder: Path, monkeypatch: pytest.MonkeyPatch, *, ends: bool) -> tuple[Path, Path]:
    """A list of one study, flown by other code, to its end or not: where it is flown, where committed."""
    flown = folder / "outputs" / "results" / code_digest()[:8] / "mcr" / "table1"
    there = folder / "there"
    shutil.copytree(COMMITTED, there)
    one = next(one for one in listed() if one.study == "mcr/table1")
    monkeypatch.setattr(command, "listed", lambda share: [one])
    monkeypatch.setattr(command, "committed", lambda study: there)
    monkeypatch.setattr(command, "outputs_root", lambda: folder / "outputs")
    monkeypatch.setattr(command, "_fly", lambda study, folder: ends and folder.is_dir())
    monkeypatch.setattr(command.subprocess, "run", lambda *words, **how: None)
    altered(flown, path_length_m=lambda values: values + 3.0, code=lambda values: "another")
    return flown, there


def test_the_same_flights_changed_nothing(tmp_path: Path) -> None:
    found = changes(COMMITTED, altered(tmp_path / "now"))
    assert len(found) > 50
    assert all(change.before == change.now or np.isnan(change.before) for change in found)
    assert not [change for change in found if change.p < 0.05]


def test_a_change_is_found_where_it_is_with_its_size(tmp_path: Path) -> None:
    found = changes(COMMITTED, altered(tmp_path / "now", path_length_m=lambda values: values + 3.0))
    beyond = [change for change in found if change.p < 0.05]
    assert {(change.arm, change.metric.column) for change in beyond} == {(ARM, "path_length_m")}
    assert beyond[0].now - beyond[0].before == pytest.approx(3.0)
    assert beyond[0].pairs == 200


def test_of_a_part_the_means_are_those_of_the_pairs(tmp_path: Path) -> None:
    now = altered(tmp_path / "now", min_clearance_m=lambda values: values - 0.01)
    part_of(now, lambda trials: trials["seed"] < 2)
    found = [one for one in changes(COMMITTED, now) if one.metric.column == "min_clearance_m"]
    assert {one.arm: round(one.now - one.before, 6) for one in found} == {
        one.arm: -0.01 if one.arm == ARM else 0.0 for one in found
    }
    assert {one.pairs for one in found} == {20}


def test_what_a_single_scene_lost_is_seen(tmp_path: Path) -> None:
    now = altered(tmp_path / "now", collision_count=lambda values: values + 50)
    part_of(now, lambda trials: trials["scene"] == "rooms")
    beyond = {one.metric.column for one in changes(COMMITTED, now) if one.p < 0.05}
    assert beyond == {"collision_count"}


def test_other_seeds_are_compared_unpaired(tmp_path: Path) -> None:
    now = altered(tmp_path / "now", seed=lambda values: values + 1000)
    mine = [change for change in changes(COMMITTED, now) if change.arm == ARM]
    assert {change.pairs for change in mine} == {0}
    assert not [change for change in mine if change.p < 0.05]


def test_another_verdict_is_told(tmp_path: Path) -> None:
    now = altered(tmp_path / "now")
    assert verdict_changes(COMMITTED, now) == []
    text = (now / "claims.csv").read_text()
    (now / "claims.csv").write_text(text.replace(",reproduced,", ",contradicted,", 1))
    (line,) = verdict_changes(COMMITTED, now)
    assert line.endswith("reproduced -> contradicted")


def test_what_changed_is_told_once_and_stays_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second run finds the study in place; it would compare it with itself."""
    flown, _ = one_study(tmp_path, monkeypatch, ends=True)
    assert command.main([]) == 0
    told = (flown.parents[1] / "changes.md").read_text()
    assert "## mcr/table1" in told
    assert "TBR: Path length" in told
    assert command.main([]) == 0
    assert (flown.parents[1] / "changes.md").read_text() == told


def test_a_change_in_other_seeds_is_found_unpaired(tmp_path: Path) -> None:
    now = altered(
        tmp_path / "now", seed=lambda values: values + 1000, path_length_m=lambda values: values + 3.0
    )
    beyond = [change for change in changes(COMMITTED, now) if change.p < 0.05]
    assert [(one.arm, one.metric.column, one.pairs) for one in beyond] == [(ARM, "path_length_m", 0)]


def test_clock_times_are_the_machines() -> None:
    storeys = experiments_folder() / "real" / "results" / "storeys"
    assert "wall_" in (storeys / "tables" / "values.csv").read_text()
    names = {change.metric.column for change in changes(storeys, storeys)}
    assert names
    assert not [name for name in names if name.startswith("wall_")]


def test_a_part_of_a_study_is_not_the_same(tmp_path: Path) -> None:
    whole = altered(tmp_path / "whole")
    part = part_of(altered(tmp_path / "part"), lambda trials: trials["seed"] < 2)
    assert is_the_same(COMMITTED, whole)
    assert not is_the_same(COMMITTED, part)
    assert not is_the_same(part, whole)
    assert not is_the_same(COMMITTED, tmp_path / "nowhere")


def test_a_claim_that_is_new_or_gone_is_told(tmp_path: Path) -> None:
    now = altered(tmp_path / "now")
    lines = (now / "claims.csv").read_text().splitlines(keepends=True)
    (now / "claims.csv").write_text("".join(lines[:-1]))
    (gone,) = verdict_changes(COMMITTED, now)
    assert gone.endswith(" -> not judged")
    (new,) = verdict_changes(now, COMMITTED)
    assert ": not judged -> " in new


def test_what_was_not_flown_to_its_end_is_not_put_in_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    flown, there = one_study(tmp_path, monkeypatch, ends=False)
    before = (there / "trials.parquet").read_bytes()
    assert command.main([]) == 1
    assert "not flown to their end: mcr/table1" in capsys.readouterr().out
    assert ", not flown to its end" in (flown.parents[1] / "changes.md").read_text()
    assert (there / "trials.parquet").read_bytes() == before
