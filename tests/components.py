"""Options of a config group, found by glob, built from their own yaml."""

from __future__ import annotations

import dataclasses
from typing import Any

from hydra.utils import get_class
from omegaconf import OmegaConf

from tests.folders import CONF as CONF


def options(group: str) -> list[str]:
    """Names of all options of a group."""
    return sorted(path.stem for path in CONF.joinpath(*group.split(".")).glob("*.yaml"))


def build(group: str, option: str, **changes: Any) -> Any:
    """The component that an option's yaml describes, with the options of its group that it holds."""
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
    return get_class(values.pop("_target_"))(**(values | changes))


def numbers(component: Any) -> list[str]:
    """Names of the float parameters of a component."""
    return [f.name for f in dataclasses.fields(component) if f.init and type(f.default) is float]
