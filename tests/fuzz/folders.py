"""Study folders as a stranger may have left them: a piece is changed, then everything read."""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from uavexp.errors import UavexpError
from uavexp.export.formats import export
from uavexp.report.make import make_report
from uavexp.report.picture_files import draw_missing
from uavexp.show.chosen import chosen
from uavexp.show.page import page_html
from uavexp.store.logs import pack, unpack
from uavexp.store.records import seal
from uavexp.store.resume import take_stock
from uavexp.store.stored_trial import read_trial
from uavexp.store.study import collect

NASTY: tuple[Any, ...] = (
    None, True, 0, -1, 2**63, 1e308, -1e-320, "", "\0", "../../x", "[/b] <!--<script>",
    "inf", "nan", "a" * 5000,
    [], {}, [None], {"": {}}, [[1.0, 2.0]], {"_target_": "x"}, "–", 10**30,
)  # fmt: skip
READERS: tuple[Callable[[Path], object], ...] = (
    make_report,
    collect,
    lambda folder: take_stock(folder, {}, accept_other_code=True),
    lambda folder: list(draw_missing(folder)),
    lambda folder: page_html("", chosen(folder).trials),
    lambda folder: [page_html("", [read_trial(trial)]) for trial in first_trials(folder)],
    lambda folder: [export(read_trial(trial), "csv", folder / "x.csv") for trial in first_trials(folder)],
    lambda folder: [export(read_trial(trial), "ply", folder / "x.ply") for trial in first_trials(folder)],
)


def first_trials(folder: Path) -> list[Path]:
    return sorted((folder / "trials").glob("*"))[:1]


def spoil(folder: Path, chance: random.Random) -> str:
    """Change one piece of a study folder; what was done, in words."""
    file = chance.choice(sorted(item for item in folder.rglob("*") if item.is_file()))
    ways = [_swap_kind, _cut, _flip]
    if file.suffix == ".json":
        ways += [_change_json] * 6
    if file.suffix == ".npz":
        ways += [_change_arrays] * 6
    if file.suffix == ".parquet":
        ways += [_change_columns] * 6
    way = chance.choice(ways)
    return f"{way.__name__} {file.relative_to(folder)}: {way(file, chance)}"


def _swap_kind(file: Path, chance: random.Random) -> str:
    kind = chance.choice(("folder", "fifo", "loop", "zero", "gone", "empty"))
    file.unlink()
    if kind == "folder":
        file.mkdir()
    elif kind == "fifo":
        os.mkfifo(file)
    elif kind == "loop":
        file.symlink_to(file)
    elif kind == "zero":
        file.symlink_to("/dev/zero")
    elif kind == "empty":
        file.touch()
    return kind


def _cut(file: Path, chance: random.Random) -> str:
    data = file.read_bytes()
    place = chance.randrange(len(data) + 1)
    file.write_bytes(data[:place])
    return f"at {place}"


def _flip(file: Path, chance: random.Random) -> str:
    data = bytearray(file.read_bytes())
    places = [chance.randrange(len(data)) for _ in range(chance.choice((1, 1, 3, 20)))] if data else []
    for place in places:
        data[place] = chance.randrange(256)
    file.write_bytes(data)
    return f"{places}"


def _change_json(file: Path, chance: random.Random) -> str:
    try:
        tree = json.loads(file.read_text())
    except ValueError:
        return "no JSON any more"
    node, path = tree, []
    while isinstance(node, dict | list) and node:
        key = chance.choice(sorted(node) if isinstance(node, dict) else range(len(node)))
        path.append(key)
        if not isinstance(node[key], dict | list) or not node[key] or chance.random() < 0.4:
            break
        node = node[key]
    words = f"{path}"
    if path and chance.random() < 0.25:
        del node[path[-1]]
    elif path:
        node[path[-1]] = value = chance.choice(NASTY)
        words += f" = {value!r:.40}"
    if file.name == "record.json":
        tree.pop("sha256", None)
        tree.pop("schema", None)
        file.write_text(seal(tree))
    else:
        file.write_text(json.dumps(tree))
    return words


def _change_arrays(file: Path, chance: random.Random) -> str:
    try:
        arrays = unpack(file)
    except UavexpError:
        return "no arrays any more"
    name = chance.choice(sorted(arrays))
    array = arrays.pop(name)
    ways: dict[str, Callable[[], Any]] = {
        "text": lambda: np.full(array.shape, "x"),
        "nan": lambda: np.full(array.shape, np.nan),
        "inf": lambda: np.full(array.shape, np.inf),
        "huge": lambda: np.full(array.shape, 1e308),
        "zero": lambda: np.zeros(array.shape),
        "minus": lambda: np.full(array.shape, -(2**40)),
        "flat": lambda: array.ravel(),
        "half": lambda: array[: len(array) // 2] if array.ndim else array,
        "none": lambda: array[:0] if array.ndim else np.zeros(0),
        "one more": lambda: array[None],
        "truths": lambda: np.ones(array.shape, dtype=bool),
        "reversed": lambda: array[::-1] if array.ndim else array,
        "complex": lambda: np.ones(array.shape, dtype=complex),
        "big": lambda: np.full(array.shape, 2**62),
    }
    way = chance.choice(["gone", *ways])
    if way != "gone":
        arrays[name] = ways[way]()
    file.write_bytes(pack(arrays))
    return f"{name} {way}"


def _change_columns(file: Path, chance: random.Random) -> str:
    try:
        table = pd.read_parquet(file)
    except Exception:
        return "no table any more"
    names = [name for name in table.columns if not name.startswith("p_")]
    name = chance.choice(names)
    ways: dict[str, Callable[[], Any]] = {
        "text": lambda: "x",
        "path": lambda: "../../../x",
        "none": lambda: None,
        "nan": lambda: np.nan,
        "inf": lambda: np.inf,
        "number": lambda: 7,
        "minus": lambda: -1e300,
        "truth": lambda: True,
        "time": lambda: pd.Timestamp("2020-01-01"),
        "bytes": lambda: b"\xff",
        "list": lambda: [[1, 2]] * len(table),
        "mixed": lambda: pd.Categorical(["a"] * len(table)),
    }
    way = chance.choice(["gone", "rows", *ways])
    if way == "gone":
        table = table.drop(columns=name)
    elif way == "rows":
        table = pd.concat([table, table]) if chance.random() < 0.5 else table[:1]
    else:
        table[name] = ways[way]()
    with contextlib.suppress(Exception):
        table.to_parquet(file)
        later = max(item.stat().st_mtime_ns for item in file.parent.rglob("record.json")) + 10**9
        os.utime(file, ns=(later, later))
    return f"{name} {way}"


def faults_of(study: Path, place: Path, seed: int, readers: int | None = None) -> list[str]:
    """Spoil a copy of a study and read it in every way; what ended as nothing may end.

    Args:
        study: a whole one.
        place: where the copy goes; what appears beside it is a fault, too.
        seed: of what is spoiled.
        readers: how many readers are drawn; all of them by default.
    """
    chance = random.Random(seed)
    shutil.rmtree(place, ignore_errors=True)
    folder = Path(shutil.copytree(study, place / "study"))
    did = [spoil(folder, chance) for _ in range(chance.choice((1, 1, 2)))]
    faults = []
    for reader in READERS if readers is None else chance.sample(READERS, readers):
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                reader(folder)
        except UavexpError as error:
            if not str(error):
                faults.append(f"seed {seed}: {did}: {type(error).__name__} without a word")
        except Exception as error:
            faults.append(f"seed {seed}: {did}: {type(error).__name__}: {error}")
    if {item.name for item in place.iterdir()} != {"study"}:
        faults.append(f"seed {seed}: {did}: wrote beside the folder")
    return faults
