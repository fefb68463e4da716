"""What every map backend is told: the parameters of TSDF, occupancy and ESDF."""

from __future__ import annotations

from dataclasses import dataclass

from uavexp.arrays import Float
from uavexp.errors import require, require_positive
from uavexp.mapping.esdf import distance_table
from uavexp.mapping.occupancy import OccupancyMap, Rule, check_rule


@dataclass(slots=True, kw_only=True)
class MapParameters:
    """Parameters shared by the backends; no state. Units in the names, meaning in `occupancy`."""

    voxel_size_m: float = 0.10
    truncation_m: float = 0.30
    max_weight: int = 20
    esdf_rate_hz: float = 10.0
    max_distance_m: float = 2.0
    occupied_below_m: float = 0.025
    free_above_m: float = 0.10
    solid_depth_m: float = 0.25
    hit_evidence: int = 2
    miss_evidence: int = 1
    occupied_evidence: int = 4
    max_evidence: int = 12
    max_memory_mb: float = 1000.0

    def __post_init__(self) -> None:
        require_positive(
            voxel_size_m=self.voxel_size_m,
            truncation_m=self.truncation_m,
            esdf_rate_hz=self.esdf_rate_hz,
            max_distance_m=self.max_distance_m,
            max_memory_mb=self.max_memory_mb,
        )
        for name in ("max_weight", "hit_evidence", "miss_evidence", "occupied_evidence", "max_evidence"):
            value = getattr(self, name)
            require(isinstance(value, int), f"{name} must be a whole number, got {value}")
        check_rule(self.rule())
        distance_table(self.voxel_size_m, self.max_distance_m)

    def rule(self) -> Rule:
        """Return the fusion and occupancy rule in the form that kernels take."""
        return Rule(
            truncation_m=float(self.truncation_m),
            max_weight=self.max_weight,
            occupied_below_m=float(self.occupied_below_m),
            free_above_m=float(self.free_above_m),
            solid_depth_m=float(self.solid_depth_m),
            hit_evidence=self.hit_evidence,
            miss_evidence=self.miss_evidence,
            occupied_evidence=self.occupied_evidence,
            max_evidence=self.max_evidence,
        )

    def empty_map(self, bounds_m: Float) -> OccupancyMap:
        """Return a map of `bounds_m` (2, 3) in which everything is unknown."""
        return OccupancyMap(bounds_m, self.voxel_size_m, self.max_distance_m, self.max_memory_mb)
