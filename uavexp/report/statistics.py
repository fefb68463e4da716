"""Means and rates with intervals, for trials that come in scenes.

Trials of one scene are alike, so a scene, not a trial, is the independent unit: every
interval here widens with the spread between scenes. Values that do not exist (a metric of
a trial that did not run to its end) are NaN and are left out of the mean, never out of
the success rate, for which such a trial is a failure.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats

from uavexp.arrays import Bool, Float

LEVEL = 0.95
RESAMPLES, RESAMPLES_OF_MANY = 4000, 2000
SEED = 20260310  # of the resampling, fixed: the same trials give the same interval
_MANY_ROWS = 10_000  # then the scenes decide, and time counts
_DRAWS_AT_ONCE = 2_000_000
_ROUNDING = 1e-12  # relative; means of equal values differ by less

Labels = npt.NDArray[Any]


class Interval(NamedTuple):
    """Lower and upper end of a confidence interval."""

    low: float
    high: float


NOTHING = Interval(math.nan, math.nan)


def wilson_interval(successes: float, n: float, level: float = LEVEL) -> Interval:
    """Score interval of a proportion of independent trials.

    Args:
        successes: number of successes, 0 to n; a fraction when n is an effective size.
        n: number of trials; 0 gives NaN.
        level: of confidence.

    Source: Wilson 1927, "Probable inference, the law of succession, and statistical inference".
    """
    if n <= 0:
        return NOTHING
    z = float(stats.norm.ppf(0.5 + 0.5 * level))
    rate = successes / n
    centre = (rate + z * z / (2.0 * n)) / (1.0 + z * z / n)
    half = z / (1.0 + z * z / n) * math.sqrt(rate * (1.0 - rate) / n + z * z / (4.0 * n * n))
    return Interval(max(centre - half, 0.0), min(centre + half, 1.0))


def no_event_interval(n: int, level: float = LEVEL) -> Interval:
    """Interval of the mean of a count that was zero in every one of n independent trials.

    The exact upper end for a Poisson count, 3.7 / n at 95 %: the "rule of three", two-sided. As
    with a rate of 0 or 1, nothing shows how trials cluster, and n itself is taken.

    Source: Garwood 1936, "Fiducial limits for the Poisson distribution".
    """
    return Interval(0.0, -math.log(0.5 * (1.0 - level)) / n) if n else NOTHING


def effective_size(success: Bool, cluster: Labels, level: float = LEVEL) -> float:
    """Number of independent trials that tell as much about a rate as these clustered ones.

    The trials divided by their design effect (never below 1), and reduced for estimating
    it from few clusters. A rate of 0 or 1, or one cluster, shows no clustering: n itself.

    Args:
        success: (N,) of each trial.
        cluster: (N,) scene of each trial.
        level: of the interval to be made of it.

    Source: Rao and Scott 1992, "A simple method for the analysis of clustered binary data",
    design effect; Korn and Graubard 1998, "Confidence intervals for proportions with small
    expected number of positive counts estimated from survey data", degrees of freedom.
    """
    n, rate = success.size, float(success.mean()) if success.size else math.nan
    index = np.unique(cluster, return_inverse=True)[1]
    sizes = np.bincount(index)
    if sizes.size < 2 or rate in (0.0, 1.0):
        return float(n)
    clusters = sizes.size
    residuals = np.bincount(index, weights=success) - sizes * rate
    variance = clusters / (clusters - 1) * float(residuals @ residuals) / n**2
    design_effect = max(n * variance / (rate * (1.0 - rate)), 1.0)
    normal, few = (float(stats.t.ppf(0.5 + 0.5 * level, freedom - 1)) for freedom in (n, clusters))
    return float(n / design_effect * (normal / few) ** 2)


def rate_interval(success: Bool, cluster: Labels, level: float = LEVEL) -> Interval:
    """Wilson's interval of a rate over clustered trials, made with their effective number.

    Args:
        success: (N,) of each trial.
        cluster: (N,) scene of each trial.
        level: of confidence.

    Source: Wilson 1927 with `effective_size`.
    """
    if not success.size:
        return NOTHING
    n = effective_size(success, cluster, level)
    return wilson_interval(float(success.mean()) * n, n, level)


def resampled_means(
    blocks: Sequence[Float], cluster: Labels, *, resamples: int | None = None, seed: int = SEED
) -> Float:
    """Means of resampled trials: scenes drawn with replacement, then rows within each of them.

    All columns of a row stay together, so that differences and ratios of columns keep the
    pairing by seed.

    Args:
        blocks: each (N, ...) one row per scene and seed, C columns in all; NaN where a value does not
            exist. They are put side by side one scene at a time.
        cluster: (N,) scene of each row; with a single scene only its rows are resampled.
        resamples: number B of resamples; by default 4000, or 2000 of more than 10,000 rows.
        seed: of the generator.

    Returns:
        (B, C) means over the values that exist; NaN where a resample has none.

    Source: Davison and Hinkley 1997, "Bootstrap methods and their application", section 3.8.
    """
    columns = sum(block.shape[1] for block in blocks)
    resamples = resamples or (RESAMPLES if len(cluster) <= _MANY_ROWS else RESAMPLES_OF_MANY)
    index = np.unique(cluster, return_inverse=True)[1]
    clusters = int(index.max()) + 1 if index.size else 0
    rng = np.random.default_rng(seed)
    chosen = rng.integers(max(clusters, 1), size=(resamples, clusters))
    total = np.zeros((resamples, 2 * columns))
    for scene in range(clusters):
        values = np.concatenate([block[index == scene] for block in blocks], axis=1)
        exists = np.isfinite(values)
        rows = np.concatenate([np.where(exists, values, 0.0), exists], axis=1)
        times = (chosen == scene).sum(axis=1)
        if len(rows) > _MANY_ROWS:
            total += _limit_of_resampled_sums(rows, times, rng)
            continue
        for some in _batches(resamples, len(rows)):
            total[some] += _resampled_sums(rows, times[some], rng)
    with np.errstate(invalid="ignore"):
        return np.asarray(total[:, :columns] / total[:, columns:])


def _batches(resamples: int, rows: int) -> Iterator[slice]:
    step = max(1, _DRAWS_AT_ONCE // max(rows, 1))
    return (slice(start, start + step) for start in range(0, resamples, step))


def _resampled_sums(rows: Float, times: npt.NDArray[np.int64], rng: np.random.Generator) -> Float:
    """Sums (B, C) over `times[b]` resamples of all the rows (n, C)."""
    n = len(rows)
    draw = rng.integers(n, size=int(times.sum()) * n)
    draw += np.repeat(n * np.arange(times.size), times * n)
    weights = np.bincount(draw, minlength=times.size * n).reshape(times.size, n)
    return np.asarray(weights.astype(float) @ rows)


def _limit_of_resampled_sums(rows: Float, times: npt.NDArray[np.int64], rng: np.random.Generator) -> Float:
    """The same over very many rows, drawn from the normal distribution that such sums then have.

    Its covariance is `times[b]` n times that of the rows, Rᵀ R / n with R of their QR decomposition, which
    leaves a column of equal values without any spread.
    """
    mean, times = rows.mean(axis=0), times[:, None]
    factor = np.linalg.qr(rows - mean, mode="r")
    spread = rng.standard_normal((times.size, len(factor))) @ factor
    return np.asarray(times * len(rows) * mean + np.sqrt(times) * spread)


def percentile_interval(samples: Float, units: int, level: float = LEVEL) -> tuple[Float, Float]:
    """Ends of the bootstrap interval, widened for the number of independent units.

    Plain percentiles are too narrow for few units: with ten scenes 95 % intervals cover about
    90 %. The expanded percentiles are as wide as Student's t asks for.

    Args:
        samples: (B, C) of `resampled_means`, or any function of its columns.
        units: independent units behind them: scenes, or rows when there is one scene.
        level: of confidence.

    Returns:
        Lower and upper ends (C,); NaN with fewer than two units, and where all samples are the
        same: equal values leave nothing to resample, which is no evidence that others would equal them.

    Source: Hesterberg 2015, "What teachers should know about the bootstrap", section 5.
    """
    if units < 2 or not len(samples):
        nothing = np.full(samples.shape[1:], math.nan)
        return nothing, nothing
    reach = math.sqrt(units / (units - 1)) * float(stats.t.ppf(0.5 + 0.5 * level, units - 1))
    tail = float(stats.norm.cdf(-reach))
    finite = bool(np.isfinite(samples).all())
    quantile = np.quantile if finite else _quantile_of_existing
    low, high = quantile(samples, [tail, 1.0 - tail], axis=0)
    alike = high - low <= _ROUNDING * np.maximum(np.abs(low), np.abs(high))
    return np.where(alike, math.nan, low), np.where(alike, math.nan, high)


def _quantile_of_existing(samples: Float, levels: list[float], axis: int) -> Float:
    empty = ~np.isfinite(samples).any(axis=axis)
    filled = np.where(empty, 0.0, samples)
    return np.where(empty, math.nan, np.nanquantile(filled, levels, axis=axis))


def units_of(cluster: Labels) -> int:
    """Number of independent units: scenes, or rows when there is only one scene."""
    scenes = int(np.unique(cluster).size)
    return scenes if scenes > 1 else int(cluster.size)


def mean_interval(values: Float, cluster: Labels, level: float = LEVEL) -> Interval:
    """Bootstrap interval of one mean over clustered trials.

    Args:
        values: (N,) one per trial; NaN where it does not exist.
        cluster: (N,) scene of each trial.
        level: of confidence.

    Source: `resampled_means` and `percentile_interval`.
    """
    exists = np.isfinite(values)
    samples = resampled_means([values[exists, None]], cluster[exists])
    low, high = percentile_interval(samples, units_of(cluster[exists]), level)
    return Interval(float(low[0]), float(high[0]))
