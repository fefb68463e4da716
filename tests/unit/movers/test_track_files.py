"""Files of people's tracks: every format against an independent reader, every fault one line."""

from __future__ import annotations

import contextlib
import json
import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.folders import SHARED
from uavexp.errors import WorldError
from uavexp.movers.track_files import READERS, Options, read

PEDPY, PEOPLE = SHARED / "tracks" / "pedpy", SHARED / "pedestrians"
CASES = SHARED.parent / "cases" / "movers_bom"
needs_data = pytest.mark.skipif(not PEDPY.is_dir(), reason="../shared/data/tracks is absent")


def agrees(tracks: dict[str, np.ndarray], time_s, person, x_m, y_m) -> None:
    """Each person's rows are those of the columns, in the order of time."""
    table = pd.DataFrame({"t": time_s, "id": person, "x": x_m, "y": y_m}).sort_values(["id", "t"])
    assert sum(map(len, tracks.values())) == len(table)
    assert len(tracks) == table["id"].nunique()
    for name, rows in table.groupby("id"):
        np.testing.assert_allclose(tracks[f"{name}"], rows[["t", "x", "y"]], atol=1e-9)


# ---- what others recorded ---------------------------------------------------------------------


@needs_data
@pytest.mark.parametrize("name", ["eth_univ", "hermes_uo_050_180_180", "ucy_zara01"])
def test_csv_as_pandas_reads_it(name: str) -> None:
    table = pd.read_csv(PEOPLE / f"{name}.csv")
    agrees(read(PEOPLE / f"{name}.csv"), table["t_s"], table["id"], table["x_m"], table["y_m"])


@needs_data
@pytest.mark.parametrize(
    ("name", "unit_m"),
    [
        ("bi-directional/bi_corr_400_b_03", 0.01),
        ("bottleneck/040_c_56_h-", 1.0),
        ("preprocessing/030_c_56_h0_invalid", 1.0),
    ],
)
def test_pedpy_text_as_numpy_reads_it(name: str, unit_m: float) -> None:
    person, frame, x, y = np.loadtxt(PEDPY / f"{name}.txt", usecols=(0, 1, 2, 3)).T
    agrees(read(PEDPY / f"{name}.txt"), frame / 25.0, person.astype(int), unit_m * x, unit_m * y)


@needs_data
def test_csv_of_others_by_their_columns() -> None:
    table = pd.read_csv(PEDPY / "pathfinder" / "pathfinder.csv", skiprows=[1])
    tracks = read(PEDPY / "pathfinder" / "pathfinder.csv")
    agrees(tracks, table["t"], table["id"], table["x"], table["y"])
    frames = pd.read_csv(PEDPY / "single_file" / "n34_cam2.csv")
    tracks = read(PEDPY / "single_file" / "n34_cam2.csv", Options(frame_rate_hz=25.0, unit_m=0.01))
    agrees(tracks, frames["Frame"] / 25.0, frames["ID"], 0.01 * frames["x"], 0.01 * frames["y"])


@needs_data
def test_jupedsim_as_sqlite_reads_it() -> None:
    file = PEDPY / "jupedsim" / "trajectories.sqlite"
    with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro&immutable=1", uri=True)) as connection:
        table = pd.read_sql_query("SELECT * FROM trajectory_data", connection)
    agrees(read(file), table["frame"] / 25.0, table["id"], table["pos_x"], table["pos_y"])


@needs_data
@pytest.mark.parametrize("name", ["bom", "semicolon", "unsorted"])
def test_spreadsheets_csv_holds_the_same_people(name: str) -> None:
    separator = ";" if name == "semicolon" else ","
    table = pd.read_csv(CASES / f"{name}.csv", sep=separator, encoding="utf-8-sig")
    agrees(read(CASES / f"{name}.csv"), table["t_s"], table["id"], table["x_m"], table["y_m"])


# ---- one walk in every format -----------------------------------------------------------------

WALK = pd.DataFrame(
    {
        "frame": [6, 12, 18, 6, 12, 30],
        "id": [2, 2, 2, 7, 7, 7],
        "x": [0.5, 1.0, 1.5, -2.0, -2.5, -4.0],
        "y": [3.0, 3.25, 3.5, 0.0, 0.0, 0.5],
    }
)
RATE_HZ = 15.0


def as_csv(file: Path, **form) -> None:
    table = WALK.assign(t_s=WALK["frame"] / RATE_HZ).drop(columns="frame")
    table.rename(columns={"x": "x_m", "y": "y_m"}).to_csv(file, index=False, **form)


def as_pedpy(file: Path, scale: float = 1.0, unit: str = "m") -> None:
    rows = "\n".join(f"{r.id} {r.frame} {r.x * scale} {r.y * scale} 1.76" for r in WALK.itertuples())
    head = f"# framerate: {RATE_HZ} fps\n# id frame x/{unit} y/{unit} z/{unit}\n"
    file.write_text(head + rows + "\n")


def as_social_gan(file: Path) -> None:
    rows = WALK[["frame", "id", "x", "y"]].to_csv(index=False, header=False, sep="\t")
    file.write_text("# frame id x y\n" + rows)


def as_obsmat(file: Path) -> None:
    table = WALK.assign(z=0.0, vx=0.0, vz=0.0, vy=0.0)[["frame", "id", "x", "z", "y", "vx", "vz", "vy"]]
    np.savetxt(file, table.to_numpy(), fmt="%.7e")


def as_trajnet(file: Path) -> None:
    lines = [{"scene": {"id": 0, "p": 2, "s": 6, "e": 30, "fps": 2.5, "tag": 2}}]
    lines += [{"scene": {"id": 1, "p": 7, "s": 6, "e": 30, "fps": 2.5}}]
    lines += [{"track": {"f": r.frame, "p": r.id, "x": r.x, "y": r.y}} for r in WALK.itertuples()]
    lines += [{"track": {"f": 36, "p": 2, "x": 9.0, "y": 9.0, "prediction_number": 0, "scene_id": 0}}]
    file.write_text("\n".join(map(json.dumps, lines)) + "\n")


def as_jupedsim(file: Path, version: str = "1", more: str = "") -> None:
    with contextlib.closing(sqlite3.connect(file)) as connection:
        connection.executescript(
            "CREATE TABLE metadata(key TEXT, value TEXT);"
            "CREATE TABLE trajectory_data(frame INTEGER, id INTEGER, pos_x REAL, pos_y REAL);"
        )
        connection.executemany(
            "INSERT INTO metadata VALUES (?, ?)", [("version", version), ("fps", f"{RATE_HZ}")]
        )
        rows = [(r.frame, r.id, r.x, r.y) for r in WALK.itertuples()]
        connection.executemany("INSERT INTO trajectory_data VALUES (?, ?, ?, ?)", rows)
        connection.executescript(more)
        connection.commit()


FORMS: dict[str, tuple[str, Callable[[Path], None], Options]] = {
    "csv": ("csv", as_csv, Options()),
    "semicolons and decimal commas": ("csv", lambda f: as_csv(f, sep=";", decimal=","), Options()),
    "tabs": ("tsv", lambda f: as_csv(f, sep="\t"), Options()),
    "byte order mark": ("csv", lambda f: as_csv(f, encoding="utf-8-sig"), Options()),
    "carriage returns": ("csv", lambda f: as_csv(f, lineterminator="\r\n"), Options()),
    "quotes": ("csv", lambda f: as_csv(f, quoting=1), Options()),
    "pedpy": ("txt", as_pedpy, Options()),
    "pedpy in cm": ("txt", lambda f: as_pedpy(f, 100.0, "cm"), Options()),
    "pedpy, overruled": ("txt", lambda f: as_pedpy(f, 1000.0), Options(unit_m=0.001, frame_rate_hz=15.0)),
    "other columns": ("txt", as_social_gan, Options(frame_rate_hz=15.0)),
    "table with another suffix": ("txt", as_csv, Options()),
    "obsmat": ("txt", as_obsmat, Options(frame_rate_hz=15.0)),
    "trajnet": ("ndjson", as_trajnet, Options()),
    "jupedsim 1": ("sqlite", as_jupedsim, Options()),
    "jupedsim 2": ("db", lambda f: as_jupedsim(f, "2"), Options()),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_walk_is_the_same_in_every_form(tmp_path: Path, form: str) -> None:
    suffix, write, options = FORMS[form]
    file = tmp_path / f"people.{suffix}"
    write(file)
    tracks = read(file, options)
    assert list(tracks) == ["2", "7"]
    agrees(tracks, WALK["frame"] / RATE_HZ, WALK["id"], WALK["x"], WALK["y"])


def test_rows_in_any_order_comments_and_any_case_change_nothing(tmp_path: Path) -> None:
    as_csv(tmp_path / "people.csv")
    header, *rows = (tmp_path / "people.csv").read_text().splitlines()
    mixed = ["# made by hand", header.upper(), *rows[::-1], "", "  # twice:", rows[2]]
    (tmp_path / "mixed.csv").write_text("\n".join(mixed))
    expected, found = read(tmp_path / "people.csv"), read(tmp_path / "mixed.csv")
    assert list(found) == ["7", "2"]
    for person in expected:
        np.testing.assert_array_equal(found[person], expected[person])


# ---- faults -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.csv", "t_s|id|x_m|y_m\n0|1|0|0", "there are t_s|id|x_m|y_m, if they are separated by commas"),
        ("a.csv", "", "no rows"),
        ("a.csv", "frame,id,x,y\n0,1,0,0", "does not say how fast; give movers.frame_rate_hz="),
        ("a.csv", 't_s,id,x_m,y_m\n0,"1,0,0', "a.csv:2"),
        ("a.csv", "t_s,id,x_m,y_m\n0,1,1e300,0", "a.csv:2: 0 s, 1e+300 m, 0 m is too far"),
        ("a.csv", "t_s,id,x_m,y_m\n0,1,0,0\n0,1,0,0.1", "a.csv:3: person 1 is at 0 s in another place"),
        ("a.txt", "# framerate: 0\n1 0 0 0", "the frame rate must be 0.001 to 1e6 Hz, got 0"),
        ("a.txt", "# framerate: 25\n1 0 0", "a.txt:2: 4 columns are needed, got 3"),
        ("a.txt", "# in m\n1 0 0 0", "does not say how fast"),
        ("a.txt", "1 0 0 0", "what its columns are is not said; put a line above them: # id frame x y"),
        ("a.ndjson", '{"scene": {"fps": 2.5}}\n{"scene": {"fps": 5}}', "different rates, 2.5, 5 fps"),
        ("a.ndjson", '{"track": {"f": 1, "p": 1, "x": 1}}\n{"scene": {"fps": 5}}', "a.ndjson:1: y must be"),
        ("a.ndjson", "{]", "a.ndjson:1: no JSON"),
        ("a.ndjson", "[" * 100_000, "a.ndjson:1: no JSON"),
        ("a.sqlite", "no database", "is no trajectory of JuPedSim that can be read: file is not a database"),
        ("a.h5", "", "its suffix must be one of .csv"),
    ],
)  # fmt: skip
def test_faults_are_named(tmp_path: Path, name: str, text: str, says: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(WorldError) as told:
        read(tmp_path / name)
    assert says in str(told.value)
    assert name in str(told.value)


def test_more_rows_than_memory_is_meant_for_are_refused_before_they_are_read(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t_s,id,x_m,y_m\n" + "0\n" * 2_001_000)
    with pytest.raises(WorldError, match=r"a\.csv: more than 2000000 rows; cut the recording"):
        read(tmp_path / "a.csv")


def test_a_rate_for_a_file_with_times_is_refused(tmp_path: Path) -> None:
    as_csv(tmp_path / "people.csv")
    with pytest.raises(WorldError, match="frame_rate_hz does not apply"):
        read(tmp_path / "people.csv", Options(frame_rate_hz=10.0))


ENDLESS = (
    "CREATE VIEW trajectory_data AS WITH RECURSIVE c(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM c) "
    "SELECT n frame, 1 id, 0 pos_x, 0 pos_y FROM c"
)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("DROP TABLE trajectory_data", "table trajectory_data missing"),
        (f"DROP TABLE trajectory_data; {ENDLESS}", "table trajectory_data missing"),
        ("UPDATE metadata SET value = '3' WHERE key = 'version'", "version 1 or 2 is read, got 3"),
        ("UPDATE metadata SET value = 'fast' WHERE key = 'fps'", "fps must be a finite number, got 'fast'"),
        ("UPDATE trajectory_data SET pos_x = NULL WHERE frame = 30", ":6: pos_x must be a finite number"),
        ("UPDATE trajectory_data SET id = zeroblob(100000)", "string or blob too big"),
    ],
)  # fmt: skip
def test_a_database_that_is_none_of_jupedsim_is_refused(tmp_path: Path, more: str, says: str) -> None:
    as_jupedsim(tmp_path / "a.sqlite", more=more)
    with pytest.raises(WorldError) as told:
        read(tmp_path / "a.sqlite")
    assert says in str(told.value)


def test_reading_leaves_a_database_and_its_folder_as_they_are(tmp_path: Path) -> None:
    as_jupedsim(tmp_path / "a.sqlite")
    before = (tmp_path / "a.sqlite").read_bytes()
    read(tmp_path / "a.sqlite")
    assert (tmp_path / "a.sqlite").read_bytes() == before
    assert [item.name for item in tmp_path.iterdir()] == ["a.sqlite"]
    (tmp_path / "a.sqlite-wal").write_bytes(b"rows that are not in it yet")
    with pytest.raises(WorldError, match="is still being written"):
        read(tmp_path / "a.sqlite")


def test_frames_of_two_videos_do_not_change_the_step(tmp_path: Path) -> None:
    rows = [{"scene": {"fps": 2.5}}]
    rows += [{"track": {"f": 10 * n + p, "p": p, "x": n, "y": p}} for n in range(4) for p in (0, 3)]
    (tmp_path / "a.ndjson").write_text("\n".join(map(json.dumps, rows)))
    tracks = read(tmp_path / "a.ndjson")
    assert np.diff(tracks["3"][:, 0]) == pytest.approx(0.4)
    assert tracks["3"][0, 0] == pytest.approx(3 / 25.0)


@settings(max_examples=30, deadline=None)
@given(data=st.data())
@pytest.mark.parametrize("form", FORMS)
def test_no_damage_ends_otherwise_than_in_tracks_or_one_line(tmp_path_factory, form, data) -> None:
    suffix, write, options = FORMS[form]
    assert f".{suffix}" in READERS
    file = tmp_path_factory.mktemp("damaged") / f"people.{suffix}"
    write(file)
    whole = file.read_bytes()
    at = data.draw(st.integers(0, len(whole)))
    length = data.draw(st.integers(0, 30))
    file.write_bytes(whole[:at] + data.draw(st.binary(max_size=30)) + whole[at + length :])
    with contextlib.suppress(WorldError):
        tracks = read(file, options)
        assert all(
            np.isfinite(track).all() and (np.diff(track[:, 0]) > 0.0).all() for track in tracks.values()
        )
