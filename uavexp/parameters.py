"""A parameter is declared once: a field of its option with type, bounds, default and one sentence.

    @option
    class Brake:
        margin_m: NonNegative = 0.03  # m, the path counts as blocked below body radius + this [ours]

The check below reads type and bounds, `uavexp.config.generate` all four (`make conf`).
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import inspect
import math
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum, StrEnum
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from uavexp.errors import ConfigError, require

GREATEST_INT = 2**63 - 1  # that a column of a table holds
MISSING = "???"  # OmegaConf's mark of a value that must be given


@dataclasses.dataclass(frozen=True, slots=True)
class Constraint:
    """What a value must be beyond its type, in words and as a test."""

    words: str
    holds: Callable[[Any], bool]


def above(least: float) -> Constraint:
    """Greater than a number."""
    return Constraint(f"> {least:g}", lambda value: value > least)


def below(most: float) -> Constraint:
    """Less than a number."""
    return Constraint(f"< {most:g}", lambda value: value < most)


def at_least(least: float) -> Constraint:
    """A number or more."""
    return Constraint(f">= {least:g}", lambda value: value >= least)


def at_most(most: float) -> Constraint:
    """A number or less."""
    return Constraint(f"<= {most:g}", lambda value: value <= most)


def between(least: float, most: float) -> Constraint:
    """From one number to another, both included."""
    return Constraint(f"{least:g} to {most:g}", lambda value: least <= value <= most)


FINITE = Constraint("finite", math.isfinite)
Finite = Annotated[float, FINITE]
Positive = Annotated[float, above(0), FINITE]
NonNegative = Annotated[float, at_least(0), FINITE]
Share = Annotated[float, between(0, 1)]
PositiveShare = Annotated[float, above(0), at_most(1)]
Whole = Annotated[int, at_least(0)]
Count = Annotated[int, at_least(1)]
Vector = tuple[Finite, Finite, Finite]
Range = Annotated[tuple[Positive, Positive], Constraint("[least, greatest]", lambda pair: pair[0] <= pair[1])]


# What holds everywhere in a trial, named by the key of no group that it is taken from
NarrowClearance = Annotated[float, between(0, 1)]  # `${narrow_clearance_m}`
NarrowSpeed = Annotated[float, above(0), at_most(10)]  # `${narrow_speed_mps}`


class Unknown(StrEnum):
    """Whether plans may enter space never seen; one word for the whole trial (`${unknown}`)."""

    OPTIMISTIC = "optimistic"  # as if it were free
    CONSERVATIVE = "conservative"


@typing.dataclass_transform(kw_only_default=True, field_specifiers=(dataclasses.field,))
def option(cls: Any = None, /, *, frozen: bool = False) -> Any:
    """Make a class an option of its group: a dataclass whose parameters are checked and converted.

    Its own `__post_init__` comes after that, for what ties parameters together.
    """
    if cls is None:
        return functools.partial(option, frozen=frozen)
    then = getattr(cls, "__post_init__", None)

    def __post_init__(self: Any) -> None:
        for name, annotation in parameter_types(self.__class__).items():
            object.__setattr__(self, name, check_value(name, getattr(self, name), annotation))
        if then is not None:
            then(self)

    cls.__post_init__ = __post_init__
    cls.__option__ = True
    return dataclasses.dataclass(frozen=frozen, slots=True, kw_only=True)(cls)


def is_option(item: object) -> bool:
    """Whether an object is a class that `option` has made (not one that only inherits from it)."""
    return isinstance(item, type) and "__option__" in vars(item)


@functools.cache
def parameter_types(cls: type) -> dict[str, Any]:
    """Name and annotation of every constructor parameter of a component class."""
    if dataclasses.is_dataclass(cls):
        hints = typing.get_type_hints(cls, include_extras=True)
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
        ConfigError: a value of another type, NaN, out of bounds, or a missing one; names what is allowed.
    """
    if value == MISSING:
        raise ConfigError(f"{name} must be given: type {name}=VALUE ({describe(annotation)})")
    try:
        return _convert(name, value, annotation)
    except ConfigError:
        raise
    except (TypeError, ValueError, ArithmeticError) as error:
        is_number = isinstance(value, int | float) and describe(annotation).startswith("[")
        hint = f"; a list is typed in brackets, {name}=[...]" if is_number else ""
        raise ConfigError(f"{name} must be {describe(annotation)}, got {value!r}{hint}") from error


def describe(annotation: Any) -> str:
    """A type in words; bounds speak for themselves."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return describe(arguments[0])
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


def _convert(name: str, value: Any, annotation: Any) -> Any:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if annotation is Any or annotation is object:
        return value
    if origin is Annotated:
        is_nan = isinstance(value, float) and math.isnan(value)  # which no bounds hold
        return _constrained(name, value if is_nan else _convert(name, value, arguments[0]), arguments[1:])
    if origin in (Union, types.UnionType):
        return _convert_union(name, value, arguments)
    if origin is Literal:
        return _member(value, value in arguments)
    if origin in (list, Sequence):
        return _convert_items(name, _sequence(value), [arguments[0]] * len(value))
    if origin is tuple:
        items = _sequence(value)
        kinds = arguments[:1] * len(items) if arguments[-1] is Ellipsis else arguments
        return tuple(_convert_items(name, items, kinds))
    if origin is dict or origin is Mapping:
        if not isinstance(value, Mapping):
            raise TypeError
        kind, item_kind = arguments
        pairs = ((_convert(name, key, kind), item) for key, item in value.items())
        return {key: _convert(f"{name}.{key}", item, item_kind) for key, item in pairs}
    if isinstance(annotation, type):
        converted = _convert_scalar(value, annotation)
        if annotation is int:
            require(abs(converted) <= GREATEST_INT, f"{name} must be at most {GREATEST_INT}, got {value!r}")
        return converted
    return value


def _constrained(name: str, value: Any, constraints: Sequence[Constraint]) -> Any:
    words = " and ".join(item.words for item in constraints)
    require(all(item.holds(value) for item in constraints), f"{name} must be {words}, got {plain(value)!r}")
    return value


def _convert_union(name: str, value: Any, members: Iterable[Any]) -> Any:
    for member in members:
        try:
            return _convert(name, value, member)
        except ConfigError:  # of this type, but out of bounds
            raise
        except (TypeError, ValueError):
            continue
    raise TypeError


def _convert_items(name: str, values: Sequence[Any], kinds: Sequence[Any]) -> list[Any]:
    pairs = enumerate(zip(values, kinds, strict=True))
    return [_convert(f"{name}[{n}]", item, kind) for n, (item, kind) in pairs]


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


def _sequence(value: Any) -> Sequence[Any]:
    if not isinstance(value, Sequence) or isinstance(value, str):  # OmegaConf's lists are no `list`
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
