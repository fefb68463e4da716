"""Whom a configuration may call: a config from a stranger must not run code.

Hydra's `_target_` and logging's `()` name something to call. Every one of them, anywhere
in the composed tree, must belong to `uavexp` or to a package the user names in the
environment variable `UAVEXP_TRUST`. The check runs on plain, fully resolved data, and
that same data is what `uavexp.config.build` reads: nothing can change in between.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from typing import Any

from uavexp.config.options import RUNNER_GROUP
from uavexp.errors import ConfigError

VARIABLE = "UAVEXP_TRUST"
_CALLS = ("_target_", "()")
_DOTTED_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)+", re.ASCII)


def trusted_packages() -> tuple[str, ...]:
    """Packages whose classes a configuration may name: `uavexp` and those of `UAVEXP_TRUST`."""
    named = re.split(r"[,:;\s]+", os.environ.get(VARIABLE, ""))
    return ("uavexp", *(name for name in named if name))


def is_trusted(dotted_name: str) -> bool:
    """Whether a dotted name lies inside a trusted package."""
    return any(dotted_name.startswith(f"{package}.") for package in trusted_packages())


def check_places(tree: Mapping[str, Any]) -> None:
    """Refuse options whose files say where results go or whom to connect to: that counts only as typed.

    Dask's client unpickles what a scheduler sends, so an address from a stranger would run code.

    Args:
        tree: of options as composed, before what was typed is applied.

    Raises:
        ConfigError: names the key and what to type.
    """
    for key in ("out", *(f"{RUNNER_GROUP}.{name}" for name in ("address", "queue"))):
        group, _, name = key.rpartition(".")
        value = (tree.get(group, {}) if group else tree).get(name)
        if value is not None:
            raise ConfigError(
                f"a configuration file sets {key}={value!r}: refused, where results go and whom to connect "
                f"to count only as typed; type {key}=... yourself if you trust it"
            )


def check_trust(tree: Any) -> None:
    """Refuse a tree in which anything but a trusted package would be called.

    Args:
        tree: nested dicts and lists of a composed configuration, `hydra` included.

    Raises:
        ConfigError: names the first offending key and value.
    """
    for key, value in _calls(tree, ""):
        if not (isinstance(value, str) and _DOTTED_NAME.fullmatch(value) and is_trusted(value)):
            raise ConfigError(
                f"{key}={value!r} is refused: a configuration may only name classes of "
                f"{', '.join(trusted_packages())}; add packages to the variable {VARIABLE}"
            )


def called_names(tree: Any) -> list[str]:
    """Dotted names of all that a checked tree calls."""
    return [str(value) for _, value in _calls(tree, "")]


def _calls(node: Any, path: str) -> Iterator[tuple[str, Any]]:
    if isinstance(node, Mapping):
        for key, value in node.items():
            here = f"{path}.{key}" if path else str(key)
            if key in _CALLS:
                yield here, value
            yield from _calls(value, here)
    elif isinstance(node, list | tuple):
        for index, value in enumerate(node):
            yield from _calls(value, f"{path}[{index}]")
