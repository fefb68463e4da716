"""Records: canonical, sealed, whole or absent; logs come back as they were."""

from __future__ import annotations

import dataclasses
import io
import json
import math
import stat
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

from tests.logs import make_log, make_replan, still_curve
from uavexp.check.promise import same
from uavexp.errors import RecordError
from uavexp.log import Contact, Replan, TrialLog
from uavexp.store.logs import arrays_digest, flat, log_arrays, nested, pack, read_log
from uavexp.store.parts import check_table
from uavexp.store.records import (
    canonical_json,
    cell_digest,
    code_digest,
    digest,
    read_record,
    seal,
    trial_name,
    write_atomically,
    write_text,
)
from uavexp.store.study import Study, StudyCell, _read, collect, read_study, study_text
from uavexp.store.table import FIRST, replan_rows, row_of, write_table
from uavexp.store.worlds import read_world, world_bytes
from uavexp.types import Outcome, PlanStatus, World
from uavexp.world.random_columns import RandomColumns

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=10,
)


def replan(time_s: float, changed: int) -> Replan:
    return Replan(
        time_s=time_s,
        effective_s=time_s + 0.03 if changed else math.nan,
        cause="map",
        score=1.5,
        position_m=np.array([1.0, 2.0, time_s]),
        goal_m=np.array([4.0, 5.0, 6.0]),
        status=PlanStatus.OK if changed else PlanStatus.NO_PATH,
        reason="" if changed else "search exhausted",
        path_change_m=0.25,
        iterations=3,
        expansions=100,
        near_change=bool(changed % 2),
        changed_m=np.full((changed, 3), time_s, dtype=np.float32),
        trajectory_m=np.zeros((2 * changed, 3), dtype=np.float32),
    )


def flight(rows: int = 5, replans: int = 3, contacts: int = 1) -> TrialLog:
    rng = np.random.default_rng(rows)
    return nested(
        {
            "outcome": Outcome.REACHED,
            "reason": "a reason",
            "step_s": 0.01,
            "time_s": np.arange(rows) * 0.01,
            "position_m": rng.normal(size=(rows, 3)),
            "velocity_mps": rng.normal(size=(rows, 3)),
            "quaternion_wxyz": rng.normal(size=(rows, 4)),
            "estimated_position_m": rng.normal(size=(rows, 3)),
            "reference_position_m": rng.normal(size=(rows, 3)),
            "reference_acceleration_mps2": rng.normal(size=(rows, 3)),
            "clearance_m": rng.normal(size=rows),
            "tick_s": np.arange(rows) * 0.1,
            "esdf_clearance_m": rng.normal(size=rows),
            "changed_voxels": np.arange(rows),
            "decision_score": rng.normal(size=rows),
            "replans": tuple(replan(0.5 * index, index) for index in range(replans)),
            "dropped_triggers": 2,
            "contacts": tuple(
                Contact(start_s=1.0 + index, end_s=1.5 + index, position_m=np.ones(3))
                for index in range(contacts)
            ),
            "goals_m": rng.normal(size=(2, 3)),
            "seen_share": math.nan,
            "mapped_m": rng.normal(size=(4, 3)).astype(np.float32),
            "wall_s": {"plan": np.ones(3)},
        }
    )


@given(json_values)
def test_canonical_json_is_json_and_the_same_value_gives_the_same_text(value: object) -> None:
    text = canonical_json(value)
    assert canonical_json(json.loads(text)) == text
    assert "NaN" not in text.replace('"NaN"', "") or "NaN" in str(value)


def test_key_order_does_not_matter_and_values_do() -> None:
    assert digest({"a": 1, "b": 2.0}) == digest({"b": 2.0, "a": 1})
    assert digest({"a": 1}) != digest({"a": 2})
    assert digest({"a": math.nan}) == digest({"a": float("nan")})


def test_numpy_values_are_written_as_what_they_are() -> None:
    assert (
        canonical_json({"a": np.float64(0.1), "b": np.arange(2), "c": np.True_})
        == '{"a":0.1,"b":[0,1],"c":true}'
    )


def test_a_record_comes_back_with_its_nan(tmp_path: Path) -> None:
    metrics = {"x": math.nan, "y": math.inf, "z": 0.1}
    write_text(tmp_path / "record.json", seal({**RECORD, "metrics": metrics}))
    metrics = read_record(tmp_path)["metrics"]
    assert math.isnan(metrics["x"])
    assert metrics["y"] == math.inf
    assert metrics["z"] == 0.1


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text.replace('"seed":7', '"seed":8'),
        lambda text: text[: len(text) // 2],
        lambda text: "",
        lambda text: "[]",
        lambda text: text.replace('"sha256"', '"sha255"'),
        lambda text: text.replace('"schema":2', '"schema":3'),
        lambda text: text.replace('"metrics":{"x":1.5}', '"metrics":{}'),
    ],
)
def test_a_changed_record_is_refused(tmp_path: Path, damage: object) -> None:
    text = seal({"seed": 7, "metrics": {"x": 1.5}})
    (tmp_path / "record.json").write_text(damage(text))  # type: ignore[operator]
    with pytest.raises(RecordError, match="damaged"):
        read_record(tmp_path)


def test_every_digit_of_the_seal_counts(tmp_path: Path) -> None:
    text = seal({"seed": 7, "metrics": {"x": 1.5}})
    whole = json.loads(text)["sha256"]
    for place in range(len(whole)):
        other = whole[:place] + ("0" if whole[place] != "0" else "1") + whole[place + 1 :]
        (tmp_path / "record.json").write_text(text.replace(whole, other))
        with pytest.raises(RecordError, match="sha256"):
            read_record(tmp_path)


def test_a_record_of_another_schema_is_refused_even_when_sealed(tmp_path: Path) -> None:
    body = {"seed": 7, "metrics": {}, "schema": 99}
    (tmp_path / "record.json").write_text(json.dumps({**body, "sha256": digest(body)}))
    with pytest.raises(RecordError, match="schema 99"):
        read_record(tmp_path)


def test_a_missing_record_is_told(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="cannot be read"):
        read_record(tmp_path)


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "old")

    def fail(file: object) -> None:
        file.write(b"half")  # type: ignore[attr-defined]
        raise OSError(28, "No space left on device")

    with pytest.raises(RecordError, match="No space left"):
        write_atomically(tmp_path / "a.txt", fail)
    assert [item.name for item in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "old"


def test_a_written_file_is_as_readable_as_any_other(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "x")
    (tmp_path / "b.txt").write_text("x")
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("a.txt", "b.txt")]
    assert modes[0] == modes[1]


@pytest.mark.parametrize(("rows", "replans", "contacts"), [(5, 3, 1), (1, 0, 0), (0, 1, 2)])
def test_a_log_comes_back_as_it_was(tmp_path: Path, rows: int, replans: int, contacts: int) -> None:
    log = flight(rows, replans, contacts)
    (tmp_path / "log.npz").write_bytes(pack(log_arrays(log)))
    back = read_log(tmp_path / "log.npz")
    assert arrays_digest(log_arrays(back)) == arrays_digest(log_arrays(log))
    written, read = flat(log), flat(back)
    assert {name: type(value) for name, value in read.items()} == {
        name: type(value) for name, value in written.items()
    }
    assert (back.reason, back.step_s, back.dropped_triggers) == ("a reason", 0.01, 2)
    assert [item.status for item in back.replans] == [item.status for item in log.replans]
    assert [len(item.changed_m) for item in back.replans] == list(range(replans))
    assert not back.wall_s  # clock times are no part of the record


def test_equal_logs_give_equal_bytes(tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        (tmp_path / name).write_bytes(pack(log_arrays(flight())))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_arrays_are_packed_at_the_fastest_level() -> None:
    """A zip entry made by hand has a level of its own: logs used to be packed at 6 though 4 was asked for."""
    packed = pack({"a": np.sqrt(np.arange(5000) % 977)})
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        entry, plain = archive.getinfo("a.npy"), archive.read("a.npy")
    begin = entry.header_offset + 30 + len(entry.filename)  # a local header has 30 bytes and the name
    fastest = zlib.compressobj(1, zlib.DEFLATED, -15)
    assert packed[begin : begin + entry.compress_size] == fastest.compress(plain) + fastest.flush()


def test_a_flipped_bit_in_a_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "log.npz").write_bytes(pack(log_arrays(flight(200))))
    data = bytearray((tmp_path / "log.npz").read_bytes())
    data[len(data) // 3] ^= 1
    (tmp_path / "log.npz").write_bytes(data)
    with pytest.raises(RecordError):
        read_log(tmp_path / "log.npz")


def test_the_digest_of_arrays_sees_values_types_and_names() -> None:
    base = {"a": np.arange(3.0)}
    others = [
        {"a": np.arange(3.0) + 1},
        {"a": np.arange(3)},
        {"b": np.arange(3.0)},
        {"a": np.arange(3.0)[None]},
    ]
    assert len({arrays_digest(arrays) for arrays in [base, *others]}) == 5


def test_the_code_digest_is_that_of_what_a_flight_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("trial.py", "planner/search.py", "report/page.py", "sweep/local.py", "cli/run.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("a = 1")
    monkeypatch.setattr("uavexp.store.records.PACKAGE", tmp_path)
    before = code_digest()
    for name in ("report/page.py", "sweep/local.py", "cli/run.py"):
        (tmp_path / name).write_text("a = 2")
    assert code_digest() == before, "asking, running and showing change no flight"
    for name in ("trial.py", "planner/search.py"):
        (tmp_path / name).write_text("a = 2")
        assert code_digest() != before
        (tmp_path / name).write_text("a = 1")
    (tmp_path / "trial.py").rename(tmp_path / "flight.py")
    assert code_digest() != before


IDENTITY = {"strategy": "mcr", "options": {"world": "rooms"}, "config": {"step_s": 0.01}, "seed": 3}


def test_a_trial_is_named_by_what_makes_it_this_trial() -> None:
    name = trial_name(IDENTITY)
    assert name.startswith("mcr_rooms-s3-")
    assert trial_name({**IDENTITY, "outcome": "reached"}) == name
    assert trial_name(json.loads(canonical_json(IDENTITY))) == name
    others = [{**IDENTITY, "seed": 4}, {**IDENTITY, "config": {"step_s": 0.02}}]
    names = {name, *map(trial_name, others)}
    assert len(names) == len({one.rpartition("-")[2] for one in names}) == 3, (
        "the hash alone tells them apart"
    )
    assert cell_digest(others[0]) == cell_digest(IDENTITY) != cell_digest(others[1])


RECORD = {
    **IDENTITY,
    "code": "c" * 64,
    "status": "ok",
    "reason": "",
    "config": {"step_s": 0.01, "world": {"_target_": "x.Y", "size_m": [1.0, 2.0], "reach_m": "inf"}},
    "metrics": {"outcome": "reached", "success": True, "tracking_error_m": math.nan},
    "world": {"digest": "d", "clutter_density": 0.1, "narrowest_gap_m": "inf", "straight_line_m": 3.0},
    "replans": [
        {
            "time_s": 0.5,
            "effective_s": None,
            "cause": "first",
            "position_m": [1, 2, 3],
            "goal_m": [4, 5, 6],
            "status": "ok",
            "path_change_m": None,
        }
    ],
}


def test_a_row_is_made_of_a_record_its_clock_times_and_its_labels() -> None:
    wall = {
        "command": "c",
        "wall_trial_s": 2.0,
        "laps": {"plan": {"sum_s": 1.0, "median_s": 0.1, "p99_s": 0.2}},
    }
    row = row_of(RECORD, wall, {"arm": "MCR"})
    assert row["world"] == "rooms"
    assert row["arm"] == "MCR"
    assert row["trial"] == trial_name(RECORD)
    assert row["world_digest"] == "d"
    assert row["narrowest_gap_m"] == row["p_world_reach_m"] == math.inf
    assert row["p_step_s"] == 0.01
    assert "p_world__target_" not in row
    assert (row["wall_trial_s"], row["wall_plan_p99_s"]) == (2.0, 0.2)
    assert "command" not in row


def test_a_trial_that_did_not_run_is_a_row_without_measurements() -> None:
    failed = {key: value for key, value in RECORD.items() if key not in ("world", "replans")}
    row = row_of({**failed, "status": "killed", "reason": "signal 11", "metrics": {}}, {}, {})
    assert (row["outcome"], row["success"], row["status"], row["reason"]) == (
        "error",
        False,
        "killed",
        "signal 11",
    )
    assert "tracking_error_m" not in row
    assert list(replan_rows(failed, {})) == []


def test_every_planning_request_is_a_row() -> None:
    (row,) = replan_rows(RECORD, {"arm": "MCR"})
    assert (row["number"], row["cause"], row["arm"], row["seed"]) == (0, "first", "MCR", 3)
    assert [row[name] for name in ("x_m", "y_m", "z_m", "goal_x_m", "goal_y_m", "goal_z_m")] == [
        1,
        2,
        3,
        4,
        5,
        6,
    ]
    assert math.isnan(row["effective_s"])
    assert math.isnan(row["delay_s"])  # an earlier record does not tell it


def test_a_delay_that_a_record_does_not_tell_comes_from_its_log(tmp_path: Path) -> None:
    """Records written before delays were kept get theirs when the tables are made again."""
    remaining_m = np.full(101, 0.5)
    remaining_m[20:30] = 0.1  # blocked from 2.0 s to 3.0 s
    log = make_log(
        still_curve(),
        still_curve(),
        remaining_clearance_m=remaining_m,
        replans=(make_replan(0.0, "first"), make_replan(2.5, "map")),
    )
    cell = {**RECORD, "replans": [{**RECORD["replans"][0], "time_s": time_s} for time_s in (0.0, 2.5)]}
    trial = tmp_path / "trials" / trial_name(cell)
    trial.mkdir(parents=True)
    (trial / "record.json").write_text(seal(cell))
    study = Study(
        folder=tmp_path, name="", title="", report={}, axes={"cell": ("mcr",)}, seeds=(3,), settings={},
        cells=(StudyCell(digest=cell_digest(cell), labels={"cell": "mcr"}),),
    )  # fmt: skip
    (tmp_path / "study.json").write_text(study_text(study))
    collect(tmp_path)
    assert read_study(tmp_path).replans["delay_s"].isna().all()  # no log either
    (trial / "log.npz").write_bytes(pack(log_arrays(log)))
    collect(tmp_path)
    replans = read_study(tmp_path).replans
    assert replans["blocked_since_s"].tolist() == pytest.approx([math.nan, 2.0], nan_ok=True)
    assert replans["delay_s"].tolist() == pytest.approx([math.nan, 0.5], nan_ok=True)


def test_a_world_comes_back_as_it_was_and_equal_worlds_give_equal_bytes(tmp_path: Path) -> None:
    world = RandomColumns(size_m=(8.0, 6.0, 3.0)).generate(np.random.default_rng(1))
    (tmp_path / "world.npz").write_bytes(world_bytes(world))
    back = read_world(tmp_path / "world.npz")
    for item in dataclasses.fields(World):
        given, got = getattr(world, item.name), getattr(back, item.name)
        assert type(given) is type(got), item.name
        assert same(given, got), item.name
    assert world_bytes(back) == world_bytes(world) == (tmp_path / "world.npz").read_bytes()
    (tmp_path / "log.npz").write_bytes((tmp_path / "world.npz").read_bytes()[:300])
    with pytest.raises(RecordError, match="damaged"):
        read_world(tmp_path / "log.npz")


def test_the_table_has_its_columns_in_order_and_its_pages_checked(tmp_path: Path) -> None:
    rows = [
        {
            "strategy": "mcr",
            "world": "w",
            "seed": 1,
            "success": True,
            "jerk": 0.5,
            "p_a_b": [1, 2],
            "wall_x": 1.0,
        },
        {
            "strategy": "mcr",
            "world": "w",
            "seed": 2,
            "success": False,
            "p_a_b": "text",
            "p_a_a": 1,
            "wall_x": 2.0,
        },
    ]
    write_table(tmp_path / "trials.parquet", rows)
    table = parquet.read_table(tmp_path / "trials.parquet", page_checksum_verification=True)
    assert table.column_names == [*FIRST, "jerk", "p_a_a", "p_a_b", "wall_x"]
    assert table["p_a_b"].to_pylist() == ["[1,2]", "text"]
    assert table["success"].to_pylist() == [True, False]
    assert table["jerk"].to_pylist() == [0.5, None]


def test_what_only_some_worlds_ask_for_comes_back_as_numbers(tmp_path: Path) -> None:
    """A study of BARN's worlds and others could not be reported: `barn_collided` is no or nothing there."""
    trial = {"trial": "a", "seed": 0, "outcome": "reached", "success": True, "completion_time_s": 1.0}
    rows = [{**trial, "barn_collided": asked} for asked in (None, False, True)]
    write_table(tmp_path / "trials.parquet", rows)
    table = _read(tmp_path / "trials.parquet")
    check_table(tmp_path / "trials.parquet", table, {})
    np.testing.assert_array_equal(table["barn_collided"], [np.nan, 0.0, 1.0])
    assert table["success"].dtype == bool


def test_a_flipped_bit_in_the_table_is_noticed(tmp_path: Path) -> None:
    rows = [{"strategy": "mcr", "seed": seed, "path_length_m": seed * 1.1} for seed in range(500)]
    file = tmp_path / "trials.parquet"
    write_table(file, rows)
    data = bytearray(file.read_bytes())
    data[300] ^= 1
    file.write_bytes(data)
    with pytest.raises(OSError, match=r"(?i)crc|checksum|corrupt"):
        parquet.read_table(file, page_checksum_verification=True)
