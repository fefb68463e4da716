"""What `make results` flies: all of it, a tenth of it, and what that takes."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from uavexp.config.composition import Composer
from uavexp.config.experiment import list_experiments, read_experiment
from uavexp.config.overrides import expand_seeds, parse_settings
from uavexp.paths import experiments_folder
from uavexp.results.listed import TENTH, TUNE, Listed, committed, listed
from uavexp.store.study import STUDY

WHOLE, FAST = listed(), listed(TENTH)


def test_every_study_that_is_committed_is_flown_again() -> None:
    there = {file.parent for file in experiments_folder().glob(f"*/results/*/{STUDY}")}
    named = {word.partition("=")[2] for one in WHOLE for word in one.words if word.startswith("experiments=")}
    assert there <= {committed(name) for name in (*named, *(one.study for one in WHOLE))}


def test_every_policy_is_tuned_by_the_same_budget_on_worlds_that_are_not_compared() -> None:
    tuned = [one for one in WHOLE if one.words[0] == TUNE]
    assert len(tuned) >= 6
    assert len({one.trials for one in tuned}) == 1
    typed = {word.partition("=")[2] for one in tuned for word in one.words if word.startswith("seed=")}
    tuning = expand_seeds(
        [read_experiment("mcr/policies_tuning", list_experiments()["mcr/policies_tuning"]).seed]
    )
    assert [expand_seeds([text]) for text in typed] == [tuning]
    assert {one.trials for one in tuned} == {10 * 4 * len(tuning)}, "settings, scenes, seeds"
    for name in ("mcr/policies", "mcr/policies_new", "mcr/table1", "mcr/second_sample"):
        assert not set(tuning) & set(expand_seeds([read_experiment(name, list_experiments()[name]).seed]))


def test_no_study_is_flown_twice() -> None:
    assert len({one.study for one in WHOLE}) == len(WHOLE)


def test_fast_is_a_tenth() -> None:
    share = sum(one.trials for one in FAST) / sum(one.trials for one in WHOLE)
    assert 0.08 <= share <= 0.13
    assert [one.study for one in FAST] == [one.study for one in WHOLE]


def test_an_estimate_is_the_committed_mean_times_the_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    one = next(one for one in listed() if one.study == "mcr/table1")
    rows = pd.read_parquet(committed("mcr/table1") / "trials.parquet")
    assert one.trials == 1000
    assert one.estimate_s == pytest.approx(rows["wall_trial_s"].mean() * 1000 / 2)


@pytest.mark.parametrize(
    "one", [one for one in FAST if one.study in ("voxel/table1", "real/storeys")],
    ids=lambda one: one.study,
)  # fmt: skip
def test_what_is_said_is_what_the_command_flies(one: Listed) -> None:
    assert one.words[0] != TUNE
    command = Composer().command(parse_settings(one.words))
    assert len(command.cells) * len(command.seeds) == one.trials


def test_the_folder_of_a_study_is_that_of_its_paper() -> None:
    assert committed("mcr/table1") == Path(experiments_folder()) / "mcr" / "results" / "table1"
