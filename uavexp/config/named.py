"""`-cn NAME`: settings from a file of one's own, `NAME.yaml` in the folder of `--config-dir`.

    defaults:                     options, as in Hydra's files; `config` and `_self_` mean nothing here
      - override world: rooms
    trigger:
      delta_map_m: 0.2            or trigger.delta_map_m: 0.2
    seed: "0:3"

What is typed beside it wins.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from uavexp.config.files import refuse_unpacking
from uavexp.config.overrides import Setting, flatten, parse_settings
from uavexp.errors import ConfigError, one_line
from uavexp.parameters import nearest

_DEFAULTS = "defaults"
_NO_SETTING = ("_self_", "config")
_PREFIX = "override "


def with_named(name: str, folder: Path | None, typed: Sequence[Setting]) -> list[Setting]:
    """The settings of a file and those typed, which replace its own.

    Args:
        name: of the file, without its suffix.
        folder: of `--config-dir`.
        typed: settings of the command line.

    Raises:
        ConfigError: there is no such file, or it is damaged.
    """
    if folder is None:
        raise ConfigError(f"--config-name {name}: name the folder of {name}.yaml, too: --config-dir DIR")
    file = folder / f"{name.removesuffix('.yaml')}.yaml"
    if not file.is_file():
        known = sorted(item.stem for item in folder.glob("*.yaml"))
        there = f"there are {', '.join(known)}" if known else "the folder has no yaml file"
        raise ConfigError(f"--config-name {name}: no file {file}{nearest(name, known)}; {there}")
    settings = {setting.key: setting for setting in _settings(file)}
    return list({**settings, **{setting.key: setting for setting in typed}}.values())


def _settings(file: Path) -> Iterator[Setting]:
    tree = _tree(file)
    for item in tree.pop(_DEFAULTS, None) or []:
        if item in _NO_SETTING:
            continue
        if not isinstance(item, Mapping) or len(item) != 1:
            raise ConfigError(f"{file}: defaults: each is GROUP: OPTION, got {item!r}")
        group, option = next(iter(item.items()))
        name = str(group).removeprefix(_PREFIX).strip("/").replace("/", ".")
        yield from parse_settings([f"{name}={option}"])
    for key, value in tree.items():
        if isinstance(value, str):
            yield from parse_settings([f"{key}={value}"])
        else:
            yield from flatten(str(key), value)


def _tree(file: Path) -> dict[str, Any]:
    import yaml  # type: ignore[import-untyped]
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    refuse_unpacking(file)
    try:
        tree = OmegaConf.to_container(OmegaConf.load(file), resolve=False)
    except (OSError, ValueError, RecursionError, yaml.YAMLError, OmegaConfBaseException) as error:
        raise ConfigError(f"{file} cannot be read: {one_line(error)}") from error
    if not isinstance(tree, dict) or not isinstance(tree.get(_DEFAULTS, []), list):
        raise ConfigError(f"{file}: must be settings, KEY: VALUE, with a list of defaults at most")
    return {str(key): value for key, value in tree.items()}
