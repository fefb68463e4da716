"""Studies for tests of what reads study folders: copies of flown ones, and made-up ones."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pandas as pd

from uavexp.config.experiment import list_experiments, read_experiment
from uavexp.store.study import STUDY, Study, read_study
from uavexp.store.table import REPLANS, TABLE, write_table


def copy_of(study: Study, folder: Path, **changes: Any) -> Study:
    """The same study in another folder, parts of its `study.json` changed."""
    shutil.copytree(study.folder, folder)
    text = json.loads((folder / STUDY).read_text())
    (folder / STUDY).write_text(json.dumps(text | changes))
    return read_study(folder)


def made_up(
    folder: Path,
    trials: pd.DataFrame,
    axes: dict[str, tuple[str, ...]],
    *,
    report: dict[str, Any] | None = None,
    settings: dict[str, Any] | None = None,
    replans: pd.DataFrame | None = None,
) -> Study:
    """A study folder of tables alone, without logs."""
    folder.mkdir(parents=True, exist_ok=True)
    content = {
        "name": "",
        "title": "made up",
        "report": report or {},
        "axes": [[name, list(values)] for name, values in axes.items()],
        "seeds": sorted({int(seed) for seed in trials["seed"]}),
        "settings": settings or {},
        "cells": [],
    }
    (folder / STUDY).write_text(json.dumps(content))
    write_table(folder / TABLE, _rows(trials))
    columns = ("trial", "number", "time_s", "effective_s", "cause", "status", "path_change_m", "near_change")
    write_table(folder / REPLANS, _rows(replans) if replans is not None else [], columns)
    return read_study(folder)


def shipped(name: str) -> dict[str, Any]:
    """Tables, figures and claims that an experiment of this repository declares."""
    return dict(read_experiment(name, list_experiments()[name]).report)


def _rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    return table.astype(object).where(table.notna(), None).to_dict("records")
