"""The closed loop, flown for real in small worlds."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import uavexp
from uavexp.config.build import build
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError
from uavexp.geometry import rotation_from_quaternion
from uavexp.planner.find_and_shape import FindAndShape
from uavexp.scene import Scene
from uavexp.trial import steps_per
from uavexp.trigger.tbr import Tbr
from uavexp.types import Decision, Observation, Outcome, PlanRequest, PlanResult, PlanStatus

SMALL: Mapping[str, Any] = {
    "world": "random_columns",
    "world.size_m": [10.0, 7.0, 3.0],
    "world.density_per_m2": 0.15,
}


def fly(**values: Any) -> Any:
    return uavexp.fly(**{**SMALL, "seed": 1, **values})


@pytest.fixture(scope="module")
def flown() -> Any:
    return fly(strategy="mcr")


def test_reaches_the_target_without_contact(flown: Any) -> None:
    assert flown.log.outcome is Outcome.REACHED
    assert flown.metrics["success"] is True
    end_m = flown.log.steps.position_m[-1]
    assert np.linalg.norm(end_m - flown.world.target_m) <= 0.3


def test_goals_are_chosen_at_the_rate_of_the_mission_if_it_chooses_them() -> None:
    rates = [
        build(Composer().command(parse_settings(typed.split())).cells[0].config).tick_steps()[2]
        for typed in (
            "strategy=inspect explorer.rate_hz=10", "strategy=inspect mission.rate_hz=10",
            "strategy=mcr explorer.rate_hz=10",
        )
    ]  # fmt: skip
    assert rates == [20, 10, 10], "steps of 0.01 s"


def test_log_rows_are_one_step_apart_and_begin_at_the_start(flown: Any) -> None:
    log = flown.log
    np.testing.assert_allclose(np.diff(log.steps.time_s), log.step_s)
    np.testing.assert_array_equal(log.steps.position_m[0], flown.world.start_m)
    np.testing.assert_allclose(np.diff(log.ticks.tick_s), 0.1)
    assert (
        len(log.steps.time_s)
        == len(log.steps.position_m)
        == len(log.steps.clearance_m)
        == len(log.steps.reference_position_m)
    )


def test_reference_is_continuous_and_keeps_the_limits(flown: Any) -> None:
    """Replans join with equal position and velocity, whatever their cause."""
    reference_m, step_s = flown.log.steps.reference_position_m, flown.log.step_s
    velocity = np.diff(reference_m, axis=0) / step_s
    assert np.linalg.norm(velocity, axis=1).max() <= 0.96 * 2.5 + 1e-6  # `speed_margin`
    assert np.linalg.norm(np.diff(velocity, axis=0) / step_s, axis=1).max() <= 2.5 * 1.02


def test_clearance_is_the_true_distance(flown: Any) -> None:
    rows = slice(0, None, 97)
    measured = Scene(flown.world).distance_m(flown.log.steps.position_m[rows])
    np.testing.assert_allclose(flown.log.steps.clearance_m[rows], measured, atol=1e-5)


def test_every_replan_names_its_cause_and_takes_effect_after_the_latency(flown: Any) -> None:
    first, *later = flown.log.replans
    assert first.cause == "first"
    for replan in later:
        assert replan.cause in {"map", "goal", "retry"}
    for replan in flown.log.replans:
        if replan.status is PlanStatus.OK:
            assert replan.effective_s - replan.time_s == pytest.approx(0.03)
    executed = [replan for replan in later if replan.status is PlanStatus.OK]
    assert flown.metrics["replans"] == len(executed)


def test_what_is_mapped_is_really_there(flown: Any) -> None:
    """Mapped obstacles lie within a voxel's diagonal and the noise of true surfaces."""
    distance_m = Scene(flown.world).distance_m(flown.log.mapped_m.astype(np.float64))
    assert np.quantile(distance_m, 0.99) < 0.25
    assert len(flown.log.mapped_m) > 500


def test_the_world_is_the_same_under_every_strategy(flown: Any) -> None:
    for strategy in ("tbr", "ssp"):
        assert fly(strategy=strategy).world.digest == flown.world.digest


def test_single_shot_makes_one_plan_and_the_clock_replans_on_time() -> None:
    single = fly(strategy="ssp")
    assert [replan.cause for replan in single.log.replans] == ["first"]
    clock = fly(strategy="tbr", **{"trigger.interval_s": 1.0})
    ticks = [replan.time_s for replan in clock.log.replans if replan.cause == "clock"]
    np.testing.assert_allclose(ticks, np.round(ticks))
    assert len(ticks) == int(clock.log.steps.time_s[-1])


def test_literal_replans_far_more_often(flown: Any) -> None:
    literal = fly(strategy="mcr_literal")
    assert literal.metrics["replans"] > 3 * flown.metrics["replans"]


def test_same_seed_same_bytes_in_a_fresh_process_and_with_other_thread_settings() -> None:
    code = (
        "import uavexp, hashlib, json;"
        f"t = uavexp.fly(strategy='mcr', seed=1, **{dict(SMALL)!r});"
        "print(json.dumps([hashlib.sha256(t.log.steps.position_m.tobytes()).hexdigest(),"
        " len(t.log.replans), t.metrics['min_clearance_m']]))"
    )
    answers = set()
    for threads in ("1", "2"):
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True
        )
        answers.add(json.dumps(json.loads(done.stdout.strip().splitlines()[-1])))
    assert len(answers) == 1


def test_point_mass_brake_drift_and_voxel_blocks_fly_too() -> None:
    trial = fly(
        strategy="mcr",
        vehicle="point_mass",
        safety="brake",
        estimator="drift",
        mapping="voxel_block_grid",
    )
    assert trial.log.outcome is Outcome.REACHED


def test_what_decides_sees_the_estimate_and_the_log_tells_it_from_the_truth(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[tuple[float, Any]] = []

    def decide(self: Tbr, observation: Observation) -> Decision:
        seen.append((observation.time_s, observation.state.position_m.copy()))
        return Decision(replan=False)

    monkeypatch.setattr(Tbr, "decide", decide)
    severe = {"estimator.position_drift_mps": 0.08, "estimator.max_position_drift_mps": 0.2}
    trial = fly(strategy="tbr", estimator="drift", stuck_s=6.0, **severe)
    steps = trial.log.steps
    rows = [round(time_s / trial.log.step_s) for time_s, _ in seen]
    np.testing.assert_array_equal(steps.estimated_position_m[rows], [place_m for _, place_m in seen])
    assert np.linalg.norm(steps.estimated_position_m - steps.position_m, axis=1).max() > 0.1
    test_clearance_is_the_true_distance(trial)
    speed_mps = np.linalg.norm(np.diff(steps.position_m, axis=0), axis=1) / trial.log.step_s
    np.testing.assert_allclose(speed_mps, np.linalg.norm(steps.velocity_mps, axis=1)[1:], atol=0.05)


def test_conservative_planning_never_enters_unseen_space() -> None:
    trial = fly(strategy="mcr", unknown="conservative")
    assert trial.log.outcome in (Outcome.REACHED, Outcome.STUCK, Outcome.NO_PLAN)
    for replan in trial.log.replans:
        assert replan.status is not PlanStatus.SOLVER


def test_exploring_sees_nearly_everything_and_says_how_much() -> None:
    trial = fly(strategy="mcr", mission="explore", **{"world.size_m": [8.0, 6.0, 2.6]})
    assert trial.log.outcome is Outcome.EXPLORED
    assert 0.7 < trial.metrics["seen_share"] <= 1.0


@pytest.mark.parametrize("explorer", ["frontier", "frontier_3d"])
def test_a_vehicle_that_no_plan_leads_away_has_explored_nothing(
    explorer: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every goal is given up in the end; it used to be told as explored."""
    plan = FindAndShape.plan

    def plan_at_first(self: FindAndShape, request: PlanRequest) -> PlanResult:
        return (
            plan(self, request)
            if request.time_s < 2.0
            else PlanResult(status=PlanStatus.NO_PATH, reason="shut")
        )

    monkeypatch.setattr(FindAndShape, "plan", plan_at_first)
    trial = fly(strategy="mcr", mission="explore", explorer=explorer, **{"world.size_m": [20.0, 12.0, 2.6]})
    assert trial.log.outcome is Outcome.STUCK
    assert trial.log.reason.startswith("no plan led anywhere: no_path: shut")


def test_a_body_that_flies_into_walls_touches_but_never_passes_through() -> None:
    """Single shot at the target through unknown space: contacts happen, overlap does not."""
    trial = uavexp.fly(strategy="ssp", seed=0, world="rooms", stuck_s=3.0)
    assert trial.metrics["collision_count"] > 0
    assert trial.metrics["replans"] == 0, "one plan, whatever it leads into"
    scene, size = Scene(trial.world), np.array([0.32, 0.32, 0.12])
    for row in range(0, len(trial.log.steps.time_s), 10):
        rotation = rotation_from_quaternion(trial.log.steps.quaternion_wxyz[row])
        assert not scene.touches(trial.log.steps.position_m[row], rotation, size, -1e-3)


def test_rates_must_fit_the_step() -> None:
    assert steps_per(0.01, "latency_s", 0.03) == 3
    with pytest.raises(ConfigError, match="whole multiple of step_s"):
        steps_per(0.01, "1 / sensor.rate_hz", 1.0 / 30.0)


def test_a_trigger_that_draws_from_the_global_generator_ends_the_flight(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The same command used to make 18 replans, and 20 the next time."""

    def decide(self: Tbr, observation: object) -> Decision:
        return Decision(replan=np.random.random() < 0.1, cause="luck")  # noqa: NPY002

    monkeypatch.setattr(Tbr, "decide", decide)
    with pytest.raises(ConfigError, match="numpy's global generator"):
        fly(strategy="tbr")


def test_a_trigger_cannot_change_the_map_that_it_looks_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """What one wrote into the field, planner and safety used to take for measured."""

    def decide(self: Tbr, observation: Observation) -> Decision:
        observation.field.distance[:] = 9.0
        return Decision(replan=False)

    monkeypatch.setattr(Tbr, "decide", decide)
    with pytest.raises(ValueError, match="read-only"):
        fly(strategy="tbr")
