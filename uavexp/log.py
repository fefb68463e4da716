"""What a flight leaves behind: rows per step and per ESDF update, events, and what its mission found."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from uavexp.arrays import Bool, Float, Float32, Int, UInt8
from uavexp.geometry import polyline_length_m
from uavexp.types import Outcome, PlanStatus


def none(*shape: int, dtype: type = np.float64) -> Callable[[], npt.NDArray[Any]]:
    """Factory of what a flight may lack: an array without rows."""
    return lambda: np.zeros(shape or 0, dtype=dtype)


@dataclass(frozen=True, slots=True, kw_only=True)
class Replan:
    """One planning request after the first, and what came of it (the first plan is number 0)."""

    time_s: float  # of the trigger
    effective_s: float  # when the new plan took over; NaN when it failed
    cause: str  # "first", "map", "goal", "clock", "brake", ...
    score: float
    position_m: Float  # (3,) estimated position at the trigger
    goal_m: Float  # (3,)
    status: PlanStatus
    reason: str
    path_change_m: float  # largest distance of the old remaining path from the new one; NaN if none
    iterations: int
    expansions: int
    near_change: bool  # whether the map was changing near vehicle or path (`pilot`), whatever the cause
    changed_m: Float32  # (N, 3) voxel centres whose change fired it (figure 10); may be empty
    trajectory_m: Float32  # (P, 3) samples of the new trajectory (drawn in pictures); may be empty


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """One contact of the body box with true geometry, from touch until it has ended."""

    start_s: float
    end_s: float
    position_m: Float  # (3,) body centre at first touch
    mover: int = -1  # index of the mover that was touched first; -1: a fixed surface


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """The flight, one row per simulation step; row 0 is the start."""

    time_s: Float  # (T,)
    position_m: Float  # (T, 3) true
    velocity_mps: Float  # (T, 3) true
    quaternion_wxyz: Float  # (T, 4) true
    estimated_position_m: Float  # (T, 3)
    reference_position_m: Float  # (T, 3)
    reference_acceleration_mps2: Float  # (T, 3)
    clearance_m: Float  # (T,) true distance of the body centre to the nearest surface; < 0 inside of a solid


@dataclass(frozen=True, slots=True, kw_only=True)
class Ticks:
    """What was known and decided, one row per ESDF update."""

    tick_s: Float  # (M,)
    esdf_clearance_m: Float  # (M,) mapped distance at the estimated position
    changed_voxels: Int  # (M,) size of the change log
    decision_score: Float  # (M,)
    # (M,) least mapped distance over the rest of the flown trajectory; NaN where nothing is left
    # of one, empty when it was not measured
    remaining_clearance_m: Float = field(default_factory=none())
    # (M,) observed share of the reachable free volume; empty for a flight with a target
    seen_so_far: Float = field(default_factory=none())


@dataclass(frozen=True, slots=True, kw_only=True)
class MapGrid:
    """The map at the end on its grid of voxels, and since when; empty in logs that did not note it."""

    origin_m: Float = field(default_factory=none())  # (3,) lower corner of voxel (0, 0, 0)
    voxel_size_m: float = math.nan
    shape: Int = field(default_factory=none(dtype=np.int64))  # (3,) voxels along x, y and z
    free: UInt8 = field(default_factory=none(dtype=np.uint8))  # bits of `np.packbits`, C order
    occupied_s: Float32 = field(
        default_factory=none(dtype=np.float32)
    )  # (N,) when each of `TrialLog.mapped_m` was first mapped as occupied


@dataclass(frozen=True, slots=True, kw_only=True)
class MoverRows:
    """The movers in truth, one row per simulation step."""

    shape: UInt8 = field(default_factory=none(dtype=np.uint8))  # (B,) `Shape`
    half_size_m: Float = field(default_factory=none(0, 3))  # (B, 3)
    position_m: Float32 = field(default_factory=none(0, 0, 3, dtype=np.float32))  # (T, B, 3)
    clearance_m: Float = field(
        default_factory=none()
    )  # (T,) body centre to nearest mover; empty without movers


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackRows:
    """The movers as believed: one row per ESDF update and track, updates one after the other."""

    count: Int = field(default_factory=none(dtype=np.int64))  # (M,) tracks of each update
    identity: Int = field(default_factory=none(dtype=np.int64))  # (S,)
    position_m: Float = field(default_factory=none(0, 3))  # (S, 3)
    velocity_mps: Float = field(default_factory=none(0, 3))  # (S, 3)
    swerve_m: Float32 = field(default_factory=none(0, 0, 3, dtype=np.float32))  # (S, K, 3) `Tracks.swerve_m`


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstPlan:
    """The first plan, for studies of planners; empty without one."""

    path_m: Float = field(default_factory=none(0, 3))  # (P, 3) as searched
    breaks_s: Float = field(default_factory=none())  # (K+1,) of the trajectory
    coefficients: Float = field(default_factory=none(0, 0, 3))  # (K, D+1, 3)
    history: Float = field(default_factory=none(0, 2))  # (H, 2) iteration, best cost so far
    tree_m: Float32 = field(
        default_factory=none(0, 2, 3, dtype=np.float32)
    )  # (E, 2, 3) edges of the search's tree
    collision_checks: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanLimits:
    """What plans have to keep; NaN in logs that did not note it."""

    max_speed_mps: float = math.nan
    max_acceleration_mps2: float = math.nan
    body_radius_m: float = math.nan  # circle around the body: a trajectory nearer than this is blocked


@dataclass(frozen=True, slots=True, kw_only=True)
class Inspection:
    """What a mission found out that only it knows; empty unless it inspects.

    One row per cell of the reference's surface to be seen (C), per cell of the true surface
    (U), and per viewpoint of the first tour in the order planned (V).
    """

    cell_m: Float32 = field(default_factory=none(0, 3, dtype=np.float32))  # (C, 3)
    cell_seen_s: Float = field(default_factory=none())  # (C,) first time seen; inf: never
    cell_visible: Bool = field(default_factory=none(dtype=np.bool_))  # (C,) from anywhere allowed
    true_cell_seen_s: Float = field(default_factory=none())  # (U,)
    true_cell_visible: Bool = field(default_factory=none(dtype=np.bool_))  # (U,)
    viewpoint_m: Float = field(default_factory=none(0, 3))  # (V, 3)
    viewpoint_yaw_rad: Float = field(default_factory=none())  # (V,)
    viewpoint_segment: Int = field(default_factory=none(dtype=np.int64))  # (V,)
    viewpoint_visited_s: Float = field(default_factory=none())  # (V,) inf: never


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialLog:
    """Everything a flight leaves behind; metrics are recomputed from it without flying."""

    outcome: Outcome
    reason: str  # one sentence; empty when the outcome says it all
    step_s: float
    steps: Steps
    ticks: Ticks
    replans: tuple[Replan, ...]  # the first plan included, as number 0
    dropped_triggers: int  # triggers while a request was in flight
    contacts: tuple[Contact, ...]
    goals_m: Float  # (G, 3) distinct goals pursued, in order
    seen_share: float  # observed share of the reachable free volume; NaN when not asked for
    mapped_m: Float32  # (N, 3) occupied voxel centres of the map at the end, for pictures
    grid: MapGrid = MapGrid()
    movers: MoverRows = MoverRows()
    tracks: TrackRows = TrackRows()
    first_plan: FirstPlan = FirstPlan()
    limits: PlanLimits = PlanLimits()
    inspection: Inspection = Inspection()
    wall_s: dict[str, Float] = field(default_factory=dict)  # clock times of each call: never recorded

    @property
    def summary(self) -> str:
        """How the flight ended, in one line."""
        rows = self.steps.time_s.size
        if not rows:
            return f"{self.outcome} before the first step"
        plans = sum(replan.status is PlanStatus.OK for replan in self.replans)
        return (
            f"{self.outcome}: {polyline_length_m(self.steps.position_m):.1f} m in "
            f"{(rows - 1) * self.step_s:.1f} s, {_count(plans, 'plan')}, "
            f"{_count(len(self.contacts), 'contact')}, least clearance {self.steps.clearance_m.min():.2f} m"
        )

    def __repr__(self) -> str:
        return f"TrialLog({self.summary})"


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
