"""The shapes of a log's arrays, and the check that arrays read from a file have them.

The names are those of the file (`uavexp.store.logs`), the letters those of the comments in `uavexp.log`:
the same letter is the same length everywhere. What a log may lack may be empty in place of its shape.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

NEEDED = {
    "outcome": "", "reason": "", "step_s": "", "dropped_triggers": "", "seen_share": "",
    "time_s": "T", "position_m": "T 3", "velocity_mps": "T 3", "quaternion_wxyz": "T 4",
    "estimated_position_m": "T 3", "reference_position_m": "T 3", "reference_acceleration_mps2": "T 3",
    "clearance_m": "T",
    "tick_s": "M", "esdf_clearance_m": "M", "changed_voxels": "M", "decision_score": "M",
    "goals_m": "G 3", "mapped_m": "N 3",
}  # fmt: skip
OPTIONAL = {
    "remaining_clearance_m": "M", "seen_so_far": "M",
    "map_origin_m": "3", "map_voxel_size_m": "", "map_shape": "3", "map_free": "F", "map_occupied_s": "N",
    "mover_shape": "B", "mover_half_size_m": "B 3", "mover_position_m": "T B 3", "mover_clearance_m": "T",
    "track_count": "M", "track_identity": "S", "track_position_m": "S 3", "track_velocity_mps": "S 3",
    "track_swerve_m": "S J 3",
    "plan_path_m": "P 3", "plan_breaks_s": "K1", "plan_coefficients": "K D 3", "plan_history": "H 2",
    "plan_tree_m": "E 2 3", "plan_collision_checks": "",
    "max_speed_mps": "", "max_acceleration_mps2": "", "body_radius_m": "",
    "cell_m": "C 3", "cell_seen_s": "C", "cell_visible": "C",
    "true_cell_seen_s": "U", "true_cell_visible": "U",
    "viewpoint_m": "V 3", "viewpoint_yaw_rad": "V", "viewpoint_segment": "V", "viewpoint_visited_s": "V",
}  # fmt: skip
_EVENTS = {
    "time_s": "R", "effective_s": "R", "cause": "R", "score": "R", "position_m": "R 3", "goal_m": "R 3",
    "status": "R", "reason": "R", "path_change_m": "R", "iterations": "R", "expansions": "R",
    "near_change": "R", "changed_m": "RC 3", "changed_m.count": "R", "trajectory_m": "RT 3",
    "trajectory_m.count": "R",
}  # fmt: skip
EVENTS = {f"replans.{name}": shape for name, shape in _EVENTS.items()} | {
    "contacts.start_s": "O", "contacts.end_s": "O", "contacts.position_m": "O 3", "contacts.mover": "O",
}  # fmt: skip
_TEXTS = ("outcome", "reason", "replans.cause", "replans.status", "replans.reason")
_FINITE = ("time_s", "position_m", "estimated_position_m", "tick_s", "mapped_m", "step_s", "map_origin_m")
_MOST_CELLS = 1 << 31  # of a map's grid


def check_shapes(arrays: Mapping[str, npt.NDArray[Any]]) -> None:
    """Refuse arrays that are no log's.

    Args:
        arrays: by their names in the file.

    Raises:
        ValueError: names the array and what it must be.
    """
    lengths: dict[str, int] = {}
    for name, shape in (NEEDED | EVENTS | OPTIONAL).items():
        array = arrays.get(name)
        if array is None:
            if name in NEEDED:
                raise ValueError(f"{name} is missing")
        elif name not in NEEDED and not array.size and array.ndim:
            continue  # of what it may lack, or of events that there were none of
        else:
            _check(name, array, shape.split(), lengths)
    for name in _FINITE:
        if name in arrays and not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} must be finite")
    _check_sums(arrays)


def _check(name: str, array: npt.NDArray[Any], shape: list[str], lengths: dict[str, int]) -> None:
    kinds = "U" if name in _TEXTS else "fiub"
    if array.dtype.kind not in kinds:
        raise ValueError(f"{name} must hold {'text' if kinds == 'U' else 'numbers'}, it holds {array.dtype}")
    wanted = [
        lengths.setdefault(key, length) if key.isalpha() or key == "K1" else int(key)
        for key, length in zip(shape, array.shape, strict=False)
    ]
    if len(shape) != array.ndim or list(array.shape) != wanted:
        raise ValueError(f"{name} must be ({', '.join(shape)}), it is {array.shape}")


def _check_sums(arrays: Mapping[str, npt.NDArray[Any]]) -> None:
    """Counts add up to what they count, and a grid has a bit for each of its voxels."""
    pairs = [
        ("replans.changed_m.count", "replans.changed_m"),
        ("replans.trajectory_m.count", "replans.trajectory_m"),
    ]
    for counts, rows in [*pairs, ("track_count", "track_identity")]:
        count = arrays.get(counts)
        if count is not None and (count.min(initial=0) < 0 or count.sum() != len(arrays.get(rows, ()))):
            raise ValueError(f"{counts} does not add up to the rows of {rows}")
    if (shape := arrays.get("map_shape")) is not None and shape.size:
        cells = int(np.prod(shape, dtype=object))
        bits = arrays.get("map_free", np.zeros(0)).size
        if shape.min() < 1 or cells > _MOST_CELLS or (bits and bits != -(-cells // 8)):
            raise ValueError(f"map_shape {shape.tolist()} does not fit map_free of {bits} bytes")
        if not arrays.get("map_voxel_size_m", np.float64("nan")) > 0.0:
            raise ValueError("map_voxel_size_m must be > 0")
