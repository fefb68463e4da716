"""Whether two arms differ, flown in the same worlds: paired tests, corrections, sizes of effects.

The primary test is `sign_flip_p`, which takes a whole scene as one observation. McNemar's
and Wilcoxon's tests, which take every flight as one, stand beside it: with scenes that
differ they say "significant" too easily.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from scipy import stats

from uavexp.arrays import Bool, Float
from uavexp.report.statistics import LEVEL, Interval, Labels

Alternative = Literal["two-sided", "greater", "less"]

ALPHA = 0.05
_MOST_RANKED = 13  # pairs: exact with ties, too, which SciPy permutes one by one
_MOST_FLIPPED = 20  # all 2**20 patterns of signs are listed; above, their normal limit


def cluster_means(differences: Float, cluster: Labels) -> Float:
    """Mean difference of each scene; with a single scene the differences themselves.

    Args:
        differences: (N,) of paired trials; NaN where a pair does not exist.
        cluster: (N,) scene of each pair.

    Returns:
        (K,) one number per independent unit.
    """
    exists = np.isfinite(differences)
    differences, index = differences[exists], np.unique(cluster[exists], return_inverse=True)[1]
    if not index.size or index.max() == 0:
        return differences
    return np.asarray(np.bincount(index, weights=differences) / np.bincount(index))


def sign_flip_p(differences: Float, cluster: Labels, alternative: Alternative = "two-sided") -> float:
    """Probability of such a mean difference if each scene might as well have had the other sign.

    Exact up to 20 scenes that differ; with more, the normal limit of the same distribution.

    Args:
        differences: (N,) of paired trials; NaN where a pair does not exist.
        cluster: (N,) scene of each pair; a single scene flips pair by pair.
        alternative: sign of the mean difference asked about.

    Returns:
        p value; NaN without a pair. Never below `smallest_p`.

    Source: Fisher 1935, "The design of experiments", section 21; for clusters Canay, Romano
    and Shaikh 2017, "Randomization tests under an approximate symmetry assumption".
    """
    means = cluster_means(differences, cluster)
    if not means.size:
        return math.nan
    means = means[means != 0.0]  # a flipped zero is the same
    observed = float(means.sum()) * (-1.0 if alternative == "less" else 1.0)
    if means.size > _MOST_FLIPPED:
        z = observed / math.sqrt(float(means @ means))
        return float(2.0 * stats.norm.sf(abs(z)) if alternative == "two-sided" else stats.norm.sf(z))
    if not means.size:
        return 1.0
    two_sided = alternative == "two-sided"
    # of the patterns with the first sign turned, too, the sums are the same with the other sign
    sums, others = (means[:1], means[1:]) if two_sided else (np.zeros(1), means)
    for mean in others:
        sums = np.concatenate([sums + mean, sums - mean])
    if two_sided:
        sums, observed = np.abs(sums), abs(observed)
    rounding = 1e-9 * float(np.abs(means).sum())
    return float(np.mean(sums >= observed - rounding))


def smallest_p(units: int, alternative: Alternative = "two-sided") -> float:
    """Least p value that `sign_flip_p` can give: with few scenes nothing is significant."""
    return min(1.0, (2.0 if alternative == "two-sided" else 1.0) * 0.5**units)


def mcnemar_p(first: Bool, second: Bool) -> float:
    """Exact McNemar test of two success rates over the same trials, clustering ignored.

    Args:
        first: (N,) success of one arm.
        second: (N,) success of the other in the same worlds.

    Source: McNemar 1947, "Note on the sampling error of the difference between correlated
    proportions or percentages"; exact form: binomial test of the discordant pairs.
    """
    only_first, only_second = int((first & ~second).sum()), int((second & ~first).sum())
    discordant = only_first + only_second
    return float(stats.binomtest(only_first, discordant).pvalue) if discordant else 1.0


def wilcoxon_p(differences: Float) -> float:
    """Wilcoxon signed-rank test, zeros left out, clustering ignored; NaN without a pair.

    Args:
        differences: (N,) of paired trials; NaN where a pair does not exist.

    Source: Wilcoxon 1945, "Individual comparisons by ranking methods".
    """
    differences = differences[np.isfinite(differences)]
    if not differences.size:
        return math.nan
    differences = differences[differences != 0.0]
    if differences.size <= _MOST_RANKED:
        signed = stats.rankdata(np.abs(differences)) * np.sign(differences)
        return sign_flip_p(signed, np.arange(signed.size)) if signed.size else 1.0
    return float(stats.wilcoxon(differences).pvalue)


def holm(p_values: Float) -> Float:
    """Corrects p values for their number; NaN stays NaN and does not count.

    Args:
        p_values: (M,) of one family of tests.

    Returns:
        (M,) adjusted values, at most 1; each below alpha is significant at that family-wise level.

    Source: Holm 1979, "A simple sequentially rejective multiple test procedure".
    """
    adjusted = np.full(p_values.shape, math.nan)
    tested = np.flatnonzero(np.isfinite(p_values))
    order = tested[np.argsort(p_values[tested], kind="stable")]
    steps = p_values[order] * (order.size - np.arange(order.size))
    adjusted[order] = np.minimum(np.maximum.accumulate(steps), 1.0) if order.size else steps
    return adjusted


def rank_biserial(differences: Float) -> float:
    """Matched-pairs rank-biserial correlation, -1 to 1: share of rank sums for minus against.

    Args:
        differences: (N,) of paired trials; NaN where a pair does not exist.

    Returns:
        1 when every difference is positive, 0 without a difference, NaN without a pair.

    Source: Kerby 2014, "The simple difference formula".
    """
    differences = differences[np.isfinite(differences)]
    if not differences.size:
        return math.nan
    differences = differences[differences != 0.0]
    if not differences.size:
        return 0.0
    ranks = stats.rankdata(np.abs(differences))
    return float(ranks @ np.sign(differences) / ranks.sum())


def risk_difference_interval(first: Bool, second: Bool, level: float = LEVEL) -> Interval:
    """Interval of the difference of two paired success rates, clustering ignored.

    It exists where the bootstrap has nothing to resample: when no pair differs.

    Args:
        first: (N,) success of one arm.
        second: (N,) success of the other in the same worlds.
        level: of confidence.

    Source: Bonett and Price 2012, "Adjusted Wald confidence interval for a difference of
    binomial proportions based on paired data".
    """
    n = first.size + 2
    only_first = (int((first & ~second).sum()) + 1) / n
    only_second = (int((second & ~first).sum()) + 1) / n
    difference = only_first - only_second
    z = float(stats.norm.ppf(0.5 + 0.5 * level))
    half = z * math.sqrt((only_first + only_second - difference**2) / n)
    return Interval(max(difference - half, -1.0), min(difference + half, 1.0))
