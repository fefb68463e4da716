"""Trials side by side: every arm in the same worlds, summarised and compared in one place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import pandas as pd

from uavexp.arrays import Bool, Float, Int
from uavexp.errors import RecordError
from uavexp.metrics.metric import Metric
from uavexp.report import significance, statistics
from uavexp.report.labels import RATE
from uavexp.report.significance import Alternative
from uavexp.report.statistics import Interval

FEWEST_SCENES = 6  # with fewer, sign flips of scenes cannot give p < 0.05, nor the bootstrap 95 %
MOST_FAILED = 0.5  # share of an arm's flights: with more failed, nothing is said of what needs arrival
SCENE = "scene"


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmEstimate:
    """Mean of a metric over the trials of an arm."""

    n: int  # trials for which it exists
    mean: float
    sd: float  # over trials; of a rate: over the scenes' rates; NaN with fewer than two
    interval: Interval  # NaN where there is none


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """First arm minus second arm over paired trials."""

    pairs: int
    units: int  # independent ones: scenes, or pairs when there is one scene
    first_mean: float
    second_mean: float
    mean: float
    interval: Interval
    p: float  # sign flips of whole scenes: the primary test
    p_pairs: float  # McNemar for rates, else Wilcoxon: clustering ignored
    effect: float  # rank-biserial; of a rate: the difference itself


@dataclass(frozen=True, kw_only=True)
class Panel:
    """The trials of several arms, a row per world (scene and seed), a column per arm.

    The order of rows does not depend on the order of the trials. Scenes are the independent
    units, so that intervals and tests speak of other scenes like these; with fewer than
    `FEWEST_SCENES` the rows are, and they speak of other seeds in these scenes.
    """

    arms: tuple[str, ...]
    scene: Int  # (U,) number of the scene of each row
    scenes: tuple[str, ...]
    flown: Bool  # (U, A) whether the trial exists
    trials: pd.DataFrame  # (N,) whose columns are read when asked
    place: tuple[Int, Int]  # row and column of each trial
    together: tuple[Metric, ...] = ()  # resampled together, which is faster than one by one
    _blocks: dict[str, Float] = field(default_factory=dict)
    _samples: dict[str, Float] = field(default_factory=dict)

    @property
    def scenes_are_units(self) -> bool:
        """Whether there are scenes enough to be the independent units."""
        return len(self.scenes) >= FEWEST_SCENES

    @property
    def cluster(self) -> Int:
        """Cluster of each row (U,): its scene, or the same for all where rows are the units."""
        return self.scene if self.scenes_are_units else np.zeros_like(self.scene)

    def has(self, metric: Metric) -> bool:
        """Whether the trials have this metric."""
        return metric.column in self.trials

    def block(self, metric: Metric) -> Float:
        """Values (U, A) as stored; NaN where they do not exist."""
        if metric.column not in self._blocks:
            block = np.full(self.flown.shape, math.nan)
            block[self.place] = self.trials[metric.column].to_numpy(dtype=float, na_value=math.nan)
            self._blocks[metric.column] = block
        return self._blocks[metric.column]

    def values(self, metric: Metric, arm: str) -> Float:
        """Values (U,) of one arm in the unit shown; NaN where they do not exist."""
        return self.block(metric)[:, self.arms.index(arm)] * metric.scale

    def success(self, arm: str) -> Bool:
        """Whether each trial (U,) of an arm succeeded; a failed or missing one did not."""
        succeeded: Bool = self.block(RATE)[:, self.arms.index(arm)] == 1.0
        return succeeded

    def n(self, arm: str) -> int:
        """Trials of an arm, failed ones included."""
        return int(self.flown[:, self.arms.index(arm)].sum())

    def samples(self, metric: Metric) -> Float:
        """Resampled means (B, A) of a metric, of every metric from the same resampled worlds."""
        if metric.column not in self._samples:
            asked = self.together if metric in self.together else (metric,)
            there = [item for item in dict.fromkeys(asked) if self.has(item)]
            blocks = [self.block(item) for item in there]
            parts = np.split(statistics.resampled_means(blocks, self.cluster), len(there), axis=1)
            self._samples.update(zip((item.column for item in there), parts, strict=True))
        return self._samples[metric.column]


def panel_of(
    trials: pd.DataFrame, arm_column: str, arms: Sequence[str], *, together: Sequence[Metric] = ()
) -> Panel:
    """Trials of these arms by world; the column `scene`, where there is one, tells the scenes apart.

    Raises:
        RecordError: an arm has two trials with the same scene and seed.
    """
    column = pd.Index(arms).get_indexer(trials[arm_column])
    trials, column = trials[column >= 0], column[column >= 0]
    scene = trials[SCENE].astype(str) if SCENE in trials else pd.Series("", index=trials.index)
    keys = pd.MultiIndex.from_arrays([scene, trials["seed"]])
    units = keys.unique().sort_values()
    place = (units.get_indexer(keys), column)
    flown = np.zeros((len(units), len(arms)), dtype=bool)
    flown[place] = True
    if flown.sum() != len(trials):
        raise RecordError("two trials of one arm with the same scene and seed")
    names = units.get_level_values(0)
    scenes = tuple(names.unique())
    return Panel(
        arms=tuple(arms),
        scene=pd.Index(scenes).get_indexer(names),
        scenes=scenes,
        flown=flown,
        trials=trials,
        place=place,
        together=tuple(together),
    )


def arm_names(trials: pd.DataFrame, arm_axes: Sequence[str]) -> pd.Series:
    """Name of each trial's arm: the values of its axes joined by commas, empty ones left out."""
    names = pd.Series("", index=trials.index)
    for axis in arm_axes:
        values = trials[axis].astype(str)
        names = names + values.where(values == "", ", " + values)
    return names.str.removeprefix(", ")


def estimate(panel: Panel, metric: Metric, arm: str) -> ArmEstimate:
    """Mean of a metric over an arm's trials, with its spread and interval.

    There is none of what needs arrival where fewer than half of the flights succeeded: it would be that of
    flights cut short, or of a vehicle left behind.
    """
    values = panel.values(metric, arm)
    exists = np.isfinite(values)
    if metric.needs_arrival and panel.has(RATE) and panel.success(arm).sum() < MOST_FAILED * panel.n(arm):
        exists[:] = False
    values, scene = values[exists], panel.scene[exists]
    if not values.size:
        return ArmEstimate(n=0, mean=math.nan, sd=math.nan, interval=statistics.NOTHING)
    spread = significance.cluster_means(values, scene) if metric.is_rate else values
    return ArmEstimate(
        n=values.size,
        mean=float(values.mean()),
        sd=float(spread.std(ddof=1)) if spread.size > 1 else math.nan,
        interval=_interval(panel, metric, arm),
    )


def _interval(panel: Panel, metric: Metric, arm: str) -> Interval:
    column = panel.arms.index(arm)
    exists = np.isfinite(panel.block(metric)[:, column])
    cluster = panel.cluster[exists]
    if metric.is_rate:
        low, high = statistics.rate_interval(panel.success(arm)[exists], cluster)
        return Interval(metric.scale * low, metric.scale * high)
    if metric.is_count and not panel.values(metric, arm)[exists].any():
        return statistics.no_event_interval(int(exists.sum()))
    samples = panel.samples(metric)[:, column]
    return interval_of(metric.scale * samples, statistics.units_of(cluster))


def interval_of(samples: Float, units: int) -> Interval:
    """Bootstrap interval of one quantity from its resampled values (B,)."""
    low, high = statistics.percentile_interval(samples[:, None], units)
    return Interval(float(low[0]), float(high[0]))


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """Two arms in the worlds that both were flown in."""

    first: str
    second: str
    scene: Int  # (P,)
    cluster: Int  # (P,) as in the panel
    scenes_are_units: bool  # as in the panel
    columns: dict[str, Float]  # metric -> (P, 2), NaN: does not exist

    @cached_property
    def samples(self) -> dict[str, Float]:
        """Resampled mean differences (B,) of every metric, all resampled together."""
        differences = [values[:, :1] - values[:, 1:] for values in self.columns.values()]
        means = statistics.resampled_means(differences, self.cluster)
        return dict(zip(self.columns, means.T, strict=True))


def pairs_of(
    panel: Panel, first: str, second: str, metrics: Sequence[Metric], *, both_succeeded: bool = False
) -> Pairs:
    """The worlds that two arms were flown in, or only those in which both succeeded."""
    columns = [panel.arms.index(first), panel.arms.index(second)]
    rows = panel.flown[:, columns].all(axis=1)
    if both_succeeded:
        rows &= panel.success(first) & panel.success(second)
    return Pairs(
        first=first,
        second=second,
        scene=panel.scene[rows],
        cluster=panel.cluster[rows],
        scenes_are_units=panel.scenes_are_units,
        columns={metric.column: panel.block(metric)[rows][:, columns] for metric in metrics},
    )


def compare(
    pairs: Pairs, metric: Metric, *, margin: float = 0.0, alternative: Alternative = "two-sided"
) -> Difference:
    """First arm minus second arm in the same worlds.

    Args:
        pairs: the trials of both.
        metric: what is compared.
        margin: added to the difference before it is tested, in the unit shown: with `greater`
            the test asks whether the first arm is worse by less than this.
        alternative: sign of the difference asked about.
    """
    values = metric.scale * pairs.columns[metric.column]
    exist: Bool = np.asarray(np.isfinite(values).all(axis=1))
    one, two, cluster = values[exist, 0], values[exist, 1], pairs.cluster[exist]
    difference = one - two
    if not difference.size:
        return _NO_PAIRS
    p_pairs = (
        significance.mcnemar_p(one > 0.0, two > 0.0)
        if metric.is_rate
        else significance.wilcoxon_p(difference)
    )
    if pairs.scenes_are_units and np.unique(cluster).size < 2:  # nothing of one scene speaks of others
        return replace(
            _NO_PAIRS,
            pairs=difference.size,
            units=1,
            first_mean=float(one.mean()),
            second_mean=float(two.mean()),
            mean=float(difference.mean()),
            p_pairs=p_pairs,
        )
    return Difference(
        pairs=difference.size,
        units=statistics.units_of(cluster),
        first_mean=float(one.mean()),
        second_mean=float(two.mean()),
        mean=float(difference.mean()),
        interval=_difference_interval(pairs, metric, exist),
        p=significance.sign_flip_p(difference + margin, cluster, alternative),
        p_pairs=p_pairs,
        effect=float(difference.mean()) if metric.is_rate else significance.rank_biserial(difference),
    )


_NO_PAIRS = Difference(
    pairs=0,
    units=0,
    first_mean=math.nan,
    second_mean=math.nan,
    mean=math.nan,
    interval=statistics.NOTHING,
    p=math.nan,
    p_pairs=math.nan,
    effect=math.nan,
)


def _difference_interval(pairs: Pairs, metric: Metric, exist: Bool) -> Interval:
    one, two = pairs.columns[metric.column][exist].T
    if metric.is_rate and np.array_equal(one, two):  # the bootstrap has nothing to resample
        low, high = significance.risk_difference_interval(one > 0.0, two > 0.0)
        return Interval(metric.scale * low, metric.scale * high)
    return interval_of(metric.scale * pairs.samples[metric.column], statistics.units_of(pairs.cluster[exist]))
