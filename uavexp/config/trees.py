"""Trees of options as Hydra composes them: the only module that composes with it, once per combination."""

from __future__ import annotations

import copy
import functools
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uavexp.config.files import refuse_unpacking
from uavexp.config.options import PRESET_GROUP, list_options
from uavexp.config.overrides import quoted
from uavexp.errors import ConfigError, one_line
from uavexp.parameters import nearest
from uavexp.paths import conf_folder

TRIGGER_GROUP = "trigger"  # what presets choose
CONFIG_NAME = "config"
_OF_ONE_COMPOSITION = ("runtime", "overrides", "job")  # parts of `hydra` that only tell what was typed
_Kept = dict[tuple[tuple[str, str], ...], dict[str, Any]]  # trees by what was chosen


@dataclass(slots=True, kw_only=True)
class Trees:
    """Composed trees of options, kept: the shipped ones as long as the process lives."""

    user_folder: Path | None = None
    many: bool = False  # of a large grid: join trees of single options where that is the same
    _own: _Kept = field(default_factory=dict, repr=False)  # with a user's folder, which may change

    def __post_init__(self) -> None:
        if self.user_folder is not None:
            for files in list_options([self.user_folder]).values():
                for file in files.values():
                    refuse_unpacking(file)  # Hydra would unpack it

    def of(self, chosen: Mapping[str, str]) -> dict[str, Any]:
        """The tree of these options (group -> option), unresolved; not to be changed."""
        kept = _shipped(conf_folder(), self.many) if self.user_folder is None else self._own
        key = tuple(sorted(chosen.items()))
        if key not in kept:
            joined = self._join(chosen) if self.many and len(chosen) > 1 else None
            kept[key] = joined or self._compose(chosen)
        return kept[key]

    def _join(self, chosen: Mapping[str, str]) -> dict[str, Any] | None:
        """The tree of several options from trees of one each: a grid needs their sum, not their product.

        None where an option touches more than its own group, or the preset touches that group.
        """
        preset = {group: option for group, option in chosen.items() if group in (PRESET_GROUP, TRIGGER_GROUP)}
        if preset == chosen or any("." in group for group in chosen):
            return None
        plain = self.of({})
        tree = copy.deepcopy(self.of(preset))
        for group, option in chosen.items():
            if group in preset:
                continue
            alone = self.of({group: option})
            if _without(alone, group) != _without(plain, group) or tree[group] != plain[group]:
                return None
            tree[group] = copy.deepcopy(alone[group])
            tree["hydra"]["runtime"]["choices"][group] = option
        return tree

    def _compose(self, chosen: Mapping[str, str]) -> dict[str, Any]:
        arguments = [f"{group.replace('.', '/')}={name}" for group, name in chosen.items()]
        if TRIGGER_GROUP in chosen and PRESET_GROUP not in chosen:
            arguments.append(f"~{PRESET_GROUP}")  # the default preset's name would be wrong
        tree = self._tree(arguments)
        if TRIGGER_GROUP in chosen and PRESET_GROUP in chosen:
            preset = self._tree([f"{PRESET_GROUP}={chosen[PRESET_GROUP]}"])
            wanted = preset["hydra"]["runtime"]["choices"][TRIGGER_GROUP]
            if wanted != chosen[TRIGGER_GROUP]:
                raise ConfigError(
                    f"{PRESET_GROUP}={chosen[PRESET_GROUP]} means {TRIGGER_GROUP}={wanted}, "
                    f"{TRIGGER_GROUP}={chosen[TRIGGER_GROUP]} contradicts it: give one of the two"
                )
        return tree

    def _tree(self, arguments: list[str]) -> dict[str, Any]:
        import yaml  # type: ignore[import-untyped]
        from hydra import compose, initialize_config_dir
        from hydra.core.global_hydra import GlobalHydra
        from hydra.errors import HydraException, MissingConfigException
        from omegaconf import OmegaConf
        from omegaconf.errors import OmegaConfBaseException

        bad_input = (HydraException, OmegaConfBaseException, yaml.YAMLError, OSError, ValueError, KeyError)

        if self.user_folder is not None:
            arguments = [*arguments, f"hydra.searchpath=[{_file_url(self.user_folder)}]"]
        GlobalHydra.instance().clear()
        try:
            with (
                warnings.catch_warnings(),
                initialize_config_dir(config_dir=str(conf_folder()), version_base="1.3", job_name="uavexp"),
            ):
                warnings.simplefilter("ignore")
                composed = compose(CONFIG_NAME, overrides=arguments, return_hydra_config=True)
            tree: Any = OmegaConf.to_container(composed, resolve=False)
        except RecursionError as error:
            words = "a configuration is too deep, or holds itself"
            raise ConfigError(f"the configuration does not compose: {words}") from error
        except MissingConfigException as error:
            raise ConfigError(self._missing(str(error.missing_cfg_file), arguments)) from error
        except bad_input as error:
            raise ConfigError(f"the configuration does not compose: {_with_cause(error)}") from error
        return dict(tree)

    def _missing(self, name: str, arguments: Sequence[str]) -> str:
        """What to say of an option that an option or a preset asks for and that does not exist."""
        group, _, option = name.rpartition("/")
        known = list_options([conf_folder(), *([self.user_folder] if self.user_folder else [])])
        there = known.get(group.replace("/", "."), {})
        asking = " ".join(word for word in arguments if not word.startswith("hydra."))
        hint = f"{nearest(option, there)}; {group} may be {', '.join(there)}" if there else ""
        return f"{asking} asks for {group}={option}: no such option{hint}"


@functools.cache
def _shipped(folder: Path, many: bool) -> _Kept:
    """Trees of this folder's options that were composed before; with and without joining, each its own."""
    return {}


def _without(tree: Mapping[str, Any], group: str) -> dict[str, Any]:
    """A composed tree without one group, and without what `hydra` tells of the composition itself."""
    hydra = {key: value for key, value in tree["hydra"].items() if key not in _OF_ONE_COMPOSITION}
    return {**{key: value for key, value in tree.items() if key != group}, "hydra": hydra}


def _file_url(folder: Path) -> str:
    return quoted(f"file://{folder}")


def _with_cause(error: BaseException) -> str:
    """Message of an error and of its cause, in one line."""
    cause = error.__cause__
    return (one_line(error) or type(error).__name__) + (f" ({one_line(cause)})" if cause else "")
