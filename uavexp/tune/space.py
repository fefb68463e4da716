"""What is tuned: `trigger.interval_s=0.5:5`, `trigger.distance_m=0.2:5:log`, `planner=choice(a,b)`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from uavexp.config.overrides import Setting, parse_settings, render
from uavexp.errors import ConfigError

if TYPE_CHECKING:
    import optuna

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?"
_RANGE = re.compile(rf"({_NUMBER}):({_NUMBER})(:log)?", re.IGNORECASE)
_CHOICE = re.compile(r"choice\((.+)\)")
_DIGITS = 4  # of a number tried: more would tell nothing apart, and labels are read


@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """A parameter that takes any number between two."""

    key: str
    low: float
    high: float
    is_log: bool  # drawn evenly over its logarithm
    is_whole: bool  # typed without a point at either end

    def suggest(self, trial: optuna.Trial) -> Any:
        """The number to try next."""
        if self.is_whole:
            return trial.suggest_int(self.key, round(self.low), round(self.high), log=self.is_log)
        drawn = trial.suggest_float(self.key, self.low, self.high, log=self.is_log)
        return min(self.high, max(self.low, float(f"{drawn:.{_DIGITS}g}")))

    def holds(self, value: Any) -> bool:
        """Whether a value may be tried."""
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        return is_number and self.low <= value <= self.high and (isinstance(value, int) or not self.is_whole)

    def as_drawn(self, value: Any) -> Any:
        """A value as Optuna knows it."""
        return value

    def at(self, share: float) -> Any:
        """The number at a share of the range, as Optuna knows it."""
        if self.is_log:
            number = self.low * (self.high / self.low) ** share
        else:
            number = self.low + share * (self.high - self.low)
        return round(number) if self.is_whole else number


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A parameter or a group that takes one of several values."""

    key: str
    values: tuple[Any, ...]

    def suggest(self, trial: optuna.Trial) -> Any:
        """The value to try next."""
        names = [render(value) for value in self.values]
        return self.values[names.index(trial.suggest_categorical(self.key, names))]

    def holds(self, value: Any) -> bool:
        """Whether a value may be tried."""
        return value in self.values

    def as_drawn(self, value: Any) -> Any:
        """A value as Optuna knows it."""
        return render(value)

    def at(self, share: float) -> Any:
        """The value at a share of the list, below 1, as Optuna knows it."""
        return render(self.values[int(share * len(self.values))])


Tuned = Range | Choice


def split(texts: Sequence[str]) -> tuple[list[Tuned], list[str]]:
    """What is tuned, and the other words of a command line.

    Raises:
        ConfigError: a range is empty or cannot be drawn from.
    """
    tuned: list[Tuned] = []
    others: list[str] = []
    for text in texts:
        key, _, value = text.partition("=")
        found = _tuned(key, value) if key != "seed" else None
        if found is None:
            others.append(text)
        else:
            tuned.append(found)
    keys = [item.key for item in tuned]
    for key in keys:
        if keys.count(key) > 1:
            raise ConfigError(f"{key} is given twice; give it once")
    return tuned, others


def _tuned(key: str, value: str) -> Tuned | None:
    if match := _CHOICE.fullmatch(value.strip()):
        (setting,) = parse_settings([f"{key}={match[1]}"])
        return Choice(key=key, values=setting.values)
    if not (match := _RANGE.fullmatch(value.strip())):
        return None
    low, high, is_log = float(match[1]), float(match[2]), match[3] is not None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ConfigError(f"{key}={value}: the range is empty; type {key}=LOW:HIGH, e.g. {key}=0.5:5")
    if is_log and low <= 0.0:
        raise ConfigError(f"{key}={value}: a logarithmic range must begin above 0")
    is_whole = all(re.fullmatch(r"[+-]?\d+", text) for text in match.groups()[:2])
    return Range(key=key, low=low, high=high, is_log=is_log, is_whole=is_whole)


def settings_of(values: Mapping[str, Any]) -> tuple[Setting, ...]:
    """Values to try as they would be typed."""
    return tuple(Setting(key=key, values=(value,)) for key, value in values.items())


def label_of(values: Mapping[str, Any]) -> str:
    """What tells these values from others: `interval_s=1.25`."""
    return " ".join(f"{key.rpartition('.')[2]}={render(value)}" for key, value in values.items())


def wholes_checked(tuned: Sequence[Tuned], default_of: Callable[[str], Any]) -> list[Tuned]:
    """Ranges typed in whole numbers, drawn as such only where the parameter is a whole number."""
    return [
        Range(key=item.key, low=item.low, high=item.high, is_log=item.is_log, is_whole=False)
        if isinstance(item, Range) and item.is_whole and not _is_whole(default_of(item.key))
        else item
        for item in tuned
    ]


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
