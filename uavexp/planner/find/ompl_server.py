"""OMPL's own planners, each search in a process of its own.

OMPL has one random generator per process, which can be seeded once. So a server process imports it and
loads the kernels, and forks a child for every request: the same seed and number of iterations give the
same path, whatever was asked before. The server reads requests from its standard input; when that
ends, its parent is gone or done, and it ends too, with the child it has.
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
from typing import IO, Any

import numpy as np

from uavexp.errors import ConfigError
from uavexp.field import DistanceField
from uavexp.planner.find.batch_tree.informed import sampled_region
from uavexp.planner.find.free_space import free_space, look, straight_is_free
from uavexp.planner.find.ompl_search import Query, Solved, solve

_LENGTH_BYTES = 8


def search_with_ompl(query: Query) -> Solved:
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
    if not isinstance(answer, Solved):
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
    """Solved the queries of standard input, one at a time, until it ends."""
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
