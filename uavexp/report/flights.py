"""Which flights a figure shows: by a rule fixed beforehand, never by how they look."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import pandas as pd

from uavexp.errors import RecordError
from uavexp.log import TrialLog
from uavexp.report.comparison import SCENE
from uavexp.report.results import ARM, OK, Results
from uavexp.store.study import TRIALS, WORLDS, trial_folders
from uavexp.types import World

_KIND = "scene_kind"  # column of inspections: what the reference does not show
_SAFETY_M = 0.30  # m; where a study does not say (`metrics.summary`)
RULE = "lowest seed with a stored log of every arm shown"


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

    @property
    def longest_s(self) -> float:
        """How long the longest of the flights took, at least 1 s."""
        return max(1.0, *(float(log.steps.time_s[-1]) for log in self.logs.values()))


def three_arms(results: Results) -> tuple[str, ...]:
    """The paper's three strategies, those that were flown; else the first three arms."""
    wanted = [arm for arm in ("SSP", results.clock, results.primary) if arm in results.arms]
    return tuple(wanted) if len(wanted) > 1 else results.arms[:3]


def scene_at(results: Results, place: str) -> str:
    """The `first` or the `last` scene with a trial; "" without scenes."""
    return results.scenes[0 if place == "first" else -1] if results.scenes else ""


def safety_threshold_m(results: Results) -> float:
    """The clearance that the flights were to keep, m."""
    column = "safety_threshold_m"
    known = results.trials[column].dropna().tolist() if column in results.trials else []
    return float([*known, _SAFETY_M][0])


def stored(results: Results) -> pd.DataFrame:
    """The flights that ran to their end and whose log and world are in the folder."""
    study, flights = results.study, results.trials
    if "world_digest" not in flights:
        return flights.iloc[:0]
    worlds = {file.stem for file in (study.folder / WORLDS).glob("*.npz")}
    there = flights[(flights["status"] == OK) & flights["world_digest"].isin(worlds)]
    folders = {folder.name for folder in trial_folders(study.folder)}
    there = there[there["trial"].isin(folders)]
    return there[there["trial"].map(study.has_log).astype(bool)]


def inspections(results: Results) -> pd.DataFrame:
    """The stored flights that had a surface to see."""
    there = stored(results)
    return there[there[_KIND].fillna("").astype(str) != ""] if _KIND in there else there.iloc[:0]


def shared_worlds(results: Results, arms: Sequence[str], scenes: Sequence[str]) -> Iterator[SharedWorld]:
    """The worlds that all of these arms flew in and left logs of, by scene in the order given, then by seed.

    Args:
        results: whose logs are read.
        arms: that must all have flown there.
        scenes: in order.

    Raises:
        RecordError: the next world or one of its logs is damaged.
    """
    study, flights = results.study, stored(results)
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


@lru_cache(maxsize=2)  # several figures show the same world
def shared_world(results: Results, arms: tuple[str, ...], scene: str) -> SharedWorld:
    """The first of the `shared_worlds` of one scene.

    Raises:
        RecordError: there is none, or it is damaged.
    """
    shared = next(shared_worlds(results, arms, [scene]), None)
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
        flights: of `Results.trials`; replans of other trials are left out.
    """
    end_s = replans["trial"].map(flights.set_index("trial")["completion_time_s"].astype(float))
    taken = replans[replans["effective_s"].astype(float) <= end_s]
    taken = taken.sort_values(["trial", "number"], kind="stable")
    return taken[taken.groupby("trial").cumcount() > 0]
