"""Planner role: a trajectory from the current reference to the goal on the current map."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from uavexp.types import Limits, PlanRequest, PlanResult


class Planner(Protocol):
    """Plans on request; built fresh for every trial (solvers may be kept between requests)."""

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial of a vehicle with these limits."""

    def plan(self, request: PlanRequest) -> PlanResult:
        """Return a trajectory or the reason why there is none; never raises for a hard problem.

        The trajectory starts at the request's time with its position, velocity and
        acceleration, keeps the limits along its whole length, ends at the goal (at rest
        when the goal is the target) and keeps clear of mapped obstacles.
        """
