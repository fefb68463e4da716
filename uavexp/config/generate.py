"""`make conf`: the yaml of every option, made from the fields of its class and their comments.

A parameter's comment begins behind its default and may go on in the lines below:

    margin_m: NonNegative = 0.03  # m, the path counts as blocked when its clearance is below
    # body radius + this [ours]

`python -m uavexp.config.generate MODULE.CLASS` prints the yaml of an option of your own.
"""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import io
import sys
import textwrap
import tokenize
from pathlib import Path
from typing import Any

import yaml  # type: ignore[import-untyped]

from uavexp.config.build import GROUPS, TARGET, component_class, nested_groups
from uavexp.config.options import RUNNER_GROUP
from uavexp.config.trust import VARIABLE, is_trusted
from uavexp.errors import ConfigError, UavexpError, one_line
from uavexp.parameters import (
    MISSING,
    NarrowClearance,
    NarrowSpeed,
    Unknown,
    is_option,
    parameter_types,
    plain,
)
from uavexp.paths import PACKAGE, conf_folder

# parameters that hold everywhere in a trial, by their type, and the key in conf/config.yaml
_SHARED = (
    (Unknown, "unknown"),
    (NarrowClearance, "narrow_clearance_m"),
    (NarrowSpeed, "narrow_speed_mps"),
)


def option_files() -> dict[Path, str]:
    """Path and text of the yaml of every option of the package."""
    held = [f"{base.parent.parent.name}.{base.parent.name}" for base in PACKAGE.glob("*/*/base.py")]
    classes = [cls for group in (*GROUPS, *held) for cls in _options(group)]
    return {_place(cls): option_yaml(cls) for cls in classes} | _runner_file()


def option_yaml(cls: type) -> str:
    """The yaml of one option: its class, and a line for each parameter."""
    target = f"{TARGET}: {cls.__module__}.{cls.__name__}"
    return "\n".join([*_defaults_list(cls), target, *parameter_lines(cls)]) + "\n"


def parameter_lines(cls: type) -> list[str]:
    """`name: default  # comment` of every parameter of a dataclass."""
    bases = [base for base in reversed(cls.__mro__) if dataclasses.is_dataclass(base)]
    said = {name: text for base in bases for name, text in _comments(base).items() if text}
    fields = [item for item in dataclasses.fields(cls) if item.init and item.name not in _held(cls)]
    return [f"{item.name}: {_default(cls, item)}  # {said.get(item.name, '')}".rstrip() for item in fields]


def _runner_file() -> dict[Path, str]:
    """The runner is no part of a trial and no target: its parameters under what it says of itself."""
    runner = importlib.import_module("uavexp.sweep.runner").Runner
    text = "\n".join([f"# {inspect.getdoc(runner)}", *parameter_lines(runner)])
    return {conf_folder() / RUNNER_GROUP / "local.yaml": f"{text}\n"}


def _defaults_list(cls: type) -> list[str]:
    """What an option brings with it: what it holds, or its class's `defaults_list` with the comment there."""
    items: tuple[str, ...] = getattr(cls, "defaults_list", ())
    head = [f"# {_comments(cls)['defaults_list']}", "defaults:"] if items else []
    if held := _held(cls):
        head, items = ["defaults:"], (*(f"{name}: {option}" for name, option in held.items()), "_self_")
    return head + [f"  - {item}" for item in items]


def _held(cls: type) -> dict[str, str]:
    """Parameters that hold one option of another group each, and which by default."""
    factories = {item.name: item.default_factory for item in dataclasses.fields(cls)}
    modules = {name: getattr(factories[name], "__module__", "") for name in nested_groups(cls)}
    return {
        name: module.rpartition(".")[2] for name, module in modules.items() if module.startswith("uavexp.")
    }


def _default(cls: type, item: dataclasses.Field[Any]) -> str:
    shared = [name for kind, name in _SHARED if parameter_types(cls)[item.name] == kind]
    if shared:
        return f"${{{shared[0]}}}"  # the trial's
    if item.default_factory is not dataclasses.MISSING:
        return _scalar(item.default_factory())
    return MISSING if item.default is dataclasses.MISSING else _scalar(item.default)


def _scalar(value: Any) -> str:
    text: str = yaml.safe_dump(plain(value), default_flow_style=True, width=1_000_000, allow_unicode=True)
    return text.removesuffix("\n...\n").strip()


def _comments(cls: type) -> dict[str, str]:
    """Comment of every field in a class's source: behind it, and in whole lines after it."""
    source = textwrap.dedent(inspect.getsource(cls))
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    comments = {at[0]: text.lstrip("# ") for kind, text, at, *_ in tokens if kind == tokenize.COMMENT}
    body = ast.parse(source).body[0].body  # type: ignore[attr-defined]
    ends = [node.lineno for node in body[1:]] + [sys.maxsize]
    return {
        node.target.id: " ".join(comments[line] for line in sorted(comments) if node.lineno <= line < end)
        for node, end in zip(body, ends, strict=True)
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }


def _options(group: str) -> list[type]:
    names = [
        f"uavexp.{group}.{file.stem}" for file in sorted(PACKAGE.joinpath(*group.split(".")).glob("*.py"))
    ]
    modules = [importlib.import_module(name) for name in names]
    return [
        item
        for module in modules
        for item in vars(module).values()
        if is_option(item) and item.__module__ == module.__name__
    ]


def _place(cls: type) -> Path:
    _, *group, name = cls.__module__.split(".")
    return conf_folder().joinpath(*group, f"{name}.yaml")


def _class_of(target: str) -> type:
    if target.count(".") < 2 or not is_trusted(target):
        raise ConfigError(f"{target} is no class of uavexp or of a package that {VARIABLE} names")
    return component_class(target.split(".")[1], target, "option")


def main(targets: list[str]) -> int:
    """Print the yaml of the classes named; without any, write that of every shipped option."""
    try:
        texts = [option_yaml(_class_of(target)) for target in targets]
    except UavexpError as error:
        sys.stderr.write(f"error: {one_line(error)}; type PACKAGE.MODULE.CLASS\n")
        return 2
    sys.stdout.write("".join(texts))
    for path, text in option_files().items() if not targets else ():
        path.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
