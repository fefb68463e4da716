"""An office or flat: rooms split off one another, doors with lintels, furniture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavexp.errors import require
from uavexp.parameters import Positive, Share, between, option
from uavexp.world import indoor
from uavexp.world.boxes import Boxes

PARTITION_M = 0.12  # thickness of inner walls
DOOR_CORNER_M = 0.35  # least distance of a door from the end of its wall
DOOR_KEEP_M = 0.9  # no furniture nearer to a door's middle

# parts are (x, y, underside, length, width, height) about the piece's middle, m
TABLE = (
    (0.0, 0.0, 0.71, 1.5, 0.8, 0.04),
    *((x, y, 0.0, 0.06, 0.06, 0.71) for x in (-0.69, 0.69) for y in (-0.34, 0.34)),
)
CHAIR = (
    (0.0, 0.0, 0.42, 0.44, 0.44, 0.05),
    (-0.2, 0.0, 0.47, 0.04, 0.44, 0.45),
    *((x, y, 0.0, 0.04, 0.04, 0.42) for x in (-0.19, 0.19) for y in (-0.19, 0.19)),
)
SOFA = ((0.0, 0.0, 0.0, 0.85, 1.8, 0.42), (-0.33, 0.0, 0.42, 0.2, 1.8, 0.4))
CUPBOARD = ((0.0, 0.0, 0.0, 0.45, 1.0, 2.0),)
SIDEBOARD = ((0.0, 0.0, 0.0, 0.45, 1.4, 0.85),)
BOOKCASE = (
    *((0.0, 0.0, z, 0.3, 0.9, 0.03) for z in (0.0, 0.45, 0.9, 1.35, 1.8)),
    (0.0, -0.435, 0.0, 0.3, 0.03, 1.83),
    (0.0, 0.435, 0.0, 0.3, 0.03, 1.83),
    (-0.14, 0.0, 0.0, 0.02, 0.9, 1.83),
)
AGAINST_WALL = (CUPBOARD, SIDEBOARD, BOOKCASE, SOFA)  # their back is towards -x


@dataclass(slots=True, kw_only=True)
class Room:
    """A rectangle of floor, m."""

    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def sides(self) -> tuple[float, float]:
        """Length along x and y, m."""
        return self.high[0] - self.low[0], self.high[1] - self.low[1]


@option
class Rooms(indoor.Indoor):
    """Rooms made by halving the floor again and again, with a door in every dividing wall."""

    advice = "lower furniture_per_m2, or raise door_width_m or room_m"

    size_m: indoor.Size = (22.0, 13.0, 2.8)  # m, inner length, width, height
    room_m: Positive = 3.6  # m, least side of a room [ours]
    door_width_m: Positive = 1.25  # m, free width of a door [ours]
    door_height_m: Positive = 2.1  # m, free height under its lintel [ours]
    second_door_share: Share = 0.5  # 0 to 1, share of dividing walls with a second door [ours]
    furniture_per_m2: Annotated[float, between(0, 5)] = 0.2  # 1/m², pieces along the walls [ours]
    table_share: Share = 0.6  # 0 to 1, share of rooms with a table, chairs and a lamp [ours]

    def __post_init__(self) -> None:
        indoor.Indoor.__post_init__(self)
        require(
            self.door_width_m >= 2.0 * self.clearance_m,
            f"door_width_m must be at least twice clearance_m, {2.0 * self.clearance_m:g} m, "
            f"got {self.door_width_m}",
        )
        least = self.door_width_m + 2.0 * DOOR_CORNER_M
        require(
            self.room_m >= least, f"room_m must be at least {least:g} m to hold a door, got {self.room_m}"
        )

    def furnish(self, boxes: Boxes, rng: np.random.Generator) -> None:
        """Divide the floor into rooms with doors and put furniture into them."""
        whole = Room(low=(0.0, 0.0), high=(self.size_m[0], self.size_m[1]))
        doors: list[tuple[float, float, float]] = []
        rooms = self._split(boxes, rng, whole, doors)
        for room in rooms:
            taken = list(doors)
            if rng.random() < self.table_share and min(room.sides) > 3.0:
                self._table_group(boxes, rng, room, taken)
            for _ in range(round(self.furniture_per_m2 * room.sides[0] * room.sides[1])):
                _against_wall(boxes, rng, room, taken)

    def _split(
        self, boxes: Boxes, rng: np.random.Generator, room: Room, doors: list[tuple[float, float, float]]
    ) -> list[Room]:
        """Halve a room by a wall across its longer side until the halves would be too small."""
        axis = 0 if room.sides[0] * rng.uniform(0.8, 1.25) > room.sides[1] else 1
        if room.sides[axis] < 2.0 * self.room_m + PARTITION_M:
            axis = 1 - axis
        if room.sides[axis] < 2.0 * self.room_m + PARTITION_M:
            return [room]
        reach = room.sides[axis] - 2.0 * self.room_m - PARTITION_M
        at = room.low[axis] + self.room_m + rng.random() * reach
        first_high, second_low = list(room.high), list(room.low)
        first_high[axis], second_low[axis] = at, at + PARTITION_M
        first = Room(low=room.low, high=(first_high[0], first_high[1]))
        second = Room(low=(second_low[0], second_low[1]), high=room.high)
        # the halves are split first: a door must not open onto the end of a later wall
        rooms = self._split(boxes, rng, first, doors) + self._split(boxes, rng, second, doors)
        self._wall(boxes, rng, rooms, axis, at, room, doors)
        return rooms

    def _wall(
        self,
        boxes: Boxes,
        rng: np.random.Generator,
        rooms: list[Room],
        axis: int,
        at: float,
        room: Room,
        doors: list[tuple[float, float, float]],
    ) -> None:
        """The wall across `axis` at `at` through `room`, with doors where it joins two rooms."""
        side = 1 - axis
        need = self.door_width_m + 2.0 * DOOR_CORNER_M
        shared = []
        for a in rooms:
            for b in rooms:
                low, high = max(a.low[side], b.low[side]), min(a.high[side], b.high[side])
                faces = a.high[axis] == at and b.low[axis] == at + PARTITION_M
                if faces and high - low >= need:
                    shared.append((low, high))
        count = 1 + int(len(shared) > 1 and rng.random() < self.second_door_share)
        chosen = sorted(rng.permutation(len(shared))[:count])
        begin, height = room.low[side], self.size_m[2]
        pieces = []
        for n in chosen:
            low, high = shared[n]
            door = low + DOOR_CORNER_M + rng.random() * (high - low - need)
            pieces.append((begin, door, 0.0))
            pieces.append((door, door + self.door_width_m, self.door_height_m))
            begin = door + self.door_width_m
            middle = np.empty(2)
            middle[axis], middle[side] = at + 0.5 * PARTITION_M, door + 0.5 * self.door_width_m
            doors.append((float(middle[0]), float(middle[1]), DOOR_KEEP_M))
        pieces.append((begin, room.high[side], 0.0))
        for low, high, base in pieces:
            corners = np.empty((2, 2))
            corners[:, axis] = at, at + PARTITION_M
            corners[:, side] = low, high
            boxes.span((*corners[0], base), (*corners[1], height))

    def _table_group(
        self, boxes: Boxes, rng: np.random.Generator, room: Room, taken: list[tuple[float, float, float]]
    ) -> None:
        """A table near the middle of a room, up to four chairs, a lamp hanging over it."""
        share = rng.uniform(0.35, 0.65, 2)
        x, y = (low + s * side for low, s, side in zip(room.low, share, room.sides, strict=True))
        yaw = 0.5 * np.pi * rng.integers(2) + rng.normal(0.0, 0.08)
        seats, drop = rng.integers(1, 5), rng.uniform(0.5, 0.9)
        if not indoor.apart(x, y, taken, 0.5):
            return
        taken.append((x, y, 1.1))
        boxes.place(x, y, yaw, TABLE)
        for n in range(seats):
            local = np.array([(-0.4, 0.4, -0.4, 0.4)[n], (-0.6, -0.6, 0.6, 0.6)[n]])
            local += rng.normal(0.0, 0.06, 2)
            c, s = np.cos(yaw), np.sin(yaw)
            facing = 0.5 * np.pi if local[1] < 0.0 else -0.5 * np.pi
            boxes.place(x + c * local[0] - s * local[1], y + s * local[0] + c * local[1], yaw + facing, CHAIR)
        height = self.size_m[2]
        boxes.stand(x, y, (0.45, 0.45, 0.2), yaw, height - drop)
        boxes.stand(x, y, (0.03, 0.03, drop - 0.2), yaw, height - drop + 0.2)


def _against_wall(
    boxes: Boxes, rng: np.random.Generator, room: Room, taken: list[tuple[float, float, float]]
) -> None:
    """One piece with its back to one of the room's walls; none where doors or pieces are near."""
    kind, wall, along = int(rng.integers(len(AGAINST_WALL))), int(rng.integers(4)), rng.random()
    piece = AGAINST_WALL[kind]
    deep, long = max(part[3] for part in piece), max(part[4] for part in piece)
    axis, far = wall // 2, wall % 2 == 1  # walls at low x, high x, low y, high y
    side = 1 - axis
    if room.sides[side] < long + 0.1:
        return
    at = np.empty(2)
    at[axis] = room.high[axis] - 0.5 * deep - 0.02 if far else room.low[axis] + 0.5 * deep + 0.02
    at[side] = room.low[side] + 0.5 * long + along * (room.sides[side] - long)
    if not indoor.apart(at[0], at[1], taken, 0.5 * long):
        return
    taken.append((float(at[0]), float(at[1]), 0.5 * long))
    yaw = 0.5 * np.pi * axis + (np.pi if far else 0.0)
    boxes.place(at[0], at[1], yaw, piece)
