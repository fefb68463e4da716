"""Which options are checked: those that were typed, or all there are."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from uavexp.check.promise import Make, breach, promises
from uavexp.config.build import GROUPS, TARGET, build_component
from uavexp.config.composition import Composer
from uavexp.config.options import read_option
from uavexp.config.overrides import Setting
from uavexp.errors import ConfigError
from uavexp.parameters import MISSING


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """One option to hold to its group's promises."""

    group: str
    option: str
    make: Make | None  # None: `lacking` must be given first
    lacking: str = ""

    def __str__(self) -> str:
        return f"{self.group}={self.option}"

    def breaches(self) -> Iterator[tuple[str, str]]:
        """Each promise in words, and how it is broken; empty when it is kept."""
        if self.make is not None:
            yield from ((words, breach(kept, self.make)) for words, kept in promises(self.group).items())


def subjects(composer: Composer, settings: Sequence[Setting]) -> list[Subject]:
    """The options chosen (`planner=mine`), with the values of their parameters (`planner.reach_m=2`).

    Raises:
        ConfigError: no such option or parameter, a value refused, one that must be given.
    """
    chosen = [(item.key, str(option)) for item in settings if item.key in GROUPS for option in item.values]
    values = [item for item in settings if item.key not in GROUPS]
    for item in values:
        group = item.key.split(".")[0]
        if group in GROUPS and group not in dict(chosen):
            inside = f"{group}={composer.compose([])['hydra']['runtime']['choices'][group]}"
            typed = f"{item.key}={','.join(map(str, item.values))}"
            raise ConfigError(f"check {item.key} inside a {group}: {inside} {typed}")
        if group not in dict(chosen):
            raise ConfigError(f"{item.key} is no parameter of an option that is checked")
        if len(item.values) > 1:
            raise ConfigError(f"{item.key} must have one value, got {', '.join(map(str, item.values))}")
    if chosen:
        return [_subject(composer, group, option, values) for group, option in chosen]
    every = [(group, option) for group in GROUPS for option in composer.options[group]]
    return [
        Subject(group=group, option=option, make=None, lacking=", ".join(names))
        if (names := lacking(composer, group, option))
        else _subject(composer, group, option, [])
        for group, option in every
    ]


def _subject(composer: Composer, group: str, option: str, values: Sequence[Setting]) -> Subject:
    own = [item for item in values if item.key.startswith(f"{group}.")]
    tree = composer.compose([Setting(key=group, values=(option,)), *own])[group]
    if TARGET not in tree:
        raise ConfigError(f"{group}={option}: the option has no {TARGET}")
    build_component(group, tree)  # what it refuses is told before anything is checked
    return Subject(group=group, option=option, make=functools.partial(build_component, group, tree))


def lacking(composer: Composer, group: str, option: str) -> list[str]:
    """The parameters of an option that have no default."""
    parameters = read_option(composer.options[group][option]).parameters
    return [f"{group}.{item.name}" for item in parameters if item.default == MISSING]
