"""Statistics of the report, against published examples, scipy, and simulation."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy import stats

from uavexp.report import significance, statistics


@pytest.mark.parametrize(("successes", "n"), [(0, 10), (10, 10), (3, 10), (81, 263), (15, 148), (1, 29)])
def test_wilson_is_scipys(successes: int, n: int) -> None:
    ends = stats.binomtest(successes, n).proportion_ci(0.95, method="wilson")
    assert statistics.wilson_interval(successes, n) == pytest.approx((ends.low, ends.high), abs=1e-12)


def test_wilson_as_published() -> None:
    # Newcombe 1998, "Two-sided confidence intervals for the single proportion", table I, method 3
    assert statistics.wilson_interval(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert statistics.wilson_interval(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)


def test_no_trial_has_no_interval() -> None:
    assert all(math.isnan(end) for end in statistics.wilson_interval(0, 0))
    empty = np.zeros(0, dtype=bool)
    assert all(math.isnan(end) for end in statistics.rate_interval(empty, empty))


def test_independent_trials_keep_nearly_their_number_and_identical_ones_count_once() -> None:
    scenes = np.repeat(np.arange(50), 20)
    rng = np.random.default_rng(0)
    independent = rng.random(1000) < 0.7
    assert 800 < statistics.effective_size(independent, scenes) <= 1000
    same_in_a_scene = np.repeat(rng.random(50) < 0.7, 20)
    few = statistics.effective_size(same_in_a_scene, scenes)
    # a scene then tells as much as one trial, less what 49 degrees of freedom cost
    assert few == pytest.approx(50 * (1.962 / 2.010) ** 2 * 49 / 50, rel=0.01)


def test_rate_without_failure_is_plain_wilson() -> None:
    success = np.ones(40, dtype=bool)
    assert statistics.rate_interval(success, np.repeat(np.arange(4), 10)) == statistics.wilson_interval(
        40, 40
    )


def test_intervals_cover_the_truth_when_scenes_differ() -> None:
    rng = np.random.default_rng(4)
    scene, runs = np.repeat(np.arange(10), 12), 250
    mean_hits = rate_hits = plain_hits = 0
    for _ in range(runs):
        values = rng.normal(0.0, 1.0, 10)[scene] + rng.normal(0.0, 1.5, scene.size)
        samples = statistics.resampled_means([values[:, None]], scene, resamples=600)
        low, high = statistics.percentile_interval(samples, 10)
        mean_hits += bool(low[0] <= 0.0 <= high[0])
        success = rng.random(scene.size) < rng.beta(4.0, 1.0, 10)[scene]
        ends = statistics.rate_interval(success, scene)
        rate_hits += ends.low <= 0.8 <= ends.high
        ends = statistics.wilson_interval(int(success.sum()), success.size)
        plain_hits += ends.low <= 0.8 <= ends.high
    assert 0.91 < mean_hits / runs < 0.99
    assert 0.90 < rate_hits / runs < 0.99
    assert plain_hits / runs < 0.85  # what happens when scenes are forgotten


def test_resampling_has_the_spread_of_two_stages() -> None:
    """Against the closed form: variance of scene means, and within scenes, both over their numbers."""
    rng = np.random.default_rng(1)
    values = rng.normal(0.0, 1.0, (10, 30)) + rng.normal(0.0, 0.5, (10, 1))
    samples = statistics.resampled_means(
        [values.reshape(-1, 1)], np.repeat(np.arange(10), 30), resamples=20_000
    )
    expected = values.mean(axis=1).var() / 10 + values.var(axis=1).mean() / 300
    assert samples.var() == pytest.approx(expected, rel=0.05)
    assert samples.mean() == pytest.approx(values.mean(), abs=0.005)


def test_one_scene_resamples_its_rows() -> None:
    values = np.random.default_rng(2).gamma(2.0, size=200)
    ends = statistics.mean_interval(values, np.zeros(200))
    scipys = stats.bootstrap((values,), np.mean, method="percentile", random_state=1).confidence_interval
    assert ends == pytest.approx((scipys.low, scipys.high), abs=0.04)


def test_missing_values_leave_the_mean_not_the_pairing() -> None:
    values = np.array([[1.0, 10.0], [2.0, math.nan], [3.0, 30.0], [4.0, 40.0]])
    samples = statistics.resampled_means([values], np.array([0, 0, 1, 1]), resamples=500)
    both = np.array([[1.0, 10.0], [3.0, 30.0], [4.0, 40.0]])
    paired = statistics.resampled_means([both], np.array([0, 1, 1]), resamples=500)
    assert np.allclose(10.0 * paired[:, 0], paired[:, 1])
    assert np.nanmin(samples[:, 1]) >= 10.0
    assert np.nanmax(samples[:, 1]) <= 40.0
    assert np.isfinite(samples[:, 0]).all()


def test_same_trials_same_interval() -> None:
    values, scene = np.arange(20.0), np.repeat([0, 1], 10)
    assert statistics.mean_interval(values, scene) == statistics.mean_interval(values, scene)


def test_many_rows_in_batches_give_means_around_the_mean() -> None:
    values = np.random.default_rng(3).normal(5.0, 1.0, (12_000, 1))
    samples = statistics.resampled_means([values], np.repeat([0, 1], 6000))
    assert len(samples) == statistics.RESAMPLES_OF_MANY
    assert samples.mean() == pytest.approx(values.mean(), abs=0.005)


def test_very_many_rows_have_the_intervals_of_rows_drawn_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    rng, scene = np.random.default_rng(5), np.repeat(np.arange(8), 3000)
    values = np.column_stack([rng.gamma(2.0, size=scene.size) + scene, rng.normal(3.0, 1.0, scene.size)])
    values[rng.random(values.shape) < 0.1] = math.nan
    columns = np.column_stack([values, 2.0 * values[:, 0], np.full(scene.size, 0.1)])
    drawn = statistics.resampled_means([columns[:, :1], columns[:, 1:]], scene, resamples=4000)
    monkeypatch.setattr(statistics, "_MANY_ROWS", 1000)
    limit = statistics.resampled_means([columns], scene, resamples=4000)
    for ours, theirs in zip(
        statistics.percentile_interval(limit, 8), statistics.percentile_interval(drawn, 8), strict=True
    ):
        np.testing.assert_allclose(ours[0], theirs[0], atol=0.1 * np.nanstd(drawn[:, 0]) + 0.05)
        np.testing.assert_allclose(ours[1], theirs[1], atol=0.002)
        assert math.isnan(ours[3]), "equal values have no interval"
        assert math.isnan(theirs[3])
    np.testing.assert_allclose(limit[:, 2], 2.0 * limit[:, 0], rtol=1e-9)
    within = statistics.resampled_means([columns[:, 1:2]], np.zeros(scene.size), resamples=4000)
    assert within.std() == pytest.approx(np.nanstd(values[:, 1]) / math.sqrt(0.9 * scene.size), rel=0.05)


def test_one_unit_has_no_bootstrap_interval() -> None:
    assert all(math.isnan(end) for end in statistics.mean_interval(np.array([3.0]), np.array([0])))


@pytest.mark.parametrize("value", [0.0, 0.1, 7.0])
def test_equal_values_have_no_bootstrap_interval(value: float) -> None:
    """Used to be one of no width, as if further flights could not differ."""
    values, scene = np.full(200, value), np.repeat(np.arange(10), 20)
    assert all(math.isnan(end) for end in statistics.mean_interval(values, scene))
    ends = statistics.mean_interval(np.append(values[:-1], value + 1.0), scene)
    assert ends.low < ends.high


def test_no_event_in_n_flights_bounds_their_mean() -> None:
    """At the upper end, no event in any of n flights has probability 2.5 % (Poisson)."""
    ends = statistics.no_event_interval(200)
    assert ends.low == 0.0
    assert stats.poisson.cdf(0, 200 * ends.high) == pytest.approx(0.025)


def brute_force_p(means: list[float]) -> float:
    observed = abs(sum(means))
    patterns = list(itertools.product([1.0, -1.0], repeat=len(means)))
    sums = [abs(sum(s * m for s, m in zip(signs, means, strict=True))) for signs in patterns]
    return sum(total >= observed - 1e-12 for total in sums) / len(patterns)


@pytest.mark.parametrize("means", [[1.0, 2.0, 3.0], [1.0, -2.0, 0.5, 0.25], [0.1, 0.0, 0.3, 0.0], [0.2] * 10])
def test_sign_flips_of_scenes_by_brute_force(means: list[float]) -> None:
    differences = np.repeat(means, 4) + np.tile([0.5, -0.5, 0.25, -0.25], len(means))
    scene = np.repeat(np.arange(len(means)), 4)
    assert significance.sign_flip_p(differences, scene) == pytest.approx(brute_force_p(means))


def test_ten_scenes_that_agree_reach_the_smallest_p() -> None:
    differences, scene = np.full(200, 0.3), np.repeat(np.arange(10), 20)
    assert significance.sign_flip_p(differences, scene) == 2 / 1024 == significance.smallest_p(10)
    assert significance.sign_flip_p(differences, scene, "greater") == 1 / 1024
    assert significance.sign_flip_p(differences, scene, "less") == 1.0


def test_more_flights_in_the_same_scenes_are_no_more_evidence() -> None:
    """A test that forgets the scenes says 1e-6 where three of four scenes say nothing."""
    scene = np.repeat(np.arange(4), 50)
    differences = np.array([1.0, 0.9, 1.1, -0.2])[scene] + np.random.default_rng(0).normal(0, 0.1, 200)
    assert significance.sign_flip_p(differences, scene) >= 2 / 16
    assert significance.wilcoxon_p(differences) < 1e-6


def test_sign_flips_of_one_scene_of_successes_are_mcnemar() -> None:
    first = np.array([True] * 9 + [False] * 2 + [True] * 30)
    second = np.array([False] * 9 + [True] * 2 + [True] * 30)
    p = significance.sign_flip_p(first.astype(float) - second, np.zeros(first.size))
    assert p == pytest.approx(significance.mcnemar_p(first, second))


def test_many_scenes_use_the_normal_limit_of_the_same_distribution() -> None:
    rng = np.random.default_rng(5)
    differences = rng.normal(0.25, 1.0, 60)
    signs = rng.choice([-1.0, 1.0], (40_000, 60))
    simulated = np.mean(np.abs(signs @ differences) >= abs(differences.sum()))
    assert significance.sign_flip_p(differences, np.arange(60)) == pytest.approx(simulated, abs=0.01)


def test_mcnemar_of_fleiss() -> None:
    # Fagerland, Lydersen, Laake 2013, table 1 (airway hyper-responsiveness): 1 against 7, exact p 0.0703
    first = np.array([True] * 1 + [False] * 7 + [True] * 13)
    second = np.array([False] * 1 + [True] * 7 + [True] * 13)
    assert significance.mcnemar_p(first, second) == pytest.approx(0.0703, abs=5e-5)
    assert significance.mcnemar_p(first, first) == 1.0


def test_holm_by_hand() -> None:
    # sorted 0.005 0.010 0.030 0.040: times 4, 3, 2, 1, never decreasing
    adjusted = significance.holm(np.array([0.01, 0.04, 0.03, 0.005]))
    assert adjusted == pytest.approx([0.03, 0.06, 0.06, 0.02])


def test_holm_passes_over_tests_that_could_not_be_made() -> None:
    adjusted = significance.holm(np.array([math.nan, 0.02, 0.03]))
    assert math.isnan(adjusted[0])
    assert adjusted[1:] == pytest.approx([0.04, 0.04])


def test_rank_biserial_by_hand() -> None:
    # |d| ranks 1 2 3 4; minus: 1; plus: 2 + 3 + 4
    assert significance.rank_biserial(np.array([-1.0, 2.0, 3.0, 4.0])) == pytest.approx(0.8)
    assert significance.rank_biserial(np.array([0.0, 0.0])) == 0.0
    assert significance.rank_biserial(np.array([0.0, 5.0, math.nan])) == 1.0


def test_wilcoxon_leaves_zeros_and_missing_pairs_out() -> None:
    differences = np.array([0.0, 0.5, 1.5, -0.2, 2.5, math.nan, 3.5])
    assert significance.wilcoxon_p(differences) == pytest.approx(
        stats.wilcoxon([0.5, 1.5, -0.2, 2.5, 3.5]).pvalue
    )
    assert significance.wilcoxon_p(np.zeros(5)) == 1.0
    assert math.isnan(significance.wilcoxon_p(np.array([math.nan])))


def test_risk_difference_interval_by_hand() -> None:
    # Bonett and Price 2012: (b + 1, c + 1) over n + 2, Wald; here b = 12, c = 2, n = 50
    first = np.array([True] * 12 + [False] * 2 + [True] * 36)
    second = np.array([False] * 12 + [True] * 2 + [True] * 36)
    one, two = 13 / 52, 3 / 52
    half = 1.959964 * math.sqrt((one + two - (one - two) ** 2) / 52)
    ends = significance.risk_difference_interval(first, second)
    assert ends == pytest.approx((one - two - half, one - two + half), abs=1e-6)
    nothing = significance.risk_difference_interval(first, first)
    assert nothing.low < 0.0 < nothing.high


@pytest.mark.parametrize("units", [5, 10, 40])
def test_percentiles_of_a_normal_bootstrap_give_students_interval(units: int) -> None:
    """A bootstrap has the variance with divisor n; the interval must come out as t asks with n - 1."""
    bootstrap = stats.norm.ppf((np.arange(400_000) + 0.5) / 400_000)[:, None]
    low, high = statistics.percentile_interval(bootstrap, units)
    student = stats.t.ppf(0.975, units - 1) * math.sqrt(units / (units - 1))
    assert (low[0], high[0]) == pytest.approx((-student, student), rel=2e-3)


@pytest.mark.parametrize("differences", [[1.0, -1.0, 2.0, 2.0, 3.0], [0.5, 1.5, -2.5, 4.0], [0.0, 2.0, 2.0]])
def test_wilcoxons_test_of_few_pairs_is_scipys_with_ties_or_without(differences: list[float]) -> None:
    values = np.array(differences)
    expected = stats.wilcoxon(values[values != 0.0]).pvalue
    assert significance.wilcoxon_p(values) == pytest.approx(expected)


def test_of_many_scenes_the_other_side_is_no_evidence() -> None:
    differences, scene = np.random.default_rng(5).normal(0.6, 1.0, 60), np.arange(60)
    greater, less = (significance.sign_flip_p(differences, scene, side) for side in ("greater", "less"))
    assert greater < 0.01
    assert less == pytest.approx(1.0 - greater)


def test_a_resample_without_a_value_is_left_out_of_the_percentiles() -> None:
    every = np.arange(1000.0)
    samples = np.column_stack([every, np.where(every % 10, every, math.nan), np.full(1000, math.nan)])
    low, high = statistics.percentile_interval(samples, 10)
    assert (low[1], high[1]) == pytest.approx((low[0], high[0]), abs=10.0)
    assert math.isnan(low[2])
    assert math.isnan(high[2])
