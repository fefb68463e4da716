"""Promises: what is checked of an option, and how it is told that one of them is broken."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from uavexp.errors import one_line

Make = Callable[[], Any]  # builds the option afresh
Promise = Callable[[Make], None]  # returns when it is kept, raises `Broken` when it is not


class Broken(Exception):
    """A promise is not kept; the message says by how much."""


def keep(kept: bool | np.bool_, by_how_much: str) -> None:
    """Raise `Broken` unless it is so."""
    if not kept:
        raise Broken(by_how_much)


def promises(group: str) -> dict[str, Promise]:
    """What an option of this group promises, in words: the public functions of `uavexp.check.<group>`."""
    module = importlib.import_module(f"uavexp.check.{group}")
    return {
        name.replace("_", " "): function
        for name, function in vars(module).items()
        if inspect.isfunction(function) and function.__module__ == module.__name__ and name[0] != "_"
    }


def breach(promise: Promise, make: Make) -> str:
    """How an option breaks a promise; empty when it keeps it.

    Whatever is asked of it, it raises nothing and leaves the global generators alone.
    """
    before = _global_generators()
    try:
        promise(make)
    except Broken as broken:
        return str(broken)
    except Exception as error:  # whatever a stranger's code raises is told, not passed on
        return f"it raised {type(error).__name__}: {one_line(error)}"
    drawn = [name for name, state in _global_generators().items() if state != before[name]]
    return f"it drew from the global generator of {' and of '.join(drawn)}" if drawn else ""


def _global_generators() -> dict[str, str]:
    return {"numpy": repr(np.random.get_state(legacy=False)), "random": repr(random.getstate())}  # noqa: NPY002


def arrays(item: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every array and plain value inside frozen data, with its path; clock times (`wall_`) left out."""
    if dataclasses.is_dataclass(item):
        for part in dataclasses.fields(item):
            if not part.name.startswith("wall_"):
                yield from arrays(getattr(item, part.name), f"{path}.{part.name}" if path else part.name)
    elif isinstance(item, tuple | list):
        for number, part in enumerate(item):
            yield from arrays(part, f"{path}[{number}]")
    else:
        yield path, item


def same(one: Any, other: Any) -> bool:
    """Whether two pieces of frozen data are the same to the last bit."""
    ours, theirs = list(arrays(one)), list(arrays(other))
    return [path for path, _ in ours] == [path for path, _ in theirs] and all(
        np.asarray(here).tobytes() == np.asarray(there).tobytes() if _is_number(here) else here == there
        for (_, here), (_, there) in zip(ours, theirs, strict=True)
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, np.ndarray | float)  # bits: NaN equals itself


@contextmanager
def untouched(**given: Any) -> Iterator[None]:
    """Hold the block to writing into none of the arrays that it is given."""
    held = {
        path: (array, array.copy())
        for name, item in given.items()
        for path, array in arrays(item, name)
        if isinstance(array, np.ndarray)
    }
    yield
    for path, (now, before) in held.items():
        keep(np.array_equal(now, before, equal_nan=now.dtype.kind == "f"), f"it wrote into {path}")
