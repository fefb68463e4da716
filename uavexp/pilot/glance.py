"""Whom to look at: the mover that will come near the soonest."""

from __future__ import annotations

import math

import numpy as np

from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Observation

_HORIZON_S = 2.0
_STEP_S = 0.1
_NEAR_M = 1.5  # from its surface, where a mover is met


def towards_encounter_rad(observation: Observation, trajectory: Trajectory | None) -> float:
    """Bearing from the vehicle to the mover that it will be near to first on what it flies; NaN: to none."""
    tracks, now_s = observation.tracks, observation.time_s
    if not len(tracks):
        return math.nan
    times_s = now_s + np.arange(0.0, _HORIZON_S, _STEP_S)
    here_m = observation.state.position_m
    path_m = here_m[None]
    if trajectory is not None:
        path_m = evaluate(trajectory, np.clip(times_s, trajectory.start_s, trajectory.end_s))[0]
    places_m = tracks.predicted_m(times_s)
    apart_m = (
        np.linalg.norm((places_m - path_m)[..., :2], axis=2) - tracks.half_size_m[:, :2].max(axis=1)[:, None]
    )
    near = apart_m < _NEAR_M
    if not near.any():
        return math.nan
    # the soonest, and of those that are near already the nearest
    first = np.where(near.any(axis=1), near.argmax(axis=1), len(times_s))
    whom = int(np.lexsort((apart_m.min(axis=1), first))[0])
    dx, dy = (places_m[whom, 0] - here_m)[:2]
    return math.atan2(dy, dx)
