"""Experiments: what a file means, what may be typed beside it, and that every shipped one composes."""

from __future__ import annotations

from pathlib import Path

import pytest

from uavexp.config.composition import Composer
from uavexp.config.experiment import expand, list_experiments, read_experiment
from uavexp.config.overrides import parse_settings, render
from uavexp.errors import ConfigError
from uavexp.store.table import is_ours

SHIPPED = list_experiments()
COMPOSER = Composer()
TEXT = """
title: Two ways
tables: [by_metric]
seed: "0:3"
fixed: {latency_s: 0.05}
axes:
  arm:
    clock: {strategy: tbr, trigger.interval_s: "1,2"}
    map: {strategy: mcr}
  scene:
    small: {world: rooms, world.size_m: [8, 6, 2.6]}
    halls: {world: warehouse}
"""


@pytest.fixture
def composer(tmp_path: Path) -> Composer:
    folder = tmp_path / "experiments" / "own"
    folder.mkdir(parents=True)
    (folder / "two.yaml").write_text(TEXT)
    return Composer(user_folder=tmp_path)


def cells(composer: Composer, *typed: str) -> list[tuple[dict[str, str], dict[str, object]]]:
    command = composer.command(parse_settings(["experiments=own/two", *typed]))
    return [(cell.labels, cell.config) for cell in command.cells]


def test_every_combination_is_a_cell_with_its_place_on_every_axis(composer: Composer) -> None:
    command = composer.command(parse_settings(["experiments=own/two"]))
    assert command.seeds == (0, 1, 2)
    assert command.axes == {
        "arm": ("clock", "map"),
        "scene": ("small", "halls"),
        "setting": ("interval_s=1", "interval_s=2", ""),
    }
    assert [tuple(cell.labels.values()) for cell in command.cells] == [
        ("clock", "small", "interval_s=1"),
        ("clock", "small", "interval_s=2"),
        ("clock", "halls", "interval_s=1"),
        ("clock", "halls", "interval_s=2"),
        ("map", "small", ""),
        ("map", "halls", ""),
    ]
    assert [cell.config["trigger"].get("interval_s") for cell in command.cells][:4] == [1.0, 2.0, 1.0, 2.0]
    assert {cell.config["latency_s"] for cell in command.cells} == {0.05}
    assert command.cells[0].config["world"]["size_m"] == [8.0, 6.0, 2.6]


def test_what_is_typed_replaces_where_it_is_set_and_else_holds_everywhere(composer: Composer) -> None:
    replaced = cells(composer, "trigger.interval_s=3", "pilot.settle_s=0.7", "latency_s=0.01")
    assert [config["trigger"].get("interval_s") for _, config in replaced] == [3.0, 3.0, None, None]
    assert {config["pilot"]["settle_s"] for _, config in replaced} == {0.7}
    assert {config["latency_s"] for _, config in replaced} == {0.01}
    assert all("setting" not in labels for labels, _ in replaced)  # nothing is swept any more


def test_an_axis_picks_entries_in_the_files_order(composer: Composer) -> None:
    assert [labels["arm"] for labels, _ in cells(composer, "arm=map,clock", "scene=halls")] == [
        "clock",
        "clock",
        "map",
    ]


def test_a_swept_key_is_an_entry_for_each_value(tmp_path: Path) -> None:
    folder = tmp_path / "experiments" / "own"
    folder.mkdir(parents=True)
    scene = "{rooms: {world: rooms}, world.size_m: '[30.0,12.0,3.0],[20.0,12.0,3.0]', step_s: 'range(1,3)'}"
    (folder / "two.yaml").write_text(f"axes: {{arm: {{a: {{strategy: tbr}}}}, scene: {scene}}}")
    labelled, axes = expand(read_experiment("own/two", folder / "two.yaml"), [])
    assert axes["scene"] == ["rooms", "[30.0,12.0,3.0]", "[20.0,12.0,3.0]", "1", "2"]
    assert [cell.settings[-1].values for cell in labelled[1:]] == [
        ([30.0, 12.0, 3.0],),
        ([20.0, 12.0, 3.0],),
        (1,),
        (2,),
    ]
    assert all(set(cell.labels) == {"arm", "scene"} for cell in labelled)


def test_seeds_typed_win(composer: Composer) -> None:
    assert composer.command(parse_settings(["experiments=own/two", "seed=7"])).seeds == (7,)


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (["arm=mop"], ["arm=mop: no such entry", "did you mean 'map'?"]),
        (["trigger.interval_s=3,3.0"], ["the same configuration twice"]),
        (["runner.n_jobs=1,2"], ["runner.n_jobs must have one value"]),
        (["sensor.rate_hz=30"], ["sensor.rate_hz"]),
        (["experiments=own/tow"], ["given twice"]),
    ],
)
def test_mistakes_are_told(composer: Composer, typed: list[str], words: list[str]) -> None:
    with pytest.raises(ConfigError) as told:
        cells(composer, *typed)
    assert all(word in str(told.value) for word in words)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("axes: {arm: {a: {strategy: mcr}}}\nseeed: '0'", ["unknown part 'seeed'", "did you mean 'seed'?"]),
        ("axes: {arm: {a: {strategy: mcr}}}\nseed: 1:20", ["quote the seeds"]),
        ("title: nothing", ["needs axes"]),
        ("axes: {arm: {}}", ["axis arm needs entries"]),
        ("axes: {arm: {a: mcr}}", ["must be a mapping"]),
        ("axes: {arm: {a: {out: x}}}", ["out has its own place"]),
        ("axes: {arm: {a: {strategy: 'mcr,,'}}}", ["cannot read"]),
        ("axes: [", ["cannot be read"]),
        ("axes: {arm: {a: {strategy: mcr}, a: {strategy: tbr}}}", ["cannot be read", "duplicate key a"]),
        ("axes: {arm: {a: {strategy: mcr}}, arm: {b: {strategy: tbr}}}", ["duplicate key arm"]),
        (
            "axes: {arm: {MCR: {strategy: mcr}}}\nsettings: {primary: MRC}",
            ["settings.primary=MRC: no such arm (did you mean 'MCR'?)"],
        ),
    ],
)
def test_a_bad_file_is_told(tmp_path: Path, text: str, words: list[str]) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as told:
        read_experiment("own/bad", file)
    assert all(word in str(told.value) for word in words)


def test_an_axis_may_be_borrowed(tmp_path: Path) -> None:
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "two.yaml").write_text(TEXT)
    (folder / "more.yaml").write_text("axes: {arm: {a: {strategy: ssp}}, scene: own/two}")
    (folder / "none.yaml").write_text("axes: {arm: {a: {strategy: ssp}}, place: own/two}")
    (folder / "self.yaml").write_text("axes: {arm: own/self}")
    two, more = (read_experiment(f"own/{name}", folder / f"{name}.yaml") for name in ("two", "more"))
    assert more.axes["scene"] == two.axes["scene"]
    for name in ("none", "self"):
        with pytest.raises(ConfigError, match="has no axis"):
            read_experiment(f"own/{name}", folder / f"{name}.yaml")


def test_a_strangers_experiment_runs_no_code(tmp_path: Path) -> None:
    folder = tmp_path / "experiments" / "own"
    folder.mkdir(parents=True)
    (folder / "bad.yaml").write_text("axes: {arm: {a: {planner._target_: os.system}}}")
    with pytest.raises(ConfigError, match="is refused"):
        Composer(user_folder=tmp_path).command(parse_settings(["experiments=own/bad"]))
    (folder / "bad.yaml").write_text("axes: !!python/object/apply:os.system ['true']")
    with pytest.raises(ConfigError, match="cannot be read"):
        Composer(user_folder=tmp_path).command(parse_settings(["experiments=own/bad"]))


def test_an_axis_may_not_hide_a_key(tmp_path: Path) -> None:
    folder = tmp_path / "experiments" / "own"
    folder.mkdir(parents=True)
    (folder / "bad.yaml").write_text("axes: {world: {a: {strategy: mcr}}}")
    with pytest.raises(ConfigError, match="may not be called like the key world"):
        Composer(user_folder=tmp_path).command(parse_settings(["experiments=own/bad"]))


def test_a_report_is_a_list_or_that_of_another_experiment(tmp_path: Path) -> None:
    folder = tmp_path / "experiments" / "own"
    folder.mkdir(parents=True)
    axes = "axes: {arm: {a: {strategy: mcr}}}"
    (folder / "one.yaml").write_text(f"tables: [by_arm]\n{axes}")
    (folder / "two.yaml").write_text(f"tables: own/one\nfigures: [success]\n{axes}")
    assert read_experiment("own/two", folder / "two.yaml").report == {
        "tables": ["by_arm"],
        "figures": ["success"],
    }
    (folder / "shipped.yaml").write_text(f"figures: mcr/table1\n{axes}")
    assert "attribution" in str(read_experiment("own/shipped", folder / "shipped.yaml").report["figures"])
    (folder / "bad.yaml").write_text(f"claims: {{says: this}}\n{axes}")
    with pytest.raises(ConfigError, match="claims must be a list"):
        read_experiment("own/bad", folder / "bad.yaml")


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_every_shipped_experiment_has_cells_and_paired_arms(name: str) -> None:
    labelled, axes = expand(read_experiment(name, SHIPPED[name]), [])
    assert len(labelled) > 1
    assert len({tuple(cell.labels.values()) for cell in labelled}) == len(labelled)
    assert all(set(cell.labels) == set(axes) for cell in labelled)


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_every_arm_of_every_shipped_experiment_can_be_flown(name: str) -> None:
    """Two could not: an axis was called like a column of the trials, a strategy set what an arm lacks."""
    axes = read_experiment(name, SHIPPED[name]).axes
    assert not [axis for axis in axes if is_ours(axis)], "columns of trials.parquet"
    arms = "arm" if "arm" in axes else next(iter(axes))
    chosen = [f"{axis}={render(next(iter(axes[axis])))}" for axis in axes if axis != arms]
    try:
        command = COMPOSER.command(parse_settings([f"experiments={name}", "seed=0", *chosen]))
    except ConfigError as error:
        if "cannot be read" not in str(error):
            raise
        pytest.skip("its buildings are not part of this repository")
    assert command.cells


def test_a_shipped_experiment_is_not_replaced_in_silence(tmp_path: Path) -> None:
    (tmp_path / "experiments" / "mcr").mkdir(parents=True)
    (tmp_path / "experiments" / "mcr" / "table1.yaml").write_text(TEXT)
    with pytest.raises(ConfigError, match="experiments=mcr/table1 exists already"):
        Composer(user_folder=tmp_path)
