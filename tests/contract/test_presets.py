"""Every key that a strategy's file sets is set in the flights that it names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pytest
import yaml

from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.paths import conf_folder

PRESETS = sorted(path.stem for path in (conf_folder() / "strategy").glob("*.yaml"))


def leaves(tree: Mapping[str, Any], above: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from leaves(value, (*above, key))
        else:
            yield (*above, key), value


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_has_the_last_word_on_what_it_sets(name: str) -> None:
    preset = yaml.safe_load((conf_folder() / "strategy" / f"{name}.yaml").read_text()) or {}
    preset.pop("defaults", None)
    (cell,) = Composer().command(parse_settings([f"strategy={name}"])).cells
    for path, value in leaves(preset):
        found: Any = cell.config
        for key in path:
            found = found[key]
        assert found == value, ".".join(path)


def test_what_is_typed_beats_the_preset() -> None:
    (cell,) = Composer().command(parse_settings(["strategy=risk", "pilot.turn_first_rad=1.5"])).cells
    assert cell.config["pilot"]["turn_first_rad"] == 1.5
