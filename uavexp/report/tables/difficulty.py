"""How hard the worlds of each scene are, measured on their true geometry."""

from __future__ import annotations

from uavexp.report import number_format
from uavexp.report.comparison import SCENE
from uavexp.report.results import Results
from uavexp.report.tables.base import Table

_LABELS = {
    "shortest_path_m": "shortest path [m]",
    "straight_line_m": "straight line [m]",
    "clutter_density": "occupied share of the flight band",
    "narrowest_gap_m": "narrowest gap on the shortest path [m]",
}


def table(results: Results, *, name: str) -> Table | None:
    """A row per scene: mean [least, greatest] over its worlds; none without scenes."""
    if not results.scenes:
        return None
    have = [column for column in _LABELS if column in results.trials]
    worlds = results.trials.dropna(subset=have).drop_duplicates([SCENE, "seed"])

    def cell(scene: str, column: str) -> str:
        values = worlds.loc[worlds[SCENE].astype(str) == scene, column].to_numpy(dtype=float)
        if not values.size:
            return number_format.NONE
        return f"{values.mean():.2f} [{values.min():.2f}, {values.max():.2f}]"

    return Table(
        name=name,
        title="How hard the worlds are, measured on their true geometry",
        columns=("scene", *(_LABELS[column] for column in have)),
        rows=tuple((scene, *(cell(scene, column) for column in have)) for scene in results.scenes),
        notes=("Mean [least, greatest] over the worlds of a scene.",),
    )
