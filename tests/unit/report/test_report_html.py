"""`report.html`: one whole file, nothing fetched, every number and link that it shows is true."""

from __future__ import annotations

import base64
import gzip
import json
import shutil
import subprocess
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest

from tests.studies import copy_of, made_up
from uavexp.metrics import replanning
from uavexp.report import flight3d, html
from uavexp.report.abbreviations import ABBREVIATIONS
from uavexp.report.contents import Judgement, Report
from uavexp.report.figures.base import png_of
from uavexp.report.html_failed import MOST_FAILED
from uavexp.report.judges import Verdict
from uavexp.report.tables.base import Table
from uavexp.store.study import TRIALS, read_wall

TABLE = Table(name="t", title="A <table>", columns=("", "x & y"), rows=(("one", "1 < 2"),), notes=("n = 1",))
CLAIMS = tuple(
    Judgement(statement=f"it is {verdict}", source="§4", verdict=verdict, evidence='"5 > 4"')
    for verdict in Verdict
)
VOID = {"meta", "img", "input", "br", "link"}


class Page(HTMLParser):
    """A page taken apart; refuses tags that do not close in order."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.stack: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, str] = {}  # content of elements with an id
        self.words = ""
        self._ids: list[str] = []
        self.feed(text)
        self.close()
        assert not self.stack

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.stack.append(tag)
            self._ids.append(dict(attrs).get("id") or "")

    def handle_endtag(self, tag):
        assert self.stack.pop() == tag, tag
        self._ids.pop()

    def handle_data(self, data):
        if self._ids and self._ids[-1]:
            self.texts[self._ids[-1]] = self.texts.get(self._ids[-1], "") + data
        if self.stack and self.stack[-1] not in ("script", "style"):
            self.words += data

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


def written(study, drawings=()) -> str:
    path, report = study.folder / "report.html", Report(study=study)
    report.__dict__.update(tables=(TABLE,), judgements=CLAIMS)  # in place of those of the study
    html.write_html(report, drawings, path)
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def drawn(flown, tmp_path_factory):
    folder = tmp_path_factory.mktemp("figures")
    pairs = []
    for drawing in Report(study=flown).drawings():
        path = folder / f"{drawing.name}.png"
        path.write_bytes(png_of(drawing.figure, dpi=40))
        pairs.append((drawing, path))
    return pairs


@pytest.fixture(scope="module")
def page(flown, drawn):
    return Page(written(flown, drawn))


class TestOneFile:
    def test_nothing_is_fetched(self, page):
        for tag, attributes in page.tags:
            address = attributes.get("src") or attributes.get("href") or ""
            if tag == "a" and address.startswith("https://doi.org/"):
                continue  # followed by a click alone
            assert address.startswith(("data:", "#", f"{TRIALS}/", "figures/")) or not address, (tag, address)
            assert tag not in ("iframe", "object")

    def test_every_figure_is_in_it_with_its_caption(self, page, drawn):
        images = [image["src"] for image in page.all("img") if image["src"].startswith("data:")]
        assert len(images) == len(drawn) > 0
        for source, (drawing, path) in zip(images, drawn, strict=True):
            assert base64.b64decode(source.removeprefix("data:image/png;base64,")) == path.read_bytes()
            assert drawing.caption in page.words

    def test_the_same_study_gives_the_same_bytes(self, flown, drawn):
        assert written(flown, drawn) == written(flown, drawn)

    def test_links_within_the_page_lead_somewhere(self, page):
        ids = {attributes.get("id") for _, attributes in page.tags}
        for link in page.all("a"):
            assert not link["href"].startswith("#") or link["href"][1:] in ids

    def test_ids_are_unique(self, page):
        ids = [attributes["id"] for _, attributes in page.tags if attributes.get("id")]
        assert len(ids) == len(set(ids))

    def test_what_looks_like_markup_is_shown_not_obeyed(self, flown, tmp_path):
        study = copy_of(flown, tmp_path / "hostile", title="</title><script>alert(1)</script>")
        text = written(study)
        assert "alert(1)</script>" not in text
        page = Page(text)
        for shown in ("A <table>", "x & y", "1 < 2", '"5 > 4"'):
            assert shown in page.words

    def test_verdicts_are_counted_and_told_by_more_than_colour(self, page):
        assert "1 reproduced, 1 contradicted, 1 not shown, 1 not testable" in page.words
        for mark in ("✓ reproduced", "✗ contradicted", "? not shown", "– not testable"):
            assert mark in page.words

    def test_the_verdict_stands_first_then_what_was_flown(self, page, flown):
        order = ("Claims of the paper:", "Success in %", "Date", "Machine")
        told = [page.words.index(word) for word in order]
        assert told == sorted(told)
        assert told[-1] < page.words.index("A <table>")
        assert "10.3390/drones10030168" in page.words
        assert flown.measurements["code"].iloc[0] in page.words

    def test_abbreviations_of_the_page_are_spelled_out_and_no_others(self, page):
        assert ABBREVIATIONS["SSP"] in page.words
        assert ABBREVIATIONS["BARN"] not in page.words

    def test_the_command_is_told_without_where_it_wrote_to(self, flown, tmp_path):
        study = copy_of(flown, tmp_path / "run")
        runs = {
            "runs": [{"command": ["experiments=mcr/table1", "out=/home/me", "runner.n_jobs=3", "arm=A B"]}]
        }
        (study.folder / "run.json").write_text(json.dumps(runs))
        text = written(study)
        assert "python -m uavexp experiments=mcr/table1 &#x27;arm=A B&#x27;" in text
        assert "/home/me" not in text


class TestFailedTrials:
    def rows(self, page):
        return [link["href"] for link in page.all("a") if link["href"].startswith(TRIALS)]

    def test_each_leads_to_its_picture_and_tells_the_command_that_repeats_it(self, flown, tmp_path):
        study = copy_of(flown, tmp_path / "linked")
        failed = study.trials[~study.trials["success"]]["trial"]
        assert len(failed)
        for trial in failed:
            (study.folder / TRIALS / trial / "picture.png").touch()
        page = Page(written(study))
        assert self.rows(page) == [f"{TRIALS}/{trial}/picture.png" for trial in failed]
        for trial in failed:
            assert (study.folder / TRIALS / trial / "picture.png").is_file()
            command = read_wall(study.folder / TRIALS / trial).get("command")
            assert command is None or command in page.words

    def test_without_a_stored_picture_there_is_no_link_but_the_command_that_makes_it(self, flown, tmp_path):
        study = copy_of(flown, tmp_path / "packed")
        for picture in (study.folder / TRIALS).glob("*/picture.png"):
            picture.unlink()
        page = Page(written(study))
        assert self.rows(page) == []
        failed = study.trials[~study.trials["success"]]
        assert "Where no picture is kept, the command makes it." in page.words
        assert page.words.count("not kept") == len(failed) > 0
        for command in failed["wall_command"]:
            assert command in page.words

    def test_ways_of_ending_are_counted(self, tmp_path):
        rows = pd.DataFrame({"seed": range(4), "cell": "MCR", "status": ["ok", "ok", "ok", "killed"]})
        rows["success"] = [True, False, False, False]
        rows["outcome"] = ["reached", "reached", "stuck", "error"]
        rows["trial"] = [f"t{number}" for number in range(4)]
        rows["strategy"] = rows["world"] = "x"
        words = Page(written(made_up(tmp_path, rows, {"cell": ("MCR",)}))).words
        table = words[words.index("reached after contact") :]
        assert table.index("killed") > 0
        assert "3 of 4" in table

    def test_trials_that_succeeded_are_not_listed(self, flown, page):
        won = set(flown.trials[flown.trials["success"]]["trial"])
        assert not won & {href.split("/")[1] for href in self.rows(page)}

    def test_a_trial_that_was_killed_says_so(self, tmp_path):
        rows = {"strategy": "mcr", "world": "w", "seed": 0, "outcome": "error", "success": False}
        row = rows | {"status": "killed", "reason": "by signal 9", "trial": "t", "cell": "MCR"}
        study = made_up(tmp_path, pd.DataFrame([row]), {"cell": ("MCR",)})
        page = Page(written(study))
        assert "killed (by signal 9)" in page.words
        assert "1 of 1 trials" in page.words

    def test_a_long_list_is_capped_and_says_where_the_rest_is(self, tmp_path):
        n = MOST_FAILED + 7
        rows = pd.DataFrame(
            {"seed": range(n), "success": False, "cell": "MCR", "status": "ok", "outcome": "stuck"}
        )
        rows["trial"] = [f"t{number}" for number in range(n)]
        rows["strategy"] = rows["world"] = "x"
        page = Page(written(made_up(tmp_path, rows, {"cell": ("MCR",)})))
        assert "7 more are in trials.parquet" in page.words


class TestFlight:
    def payload(self, page):
        return json.loads(page.texts["flights"])

    def test_the_script_is_plotly_packed_whole(self, page):
        script = gzip.decompress(base64.b64decode(page.texts["plotly-gz"]))
        assert script == flight3d.plotly_file().read_bytes()

    def test_paths_and_replans_are_those_of_the_logs(self, flown, page):
        flights = self.payload(page)["flights"]
        assert [flight["arm"] for flight in flights] == ["SSP", "TBR", "MCR"]
        first = flown.trials.sort_values("seed", kind="stable")
        first = first[first["scene"] == flown.axes["scene"][0]].drop_duplicates("arm").set_index("arm")
        for flight in flights:
            log = flown.log(first.loc[flight["arm"], "trial"])
            drawn = np.array(flight["flown"]).T
            np.testing.assert_allclose(drawn[[0, -1]], log.steps.position_m[[0, -1]], atol=6e-4)
            assert len(flight["hover"]) == len(drawn) <= flight3d.MOST_POINTS + 1
            causes = [replan["cause"] for replan in flight["replans"]]
            assert causes == [replan.cause for replan in replanning.executed(log)]
            assert len(flight["contacts"][0]) == len(log.contacts)

    def test_the_map_comes_back_voxel_by_voxel(self, flown, page):
        flight = self.payload(page)["flights"][-1]
        row = flown.trials[(flown.trials["arm"] == "MCR") & (flown.trials["scene"] == flown.axes["scene"][0])]
        expected = flown.log(row.sort_values("seed")["trial"].iloc[0]).mapped_m
        np.testing.assert_allclose(
            sorted(centres(flight["map"]).tolist()), sorted(expected.tolist()), atol=2e-3
        )

    def test_without_logs_there_is_no_view(self, flown, tmp_path):
        study = copy_of(flown, tmp_path / "bare")
        shutil.rmtree(study.folder / TRIALS)
        page = Page(written(study))
        assert "plotly-gz" not in page.texts
        assert "a-flight-in-3d" not in {attributes.get("id") for _, attributes in page.tags}

    def test_without_plotly_the_page_says_how_to_get_it(self, flown, tmp_path, monkeypatch):
        monkeypatch.setattr(flight3d, "plotly_file", lambda: None)
        page = Page(written(copy_of(flown, tmp_path / "without")))
        assert "pip install plotly" in page.words

    @pytest.mark.skipif(shutil.which("node") is None, reason="no node to read JavaScript")
    @pytest.mark.parametrize("name", ["page.js", "flight3d.js"])
    def test_the_scripts_are_javascript(self, name, tmp_path):
        file = tmp_path / name
        file.write_text(html.asset(name))
        assert subprocess.run(["node", "--check", file], capture_output=True, check=False).returncode == 0


def centres(packed):
    """Voxel centres (N, 3) as the page's script unpacks them."""
    index = np.frombuffer(gzip.decompress(base64.b64decode(packed["index"])), dtype="<i2").reshape(3, -1)
    return np.array(packed["origin_m"]) + packed["size_m"] * index.T


@pytest.mark.parametrize("count", [0, 1, 500])
def test_voxels_survive_packing(count):
    rng = np.random.default_rng(count)
    cells = np.unique(rng.integers(-40, 40, (count, 3)), axis=0)
    packed = flight3d.voxels((0.05 + 0.1 * cells).astype(np.float32))
    np.testing.assert_allclose(centres(packed), 0.05 + 0.1 * cells, atol=1e-3)


def test_of_many_configurations_the_head_names_the_two_ends(tmp_path):
    arms = [f"arm {number}" for number in range(9)]
    rows = pd.DataFrame({"cell": np.repeat(arms, 8), "seed": np.tile(range(8), 9), "status": "ok"})
    rows["success"] = rows["seed"] < np.repeat(range(9), 8)
    rows["outcome"] = np.where(rows["success"], "reached", "stuck")
    rows["trial"] = [f"t{number}" for number in range(len(rows))]
    rows["strategy"] = rows["world"] = "x"
    words = Page(written(made_up(tmp_path, rows, {"cell": tuple(arms)}))).words
    head = words[: words.index("A <table>")]
    assert "9 configurations" in head
    assert "arm 0 0.0 [" in head
    assert "arm 8 100.0 [" in head
    assert "arm 4 50.0" not in head
