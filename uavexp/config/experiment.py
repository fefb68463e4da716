"""Experiments: the grid and the seeds of one table or figure, `experiments/<paper>/<table>.yaml`.

    title: what is compared
    seed: "0:20"
    settings: {primary: MCR}        read by the report
    tables: [by_metric]             as are figures and claims (`uavexp.report.declared`); none: a summary
    fixed: {latency_s: 0.03}        of every cell
    axes:                           every combination of one entry of each axis
      arm:
        SSP: {strategy: ssp}
        TBR: {strategy: tbr, trigger.interval_s: "1,2,5"}      a grid, as typed on the command line
      scene:
        rooms: {world: rooms}

An entry's values are what would be typed after `=`: text is read by the same parser, so
`"1,2,5"` are three values and each makes a cell of its own, told apart by the axis
`setting`. In place of an entry, `world.number: "range(0,300)"` are 300 of them, one for each
value of that key and named by it. An axis given as the name of another experiment,
`scene: mcr/table1`, has the entries of that experiment's axis; so have tables, figures and
claims. On the command line an axis picks entries (`arm=MCR,SSP`), a key that entries set
replaces their values there and nowhere else, and any other key holds for every cell.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from uavexp.config.files import refuse_unpacking, yaml_files
from uavexp.config.options import text_of
from uavexp.config.overrides import Setting, expand_grid, flatten, parse_settings, render
from uavexp.errors import ConfigError, one_line
from uavexp.parameters import nearest
from uavexp.paths import experiments_folder

SETTING_AXIS = "setting"  # tells the cells of one entry apart
_REPORT = ("tables", "figures", "claims")
_KEYS = ("title", "seed", "settings", *_REPORT, "fixed", "axes")
_OURS = ("seed", "out", "runner", "experiments")  # no part of a cell


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """One file, taken apart."""

    name: str  # "mcr/table1"
    title: str
    report: Mapping[str, Sequence[Any]]  # its tables, figures and claims, those that it names
    seed: str
    settings: Mapping[str, Any]
    fixed: tuple[Setting, ...]
    axes: Mapping[str, Mapping[str, tuple[Setting, ...]]]  # axis -> entry -> settings


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelledCell:
    """One cell's settings, each with one value, and its place on every axis."""

    labels: dict[str, str]
    settings: tuple[Setting, ...]


def list_experiments(user_folder: Path | None = None) -> dict[str, Path]:
    """File of every experiment by its name, `<paper>/<table>`: the shipped ones, then the user's.

    Raises:
        ConfigError: a user's experiment has the name of a shipped one.
    """
    found: dict[str, Path] = {}
    for folder in (experiments_folder(), *([user_folder / "experiments"] if user_folder else [])):
        for file in yaml_files(folder, "*/*.yaml"):
            name = f"{file.parent.name}/{file.stem}"
            if name in found:
                raise ConfigError(f"{file}: experiments={name} exists already; rename yours")
            found[name] = file
    return found


def title_of(name: str, file: Path) -> str:
    """Title of an experiment, from its text; nothing else of it is looked at."""
    match = re.search(r"^title:\s*(.*?)\s*$", text_of(file), re.MULTILINE)
    return match[1].strip("\"'") if match else name


def read_experiment(name: str, file: Path, *, borrow: bool = True) -> Experiment:
    """Read one experiment's file.

    Args:
        name: `<paper>/<table>`.
        file: its yaml.
        borrow: whether axes may come from other experiments; otherwise such axes are left out.

    Raises:
        ConfigError: it cannot be read, or a part is missing, unknown or of the wrong kind.
    """
    tree = _load(name, file)
    if not isinstance(tree.get("axes"), dict) or not tree["axes"]:
        raise ConfigError(f"experiments={name}: the file needs axes: {{arm: {{NAME: {{KEY: VALUE}}}}}}")
    for key in tree:
        if key not in _KEYS:
            hint = nearest(str(key), _KEYS)
            raise ConfigError(f"experiments={name}: unknown part '{key}'{hint}; known: {', '.join(_KEYS)}")
    seed = tree.get("seed", "0")
    if not isinstance(seed, str):
        raise ConfigError(f'experiments={name}: quote the seeds, seed: "{seed}" (1:20 unquoted is 80)')
    experiment = Experiment(
        name=name,
        title=str(tree.get("title", name)),
        report={key: _listed(name, file, key, tree[key]) for key in _REPORT if key in tree},
        seed=seed,
        settings=_mapping(name, "settings", tree.get("settings", {})),
        fixed=_settings(name, "fixed", tree.get("fixed", {})),
        axes={
            str(axis): _borrowed(name, file, str(axis), entries)
            if isinstance(entries, str)
            else _entries(name, str(axis), _mapping(name, f"axes.{axis}", entries))
            for axis, entries in tree["axes"].items()
            if borrow or not isinstance(entries, str)
        },
    )
    if borrow:
        _check_primary(experiment)
    return experiment


def _check_primary(experiment: Experiment) -> None:
    """Refuse a primary arm that no axis has: what is compared with it would be silently left out."""
    primary = experiment.settings.get("primary")
    entries = [entry for axis in experiment.axes.values() for entry in axis]
    if primary and primary not in entries:
        hint = nearest(str(primary), entries)
        raise ConfigError(f"experiments={experiment.name}: settings.primary={primary}: no such arm{hint}")


def _load(name: str, file: Path) -> dict[Any, Any]:
    import yaml  # type: ignore[import-untyped]
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    refuse_unpacking(file)
    try:
        loaded = OmegaConf.load(file)  # unlike yaml itself, it refuses a key that stands there twice
        tree = OmegaConf.to_container(loaded, resolve=False)
    except RecursionError as error:
        raise ConfigError(f"experiments={name} cannot be read: it is too deep, or holds itself") from error
    except (OSError, ValueError, yaml.YAMLError, OmegaConfBaseException) as error:
        raise ConfigError(f"experiments={name} cannot be read: {one_line(error)}") from error
    _check_plain(name, "", tree)
    return tree if isinstance(tree, dict) else {}


def _check_plain(name: str, place: str, node: Any) -> None:
    """Refuse what yaml reads as something else than text, numbers, lists and mappings: a date, say."""
    if isinstance(node, Mapping):
        for key, value in node.items():
            _check_plain(name, f"{place}.{key}" if place else str(key), value)
    elif isinstance(node, list):
        for index, value in enumerate(node):
            _check_plain(name, f"{place}[{index}]", value)
    elif not isinstance(node, str | bool | int | float | None):
        raise ConfigError(
            f"experiments={name}: {place} is a {type(node).__name__}, {node}: write it as text, in quotes"
        )


def _other(name: str, file: Path) -> Experiment:
    """Another experiment, from the same folder or else from those shipped."""
    own = file.parent.parent / f"{name}.yaml"
    shipped = experiments_folder() / f"{name}.yaml"
    return read_experiment(name, own if own.is_file() else shipped, borrow=False)


def _listed(name: str, file: Path, key: str, items: Any) -> Sequence[Any]:
    """Tables, figures or claims, or those of another experiment."""
    if isinstance(items, str):
        other = _other(items, file).report
        return other.get(key, [])
    if not isinstance(items, list):
        raise ConfigError(f"experiments={name}: {key} must be a list, got {items!r}")
    return items


def _borrowed(name: str, file: Path, axis: str, other: str) -> Mapping[str, tuple[Setting, ...]]:
    """Entries of the same axis in another experiment, which must have its own."""
    axes = _other(other, file).axes
    if axis not in axes:
        raise ConfigError(f"experiments={name}: axes.{axis}: {other} has no axis {axis}")
    return axes[axis]


def expand(
    experiment: Experiment, typed: Sequence[Setting]
) -> tuple[list[LabelledCell], dict[str, list[str]]]:
    """Cells of an experiment under what was typed beside it.

    Args:
        experiment: as read.
        typed: settings of the command line; those of `seed`, `out`, `runner` are passed over.

    Returns:
        The cells, first axis slowest, and the axes with their values in order.

    Raises:
        ConfigError: an entry that no axis has.
    """
    typed = [setting for setting in typed if setting.key.split(".")[0] not in _OURS]
    picked = {setting.key: setting for setting in typed if setting.key in experiment.axes}
    others = [setting for setting in typed if setting.key not in picked]
    axes = {axis: _pick(axis, entries, picked.get(axis)) for axis, entries in experiment.axes.items()}
    in_entries = {s.key for entries in axes.values() for settings in entries.values() for s in settings}
    free = [setting for setting in others if setting.key not in in_entries]
    replaced = {setting.key: setting for setting in others if setting.key in in_entries}
    cells = [
        cell
        for entries in itertools.product(*(axis.items() for axis in axes.values()))
        for cell in _cells(dict(zip(axes, entries, strict=True)), experiment.fixed, free, replaced)
    ]
    labels = {axis: list(entries) for axis, entries in axes.items()}
    values = list(dict.fromkeys(cell.labels[SETTING_AXIS] for cell in cells))
    if values == [""]:
        return [LabelledCell(labels=_without(cell.labels), settings=cell.settings) for cell in cells], labels
    return cells, {**labels, SETTING_AXIS: values}


def _cells(
    entries: Mapping[str, tuple[str, tuple[Setting, ...]]],
    fixed: Sequence[Setting],
    free: Sequence[Setting],
    replaced: Mapping[str, Setting],
) -> Iterator[LabelledCell]:
    """Cells of one combination of entries: later settings of a key replace earlier ones."""
    settings: dict[str, Setting] = {setting.key: setting for setting in (*fixed, *free)}
    for _, chosen in entries.values():
        settings |= {setting.key: replaced.get(setting.key, setting) for setting in chosen}
    swept = [key for key, setting in settings.items() if len(setting.values) > 1]
    for cell in expand_grid(list(settings.values())):
        words = [f"{s.key.split('.')[-1]}={render(s.values[0])}" for s in cell if s.key in swept]
        labels = {axis: entry for axis, (entry, _) in entries.items()}
        yield LabelledCell(labels={**labels, SETTING_AXIS: " ".join(words)}, settings=cell)


def _pick(
    axis: str, entries: Mapping[str, tuple[Setting, ...]], wanted: Setting | None
) -> dict[str, tuple[Setting, ...]]:
    """Entries of an axis, all or those typed, in the file's order."""
    if wanted is None:
        return dict(entries)
    names = [str(value) for value in wanted.values]
    for name in names:
        if name not in entries:
            raise ConfigError(
                f"{axis}={name}: no such entry{nearest(name, entries)}; the experiment has "
                f"{', '.join(entries)}"
            )
    return {name: settings for name, settings in entries.items() if name in names}


def _entries(name: str, axis: str, entries: Mapping[str, Any]) -> dict[str, tuple[Setting, ...]]:
    if not entries or axis == SETTING_AXIS:
        raise ConfigError(f"experiments={name}: axis {axis} needs entries, and another name than setting")
    found: dict[str, tuple[Setting, ...]] = {}
    for entry, tree in entries.items():
        swept = parse_settings([f"{entry}={tree}"]) if isinstance(tree, str) else []
        if len(swept) == 1 and len(swept[0].values) > 1:
            found |= {render(value): (replace(swept[0], values=(value,)),) for value in swept[0].values}
        else:
            found[str(entry)] = _settings(name, f"axes.{axis}.{entry}", tree)
    return found


def _settings(name: str, place: str, tree: Any) -> tuple[Setting, ...]:
    """Settings of one mapping; text is read as if it had been typed."""
    settings: list[Setting] = []
    for key, value in _mapping(name, place, tree).items():
        if str(key).split(".")[0] in _OURS:
            raise ConfigError(f"experiments={name}: {place}: {key} has its own place, not here")
        if isinstance(value, str):
            settings += parse_settings([f"{key}={value}"])
        else:
            settings += flatten(str(key), value)
    return tuple(settings)


def _mapping(name: str, place: str, tree: Any) -> Mapping[str, Any]:
    if not isinstance(tree, Mapping):
        raise ConfigError(f"experiments={name}: {place} must be a mapping, got {tree!r}")
    return tree


def _without(labels: Mapping[str, str]) -> dict[str, str]:
    return {axis: value for axis, value in labels.items() if axis != SETTING_AXIS}
