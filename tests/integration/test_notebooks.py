"""Every notebook in `analysis/` runs on a stored study of its kind, and holds nothing that it should not."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import pytest

from tests.folders import ROOT
from tests.studies import copy_of, shipped

FOLDER = ROOT / "analysis"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
EXPERIMENTS = {file.stem: file.stem.replace("_", "/", 1) for file in NOTEBOOKS}


def cells_of(file: Path) -> list[dict]:
    return json.loads(file.read_text(encoding="utf-8"))["cells"]


def code_of(file: Path) -> list[str]:
    return ["".join(cell["source"]) for cell in cells_of(file) if cell["cell_type"] == "code"]


def test_each_is_of_an_experiment():
    assert {file.stem for file in NOTEBOOKS} >= {
        "mcr_table1",
        "mcr_policies",
        "mcr_thresholds",
        "mcr_noise_latency_drift",
    }


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_it_runs_and_shows_tables_and_figures(file, flown, tmp_path, monkeypatch):
    from IPython.display import Image, Markdown

    report = shipped(EXPERIMENTS[file.stem])
    report["figures"] = [*report["figures"], "success"]  # what was flown here has no axis of noise
    study = copy_of(flown, tmp_path / "study", report=report)
    monkeypatch.setenv("UAVEXP_STUDY", str(study.folder))
    monkeypatch.setattr("IPython.display.display", lambda *items: shown.extend(items))
    shown: list[object] = []
    names: dict[str, object] = {}
    for code in code_of(file):
        exec(compile(code, file.name, "exec"), names)
    assert any(isinstance(item, Image) for item in shown)
    assert any(isinstance(item, Markdown) and "|" in item.data for item in shown)


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
