"""Movers in pictures: what is drawn is what the log says, and a flight without any looks as it did."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from tests.inspections import building
from tests.logs import changed, empty_log, make_log, make_replan, make_world
from uavexp.bodies import ABSENT_M
from uavexp.log import Contact, TrialLog
from uavexp.metrics.evaluate import evaluate
from uavexp.metrics.tracking_movers import near_misses
from uavexp.report import flight3d, movers_view, picture, picture_layout, plan_view
from uavexp.report.flight3d import _movers
from uavexp.types import Shape

NEAR_M = 0.5
SHAPES = np.array([Shape.CYLINDER, Shape.BOX, Shape.SPHERE], dtype=np.uint8)
HALF_M = np.array([[0.25, 0.25, 0.85], [0.4, 0.2, 0.5], [0.3, 0.3, 0.3]])


def straight(times_s):
    return np.stack([1.0 + times_s, np.full(times_s.size, 6.0), np.full(times_s.size, 1.2)], axis=1)


def straight_velocity(times_s):
    return np.tile([1.0, 0.0, 0.0], (times_s.size, 1))


def flight(**fields) -> TrialLog:
    """10 s among a person that crosses at x = 6, a box that comes after 5 s, and a ball that goes then."""
    times_s = 0.01 * np.arange(1001)
    ones = np.ones_like(times_s)
    person = np.stack([6.0 * ones, 1.5 + times_s, 0.85 * ones], axis=1)
    box = np.stack([10.0 * ones, 9.0 - 0.2 * times_s, 0.5 * ones], axis=1)
    ball = np.stack([3.0 + 0.5 * times_s, 4.0 * ones, 1.4 * ones], axis=1)
    box[times_s < 5.0], ball[times_s >= 5.0] = ABSENT_M, ABSENT_M
    ticks = 101
    values = {
        "mover_shape": SHAPES,
        "mover_half_size_m": HALF_M,
        "mover_position_m": np.stack([person, box, ball], axis=1).astype(np.float32),
        "mover_clearance_m": np.hypot(times_s - 5.0, times_s - 4.5) - 0.25,
        "track_count": np.full(ticks, 2),
        "track_identity": np.tile([4, 7], ticks),
        "track_position_m": np.stack([person[::10], np.tile([2.0, 8.0, 1.0], (ticks, 1))], axis=1).reshape(
            -1, 3
        ),
        "track_velocity_mps": np.tile([[0.0, 1.0, 0.0], [0.5, 0.0, 0.0]], (ticks, 1)),
        "replans": (
            make_replan(0.0, "first"),
            make_replan(3.0, "risk", position_m=np.array([4.0, 6.0, 1.2]), score=1.5),
            make_replan(3.5, "map", position_m=np.array([4.5, 6.0, 1.2])),
        ),
    }
    return make_log(straight, straight_velocity, **(values | fields))


def axes_of(size_m=(20.0, 12.0)):
    return picture_layout.lay_out(size_m).plan


class TestPaths:
    def test_lead_through_the_movers_places_and_fade_into_the_past(self):
        axes, log = axes_of(), flight()
        movers_view.draw(axes, log)
        person, box, ball = [item for item in axes.collections if isinstance(item, LineCollection)]
        ends = np.array(person.get_segments())
        np.testing.assert_allclose(ends[0, 0], [6.0, 1.5], atol=1e-6)
        np.testing.assert_allclose(ends[-1, 1], [6.0, 11.5], atol=1e-6)
        opacity = person.get_colors()[:, 3]
        assert np.all(np.diff(opacity) > 0.0)
        assert opacity[-1] == pytest.approx(1.0)
        assert len(box.get_segments()) == len(ball.get_segments()) + 1 == 500  # steps with both ends there

    def test_no_line_joins_the_end_of_a_recording_with_its_new_begin(self):
        log = flight()
        jumped = log.movers.position_m.copy()
        jumped[500:, 0, 0] += 8.0
        axes = axes_of()
        movers_view.draw(axes, changed(log, mover_position_m=jumped))
        segments = np.array(axes.collections[0].get_segments())
        assert len(segments) == 999
        assert np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).max() < 0.02

    def test_outlines_at_the_end_are_to_scale_and_of_those_still_there(self):
        axes = axes_of()
        movers_view.draw(axes, flight())
        person, box = axes.patches
        assert isinstance(person, Circle)
        assert person.get_radius() == 0.25
        np.testing.assert_allclose(person.get_center(), [6.0, 11.5], atol=1e-6)
        assert isinstance(box, Rectangle)
        np.testing.assert_allclose(box.get_bbox().extents, [9.6, 6.8, 10.4, 7.2], atol=1e-6)


class TestPredictions:
    def test_are_straight_lines_from_the_tracks_at_the_replan(self):
        log = flight()
        places_m, _, are_true = movers_view.predicted(log, log.replans[1])
        np.testing.assert_allclose(places_m, [[6.0, 4.5, 0.85], [2.0, 8.0, 1.0]])
        assert are_true.tolist() == [True, False]
        axes = axes_of()
        movers_view.draw(axes, log)
        lines = [line.get_xydata() for line in axes.lines if len(line.get_xdata()) == 2]
        np.testing.assert_allclose(lines, [[[6.0, 4.5], [6.0, 5.7]], [[2.0, 8.0], [2.6, 8.0]]])
        assert [text.get_text() for text in axes.texts] == ["1", "1", "1"]

    def test_tracks_out_of_reach_are_left_out(self):
        log = flight()
        far = dataclasses.replace(log.replans[1], position_m=np.array([6.0, 9.6, 0.85]))
        places_m, _, _ = movers_view.predicted(log, far)
        np.testing.assert_allclose(places_m, [[2.0, 8.0, 1.0]])

    @settings(max_examples=50, deadline=None)
    @given(counts=st.lists(st.integers(0, 3), min_size=11, max_size=11), at=st.floats(0.0, 1.0))
    def test_the_tracks_are_those_of_the_last_map_update(self, counts, at):
        tick_of = np.repeat(np.arange(11), counts).astype(float)
        log = make_log(
            straight,
            straight_velocity,
            duration_s=1.0,
            track_count=np.array(counts),
            track_position_m=tick_of[:, None] * np.ones(3),
            track_velocity_mps=np.zeros((len(tick_of), 3)),
        )
        at = round(at, 2)  # a step of the flight
        places_m, _ = movers_view.tracks_at(log, at)
        tick = int(round(100 * at) // 10)
        assert places_m[:, 0].tolist() == [tick] * counts[tick]

    def test_of_many_replans_the_most_urgent_are_drawn_in_order_of_time(self):
        replans = tuple(make_replan(1.5 * n, "risk", score=float((7 * n) % 30)) for n in range(1, 30))
        chosen = movers_view.predictive(flight(replans=replans))
        assert len(chosen) == movers_view.MOST_PREDICTIONS
        times_s = [replan.time_s for replan in chosen]
        assert times_s == sorted(times_s)
        assert min(replan.score for replan in chosen) == 18.0
        labels = [handle.get_label() for handle in movers_view.handles(flight(replans=replans), NEAR_M)]
        assert any("12 of 29" in label for label in labels)

    @given(asked=st.lists(st.tuples(st.integers(0, 100), st.floats(0.0, 9.0)), unique_by=lambda one: one[0]))
    def test_one_is_drawn_for_every_encounter_of_a_flight_with_few(self, asked):
        replans = tuple(make_replan(0.1 * tick, "risk", score=score) for tick, score in sorted(asked))
        chosen = movers_view.predictive(empty_log(replans=replans))
        times_s = np.array([replan.time_s for replan in chosen])
        assert np.all(np.diff(times_s) >= movers_view.HORIZON_S)
        assert len(chosen) <= movers_view.MOST_PREDICTIONS
        for replan in replans:  # what is left out has a more urgent one beside it
            beside = [one for one in chosen if abs(one.time_s - replan.time_s) < movers_view.HORIZON_S]
            assert (
                len(chosen) == movers_view.MOST_PREDICTIONS
                or max(one.score for one in beside) >= replan.score
            )


class TestNearMisses:
    @settings(max_examples=100, deadline=None)
    @given(
        clearance=st.lists(st.sampled_from([0.2, 0.4, 0.49, 0.5, 0.9, np.inf]), min_size=1, max_size=40),
        touches=st.lists(st.tuples(st.integers(0, 39), st.integers(0, 5), st.integers(-1, 1)), max_size=3),
    )
    def test_are_those_that_the_metric_counts(self, clearance, touches):
        contacts = tuple(
            Contact(start_s=0.01 * a, end_s=0.01 * (a + n), position_m=np.zeros(3), mover=mover)
            for a, n, mover in touches
        )
        duration_s = 0.01 * (len(clearance) - 1)
        distances_m = np.array(clearance)
        log = make_log(
            straight,
            straight_velocity,
            duration_s=duration_s,
            mover_clearance_m=distances_m,
            contacts=contacts,
        )
        rows = movers_view.near_miss_rows(log, NEAR_M)
        assert len(rows) == near_misses(log.steps.time_s, distances_m, contacts, NEAR_M)
        assert all(distances_m[row] < NEAR_M for row in rows)

    def test_the_ring_is_to_scale_around_the_vehicle_and_the_mover_is_the_nearest(self):
        axes, log = axes_of(), flight()
        movers_view.draw_near_misses(axes, log, NEAR_M)
        mover, ring = axes.patches
        row = int(np.argmin(log.movers.clearance_m))
        assert log.movers.clearance_m[row] < NEAR_M
        np.testing.assert_allclose(ring.get_center(), log.steps.position_m[row, :2])
        assert ring.get_radius() == NEAR_M
        np.testing.assert_allclose(mover.get_center(), log.movers.position_m[row, 0, :2], atol=1e-6)

    def test_without_a_limit_there_are_none(self):
        assert movers_view.near_miss_rows(flight(), float("nan")) == ()


class TestPanel:
    @pytest.mark.parametrize(("least_m", "top_m"), [(0.3, 1.0), (2.0, 2.4), (50.0, 1.0), (np.inf, 0.8)])
    def test_is_high_enough_for_the_nearest_approach_unless_that_is_far(self, least_m, top_m):
        axes = Figure().add_subplot()
        axes.set_ylim(0.0, 0.8)
        distances_m = least_m + np.arange(1001)
        movers_view.draw_clearance(axes, flight(mover_clearance_m=distances_m), NEAR_M)
        assert axes.get_ylim()[1] == pytest.approx(top_m)


class TestLegend:
    def test_counts_what_is_drawn(self):
        contacts = (
            Contact(start_s=1.0, end_s=1.1, position_m=np.zeros(3), mover=1),
            Contact(start_s=2.0, end_s=2.1, position_m=np.zeros(3)),
            Contact(start_s=3.0, end_s=3.1, position_m=np.zeros(3)),
        )
        log = flight(contacts=contacts)
        labels = " | ".join(str(handle.get_label()) for handle in movers_view.handles(log, NEAR_M))
        for part in (
            "past fades (3)",
            "at the end (2)",
            "replan (1)",
            "there (1)",
            "mover contact (1)",
            "0.5 m (1)",
        ):
            assert part in labels
        assert [handle.get_label() for handle in plan_view.contact_handles(log)] == ["wall contact (2)"]

    def test_says_nothing_of_flights_without_movers(self):
        log = make_log(straight, straight_velocity)
        axes = axes_of()
        movers_view.draw(axes, log)
        movers_view.draw_clearance(axes, log, NEAR_M)
        assert not axes.has_data()
        assert movers_view.handles(log, NEAR_M) == []
        assert movers_view.key_numbers({"path_length_m": 1.0}) == ()

    def test_people_who_never_come_are_no_movers(self):
        nobody = np.tile(ABSENT_M, (1001, 3, 1)).astype(np.float32)
        log = flight(
            mover_position_m=nobody, mover_clearance_m=np.full(1001, np.inf), track_count=np.zeros(101, int)
        )
        assert movers_view.handles(log, NEAR_M) == []
        assert movers_view.key_numbers({"min_mover_clearance_m": np.inf, "near_misses": 0})[0].endswith("–")


class TestPicture:
    @pytest.mark.parametrize("size_m", [(20.0, 12.0), (8.0, 30.0)])
    def test_is_the_same_for_the_same_flight_and_shows_the_movers(self, tmp_path, size_m):
        world, log = make_world([], size_m=(*size_m, 3.0)), flight()
        metrics = evaluate(log, world)
        without = changed(log, mover_position_m=np.tile(ABSENT_M, (1001, 3, 1)).astype(np.float32))
        for name, one in (("a", log), ("b", log), ("c", without)):
            picture.draw(world, one, metrics, "command", tmp_path / f"{name}.png")
        data = [(tmp_path / f"{name}.png").read_bytes() for name in "abc"]
        assert data[0] == data[1] != data[2]

    @pytest.mark.parametrize("kind", ["one row", "no row", "inspection"])
    def test_is_drawn_for_every_kind_of_flight(self, tmp_path, kind):
        log, world = flight(), make_world([])
        if kind == "no row":
            log = empty_log(
                mover_shape=SHAPES, mover_half_size_m=HALF_M, mover_position_m=np.zeros((0, 3, 3), np.float32)
            )
        elif kind == "one row":
            log = make_log(
                straight,
                straight_velocity,
                duration_s=0.0,
                mover_shape=SHAPES,
                mover_half_size_m=HALF_M,
                mover_position_m=log.movers.position_m[:1],
                mover_clearance_m=np.ones(1),
                track_count=np.zeros(1, int),
            )
        else:
            cells = building().vertices_m
            log = changed(
                log, cell_m=cells, cell_seen_s=np.ones(len(cells)), cell_visible=np.ones(len(cells), bool)
            )
        picture.draw(world, log, {"near_miss_distance_m": NEAR_M}, "command", tmp_path / "a.png")
        assert (tmp_path / "a.png").stat().st_size > 10_000


def test_the_view_in_3d_breaks_a_path_where_the_mover_is_not_there():
    log = flight()
    movers = _movers(log, np.array([0, 400, 600, 1000]))
    assert movers["count"] == 3
    assert movers["paths"][0] == [
        6.0,
        6.0,
        6.0,
        6.0,
        None,
        None,
        None,
        10.0,
        10.0,
        None,
        3.0,
        5.0,
        None,
        None,
        None,
    ]
    assert movers["last"][1] == [11.5, 7.0]
    assert "movers" not in flight3d._flight(make_world([]), make_log(straight, straight_velocity))
