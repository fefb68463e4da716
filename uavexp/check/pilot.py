"""What every pilot promises, with a crew that plans slow flights through an empty hall."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from uavexp.arrays import Float
from uavexp.check.fields import bounds, empty, field_from
from uavexp.check.hall import LIMITS, hovering, observe
from uavexp.check.promise import Make, keep
from uavexp.check.requests import quintic
from uavexp.field import DistanceField
from uavexp.pilot.base import Crew, Piloting
from uavexp.recorder import Stopwatch
from uavexp.safety.base import Unguarded
from uavexp.trajectory import Trajectory
from uavexp.types import Decision, Goal, Observation, PlanRequest, PlanResult, PlanStatus, Reference

_STEP_S, _LATENCY_S = 0.01, 0.03  # not exact in binary: a plan may start a rounding after its step
_START_M, _TARGET_M = np.array([1.0, 2.0, 1.0]), np.array([9.0, 2.5, 1.2])
_FIELD = field_from(empty((10.0, 4.0, 2.0)))
_SLOW_S = 12.0  # of each plan: far from every limit
_SPARE = 1.01  # of a limit, by which a reference may exceed it between two steps


@dataclass(slots=True)
class _Crew:
    """Explorer, trigger, and planner in one: the target, every `period_s`, by quintics."""

    period_s: float = np.inf
    refuses: Callable[[float], bool] = lambda time_s: False
    rate_hz: float = 5.0
    explores: ClassVar[bool] = False
    last_s: float = 0.0

    def reset(self, *_: Any) -> None:
        """Begin a trial: nothing to forget, it is built for one."""

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        """The target."""
        return Goal(position_m=_TARGET_M, is_target=True, score=0.0)

    def reject(self, position_m: Float, time_s: float) -> None:
        """Set nothing aside: the target is all there is."""

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Take note of nothing."""

    def decide(self, observation: Observation) -> Decision:
        """Replan when the period is over."""
        if observation.time_s - self.last_s < self.period_s:
            return Decision(replan=False)
        self.last_s = observation.time_s
        return Decision(replan=True, cause="clock")

    def plan(self, request: PlanRequest) -> PlanResult:
        """A slow quintic, unless told to refuse."""
        if self.refuses(request.time_s):
            return PlanResult(status=PlanStatus.NO_PATH, reason="asked to refuse")
        return PlanResult(status=PlanStatus.OK, trajectory=quintic(request, _SLOW_S))


def _flown(make: Make, crew: _Crew, duration_s: float = 6.0) -> tuple[Piloting, list[Reference]]:
    """A flight that is tracked exactly: 100 references, 10 ESDF updates and 5 goals a second."""
    pilot: Piloting = make().begin(
        Crew(
            explorer=crew,
            trigger=crew,
            planner=crew,
            guard=Unguarded(),
            limits=LIMITS,
            latency_s=_LATENCY_S,
            start_m=_START_M,
            start_yaw_rad=0.0,
            flight_bounds_m=bounds(_FIELD.state),
            watch=Stopwatch(),
        )
    )
    references = []
    for step in range(round(duration_s / _STEP_S)):
        references.append(pilot.reference(step * _STEP_S, _STEP_S))
        if step % 10 == 0:
            seen = _seen(pilot, step * _STEP_S, references[-1])
            if step % 20 == 0:
                pilot.explore(seen)
            pilot.decide(_seen(pilot, step * _STEP_S, references[-1]))
    return pilot, references


def _seen(pilot: Piloting, time_s: float, reference: Reference) -> Observation:
    state = replace(hovering(reference.position_m, reference.yaw_rad), velocity_mps=reference.velocity_mps)
    return replace(
        observe(_FIELD, time_s=time_s, goal=pilot.goal, best=pilot.best_goal),
        state=state,
        reference=reference,
        trajectory=pilot.trajectory,
        target_m=_TARGET_M,
        flight_bounds_m=bounds(_FIELD.state),
    )


def hovers_at_the_start_without_a_plan(make: Make) -> None:
    """However often it asks for one."""
    pilot, references = _flown(make, _Crew(refuses=lambda time_s: True))
    away_m = max(float(np.linalg.norm(one.position_m - _START_M)) for one in references)
    keep(away_m < 1e-9, f"without a plan its reference goes {away_m:.3g} m from the start")
    keep(not pilot.ever_planned, "it says that there was a plan")


def sets_off_with_the_first_plan(make: Make) -> None:
    """In 6 s of a slow plan it is under way, and it keeps that plan while nobody asks for another."""
    pilot, references = _flown(make, _Crew())
    keep(pilot.ever_planned and pilot.first_plan is not None, "after 6 s there is no first plan")
    moved_m = float(np.linalg.norm(references[-1].position_m - _START_M))
    keep(moved_m > 0.5, f"after 6 s of a plan of {_SLOW_S:g} s it is {moved_m:.2f} m from the start")
    keep(len(pilot.replans) == 1, f"it made {len(pilot.replans)} requests, nobody asked for a second")


def moves_its_reference_without_a_jump(make: Make) -> None:
    """Through replans, and through a plan that fails and the stop that follows."""
    for crew in (_Crew(period_s=0.7), _Crew(period_s=0.7, refuses=lambda time_s: time_s > 3.0)):
        _, references = _flown(make, crew)
        for unit, name, limit in (
            ("m", "position_m", LIMITS.max_speed_mps),
            ("m/s", "velocity_mps", LIMITS.max_acceleration_mps2),
        ):
            steps = np.linalg.norm(np.diff([getattr(one, name) for one in references], axis=0), axis=1)
            worst = int(np.argmax(steps))
            keep(
                steps[worst] <= _SPARE * limit * _STEP_S,
                f"{name} jumps by {steps[worst]:.3g} {unit} at {(worst + 1) * _STEP_S:.2f} s",
            )


def turns_no_faster_than_the_vehicle(make: Make) -> None:
    """The heading, from step to step."""
    _, references = _flown(make, _Crew(period_s=0.7))
    turns = np.diff(np.unwrap([one.yaw_rad for one in references])) / _STEP_S
    fastest = float(np.abs(turns).max())
    keep(
        fastest <= _SPARE * LIMITS.max_body_rate_radps,
        f"it turns at {fastest:.3f} rad/s, the vehicle at {LIMITS.max_body_rate_radps:g} rad/s",
    )


def notes_every_request_and_its_cause(make: Make) -> None:
    """In order; a plan takes over no earlier than its latency allows, one that failed never."""
    pilot, _ = _flown(make, _Crew(period_s=0.7, refuses=lambda time_s: 3.0 < time_s < 4.0))
    asked_s = [one.time_s for one in pilot.replans]
    keep(asked_s == sorted(asked_s), f"its requests are noted out of order: {asked_s}")
    for one in pilot.replans:
        at = f"the request of {one.time_s:.2f} s"
        keep(one.cause != "", f"{at} has no cause")
        if one.status is PlanStatus.OK:
            late_s = one.effective_s - one.time_s
            keep(late_s >= _LATENCY_S - 1e-9, f"{at} takes effect after {late_s:.3f} s of {_LATENCY_S} s")
        else:
            keep(np.isnan(one.effective_s), f"{at} failed and takes effect at {one.effective_s:.2f} s")
