"""What README and site print of the results is what the committed results hold."""

from __future__ import annotations

import csv
import importlib.util
import re
from types import ModuleType

import pytest

from tests.folders import ROOT
from uavexp.errors import ConfigError

LABEL = "Success rate, SR [%]"


@pytest.fixture(scope="module")
def pages() -> ModuleType:
    spec = importlib.util.spec_from_file_location("site_pages", ROOT / "docs" / "pages.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_no_table_and_no_number_of_a_page_is_stale(
    pages: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    assert pages.main(["--check"]) == 0, capsys.readouterr().out


def test_no_number_begins_a_line_as_a_comment_there_ends_a_paragraph(pages: ModuleType) -> None:
    for page in pages.pages():
        assert not re.findall(r"(?m)^\s*<!-- (?:number|paired): .*", page.read_text(encoding="utf-8")), page


def replans_of(arm: str) -> str:
    with (ROOT / "experiments/mcr/results/table1/tables/values.csv").open(encoding="utf-8") as text:
        means = {(row["metric"], row["arm"]): float(row["mean"]) for row in csv.DictReader(text)}
    return f"{means['replans', arm]:.1f}"


def test_the_readme_shows_what_the_committed_study_measured() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = re.search(r"^\| replans \|(.*)$", readme, re.M)
    assert shown is not None
    assert re.findall(r"([\d.]+) \[", shown[1]) == [
        replans_of(arm) for arm in ("SSP", "TBR", "TBR frequent", "MCR")
    ]


def test_a_paired_difference_stands_in_a_sentence_with_its_corrected_p(pages: ModuleType) -> None:
    with (ROOT / "experiments/mcr/results/table1/tables/paired_tests.csv").open(encoding="utf-8") as text:
        rows = {(row["first"], row["second"]): row for row in csv.DictReader(text) if row["metric"] == LABEL}
    for second in ("TBR", "SSP"):
        row = rows["MCR", second]
        told = pages.with_results(f"<!-- paired: mcr/table1 success MCR - {second} -->?<!-- end -->")
        assert row["first − second [95 %]"].replace("-", "−") in told
        assert re.search(r", p (= |< )" + re.escape(row["p, Holm"].strip("<")) + "<!", told)


def test_what_is_typed_over_a_number_is_put_right(pages: ModuleType) -> None:
    right = f"MCR: <!-- number: mcr/table1 replans MCR -->{replans_of('MCR')}<!-- end --> replans"
    assert pages.with_results(right) == right
    assert pages.with_results(right.replace(f">{replans_of('MCR')}<", ">99.9<")) == right


@pytest.mark.parametrize(
    ("mark", "told"),
    [
        ("<!-- number: mcr/table1 replan MCR -->1<!-- end -->", "no replan of MCR; there are"),
        ("<!-- number: mcr/table1 replans mcr -->1<!-- end -->", "no replans of mcr; there are"),
        (
            "<!-- paired: mcr/table1 success TBR - TBR -->1<!-- end -->",
            "no success of TBR - TBR; there are MCR",
        ),
        ("<!-- number: mcr/nothing replans MCR -->1<!-- end -->", "No such file"),
        ("<!-- table: mcr/table1\nmetric: {replans: replans}\n-->\n<!-- end -->", "no such key: metric"),
        ("<!-- table: mcr/table1/table1 -->", "has no <!-- end -->"),
    ],
)
def test_a_mark_that_asks_for_what_is_not_there_is_told(pages: ModuleType, mark: str, told: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(told)):
        pages.with_results(mark)
