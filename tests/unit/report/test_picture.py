"""The picture of a trial: drawn for every kind of log, the same bytes for the same trial."""

from __future__ import annotations

import dataclasses
import struct
import time

import numpy as np
import pytest

from tests.logs import empty_log, make_log, make_replan, make_world
from uavexp.log import Contact, TrialLog
from uavexp.metrics.evaluate import evaluate
from uavexp.report import cross_section, picture_layout, plan_view
from uavexp.report.picture import draw
from uavexp.types import Outcome, World

COMMAND = "python -m uavexp strategy=mcr world=warehouse seed=7"
SHELVES = [([x, y, 0.0], [x + 1.0, y + 4.0, 2.0]) for x in (4.0, 8.0, 12.0, 16.0) for y in (0.5, 7.5)]
WALLS = [([0.0, -0.1, 0.0], [20.0, 0.0, 3.0]), ([0.0, 12.0, 0.0], [20.0, 12.1, 3.0])]
BOXES = [*SHELVES, *WALLS, ([10.0, 5.6, 0.0], [10.4, 6.8, 1.8])]


def weave(times_s):
    return np.stack(
        [1.0 + 0.9 * times_s, 6.0 + 0.9 * np.sin(0.5 * times_s), np.full(times_s.size, 1.2)], axis=1
    )


def weave_velocity(times_s):
    zeros = np.zeros(times_s.size)
    return np.stack([0.9 + 0.5 * np.sin(times_s), 0.45 * np.cos(0.5 * times_s), zeros], axis=1)


def synthetic() -> tuple[World, TrialLog]:
    """A weave between shelves with replans of every cause, a failed one, and a contact."""
    world = make_world(
        BOXES, shortest_path=np.array([[1, 6, 1.2], [10.2, 7.0, 1.2], [19, 6, 1.2]], dtype=float)
    )
    times_s = 0.01 * np.arange(2001)
    rng = np.random.default_rng(0)
    wall_m = np.array(
        [[x, y, z] for x in np.arange(4.05, 5.0, 0.1) for y in (4.45, 7.55) for z in (1.05, 1.25)]
    )
    post_m = np.array([[x, y, 1.15] for x in (10.05, 10.35) for y in np.arange(5.65, 6.8, 0.1)])

    def replan(time_s, cause, **fields):
        ahead = weave(time_s + np.linspace(0.0, 4.0, 40)) + np.array([0.0, 0.15, 0.0])
        place = weave(np.array([time_s]))[0]
        return make_replan(time_s, cause, position_m=place, trajectory_m=ahead.astype(np.float32), **fields)

    log = make_log(
        weave,
        weave_velocity,
        duration_s=20.0,
        reference_position_m=weave(times_s) + 0.05 * np.sin(times_s)[:, None] * np.array([0.3, 1.0, 0.2]),
        clearance_m=0.8 + 0.6 * np.sin(0.9 * times_s) + 0.02 * rng.normal(size=2001),
        esdf_clearance_m=0.9 + 0.6 * np.sin(0.09 * np.arange(201)),
        replans=(
            replan(0.0, "first"),
            replan(3.1, "map"),
            replan(6.4, "goal"),
            replan(9.0, "map", ok=False),
            replan(9.5, "clock"),
            replan(13.0, "map"),
            replan(15.0, "brake"),
            replan(17.0, "retry"),
        ),
        contacts=(Contact(start_s=5.2, end_s=5.9, position_m=weave(np.array([5.2]))[0]),),
        mapped_m=np.concatenate([wall_m, post_m]).astype(np.float32),
    )
    return world, log


def png_size(path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", data[16:24])


def test_the_same_trial_gives_the_same_bytes_whatever_the_users_own_style(tmp_path):
    import matplotlib

    world, log = synthetic()
    values = evaluate(log, world)
    draw(world, log, values, COMMAND, tmp_path / "a.png")
    with matplotlib.rc_context({"font.size": 20.0, "lines.linewidth": 9.0}):
        draw(world, log, values, COMMAND, tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert b"Software" not in (tmp_path / "a.png").read_bytes()
    assert min(png_size(tmp_path / "a.png")) > 800


def test_uses_no_window_system_and_no_global_figures(tmp_path):
    from matplotlib import pyplot as plt  # the global ones; tests of notebooks leave some

    before = plt.get_fignums()
    draw(*synthetic(), {}, COMMAND, tmp_path / "a.png")
    assert plt.get_fignums() == before


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_draws_a_trial_that_broke_before_it_flew(tmp_path, rows):
    world, _ = synthetic()
    log = empty_log() if rows == 0 else make_log(weave, weave_velocity, duration_s=0.01 * (rows - 1))
    draw(world, log, evaluate(log, world), COMMAND, tmp_path / "a.png")
    assert png_size(tmp_path / "a.png")[0] > 800


@pytest.mark.parametrize("size_m", [(20.0, 4.0), (8.0, 8.0), (5.0, 40.0)])
def test_draws_worlds_of_every_shape(tmp_path, size_m):
    ends = ((1.0, 1.0, 1.2), (size_m[0] - 1.0, size_m[1] - 1.0, 1.2))
    world = make_world([], size_m=(*size_m, 3.0), start_m=ends[0], target_m=ends[1])
    log = empty_log()
    draw(world, log, {}, "x" * 400, tmp_path / "a.png")
    assert max(png_size(tmp_path / "a.png")) < 2000


def test_the_plan_keeps_its_proportions_and_shows_all_that_was_flown():
    world, log = synthetic()
    view = plan_view.view_m(world, log)
    assert np.all(view[0] <= log.steps.position_m[:, :2].min(axis=0))
    assert np.all(view[1] >= log.steps.position_m[:, :2].max(axis=0))
    assert np.all(view[0] >= world.bounds_m[0, :2])
    sheet = picture_layout.lay_out((20.0, 8.0))
    plan_view.draw(sheet.plan, world, log, view)
    sheet.plan.apply_aspect()
    corners = sheet.plan.transData.transform([[0.0, 0.0], [1.0, 1.0]])
    assert corners[1, 0] - corners[0, 0] == pytest.approx(corners[1, 1] - corners[0, 1])


class TestSection:
    def cut(self, world, heights_m=(0.7, 1.7), cell_m=0.05):
        visited = np.array([world.start_m])
        plan = cross_section.cut(world, heights_m, visited, cell_m)

        def at(x, y):
            return plan.cells[int((x - plan.lower_m[0]) / cell_m), int((y - plan.lower_m[1]) / cell_m)]

        return plan, at

    def test_a_box_is_outlined_its_inside_solid_and_the_rest_open(self):
        plan, at = self.cut(make_world(BOXES))
        assert at(4.0, 2.0) == cross_section.SURFACE
        assert at(4.5, 2.0) == cross_section.SOLID
        assert at(6.0, 6.0) == cross_section.OPEN
        inner_m2 = np.count_nonzero(plan.cells == cross_section.SOLID) * 0.05**2
        assert inner_m2 == pytest.approx(8 * 4.0 + 0.4 * 1.2, rel=0.12)

    def test_what_stands_below_or_hangs_above_the_slab_is_not_shown(self):
        low, high = ([6.0, 6.0, 0.0], [7.0, 7.0, 0.6]), ([8.0, 6.0, 1.8], [9.0, 7.0, 3.0])
        _, at = self.cut(make_world([low, high, *WALLS]))
        assert at(6.0, 6.5) == at(6.5, 6.5) == at(8.0, 6.5) == at(8.5, 6.5) == cross_section.OPEN

    def test_a_table_top_within_the_slab_is_filled(self):
        _, at = self.cut(make_world([([6.0, 6.0, 1.0], [8.0, 7.0, 1.05])]))
        assert at(7.0, 6.5) == cross_section.SURFACE

    def test_a_slanted_triangle_is_cut_at_both_heights(self):
        ramp = make_world([])
        vertices = np.array([[2, 2, 0], [2, 10, 0], [12, 2, 2.5], [12, 10, 2.5]], dtype=np.float32)
        triangles = np.array([[0, 1, 2], [1, 3, 2]], dtype=np.int32)
        _, at = self.cut(dataclasses.replace(ramp, vertices_m=vertices, triangles=triangles))
        # the ramp rises 0.25 m per metre from x = 2: inside the slab for 4.8 < x < 8.8
        expected = {
            4.6: cross_section.OPEN,
            5.0: cross_section.SURFACE,
            8.6: cross_section.SURFACE,
            9.0: cross_section.OPEN,
        }
        for x, value in expected.items():
            assert at(x, 5.0) == value, x


def test_a_building_of_300_000_triangles_is_drawn_in_seconds_not_minutes(tmp_path):
    world, log = synthetic()
    rng = np.random.default_rng(0)
    corners = rng.uniform([0, 0, 0], [20, 12, 3], (100_000, 3)).repeat(3, axis=0)
    vertices = (corners + rng.normal(scale=0.03, size=corners.shape)).astype(np.float32)
    triangles = np.arange(300_000, dtype=np.int32).reshape(-1, 3)
    world = dataclasses.replace(world, vertices_m=vertices, triangles=np.concatenate([triangles] * 3))
    draw(world, log, {}, COMMAND, tmp_path / "first.png")
    begin_s = time.process_time()
    draw(world, log, {}, COMMAND, tmp_path / "a.png")
    assert time.process_time() - begin_s < 10.0  # 0.5 s here


def test_a_failed_trial_says_why(tmp_path):
    world, log = synthetic()
    stuck = dataclasses.replace(log, outcome=Outcome.STUCK, reason="no goal is reachable")
    for name, trial in (("reached.png", log), ("stuck.png", stuck)):
        draw(world, trial, evaluate(trial, world), COMMAND, tmp_path / name)
    assert (tmp_path / "reached.png").read_bytes() != (tmp_path / "stuck.png").read_bytes()
