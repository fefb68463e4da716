"""The parameters that policies are compared with are those that the rule of mcr/policies_tuning chooses."""

from __future__ import annotations

import re

import pandas as pd
import pytest

from uavexp.config.experiment import list_experiments, read_experiment
from uavexp.config.overrides import Setting
from uavexp.results.listed import TUNE, committed, listed

LINES = {one.study: one.words for one in listed() if one.words[0] == TUNE}
COMPARED = {"gain": "gain, fewest replans"}  # the arm of mcr/policies_new that has the rule's setting


def chosen(study: str) -> set[str]:
    """Labels of the settings with the highest success, and of those with the fewest replans."""
    rows = pd.read_parquet(committed(study) / "trials.parquet").groupby("candidate")
    found = rows.agg(success=("success", "mean"), replans=("replans", "mean"))
    best = found[found["success"] == found["success"].max()]
    return set(best.index[best["replans"] == best["replans"].min()])


@pytest.mark.parametrize("study", LINES)
def test_what_is_compared_is_what_the_rule_chooses(study: str) -> None:
    arm = next(word.partition("=")[2].strip('"') for word in LINES[study] if word.startswith("arm="))
    key = next(word for word in LINES[study] if word.startswith("trigger.")).partition("=")[0]
    typed: dict[str, list[Setting]] = {}
    for name in ("mcr/policies", "mcr/policies_new"):
        for label, settings in read_experiment(name, list_experiments()[name]).axes["arm"].items():
            typed.setdefault(label, []).extend(setting for setting in settings if setting.key == key)
    values = {setting.values[0] for setting in typed[COMPARED.get(arm, arm)]}
    assert len(values) == 1, "one value in every comparison"
    label = re.sub(r"^.*\.", "", key)
    assert chosen(study) & {f"{label}={float(value)}" for value in values}, chosen(study)
