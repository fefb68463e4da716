"""The network of the learned trigger: numpy's forward pass by hand, its file, and what is refused."""

from __future__ import annotations

import pickle
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from uavexp.errors import ConfigError
from uavexp.network import Network, load_network
from uavexp.policy import FEATURES
from uavexp.trigger.learned import SHIPPED, Learned

SMALL = Network(
    mean=np.array([1.0, -2.0]), scale=np.array([2.0, 0.5]), hidden=np.array([[1.0, 2.0], [0.0, -1.0]]),
    hidden_bias=np.array([0.5, 0.0]), out=np.array([3.0, -1.0]), out_bias=np.array([0.25]),
)  # fmt: skip


def test_is_tanh_units_over_normalised_numbers() -> None:
    first, second = (
        np.tanh(1.0 * 1.0 + 2.0 * 2.0 + 0.5),
        np.tanh(-2.0),
    )  # of (3 - 1) / 2 = 1, (-1 + 2) / 0.5 = 2
    expected = 3.0 * first - second + 0.25
    assert SMALL.value(np.array([3.0, -1.0])) == pytest.approx(expected)
    np.testing.assert_allclose(SMALL.value(np.array([[3.0, -1.0]] * 2)), [expected] * 2)


def test_a_file_gives_back_what_was_saved(tmp_path: Path) -> None:
    SMALL.save(tmp_path / "small.npz")
    loaded = load_network(tmp_path / "small.npz", 2)
    for item in fields(Network):
        np.testing.assert_array_equal(getattr(loaded, item.name), getattr(SMALL, item.name))


def test_the_shipped_one_is_small_and_sees_what_a_policy_sees() -> None:
    assert SHIPPED.stat().st_size < 100_000
    assert load_network(SHIPPED, len(FEATURES)).hidden.shape[1] == len(FEATURES)


class _Runs:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return Path.touch, (Path("was_run"),)


@pytest.mark.parametrize("fault", ["absent", "no npz", "pickle", "part", "inputs", "nan", "shape"])
def test_what_is_no_network_is_told_in_one_line(
    tmp_path: Path, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "net.npz"
    parts = {item.name: getattr(SMALL, item.name) for item in fields(Network)}
    if fault == "no npz":
        file.write_text("weights")
    elif fault == "pickle":
        file.write_bytes(pickle.dumps(_Runs()))
    elif fault == "part":
        np.savez(file, mean=SMALL.mean)
    elif fault == "inputs":
        SMALL.save(file)
    elif fault == "nan":
        replace(SMALL, out=np.array([np.nan, 1.0])).save(file)
    elif fault == "shape":
        np.savez(file, **{**parts, "out": np.zeros(3)})
    with pytest.raises(ConfigError, match=r"net\.npz: (no|a) network") as error:
        load_network(file, 33 if fault == "inputs" else 2)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "was_run").exists()


def test_an_option_takes_a_file_of_ones_own(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="absent"):
        Learned(weights=str(tmp_path / "absent.npz"))
    own = replace(load_network(SHIPPED, len(FEATURES)), out_bias=np.array([1.0]))
    own.save(tmp_path / "own.npz")
    assert Learned(weights=str(tmp_path / "own.npz")).weights.endswith("own.npz")
