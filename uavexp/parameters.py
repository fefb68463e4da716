"""Checks plain values against the annotations of the class that will take them."""

from __future__ import annotations

import dataclasses
import difflib
import functools
import inspect
import math
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from typing import Any, Literal, Union, get_args, get_origin

from uavexp.errors import ConfigError

MISSING = "???"  # OmegaConf's mark of a value that must be given


@functools.cache
def parameter_types(cls: type) -> dict[str, Any]:
    """Name and annotation of every constructor parameter of a component class."""
    if dataclasses.is_dataclass(cls):
        hints = typing.get_type_hints(cls)
        return {item.name: hints[item.name] for item in dataclasses.fields(cls) if item.init}
    signature = inspect.signature(cls, eval_str=True)
    return {
        name: Any if parameter.annotation is parameter.empty else parameter.annotation
        for name, parameter in signature.parameters.items()
        if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
    }


@functools.cache
def required_parameters(cls: type) -> list[str]:
    """Names of the constructor parameters without a default."""
    parameters = inspect.signature(cls).parameters
    return [name for name in parameter_types(cls) if parameters[name].default is inspect.Parameter.empty]


def check_value(name: str, value: Any, annotation: Any) -> Any:
    """Return the value in the annotated type: 5 becomes 5.0, a list a tuple, a word an enum's member.

    Raises:
        ConfigError: a value of another type, NaN, or a missing one; names what is allowed.
    """
    if value == MISSING:
        raise ConfigError(f"{name} must be given: type {name}=VALUE ({describe(annotation)})")
    try:
        return _convert(value, annotation)
    except (TypeError, ValueError, ArithmeticError) as error:
        raise ConfigError(f"{name} must be {describe(annotation)}, got {value!r}") from error


def describe(annotation: Any) -> str:
    """An annotation in words."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin in (Union, types.UnionType):
        return " or ".join(describe(item) for item in arguments)
    if origin is Literal:
        return " | ".join(map(str, arguments))
    if origin in (list, Sequence):
        return f"a list, each {describe(arguments[0])}"
    if origin is tuple:
        if arguments[-1] is Ellipsis:
            return f"a list, each {describe(arguments[0])}"
        return "[" + ", ".join(describe(item) for item in arguments) + "]"
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return " | ".join(str(member.value) for member in annotation)
    words = {float: "a number", int: "a whole number", bool: "true or false", str: "text", type(None): "null"}
    return words.get(annotation, str(getattr(annotation, "__name__", annotation)))


def plain(value: Any) -> Any:
    """The same value as JSON and yaml know it: tuples as lists, enums as their words."""
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    return value


def _convert(value: Any, annotation: Any) -> Any:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if annotation is Any or annotation is object:
        return value
    if origin in (Union, types.UnionType):
        return _convert_union(value, arguments)
    if origin is Literal:
        return _member(value, value in arguments)
    if origin in (list, Sequence):
        return [_convert(item, arguments[0]) for item in _sequence(value)]
    if origin is tuple:
        return _convert_tuple(_sequence(value), arguments)
    if origin is dict or origin is Mapping:
        if not isinstance(value, Mapping):
            raise TypeError
        return {_convert(key, arguments[0]): _convert(item, arguments[1]) for key, item in value.items()}
    if isinstance(annotation, type):
        return _convert_scalar(value, annotation)
    return value


def _convert_union(value: Any, members: tuple[Any, ...]) -> Any:
    for member in members:
        try:
            return _convert(value, member)
        except (TypeError, ValueError):
            continue
    raise TypeError


def _convert_tuple(value: list[Any] | tuple[Any, ...], items: tuple[Any, ...]) -> tuple[Any, ...]:
    if items and items[-1] is Ellipsis:
        return tuple(_convert(item, items[0]) for item in value)
    return tuple(_convert(item, kind) for item, kind in zip(value, items, strict=True))


def _convert_scalar(value: Any, kind: type) -> Any:
    if issubclass(kind, Enum):
        return kind(plain(value))
    if kind is type(None):
        return _member(value, value is None)
    if kind is bool or kind is str:
        return _member(value, isinstance(value, kind))
    if kind is float:
        number = float(_member(value, isinstance(value, int | float) and not isinstance(value, bool)))
        return _member(number, not math.isnan(number))
    if kind is int:
        _member(value, isinstance(value, int | float) and not isinstance(value, bool))
        return _member(int(value), int(value) == value)
    if kind in (list, tuple):
        return kind(_sequence(value))
    return value


def _sequence(value: Any) -> list[Any] | tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise TypeError
    return value


def _member(value: Any, allowed: bool) -> Any:
    if not allowed:
        raise TypeError
    return value


def nearest(given: str, allowed: Iterable[str]) -> str:
    """` (did you mean 'x'?)` for the closest allowed name, or nothing."""
    close = difflib.get_close_matches(given, list(allowed), n=1, cutoff=0.5)
    return f" (did you mean '{close[0]}'?)" if close else ""
