"""`${key}` in a composed tree: the value of another key, and nothing that would run something."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from uavexp.errors import ConfigError

_REFERENCE = re.compile(r"\$\{([A-Za-z_]\w*(?:\.\w+)*)\}")


def resolved(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Replace every `${key}` and `${group.key}` by that value; `hydra` stays as it is.

    Raises:
        ConfigError: a key that is not there or names itself; `${resolver:...}`, which reads clocks,
            environment or text as code; a reference within other text.
    """
    own = {key: value for key, value in tree.items() if key != "hydra"}
    return {**_resolve(own, own, "", ()), "hydra": tree["hydra"]}


def _resolve(node: Any, top: Mapping[str, Any], path: str, followed: tuple[str, ...]) -> Any:
    if isinstance(node, Mapping):
        return {
            key: _resolve(value, top, f"{path}.{key}".strip("."), followed) for key, value in node.items()
        }
    if isinstance(node, list):
        return [_resolve(value, top, f"{path}[{index}]", followed) for index, value in enumerate(node)]
    if not isinstance(node, str) or "${" not in node:
        return node
    match = _REFERENCE.fullmatch(node)
    if match is None or match[1] in followed:
        raise ConfigError(
            f"{path}={node}: only ${{key}} of another key may be used in a value, no ${{resolver:...}}"
        )
    return _resolve(_value(top, match[1], f"{path}={node}"), top, path, (*followed, match[1]))


def _value(top: Mapping[str, Any], key: str, where: str) -> Any:
    node: Any = top
    for name in key.split("."):
        if not isinstance(node, Mapping) or name not in node:
            raise ConfigError(f"{where}: there is no key {key}")
        node = node[name]
    return node
