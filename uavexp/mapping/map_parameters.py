"""What every map backend is told: the parameters of TSDF, occupancy and ESDF."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require
from uavexp.mapping.esdf import distance_table
from uavexp.mapping.occupancy import LARGEST_EVIDENCE, FusionRule, OccupancyMap
from uavexp.parameters import FINITE, Count, Positive, at_least, between

Evidence = Annotated[int, between(1, LARGEST_EVIDENCE)]


@dataclass(slots=True, kw_only=True)
class FieldParameters:
    """Parameters that every backend has; no state."""

    voxel_size_m: Annotated[float, between(0.005, 0.5)] = 0.10  # m; the paper's
    esdf_rate_hz: Positive = 10.0  # Hz; the paper's
    max_distance_m: Positive = 2.0  # m, truncation of the field; >= trigger.monitor_radius_m [ours]
    max_memory_mb: Positive = 1000.0  # 10^6 bytes; larger maps are refused [ours]

    def __post_init__(self) -> None:
        distance_table(self.voxel_size_m, self.max_distance_m)  # refuses what it cannot hold


@dataclass(slots=True, kw_only=True)
class MapParameters(FieldParameters):
    """Parameters of the backends that fuse scans; no state. Meaning in `occupancy`."""

    truncation_m: Positive = 0.30  # m, of the signed distance along the optical axis
    # [ours: the paper gives none]
    max_weight: Annotated[int, between(1, 255)] = 20  # frames; a second at 20 Hz [ours: w_max is not given]
    occupied_below_m: float = 0.025  # m; a judged distance below this is a hit [ours: a quarter of a voxel]
    free_above_m: float = 0.10  # m; above this a miss; with occupied_below_m more than a voxel,
    # so that sheets stay [ours]
    solid_depth_m: Positive = 0.25  # m behind a surface that become occupied;
    # half a voxel less than truncation_m [ours]
    hit_evidence: Evidence = (
        2  # counts a hit adds; 2 to 1: an object hit in a third of the frames stands [ours]
    )
    miss_evidence: Evidence = 1  # counts a miss takes away [ours]
    occupied_evidence: Count = 4  # counts that make a voxel occupied: two hits, so no speckle does [ours]
    max_evidence: Evidence = 12  # counts at most (<= 31);
    # what was removed is forgotten after 12 misses, 0.6 s [ours]

    forget_s: Annotated[float, at_least(0.1), FINITE] | None = (
        None  # s after which what is no longer seen is unknown again, against
    )
    # drift (a voxel seen for fewer than max_weight frames sooner); null: never [ours]

    def __post_init__(self) -> None:
        FieldParameters.__post_init__(self)
        require(
            -self.truncation_m < self.occupied_below_m < self.free_above_m < self.truncation_m,
            "-truncation_m < occupied_below_m < free_above_m < truncation_m must hold, got "
            f"truncation_m {self.truncation_m}, occupied_below_m {self.occupied_below_m}, "
            f"free_above_m {self.free_above_m}",
        )
        require(
            self.solid_depth_m <= self.truncation_m and self.occupied_below_m > -self.solid_depth_m,
            "solid_depth_m <= truncation_m and occupied_below_m > -solid_depth_m must hold, got "
            f"solid_depth_m {self.solid_depth_m}",
        )
        require(
            self.occupied_evidence <= self.max_evidence,
            f"occupied_evidence must be <= max_evidence = {self.max_evidence}, got {self.occupied_evidence}",
        )

    def rule(self) -> FusionRule:
        """Return the fusion and occupancy rule in the form that kernels take."""
        return FusionRule(
            truncation_m=np.float32(self.truncation_m),
            max_weight=self.max_weight,
            occupied_below_m=np.float32(self.occupied_below_m),
            free_above_m=np.float32(self.free_above_m),
            solid_depth_m=np.float32(self.solid_depth_m),
            hit_evidence=self.hit_evidence,
            miss_evidence=self.miss_evidence,
            occupied_evidence=self.occupied_evidence,
            max_evidence=self.max_evidence,
        )

    def empty_map(self, bounds_m: Float) -> OccupancyMap:
        """Return a map of `bounds_m` (2, 3) in which everything is unknown."""
        fade_s = math.inf if self.forget_s is None else self.forget_s / self.max_weight
        return OccupancyMap(bounds_m, self.voxel_size_m, self.max_distance_m, self.max_memory_mb, fade_s)
