"""The figure of first plans: what it draws is what was planned."""

from __future__ import annotations

import numpy as np
import pytest

from tests.logs import changed, make_log, make_world, still_curve
from tests.unit.metrics.test_metrics_plan import cubic
from tests.unit.planner.find.tree.test_tree import plan
from uavexp.report.figures.first_plans import draw
from uavexp.report.flights import SharedWorld
from uavexp.report.looks import Look

LOOKS = {name: Look(colour, "o", "-") for name, colour in (("a", "C0"), ("b", "C1"))}


def shared(**logs):
    return SharedWorld(
        scene="", seed=3, world=make_world([]), logs=logs, trials={name: name for name in logs}
    )


def test_profiles_are_the_norms_of_the_plan_below_their_limits() -> None:
    """x = t³/6 over 4 s: speed t²/2, acceleration t."""
    drawing = draw("first_plans", shared(a=cubic()), LOOKS)
    assert drawing is not None
    _, speed, acceleration = drawing.figure.axes
    for axes, value in ((speed, lambda t: t**2 / 2), (acceleration, lambda t: t)):
        times_s, norms = axes.lines[0].get_data()
        assert times_s[[0, -1]] == pytest.approx([0.0, 4.0])
        assert norms == pytest.approx(value(times_s))
        assert axes.lines[1].get_ydata() == pytest.approx([9.0, 9.0])  # the limit


def test_the_tree_is_of_the_first_arm_that_has_one() -> None:
    edges = np.array([[[0.0, 6.0, 1.2], [1.0, 6.0, 1.2]]], dtype=np.float32)
    with_tree = changed(cubic(), plan_tree_m=edges)
    drawing = draw("first_plans", shared(a=cubic(), b=with_tree), LOOKS)
    assert drawing is not None
    assert "tree that b ended with" in drawing.caption
    drawn = [part for part in drawing.figure.axes[0].collections if len(part.get_segments()) == 1]
    assert len(drawn) == 1


def test_without_a_plan_there_is_nothing_to_draw() -> None:
    assert draw("first_plans", shared(a=make_log(still_curve(), still_curve())), LOOKS) is None


def test_df_bitstar_hands_its_tree_over() -> None:
    """Every edge of the tree ends where another begins, or at the root: one tree, not loose edges."""
    result = plan(edges="straight")
    assert len(result.tree_m) > len(result.path_m) - 2
    ends = {tuple(point) for point in result.tree_m[:, 1]}
    begins = {tuple(point) for point in result.tree_m[:, 0]}
    assert len(begins - ends) == 1
