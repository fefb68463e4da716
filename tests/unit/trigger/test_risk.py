"""The risk trigger against closed forms: two straight lines, and monotone in every parameter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.arrays import Float
from uavexp.check.hall import LIMITS, STRAIGHT, observe, room
from uavexp.errors import ConfigError
from uavexp.trigger.risk import Risk, approaches
from uavexp.types import Observation, Tracks

NOW_S = 1.5  # the straight flight is at (1, 2.05, 1.05) and moves at 1 m/s along x
HERE_M = np.array([1.0, 2.05, 1.05])
POINT_M = np.full(3, 1e-6)


def track(
    offset_m: tuple[float, float, float],
    velocity_mps: tuple[float, float, float] = (0.0, 0.0, 0.0),
    half_m: Float = POINT_M,
) -> Tracks:
    """One mover, placed relative to the vehicle of now."""
    return Tracks(
        time_s=NOW_S,
        identity=np.zeros(1, dtype=np.int64),
        position_m=HERE_M + np.array([offset_m]),
        velocity_mps=np.array([velocity_mps]),
        covariance=np.zeros((1, 6, 6)),
        half_size_m=half_m[None],
    )


def seen(tracks: Tracks, time_s: float = NOW_S) -> Observation:
    return replace(observe(room(), time_s=time_s), tracks=tracks)


def policy(**parameters: Any) -> Risk:
    made = Risk(**parameters)
    made.reset(LIMITS)
    made.planned(STRAIGHT, room())
    return made


offsets = st.tuples(*[st.floats(-3.0, 3.0) for _ in range(3)])
UNSWERVED = np.zeros((1, 0, 3))
speeds = st.tuples(*[st.floats(-2.0, 2.0) for _ in range(3)])


@settings(deadline=None)  # the first call compiles
@given(offset=offsets, velocity=speeds)
def test_the_least_distance_of_two_straight_flights_is_that_of_the_closed_form(
    offset: tuple[float, float, float], velocity: tuple[float, float, float]
) -> None:
    """Offset o, relative velocity w: |o + w t| is least at t = -o w / w², clipped to the window."""
    times = np.arange(0.0, 1.2 + 1e-9, 0.02)
    own = np.array([1.0, 0.0, 0.0])
    path = HERE_M + times[:, None] * own
    ((least, relative, closing),) = approaches(
        path, np.tile(own, (len(times), 1)), times, (HERE_M + np.array(offset))[None],
        np.array([velocity]), POINT_M[None], True, UNSWERVED,
    )  # fmt: skip
    apart, drift = np.array(offset), np.array(velocity) - own
    square = float(drift @ drift)
    at = min(max(-float(apart @ drift) / square, 0.0), 1.2) if square > 0.0 else 0.0
    exact = float(np.linalg.norm(apart + at * drift))
    assert exact - 1e-4 <= least <= np.hypot(exact, 0.01 * np.sqrt(square)) + 1e-4
    assert relative == pytest.approx(np.sqrt(square))
    assert 0.0 <= closing <= relative + 1e-9


@settings(deadline=None)  # the first call compiles
@given(offset=offsets, velocity=speeds)
def test_any_instant_is_never_farther_than_the_same_instant(
    offset: tuple[float, float, float], velocity: tuple[float, float, float]
) -> None:
    times = np.arange(0.0, 1.2 + 1e-9, 0.1)
    own = np.array([1.0, 0.0, 0.0])
    common = (
        HERE_M + times[:, None] * own, np.tile(own, (len(times), 1)), times,
        (HERE_M + np.array(offset))[None], np.array([velocity]), np.array([[0.3, 0.3, 0.8]]),
    )  # fmt: skip
    assert approaches(*common, False, UNSWERVED)[0, 0] <= approaches(*common, True, UNSWERVED)[0, 0]


def test_paths_that_cross_at_different_times_meet_at_any_instant_only() -> None:
    """The mover is at the crossing (1, 0) at once and gone when the vehicle comes."""
    gone = seen(track((1.0, 0.0, 0.0), (0.0, 2.0, 0.0)))
    assert not policy(margin_m=0.3, speed_s=0.0).decide(gone).replan
    assert policy(margin_m=0.3, speed_s=0.0, instant="any").decide(gone).replan


@pytest.mark.parametrize(("side_m", "fires"), [(0.5 + LIMITS.body_radius_m - 0.01, True), (0.74, False)])
def test_a_mover_beside_the_path_is_a_risk_within_margin_and_radius(side_m: float, fires: bool) -> None:
    """It stands; at the closest approach nothing closes, so d_safe is delta and the radius."""
    assert policy().decide(seen(track((0.6, side_m, 0.0)))).replan is fires


def test_the_size_of_the_mover_counts() -> None:
    beside = (0.6, 1.2, 0.0)
    assert not policy().decide(seen(track(beside))).replan
    assert policy().decide(seen(track(beside, half_m=np.array([0.5, 0.5, 0.9])))).replan


def test_the_formula_read_literally_fires_at_a_mover_that_goes_away() -> None:
    """|v_rel| t_th = 3 m/s 1.2 s = 3.6 m, whatever its direction."""
    away = seen(track((3.0, 0.0, 0.0), (4.0, 0.0, 0.0)))
    literal = {"instant": "any", "speed": "relative", "radii": "mover", "speed_s": 1.2}
    decision = policy(**literal).decide(away)
    assert decision.replan
    # any instant: least between the vehicle after 1.2 s and the mover of now
    assert decision.score == pytest.approx((3.0 * 1.2 + 0.5) / (3.0 - 1.2), rel=1e-3)
    assert not policy().decide(away).replan


def test_head_on_it_fires_as_soon_as_the_window_reaches_the_mover() -> None:
    """Closing at 2 m/s: distance 1.2 s ahead below 0.5 + 0.226 + 2 * 0.2 m."""
    limit_m = 2.0 * 1.2 + 0.5 + LIMITS.body_radius_m + 2.0 * 0.2
    assert policy().decide(seen(track((limit_m - 0.02, 0.0, 0.0), (-1.0, 0.0, 0.0)))).replan
    assert not policy().decide(seen(track((limit_m + 0.02, 0.0, 0.0), (-1.0, 0.0, 0.0)))).replan


@settings(deadline=None)  # the first call compiles
@given(
    offset=offsets,
    velocity=speeds,
    name=st.sampled_from(["margin_m", "speed_s", "horizon_s"]),
    more=st.floats(0.01, 1.0),
)
def test_risk_grows_with_margin_speed_time_and_horizon(
    offset: tuple[float, float, float], velocity: tuple[float, float, float], name: str, more: float
) -> None:
    """The horizon only with speed_s = 0: closing speed is taken where the distance is least."""
    fixed = {"speed_s": 0.0} if name == "horizon_s" else {}
    near = Risk(**fixed)
    near.reset(LIMITS)
    far = Risk(**(fixed | {name: getattr(near, name) + more}))
    far.reset(LIMITS)
    observation = seen(track(offset, velocity))
    assert far.score(observation) >= near.score(observation) - 1e-9


def test_the_vehicles_radius_counts_with_both_radii_only() -> None:
    beside = seen(track((0.6, 0.6, 0.0)))
    assert policy(radii="both").decide(beside).replan
    assert not policy(radii="mover").decide(beside).replan


def test_a_risk_that_stays_asks_again_only_after_the_interval() -> None:
    fired = []
    asking = policy(min_interval_s=0.3)
    for tick in range(10):
        time_s = NOW_S + 0.1 * tick
        ahead = replace(track((0.6 + 0.1 * tick, 0.0, 0.0)), time_s=time_s)
        fired.append(asking.decide(seen(ahead, time_s)).replan)
    assert fired == [True, False, False] * 3 + [True]


def test_no_track_no_risk_and_nothing_before_the_plan_takes_effect() -> None:
    assert policy().decide(seen(Tracks.none())).score == 0.0
    ahead = track((0.2, 0.0, 0.0))
    assert not policy().decide(seen(ahead, time_s=0.9)).replan
    assert policy().decide(seen(ahead)).replan


def test_a_vehicle_that_stands_at_its_end_is_still_watched() -> None:
    comes = replace(track((6.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), time_s=9.0)
    decision = policy().decide(seen(comes, time_s=9.0))  # it holds at x = 5.5, the mover is at 7
    assert decision.replan
    assert decision.cause == "risk"


@pytest.mark.parametrize(
    "parameters", [{"horizon_s": 0.0}, {"instant": "later"}, {"speed": "fast"}, {"radii": "none"}]
)
def test_refuses_what_makes_no_sense(parameters: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        Risk(**parameters)
