"""OMPL's own planners, each search in a process of its own.

OMPL has one random generator per process, which can be seeded once. So a server process imports it and
loads the kernels, and forks a child for every request: the same seed and number of iterations give the
same path, whatever was asked before. The server reads requests from its standard input; when that
ends, its parent is gone or done, and it ends too, with the child it has.

The search sees what the project's own planners see: the same free space, every edge checked by the
same `straight_is_free`, called from OMPL through Python. It runs in the axes of `informed.Region`, so a
turned world gives a turned path. Its budget is iterations, as OMPL counts them for that planner.
"""

from __future__ import annotations

import atexit
import functools
import importlib.util
import os
import pickle
import select
import signal
import subprocess
import sys
import time
from typing import IO, Any, NamedTuple

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import ConfigError
from uavexp.field import DistanceField
from uavexp.planner.find.batch_tree.informed import Region, sampled_region
from uavexp.planner.find.free_space import FreeSpace, free_space, look, straight_is_free

_LENGTH_BYTES = 8


class Query(NamedTuple):
    """One search."""

    planner: str  # class in `ompl.geometric`
    settings: dict[str, float]  # of its setters
    space: FreeSpace
    seed: int
    iterations: int


class Answer(NamedTuple):
    """What it found."""

    path: Float  # (P, 3) from start to goal; empty: nothing
    history: Float  # (K, 4) iteration, best cost m, processor s and looks at the map, whenever the cost fell
    iterations: int
    checks: int  # looks at the map
    cpu_s: float  # of the search alone


def search_with_ompl(query: Query) -> Answer:
    """Run one search and wait for its answer.

    Raises:
        ConfigError: when OMPL is not installed.
        RuntimeError: when the search died; its last words are in the message.
    """
    if importlib.util.find_spec("ompl") is None:
        raise ConfigError("OMPL is not installed: pip install 'uavexp[peers]'")
    server = _server()
    if server.poll() is not None or server.stdin is None or server.stdout is None:
        _server.cache_clear()
        return search_with_ompl(query)
    _write(server.stdin, query)
    answer = _read(server.stdout)
    if not isinstance(answer, Answer):
        raise RuntimeError(f"OMPL's {query.planner} failed: {answer}")
    return answer


@functools.cache
def _server() -> subprocess.Popen[bytes]:
    """The server of this process, started when first needed."""
    server = subprocess.Popen(
        [sys.executable, "-c", "from uavexp.planner.find.ompl_server import serve; serve()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    atexit.register(_end, server)
    return server


def _end(server: subprocess.Popen[bytes]) -> None:
    for pipe in (server.stdin, server.stdout):
        if pipe is not None:
            pipe.close()
    server.wait()


def _write(pipe: IO[bytes], thing: object) -> None:
    body = pickle.dumps(thing)
    pipe.write(len(body).to_bytes(_LENGTH_BYTES, "big") + body)
    pipe.flush()


def _read(pipe: IO[bytes]) -> object:
    """Next thing of a pipe; None at its end."""
    head = pipe.read(_LENGTH_BYTES)
    if len(head) < _LENGTH_BYTES:
        return None
    return pickle.loads(pipe.read(int.from_bytes(head, "big")))


def serve() -> None:
    """Answer the queries of standard input, one at a time, until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal's Ctrl-C is the parent's to handle
    queries, answers = os.fdopen(0, "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what OMPL prints is no answer
    _warm_up()
    while (query := _read(queries)) is not None:
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            _answer(query, os.fdopen(writing, "wb"))
        os.close(writing)
        with os.fdopen(reading, "rb") as pipe:
            ended = select.select([queries, pipe], [], [])[0]
            if queries in ended:  # nobody asks twice: it is closed
                os.kill(child, signal.SIGKILL)
                return
            answer = _read(pipe)
        status = os.waitpid(child, 0)[1]
        _write(answers, answer if answer is not None else f"ended with status {status}")


def _warm_up() -> None:
    """Import OMPL and load the kernels, so that no child has to; draws no random number."""
    import ompl.base
    import ompl.geometric
    import ompl.util  # noqa: F401

    nowhere, box = np.zeros(3), np.ones((2, 3))
    field = DistanceField(
        origin_m=nowhere,
        voxel_size_m=1.0,
        max_distance_m=1.0,
        distance=np.ones((2, 2, 2), dtype=np.float32),
        state=np.ones((2, 2, 2), dtype=np.uint8),
    )
    space = free_space(field, box, np.stack([nowhere, 2.0 * box[0]]), 0.1, 1.0, False)
    sampled_region(space, nowhere, nowhere, np.inf)
    look(space, 1.0, 1.0, 1.0)
    straight_is_free(space, nowhere, nowhere)


def _answer(query: Any, pipe: IO[bytes]) -> None:
    """Solve and answer in the forked child, which ends here without cleaning up after OMPL."""
    try:
        answer: object = solve(query)
    except Exception as error:  # whatever OMPL raises is told to the parent
        answer = f"{type(error).__name__}: {error}"
    _write(pipe, answer)
    os._exit(0)


def solve(query: Query) -> Answer:
    """Run a search in this process, which must not have used OMPL's random numbers before."""
    import ompl.base as ob
    import ompl.geometric as og
    import ompl.util as ou

    ou.noOutputHandler()
    ou.RNG.setSeed(query.seed)
    space, (start_m, goal_m) = query.space, query.space.ends_m
    region = sampled_region(space, start_m, goal_m, np.inf)
    checks = 0

    def is_free(state: Any) -> bool:
        nonlocal checks
        checks += 1
        return bool(look(space, *_world(region, state))[0])

    class Validator(ob.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:
            nonlocal checks
            free, looks = straight_is_free(space, np.array(_world(region, a)), np.array(_world(region, b)))
            checks += looks
            return bool(free)

    volume = ob.RealVectorStateSpace(3)
    box = ob.RealVectorBounds(3)
    for axis in range(3):
        box.setLow(axis, float(region.low_m[axis]))
        box.setHigh(axis, float(region.high_m[axis]))
    volume.setBounds(box)
    information = ob.SpaceInformation(volume)
    information.setStateValidityChecker(is_free)
    validator = Validator(information)
    information.setMotionValidator(validator)
    information.setup()
    problem = ob.ProblemDefinition(information)
    start, goal = _state(volume, region, start_m), _state(volume, region, goal_m)
    problem.setStartAndGoalStates(start, goal)
    problem.setOptimizationObjective(ob.PathLengthOptimizationObjective(information))
    planner = getattr(og, query.planner)(information)
    for name, value in query.settings.items():
        getattr(planner, name)(value)
    planner.setProblemDefinition(problem)
    planner.setup()
    is_free(start)  # loads the kernels before the clock starts
    validator.checkMotion(start, start)
    checks = 0
    history: list[tuple[float, float, float, float]] = []
    began_s = time.process_time()

    def is_over() -> bool:
        cost = planner.bestCost().value()
        if np.isfinite(cost) and (not history or cost < history[-1][1]):
            history.append((planner.numIterations(), cost, time.process_time() - began_s, checks))
        return bool(planner.numIterations() >= query.iterations)

    planner.solve(ob.PlannerTerminationCondition(is_over))
    is_over()
    cpu_s = time.process_time() - began_s
    path = np.zeros((0, 3))
    if problem.hasExactSolution():
        states = problem.getSolutionPath().getStates()
        path = np.array([_world(region, state) for state in states])
        path[0], path[-1] = start_m, goal_m
    return Answer(path, np.array(history).reshape(-1, 4), planner.numIterations(), checks, cpu_s)


def _world(region: Region, state: Any) -> tuple[float, float, float]:
    """World position of a state in the region's axes."""
    x, y, z = state[0], state[1], state[2]
    origin = region.origin_m
    return (
        origin[0] + region.cosine * x - region.sine * y,
        origin[1] + region.sine * x + region.cosine * y,
        origin[2] + z,
    )


def _state(volume: Any, region: Region, point_m: Float) -> Any:
    """State in the region's axes of a world position (3,)."""
    step, state = point_m - region.origin_m, volume.allocState()
    state[0] = float(region.cosine * step[0] + region.sine * step[1])
    state[1] = float(region.cosine * step[1] - region.sine * step[0])
    state[2] = float(step[2])
    return state
