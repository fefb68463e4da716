"""Several policies at once: who fires first, what is told, and how they are configured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from uavexp.check.hall import LIMITS, STRAIGHT, observe, room
from uavexp.config.build import GROUPS, build, nested_groups
from uavexp.config.composition import Cell, Composer
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory
from uavexp.trigger.any_of import AnyOf
from uavexp.trigger.risk import Risk
from uavexp.trigger.tbr import Tbr
from uavexp.types import Decision, Limits, Observation

COMPOSER = Composer()


@dataclass(slots=True)
class Says:
    """A policy that always says the same, and counts what it is told."""

    decision: Decision
    asked: int = 0
    plans: int = 0
    resets: int = 0

    def reset(self, limits: Limits) -> None:
        self.resets += 1

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        self.plans += 1

    def decide(self, observation: Observation) -> Decision:
        self.asked += 1
        return self.decision


def yes(cause: str, score: float = 1.0) -> Says:
    return Says(Decision(replan=True, cause=cause, score=score, voxel=np.array([7], dtype=np.int32)))


def no(score: float) -> Says:
    return Says(Decision(replan=False, score=score))


@pytest.mark.parametrize(
    ("policies", "cause", "score"),
    [
        ({"a": no(0.2), "b": no(0.7)}, "", 0.7),
        ({"a": no(5.0), "b": yes("map", 1.5)}, "map", 1.5),
        ({"a": yes("risk", 1.2), "b": yes("map", 9.0)}, "risk", 1.2),
        ({"b": yes("map", 9.0), "a": yes("risk", 1.2)}, "map", 9.0),
    ],
)
def test_the_first_in_order_that_fires_is_the_decision(
    policies: dict[str, Says], cause: str, score: float
) -> None:
    decision = AnyOf(policies=dict(policies)).decide(observe(room()))
    assert (decision.replan, decision.cause, decision.score) == (cause != "", cause, score)
    assert list(decision.voxel) == ([7] if cause else [])


def test_every_policy_is_told_everything_even_after_one_has_fired() -> None:
    policies = {"a": yes("risk"), "b": no(0.0)}
    both = AnyOf(policies=dict(policies))
    both.reset(LIMITS)
    both.planned(STRAIGHT, room())
    both.decide(observe(room()))
    assert all((one.resets, one.plans, one.asked) == (1, 1, 1) for one in policies.values())


def test_one_alone_is_that_policy() -> None:
    alone, inside = Tbr(interval_s=0.5), AnyOf(policies={"clock": Tbr(interval_s=0.5)})
    for tick in range(20):
        seen = observe(room(), time_s=0.1 * tick)
        one, other = alone.decide(seen), inside.decide(seen)
        assert (one.replan, one.cause, one.score) == (other.replan, other.cause, other.score)


def test_none_at_all_is_refused() -> None:
    with pytest.raises(ConfigError, match="policies must name one policy or more, got none"):
        AnyOf(policies={})


def cell(*typed: str) -> Cell:
    (only,) = COMPOSER.command(parse_settings(["trigger=any_of", *typed])).cells
    return only


def refusal(*typed: str) -> str:
    with pytest.raises(ConfigError) as error:
        cell(*typed)
    return str(error.value)


def test_the_option_combines_risk_with_map_changes_in_this_order() -> None:
    trigger = build(cell().config).trigger
    assert {name: type(policy).__name__ for name, policy in trigger.policies.items()} == {
        "risk": "Risk",
        "mcr": "Mcr",
    }
    assert nested_groups(AnyOf) == {"policies": "trigger"}
    assert nested_groups(Risk) == {}


def test_a_parameter_inside_is_typed_by_its_path_and_comes_in_its_own_type() -> None:
    config = cell("trigger.policies.risk.margin_m=1").config
    assert config["trigger"]["policies"]["risk"]["margin_m"] == 1.0
    assert isinstance(config["trigger"]["policies"]["risk"]["margin_m"], float)
    assert config == cell("trigger.policies.risk.margin_m=1.0").config
    assert build(config).trigger.policies["risk"].margin_m == 1.0


def test_a_policy_can_be_added() -> None:
    trigger = build(
        cell("+trigger.policies.clock={_target_: uavexp.trigger.tbr.Tbr, interval_s: 3}").config
    ).trigger
    assert list(trigger.policies) == ["risk", "mcr", "clock"]
    assert trigger.policies["clock"].interval_s == 3.0


@pytest.mark.parametrize(
    ("typed", "told"),
    [
        ("trigger.policies.risk.margin_m=-1", "trigger.policies.risk.margin_m must be >= 0"),
        ("trigger.policies.risk.margin_m=far", "trigger.policies.risk.margin_m must be a number, got 'far'"),
        ("trigger.policies.risk.margn_m=1", "did you mean 'margin_m'?"),
        ("+trigger.policies.x={_target_: os.system}", "is refused"),
        ("+trigger.policies.x={_target_: uavexp.planner.min_acc.MinAcc}", "is no option of trigger"),
        ("+trigger.policies.x={_target_: uavexp.trigger.tbr.Tbr, period: 3}", "trigger.policies.x.period"),
        ("+trigger.policies.x={interval_s: 3}", "trigger.policies.x must be a component of trigger"),
        ("+trigger.policies.x=3", "trigger.policies.x must be a component of trigger"),
        ("trigger.policies=3", "trigger.policies must be one of trigger, or several by name, got 3"),
        ("trigger.policies={}", "policies must name one policy or more"),
        (
            "trigger.policies.mcr.monitor_radius_m=5",
            "mcr.monitor_radius_m must be <= mapping.max_distance_m = 2.0",
        ),
    ],
)
def test_mistakes_inside_are_told_by_their_path(typed: str, told: str) -> None:
    text = refusal(typed)
    assert told in text
    assert "\n" not in text


def test_a_slow_clock_inside_is_refused_like_one_alone() -> None:
    told = refusal("+trigger.policies.clock={_target_: uavexp.trigger.tbr.Tbr, interval_s: 30}")
    assert told == "trigger.policies.clock.interval_s must be < stuck_s = 20.0, got 30.0"


def test_patience_that_would_end_a_flight_as_stuck_is_refused() -> None:
    told = refusal("mission=inspect", "mission.patience_s=10")
    assert told == "mission.patience_s must be < stuck_s / 2 = 10.0, got 10.0"


def test_only_trigger_and_planner_hold_components() -> None:
    config = cell().config
    holding = [group for group in GROUPS if any(isinstance(value, dict) for value in config[group].values())]
    assert holding == ["trigger", "planner"]
