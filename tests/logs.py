"""Worlds and logs made by formula, for tests of what reads logs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from uavexp.arrays import Float, Int32
from uavexp.log import Replan, TrialLog
from uavexp.store.logs import flat, nested
from uavexp.types import Difficulty, Outcome, PlanStatus, World

Curve = Callable[[Float], Float]  # times (T,) -> (T, 3)


def box_mesh(lower_m: Float, upper_m: Float) -> tuple[Float, Int32]:
    """Vertices (8, 3) and triangles (12, 3) of a box."""
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=np.float64)
    faces = np.array(
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], dtype=np.int32
    )
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    return np.asarray(lower_m) + corners * (np.asarray(upper_m) - np.asarray(lower_m)), triangles


def make_world(
    boxes: list[tuple[list[float], list[float]]],
    *,
    size_m: tuple[float, float, float] = (20.0, 12.0, 3.0),
    start_m: tuple[float, float, float] = (1.0, 6.0, 1.2),
    target_m: tuple[float, float, float] = (19.0, 6.0, 1.2),
    shortest_path: Float | None = None,
    shortest_m: float | None = None,
) -> World:
    """A hall from the origin with boxes in it."""
    meshes = [box_mesh(np.array(low), np.array(high)) for low, high in boxes]
    meshes = meshes or [box_mesh(np.zeros(3), np.array([size_m[0], size_m[1], 0.0]))]
    counts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    ends = np.array([start_m, target_m])
    straight_m = float(np.linalg.norm(ends[1] - ends[0]))
    return World(
        name="synthetic",
        vertices_m=np.concatenate([vertices for vertices, _ in meshes]).astype(np.float32),
        triangles=np.concatenate([faces + n for (_, faces), n in zip(meshes, counts, strict=False)]).astype(
            np.int32
        ),
        bounds_m=np.array([[0.0, 0.0, 0.0], size_m]),
        flight_bounds_m=np.array([[0.2, 0.2, 0.3], [size_m[0] - 0.2, size_m[1] - 0.2, size_m[2] - 0.3]]),
        start_m=ends[0],
        start_yaw_rad=0.0,
        target_m=ends[1],
        shortest_path=ends if shortest_path is None else shortest_path,
        difficulty=Difficulty(
            clutter_density=0.1,
            narrowest_gap_m=1.0,
            straight_line_m=straight_m,
            shortest_path_m=straight_m if shortest_m is None else shortest_m,
        ),
        digest="0" * 64,
    )


def make_log(
    position: Curve,
    velocity: Curve,
    *,
    duration_s: float = 10.0,
    step_s: float = 0.01,
    begin_s: float = 0.0,
    **fields: Any,
) -> TrialLog:
    """A flight along a curve, tracked and known exactly, 1 m from everything, unless told otherwise.

    `fields` are named as in `log.npz`.
    """
    rows = round(duration_s / step_s) + 1
    own_s = step_s * np.arange(rows)
    position_m, ticks = position(own_s), step_s * np.arange(0, rows, 10)
    values: dict[str, Any] = {
        "outcome": Outcome.REACHED,
        "reason": "",
        "step_s": step_s,
        "time_s": begin_s + own_s,
        "position_m": position_m,
        "velocity_mps": velocity(own_s),
        "quaternion_wxyz": np.tile([1.0, 0.0, 0.0, 0.0], (rows, 1)),
        "estimated_position_m": position_m.copy(),
        "reference_position_m": position_m.copy(),
        "reference_acceleration_mps2": np.zeros((rows, 3)),
        "clearance_m": np.ones(rows),
        "tick_s": begin_s + ticks,
        "esdf_clearance_m": np.full(ticks.size, 1.1),
        "changed_voxels": np.zeros(ticks.size, dtype=np.int64),
        "decision_score": np.zeros(ticks.size),
        "remaining_clearance_m": np.ones(ticks.size),
        "replans": (),
        "dropped_triggers": 0,
        "contacts": (),
        "goals_m": np.zeros((0, 3)),
        "seen_share": float("nan"),
        "body_radius_m": 0.226,
        "mapped_m": np.zeros((0, 3), dtype=np.float32),
    }
    return nested(values | fields)


def changed(log: TrialLog, **fields: Any) -> TrialLog:
    """The log with other values of some fields, named as in `log.npz`."""
    return nested(flat(log) | fields)


def empty_log(**fields: Any) -> TrialLog:
    """What an error before the first step leaves behind: no row at all."""
    vectors = ("position_m", "velocity_mps", "estimated_position_m", "reference_position_m")
    vectors += ("reference_acceleration_mps2",)
    series = ("time_s", "clearance_m", "tick_s", "esdf_clearance_m", "decision_score")
    series += ("remaining_clearance_m",)
    rows: dict[str, Any] = {name: np.zeros((0, 3)) for name in vectors}
    rows |= {name: np.zeros(0) for name in series}
    rows |= {"quaternion_wxyz": np.zeros((0, 4)), "changed_voxels": np.zeros(0, dtype=np.int64)}
    still = still_curve()
    return make_log(still, still, **({"outcome": Outcome.ERROR, "reason": "it broke"} | rows | fields))


def still_curve() -> Curve:
    """The origin, for ever."""
    return lambda times_s: np.zeros((times_s.size, 3))


def make_replan(time_s: float, cause: str, *, ok: bool = True, **fields: Any) -> Replan:
    """A request at `time_s`, effective 0.03 s later when it brought a plan."""
    values: dict[str, Any] = {
        "time_s": time_s,
        "effective_s": time_s + 0.03 if ok else float("nan"),
        "cause": cause,
        "score": 1.0,
        "position_m": np.zeros(3),
        "goal_m": np.zeros(3),
        "status": PlanStatus.OK if ok else PlanStatus.NO_PATH,
        "reason": "" if ok else "no way",
        "path_change_m": 0.0 if ok else float("nan"),
        "iterations": 1,
        "expansions": 1,
        "near_change": False,
        "changed_m": np.zeros((0, 3), dtype=np.float32),
        "trajectory_m": np.zeros((0, 3), dtype=np.float32),
    }
    return Replan(**(values | fields))
