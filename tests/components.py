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


def check_yaml(group: str, option: str) -> None:
    """One name in every place; the yaml lists every parameter with the class's default, and comments it."""
    path = CONF / group / f"{option}.yaml"
    values = dict(OmegaConf.to_container(OmegaConf.load(path)))
    target = values.pop("_target_")
    values.pop("defaults", None)
    assert target.rpartition(".")[0] == f"uavexp.{group}.{option}"
    fields = {field.name: field for field in dataclasses.fields(get_class(target)) if field.init}
    assert values.keys() == fields.keys()
    for name, value in values.items():
        default = fields[name].default
        if default is dataclasses.MISSING:
            continue
        assert (tuple(value) if isinstance(value, list) else value) == default, name
    lines = [
        line
        for line in path.read_text().splitlines()
        if line and not line.startswith(("_target_", "#", "defaults:", "  - "))
    ]
    assert all("#" in line for line in lines)


def numbers(component: Any) -> list[str]:
    """Names of the float parameters of a component."""
    return [f.name for f in dataclasses.fields(component) if f.init and type(f.default) is float]
