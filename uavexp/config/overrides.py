"""What was typed, taken apart: `key=value` overrides, grids and seeds.

The grammar is Hydra's own (its parser is used); what differs is that a grid is expanded
with or without `-m`, that `seed` is ours, and that nothing is given twice.
"""

from __future__ import annotations

import itertools
import math
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from uavexp.errors import ConfigError
from uavexp.parameters import GREATEST_INT

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override

PAPER_SEEDS = range(20)  # "20 independent trials" (paper 1, §4.1)
MAX_CELLS = 100_000
_LONGEST = 200  # characters of a setting that an error repeats
_PLAIN = re.compile(r"[A-Za-z0-9_./+-][A-Za-z0-9_./+@-]*")
_LOOKS_TYPED = re.compile(r"(?i)(null|true|false|nan|[+-]?inf|[+-]?[\d._]+(e[+-]?\d+)?)")
_RANGE = re.compile(r"(-?\d+):(-?\d+)(?::(-?\d+))?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """One key with the values it is to take, one after another."""

    key: str  # "strategy", "trigger.delta_map_m"
    values: tuple[Any, ...]  # plain data; more than one makes a grid
    add: bool = False  # typed with + or ++: the key may be new


def parse_settings(texts: Sequence[str]) -> list[Setting]:
    """Parse overrides as typed.

    Raises:
        ConfigError: an override does not parse, is of a kind that has no meaning here, has
            no values, or a key is given twice.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser

    parser = OverridesParser.create()
    texts = [re.sub(r"^experiment=", "experiments=", text) for text in texts]  # as Hydra's users type it
    settings = [setting for text in texts for setting in _parse(parser, text)]
    seen: set[str] = set()
    for setting in settings:
        if setting.key in seen:
            raise ConfigError(
                f"{setting.key} is given twice; give it once (several values: {setting.key}=a,b)"
            )
        seen.add(setting.key)
    return settings


def flatten(key: str, value: Any, *, add: bool = False) -> list[Setting]:
    """One setting per leaf, so that `world={size_m: [6,5,3]}` is `world.size_m=[6,5,3]`."""
    if isinstance(value, Mapping) and value:
        leaves = (flatten(f"{key}.{name}", inner, add=add) for name, inner in value.items())
        return list(itertools.chain.from_iterable(leaves))
    return [Setting(key=key, values=(value,), add=add)]


def _parse(parser: Any, text: str) -> list[Setting]:
    from hydra.errors import HydraException

    try:
        override: Override = parser.parse_override(text)
    except (HydraException, ValueError) as error:  # a number of thousands of digits is the latter
        raise ConfigError(_unparsable(text)) from error
    key = override.key_or_group
    if not key:
        raise ConfigError(_unparsable(text))
    if key.split(".")[0].split("/")[0] == "hydra":
        raise ConfigError(
            f"{text}: Hydra only composes here and its own settings have no effect; output goes to out=DIR"
        )
    if override.is_delete():
        raise ConfigError(f"{text}: nothing can be removed; every component needs its values")
    if override.package is not None:
        raise ConfigError(f"{text}: a group has one place; type {key}=OPTION")
    add = override.is_add() or override.is_force_add()
    if not override.is_sweep_override():
        return flatten(key, override.value(), add=add)
    return [Setting(key=key, values=_sweep_values(override, text), add=add)]


def _sweep_values(override: Override, text: str) -> tuple[Any, ...]:
    from hydra.core.override_parser.types import Glob, QuotedString

    value: Any = override.value()
    if isinstance(value, Glob) or not override.is_discrete_sweep():
        raise ConfigError(f"{text}: cannot be enumerated; list the values, {override.key_or_group}=a,b,c")
    if getattr(value, "shuffle", False):
        raise ConfigError(f"{text}: shuffling would change nothing; results are sorted by cell and seed")
    if override.is_range_sweep():
        _check_range(value, text)
    values = [item.text if isinstance(item, QuotedString) else item for item in override.sweep_iterator()]
    if not values:
        raise ConfigError(f"{text}: the range is empty")
    converted = (override._convert_value(item) for item in values)
    if override.is_range_sweep():  # 0.05 + 2 * 0.05 is 0.15, whatever the processor says
        return tuple(float(f"{item:.12g}") if isinstance(item, float) else item for item in converted)
    return tuple(converted)


def _check_range(value: Any, text: str) -> None:
    numbers = (value.start, value.stop, value.step)
    if value.step == 0 or not all(math.isfinite(number) for number in numbers):
        raise ConfigError(f"{text}: the step of a range must not be 0 and its ends must be finite")
    if (value.stop - value.start) / value.step > MAX_CELLS:
        raise ConfigError(f"{text}: more than {MAX_CELLS} values")


def _unparsable(text: str) -> str:
    key, equals, value = text.partition("=")
    if not equals or not key or not re.fullmatch(r"\+{0,2}[\w./@]+", key):
        return f"cannot read {text!r}: type KEY=VALUE, e.g. strategy=mcr (see --help)"
    if len(text) > _LONGEST:
        return f"cannot read {text[:_LONGEST]!r}...: {len(value)} characters"
    return f"cannot read {text!r}: quote the value, {shlex.quote(f'{key}={quoted(value)}')}"


def render(value: Any) -> str:
    """A value as Hydra's grammar reads it back; `shlex.quote` the whole override for a shell."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        return value if _PLAIN.fullmatch(value) and not _LOOKS_TYPED.fullmatch(value) else quoted(value)
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{key}:{render(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, Iterable):
        return "[" + ",".join(render(inner) for inner in value) + "]"
    raise ConfigError(f"cannot write {value!r} as an override")


def quoted(text: str) -> str:
    """A text between double quotes, as Hydra's grammar reads it back."""
    # Hydra: backslashes count only before a quote or at the end
    escaped = re.sub(r"(\\*)(\"|$)", lambda match: match[1] * 2 + ("\\" + match[2] if match[2] else ""), text)
    return f'"{escaped}"'


def expand_grid(settings: Sequence[Setting]) -> list[tuple[Setting, ...]]:
    """Every combination of the settings' values, the first key slowest.

    Returns:
        Cells; each setting in a cell has exactly one value.
    """
    size = math.prod(len(setting.values) for setting in settings)
    if size > MAX_CELLS:
        raise ConfigError(f"the grid has {size} cells; at most {MAX_CELLS} are allowed")
    choices = [
        [Setting(key=setting.key, values=(value,), add=setting.add) for value in setting.values]
        for setting in settings
    ]
    return list(itertools.product(*choices))


def expand_seeds(values: Iterable[Any]) -> tuple[int, ...]:
    """Seeds in the order given: `3`, `"1,4,7"`, `"0:20"`, `"range"`, lists of these.

    Raises:
        ConfigError: not a seed, negative, an empty range, or a duplicate.
    """
    seeds = [seed for value in values for seed in _seeds_of(value)]
    if not seeds:
        raise ConfigError("seed: no seed given; type seed=0, seed=1,4,7 or seed=0:20")
    if any(seed > GREATEST_INT for seed in seeds):
        raise ConfigError(f"seed must be at most {GREATEST_INT}, got {max(seeds)}")
    negative = next((seed for seed in seeds if seed < 0), None)
    if negative is not None:
        raise ConfigError(f"seed must be >= 0, got {negative}")
    if len(set(seeds)) < len(seeds):
        duplicate = next(seed for index, seed in enumerate(seeds) if seed in seeds[:index])
        raise ConfigError(f"seed {duplicate} is given twice; every seed counts once")
    return tuple(seeds)


def _seeds_of(value: Any) -> Sequence[int]:
    if isinstance(value, bool) or value is None:
        raise ConfigError(_not_a_seed(value))
    if isinstance(value, int):
        return [value]
    if isinstance(value, list | tuple | range):
        return [seed for item in value for seed in _seeds_of(item)]
    text = str(value).strip()
    if re.search(r"\d{20}", text):  # nor is it read: Python refuses numbers of thousands of digits
        raise ConfigError(f"seed must be at most {GREATEST_INT}, got {text[:60]}")
    if text == "range":
        return PAPER_SEEDS
    if match := _RANGE.fullmatch(text):
        return _seed_range(text, int(match[1]), int(match[2]), int(match[3] or 1))
    if inner := re.fullmatch(r"range\(\s*(-?\d+)\s*(?:,\s*(-?\d+)\s*)?(?:,\s*(-?\d+)\s*)?\)", text):
        start, stop = (0, int(inner[1])) if inner[2] is None else (int(inner[1]), int(inner[2]))
        return _seed_range(text, start, stop, int(inner[3] or 1))
    if "," in text:
        return [seed for item in text.split(",") for seed in _seeds_of(item)]
    if re.fullmatch(r"-?\d+", text):
        return [int(text)]
    raise ConfigError(_not_a_seed(value))


def _seed_range(text: str, start: int, stop: int, step: int) -> range:
    seeds = range(start, stop, step) if step else range(0)
    if len(seeds) == 0:
        raise ConfigError(f"seed={text}: the range is empty (start:stop, stop excluded)")
    if len(seeds) > MAX_CELLS:
        raise ConfigError(f"seed={text}: more than {MAX_CELLS} seeds")
    return seeds


def _not_a_seed(value: Any) -> str:
    return f"seed must be a whole number, a list 1,4,7, a range 0:20, or the word range; got {value!r}"
