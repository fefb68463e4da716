"""Which flights a figure shows: by a rule fixed beforehand, never by how they look."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from uavexp.errors import RecordError
from uavexp.log import TrialLog
from uavexp.report.comparison import SCENE, arm_names
from uavexp.report.figures.looks import clock_arm, primary_arm
from uavexp.report.findings import OK, arm_axes, arms_flown
from uavexp.store.study import TRIALS, WORLDS, Study
from uavexp.types import World

RULE = "lowest seed with a stored log of every arm shown"
ARM = "arm of all axes"  # column of `flights_of`; an axis may be called "arm"


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedWorld:
    """One world and the flights of several arms in it."""

    scene: str
    seed: int
    world: World
    logs: Mapping[str, TrialLog]  # arm -> flight, in the order shown
    trials: Mapping[str, str]  # arm -> name of its folder

    @property
    def where(self) -> str:
        """Scene and seed in words."""
        return f"scene “{self.scene}”, seed {self.seed}" if self.scene else f"seed {self.seed}"


def flights_of(study: Study) -> pd.DataFrame:
    """The trials with their arm's name in the column `ARM` and a scene for each."""
    trials = study.trials
    scene = trials[SCENE].astype(str) if SCENE in trials else pd.Series("", index=trials.index)
    return trials.assign(**{ARM: arm_names(trials, list(arm_axes(study))), SCENE: scene})


def arms_of(study: Study) -> tuple[str, ...]:
    """Names of all arms with a trial, in the experiment's order."""
    return arms_flown(study.trials, arm_axes(study))


def three_arms(study: Study) -> tuple[str, ...]:
    """The paper's three strategies, those that were flown; else the first three arms."""
    arms = arms_of(study)
    wanted = [arm for arm in ("SSP", clock_arm(study), primary_arm(study)) if arm in arms]
    return tuple(wanted) if len(wanted) > 1 else arms[:3]


def scenes_of(study: Study, flights: pd.DataFrame) -> tuple[str, ...]:
    """Scenes with a trial, in the experiment's order."""
    flown = set(flights[SCENE])
    return tuple(scene for scene in study.axes.get(SCENE, ("",)) if scene in flown)


def stored(study: Study, flights: pd.DataFrame) -> pd.DataFrame:
    """The flights that ran to their end and whose log and world are in the folder."""
    if "world_digest" not in flights:
        return flights.iloc[:0]
    worlds = {file.stem for file in (study.folder / WORLDS).glob("*.npz")}
    there = flights[(flights["status"] == OK) & flights["world_digest"].isin(worlds)]
    folders = {folder.name for folder in (study.folder / TRIALS).glob("*")}
    there = there[there["trial"].isin(folders)]
    return there[there["trial"].map(study.has_log).astype(bool)]


def shared_worlds(
    study: Study, flights: pd.DataFrame, arms: Sequence[str], scenes: Sequence[str]
) -> Iterator[SharedWorld]:
    """The worlds that all of these arms flew in and left logs of, by scene in the order given, then by seed.

    Args:
        study: whose logs are read.
        flights: of `stored`.
        arms: that must all have flown there.
        scenes: in order.

    Raises:
        RecordError: the next world or one of its logs is damaged.
    """
    for scene in scenes:
        there = flights[(flights[SCENE] == scene) & flights[ARM].isin(arms)]
        for seed, group in there.groupby("seed", sort=True):
            trials = dict(zip(group[ARM], group["trial"], strict=True))
            if set(arms) == set(trials) and group["world_digest"].nunique() == 1:
                yield SharedWorld(
                    scene=scene,
                    seed=int(str(seed)),
                    world=study.world(group["world_digest"].iloc[0]),
                    logs={arm: study.log(trials[arm]) for arm in arms},
                    trials={arm: trials[arm] for arm in arms},
                )


def shared_world(study: Study, flights: pd.DataFrame, arms: Sequence[str], scene: str) -> SharedWorld:
    """The first of the `shared_worlds` of one scene.

    Raises:
        RecordError: there is none, or it is damaged.
    """
    shared = next(shared_worlds(study, flights, arms, [scene]), None)
    if shared is None:
        where = f" in scene “{scene}”" if scene else ""
        raise RecordError(
            f"{TRIALS} and {WORLDS} hold no world{where} with a log of each of {', '.join(arms)}"
        )
    return shared


def executed(replans: pd.DataFrame, flights: pd.DataFrame) -> pd.DataFrame:
    """Replans that took effect before the flight ended, first plans left out (`metrics.replanning`).

    Args:
        replans: of a study.
        flights: of `flights_of`; replans of other trials are left out.
    """
    end_s = replans["trial"].map(flights.set_index("trial")["completion_time_s"].astype(float))
    taken = replans[replans["effective_s"].astype(float) <= end_s]
    taken = taken.sort_values(["trial", "number"], kind="stable")
    return taken[taken.groupby("trial").cumcount() > 0]
