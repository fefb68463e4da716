"""`${key}` in a composed tree: resolved when it names a key, refused when it would run something."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from uavexp.errors import ConfigError, one_line

_KEY_REFERENCE = re.compile(r"\$\{(\w+)\}")


def resolved(tree: dict[str, Any]) -> dict[str, Any]:
    """Resolve `${key}`; refuse `${resolver:...}`, which reads clocks, environment or text as code."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    hydra = tree["hydra"]
    own = {key: value for key, value in tree.items() if key != "hydra"}
    found = list(_interpolations(own, ""))
    if all(_names_plain_key(text, own) for _, text in found):
        return {**_follow(own, own), "hydra": hydra}  # OmegaConf takes 20 ms for the same
    for key, text in found:
        if _calls_resolver(text):
            raise ConfigError(f"{key}={text}: only ${{key}} may be used in a value, no ${{resolver:...}}")
    try:
        resolved: Any = OmegaConf.to_container(OmegaConf.create(own), resolve=True)
    except OmegaConfBaseException as error:
        raise ConfigError(f"the configuration does not resolve: {with_cause(error)}") from error
    return {**resolved, "hydra": hydra}


def _names_plain_key(text: str, top: Mapping[str, Any]) -> bool:
    """Whether a text is `${key}` and nothing else, of a top-level key that holds one final value."""
    match = _KEY_REFERENCE.fullmatch(text)
    value = top.get(match[1], {}) if match else {}
    return not isinstance(value, Mapping | list) and "${" not in str(value)


def _follow(node: Any, top: Mapping[str, Any]) -> Any:
    """The node with every `${key}` replaced by that top-level value."""
    if isinstance(node, dict):
        return {key: _follow(value, top) for key, value in node.items()}
    if isinstance(node, list):
        return [_follow(value, top) for value in node]
    match = _KEY_REFERENCE.fullmatch(node) if isinstance(node, str) else None
    return top[match[1]] if match else node


def _interpolations(node: Any, path: str) -> Iterator[tuple[str, str]]:
    if isinstance(node, Mapping):
        for key, value in node.items():
            yield from _interpolations(value, f"{path}.{key}" if path else str(key))
    elif isinstance(node, list):
        for index, value in enumerate(node):
            yield from _interpolations(value, f"{path}[{index}]")
    elif isinstance(node, str) and "${" in node:
        yield path, node


def _calls_resolver(text: str) -> bool:
    from omegaconf.errors import GrammarParseError
    from omegaconf.grammar_parser import parse

    def walk(context: Any) -> bool:
        if type(context).__name__ == "InterpolationResolverContext":
            return True
        return any(walk(child) for child in getattr(context, "children", None) or ())

    try:
        return walk(parse(text))
    except GrammarParseError as error:
        raise ConfigError(f"cannot read the value {text!r}") from error


def with_cause(error: BaseException) -> str:
    """Message of an error and of its cause, in one line."""
    cause = error.__cause__
    return (one_line(error) or type(error).__name__) + (f" ({one_line(cause)})" if cause else "")
