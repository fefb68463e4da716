"""What must hold of the statistics whatever the numbers are."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from uavexp.report import significance, statistics

COUNTS = st.integers(1, 400).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))
SCENES = st.lists(
    st.lists(st.floats(-5.0, 5.0).map(lambda x: round(x, 3)), min_size=1, max_size=6), min_size=2, max_size=8
)


def flat(scenes: list[list[float]]) -> tuple[np.ndarray, np.ndarray]:
    return np.concatenate(scenes), np.repeat(np.arange(len(scenes)), [len(scene) for scene in scenes])


@given(COUNTS)
def test_wilson_holds_its_rate_lies_in_0_1_and_mirrors(counts: tuple[int, int]) -> None:
    successes, n = counts
    ends = statistics.wilson_interval(successes, n)
    assert 0.0 <= ends.low <= successes / n + 1e-12
    assert successes / n - 1e-12 <= ends.high <= 1.0
    mirrored = statistics.wilson_interval(n - successes, n)
    np.testing.assert_allclose((1.0 - ends.high, 1.0 - ends.low), mirrored, atol=1e-12)


@given(COUNTS)
def test_wilson_narrows_with_the_same_rate_from_more_trials(counts: tuple[int, int]) -> None:
    few, many = (statistics.wilson_interval(times * counts[0], times * counts[1]) for times in (1, 4))
    assert many.high - many.low < few.high - few.low


@given(st.lists(st.lists(st.booleans(), min_size=1, max_size=8), min_size=1, max_size=8))
def test_clustering_never_makes_a_rate_surer(scenes: list[list[bool]]) -> None:
    success, scene = np.concatenate(scenes), np.repeat(np.arange(len(scenes)), [len(s) for s in scenes])
    assert 0.0 <= statistics.effective_size(success, scene) <= success.size * (1.0 + 1e-9)


@given(SCENES, st.randoms(use_true_random=False))
def test_order_and_names_of_scenes_do_not_matter_to_p(scenes: list[list[float]], random: object) -> None:
    values, scene = flat(scenes)
    order = list(range(values.size))
    random.shuffle(order)  # type: ignore[attr-defined]
    p = significance.sign_flip_p(values, scene)
    assert abs(significance.sign_flip_p(values[order], 100 - scene[order]) - p) < 1e-12


@given(SCENES)
def test_p_is_symmetric_and_the_two_sides_cover_everything(scenes: list[list[float]]) -> None:
    values, scene = flat(scenes)
    p = significance.sign_flip_p(values, scene)
    assert abs(significance.sign_flip_p(-values, scene) - p) < 1e-12
    assert significance.smallest_p(len(scenes)) - 1e-12 <= p <= 1.0
    greater = significance.sign_flip_p(values, scene, "greater")
    less = significance.sign_flip_p(values, scene, "less")
    assert greater + less >= 1.0 - 1e-12
    assert abs(significance.sign_flip_p(-values, scene, "less") - greater) < 1e-12


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_holm_only_raises_keeps_order_and_is_below_bonferroni(p_values: list[float]) -> None:
    p = np.array(p_values)
    adjusted = significance.holm(p)
    assert (adjusted >= p - 1e-15).all()
    assert (adjusted <= np.minimum(len(p) * p, 1.0) + 1e-12).all()
    order = np.argsort(p, kind="stable")
    assert (np.diff(adjusted[order]) >= -1e-15).all()


@given(SCENES)
def test_the_bootstrap_of_a_shifted_metric_is_shifted(scenes: list[list[float]]) -> None:
    values, scene = flat(scenes)
    ends = statistics.mean_interval(values, scene)
    assume(np.ptp(values) == 0.0 or np.ptp(values) > 1e-6)
    if np.ptp(values) == 0.0:  # nothing to resample
        assert np.isnan(ends).all()
        return
    assert min(values) - 1e-9 <= ends.low <= ends.high <= max(values) + 1e-9
    shifted = statistics.mean_interval(values + 3.0, scene)
    np.testing.assert_allclose(shifted, np.array(ends) + 3.0, atol=1e-9)
