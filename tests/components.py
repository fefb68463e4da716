"""Options of a config group, found by glob, built from their own yaml."""

from __future__ import annotations

from typing import Any

from hydra.utils import get_class
from omegaconf import OmegaConf

from tests.folders import CONF as CONF


def options(group: str) -> list[str]:
    """Names of all options of a group."""
    return sorted(path.stem for path in CONF.joinpath(*group.split(".")).glob("*.yaml"))


def build(group: str, option: str, **changes: Any) -> Any:
    """The component that an option's yaml describes, with the options of its group that it holds.

    What the yaml takes from the trial (`${unknown}`) is as the class has it.
    """
    values = OmegaConf.to_container(OmegaConf.load(CONF.joinpath(*group.split("."), f"{option}.yaml")))
    for inner in values.pop("defaults", []):  # risk@policies.risk, find: grid, _self_
        if isinstance(inner, dict):
            values |= {held: build(f"{group}.{held}", part) for held, part in inner.items()}
            continue
        part, at, place = inner.partition("@")
        if not at:
            continue
        parameter, name = place.split(".")
        values[parameter][name] = build(group, part)
    own = {name: value for name, value in values.items() if not str(value).startswith("${")}
    return get_class(own.pop("_target_"))(**(own | changes))
