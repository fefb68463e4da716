"""A sweep on a local Dask cluster of two workers: the same results, also when workers die."""

from __future__ import annotations

import logging
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.jobs import act
from tests.sweeps import QUICK, assert_same_study, run
from uavexp.__main__ import main
from uavexp.errors import ConfigError
from uavexp.store.records import Status
from uavexp.sweep.dask import differing_packages, run_dask, slurm_cluster
from uavexp.sweep.job import Allowance, Done, Job

distributed = pytest.importorskip("distributed", reason="Dask is an extra: pip install 'uavexp[dask]'")
LIMITS = Allowance(timeout_s=60.0, memory_mb=1000.0)
STUDY = (*QUICK, "strategy=mcr,tbr", "seed=0:2")


@pytest.fixture
def cluster() -> Iterator[Any]:
    """Two workers, of which one job may take down two."""
    import dask

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL
        ) as made,
    ):
        yield made


def jobs(*payloads: tuple[str, Any]) -> list[Job]:
    return [Job(name=str(number), label=deed, payload=(deed, x)) for number, (deed, x) in enumerate(payloads)]


def start(given: list[Job], address: str | None) -> Iterator[Done]:
    return run_dask(act, given, address=address, queue=None, n_jobs=2, limits=LIMITS)


def test_a_study_flown_by_dask_is_the_study_flown_here(tmp_path: Path) -> None:
    assert main([*STUDY, f"out={tmp_path / 'here'}"]) == 0
    done = run(*STUDY, "runner=dask", "runner.n_jobs=2", f"out={tmp_path / 'there'}")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert_same_study(tmp_path / "there", tmp_path / "here")


def test_a_job_that_always_kills_its_worker_costs_itself_alone(cluster: Any) -> None:
    given = jobs(*[("sleep", 0.1)] * 5, ("kill_supervisor", 1.0), ("segfault", 1.0), *[("sleep", 0.1)] * 5)
    results = list(start(given, cluster.scheduler_address))
    assert sorted(int(done.job.name) for done in results) == list(range(12))
    statuses = {done.job.label: done.answer.status for done in results}
    assert statuses == {"sleep": Status.OK, "kill_supervisor": Status.KILLED, "segfault": Status.KILLED}
    assert sum(done.answer.status is Status.OK for done in results) == 10


def test_a_worker_killed_in_mid_study_loses_nothing(cluster: Any) -> None:
    given = jobs(*[("sleep", 0.3)] * 12)
    results = start(given, cluster.scheduler_address)
    first = next(results)
    os.kill(cluster.workers[0].pid, signal.SIGKILL)
    names = [first.job.name, *(done.job.name for done in results if done.answer.status is Status.OK)]
    assert sorted(map(int, names)) == list(range(12))


def test_stopping_a_sweep_stops_the_workers_it_started(tmp_path: Path) -> None:
    results = start(jobs(("sleep", 0.1), *[("note_and_sleep", tmp_path)] * 3), None)
    assert next(results).answer.value == 0.2
    end_s = time.monotonic() + 50.0
    while not list(tmp_path.iterdir()):
        assert time.monotonic() < end_s
        time.sleep(0.05)
    results.close()  # type: ignore[attr-defined]
    while any(Path(f"/proc/{item.name}").exists() for item in tmp_path.iterdir()):
        assert time.monotonic() < end_s
        time.sleep(0.05)


def test_no_scheduler_is_one_clear_error() -> None:
    import dask

    with (
        dask.config.set({"distributed.comm.timeouts.connect": "1s"}),
        pytest.raises(ConfigError, match="no Dask scheduler answers"),
    ):
        next(start(jobs(("nothing", 1.0)), "tcp://127.0.0.1:1"))


def test_workers_of_another_version_are_refused_before_anything_is_submitted(
    cluster: Any, tmp_path: Path
) -> None:
    given = jobs(("note_and_sleep", tmp_path))
    address = cluster.scheduler_address
    results = run_dask(
        act, given, address=address, queue=None, n_jobs=2, limits=LIMITS, version=os.getpid
    )  # every process has its own
    with pytest.raises(ConfigError, match="2 of 2 Dask workers run another version of uavexp"):
        next(results)
    assert not list(tmp_path.iterdir())


def test_packages_that_differ_are_named_with_both_versions() -> None:
    packages = {"python": "3.11.7", "numpy": "2.0", "lz4": None}
    other = {"packages": {**packages, "numpy": "1.26"}}
    versions = {
        "client": {"packages": packages},
        "scheduler": {"packages": packages},
        "workers": {"a": other},
    }
    assert differing_packages(versions) == ["numpy 1.26 there, 2.0 here"]
    assert differing_packages({**versions, "workers": {}}) == []


def test_a_cluster_and_a_queue_are_one_too_many(capsys: pytest.CaptureFixture[str]) -> None:
    both = ("runner.address=tcp://127.0.0.1:1", "runner.queue=slurm", "runner.n_jobs=2")
    assert main([*STUDY, "runner=dask", *both]) == 2
    assert "not both" in capsys.readouterr().err


def test_slurm_is_asked_for_one_worker_a_job_with_room_for_a_trial() -> None:
    pytest.importorskip("dask_jobqueue")
    with slurm_cluster(LIMITS) as cluster:
        script = cluster.job_script()
    assert "#SBATCH --cpus-per-task=1" in script
    assert "#SBATCH --mem=3G" in script
