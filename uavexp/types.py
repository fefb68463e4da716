"""Everything that flows between the roles: frozen dataclasses in SI units.

World frame: z up. Body frame: x forward, y left, z up. Camera frame: x right, y down,
z forward. Quaternions are (w, x, y, z), body to world, of unit length.
Shapes stand beside the types.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum

import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int, Int32, UInt8, check_shape
from uavexp.field import DistanceField
from uavexp.space import Space
from uavexp.trajectory import Trajectory

SWERVE_STEP_S = 0.2  # between two places of a predicted path


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Rigid-body state of the vehicle, true or estimated."""

    position_m: Float  # (3,) body centre, world frame
    velocity_mps: Float  # (3,) world frame
    quaternion_wxyz: Float  # (4,) body to world
    body_rate_radps: Float  # (3,) body frame

    def __post_init__(self) -> None:
        check_shape("position_m", self.position_m, (3,))
        check_shape("velocity_mps", self.velocity_mps, (3,))
        check_shape("quaternion_wxyz", self.quaternion_wxyz, (4,))
        check_shape("body_rate_radps", self.body_rate_radps, (3,))


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """What the controller is asked to follow at one instant."""

    position_m: Float  # (3,)
    velocity_mps: Float  # (3,)
    acceleration_mps2: Float  # (3,)
    yaw_rad: float
    yaw_rate_radps: float = 0.0
    jerk_mps3: Float = field(default_factory=lambda: np.zeros(3))  # (3,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """What the controller asks of the vehicle: collective thrust and attitude."""

    thrust_N: float  # along body z, >= 0
    quaternion_wxyz: Float  # (4,) wanted attitude, body to world
    body_rate_radps: Float  # (3,) feed-forward body rate, body frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What the vehicle may be asked to do; planner, controller and brake read these."""

    max_speed_mps: float
    max_acceleration_mps2: float
    max_body_rate_radps: float
    body_size_m: tuple[float, float, float]  # box: length, width, height

    @property
    def body_radius_m(self) -> float:
        """Radius of the horizontal circle around the box, whatever its yaw."""
        return 0.5 * float(np.hypot(self.body_size_m[0], self.body_size_m[1]))


class Shape(IntEnum):
    """Form of a mover; cylinders stand upright, boxes are axis-aligned."""

    SPHERE = 0
    CYLINDER = 1
    BOX = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Bodies:
    """The moving obstacles at one instant, in truth; the same ones in the same order all flight long."""

    time_s: float
    shape: UInt8  # (B,) values of `Shape`
    half_size_m: Float  # (B, 3); a sphere's is its radius thrice, a cylinder's (r, r, half height)
    position_m: Float  # (B, 3) centres
    velocity_mps: Float  # (B, 3)

    def __post_init__(self) -> None:
        count = len(self.shape)
        for name in ("half_size_m", "position_m", "velocity_mps"):
            check_shape(name, getattr(self, name), (count, 3))

    def __len__(self) -> int:
        return len(self.shape)

    @classmethod
    def none(cls, time_s: float = 0.0) -> Bodies:
        """No body at all."""
        return cls(
            time_s=time_s,
            shape=np.zeros(0, dtype=np.uint8),
            half_size_m=np.zeros((0, 3)),
            position_m=np.zeros((0, 3)),
            velocity_mps=np.zeros((0, 3)),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """The moving obstacles as the vehicle believes them, and where they will be.

    A mover goes on at constant velocity but for its swerve: by how much it will be elsewhere, at every
    `SWERVE_STEP_S` from then on; between two of them, and beyond the last, in a straight line.
    """

    time_s: float
    identity: Int  # (N,) stays with a track while it lives
    position_m: Float  # (N, 3) centres
    velocity_mps: Float  # (N, 3)
    covariance: Float  # (N, 6, 6) of position and velocity, SI
    half_size_m: Float  # (N, 3) of an upright box around the mover
    dropped: int = 0  # filters given up so far because they diverged
    swerve_m: Float = field(default_factory=lambda: np.zeros((0, 0, 3)))  # (N, K, 3); K = 0: none

    def __post_init__(self) -> None:
        count = len(self.identity)
        check_shape("swerve_m", self.swerve_m, (count if self.swerve_m.size else None, None, 3))
        for name in ("position_m", "velocity_mps", "half_size_m"):
            check_shape(name, getattr(self, name), (count, 3))
        check_shape("covariance", self.covariance, (count, 6, 6))

    def __len__(self) -> int:
        return len(self.identity)

    @classmethod
    def none(cls, time_s: float = 0.0) -> Tracks:
        """No track at all."""
        return cls(
            time_s=time_s,
            identity=np.zeros(0, dtype=np.int64),
            position_m=np.zeros((0, 3)),
            velocity_mps=np.zeros((0, 3)),
            covariance=np.zeros((0, 6, 6)),
            half_size_m=np.zeros((0, 3)),
        )

    def predicted_m(self, times_s: Float) -> Float:
        """Centres (N, T, 3) at absolute times (T,)."""
        ahead_s = np.asarray(times_s, dtype=np.float64) - self.time_s
        straight_m = self.position_m[:, None] + ahead_s[None, :, None] * self.velocity_mps[:, None]
        return straight_m + self.swerved_m(times_s) if self.swerve_m.size else straight_m

    def swerved_m(self, times_s: Float) -> Float:
        """By how much (N, T, 3) they will be elsewhere than at constant velocity, at absolute times (T,)."""
        count, steps = len(self), self.swerve_m.shape[1]
        if not self.swerve_m.size:
            return np.zeros((count, 0, 3))
        knots_m = np.concatenate([np.zeros((count, 1, 3)), self.swerve_m], axis=1)
        at = np.maximum(np.asarray(times_s, dtype=np.float64) - self.time_s, 0.0) / SWERVE_STEP_S
        before = np.minimum(at.astype(np.int64), steps - 1)
        share = (at - before)[None, :, None]
        return np.asarray((1.0 - share) * knots_m[:, before] + share * knots_m[:, before + 1])


@dataclass(frozen=True, slots=True, kw_only=True)
class MapUpdate:
    """The change log of one ESDF update: which voxels changed, and how.

    A voxel first seen in this update is listed with `first_seen` and the old distance
    of unseen space, the truncation distance. Voxels are flat C-order indices into the
    field's grid, ascending, each at most once.
    """

    time_s: float
    voxel: Int32  # (N,)
    old_distance_m: Float32  # (N,)
    new_distance_m: Float32  # (N,)
    first_seen: Bool  # (N,)
    occupied: Bool  # (N,) state after the update


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """Where to fly next."""

    position_m: Float  # (3,)
    is_target: bool  # the mission's target itself (arrive at rest) or a frontier
    score: float  # the explorer's, higher is better
    yaw_rad: float = math.nan  # to arrive with (a viewpoint's); NaN: the pilot looks ahead


class PlanStatus(StrEnum):
    """How a planning request ended."""

    OK = "ok"
    START_BLOCKED = "start_blocked"  # the start lies inside a mapped obstacle
    GOAL_BLOCKED = "goal_blocked"  # the goal lies inside a mapped obstacle
    NO_PATH = "no_path"  # the search exhausted the map or its budget
    NOT_CLEAR = "not_clear"  # the optimised curve hits a mapped obstacle
    LIMITS = "limits"  # no duration keeps the limits from this start
    SOLVER = "solver"  # the solver failed


@dataclass(frozen=True, slots=True, kw_only=True)
class Squeeze:
    """A clearance below the usual ones and the speed at which it is flown, for a vehicle that is lost."""

    clearance_m: float
    speed_mps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanRequest:
    """What a planner is told; everything it may use."""

    time_s: float  # absolute trial time at which the plan takes effect
    position_m: Float  # (3,) state on the current reference at `time_s`
    velocity_mps: Float  # (3,)
    acceleration_mps2: Float  # (3,)
    goal: Goal
    field: DistanceField  # map at the time of the request
    flight_bounds_m: Float  # (2, 3)
    tracks: Tracks = dataclasses.field(
        default_factory=Tracks.none
    )  # believed movers at the time of the request
    squeeze: Squeeze | None = None  # to be tried where the usual clearances find no way


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanResult:
    """A planner's answer: an impossible problem is a status, not an exception."""

    status: PlanStatus
    trajectory: Trajectory | None = None  # set exactly when status is OK
    path_m: Float = field(default_factory=lambda: np.zeros((0, 3)))  # (P, 3) initial path
    reason: str = ""
    iterations: int = 0  # of the solver
    expansions: int = 0  # of the graph search
    collision_checks: int = 0  # of sampling planners
    history: Float = field(default_factory=lambda: np.zeros((0, 2)))  # (K, 2) iteration, best cost so far
    tree_m: Float = field(default_factory=lambda: np.zeros((0, 2, 3)))  # (E, 2, 3) edges of a search's tree
    wall_search_s: float = 0.0
    wall_optimise_s: float = 0.0

    def __post_init__(self) -> None:
        if (self.trajectory is not None) != (self.status is PlanStatus.OK):
            raise ValueError(f"a plan with status {self.status} must have a trajectory iff ok")


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """What the deciding roles (explorer, trigger, safety, mission) see at one instant.

    All of it is what the vehicle believes; nothing here is the truth.
    """

    time_s: float
    state: State  # estimated
    reference: Reference  # the reference being flown
    trajectory: Trajectory | None  # being flown; None before the first plan
    field: DistanceField
    update: MapUpdate  # of the latest ESDF update
    goal: Goal | None  # of the trajectory being flown
    best_goal: Goal | None  # the explorer's latest choice g*
    target_m: Float | None  # (3,) mission target; None when exploring
    flight_bounds_m: Float  # (2, 3)
    tracks: Tracks = dataclasses.field(default_factory=Tracks.none)  # movers believed to be there


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """Whether to replan, and the named cause."""

    replan: bool
    cause: str = ""  # e.g. "map", "goal", "clock"; never empty when `replan`
    score: float = 0.0  # size of the event over its threshold; policies without one say 0
    voxel: Int32 = field(default_factory=lambda: np.zeros(0, dtype=np.int32))  # (N,) whose change fired

    def __post_init__(self) -> None:
        if self.replan and not self.cause:
            raise ValueError("a replan must name its cause")


class Outcome(StrEnum):
    """How a flight ended. Contacts are counted apart: success = reached without contact."""

    REACHED = "reached"  # within the tolerance of the target, in truth
    EXPLORED = "explored"  # no reachable frontier is left
    INSPECTED = "inspected"  # every viewpoint was visited or found unreachable
    TIMEOUT = "timeout"  # the mission's time limit passed
    NO_PLAN = "no_plan"  # no plan was ever found from the start
    STUCK = "stuck"  # holding, and nothing that was tried has got it on
    UNREACHABLE = "unreachable"  # no way leads to the target through anything that may be free
    ERROR = "error"  # the trial itself raised; the record has the traceback


@dataclass(frozen=True, slots=True, kw_only=True)
class Difficulty:
    """How hard a world is, measured on the true geometry."""

    clutter_density: float  # occupied share of the flight volume at the flight height band
    narrowest_gap_m: float  # least free horizontal width across the shortest path
    straight_line_m: float
    shortest_path_m: float  # true shortest collision-free path at the required clearance

    @property
    def detour(self) -> float:
        """Shortest path over straight line, >= 1."""
        return self.shortest_path_m / self.straight_line_m if self.straight_line_m > 0.0 else 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceMap:
    """A reference map: what was known of a building before the flight, and what of it to inspect."""

    vertices_m: Float32  # (V, 3)
    triangles: Int32  # (F, 3)
    inspected: Bool  # (F,) whether the triangle is to be seen

    def __post_init__(self) -> None:
        check_shape("vertices_m", self.vertices_m, (None, 3))
        check_shape("triangles", self.triangles, (None, 3))
        check_shape("inspected", self.inspected, (self.triangles.shape[0],))


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """True geometry and a task in it."""

    name: str  # option name, e.g. "warehouse"
    vertices_m: Float32  # (V, 3)
    triangles: Int32  # (F, 3)
    bounds_m: Float  # (2, 3) box that the map covers
    flight_bounds_m: Float  # (2, 3) box the body centre may not leave
    start_m: Float  # (3,)
    start_yaw_rad: float
    target_m: Float  # (3,)
    shortest_path: Float  # (P, 3) true shortest path, start to target
    difficulty: Difficulty
    digest: str  # sha256 over geometry and task
    reference: ReferenceMap | None = None  # the map known before the flight, where there is one
    space: Space = field(default_factory=Space.all_free)  # what is solid, free, or never measured
    notes: tuple[str, ...] = ()  # what a person should know of it, a sentence each

    def __repr__(self) -> str:
        size, start, target = (
            np.round(item, 2).tolist()
            for item in (np.ptp(self.bounds_m, axis=0), self.start_m, self.target_m)
        )
        return (
            f"World({self.name}, {size} m, {len(self.triangles)} triangles, {start} to {target}, "
            f"shortest path {self.difficulty.shortest_path_m:.1f} m)"
        )
