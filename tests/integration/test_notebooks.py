"""Every notebook in `analysis/` runs on a stored study of its kind, and holds nothing that it should not."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import pytest

from tests.folders import ROOT
from tests.studies import copy_of, shipped
from uavexp.config.experiment import list_experiments

FOLDER = ROOT / "analysis"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
LEARN = FOLDER / "learn.ipynb"  # flies; the others read committed results
STUDIES = [file for file in NOTEBOOKS if file != LEARN]
EXPERIMENTS = {file.stem: file.stem.replace("_", "/", 1) for file in STUDIES}
OF_THE_KIND = [file for file in STUDIES if file.stem.startswith("mcr_")]  # that the flown study is of


def cells_of(file: Path) -> list[dict]:
    return json.loads(file.read_text(encoding="utf-8"))["cells"]


def code_of(file: Path) -> list[str]:
    return ["".join(cell["source"]) for cell in cells_of(file) if cell["cell_type"] == "code"]


def run(file: Path, monkeypatch, names: dict[str, object] | None = None) -> list[object]:
    """Run the cells where the notebook lies; returns what is displayed."""
    shown: list[object] = []
    monkeypatch.chdir(FOLDER)
    monkeypatch.setattr("IPython.display.display", lambda *items: shown.extend(items))
    names = {} if names is None else names
    for code in code_of(file):
        exec(compile(code, file.name, "exec"), names)
    return shown


def assert_shows_tables_and_figures(shown: list[object]) -> None:
    from IPython.display import Image, Markdown

    assert any(isinstance(item, Image) for item in shown)
    assert any(isinstance(item, Markdown) and "|" in item.data for item in shown)


def test_each_paper_has_one_and_one_teaches():
    assert {file.stem.split("_")[0] for file in NOTEBOOKS} == {"mcr", "voxel", "inspect", "dfbit", "learn"}
    assert set(EXPERIMENTS.values()) <= set(list_experiments())


@pytest.mark.parametrize("file", OF_THE_KIND, ids=lambda file: file.stem)
def test_it_runs_on_a_study_of_its_kind(file, flown, tmp_path, monkeypatch):
    report = shipped(EXPERIMENTS[file.stem])
    report["figures"] = [*report["figures"], "success"]  # what was flown here has no axis of noise
    study = copy_of(flown, tmp_path / "study", report=report)
    monkeypatch.setenv("UAVEXP_STUDY", str(study.folder))
    assert_shows_tables_and_figures(run(file, monkeypatch))


@pytest.mark.parametrize(
    "file", [file for file in STUDIES if file not in OF_THE_KIND], ids=lambda file: file.stem
)
def test_it_runs_on_the_committed_results(file, monkeypatch, capsys):
    shown = run(file, monkeypatch)
    assert_shows_tables_and_figures(shown)
    committed = ROOT / "experiments" / Path(EXPERIMENTS[file.stem]).parent / "results"
    verdicts = (committed / file.stem.split("_", 1)[1] / "claims.md").read_text(encoding="utf-8")
    assert any(
        item.data.strip() in verdicts
        for item in shown
        if hasattr(item, "data") and "verdict" in str(item.data)
    )


def test_the_one_that_teaches_flies_and_draws(monkeypatch):
    import matplotlib.pyplot as plt

    monkeypatch.setattr(plt, "show", lambda: None)
    plt.close("all")
    names: dict[str, object] = {}
    run(LEARN, monkeypatch, names)
    assert len(plt.get_fignums()) >= 1
    assert "reached" in repr(names["trial"])
    # its field is the one that the flight was decided on
    at = names["log"].ticks.esdf_clearance_m[-1]
    voxels, place = names["voxels"], names["log"].steps.position_m[-1]
    index = tuple(((place - voxels.origin_m) / voxels.voxel_size_m).astype(int))
    assert names["esdf_m"][index] == pytest.approx(at, abs=voxels.voxel_size_m)
    plt.close("all")


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_it_loads_calls_and_shows(file):
    for code in code_of(file):
        kinds = (ast.FunctionDef, ast.Lambda, ast.ClassDef)
        assert not any(isinstance(node, kinds) for node in ast.walk(ast.parse(code)))


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_its_outputs_are_stripped(file):
    for cell in cells_of(file):
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None
