"""A planner that breaks a promise is told which, and by how much."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from uavexp.check.promise import breach, promises
from uavexp.check.requests import quintic
from uavexp.field import OCCUPIED
from uavexp.trajectory import Trajectory
from uavexp.types import Limits, PlanRequest, PlanResult, PlanStatus

SLOW_S = 12.0
REFUSED = PlanResult(status=PlanStatus.NOT_CLEAR, reason="something is mapped")


def answer(trajectory: Trajectory) -> PlanResult:
    return PlanResult(status=PlanStatus.OK, trajectory=trajectory)


def honest(request: PlanRequest, asked: int) -> PlanResult:
    """Fly slowly where nothing is mapped and refuse everywhere else."""
    return REFUSED if (request.field.state == OCCUPIED).any() else answer(quintic(request, SLOW_S))


@dataclass
class Planner:
    """Answers as told; `asked` counts the requests of a trial."""

    answers: Callable[[PlanRequest, int], PlanResult]
    asked: int = 0

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        self.asked = 0

    def plan(self, request: PlanRequest) -> PlanResult:
        self.asked += 1
        return self.answers(request, self.asked)


def fast(request: PlanRequest, asked: int) -> PlanResult:
    return honest(request, asked) if asked > 1 else answer(quintic(request, 2.0))


def blind(request: PlanRequest, asked: int) -> PlanResult:
    return answer(quintic(request, SLOW_S))


def short(request: PlanRequest, asked: int) -> PlanResult:
    nearer = replace(request.goal, position_m=request.goal.position_m - [0.2, 0.0, 0.0])
    return honest(replace(request, goal=nearer), asked)


def restless(request: PlanRequest, asked: int) -> PlanResult:
    result = honest(request, asked)
    return answer(replace(result.trajectory, at_rest=False)) if result.trajectory else result


def late(request: PlanRequest, asked: int) -> PlanResult:
    return honest(replace(request, time_s=request.time_s + 0.5), asked)


def from_rest(request: PlanRequest, asked: int) -> PlanResult:
    return honest(replace(request, velocity_mps=np.zeros(3)), asked)


def jumping(request: PlanRequest, asked: int) -> PlanResult:
    """To rest at the goal, and from there on as if it stood 0.1 m higher."""
    first = quintic(request, SLOW_S)
    up = np.zeros((1, 6, 3))
    up[0, 0] = np.add(request.goal.position_m, [0.0, 0.0, 0.1])
    pieces = np.concatenate([first.coefficients, up])
    twice = replace(first, breaks_s=np.append(first.breaks_s, first.end_s + 1.0), coefficients=pieces)
    return answer(twice) if honest(request, asked).trajectory else REFUSED


def climbing(request: PlanRequest, asked: int) -> PlanResult:
    return honest(replace(request, velocity_mps=np.array([0.0, 0.0, 2.0])), asked)


def tired(request: PlanRequest, asked: int) -> PlanResult:
    return PlanResult(status=PlanStatus.SOLVER, reason="tired")


def silent(request: PlanRequest, asked: int) -> PlanResult:
    return replace(honest(request, asked), reason="")


def raising(request: PlanRequest, asked: int) -> PlanResult:
    raise ZeroDivisionError("no such luck")


def gambling(request: PlanRequest, asked: int) -> PlanResult:
    np.random.random()  # noqa: NPY002
    return honest(request, asked)


def writing(request: PlanRequest, asked: int) -> PlanResult:
    request.field.distance[0, 0, 0] += 1.0
    return honest(request, asked)


def learning(request: PlanRequest, asked: int) -> PlanResult:
    return replace(honest(request, asked), iterations=asked)


def homesick(request: PlanRequest, asked: int) -> PlanResult:
    return answer(quintic(request, 12.0 + 0.1 * request.position_m[0]))


Answers = Callable[[PlanRequest, int], PlanResult]


def broken(answers: Answers, promise: str) -> str:
    def make() -> Planner:
        return Planner(answers)

    return breach(promises("planner")[promise], make)


@pytest.mark.parametrize("promise", promises("planner"))
def test_an_honest_planner_that_refuses_all_that_is_hard_breaks_none(promise: str) -> None:
    assert broken(honest, promise) == ""


@pytest.mark.parametrize(
    ("answers", "promise", "how"),
    [
        (fast, "keeps the speed limit", r"5\.\d+ m/s at 13.34 s of request 0, limit 2.5 m/s"),
        (fast, "keeps the acceleration limit", "m/s² at .* s of request 0, limit 2.5 m/s²"),
        (blind, "keeps clear of what is mapped", "m from an obstacle at .* the body's radius is 0.226 m"),
        (blind, "refuses what cannot be flown", "a start inside a wall is answered with a plan"),
        (short, "ends at the goal", "end of request 0 is 0.2 m from the one asked for"),
        (restless, "ends at the goal", "request 0 leads to the target but not to rest"),
        (late, "begins in the state it is asked from", "request 0 begins 0.5 s after the time asked for"),
        (
            from_rest,
            "begins in the state it is asked from",
            "velocity of request 2 is 0.592 m/s from",
        ),
        (jumping, "never jumps", "a jump by 0.1 m at 24.34 s of request 0"),
        (climbing, "stays within the flight bounds", "m outside at .* s of request 0"),
        (tired, "finds a way where nothing is mapped", "request 0, through empty space, is refused: tired"),
        (silent, "answers every request with a plan or a reason", "request 3 is refused without a reason"),
        (raising, "keeps the speed limit", "it raised ZeroDivisionError: no such luck"),
        (
            gambling,
            "answers every request with a plan or a reason",
            "it drew from the global generator of numpy",
        ),
        (
            writing,
            "writes into nothing it is given",
            "it raised ValueError: assignment destination is read-only",
        ),
        (learning, "gives the same plan whatever was asked before", "request 0 is answered otherwise"),
        (homesick, "moves along with a shifted world", "m aside in a hall that stands elsewhere"),
    ],
)
def test_a_broken_promise_is_told_by_how_much(answers: Answers, promise: str, how: str) -> None:
    assert re.search(how, broken(answers, promise))
