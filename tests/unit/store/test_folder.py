"""A study folder while it is written: one writer, whole trials, nothing overwritten or pooled silently."""

from __future__ import annotations

import dataclasses
import multiprocessing
import os
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest

from uavexp.config.composition import Composer
from uavexp.errors import RecordError
from uavexp.store.folder import LOCK, locked, opened, put_trial, put_world, remove_unfinished, set_aside
from uavexp.store.resume import join_studies
from uavexp.store.study import Study, StudyCell, read_study, study_text, trial_folders


def study(folder: Path, cells: str, seeds: tuple[int, ...], name: str = "mcr/table1") -> Study:
    return Study(
        folder=folder,
        name=name,
        title="a title",
        report={"tables": ["by_metric"]},
        axes={"arm": tuple(cells)},
        seeds=seeds,
        settings={"primary": "a"},
        cells=tuple(StudyCell(digest=f"digest of {arm}", labels={"arm": arm}) for arm in cells),
    )


def test_a_trial_is_whole_and_an_earlier_one_is_set_aside(tmp_path: Path) -> None:
    for content in (b"first", b"second", b"third"):
        put_trial(tmp_path, "trial", {"record.json": content, "log.npz": b""})
    where = {item.name: (item / "record.json").read_bytes() for item in (tmp_path / "trials").iterdir()}
    assert where == {"trial": b"third", "trial.aside-1": b"first", "trial.aside-2": b"second"}
    assert [item.name for item in trial_folders(tmp_path)] == ["trial"]


def test_a_trial_that_cannot_be_written_leaves_the_earlier_one(tmp_path: Path) -> None:
    put_trial(tmp_path, "trial", {"record.json": b"first"})
    with pytest.raises(RecordError, match="cannot be written"):
        put_trial(tmp_path, "trial", {"record.json": b"second", "no/such/folder": b""})
    assert [item.name for item in (tmp_path / "trials").iterdir()] == ["trial"]
    assert (tmp_path / "trials" / "trial" / "record.json").read_bytes() == b"first"


def test_what_a_killed_sweep_was_writing_is_removed(tmp_path: Path) -> None:
    put_trial(tmp_path, "trial", {"record.json": b"whole"})
    put_world(tmp_path, "digest", b"whole")
    (tmp_path / "trials" / ".other.part").mkdir()
    (tmp_path / "trials" / ".other.part" / "log.npz").write_bytes(b"half")
    for name in ("worlds/.digest-x.npz.part", ".trials-x.parquet.part"):
        (tmp_path / name).write_bytes(b"half")
    assert list(trial_folders(tmp_path)) == [tmp_path / "trials" / "trial"]
    assert remove_unfinished(tmp_path) == 3
    assert remove_unfinished(tmp_path) == 0
    assert sorted(str(item.relative_to(tmp_path)) for item in tmp_path.rglob("*") if item.is_file()) == [
        "trials/trial/record.json",
        "worlds/digest.npz",
    ]


def test_a_world_is_written_once_and_mended_when_it_was_cut(tmp_path: Path) -> None:
    file = tmp_path / "worlds" / "digest.npz"
    put_world(tmp_path, "digest", b"whole")
    written = file.stat().st_ino
    put_world(tmp_path, "digest", b"whole")
    assert file.stat().st_ino == written
    file.write_bytes(b"who")
    put_world(tmp_path, "digest", b"whole")
    assert file.read_bytes() == b"whole"


def test_set_aside_takes_the_first_free_number(tmp_path: Path) -> None:
    for _ in range(2):
        (tmp_path / "trials" / "trial").mkdir(parents=True)
        aside = set_aside(tmp_path, "trial")
    assert aside.name == "trial.aside-2"


def _hold(folder: Path, held: object, release: object) -> None:
    with locked(folder):
        held.set()  # type: ignore[attr-defined]
        release.wait()  # type: ignore[attr-defined]


def test_a_folder_has_one_writer_and_a_dead_one_holds_nothing(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    held, release = context.Event(), context.Event()
    holder = context.Process(target=_hold, args=(tmp_path, held, release))
    holder.start()
    assert held.wait(30.0)
    with pytest.raises(RecordError, match=f"process {holder.pid}"), locked(tmp_path):
        pass
    holder.kill()
    holder.join()
    with locked(tmp_path):
        assert (tmp_path / ".lock").read_text() == str(os.getpid())


def _count(folder: Path, total: Path, times: int) -> None:
    """Add to a number in a file, which only holders of the lock may do; leave no lock file behind."""
    done = 0
    while done < times:
        try:
            with locked(folder):
                total.write_text(str(int(total.read_text()) + 1))
                done += 1
                (folder / LOCK).unlink()
        except RecordError:
            continue


def test_a_lock_whose_file_is_removed_by_its_holder_has_one_holder(tmp_path: Path) -> None:
    """Used to lock the removed file beside a new one of the same name."""
    total = tmp_path / "total"
    total.write_text("0")
    context = multiprocessing.get_context("spawn")
    counters = [context.Process(target=_count, args=(tmp_path, total, 300)) for _ in range(3)]
    for counter in counters:
        counter.start()
    for counter in counters:
        counter.join()
    assert total.read_text() == "900"


def test_commands_that_begin_together_get_folders_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Used to share a number when both looked before either had made its folder."""
    monkeypatch.setattr("uavexp.store.folder.outputs_root", lambda: tmp_path / "outputs")
    command = Composer().command([])
    together = threading.Barrier(8)

    def claim(_: int) -> Path:
        with ExitStack() as stack:
            together.wait()
            folder = stack.enter_context(opened(command))
            together.wait()
            (folder / "study.json").touch()  # or the empty folder would be removed again
        return folder

    with ThreadPoolExecutor(8) as pool:
        folders = list(pool.map(claim, range(8)))
    assert sorted(folders) == sorted((tmp_path / "outputs").iterdir())
    assert len(set(folders)) == 8


def test_a_study_comes_back_as_it_was(tmp_path: Path) -> None:
    given = study(tmp_path, "ba", (0, 3))
    (tmp_path / "study.json").write_text(study_text(given))
    assert read_study(tmp_path) == given


def test_studies_join_when_one_contains_the_other(tmp_path: Path) -> None:
    stored = study(tmp_path, "abc", (0, 1))
    part = join_studies(stored, study(tmp_path, "ca", (5,)))
    assert part == dataclasses.replace(stored, seeds=(0, 1, 5))
    more = study(tmp_path, "dcba", (1,))
    assert join_studies(stored, more) == dataclasses.replace(more, seeds=(0, 1))


@pytest.mark.parametrize(
    ("cells", "name"), [("abd", "mcr/table1"), ("abc", "mcr/other"), ("d", "mcr/table1")]
)
def test_other_studies_do_not_join(tmp_path: Path, cells: str, name: str) -> None:
    with pytest.raises(RecordError, match="out=DIR"):
        join_studies(study(tmp_path, "abc", (0,)), study(tmp_path, cells, (0,), name))


def test_a_cell_under_another_name_is_another_study(tmp_path: Path) -> None:
    stored = study(tmp_path, "a", (0,))
    renamed = dataclasses.replace(stored, cells=(StudyCell(digest="digest of a", labels={"arm": "b"}),))
    with pytest.raises(RecordError, match="other cells"):
        join_studies(stored, renamed)
