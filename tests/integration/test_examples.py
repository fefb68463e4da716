"""Every example runs alone, is short, and leaves what it says; together in less than a minute."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from tests.folders import ROOT

FOLDER = ROOT / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
LEAVES = {
    "compare_policies": "compare_policies/trials.parquet",
    "fly_and_plot": "fly_and_plot.png",
    "own_building": "plan.yaml",
    "own_metric_and_figure": "own_metric_and_figure.png",
    "replay_log": "replay_log.html",
    "study_on_dask": "study_on_dask/trials.parquet",
}
SAYS = {
    "compare_policies": ("difference", "3 pairs"),
    "fly_and_plot": ("reached",),
    "own_building": ("reached", "0 contacts"),
    "own_metric_and_figure": ("mcr", "ssp", "tbr"),
    "own_planner": ("planner Straight", "reached"),
    "own_trigger": ("Odometer", "reached", "metres"),
    "replay_log": ("first", "map"),
    "study_on_dask": ("reached", "mcr", "tbr"),
}


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_it_runs_alone(file, tmp_path, monkeypatch, capsys):
    if file.stem == "study_on_dask":
        pytest.importorskip("distributed", reason="Dask is an extra")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(FOLDER))  # as Python does for a script
    monkeypatch.setenv("UAVEXP_TRUST", "")  # an example may set it
    runpy.run_path(str(file), run_name="__main__")
    said = capsys.readouterr().out
    for words in SAYS[file.stem]:
        assert words in said
    if file.stem in LEAVES:
        assert (tmp_path / LEAVES[file.stem]).stat().st_size > 50


def test_there_are_eight_and_the_list_names_them():
    listed = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert set(SAYS) == {file.stem for file in EXAMPLES}
    assert all(f"`{file.name}`" in listed for file in EXAMPLES)


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_it_is_short(file: Path):
    assert len(file.read_text(encoding="utf-8").splitlines()) < 40
