"""The filter of one mover, and the measures of tracking, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.logs import changed, make_log, make_world
from uavexp.arrays import Float
from uavexp.bodies import ABSENT_M
from uavexp.check.fields import empty, field_from
from uavexp.detection.clusters import Clusters
from uavexp.detection.kalman import Estimate, MotionFilter, MotionModel, estimated
from uavexp.detection.tracker import Tracker, TrackRule, centres_m
from uavexp.log import Contact, TrialLog
from uavexp.metrics.metric import Flight, measured
from uavexp.metrics.tracking_movers import METRICS, match, near_misses, predicted_errors_m, quality
from uavexp.scan import RayScan
from uavexp.types import Shape, Tracks


def still(times_s: Float) -> Float:
    return np.zeros((len(times_s), 3))


RULE = TrackRule(4.0, 3, 0.25, 0.12, 1.0, 1.2, 6.0, 2.0, MotionModel())
SENSOR_M = np.zeros(3)
TIMES_S = np.arange(40) * 0.1


def walk(velocity: tuple[float, float, float] = (1.0, -0.5, 0.2)) -> Float:
    return np.array([3.0, 2.0, 1.0]) + TIMES_S[:, None] * np.array(velocity)


def test_a_straight_walk_without_noise_is_followed_exactly_in_the_end() -> None:
    position, velocity = estimated(TIMES_S, walk())
    assert np.linalg.norm(position[-1] - walk()[-1]) < 1e-3
    assert np.linalg.norm(velocity[-1] - [1.0, -0.5, 0.2]) < 1e-2


def test_the_first_update_is_that_of_the_textbook() -> None:
    """K = P H' (H P H' + R)^-1 of one axis, by hand."""
    motion, period, moved = MotionModel(), 0.1, 0.07
    filter_ = MotionFilter(np.zeros(3), motion)
    filter_.predict(period, np.zeros(3), None)
    filter_.observe(np.array([moved, 0.0, 0.0]))
    r, q = motion.position_noise_m**2, motion.acceleration_density
    place = r + period**2 * motion.speed_mps**2 + q * period**3 / 3.0
    mixed = period * motion.speed_mps**2 + q * period**2 / 2.0
    assert filter_.position_m[0] == pytest.approx(place / (place + r) * moved)
    assert filter_.velocity_mps[0] == pytest.approx(mixed / (place + r) * moved)
    assert np.allclose(filter_.covariance, filter_.covariance.T)


def test_noise_is_smoothed_and_beats_the_last_two_positions() -> None:
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(20):
        seen = walk() + rng.normal(0.0, 0.05, (40, 3))
        _, believed = estimated(TIMES_S, seen)
        _, raw = estimated(TIMES_S, seen, of=Estimate.RAW)
        errors.append([np.linalg.norm(one[10:] - [1.0, -0.5, 0.2], axis=1).mean() for one in (believed, raw)])
    filter_mps, raw_mps = np.mean(errors, axis=0)
    assert filter_mps < 0.4 * raw_mps


def test_process_noise_rises_in_a_turn_and_falls_again() -> None:
    """A rebound at 1.5 m/s; the filter that adapts is nearer to the new velocity 0.5 s later."""
    corner = np.where(TIMES_S[:, None] < 2.0, [1.5, 0.0, 0.0], [-1.5, 0.0, 0.0])
    seen = np.cumsum(corner * 0.1, axis=0)
    lag = {}
    for adaptivity in (1.0, 20.0):
        _, velocity = estimated(TIMES_S, seen, MotionModel(acceleration_density=0.05, adaptivity=adaptivity))
        lag[adaptivity] = np.linalg.norm(velocity[25] - [-1.5, 0.0, 0.0])
    assert lag[20.0] < 0.85 * lag[1.0]
    filter_, misfit = MotionFilter(seen[0], MotionModel()), []
    for position_m in seen[1:]:
        filter_.predict(0.1, np.zeros(3), None)
        filter_.observe(position_m)
        misfit.append(filter_.misfit)
    assert max(misfit[20:25]) > 3.0 * misfit[17]
    assert misfit[-1] < 1.0


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_is_no_observation(bad: float) -> None:
    """filterpy's update(NaN) poisons the state without a word."""
    filter_ = MotionFilter(np.zeros(3), MotionModel())
    filter_.predict(0.1, np.zeros(3), None)
    before = filter_.position_m.copy(), filter_.covariance.copy()
    filter_.observe(np.array([0.1, bad, 0.0]))
    assert np.array_equal(filter_.position_m, before[0])
    assert np.array_equal(filter_.covariance, before[1])
    assert filter_.is_sound(6.0, 2.0)


@settings(deadline=None, max_examples=50)
@given(shift=st.tuples(*[st.floats(-50.0, 50.0)] * 3), gaps=st.sets(st.integers(3, 38), max_size=10))
def test_filtering_moves_with_the_world(shift: tuple[float, float, float], gaps: set[int]) -> None:
    seen = walk() + np.sin(7.0 * TIMES_S)[:, None] * 0.05
    seen[sorted(gaps)] = np.nan
    here, there = estimated(TIMES_S, seen), estimated(TIMES_S, seen + np.array(shift))
    assert np.allclose(here[0] + np.array(shift), there[0], atol=1e-9)
    assert np.allclose(here[1], there[1], atol=1e-9)


def test_raw_velocities_bridge_gaps_by_the_last_two_that_were_seen() -> None:
    seen = walk()
    seen[5:8] = np.nan
    position_m, raw = estimated(TIMES_S, seen, of=Estimate.RAW)
    assert np.array_equal(raw[0], np.zeros(3))
    assert np.allclose(raw[1:], [1.0, -0.5, 0.2])
    assert np.allclose(position_m, walk())  # moved on while unseen


def clusters(*boxes: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Clusters:
    """Boxes ahead of the sensor along x, as it sees them."""
    low, high = (np.array([box[side] for box in boxes], dtype=np.float64).reshape(-1, 3) for side in (0, 1))
    span = np.stack([low[:, 0], low[:, 1], high[:, 1], low[:, 2], high[:, 2]], axis=1)
    sight = np.tile([1.0, 0.0], (len(boxes), 1))
    return Clusters(np.zeros(0, dtype=np.int64), low, high, sight, span)


def front(x: float, y: float = 0.0) -> Clusters:
    """The near face of a body 0.6 m wide and 1 m tall whose centre is at (x, y, 0)."""
    return clusters(((x - 0.3, y - 0.3, -0.5), (x - 0.2, y + 0.3, 0.5)))


def both(one: Clusters, other: Clusters) -> Clusters:
    return Clusters(*(np.concatenate(pair) for pair in zip(one, other, strict=True)))


def test_the_centre_lies_half_a_width_behind_the_nearest_point() -> None:
    half = np.array([[0.3, 0.3, 0.5]])
    assert np.allclose(centres_m(front(4.0, 1.0), half, np.full((1, 3), np.nan), SENSOR_M), [[4.0, 1.0, 0.0]])


@pytest.mark.parametrize(("hidden_m", "expected_m"), [(0.0, 1.0), (0.2, 1.0), (0.5, 1.0)])
def test_a_body_half_hidden_stays_where_it_was_expected(hidden_m: float, expected_m: float) -> None:
    """Its left part is behind a wall: the visible rest alone would say it is further right."""
    seen = clusters(((3.7, 0.7, -0.5), (3.8, 1.3 - hidden_m, 0.5)))
    half, predicted = np.array([[0.3, 0.3, 0.5]]), np.array([[4.0, expected_m, 0.0]])
    assert np.allclose(centres_m(seen, half, predicted, SENSOR_M)[0], [4.0, expected_m, 0.0])
    beyond = np.array([[4.0, 2.0, 0.0]])
    assert centres_m(seen, half, beyond, SENSOR_M)[0, 1] == pytest.approx(1.0), "what is seen lies within it"


NOWHERE = field_from(empty((2.0, 2.0, 2.0)), max_distance_m=2.0)  # far from any obstacle
BLIND = RayScan(  # sees nothing of what it does not cluster
    time_s=0.0,
    origin_m=SENSOR_M,
    direction=np.zeros((0, 3), np.float32),
    range_m=np.zeros(0, np.float32),
    max_range_m=10.0,
)


def follow(tracker: Tracker, scans: list[Clusters], period_s: float = 0.1) -> list[int]:
    """Published identities after the last scan."""
    for scan in scans:
        tracker.predict(period_s, NOWHERE)
        tracker.observe(scan, BLIND, period_s)
    return tracker.published(0.0, NOWHERE).identity.tolist()


def test_a_track_is_born_confirmed_by_motion_and_dies_unseen() -> None:
    tracker = Tracker(RULE)
    assert follow(tracker, [front(4.0)] * 10) == [], "what stands is no mover"
    assert follow(tracker, [front(4.0 + 0.1 * step) for step in range(8)]) == [0]
    nothing = clusters()
    assert follow(tracker, [nothing] * 11) == [0]
    assert follow(tracker, [nothing] * 3) == []
    assert tracker.dropped == 0


def test_a_track_that_fits_keeps_its_cluster_whatever_another_could_have() -> None:
    """One joint assignment would give the walker the speck behind it, and its own cluster to the newcomer."""
    tracker = Tracker(RULE)
    follow(tracker, [front(4.0, 0.1 * step) for step in range(11)])
    assert follow(tracker, [both(front(4.0, 1.1), front(4.0, 1.9))]) == [0]
    follow(tracker, [both(front(4.0, 1.22), front(4.0, 0.75))])
    assert tracker.tracks[0].filter.seen_m[1] == pytest.approx(1.22, abs=0.02)


def test_a_walker_missed_for_long_is_not_what_appears_where_it_cannot_be() -> None:
    tracker = Tracker(RULE._replace(coast_s=3.0))
    follow(tracker, [front(4.0, 0.1 * step) for step in range(11)])
    assert follow(tracker, [clusters()] * 20 + [front(4.0, -1.8)]) == [0], "1 m/s back for 2 s is -1.1 m"
    assert len(tracker.tracks) == 2
    assert follow(tracker, [front(4.0, -1.8)] * 2) == [0]
    back = Tracker(RULE._replace(coast_s=3.0))
    follow(back, [front(4.0, 0.1 * step) for step in range(11)])
    assert follow(back, [clusters()] * 20 + [front(4.0, -0.6)]) == [0]
    assert len(back.tracks) == 1


def test_a_new_track_that_is_not_seen_again_is_forgotten_at_once() -> None:
    tracker = Tracker(RULE)
    follow(tracker, [front(4.0), *[clusters()] * 3])
    assert tracker.tracks == []


def test_a_filter_that_diverges_is_dropped_and_counted() -> None:
    tracker = Tracker(RULE)
    follow(tracker, [front(4.0 + 0.1 * step) for step in range(8)])
    tracker.tracks[0].filter._kalman.x = np.full(6, np.nan)
    assert follow(tracker, [clusters()]) == []
    assert tracker.published(0.0, NOWHERE).dropped == 1
    fast = Tracker(RULE)
    follow(fast, [front(4.0 + 0.1 * step) for step in range(8)])
    fast.tracks[0].filter._kalman.x[3] = 50.0
    follow(fast, [clusters()])
    assert fast.published(0.0, NOWHERE).dropped == 1


def test_matching_keeps_the_pair_of_before_while_it_is_within_the_gate() -> None:
    """Assigned anew, both would change to the nearer one."""
    apart = np.array([[0.6, 0.1], [0.1, 0.6]])
    identity = np.array([7, 8])
    assert match(apart, {}, identity, 1.0) == {0: 1, 1: 0}
    assert match(apart, {0: 7, 1: 8}, identity, 1.0) == {0: 0, 1: 1}
    assert match(apart, {0: 7, 1: 8}, identity, 0.5) == {0: 1, 1: 0}
    assert match(np.full((2, 1), 5.0), {}, identity[:1], 1.0) == {}


def track_of(time_s: float, position_m: Float, velocity_mps: Float) -> Tracks:
    return Tracks(
        time_s=time_s, identity=np.zeros(1, np.int64), position_m=position_m[None],
        velocity_mps=velocity_mps[None], covariance=np.zeros((1, 6, 6)), half_size_m=np.zeros((1, 3)),
    )  # fmt: skip


def test_a_prediction_is_as_wrong_as_the_motion_is_curved() -> None:
    """On the unit circle at 1 m/s the tangent is (1 - cos t, t - sin t) off after t."""
    times_s, ahead_s = np.linspace(0.0, 5.0, 5001), (0.3, 0.6, 1.2)
    truth = np.stack([np.cos(times_s), np.sin(times_s), 0.0 * times_s], axis=1)
    tangent = np.array([-np.sin(1.0), np.cos(1.0), 0.0])
    error = predicted_errors_m(track_of(1.0, truth[1000], tangent), times_s, truth, ahead_s)
    t = np.array(ahead_s)
    assert np.allclose(error, np.hypot(1.0 - np.cos(t), t - np.sin(t)), atol=1e-6)
    late = predicted_errors_m(track_of(4.5, truth[4500], np.zeros(3)), times_s, truth, ahead_s)
    assert np.isfinite(late[0])
    assert np.isnan(late[1:]).all()


def log_with(tracks: list[tuple[int, Float, Float]], seconds: float = 4.0) -> TrialLog:
    """A mover at 1 m/s along x, a vehicle that stands, and the same tracks at every update."""
    log = make_log(still, still)
    count = round(seconds / 0.01) + 1
    time_s = np.arange(count) * 0.01
    mover = np.stack([1.0 + time_s, 0.0 * time_s, 0.0 * time_s + 1.0], axis=1)
    tick_s = time_s[::10]
    at = mover[::10]
    return changed(
        log,
        step_s=0.01,
        time_s=time_s,
        position_m=np.zeros((count, 3)),
        contacts=(),
        tick_s=tick_s,
        mover_shape=np.array([int(Shape.CYLINDER)], dtype=np.uint8),
        mover_half_size_m=np.full((1, 3), 0.3),
        mover_position_m=mover[:, None].astype(np.float32),
        mover_clearance_m=np.linalg.norm(mover, axis=1) - 0.3,
        track_count=np.full(len(tick_s), len(tracks), dtype=np.int64),
        track_identity=np.array([one[0] for _ in tick_s for one in tracks], dtype=np.int64),
        track_position_m=np.array([here + one[1] for here in at for one in tracks]).reshape(-1, 3),
        track_velocity_mps=np.array([one[2] for _ in tick_s for one in tracks]).reshape(-1, 3),
    )


AHEAD = np.array([1.0, 0.0, 0.0])


def test_a_perfect_track_has_no_error_and_a_shifted_one_its_shift() -> None:
    perfect = quality(log_with([(3, np.zeros(3), AHEAD)]))
    assert perfect.position_error_m < 1e-6
    assert max(perfect.prediction_error_m) < 1e-6
    assert (perfect.missed_share, perfect.false_share, perfect.identity_switches) == (0.0, 0.0, 0)
    slow = quality(log_with([(3, np.array([0.0, 0.3, 0.0]), np.zeros(3))]))
    assert slow.position_error_m == pytest.approx(0.3, abs=1e-6)
    assert slow.prediction_error_m == pytest.approx(
        [np.hypot(0.3, t) for t in (0.3, 0.6, 0.9, 1.2)], abs=1e-5
    )
    assert slow.mean_prediction_error_m == pytest.approx(
        np.mean([np.hypot(0.3, 0.1 * n) for n in range(1, 13)]), abs=1e-5
    )


def test_nobody_is_predicted_to_where_he_is_not() -> None:
    """A mover that leaves and comes back: the error of a perfect track stays zero."""
    log = log_with([(3, np.zeros(3), AHEAD)])
    away = log.movers.position_m.copy()
    middle = len(away) // 2
    away[middle : middle + 20] = ABSENT_M
    left = quality(changed(log, mover_position_m=away))
    assert max(left.prediction_error_m) < 1e-6
    assert left.mean_prediction_error_m < 1e-6


def test_missed_false_and_switched_tracks_are_counted() -> None:
    missed = quality(log_with([]))
    assert missed.missed_share == 1.0
    assert np.isnan(missed.false_share)
    ghost = quality(log_with([(3, np.zeros(3), AHEAD), (4, np.array([0.0, 3.0, 0.0]), AHEAD)]))
    assert ghost.false_share == pytest.approx(0.5)
    log = log_with([(3, np.zeros(3), AHEAD)])
    renamed = np.where(np.arange(len(log.tracks.identity)) < 20, 3, 9)
    assert quality(changed(log, track_identity=renamed)).identity_switches == 1


def test_near_misses_are_episodes_without_a_contact() -> None:
    time_s = np.arange(100) * 0.1
    clearance_m = np.full(100, 2.0)
    clearance_m[[10, 11, 30, 50, 51, 99]] = 0.3
    hit = Contact(start_s=5.05, end_s=5.2, position_m=np.zeros(3), mover=0)
    wall = Contact(start_s=1.0, end_s=1.2, position_m=np.zeros(3))
    assert near_misses(time_s, clearance_m, (), 0.5) == 4
    assert near_misses(time_s, clearance_m, (hit, wall), 0.5) == 3
    assert near_misses(time_s, clearance_m, (), 0.2) == 0


def test_flights_without_movers_have_no_such_columns() -> None:
    world = make_world([])
    assert measured(METRICS, Flight(log=make_log(still, still), world=world)) == {}
    told = measured(METRICS, Flight(log=log_with([(3, np.zeros(3), AHEAD)]), world=world))
    assert told["mover_contacts"] == 0
    assert told["near_miss_distance_m"] == 0.5
    assert told["prediction_error_1.2s_m"] == pytest.approx(0.0, abs=1e-6)


def test_a_lost_track_that_may_be_anywhere_does_not_take_the_one_that_is_seen() -> None:
    """It comes, unseen, to where the other is seen 0.2 m off its way: near for it, but less likely."""
    tracker = Tracker(RULE._replace(coast_s=3.0))
    follow(tracker, [both(front(4.0, -3.0 + 0.1 * k), front(4.0, 2.0 - 0.05 * k)) for k in range(10)])
    follow(tracker, [front(4.0, 2.0 - 0.05 * k) for k in range(10, 34)])
    assert follow(tracker, [front(4.0, 2.0 - 0.05 * 34 + 0.2)]) == [0, 1]
    lost, seen = tracker.tracks
    assert lost.unseen_s == pytest.approx(2.5)
    assert seen.unseen_s == 0.0


@pytest.mark.parametrize("fading", [0.0, 0.3, 0.9])
def test_the_misfit_keeps_its_share_of_the_innovations_before(fading: float) -> None:
    """Mehra's average: old share times what was, the rest is the squared innovation over its expectation."""
    filter_ = MotionFilter(first_m=np.zeros(3), motion=MotionModel(fading=fading))
    expected = 1.0
    for place_m in (np.array([0.5, 0.0, 0.0]), np.array([0.5, 0.9, 0.0]), np.array([0.6, 1.0, 0.1])):
        filter_.predict(0.1, np.full(3, 0.3), None)
        away = place_m - filter_.position_m
        squared = float(away @ np.linalg.solve(filter_.innovation_covariance, away))
        expected = fading * expected + (1.0 - fading) * squared / 3.0
        filter_.observe(place_m)
        assert filter_.misfit == pytest.approx(expected)
