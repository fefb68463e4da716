"""The commands of `experiments/results.yaml`, what each flies, a tenth of it, and how long that takes."""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import yaml  # type: ignore[import-untyped]

from uavexp.config.experiment import expand, list_experiments, read_experiment
from uavexp.config.overrides import expand_seeds, parse_settings, render
from uavexp.errors import ConfigError
from uavexp.paths import experiments_folder
from uavexp.report.comparison import SCENE
from uavexp.store.table import TABLE
from uavexp.tune.space import split

LIST = "results.yaml"
TENTH = 0.1
TUNE = "tune"
_BUDGET = "budget"


@dataclass(frozen=True, slots=True, kw_only=True)
class Listed:
    """One command."""

    words: tuple[str, ...]  # typed behind `python -m uavexp`
    study: str  # whose folder it fills: PAPER/TABLE
    trials: int
    estimate_s: float  # of clock time on the cores there are


def listed(share: float = 1.0) -> list[Listed]:
    """All commands in their order.

    Args:
        share: of the flights that is flown, 1 or less.

    Raises:
        ConfigError: the list, or an experiment that it names, is damaged.
    """
    file = experiments_folder() / LIST
    lines = yaml.safe_load(file.read_text(encoding="utf-8"))
    if not isinstance(lines, list) or not all(isinstance(line, str) for line in lines):
        raise ConfigError(f"{file}: must be a list of commands, - experiments=PAPER/TABLE")
    return [_listed(shlex.split(line), share) for line in lines]


def committed(study: str) -> Path:
    """The committed folder of a study: `mcr/table1` is in `experiments/mcr/results/table1`."""
    paper, _, name = study.partition("/")
    return experiments_folder() / paper / "results" / name


def _listed(line: Sequence[str], share: float) -> Listed:
    is_tuned, given = line[:1] == [TUNE], {word.partition("=")[0]: word for word in line}
    name = given.get("experiments", "").partition("=")[2]
    files = list_experiments()
    if name not in files:
        raise ConfigError(f"{LIST}: {' '.join(line)}: experiments= must name one of {', '.join(files)}")
    experiment = read_experiment(name, files[name])
    own = [word for word in line if word.partition("=")[0] not in ("experiments", _BUDGET, TUNE)]
    typed = parse_settings(split(own)[1] if is_tuned else own)
    asked = [item.values for item in typed if item.key == "seed"]
    seeds = expand_seeds(asked[0] if asked else [experiment.seed])
    budget = int(given[_BUDGET].partition("=")[2]) if is_tuned else 1
    if share < 1.0:
        kept = max(1, round(share * len(seeds)))
        share, seeds = min(1.0, share * len(seeds) / kept), seeds[:kept]
        given["seed"] = f"seed={','.join(map(str, seeds))}"
        if is_tuned:
            budget = max(2, math.ceil(share * budget))
            given[_BUDGET] = f"{_BUDGET}={budget}"
        elif SCENE in experiment.axes and share < 1.0:
            given[SCENE] = f"{SCENE}={','.join(map(render, _spread(list(experiment.axes[SCENE]), share)))}"
        typed = parse_settings([word for key, word in given.items() if key in (*experiment.axes, SCENE)])
    trials = len(expand(experiment, typed)[0]) * len(seeds) * budget
    study = f"{TUNE}/{_who(given)}" if is_tuned else name
    return Listed(
        words=tuple(given.values()),
        study=study,
        trials=trials,
        estimate_s=trials * _trial_s(study) / (os.cpu_count() or 1),
    )


def _who(given: dict[str, str]) -> str:
    """Name of a tuning study's folder: the arm that is tuned."""
    return given["arm"].partition("=")[2].strip('"').replace(" ", "_")


def _spread(entries: Sequence[str], share: float) -> list[str]:
    """So many of the entries, evenly spread over them."""
    count = max(1, round(share * len(entries)))
    return [entries[int((n + 0.5) * len(entries) / count)] for n in range(count)]


@cache
def _trial_s(study: str) -> float:
    """Clock time of a trial, s: the mean of the committed ones, else the median study's mean."""
    file = committed(study) / TABLE
    files = [file] if file.is_file() else sorted(experiments_folder().glob(f"*/results/*/{TABLE}"))
    times = [pd.read_parquet(file, columns=["wall_trial_s"])["wall_trial_s"].mean() for file in files]
    return float(np.median(times)) if times else math.nan
