"""What a group's protocol asks of a component, and whether one that somebody wrote has it."""

from __future__ import annotations

import functools
import importlib
import inspect
from typing import Any

from uavexp.errors import ConfigError


def check_protocol(group: str, component: object, path: str) -> None:
    """Refuse a component that lacks what its group asks for, or takes other arguments.

    Args:
        group: whose protocol it must speak.
        component: of any class.
        path: where it stands, for messages.

    Raises:
        ConfigError: names what to write.
    """
    lacking = [name for name in protocol_members(group) if not _has(component, name)]
    cls = type(component)
    if lacking:
        raise ConfigError(
            f"{path}: {cls.__module__}.{cls.__name__} is no {group}, it lacks {', '.join(lacking)}; "
            f"write them as in uavexp/{group}/base.py"
        )
    shipped = cls.__module__.startswith("uavexp.")  # a test holds them to it
    for name, asked in ({} if shipped else _methods(group)).items():
        if not _takes(getattr(component, name), asked):
            raise ConfigError(
                f"{path}: {cls.__module__}.{cls.__name__}.{name} takes other arguments than it is given; "
                f"write def {name}{_text(asked)}"
            )


@functools.cache
def _methods(group: str) -> dict[str, inspect.Signature]:
    """Methods that a group's protocol asks for, as they are written."""
    found = {name: item for name, item in vars(protocol_of(group)).items() if inspect.isfunction(item)}
    return {name: inspect.signature(item) for name, item in found.items() if not name.startswith("_")}


def _takes(method: Any, asked: inspect.Signature) -> bool:
    """Whether a bound method can be called as a protocol's."""
    words = [item for item in asked.parameters.values() if item.kind is item.KEYWORD_ONLY]
    try:
        inspect.signature(method).bind(
            *[None] * (len(asked.parameters) - 1 - len(words)), **{item.name: None for item in words}
        )
    except TypeError:
        return False
    except ValueError:  # compiled, without a signature
        return True
    return True


def _has(component: object, name: str) -> bool:
    """Whether an attribute exists; properties are not called, they may need `reset` first."""
    try:
        inspect.getattr_static(component, name)
    except AttributeError:
        return False
    return True


def _text(signature: inspect.Signature) -> str:
    """A signature as it is written: its annotations are kept as text."""
    return str(signature).replace("'", "")


def protocol_members(group: str) -> list[str]:
    """Names of the methods and attributes that a group's protocol asks for."""
    protocol = protocol_of(group)
    own = [name for name in vars(protocol) if not name.startswith("_")]
    return sorted({*own, *vars(protocol).get("__annotations__", {})})


def protocol_of(group: str) -> type:
    """The first protocol of `uavexp/<group>/base.py`, its options'; others are of what these begin."""
    base = importlib.import_module(f"uavexp.{group}.base")
    protocols = [
        item
        for item in vars(base).values()
        if isinstance(item, type)
        and item.__module__ == base.__name__
        and getattr(item, "_is_protocol", False)
    ]
    return protocols[0]
