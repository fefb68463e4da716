"""Names of a user's axes and arms are text: they hide no measurement, close no page, calculate nothing."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pandas as pd
import pytest

from uavexp.cli.terminal import Terminal
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError
from uavexp.report import flight3d
from uavexp.report.results import Results
from uavexp.report.table_formats import to_csv
from uavexp.report.tables.base import Table
from uavexp.store.study import Study
from uavexp.store.table import REPLANS, TABLE, is_ours
from uavexp.sweep.agenda import agenda_of

EVIL = "<!--<script>"


@pytest.mark.parametrize(
    "axis", ["success", "outcome", "replans", "path_length_m", "status", "wall_trial_s", "p_step_s", "code"]
)
def test_an_axis_called_like_a_column_is_refused_before_the_first_flight(axis: str, tmp_path: Path) -> None:
    """Used to replace the measurement, or to end in a traceback after all trials had flown."""
    folder = tmp_path / "experiments" / "a"
    folder.mkdir(parents=True)
    (folder / "b.yaml").write_text(f"axes: {{{axis}: {{one: {{strategy: mcr}}, two: {{strategy: ssp}}}}}}")
    command = Composer(user_folder=tmp_path).command(parse_settings(["experiments=a/b"]))
    with pytest.raises(ConfigError, match=f"an axis may not be called {axis}"):
        agenda_of(command, tmp_path / "out", tmp_path)


@pytest.mark.parametrize("table", [TABLE, REPLANS])
def test_every_column_but_the_axes_is_ours(flown: Study, table: str) -> None:
    columns = pd.read_parquet(flown.folder / table).columns
    assert {column for column in columns if not is_ours(column)} == set(flown.axes)


def test_nothing_in_the_data_of_the_page_can_begin_an_element_or_a_comment(
    flown: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An arm `<!--<script>` killed the page: browsers read on in the comment."""
    monkeypatch.setattr(flight3d, "payload", lambda *given: {"name": EVIL})
    page = flight3d.section(Results(study=flown))
    begin = page.index('type="application/json"')
    data = page[page.index(">", begin) + 1 : page.index("</script>", begin)]
    assert "<" not in data
    assert "script" in data


def test_a_cell_that_a_spreadsheet_would_calculate_is_text() -> None:
    cells = ('=HYPERLINK("x")', "+cmd", "@sum", "-2+cmd|' /C calc'!A0")
    numbers = ("-0.3 [-0.5, -0.1]", "+1.09", "-1e-05", "-", "−0.3")
    text = to_csv(Table(name="t", title="t", columns=("a",), rows=tuple((c,) for c in (*cells, *numbers))))
    rows = [row[0] for row in csv.reader(io.StringIO(text))][1:]
    assert rows == [*("'" + cell for cell in cells), *numbers]


def test_what_is_printed_is_no_markup(capsys: pytest.CaptureFixture[str]) -> None:
    """An arm `[/b] 1` raised MarkupError on a terminal."""
    Terminal().say("[/b] 1 [red]2")
    assert capsys.readouterr().out == "[/b] 1 [red]2\n"
