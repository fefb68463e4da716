"""Towards the target along the way of least expected cost over what is known and what is not.

Each cell of the planar map has a price in metres a metre flown: 1 where it is known to be free,
`narrow_cost` where the body fits but barely, and for space never seen what is to be expected there:
`unknown_cost`, rising to `wall_cost` at walls that were seen, for more of them may stand there. The goal
lies on the cheapest way from the vehicle to the target, up to `beyond_m` behind the place where it
enters the unknown, so that coming there is no event; where it leads over known cells alone, the goal is
the target. This is the assumption of D* Lite (Koenig and Likhachev 2002) with expected prices [ours].

A goal is kept until it is nearer than `commit_m`, or another way is cheaper by more than `hysteresis`.
Without a target, and where no way is left, goals are those of `Frontier`, whose parameters hold there.
"""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, ClassVar

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.explorer.frontier import Frontier
from uavexp.explorer.view import Cell, Passage, Plane, prices
from uavexp.field import UNKNOWN
from uavexp.parameters import NonNegative, Positive, Unknown, between, option
from uavexp.types import Goal, Limits, Observation

_OPEN = "over all that is not known to be closed"  # the passage of ways to the target
_ROUNDING = 0.05  # of costs of ways, cells
_TRIES = 4  # places where ways enter the unknown that one choice may set aside


@option
class ExpectedPath(Frontier):
    """Goals on the way of least expected cost; see the module docstring."""

    explores: ClassVar[bool] = True
    unknown_cost: Annotated[float, between(1, 5)] = (
        1.0  # an unknown cell counts as so many free ones ... [ours]
    )
    wall_cost: Annotated[float, between(1, 5)] = 3.0  # ... and as so many at a wall that was seen ... [ours]
    wall_m: Positive = 0.8  # m, ... less with the distance from it, up to here [ours]
    narrow_cost: Annotated[float, between(1, 5)] = 4.0  # a known cell with less than min_clearance_m counts
    # as so many free ones [ours]
    beyond_m: NonNegative = 2.0  # m, goals lie so far behind the place where their way enters the unknown
    # [ours]
    hysteresis: NonNegative = 1.0  # m, by which another way must be cheaper before the goal is reached [ours]
    _entry: Cell | None = field(init=False, repr=False, default=None)  # where the way enters the unknown

    def reset(self, flight_height_m: float, limits: Limits) -> None:
        """Begin a trial at this flight height."""
        Frontier.reset(self, flight_height_m, limits)
        self._entry = None

    def reject(self, position_m: Float, time_s: float) -> None:
        """Set this goal aside for `set_aside_s`, and the place where its way enters the unknown."""
        if self._entry is not None and self._plane is not None:
            self._shut(self._entry, self._plane, time_s)
        self._entry = None
        Frontier.reject(self, position_m, time_s)

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        """Return g*, or None when neither the target nor any frontier is reachable.

        With `fresh` the kept goal has no bonus: a plan is made anyway, so the best goal is taken.
        """
        if observation.target_m is not None:
            self._aside = [entry for entry in self._aside if entry[0] > observation.time_s]
            passage = self._open_ways(observation, observation.target_m)
            if self._keeps(passage, observation, 0.0 if fresh else self.hysteresis):
                return self._current
            for _ in range(_TRIES):
                goal, self._entry = self._on_the_way(passage, observation, observation.target_m)
                if goal is not None:
                    self._current = goal
                    return goal
                if self._entry is None:
                    break
                # A frontier still unknown from so near cannot be seen from here.
                self._shut(self._entry, passage.plane, observation.time_s)
                passage = self._open_ways(observation, observation.target_m)
        self._entry = None
        return Frontier.select(self, observation, fresh=fresh)

    def _shut(self, entry: Cell, plane: Plane, time_s: float) -> None:
        """Let no way enter the unknown there for a while."""
        self._aside.append((time_s + self.set_aside_s, self._point_m(plane, entry)))

    def _point_m(self, plane: Plane, cell: Cell | Int) -> Float:
        return np.append(plane.map.centre_m(np.array(cell, dtype=np.float64)), self._height_m)

    def _open_ways(self, observation: Observation, target_m: Float) -> Passage:
        """Ways to the target over all that is not known to be closed, up to date."""
        plane = self._look(observation)
        target, passage = plane.map.cell_of(target_m), self._passages.get(_OPEN)
        if passage is None or passage.target != target:
            passage = self._passages[_OPEN] = Passage(
                plane=plane,
                clearance_m=min(self.narrow_clearance_m or self.min_clearance_m, self.min_clearance_m),
                escape_m=self.escape_m,
                target=target,
                wall_m=self.wall_m,
                target_price=prices(self.unknown_cost, self.narrow_cost, self.wall_cost),
            )
        passage.close(
            [plane.map.cell_of(point) for _, point in self._aside], self.aside_radius_m / self.cell_m
        )
        passage.update(plane.map.cell_of(observation.state.position_m))
        return passage

    def _keeps(self, passage: Passage, observation: Observation, bonus: float) -> bool:
        """Whether the current goal is still ahead, and no way cheaper by the bonus than the one over it."""
        goal = self._current
        if (
            goal is None
            or goal.is_target
            or self._entry is None
            or self._is_near(goal.position_m, observation)
        ):
            return False
        if float(observation.field.distance_m(goal.position_m[None])[0]) <= self.min_clearance_m:
            return False
        cell = passage.plane.map.cell_of(goal.position_m)
        most = passage.from_target(passage.vehicle) + bonus / self.cell_m + _ROUNDING
        passage.begin(passage.target_price)
        return passage.from_vehicle(cell) + passage.from_target(cell) <= most

    def _is_near(self, point_m: Float, observation: Observation) -> bool:
        return float(np.linalg.norm(point_m - observation.state.position_m)) <= self.commit_m

    def _on_the_way(
        self, passage: Passage, observation: Observation, target_m: Float
    ) -> tuple[Goal | None, Cell | None]:
        """Goal on the cheapest way, and where that enters the unknown; no goal: too near; neither: no way."""
        way, map_ = passage.way_to_target(passage.vehicle), passage.plane.map
        if not len(way):
            return None, None
        score = -passage.from_target(passage.vehicle) * self.cell_m
        unknown = np.flatnonzero(map_.state[way[:, 0], way[:, 1]] == UNKNOWN)
        first = int(unknown[0]) if unknown.size else len(way)
        gone_m = self.cell_m * np.append(0.0, np.linalg.norm(np.diff(way, axis=0), axis=1).cumsum())
        entry = (int(way[first, 0]), int(way[first, 1])) if unknown.size else None
        optimistic = self.unknown is Unknown.OPTIMISTIC
        if entry is None or (optimistic and gone_m[-1] <= gone_m[first] + self.beyond_m):
            return Goal(position_m=target_m, is_target=True, score=score), entry
        carried = (
            way[first:][gone_m[first:] <= gone_m[first] + self.beyond_m] if optimistic else way[:first][-1:]
        )
        goal_m = self._roomiest(passage.plane, observation, carried)
        return None if goal_m is None else Goal(position_m=goal_m, is_target=False, score=score), entry

    def _roomiest(self, plane: Plane, observation: Observation, cells: Int) -> Float | None:
        """The last of the cells (N, 2) with room enough, else the one with most; None: all are near."""
        centres_m = plane.map.centre_m(cells.astype(np.float64))
        far = np.linalg.norm(centres_m - observation.state.position_m[:2], axis=1) > self.commit_m
        if not far.any():
            return None
        room_m = np.where(far, plane.map.clearance[cells[:, 0], cells[:, 1]], -np.inf)
        enough = np.flatnonzero(room_m >= self.enough_clearance_m)
        return self._point_m(plane, cells[enough[-1] if enough.size else np.argmax(room_m)])
