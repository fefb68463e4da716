"""The report of every committed study is made again: the same numbers, sentences and verdicts."""

from __future__ import annotations

from pathlib import Path

import pytest

from uavexp.paths import experiments_folder
from uavexp.report.contents import Report
from uavexp.report.table_formats import to_csv
from uavexp.store.study import STUDY, read_study

STUDIES = sorted(file.parent for file in experiments_folder().glob(f"*/results/*/{STUDY}"))


def name_of(folder: Path) -> str:
    return f"{folder.parts[-3]}/{folder.name}"


@pytest.mark.parametrize("folder", STUDIES, ids=name_of)
def test_tables_and_claims_are_those_committed(folder: Path) -> None:
    report = Report(study=read_study(folder))
    texts = {f"tables/{table.name}.csv": to_csv(table) for table in (*report.tables, report.values)}
    if report.judgements:
        texts["claims.csv"] = to_csv(report.claims)
    committed = {str(file.relative_to(folder)): file.read_text() for file in folder.rglob("*.csv")}
    if not committed:
        pytest.skip("only figures are committed")
    assert texts.keys() == committed.keys()
    for name, text in texts.items():
        assert text == committed[name], name


@pytest.mark.parametrize("name", ["mcr/policies", "mcr/intervals"])
def test_policies_of_any_number_of_causes_are_drawn(name: str) -> None:
    """Used to end with KeyError: 'replans_other'."""
    paper, study = name.split("/")
    folder = experiments_folder() / paper / "results" / study
    drawn = {drawing.name for drawing in Report(study=read_study(folder)).drawings()}
    assert drawn == {file.stem for file in (folder / "figures").glob("*.png")}
