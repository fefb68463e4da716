"""A configuration from a stranger must not run code."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavexp.config.build import build_component
from uavexp.config.trust import VARIABLE, check_trust, is_trusted
from uavexp.errors import ConfigError


@pytest.fixture(autouse=True)
def nobody_else_is_trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)


@pytest.mark.parametrize(
    "target",
    [
        "os.system",
        "uavexp",  # the package is nothing to call
        "uavexp_evil.Planner",  # a name that only begins alike
        "uavexp.",
        "uavexp..os.system",
        " uavexp.planner.x.Y",
        "uavexp.planner.x.Y ",
        "uavexp.planner.x.Y\n",
        "${oc.env:HOME}",
        "uavexp.${x}",
        "uavexp.planner-x.Y",
        "uavexp.планировщик.Y",
        "",
        None,
        3,
        ["uavexp.planner.x.Y"],
        {"_target_": "uavexp.planner.x.Y"},
    ],
)
@pytest.mark.parametrize("key", ["_target_", "()"])
def test_everything_but_a_dotted_name_inside_a_trusted_package_is_refused(key: str, target: object) -> None:
    with pytest.raises(ConfigError, match="refused"):
        check_trust({"planner": {key: target}})


def wrap(inner: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    around = st.lists(st.integers(), max_size=2)
    return st.one_of(
        st.tuples(st.text(max_size=5), inner).map(lambda pair: {pair[0]: pair[1]}),
        st.tuples(around, inner, around).map(lambda parts: [*parts[0], parts[1], *parts[2]]),
    )


@given(st.recursive(st.just({"_target_": "os.system", "args": [1]}), wrap, max_leaves=6))
def test_a_call_is_found_however_deep_in_dicts_and_lists(tree: object) -> None:
    with pytest.raises(ConfigError, match=r"os\.system"):
        check_trust(tree)


def test_own_classes_pass() -> None:
    check_trust({"planner": {"_target_": "uavexp.planner.min_acc.MinAcc", "notes": ["_target_", "()"]}})


def test_named_packages_pass_and_only_those(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "mine, your.part:theirs")
    assert all(map(is_trusted, ("mine.Planner", "your.part.Planner", "theirs.a.B", "uavexp.a.B")))
    assert not any(map(is_trusted, ("minefield.Planner", "your.Planner", "os.system", ".a", "a")))


def test_an_empty_variable_trusts_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, " , :")
    assert not is_trusted("os.system")
    assert not is_trusted(".system")


@pytest.mark.parametrize(
    "target",
    [
        "uavexp.config.trust.os.system",  # a stranger's function reached through our module
        "uavexp.config.trust.check_trust",  # ours, but no class
        "uavexp.safety.none.Limits",  # ours, a class, defined elsewhere than the group
        "uavexp.store.records.Path",
        "uavexp.config.build.importlib",
        "uavexp.estimator.perfect.Perfect",  # a component of another role
        "uavexp.safety.none.Missing",
        "uavexp.safety.missing.Missing",
    ],
)
def test_only_a_class_of_the_group_is_ever_called(target: str) -> None:
    with pytest.raises(ConfigError):
        build_component("safety", {"_target_": target})
