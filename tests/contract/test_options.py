"""One word everywhere: group = package = protocol = folder of yaml; option = module = yaml.

Options are found by glob: a new planner is one .py and one .yaml, and no edit here.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import inspect
import re
from pathlib import Path

import pytest
import yaml

from uavexp.config.build import (
    GROUPS,
    TARGET,
    build_component,
    component_class,
    top_level,
)
from uavexp.config.composition import Composer
from uavexp.config.generate import option_files
from uavexp.config.options import PRESET_GROUP, RUNNER_GROUP, read_option
from uavexp.config.overrides import Setting, parse_settings
from uavexp.config.protocols import protocol_members, protocol_of
from uavexp.parameters import MISSING, parameter_types
from uavexp.paths import PACKAGE, conf_folder
from uavexp.trial import Parts

CONF = conf_folder()


def folder_of(root: Path, group: str) -> Path:
    return root.joinpath(*group.split("."))


HELD = sorted(".".join(folder.relative_to(CONF).parts) for folder in CONF.glob("*/*/"))  # by an option
ALL_GROUPS = (*GROUPS, *HELD)
OPTIONS = sorted((group, file.stem) for group in ALL_GROUPS for file in folder_of(CONF, group).glob("*.yaml"))
PRESETS = sorted(file.stem for file in (CONF / PRESET_GROUP).glob("*.yaml"))
COMPOSER = Composer()


def load(group: str, option: str) -> dict[str, object]:
    return dict(yaml.safe_load((folder_of(CONF, group) / f"{option}.yaml").read_text()))


def values(tree: dict[str, object]) -> dict[str, object]:
    return {key: value for key, value in tree.items() if key != TARGET}


def test_every_group_is_a_folder_a_package_and_a_role_of_a_trial() -> None:
    folders = {item.name for item in CONF.iterdir() if item.is_dir()}
    assert folders == {*GROUPS, PRESET_GROUP, RUNNER_GROUP}
    assert all((folder_of(PACKAGE, group) / "base.py").is_file() for group in ALL_GROUPS)
    assert [item.name for item in dataclasses.fields(Parts)] == [*GROUPS, *top_level()]


def test_every_group_has_an_option_and_a_default_that_exists() -> None:
    tree = COMPOSER.compose([])
    for group in GROUPS:
        assert (group, tree["hydra"]["runtime"]["choices"][group]) in OPTIONS


def test_the_defaults_of_no_group_are_those_of_a_trial() -> None:
    config = yaml.safe_load((CONF / "config.yaml").read_text())
    defaults = {item.name: item.default for item in dataclasses.fields(Parts) if item.name in top_level()}
    assert {key: config[key] for key in top_level()} == defaults


def test_the_yaml_of_every_option_is_what_make_conf_writes() -> None:
    made = option_files()
    assert made == {path: path.read_text(encoding="utf-8") for path in made}, "make conf"
    assert {folder_of(CONF, group) / f"{option}.yaml" for group, option in OPTIONS} <= set(made)


@pytest.mark.parametrize("group", ALL_GROUPS)
def test_a_base_module_defines_one_protocol_with_members(group: str) -> None:
    assert protocol_of(group).__module__ == f"uavexp.{group}.base"
    assert protocol_members(group)


@pytest.mark.parametrize(("group", "option"), OPTIONS)
def test_an_option_is_a_class_in_the_module_of_its_name(group: str, option: str) -> None:
    target = str(load(group, option)[TARGET])
    cls = component_class(group, target)
    assert target == f"uavexp.{group}.{option}.{cls.__name__}"
    assert cls.__module__ == f"uavexp.{group}.{option}"


@pytest.mark.parametrize(("group", "option"), OPTIONS)
def test_every_parameter_has_a_comment(group: str, option: str) -> None:
    bare = [
        item.name
        for item in read_option(folder_of(CONF, group) / f"{option}.yaml").parameters
        if not item.comment
    ]
    assert not bare


@pytest.mark.parametrize(("group", "option"), OPTIONS)
def test_every_dimensional_parameter_states_its_unit(group: str, option: str) -> None:
    suffixes = {"_m": "m", "_s": "s", "_mps": "m/s", "_mps2": "m/s²", "_hz": "Hz", "_deg": "deg", "_px": "px"}
    for item in read_option(folder_of(CONF, group) / f"{option}.yaml").parameters:
        for suffix, unit in suffixes.items():
            if item.name.endswith(suffix) and "_per_" not in item.name:
                stated = unit in re.split(r"[\s,;:()]+", item.comment.replace("m/s^2", "m/s²"))
                assert stated, f"{item.name}: no {unit} in {item.comment!r}"


@pytest.mark.parametrize(("group", "option"), OPTIONS)
def test_every_option_composes_and_builds(group: str, option: str, tmp_path: Path) -> None:
    settings = [Setting(key=group, values=(option,))]
    tree = load(group, option)
    for name in (name for name, value in values(tree).items() if value == MISSING):
        file = tmp_path / "any.ply"
        file.touch()
        settings.append(Setting(key=f"{group}.{name}", values=(str(file),)))
    cell = COMPOSER.cell(settings)
    assert cell.options.get(group, option) == option
    config = functools.reduce(lambda part, key: part[key], group.split("."), cell.config)
    assert config[TARGET] == tree[TARGET]
    component = build_component(group, config)
    for name in parameter_types(type(component)):
        assert hasattr(component, name)


@pytest.mark.parametrize(("group", "option"), OPTIONS)
def test_an_option_speaks_its_protocol(group: str, option: str) -> None:
    protocol = protocol_of(group)
    cls = component_class(group, str(load(group, option)[TARGET]))
    for name, member in vars(protocol).items():
        if name.startswith("_") or not inspect.isfunction(member):
            continue
        wanted = list(inspect.signature(member).parameters)
        have = list(inspect.signature(getattr(cls, name)).parameters)
        assert have == wanted, f"{cls.__name__}.{name}{have}, the protocol has {wanted}"


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_only_overrides(preset: str) -> None:
    text = (CONF / PRESET_GROUP / f"{preset}.yaml").read_text()
    assert text.startswith("# @package _global_\n")
    tree = yaml.safe_load(text)
    groups = [key.removeprefix("override /") for item in tree.pop("defaults") for key in item]
    assert set(groups) <= set(GROUPS)
    parts = [part for part in tree.values() if isinstance(part, dict)]
    assert all(set(values(part)) == set(part) for part in parts), "a preset names no class"
    cell = COMPOSER.cell(parse_settings([f"{PRESET_GROUP}={preset}"]))
    assert cell.strategy == preset


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_is_what_it_names_and_nothing_else(preset: str) -> None:
    """The same flight as when its options and values are typed; all else is the default."""
    tree = yaml.safe_load((CONF / PRESET_GROUP / f"{preset}.yaml").read_text())
    typed = [
        f"{key.removeprefix('override /')}={option}"
        for item in tree.pop("defaults")
        for key, option in item.items()
    ]
    for key, value in tree.items():
        inner = value.items() if isinstance(value, dict) else [("", value)]
        typed += [f"{key}{'.' if name else ''}{name}={item}" for name, item in inner]
    assert COMPOSER.cell(parse_settings(typed)).config == (
        COMPOSER.cell(parse_settings([f"{PRESET_GROUP}={preset}"])).config
    )


def test_every_module_with_a_component_has_its_yaml() -> None:
    for group in ALL_GROUPS:
        members = protocol_members(group)
        for file in sorted(folder_of(PACKAGE, group).glob("*.py")):
            if file.stem in ("__init__", "base") or (group, file.stem) in OPTIONS:
                continue
            module = importlib.import_module(f"uavexp.{group}.{file.stem}")
            components = [
                item.__name__
                for item in vars(module).values()
                if inspect.isclass(item)
                and item.__module__ == module.__name__
                and not (inspect.isabstract(item) or item.__subclasses__())
                and all(hasattr(item, name) for name in members)
            ]
            assert not components, (
                f"{file.name} defines {components} but conf/{group}/{file.stem}.yaml is missing"
            )
