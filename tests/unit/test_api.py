"""What people call from Python: one flight with parts of their own, a stored study, arms compared."""

from __future__ import annotations

import pydoc
import shutil

import numpy as np
import pytest

import uavexp
from tests.folders import DATA
from uavexp.types import Decision

STUDY = DATA / "study"
SMALL = {"world": "random_columns", "vehicle": "point_mass", "mission.time_base_s": 2.0}


class Clock:
    """Replans two seconds after a plan began."""

    def __init__(self, after_s: float = 2.0) -> None:
        self.after_s, self.last_s = after_s, 0.0

    def reset(self, limits):
        self.last_s = 0.0

    def planned(self, trajectory, field):
        self.last_s = trajectory.start_s

    def decide(self, observation):
        due = observation.time_s - self.last_s >= self.after_s
        return Decision(replan=due, cause="mine" if due else "")


@pytest.fixture(scope="module")
def trial() -> uavexp.Trial:
    return uavexp.fly("seed=3", trigger=Clock(), **SMALL, **{"mission.time_per_path_spm": 0.5})


def test_everything_named_is_there_and_explains_itself():
    for name in uavexp.__all__:
        assert getattr(uavexp, name).__doc__
        assert name in dir(uavexp)
    assert "SI units" in pydoc.render_doc(uavexp.fly)
    with pytest.raises(AttributeError, match="no attribute 'flyy'"):
        _ = uavexp.flyy


def test_an_object_flies_in_place_of_an_option(trial):
    causes = {replan.cause for replan in trial.log.replans}
    assert {"first", "mine"} <= causes <= {"first", "mine", "retry", "behind"}
    own = [replan.time_s for replan in trial.log.replans if replan.cause == "mine"]
    assert np.diff(own).min() >= 2.0
    assert trial.metrics["replans_mine"] == len(own)


def test_a_trial_says_what_was_flown(trial):
    assert trial.config["trigger"]["_target_"].endswith("Clock")
    assert trial.cell.strategy == trial.cell.options["trigger"] == "Clock"
    assert "seed=3" in trial.command
    assert trial.command.endswith(f"# trigger={__name__}.Clock")


@pytest.mark.parametrize(
    ("own", "said"),
    [
        (Clock, "Clock is a class; give an object"),
        (object(), "is no trigger, it lacks decide, planned, reset"),
        (3, "no such option"),
    ],
)
def test_what_is_no_trigger_is_refused(own, said):
    with pytest.raises(uavexp.UavexpError, match=said):
        uavexp.fly(trigger=own)


def test_options_of_a_folder_fly_and_their_command_names_it(tmp_path):
    (tmp_path / "strategy").mkdir()
    (tmp_path / "strategy" / "patient.yaml").write_text(
        "# @package _global_\ndefaults:\n  - override /trigger: tbr\ntrigger:\n  interval_s: 7.0\n"
    )
    flown = uavexp.fly(strategy="patient", config_dir=tmp_path, seed=1, **SMALL)
    assert flown.config["trigger"]["interval_s"] == 7.0
    assert f"--config-dir {tmp_path}" in flown.command
    with pytest.raises(uavexp.UavexpError, match="no such folder"):
        uavexp.fly(config_dir=tmp_path / "nowhere")


def test_nothing_prints_its_arrays(trial):
    study = uavexp.read_study(STUDY)
    for item in (trial, trial.world, trial.log, study, study.trial(0)):
        assert len(repr(item)) < 400, repr(item)
        assert "array(" not in repr(item)
    assert "reached" in repr(trial) or "timeout" in repr(trial)


def test_a_study_gives_its_flights():
    study = uavexp.read_study(str(STUDY))
    row = study.trials.iloc[2]
    for which in (2, 2 - len(study.trials), row["trial"]):
        flight = study.trial(which)
        assert flight.name == row["trial"]
        assert flight.log.outcome == row["outcome"]
    assert len(study.replans) >= len(study.trials)
    for which in (len(study.trials), "nobody"):
        with pytest.raises(uavexp.UavexpError, match="no trial"):
            study.trial(which)


def test_a_comparison_is_of_pairs_of_worlds():
    study = uavexp.read_study(STUDY)
    found = study.compare("MCR", "TBR", "min_clearance_m")
    wide = study.trials.pivot(index=["scene", "seed"], columns="arm", values="min_clearance_m")
    difference = (wide["MCR"] - wide["TBR"]).dropna()
    assert found.found.pairs == len(difference)
    assert found.found.mean == pytest.approx(difference.mean())
    assert "MCR" in str(found)
    assert study.compare("TBR", "MCR", "min_clearance_m").found.mean == pytest.approx(-difference.mean())


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (("MRC", "TBR", "success"), "did you mean 'MCR'"),
        (("MCR", "TBR", "path_length"), "did you mean 'path_length_m'"),
        (("MCR", "TBR", "outcome"), "no column of numbers"),
    ],
)
def test_a_comparison_of_what_is_not_there_is_refused(asked, said):
    with pytest.raises(uavexp.UavexpError, match=said):
        uavexp.read_study(STUDY).compare(*asked)


def test_a_flight_whose_log_is_gone_is_told(tmp_path):
    shutil.copytree(STUDY, tmp_path / "study")
    shutil.rmtree(tmp_path / "study" / "trials")
    with pytest.raises(uavexp.UavexpError, match="was not kept"):
        uavexp.read_study(tmp_path / "study").trial(0)
