"""The page and the film of stored flights: whole, true to the log, nothing fetched."""

from __future__ import annotations

import base64
import gzip
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.folders import DATA
from tests.logs import changed, make_log, still_curve
from uavexp.export.map_voxels import map_voxels
from uavexp.show import __main__ as command
from uavexp.show import film, flight_data
from uavexp.show.film import film_bytes, pictures
from uavexp.show.page import inline_json, page_html
from uavexp.store.stored_trial import StoredTrial, read_trial
from uavexp.types import Shape

STUDY = DATA / "study"
FLOWN = STUDY / "trials" / "mcr_rooms-s0-a1cbaac7e702"
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


def stored(log: Any, label: str = "flight") -> StoredTrial:
    return StoredTrial(name="flight", label=label, log=log, world=None)


def voxels_of(data: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Centres (N, 3) and times (N,) that the page's script makes of a map."""
    values = np.frombuffer(gzip.decompress(base64.b64decode(data["voxels"])), "<i2").reshape(4, -1)
    return np.array(data["origin_m"]) + values[:3].T * data["size_m"], values[3] / 10.0


def data_of(page: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(re.search(r'id="flights">(.*?)</script>', page, re.DOTALL)[1])
    return found


@pytest.fixture(scope="module")
def study_page(tmp_path_factory) -> Path:
    """The page of a study of three arms."""
    file: Path = tmp_path_factory.mktemp("show") / "study.html"
    assert command.main([str(STUDY), "--out", str(file)]) == 0
    return file


def test_a_study_shows_its_arms_side_by_side_in_one_world(study_page) -> None:
    data = data_of(study_page.read_text())
    assert [flight["label"] for flight in data["flights"]] == ["SSP", "TBR", "MCR"]
    assert len({tuple(flight["path"][:3]) for flight in data["flights"]}) == 1, "from the same start"
    assert study_page.stat().st_size < 3e6


def test_the_page_fetches_nothing_and_no_name_can_end_its_script(study_page) -> None:
    page = study_page.read_text()
    assert not re.findall(r"""(?:src|href)=["'](?!data:,)|https?://|url\(|import\(|fetch\(""", page)
    hostile = page_html("</title><script>", [stored(read_trial(FLOWN).log, "</script><!--<script>alert(1)")])
    assert hostile.count("</script>") == 2
    assert "<!--" not in hostile
    assert data_of(hostile)["flights"][0]["label"] == "</script><!--<script>alert(1)"
    assert "<" not in inline_json({"a": "<", "b": ["</script>"]})


def test_the_page_shows_the_flight_that_was_flown() -> None:
    log = read_trial(FLOWN).log
    target_m = log.replans[-1].goal_m
    data = flight_data.flight_data(log, target_m)
    path_m = np.array(data["path"]).reshape(-1, 3)
    rows = np.searchsorted(log.steps.time_s, np.array(data["time_s"]) - 1e-6)
    np.testing.assert_allclose(path_m, log.steps.position_m[rows], atol=5.1e-4)
    assert rows[-1] == log.steps.time_s.size - 1
    assert [plan["cause"] for plan in data["plans"]] == [replan.cause for replan in log.replans]
    for plan, replan in zip(data["plans"], log.replans, strict=True):
        assert plan["s"] == pytest.approx(replan.time_s, abs=1e-3)
        if plan["goal"] is None:
            assert np.linalg.norm(replan.goal_m - target_m) < 0.3
        else:
            np.testing.assert_allclose(plan["goal"], replan.goal_m, atol=1e-3)
        if len(replan.trajectory_m):
            np.testing.assert_allclose(plan["points"][-3:], replan.trajectory_m[-1], atol=1e-3)


def test_every_voxel_with_a_face_is_shown_from_when_it_was_mapped() -> None:
    rng = np.random.default_rng(1)
    log = read_trial(FLOWN).log
    times_s = rng.uniform(0.0, 9.0, len(log.mapped_m)).astype(np.float32)
    grown = flight_data.map_data(changed(log, map_occupied_s=times_s))
    centres_m, since_s = voxels_of(grown)
    assert grown["grows"]
    assert (np.diff(since_s) >= 0).all()
    told = {tuple(np.round(place, 2)): at for place, at in zip(centres_m, since_s, strict=True)}
    known = {
        tuple(np.round(place, 2)): at for place, at in zip(log.mapped_m.astype(float), times_s, strict=True)
    }
    assert set(told) <= set(known)
    assert max(abs(told[place] - known[place]) for place in told) <= 0.051
    voxels = map_voxels(log)
    solid = np.pad(voxels.occupied, 1)
    inner = np.ones_like(voxels.occupied)
    for axis in range(3):
        for side in (-1, 1):
            inner &= np.roll(solid, side, axis)[1:-1, 1:-1, 1:-1]
    assert len(told) == (voxels.occupied & ~inner).sum()
    assert not flight_data.map_data(log)["grows"], "an older log does not tell"


def test_a_map_too_large_is_drawn_coarser_and_encloses_the_same(monkeypatch) -> None:
    monkeypatch.setattr(flight_data, "MOST_VOXELS", 2000)
    log = read_trial(FLOWN).log
    data = flight_data.map_data(log)
    centres_m, _ = voxels_of(data)
    assert data["size_m"] > 0.1
    assert len(centres_m) <= 2000
    low_m, high_m = centres_m.min(axis=0) - data["size_m"] / 2, centres_m.max(axis=0) + data["size_m"] / 2
    assert (low_m <= log.mapped_m.min(axis=0)).all()
    assert (high_m >= log.mapped_m.max(axis=0)).all()


def test_movers_that_are_not_there_are_not_drawn() -> None:
    log = make_log(still_curve(), still_curve(), duration_s=1.0)
    rows = log.steps.time_s.size
    places = np.zeros((rows, 2, 3), dtype=np.float32)
    places[50:, 1, 2] = -1e6
    log = changed(
        log, mover_shape=np.array([Shape.SPHERE, Shape.BOX], dtype=np.uint8), mover_position_m=places,
        mover_half_size_m=np.full((2, 3), 0.3), mover_clearance_m=np.ones(rows),
    )  # fmt: skip
    movers = flight_data.movers_data(log)
    assert [now[1] is None for now in movers["at"]] == [at_s > 0.495 for at_s in movers["time_s"]]
    assert all(now[0] == [0.0, 0.0, 0.0] for now in movers["at"])


@pytest.mark.parametrize("duration_s", [0.0, 0.5])
def test_a_flight_without_map_plan_or_step_is_shown_all_the_same(duration_s) -> None:
    trial = stored(make_log(still_curve(), still_curve(), duration_s=duration_s))
    assert data_of(page_html("t", [trial]))["flights"][0]["plans"] == []
    assert film_bytes(trial, ".gif")[:6] == b"GIF89a"


def test_a_film_shows_the_whole_flight_in_few_seconds(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(film, "MOST_S", 3.0)
    file = tmp_path / "film.gif"
    assert command.main([str(FLOWN), "--gif", str(file)]) == 0
    with Image.open(file) as shown:
        assert 24 < shown.n_frames <= 4 * 12
        shown.seek(0)
        first = np.array(shown.convert("RGB")).astype(int)
        shown.seek(shown.n_frames - 1)
        last = np.array(shown.convert("RGB")).astype(int)
    assert (np.abs(last - first).max(axis=2) > 60).sum() > 500, "it moved"


def test_the_film_of_a_growing_map_grows() -> None:
    log = read_trial(FLOWN).log
    end_s = float(log.steps.time_s[-1])
    grown = changed(log, map_occupied_s=np.linspace(0.0, end_s, len(log.mapped_m)).astype(np.float32))
    dark = [
        (np.array(frame.convert("L"))[:-120] == 42).sum() for frame in list(pictures(stored(grown)))[::20]
    ]
    assert dark == sorted(dark)
    assert dark[0] < 0.1 * dark[-1]


def test_a_video_has_the_films_pictures(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(film, "MOST_S", 2.0)
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    file = tmp_path / "film.mp4"
    assert command.main([str(FLOWN), "--mp4", str(file)]) == 0
    about = next(reader := ffmpeg.read_frames(str(file)))
    assert about["size"][0] == 720
    assert sum(1 for _ in reader) == 3 * film.FRAMES_PER_S


def test_what_cannot_be_shown_is_one_line(tmp_path, capsys) -> None:
    assert command.main([str(tmp_path)]) == 2
    assert "holds no trial: log.npz is missing" in capsys.readouterr().err
    assert command.main([str(FLOWN), "--gif", str(tmp_path / "film.avi")]) == 2
    assert "a film ends in .gif or .mp4, got '.avi'" in capsys.readouterr().err
    assert command.main([str(FLOWN), "--out", str(tmp_path / "no" / "page.html")]) == 2
    assert "cannot be written" in capsys.readouterr().err


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_a_browser_draws_the_page_without_a_complaint(study_page, tmp_path) -> None:
    shown = subprocess.run(
        [
            str(CHROMIUM), "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader", "--enable-logging=stderr", "--virtual-time-budget=5000",
            f"--user-data-dir={tmp_path}", "--dump-dom", f"{study_page.as_uri()}#t=3",
        ],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    assert "CONSOLE" not in shown.stderr
    assert 'data-ready="yes"' in shown.stdout
    assert "3.0 of 8.0 s" in shown.stdout
    assert "0.6 s · plan 0: first" in shown.stdout
