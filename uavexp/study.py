"""A stored study as people ask of it from Python: its tables, a flight, two arms compared."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from uavexp.errors import ConfigError, RecordError
from uavexp.metrics.evaluate import metric_of
from uavexp.metrics.metric import Metric
from uavexp.parameters import nearest
from uavexp.store import study as store
from uavexp.store.stored_trial import StoredTrial, read_trial

if TYPE_CHECKING:
    from uavexp.report.paired import PairedTest
    from uavexp.report.results import Results


@dataclass(frozen=True, kw_only=True, repr=False)
class Study(store.Study):
    """A folder of flown trials.

    Attributes:
        trials: a DataFrame with a row per trial; units stand in the names of the columns.
        replans: a DataFrame with a row per planning request of every trial; number 0 is the first plan.
        axes: what was varied: axis (a column of both tables) -> its values.
        seeds: of the trials.
    """

    def __repr__(self) -> str:
        axes = [f"{len(values)} {axis}{'s' * (len(values) != 1)}" for axis, values in self.axes.items()]
        seeds = f"{len(self.seeds)} seed{'s' * (len(self.seeds) != 1)}"
        return f"Study({self.name or self.folder}: {', '.join([*(axes or ['1 cell']), seeds])})"

    @property
    def arms(self) -> tuple[str, ...]:
        """Names of what was flown in the same worlds, as tables have them and `compare` takes them."""
        return self._results.arms

    @property
    def _results(self) -> Results:
        from uavexp.report.results import Results  # pandas, a second

        return Results(study=self)

    def trial(self, which: int | str) -> StoredTrial:
        """A stored flight: its `log` and `world`.

        Args:
            which: row of `trials`, from 0, or what stands in its column `trial`.

        Raises:
            ConfigError: there is no such trial.
            RecordError: its log is not in the folder, or damaged.
        """
        names = self.trials["trial"].tolist()
        if isinstance(which, str) and which in names:
            return read_trial(self.folder / store.TRIALS / which)
        if isinstance(which, int) and -len(names) <= which < len(names):
            name = names[which]
            if not self.has_log(name):
                raise RecordError(
                    f"the log of {name} was not kept in {self.folder}; fly it anew by its command"
                )
            return read_trial(self.folder / store.TRIALS / name)
        raise ConfigError(
            f"{self.folder} has no trial {which!r}: 0 to {len(names) - 1}, or one of column trial"
        )

    def compare(self, a: str, b: str, metric: str, *, both_succeeded: bool = False) -> PairedTest:
        """Arm a minus arm b in the worlds that both flew in.

        Args:
            a: name of an arm (`arms`).
            b: name of another one.
            metric: column of `trials`, e.g. "path_length_m".
            both_succeeded: only worlds in which both did: a path cut short is not a shorter path.

        Returns:
            Difference with 95 % interval in the unit shown, p value, effect; as `str` one sentence.

        Raises:
            ConfigError: no such arm or metric.
        """
        from uavexp.report.paired import paired_test
        from uavexp.report.results import Results

        results = Results(study=self, shown=(chosen := self._metric(metric),))
        for arm in (a, b):
            if arm not in results.arms:
                known = ", ".join(results.arms)
                raise ConfigError(f"no arm {arm!r}{nearest(arm, results.arms)}; {self.folder} has {known}")
        return paired_test(results.panel, chosen, a, b, both_succeeded=both_succeeded)

    def _metric(self, column: str) -> Metric:
        numbers = self.trials.select_dtypes(include=("number", "bool")).columns
        if column not in numbers:
            raise ConfigError(
                f"metric {column!r} is no column of numbers in {self.folder}{nearest(column, numbers)}"
            )
        return metric_of(column)


def read_study(folder: str | Path) -> Study:
    """Read a folder that `python -m uavexp` left behind; its tables are read when used.

    Args:
        folder: of a study, e.g. "outputs/0001-mcr-rooms".

    Raises:
        RecordError: no study, or a damaged one.
    """
    found = store.read_study(Path(folder))
    return Study(**{item.name: getattr(found, item.name) for item in dataclasses.fields(found)})
