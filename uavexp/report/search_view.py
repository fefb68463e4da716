"""Why a flight went where it went: goals in the order chosen, from where, and the frontier that it left."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from scipy.ndimage import binary_dilation

from uavexp.arrays import Float
from uavexp.log import Replan, TrialLog
from uavexp.map_grid import free_voxels
from uavexp.report import style
from uavexp.types import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SAME_M = 0.3  # goals so near to one another are one: delta_g of paper 1
_NUMBERED = 40  # goals; more are drawn without their numbers


def draw(axes: Axes, world: World, log: TrialLog) -> None:
    """Draw the frontier at the end, and each goal short of the target, its number and where it was chosen."""
    frontier = frontier_m(log, float(world.start_m[2]))
    axes.plot(frontier[:, 0], frontier[:, 1], ".", color=style.PURPLE, ms=2.4, mew=0, zorder=2.5)
    goals = chosen_goals(world, log)
    for number, replan in enumerate(goals, 1):
        places = np.stack([replan.position_m, replan.goal_m])
        axes.plot(places[:, 0], places[:, 1], ":", color=style.WINE, lw=0.7, alpha=0.7, zorder=4.5)
        axes.plot(*replan.goal_m[:2], "o", color="white", mec=style.WINE, mew=0.8, ms=4.0, zorder=6.5)
        if len(goals) <= _NUMBERED:
            look: dict[str, Any] = {
                "textcoords": "offset points",
                "fontsize": 6.5,
                "color": style.WINE,
                "clip_on": True,
            }
            axes.annotate(str(number), tuple(replan.goal_m[:2]), (3.0, 3.0), zorder=6.6, **look)


def handles(world: World, log: TrialLog) -> list[Line2D]:
    """The legend's entries for what was drawn; none where every plan led to the target."""
    goals = chosen_goals(world, log)
    found = [
        Line2D([], [], color=style.PURPLE, marker=".", ls="", ms=5, mew=0, label="frontier at the end")
        for _ in frontier_m(log, float(world.start_m[2]))[:1]
    ]
    ball: dict[str, Any] = {
        "color": style.WINE,
        "marker": "o",
        "mfc": "white",
        "mec": style.WINE,
        "mew": 0.8,
        "ms": 5,
    }
    label = f"goals in their order ({len(goals)})"
    return [*found, *([Line2D([], [], ls=":", lw=0.9, label=label, **ball)] if goals else [])]


def chosen_goals(world: World, log: TrialLog) -> list[Replan]:
    """Requests that brought a plan to another place than the one before and than the target, in order."""
    found: list[Replan] = []
    for replan in log.replans:
        is_target = float(np.linalg.norm(replan.goal_m - world.target_m)) < SAME_M
        same = bool(found) and float(np.linalg.norm(replan.goal_m - found[-1].goal_m)) < SAME_M
        if len(replan.trajectory_m) and not is_target and not same:
            found.append(replan)
    return found


def frontier_m(log: TrialLog, height_m: float) -> Float:
    """Centres (N, 2) of the free voxels at a height that have a neighbour never seen, at the end.

    None where the log did not note its map, or has no voxels at that height.
    """
    free = free_voxels(log.grid)
    layer = int(np.floor((height_m - log.grid.origin_m[2]) / log.grid.voxel_size_m)) if free.size else -1
    if not 0 <= layer < free.shape[2]:
        return np.zeros((0, 2))
    index = np.floor((log.mapped_m - log.grid.origin_m) / log.grid.voxel_size_m).astype(np.int64)
    index = index[index[:, 2] == layer]
    known = free[:, :, layer].copy()
    known[index[:, 0], index[:, 1]] = True
    cells = np.argwhere(free[:, :, layer] & binary_dilation(~known, np.ones((3, 3), dtype=np.bool_)))
    return np.asarray(log.grid.origin_m[:2] + (cells + 0.5) * log.grid.voxel_size_m)
