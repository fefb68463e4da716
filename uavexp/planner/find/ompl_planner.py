"""What OMPL's planners have in common here: peers of `df_bitstar` on the same free space, smoothed alike."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from uavexp.errors import require_non_negative, require_option, require_positive
from uavexp.planner.find.ompl_process import Query, require_ompl, search_with_ompl
from uavexp.planner.find.sampling import (
    FoundWay,
    finish,
    refusal,
    require_known_or_not,
    require_whole,
    space_of,
)
from uavexp.planner.movers.among import plan_among
from uavexp.planner.shape import Smoothing, make_smoother
from uavexp.planner.shape.base import Smoother
from uavexp.types import Limits, PlanRequest, PlanResult


@dataclass(slots=True, kw_only=True)
class OmplPlanner(ABC):
    """A planner of OMPL in a process of its own; what it is, its subclass says."""

    algorithm: ClassVar[str]  # OMPL's class
    option: ClassVar[str]  # of `planner=`

    min_clearance_m: float = 0.26
    z_band_m: float = 0.3
    unknown: str = "optimistic"
    rewire_factor: float = 1.1
    max_iterations: int = 20_000
    mover_margin_m: float = 0.5
    mover_horizon_s: float = 2.0
    smoothing: Smoothing = Smoothing.BSPLINE_QP
    derivative: str = "acceleration"
    _limits: Limits | None = field(default=None, init=False, repr=False)
    _smoother: Smoother | None = field(default=None, init=False, repr=False)
    _seed: int = field(default=1, init=False, repr=False)

    def __post_init__(self) -> None:
        require_positive(min_clearance_m=self.min_clearance_m, rewire_factor=self.rewire_factor)
        require_non_negative(
            mover_margin_m=self.mover_margin_m, mover_horizon_s=self.mover_horizon_s, z_band_m=self.z_band_m
        )
        require_whole(max_iterations=self.max_iterations)
        require_known_or_not(self.unknown)
        self.smoothing = require_option("smoothing", self.smoothing, Smoothing)
        self._smoother = make_smoother(self.smoothing, self.derivative)

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial of a vehicle with these limits; every request is searched with the same seed.

        Raises:
            ConfigError: when OMPL is not installed.
        """
        require_ompl(self.option)
        self._limits = limits
        self._seed = int(rng.integers(1, 2**31))

    def plan(self, request: PlanRequest) -> PlanResult:
        """Return a trajectory or the reason why there is none (`Planner.plan`)."""
        if self._limits is None:
            raise RuntimeError("plan() needs reset() first")
        return plan_among(
            request,
            self._plan,
            self._limits,
            margin_m=self.mover_margin_m,
            horizon_s=self.mover_horizon_s,
            min_clearance_m=self.min_clearance_m,
            known_only=self.unknown == "conservative",
        )

    @abstractmethod
    def settings(self) -> dict[str, float]:
        """OMPL's setters and what they are given."""

    def _plan(self, request: PlanRequest) -> PlanResult:
        """Plan in the map as it is."""
        assert self._limits is not None
        assert self._smoother is not None
        known_only = self.unknown == "conservative"
        refused = refusal(request, self._limits, self.min_clearance_m, known_only)
        if refused is not None:
            return PlanResult(status=refused.status, reason=refused.reason)
        space = space_of(request, self.min_clearance_m, self.z_band_m, known_only)
        query = Query(self.algorithm, self.settings(), space, self._seed, self.max_iterations)
        answer = search_with_ompl(query)
        reason = "" if len(answer.path) else f"not found in {answer.iterations} iterations"
        found = FoundWay(answer.path, None, answer.history[:, :2], answer.iterations, answer.checks, reason)
        began_s = time.perf_counter() - answer.cpu_s  # the search alone: its process may have had to start
        return finish(request, found, self._smoother, self._limits, self.min_clearance_m, known_only, began_s)
