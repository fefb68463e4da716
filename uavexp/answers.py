"""What a role answers is looked at before anybody goes by it: a component may be a stranger's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from uavexp.errors import ConfigError

T = TypeVar("T")


def ask(kind: type[T], method: Callable[..., object], *given: Any) -> T:
    """Call a component's method and return its answer, which must be of a kind.

    Args:
        kind: what its protocol says.
        method: bound to the component.
        given: its arguments.

    Raises:
        ConfigError: the answer is something else; names the method and what to return.
    """
    answer = method(*given)
    if isinstance(answer, kind):
        return answer
    name = f"{type(getattr(method, '__self__', None)).__module__}.{method.__qualname__}"
    raise ConfigError(
        f"{name} must return a {kind.__name__} ({kind.__module__}), got {type(answer).__name__}: "
        f"{str(answer)[:60]}"
    )
