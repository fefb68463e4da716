"""What was typed means what it says: the grammar, grids and seeds of the command line."""

from __future__ import annotations

import math
import shlex

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavexp.config.overrides import PAPER_SEEDS, expand_grid, expand_seeds, flatten, parse_settings, render
from uavexp.errors import ConfigError


def seeds(text: str) -> tuple[int, ...]:
    (setting,) = parse_settings([f"seed={text}"])
    return expand_seeds(setting.values)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("3", (3,)),
        ("0", (0,)),
        ("0:20", tuple(range(20))),
        ("5:8", (5, 6, 7)),
        ("0:10:4", (0, 4, 8)),
        ("range(0,20)", tuple(range(20))),
        ("range(3)", (0, 1, 2)),
        ("range", tuple(PAPER_SEEDS)),
        ("1,4,7", (1, 4, 7)),
        ("[1,4,7]", (1, 4, 7)),
        ("0:3,7:9", (0, 1, 2, 7, 8)),
        ("'0:3'", (0, 1, 2)),
        ('"range(2,4)"', (2, 3)),
    ],
)
def test_every_way_of_typing_seeds(text: str, expected: tuple[int, ...]) -> None:
    assert seeds(text) == expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("3:3", "empty"),
        ("3:0", "empty"),
        ("range(3,0)", "empty"),
        ("0:5:0", "empty"),
        ("1,1", "seed 1 is given twice"),
        ("0:3,2:4", "seed 2 is given twice"),
        ("-1", "must be >= 0, got -1"),
        ("-3:2", "must be >= 0"),
        ("fast", "got 'fast'"),
        ("1.5", "got 1.5"),
        ("true", "got True"),
        ("null", "got None"),
        ("[]", "no seed given"),
        ("", "seed must be"),
        ("0:1000000000", "more than"),
    ],
)
def test_seeds_that_mean_nothing_are_refused(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        seeds(text)


@given(st.lists(st.integers(0, 10**6), min_size=1, max_size=30, unique=True))
def test_a_seed_list_keeps_its_members_and_order(numbers: list[int]) -> None:
    assert seeds(",".join(map(str, numbers))) == tuple(numbers)


def test_a_grid_is_every_combination_once_with_the_first_key_slowest() -> None:
    settings = parse_settings(["a=1,2", "b=x", "c=range(0,3)"])
    cells = [tuple(item.values[0] for item in cell) for cell in expand_grid(settings)]
    assert cells == [(a, "x", c) for a in (1, 2) for c in (0, 1, 2)]


def test_a_range_of_decimals_has_the_decimals_that_one_would_type() -> None:
    assert parse_settings(["a=range(0.05,0.35,0.05)"])[0].values == (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)


def test_experiment_is_understood_as_hydra_users_type_it() -> None:
    assert parse_settings(["experiment=mcr/table1"]) == parse_settings(["experiments=mcr/table1"])


def test_nothing_typed_is_one_cell() -> None:
    assert expand_grid([]) == [()]


def test_lists_are_values_and_commas_are_grids() -> None:
    (as_list,) = parse_settings(["world.size_m=[6,5,3]"])
    (as_grid,) = parse_settings(["world.size_m=6,5,3"])
    assert as_list.values == ([6, 5, 3],)
    assert as_grid.values == (6, 5, 3)


def test_a_dictionary_is_the_settings_of_its_leaves() -> None:
    assert parse_settings(["world={size_m:[6,5,3],gap_m:1}"]) == parse_settings(
        ["world.size_m=[6,5,3]", "world.gap_m=1"]
    )
    assert [item.key for item in flatten("a", {"b": {"c": 1, "d": 2}})] == ["a.b.c", "a.b.d"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("strategy", "KEY=VALUE"),
        ("", "KEY=VALUE"),
        ("=3", "KEY=VALUE"),
        ("~trigger", "nothing can be removed"),
        ("trigger@other=mcr", "type trigger=OPTION"),
        ("a=range(3,0)", "the range is empty"),
        ("a=range(0,1,0)", "must not be 0"),
        ("a=range(0,1,nan)", "finite|cannot read"),
        ("a=interval(0,1)", "cannot be enumerated"),
        ("a=glob(*)", "cannot be enumerated"),
        ("a=shuffle(1,2)", "shuffling"),
        ("a=range(0,1e9)", "more than"),
        ("hydra.run.dir=x", "no effect"),
        ("hydra/launcher=joblib", "no effect"),
        ("hydra.searchpath=[pkg://os]", "no effect"),
        ("+hydra.callbacks.x._target_=os.system", "no effect"),
        ("++hydra.job_logging.handlers.x={(): os.system}", "no effect|quote"),
    ],
)
def test_overrides_without_meaning_are_refused(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        parse_settings([text])


def test_a_key_is_given_once() -> None:
    with pytest.raises(ConfigError, match="strategy is given twice"):
        parse_settings(["strategy=mcr", "seed=0", "strategy=tbr"])


@pytest.mark.parametrize(
    "path", ["/data/hall (2).ply", "büro.ply", "a#b.ply", "a=b.ply", "~/x.ply", "it's.ply"]
)
def test_the_quoted_form_that_an_error_prints_works_when_typed(path: str) -> None:
    with pytest.raises(ConfigError) as error:
        parse_settings([f"world.path={path}"])
    (typed,) = shlex.split(str(error.value).partition("quote the value, ")[2])
    (setting,) = parse_settings([typed])
    assert setting.values == (path,)


values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**9), 10**9)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=12),
    lambda inner: st.lists(inner, max_size=4),
    max_leaves=8,
)


@given(values)
def test_a_rendered_value_parses_back_to_itself(value: object) -> None:
    (typed,) = shlex.split(shlex.join([f"key={render(value)}"]))
    (setting,) = parse_settings([typed])
    assert setting.values == (value,)
    assert type(setting.values[0]) is type(value)


@given(st.floats())
def test_a_rendered_number_parses_back_to_the_same_bits(value: float) -> None:
    (setting,) = parse_settings([f"key={render(value)}"])
    assert math.isnan(setting.values[0]) if math.isnan(value) else setting.values == (value,)
