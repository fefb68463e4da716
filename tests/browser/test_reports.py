"""Reports as a person sees them: wide and narrow, by day and by night, nothing fetched, nothing in red."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser.browser import Browser
from tests.browser.conftest import SHOTS
from tests.studies import copy_of
from uavexp.report.make import make_report
from uavexp.show.__main__ import main as show
from uavexp.store.study import Study

WIDTHS_PX = (1400, 390)
# a flight is drawn slowly without a graphics card; the narrow window is the harder one
DRAWN_PX = WIDTHS_PX if SHOTS else (390,)
_DRAWN = """new Promise(done => {
  const scene = () => document.querySelector('#flight')._fullLayout?.scene?._scene?.glplot;
  const ask = () => scene() ? done(true) : setTimeout(ask, 100);
  ask();
})"""


@pytest.fixture(scope="module")
def study(flown: Study, tmp_path_factory: pytest.TempPathFactory) -> Study:
    return copy_of(flown, tmp_path_factory.mktemp("looked at") / "study")


@pytest.fixture(scope="module")
def report(study: Study) -> Path:
    return make_report(study.folder)[-1]


@pytest.mark.parametrize("width_px", WIDTHS_PX)
@pytest.mark.parametrize("dark", [False, True], ids=["day", "night"])
def test_the_report_is_as_wide_as_its_window_and_fetches_nothing(
    browser: Browser, shots: Path, report: Path, width_px: int, dark: bool
) -> None:
    colours = "[getComputedStyle(document.body).color, getComputedStyle(document.body).backgroundColor]"
    seen = browser.look(report.as_uri(), width_px=width_px, dark=dark, ask=(colours,))
    (shots / f"report-{width_px}{'-dark' * dark}.png").write_bytes(seen.png)
    assert seen.errors == []
    assert seen.outside == []
    assert seen.overflow_px <= 0
    ink, paper = (sum(map(int, colour[4:-1].split(","))) for colour in seen.answers[0])
    assert (ink > paper) == dark
    assert abs(ink - paper) > 400  # of 765: it can be read


def test_a_click_sorts_a_column_and_its_head_stays_in_sight(browser: Browser, report: Path) -> None:
    table = "document.querySelector('#failed-trials table.failed')"
    seeds = f"[...{table}.tBodies[0].rows].map(row => Number(row.cells[2].textContent))"
    click = f"{table}.tHead.rows[0].cells[2].click()"
    scrolled = f"""(() => {{
      const box = {table}.parentElement; box.scrollTop = 200;
      return {table}.tHead.rows[0].cells[1].getBoundingClientRect().top - box.getBoundingClientRect().top;
    }})()"""
    asked = (click, seeds, click, seeds, scrolled)
    _, upward, _, downward, head_px = browser.look(report.as_uri(), width_px=1400, ask=asked).answers
    assert upward == sorted(upward)
    assert downward == sorted(downward, reverse=True)
    assert abs(head_px) < 4.0


@pytest.mark.parametrize("width_px", DRAWN_PX)
def test_the_flight_in_3d_begins_with_all_of_it_in_view(
    browser: Browser, shots: Path, report: Path, width_px: int
) -> None:
    # both ends of every flight and the corners of its box, through the view's own matrices
    inside = """(() => {
      const scene = document.querySelector('#flight')._fullLayout.scene._scene, { dataScale } = scene;
      const { model, view, projection } = scene.glplot.cameraParams;
      const data = JSON.parse(document.getElementById('flights').textContent);
      const times = (m, v) => [0, 1, 2, 3].map(r => v.reduce((sum, x, c) => sum + m[4 * c + r] * x, 0));
      const points = data.flights.flatMap(f => f.flown[0].map((_, n) => [0, 1, 2].map(a => f.flown[a][n])));
      return points.every(point => {
        const p = times(projection, times(view, times(model, [...point.map((x, a) => x * dataScale[a]), 1])));
        return Math.abs(p[0] / p[3]) < 1 && Math.abs(p[1] / p[3]) < 1;
      });
    })()"""
    shown = "document.getElementById('flight').scrollIntoView()"
    seen = browser.look(report.as_uri(), width_px=width_px, ask=(shown, _DRAWN, inside), settle_s=0.1)
    (shots / f"flight3d-{width_px}.png").write_bytes(seen.png)
    assert seen.errors == []
    assert seen.answers[-1] is True


@pytest.mark.parametrize("width_px", DRAWN_PX)
def test_the_page_of_flights_shows_them_without_a_complaint(
    browser: Browser, shots: Path, study: Study, width_px: int
) -> None:
    page = study.folder / "show.html"
    if not page.is_file():
        assert show([str(study.folder), "--out", str(page)]) == 0
    inside = """(() => {
      const data = JSON.parse(document.getElementById('flights').textContent);
      const scenes = [...document.querySelectorAll('.scene')];
      return data.flights.every((flight, n) => {
        const { clientWidth: width, clientHeight: height } = scenes[n], view = camera.matrix(width / height);
        const rows = [...Array(flight.path.length / 3).keys()];
        const points = rows.map(row => flight.path.slice(3 * row, 3 * row + 3));
        return [data.target, ...points].every(point => {
          const [x, y] = camera.pixel(view, point, width, height);
          return x > 0 && y > 0 && x < width && y < height;
        });
      });
    })()"""
    ready = "new Promise(done => setInterval(() => document.body.dataset.ready && done(true), 50))"
    seen = browser.look(page.as_uri(), width_px=width_px, settle_s=0.1, ask=(ready, inside))
    (shots / f"show-{width_px}.png").write_bytes(seen.png)
    assert seen.answers == [True, True]  # it begins with all of every flight in view
    assert seen.errors == []
    assert seen.outside == []
    assert seen.overflow_px <= 0
