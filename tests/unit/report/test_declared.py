"""What an experiment declares of its report: unknown names are told with the known, own ones are found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from tests.studies import made_up
from uavexp.config.composition import Composer
from uavexp.config.experiment import expand, list_experiments, read_experiment
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError
from uavexp.report.contents import Report
from uavexp.report.declared import declared
from uavexp.store.study import Study
from uavexp.sweep.agenda import agenda_of

ARMS = ("new", "old")


def study_of(folder: Path, **report: Any) -> Study:
    rows = [{"arm": arm, "seed": 0, "success": True, "status": "ok", "trial": arm} for arm in ARMS]
    return made_up(folder, pd.DataFrame(rows), {"arm": ARMS}, report=report)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"tables": ["by_metrc"]}, r"no such one: by_metrc \(did you mean 'by_metric'\?\); there are by_arm"),
        ({"tables": [{"by_metric": {"metrics": ["plan_lenght_m"]}}]}, "did you mean 'plan_length_m'"),
        ({"tables": [{"by_arm": {"fornt": True}}]}, "no option fornt.*did you mean 'front'"),
        ({"tables": ["levels"]}, "levels: needs arm, undisturbed"),
        ({"figures": ["os.path"]}, "os.path is refused"),
        ({"figures": ["uavexp.report.style"]}, "has no function figure"),
        ({"figures": [{"success": {}, "contacts": {}}]}, "each is NAME"),
        ({"claims": [{"says": "no source"}]}, "each needs says, source"),
        ({"claims": [{"says": "x", "source": "y", "judge": "worse"}]}, "no such judge: worse"),
        ({"claims": [{"says": "x", "source": "y", "metric": "success"}]}, "needs arms"),
    ],
)
def test_what_does_not_exist_is_named_with_what_does(
    tmp_path: Path, changes: dict[str, Any], says: str
) -> None:
    with pytest.raises(ConfigError, match=says):
        declared(study_of(tmp_path / "study", **changes))


def test_a_table_and_a_figure_may_stay_in_ones_own_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "__init__.py").write_text("")
    (tmp_path / "mine" / "widths.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    study = study_of(tmp_path / "study", tables=[{"mine.widths": {"of": "arms"}}], figures=["mine.widths"])
    with pytest.raises(ConfigError, match="UAVEXP_TRUST"):
        declared(study)
    monkeypatch.setenv("UAVEXP_TRUST", "mine")
    (table,) = Report(study=study).tables
    (drawing,) = Report(study=study).drawings()
    assert (table.name, table.rows) == ("widths", (("2 arms",),))
    assert drawing.name == "widths"


OWN = """
from uavexp.report.figures.base import Drawing, new_figure
from uavexp.report.tables.base import Table

def table(results, *, name, of):
    return Table(name=name, title="Widths", columns=("n",), rows=((f"{len(results.arms)} {of}",),))

def figure(results, *, name):
    return Drawing(name=name, caption=results.notes[0], figure=new_figure(3.5, 2.0))
"""


def test_what_does_not_exist_is_refused_before_the_first_flight(tmp_path: Path) -> None:
    """Used to be found out by the report, after all flights."""
    folder = tmp_path / "experiments" / "own"
    folder.mkdir(parents=True)
    (folder / "bad.yaml").write_text("figures: [sucess]\naxes: {arm: {a: {strategy: mcr}}}")
    command = Composer(user_folder=tmp_path).command(parse_settings(["experiments=own/bad"]))
    with pytest.raises(ConfigError, match="did you mean 'success'"):
        agenda_of(command, tmp_path / "out", tmp_path)


@pytest.mark.parametrize("name", sorted(list_experiments()))
def test_claims_of_shipped_experiments_are_about_arms_that_these_fly(name: str, tmp_path: Path) -> None:
    experiment = read_experiment(name, list_experiments()[name])
    _, axes = expand(experiment, [])
    study = made_up(tmp_path, pd.DataFrame({"seed": []}), {}, report=dict(experiment.report))
    values = {value for entries in axes.values() for value in entries}
    for claim in declared(study).claims:
        assert all(claim.among[axis] in axes[axis] for axis in claim.among)
        if not claim.is_one_of_many:
            assert set(claim.arms) <= values, claim.says
