"""From a file's own frame and unit to metres, z up, near the origin."""

from __future__ import annotations

import dataclasses

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError
from uavexp.formats import Cells, Content

# rows of the rotation that turns each up axis to +z
UP_AXES = {
    "x": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-x": ((0, 1, 0), (0, 0, -1), (-1, 0, 0)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}
FARTHEST_M = 20_000.0  # beyond it float32 cannot place a surface to a millimetre


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """How a file's numbers are read."""

    path: str  # named in errors
    unit_m: float  # length of one unit of the file
    up_axis: str  # the file's axis that points up, a key of `UP_AXES`

    def notes(self, content: Content) -> list[str]:
        """Return what a person should know of the unit and axis that the file names."""
        return [
            *_note("unit_m", content.unit_m, self.unit_m, 1.0, "give another if it is wrong"),
            *_note("up_axis", content.up_axis, self.up_axis, "z", "z if the building lies on its side"),
        ]

    def turned(self, points: Float) -> Float:
        """Points (N, 3) of the file in m, z up."""
        return np.asarray(self.unit_m * (points @ np.array(UP_AXES[self.up_axis], dtype=np.float64).T))

    def origin_m(self, points_m: Float) -> Float:
        """What is to be taken off turned points (N, 3): nothing, or whole metres where they lie far away."""
        low, high = points_m.min(axis=0), points_m.max(axis=0)
        if float((high - low).max()) > FARTHEST_M:
            raise WorldError(
                f"{self.path}: it is {float((high - low).max()):.3g} m long, at most {FARTHEST_M:g} m are "
                f"allowed; is world.unit_m={self.unit_m:g} right?"
            )
        far = float(max(np.abs(low).max(), np.abs(high).max())) > FARTHEST_M
        return np.floor(low) if far else np.zeros(3)

    def upright(self, cells: Cells) -> Cells:
        """The same cells in m, z up."""
        if cells.is_plan:
            return cells
        turn = np.array(UP_AXES[self.up_axis], dtype=np.int64)
        source = np.abs(turn).argmax(axis=1)  # the file's axis that becomes each of ours
        state = np.transpose(cells.state, source)
        corners = self.turned(corners_of(cells))
        flipped = tuple(slice(None, None, int(sign)) for sign in turn[np.arange(3), source])
        return dataclasses.replace(
            cells,
            state=np.ascontiguousarray(state[flipped]),
            origin=corners.min(axis=0),
            size=self.unit_m * cells.size[source],
        )


def frame_of(content: Content, path: str, unit_m: float | None, up_axis: str | None) -> Frame:
    """Return the frame that was asked for, else the one that the file names, else metres, z up."""
    return Frame(path=path, unit_m=unit_m or content.unit_m or 1.0, up_axis=up_axis or content.up_axis or "z")


def _note(name: str, said: object, used: object, usual: object, otherwise: str) -> list[str]:
    if said is not None and said != used:
        return [f"read with world.{name}={used}, though the file says {said}"]
    if said is not None and said != usual:
        return [f"read with world.{name}={used}, as the file says; {otherwise}"]
    return []


def corners_of(cells: Cells) -> Float:
    """Lower and upper corner (2, 3) of the box of cells, not turned by their yaw."""
    return np.stack([cells.origin, cells.origin + cells.size * cells.state.shape])
