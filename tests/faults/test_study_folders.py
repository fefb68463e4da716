"""A study folder of a stranger's, or a damaged one: told in one line, waited for never, left as it is."""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.fuzz.folders import READERS, faults_of
from tests.fuzz.watch import in_time
from tests.sweeps import QUICK
from uavexp.__main__ import main as fly
from uavexp.errors import ConfigError, RecordError, UavexpError
from uavexp.report.__main__ import main as report
from uavexp.report.declared import declared
from uavexp.store.log_shapes import EVENTS, NEEDED, OPTIONAL
from uavexp.store.logs import LATER, log_arrays, pack, read_log, unpack
from uavexp.store.records import read_record, seal
from uavexp.store.study import read_study

STUDY = (*QUICK, "strategy=mcr,tbr", "seed=0")


@pytest.fixture
def copy(recorded: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(recorded, tmp_path / "study"))


def first(folder: Path) -> Path:
    return min((folder / "trials").iterdir())


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda file: file.symlink_to("/dev/zero")])
@pytest.mark.parametrize(
    "name", ["study.json", "run.json", "trials.parquet", ".report", "record.json", "log.npz", "wall.json"]
)
def test_what_is_no_file_is_waited_for_by_nobody(name: str, make: Callable[[Path], None], copy: Path) -> None:
    place = first(copy) if name in ("record.json", "log.npz", "wall.json") else copy
    (place / name).unlink(missing_ok=True)
    make(place / name)
    for reader in READERS[1:]:
        with in_time(60.0), contextlib.suppress(UavexpError):
            reader(copy)


@pytest.mark.parametrize("name", ["figures", "tables"])
def test_a_report_is_not_written_through_a_link(
    name: str, copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (copy / name).symlink_to(elsewhere)
    assert report([str(copy)]) == 2
    assert f"{name} is a link" in capsys.readouterr().err
    assert not list(elsewhere.iterdir())


@pytest.mark.parametrize("name", ["trials", "worlds"])
def test_a_flight_is_not_written_through_a_link(
    name: str, copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    elsewhere = (copy / name).rename(tmp_path / "elsewhere")
    (copy / name).symlink_to(elsewhere)
    before = sorted(elsewhere.rglob("*"))
    assert fly([*STUDY[:-1], "seed=1", f"out={copy}"]) == 2
    error = capsys.readouterr().err
    assert f"{name} is a link" in error
    assert error.count("\n") == 1
    assert sorted(elsewhere.rglob("*")) == before


def test_names_of_tables_stay_in_their_folder(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = json.loads((copy / "study.json").read_text())
    text["report"] = {"tables": [{"by_arm": {"name": "../../stolen", "metrics": ["success"]}}]}
    (copy / "study.json").write_text(json.dumps(text))
    assert report([str(copy)]) == 2
    assert "'../../stolen'" in capsys.readouterr().err
    assert not (copy.parent / "stolen.csv").exists()


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("axes", [["cell", "mcr"]]), ("axes", {"cell": ["mcr"]}), ("axes", [["cell"]]), ("seeds", ["a"]),
        ("seeds", 3), ("cells", [{"digest": 5, "labels": {}}]), ("cells", [{"labels": {}}]), ("report", []),
        ("report", {"tables": "x"}), ("settings", None), ("title", ["x"]), ("name", None),
    ],
)  # fmt: skip
def test_a_study_of_other_kinds_is_refused_where_it_is_read(part: str, value: Any, copy: Path) -> None:
    text = json.loads((copy / "study.json").read_text())
    (copy / "study.json").write_text(json.dumps({**text, part: value}))
    with pytest.raises(RecordError, match=r"study\.json: damaged"):
        read_study(copy)


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("seed", "0"), ("seed", -1), ("options", {}), ("options", {"world": 5}), ("config", []),
        ("metrics", {"path_length_m": "long"}), ("metrics", {"success": [True]}), ("metrics", {"outcome": 5}),
        ("replans", [{}]), ("replans", {}), ("world", {"digest": "../../x"}), ("status", None),
        ("traceback", "x"), ("lock", 7),
    ],
)  # fmt: skip
def test_a_sealed_record_of_other_kinds_is_refused_where_it_is_read(
    part: str, value: Any, copy: Path
) -> None:
    record = {**read_record(first(copy)), part: value}
    (first(copy) / "record.json").write_text(seal(record))
    with pytest.raises(RecordError, match=r"record\.json: damaged"):
        read_record(first(copy))


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("success", "yes", "must hold numbers"), ("path_length_m", "long", "must hold numbers"),
        ("outcome", 5, "must hold text"), ("cell", 5, "must hold text"), ("seed", None, "is empty"),
        ("trial", "../../x", "must hold names"), ("world_digest", "/etc/x", "must hold names"),
    ],
)  # fmt: skip
def test_a_table_of_other_kinds_is_refused_where_it_is_read(
    column: str, value: Any, words: str, copy: Path
) -> None:
    table = pd.read_parquet(copy / "trials.parquet")
    table[column] = value
    table.to_parquet(copy / "trials.parquet")
    with pytest.raises(RecordError, match=rf"trials\.parquet: damaged \(the column {column} {words}"):
        assert read_study(copy).measurements is None


def test_every_array_of_a_log_has_its_shape_told(recorded: Path) -> None:
    log = read_log(first(recorded) / "log.npz")
    told = (NEEDED | OPTIONAL | EVENTS).keys()
    assert log_arrays(log).keys() <= told <= {*log_arrays(log), *LATER}


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("position_m", lambda array: array[:-1]), ("position_m", lambda array: array[:, :2]),
        ("time_s", lambda array: array * np.nan), ("quaternion_wxyz", lambda array: array.astype(str)),
        ("outcome", lambda array: np.array("banana")), ("replans.cause", lambda array: array[:0]),
        ("map_shape", lambda array: array * 1000), ("replans.changed_m.count", lambda array: array + 1),
        ("mapped_m", lambda array: array.ravel()),
    ],
)  # fmt: skip
def test_a_log_of_other_shapes_is_refused_where_it_is_read(
    name: str, change: Callable[[Any], Any], copy: Path
) -> None:
    file = first(copy) / "log.npz"
    arrays = unpack(file)
    file.write_bytes(pack({**arrays, name: change(arrays[name])}))
    with pytest.raises(RecordError, match=r"log\.npz: no log"):
        read_log(file)


def test_an_archive_that_would_unpack_to_gigabytes_is_refused_before_it_is(tmp_path: Path) -> None:
    file = tmp_path / "log.npz"
    with zipfile.ZipFile(file, "w") as archive:
        for name in ("time_s.npy", "tick_s.npy"):
            archive.writestr(name, bytes(12345))
    data = file.read_bytes().replace((12345).to_bytes(4, "little"), (2**32 - 2).to_bytes(4, "little"))
    file.write_bytes(data)
    with pytest.raises(RecordError, match=r"would unpack to 8\.6 GB"):
        unpack(file)


def test_an_array_that_claims_more_than_its_bytes_is_damaged(tmp_path: Path) -> None:
    header = io.BytesIO()
    claim = {"descr": "<f8", "fortran_order": False, "shape": (1 << 45,)}
    np.lib.format.write_array_header_2_0(header, claim)
    with zipfile.ZipFile(tmp_path / "log.npz", "w") as archive:
        archive.writestr("time_s.npy", header.getvalue())
    with pytest.raises(RecordError, match="damaged"):
        unpack(tmp_path / "log.npz")


@pytest.mark.parametrize("seed", range(1000, 1024))
def test_a_spoilt_folder_is_read_or_refused(seed: int, recorded: Path, tmp_path: Path) -> None:
    with in_time(60.0):
        assert faults_of(recorded, tmp_path / "place", seed, readers=3) == []


@pytest.mark.parametrize(
    ("report", "words"),
    [
        ({"claims": [{"says": "{first.__class__}", "source": "s", "metric": "success", "arms": ["a", "b"]}]},
         "is none of first"),
        ({"claims": [{"says": "{label:>999999999}", "source": "s", "metric": "success", "arms": ["a", "b"]}]},
         "is none of first"),
        ({"claims": [{"says": "s", "source": "s", "metric": "success", "arms": ["a"]}]}, "needs arms"),
        ({"claims": [{"says": "s", "source": "s", "metric": "success", "each": 5}]}, "must be a list"),
        ({"tables": [{"by_arm": {"metrics": 5}}]}, "must be a list"),
        ({"tables": ["os.path"]}, "is refused"),
    ],
)  # fmt: skip
def test_a_report_of_a_stranger_is_refused_in_one_line(
    report: dict[str, Any], words: str, recorded: Path
) -> None:
    """A statement's {first.__class__...} is read by Python's format, which hands out what it finds."""
    with pytest.raises(ConfigError, match=words):
        declared(replace(read_study(recorded), report=report))
