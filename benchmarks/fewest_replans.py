"""The fewest replans of what was flown: `python -m benchmarks.fewest_replans [ARM ...] [--seeds 100:104]`.

An oracle that knows the map flies the same way at the same speed. Each of its plans lies in what was seen
when it is made, and is replaced as late as can be: where its seen part ends. As what was seen only grows,
no sequence of seen plans along this way has fewer. A policy whose plans enter the unknown can have less.
Arms are words in quotes, e.g. "strategy=mcr explorer.commit_m=0.5"; worlds are the four families.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from uavexp import trial as loop
from uavexp.arrays import Float
from uavexp.config.build import build
from uavexp.field import DistanceField
from uavexp.flight import one_trial
from uavexp.metrics.replanning import executed
from uavexp.trajectory import Trajectory
from uavexp.trigger.base import TriggerPolicy
from uavexp.types import Decision, Limits, Observation

ARMS = ("strategy=mcr", "strategy=mcr_adaptive", "strategy=gain", "strategy=learned")
WORLDS = ("random_columns", "warehouse", "corridors", "rooms")


class Watch:
    """A trigger with a note of when each voxel was first seen."""

    def __init__(self, trigger: TriggerPolicy) -> None:
        self.trigger = trigger
        self.seen_s, self.field = np.zeros(0), None

    def reset(self, limits: Limits) -> None:
        self.trigger.reset(limits)

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        self.trigger.planned(trajectory, field)

    def decide(self, observation: Observation) -> Decision:
        if self.field is None:  # the start is known before
            self.seen_s = np.where(observation.field.state.ravel() > 0, observation.time_s, np.inf)
        self.field, update = observation.field, observation.update
        new = update.voxel[update.first_seen]
        self.seen_s[new] = np.minimum(self.seen_s[new], observation.time_s)
        return self.trigger.decide(observation)

    def seen_at_s(self, point_m: Float) -> Float:
        """When places (N, 3) were seen, s; inf: never."""
        cell = np.floor((point_m - self.field.origin_m) / self.field.voxel_size_m).astype(int)
        return self.seen_s[np.ravel_multi_index(tuple(cell.T), self.field.state.shape, mode="clip")]


def fewest(time_s: Float, seen_s: Float, first_s: float) -> int:
    """Replans of the oracle: a plan made at t reaches to the first place seen later than t.

    Args:
        time_s: (N,) when the places of the way were passed, ascending.
        seen_s: (N,) when they were first seen.
        first_s: when the first plan is made.
    """
    count, made_s = 0, first_s
    while True:
        beyond = np.flatnonzero((seen_s > made_s) & (time_s > made_s))
        if not beyond.size:
            return count
        made_s, count = max(float(time_s[beyond[0]]), float(seen_s[beyond[0]])), count + 1
        if not np.isfinite(made_s):
            return count


def flown(arm: str, world: str, seed: int) -> tuple[int, int]:
    """Replans of one flight, and the fewest."""
    cell, _, _ = one_trial([*arm.split(), f"world={world}"], None, {})
    parts = build(cell.config)
    watch = Watch(parts.trigger)
    _, log = loop.fly_trial(replace(parts, trigger=watch), seed)
    places = log.steps.position_m[::5]
    first_s = log.replans[0].time_s
    return len(executed(log)), fewest(log.steps.time_s[::5], watch.seen_at_s(places), first_s)


def main() -> None:
    """Fly and print a row for each arm."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("arms", nargs="*", default=ARMS)
    parser.add_argument("--seeds", default="100:104")
    asked = parser.parse_args()
    seeds = range(*map(int, asked.seeds.split(":")))
    print(f"{'replans':>8} {'fewest':>7} {'ratio':>6}  arm, {len(WORLDS) * len(seeds)} flights each")
    for arm in asked.arms:
        pairs = np.array([flown(arm, world, seed) for world in WORLDS for seed in seeds])
        made, least = pairs.mean(axis=0)
        print(f"{made:8.1f} {least:7.1f} {made / least:6.2f}  {arm}", flush=True)


if __name__ == "__main__":
    main()
