"""Configuration to components, checked against their annotations and protocols.

A configuration is plain data here: one dict per group with `_target_` and parameters, and
the numbers that belong to no group. Nothing but a class defined in a trusted package is
ever looked up (`uavexp.config.trust` has refused the rest before), and only its constructor
is called.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Protocol, get_args, get_origin, runtime_checkable

from uavexp.config.own_code import imported, raised
from uavexp.config.protocols import check_protocol
from uavexp.config.trust import check_trust, is_trusted
from uavexp.errors import ConfigError, UavexpError
from uavexp.parameters import check_value, nearest, parameter_types, plain, required_parameters

if TYPE_CHECKING:
    from uavexp.trial import Parts

GROUPS = (
    "world",
    "sensor",
    "estimator",
    "mapping",
    "explorer",
    "trigger",
    "planner",
    "controller",
    "vehicle",
    "safety",
    "movers",
    "detection",
    "mission",
    "pilot",
)
TARGET = "_target_"


@runtime_checkable
class NeedsOthers(Protocol):
    """A component that does not fly with every other one."""

    def requires(self, **parts: Any) -> None:
        """Raise `ConfigError` unless the trial's other parts are as this one needs them.

        Args:
            parts: the fields of `uavexp.trial.Parts` by name; it names those that it looks at.
        """


@functools.cache
def top_level() -> dict[str, Any]:
    """Name and type of the keys of no group: the fields of a trial's parts that are no component."""
    from uavexp.trial import Parts

    return {name: kind for name, kind in parameter_types(Parts).items() if name not in GROUPS}


def check_config(config: Mapping[str, Any], options: Mapping[str, str]) -> dict[str, Any]:
    """Return the configuration in its components' own types, as plain data.

    Equal configurations come out equal whatever was typed (5 or 5.0), so that they name
    the same trial.

    Args:
        config: one tree per group and the top-level numbers.
        options: chosen option per group, for messages.

    Raises:
        ConfigError: a wrong class, an unknown or missing parameter, a wrong type; every
            constructor has accepted its values when this returns.
    """
    checked: dict[str, Any] = {key: check_value(key, config[key], kind) for key, kind in top_level().items()}
    for group in GROUPS:
        tree = config[group]
        if not isinstance(tree, Mapping) or TARGET not in tree:
            words = f"{group}={options[group]}: the option has no {TARGET}"
            keys = tree if isinstance(tree, Mapping) else ()
            hint = next((f" (is {key} meant?)" for key in keys if nearest(str(key), [TARGET])), "")
            raise ConfigError(f"{words}{hint}; its file begins {TARGET}: PACKAGE.MODULE.CLASS")
        checked[group] = _checked_tree(group, tree, group)
    build(checked)
    return checked


def build(config: Mapping[str, Any]) -> Parts:
    """Build every component of a checked configuration, fresh.

    Raises:
        ConfigError: a constructor or a protocol refuses.
    """
    from uavexp.trial import Parts

    check_trust(config)
    components = {group: build_component(group, config[group]) for group in GROUPS}
    try:
        parts = Parts(**components, **{key: config[key] for key in top_level()})
    except ArithmeticError as error:
        raise ConfigError(f"a rate or period does not fit the step: {error}") from error
    _check_needs(parts)
    return parts


def build_component(group: str, tree: Mapping[str, Any], path: str = "") -> Any:
    """Build one component, those inside it first, and check that it speaks its group's protocol.

    Args:
        group: whose protocol it must speak.
        tree: `_target_` and parameters; a parameter of type P or dict[str, P], P a group's protocol,
            holds a tree of that group, or several by name.
        path: where the tree stands, for messages; the group when it is not told.
    """
    path = path or group
    cls = component_class(group, tree[TARGET])
    arguments = _arguments(group, tree, path)
    for key, inner in nested_groups(cls).items():
        if key not in arguments:
            continue
        if TARGET in arguments[key]:
            arguments[key] = build_component(inner, arguments[key], f"{path}.{key}")
        else:
            parts = arguments[key].items()
            arguments[key] = {
                name: build_component(inner, part, f"{path}.{key}.{name}") for name, part in parts
            }
    try:
        component = cls(**arguments)
    except UavexpError as error:
        raise _told(path, cls, error) from error
    except (TypeError, ValueError, ArithmeticError) as error:
        raise ConfigError(f"{path}: {cls.__name__} cannot be made: {error}") from error
    except Exception as error:  # of a stranger's class, anything
        raise ConfigError(f"{path}: {cls.__name__} cannot be made: {raised(error)}") from error
    check_protocol(group, component, path)
    return component


def with_own(parts: Parts, own: Mapping[str, Any]) -> Parts:
    """The parts with components that somebody made (group -> component) in place of the configured ones.

    Raises:
        ConfigError: one does not speak its group's protocol, or does not fly with the others.
    """
    for group, component in own.items():
        if isinstance(component, type):
            raise ConfigError(
                f"{group}: {component.__name__} is a class; give an object, {component.__name__}()"
            )
        check_protocol(group, component, group)
    parts = dataclasses.replace(parts, **own)
    if own:
        _check_needs(parts)
    return parts


def tree_of(component: object) -> dict[str, Any]:
    """Class and parameters of a component that somebody made, as a configuration would name them."""
    cls = type(component)
    known = parameter_types(cls) if dataclasses.is_dataclass(cls) else {}
    values = {name: getattr(component, name) for name in known}
    return {TARGET: f"{cls.__module__}.{cls.__qualname__}", **plain(values)}


@functools.cache
def nested_groups(cls: type) -> dict[str, str]:
    """Parameters that hold components (annotated P or dict[str, P]), and the group whose protocol P is."""
    found = {}
    for name, annotation in parameter_types(cls).items():
        held = get_args(annotation)[1] if get_origin(annotation) is dict else annotation
        package, _, module = getattr(held, "__module__", "").rpartition(".")
        if getattr(held, "_is_protocol", False) and module == "base":
            found[name] = package.removeprefix("uavexp.")
    return found


def component_class(group: str, target: str, path: str = "") -> type:
    """Class that a `_target_` names: defined in a trusted package, a built-in one in its group's."""
    path = path or group
    module_name, _, name = target.rpartition(".")
    asked = f"{path}.{TARGET}={target}"
    if target.startswith("uavexp.") and not module_name.startswith(f"uavexp.{group}."):
        raise ConfigError(f"{asked} is no option of {group}; name a class of uavexp.{group} or of your own")
    module = imported(module_name, asked)
    cls = getattr(module, name, None)
    # a class reached through a trusted module but made elsewhere (pathlib.Path) is a stranger's
    if not isinstance(cls, type) or not is_trusted(f"{cls.__module__}.{name}"):
        known = [item.__name__ for item in vars(module).values() if _is_made_in(item, module_name)]
        raise ConfigError(
            f"{asked}: {module_name} defines no class {name}{nearest(name, known)}; "
            f"it defines {', '.join(known) or 'none'}"
        )
    return cls


def _is_made_in(item: object, module_name: str) -> bool:
    return isinstance(item, type) and item.__module__ == module_name


def _checked_tree(group: str, tree: Any, path: str) -> dict[str, Any]:
    """A component's tree as plain data in its parameters' own types."""
    return {TARGET: tree[TARGET], **plain(_arguments(group, tree, path))}


def _arguments(group: str, tree: Mapping[str, Any], path: str) -> dict[str, Any]:
    """Constructor arguments in their annotated types; components inside are still trees."""
    cls = component_class(group, tree[TARGET], path)
    allowed = parameter_types(cls)
    given = {key: value for key, value in tree.items() if key != TARGET}
    for key in given:
        if key not in allowed:
            raise ConfigError(
                f"{path}.{key}: {cls.__name__} has no parameter '{key}'{nearest(key, allowed)}; "
                f"it has {', '.join(allowed) or 'none'}"
            )
    for key in required_parameters(cls):
        if key not in given:
            raise ConfigError(f"{path}.{key} must be given: type {path}.{key}=VALUE")
    nested = nested_groups(cls)
    return {
        key: _held_trees(nested[key], value, f"{path}.{key}")
        if key in nested
        else check_value(f"{path}.{key}", value, allowed[key])
        for key, value in given.items()
    }


def _held_trees(group: str, trees: Any, path: str) -> dict[str, Any]:
    """Checked tree of the component of a group that another one holds, or trees of several, by name."""
    if not isinstance(trees, Mapping):
        raise ConfigError(f"{path} must be one of {group}, or several by name, got {trees!r}")
    if TARGET in trees:
        return _checked_tree(group, trees, path)
    for name, tree in trees.items():
        if not isinstance(tree, Mapping) or TARGET not in tree:
            raise ConfigError(f"{path}.{name} must be a component of {group} with {TARGET}, got {tree!r}")
    return {str(name): _checked_tree(group, tree, f"{path}.{name}") for name, tree in trees.items()}


def _check_needs(parts: Parts) -> None:
    """Ask every part that needs something of the others, those inside it too."""
    others = {item.name: getattr(parts, item.name) for item in dataclasses.fields(parts)}
    for group in GROUPS:
        for path, part in _with_inner(group, others[group]):
            if isinstance(part, NeedsOthers):
                try:
                    part.requires(**others)
                except ConfigError as error:
                    raise _told(path, type(part), error) from error


def _with_inner(path: str, part: Any) -> Iterator[tuple[str, Any]]:
    """A component and those it holds, each with the path of its parameters."""
    yield path, part
    cls: type = type(part)
    for key in nested_groups(cls):
        held = getattr(part, key)
        for name, inner in held.items() if isinstance(held, dict) else (("", held),):
            yield from _with_inner(f"{path}.{key}.{name}".rstrip("."), inner)


def _told(path: str, cls: type, error: UavexpError) -> ConfigError:
    """What a component said of itself or of a parameter of its own, by its path."""
    about_parameter = str(error).split(" ")[0] in parameter_types(cls)
    return ConfigError(f"{path}{'.' if about_parameter else ': '}{error}")
