"""One search by a planner of OMPL, in this process.

The search sees what the project's own planners see: the same free space, every edge checked by the
same `straight_is_free`, called from OMPL through Python. It runs in the axes of `informed.Region`, so a
turned world gives a turned path. Its budget is iterations, as OMPL counts them for that planner.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

from uavexp.arrays import Float
from uavexp.planner.find.batch_tree.informed import sampled_region
from uavexp.planner.find.free_space import FreeSpace, look, straight_is_free


class Query(NamedTuple):
    """One search."""

    planner: str  # class in `ompl.geometric`
    settings: dict[str, float]  # of its setters
    space: FreeSpace
    seed: int
    iterations: int


class Solved(NamedTuple):
    """What it found."""

    path: Float  # (P, 3) from start to goal; empty: nothing
    history: Float  # (K, 4) iteration, best cost m, processor s and looks at the map, whenever the cost fell
    iterations: int
    checks: int  # looks at the map
    cpu_s: float  # of the search alone


def solve(query: Query) -> Solved:
    """Run a search in this process, which must not have used OMPL's random numbers before."""
    import ompl.base as ob
    import ompl.util as ou

    ou.noOutputHandler()
    ou.RNG.setSeed(query.seed)
    map_ = _Map(query.space)
    information = _information(map_)
    problem = ob.ProblemDefinition(information)
    start, goal = (map_.state(information.getStateSpace(), end_m) for end_m in query.space.ends_m)
    problem.setStartAndGoalStates(start, goal)
    problem.setOptimizationObjective(ob.PathLengthOptimizationObjective(information))
    planner = _planner(query, information, problem)
    map_.is_free(start)  # loads the kernels before the clock starts
    map_.is_way_free(start, start)
    map_.checks = 0
    history: list[tuple[float, float, float, float]] = []
    began_s = time.process_time()

    def is_over() -> bool:
        cost = planner.bestCost().value()
        if np.isfinite(cost) and (not history or cost < history[-1][1]):
            history.append((planner.numIterations(), cost, time.process_time() - began_s, map_.checks))
        return bool(planner.numIterations() >= query.iterations)

    planner.solve(ob.PlannerTerminationCondition(is_over))
    is_over()
    cpu_s = time.process_time() - began_s
    path = np.zeros((0, 3))
    if problem.hasExactSolution():
        path = np.array([map_.place(state) for state in problem.getSolutionPath().getStates()])
        path[0], path[-1] = query.space.ends_m
    return Solved(path, np.array(history).reshape(-1, 4), planner.numIterations(), map_.checks, cpu_s)


class _Map:
    """The free space in the region's axes; counts the looks at it."""

    def __init__(self, space: FreeSpace) -> None:
        self.space, self.region, self.checks = space, sampled_region(space, *space.ends_m, np.inf), 0

    def is_free(self, state: Any) -> bool:
        """Whether a state is free."""
        self.checks += 1
        return bool(look(self.space, *self.place(state))[0])

    def is_way_free(self, a: Any, b: Any) -> bool:
        """Whether the straight way between two states is free."""
        free, looks = straight_is_free(self.space, np.array(self.place(a)), np.array(self.place(b)))
        self.checks += looks
        return bool(free)

    def place(self, state: Any) -> tuple[float, float, float]:
        """World position of a state."""
        x, y, z = state[0], state[1], state[2]
        region, origin = self.region, self.region.origin_m
        return (
            origin[0] + region.cosine * x - region.sine * y,
            origin[1] + region.sine * x + region.cosine * y,
            origin[2] + z,
        )

    def state(self, volume: Any, point_m: Float) -> Any:
        """State of a world position (3,)."""
        region, state = self.region, volume.allocState()
        step = point_m - region.origin_m
        state[0] = float(region.cosine * step[0] + region.sine * step[1])
        state[1] = float(region.cosine * step[1] - region.sine * step[0])
        state[2] = float(step[2])
        return state


def _information(map_: _Map) -> Any:
    """OMPL's view of the map."""
    import ompl.base as ob

    class Validator(ob.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:
            return map_.is_way_free(a, b)

    volume, box = ob.RealVectorStateSpace(3), ob.RealVectorBounds(3)
    for axis in range(3):
        box.setLow(axis, float(map_.region.low_m[axis]))
        box.setHigh(axis, float(map_.region.high_m[axis]))
    volume.setBounds(box)
    information = ob.SpaceInformation(volume)
    information.setStateValidityChecker(map_.is_free)
    information.setMotionValidator(Validator(information))
    information.setup()
    return information


def _planner(query: Query, information: Any, problem: Any) -> Any:
    """OMPL's planner with its settings, ready to solve the problem."""
    import ompl.geometric as og

    planner = getattr(og, query.planner)(information)
    for name, value in query.settings.items():
        getattr(planner, name)(value)
    planner.setProblemDefinition(problem)
    planner.setup()
    return planner
