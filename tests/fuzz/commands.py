"""Command lines as nobody would type them: composed to something whole, or refused in one line."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

from uavexp.config.composition import CommandLine, Composer
from uavexp.config.options import RUNNER_GROUP, read_option
from uavexp.config.overrides import parse_settings
from uavexp.errors import UavexpError, one_line

_VALUES = (
    "0", "-1", "1", "0.5", "1e-300", "1e300", "-1e-5", "1e9", "inf", "nan", "null", "true", "abc", "''", "[]",
    "[1,2]", "[0,0,0]", "[1e-9,1e9]", "{}", "{a:1}", "99999999999999999999", "9" * 500, "é", "'a b'", "'\t'",
    "1,2", "range(0,3)", "range(0,1e9)", "glob(*)", "${step_s}", "${oc.env:HOME}", "???", "a" * 400, "~x",
    "'../../x'", "os.system", "[[[[1]]]]", "5:1", "1e", "0x10", "$(id)", "\\", "'", '"', "a\nb", "\0",
)  # fmt: skip
_FACTORS = (0.0, 1e-6, 0.01, 0.1, 0.5, 0.9, 1.1, 2.0, 10.0, 100.0, 1e6)
_USUAL = (0.0, 0.1, 0.5, 0.9, 1.1, 2.0, 10.0)
_KEYS = ("seed", "out", "experiments", "metrics", "strategy", "world_seed", "hydra.run.dir", "x", "step_s")


def whole(text: str) -> CommandLine | None:
    """Compose a command's words, separated by lines; None when they are refused."""
    try:
        return Composer().command(parse_settings(text.split("\n")))
    except UavexpError:
        return None


def drawn(composer: Composer, chance: random.Random, *, wild: bool = True) -> list[str]:
    """The words of a command: an option or two, parameters of them, values of every kind.

    Args:
        composer: knows what there is.
        chance: draws.
        wild: whether values may be any; else numbers are up to ten times larger or smaller than usual.
    """
    options = {group: list(files) for group, files in composer.options.items() if group != RUNNER_GROUP}
    words = []
    chosen = {}
    for group in chance.sample(sorted(options), chance.choice((0, 0, 1, 1, 2))):
        chosen[group] = chance.choice(options[group])
        words.append(f"{group}={chosen[group]}")
    for _ in range(chance.choice((0, 1, 1, 2, 3))):
        words.append(_setting(composer, chosen, chance) if wild else _usual(composer, chosen, chance))
    return words


def _setting(composer: Composer, chosen: dict[str, str], chance: random.Random) -> str:
    if chance.random() < 0.15:
        return f"{chance.choice(('', '+', '++', '~'))}{chance.choice(_KEYS)}={chance.choice(_VALUES)}"
    group = chance.choice(sorted(chosen or composer.options))
    option = chosen.get(group) or chance.choice(list(composer.options[group]))
    parameters = read_option(composer.options[group][option]).parameters
    if not parameters:
        return f"{group}={chance.choice(_VALUES)}"
    parameter = chance.choice(parameters)
    return f"{group}.{parameter.name}={_value(parameter.default, chance)}"


def _usual(composer: Composer, chosen: dict[str, str], chance: random.Random) -> str:
    groups = sorted(group for group in composer.options if "." not in group and group != RUNNER_GROUP)
    while True:
        group = chance.choice(sorted(chosen) or groups)
        files = composer.options[group]
        parameters = read_option(files[chosen.get(group) or chance.choice(list(files))]).parameters
        numbers = [item for item in parameters if _is_number(item.default)]
        if not numbers and chosen:
            return "step_s=0.01"
        if numbers:
            item = chance.choice(numbers)
            scaled = float(item.default) * chance.choice(_USUAL)
            return f"{group}.{item.name}={round(scaled) if item.default.isdigit() else repr(scaled)}"


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _value(default: str, chance: random.Random) -> str:
    """A value near the default one, or any."""
    try:
        number = float(default)
    except ValueError:
        return chance.choice(_VALUES)
    if chance.random() < 0.3:
        return chance.choice(_VALUES)
    scaled = number * chance.choice(_FACTORS)
    return str(int(scaled)) if default.lstrip("-").isdigit() and chance.random() < 0.7 else repr(scaled)


def faults_of(composer: Composer, words: Sequence[str]) -> tuple[CommandLine | None, list[str]]:
    """Compose a command; what came out, and what ended as nothing may end."""
    try:
        return composer.command(parse_settings(words)), []
    except UavexpError as error:
        told = one_line(error)
        return None, [f"{words}: {len(told)} characters"] if not 0 < len(told) < 2000 else []
    except Exception as error:
        return None, [f"{words}: {type(error).__name__}: {error}"]
