"""A metric of one's own gets a column without a change to the package, from trusted modules only."""

from __future__ import annotations

from pathlib import Path

import pytest

from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.config.own_metrics import modules_of, own_metrics
from uavexp.config.trust import VARIABLE
from uavexp.errors import ConfigError
from uavexp.report.labels import metrics_of

TURNING = """
from uavexp.metrics.metric import Metric

METRICS = {
    Metric(column="rows", title="Rows", better=-1): lambda flight: len(flight.log.steps.time_s),
}
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    folder = tmp_path / "package_of_ones_own"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "turning.py").write_text(TURNING)
    (folder / "taken.py").write_text(TURNING.replace('"rows"', '"replans"'))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv(VARIABLE, folder.name)
    return folder.name


def test_its_metrics_are_found_by_flights_and_by_reports(package: str) -> None:
    cell = Composer().command(parse_settings([f"metrics={package}.turning", "seed=0"])).cells[0]
    assert cell.metrics == (f"{package}.turning",)
    assert "metrics" not in cell.config  # the same trial, whatever is measured of it
    (metric,) = own_metrics(cell.metrics)
    assert metrics_of(["replans", f"{package}.turning.rows"])[1] == metric
    with pytest.raises(ConfigError, match=r"no such metric: .*turning\.row \(did you mean"):
        metrics_of([f"{package}.turning.row"])


def test_none_one_or_several_modules(package: str) -> None:
    assert modules_of(None) == ()
    assert modules_of([f"{package}.turning"]) == modules_of(f"{package}.turning") == (f"{package}.turning",)


@pytest.mark.parametrize(
    ("module", "says"),
    [
        ("os.path", "is refused"),
        ("package_of_ones_own_and_more.turning", "is refused"),
        ("package_of_ones_own.absent", "there is no module"),
        ("package_of_ones_own", "declares no METRICS"),
        ("package_of_ones_own.taken", "the column replans is taken"),
    ],
)
def test_what_cannot_be_used_is_refused(package: str, module: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        own_metrics([module])
