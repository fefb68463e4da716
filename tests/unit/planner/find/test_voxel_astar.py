"""Plain voxel A*: exact against Dijkstra and published optima; its command; what movers block."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.folders import SHARED
from tests.voxel_paths import is_path, random_grid, shortest
from uavexp.check.fields import box, empty, field_from
from uavexp.check.hall import LIMITS
from uavexp.check.requests import ask
from uavexp.errors import ConfigError
from uavexp.planner.astar import Astar
from uavexp.planner.find.voxels.canonical import BUDGET
from uavexp.planner.find.voxels.moves import FULL, LENGTHS, STAY, STEPS, canonical_moves, open_moves
from uavexp.planner.find.voxels.published import main, read_map, read_scenarios
from uavexp.planner.find.voxels.voxel_grid import VoxelGrid
from uavexp.types import PlanStatus, Tracks

DATA = SHARED / "voxel_path"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason=f"no benchmark at {DATA}")


@pytest.mark.parametrize("density", [0.1, 0.3, 0.5])
def test_cost_is_the_least_by_dijkstra(density: float) -> None:
    rng = np.random.default_rng(3)
    solved = 0
    for _ in range(40):
        free, start, goal = random_grid(rng, (6, 7, 5), density)
        found = VoxelGrid(free).shortest(np.array(start), np.array(goal))
        least = shortest(free, start, goal)
        assert found.cost == pytest.approx(least, abs=1e-9)
        if found.found:
            solved += 1
            assert tuple(found.cells[0]) == start
            assert tuple(found.cells[-1]) == goal
            assert is_path(free, found.cells)
            length = np.linalg.norm(np.diff(found.cells, axis=0), axis=1).sum()
            assert length == pytest.approx(found.cost, abs=1e-9)
    assert solved >= 20


def test_long_straight_runs_cross_words_and_stop_at_the_goal() -> None:
    free = np.ones((3, 3, 200), dtype=bool)
    for shape in ((3, 3, 200), (3, 200, 3), (200, 3, 3)):
        grid = VoxelGrid(np.ones(shape, dtype=bool))
        axis = int(np.argmax(shape))
        for a, b in ((0, 199), (199, 0), (63, 64), (130, 1), (64, 128)):
            ends = np.ones((2, 3), dtype=np.int64)
            ends[0, axis], ends[1, axis] = a, b
            assert grid.shortest(ends[0], ends[1]).cost == abs(a - b)
    free[:, :, 100] = False
    assert not VoxelGrid(free).shortest(np.array([1, 1, 0]), np.array([1, 1, 199])).found


def test_in_open_space_a_move_goes_on_to_its_parts_only() -> None:
    for arrived in range(27):
        if arrived == STAY:
            continue
        inside = (np.abs(STEPS) <= np.abs(STEPS[arrived])) & (STEPS * STEPS[arrived] >= 0)
        parts = {int(n) for n in np.flatnonzero(inside.all(axis=1)) if n != STAY}
        assert {n for n in range(27) if canonical_moves(arrived, FULL) >> n & 1} == parts


def test_moves_cut_no_corner() -> None:
    blocked = FULL ^ (1 << 22)  # the cell ahead along x
    allowed = {n for n in range(27) if open_moves(blocked) >> n & 1}
    assert allowed == {n for n in range(27) if n != STAY and STEPS[n, 0] < 1}
    assert LENGTHS[26] == pytest.approx(np.sqrt(3.0))


def test_start_at_the_goal_blocked_ends_and_the_budget() -> None:
    free = np.ones((5, 5, 5), dtype=bool)
    free[2, 2, 2] = False
    grid = VoxelGrid(free)
    corner, far, wall = np.array([0, 0, 0]), np.array([4, 4, 4]), np.array([2, 2, 2])
    here = grid.shortest(corner, corner)
    assert (here.cost, here.cells.tolist()) == (0.0, [[0, 0, 0]])
    assert not grid.shortest(corner, wall).found
    assert not grid.shortest(wall, corner).found
    assert grid.shortest(corner, far, max_expansions=1).status == BUDGET


@needs_data
def test_the_command_finds_published_optima(capsys: pytest.CaptureFixture[str]) -> None:
    files = [str(DATA / "Simple.npz"), str(DATA / "Simple.3dmap.3dscen")]
    assert main([*files, "--limit", "100"]) == 0
    line = capsys.readouterr().out
    answer = json.loads(line)
    assert line.count("\n") == 1
    assert list(answer) == ["problems", "optimal", "expansions", "median_ms"]
    assert (answer["problems"], answer["optimal"]) == (100, 100)


@needs_data
def test_published_optima_of_the_large_map() -> None:
    free = read_map(DATA / "A1.npz")
    problems = read_scenarios(DATA / "A1.3dmap.3dscen", free)
    problems = problems[problems[:, 6] < 200.0][:40]
    grid = VoxelGrid(free)
    ends = problems[:, :6].astype(np.int64)
    costs = [grid.shortest(row[:3], row[3:]).cost for row in ends]
    np.testing.assert_allclose(costs, problems[:, 6], atol=1e-6)


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A good map and a scenario file whose one cost is the square root of three."""
    np.savez(tmp_path / "map.npz", size=np.array([4, 4, 4]), blocked=np.array([[3, 3, 3]]))
    scenario = tmp_path / "some.3dscen"
    scenario.write_text("version 1\nmap\n0 0 0 1 1 1 1.73205081 1.0\n")
    return tmp_path / "map.npz", scenario


def test_a_wrong_cost_is_exit_code_1(files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    names = [str(file) for file in files]
    assert main(names) == 0
    files[1].write_text(files[1].read_text() + "0 0 0 2 0 0 2.5 1.0\n")
    assert main(names) == 1
    assert json.loads(capsys.readouterr().out.splitlines()[1])["optimal"] == 1


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "version"),
        ("version 1\nmap\n", "no problem"),
        ("version 1\nmap\n0 0 0 1 1\n", "line 3"),
        ("version 1\nmap\n0 0 0 1 1 x 1.0 1.0\n", "line 3"),
        ("version 1\nmap\n0 0 0 1 1 nan 1.0 1.0\n", "line 3"),
        ("version 1\nmap\n0 0 0 9 1 1 1.0 1.0\n", "outside"),
        ("version 1\nmap\n0 0 0 3 3 3 1.0 1.0\n", "blocked"),
    ],
)
def test_bad_scenarios_are_one_line_and_exit_code_2(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str], text: str, word: str
) -> None:
    files[1].write_text(text)
    assert main([str(file) for file in files]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert word in error


@pytest.mark.parametrize(
    "arrays",
    [
        {},
        {"size": np.array([4, 4]), "blocked": np.zeros((1, 3), dtype=int)},
        {"size": np.array([4, 4, 4]), "blocked": np.array([[4, 0, 0]])},
        {"size": np.array([4, 4, 4]), "blocked": np.array([[0.5, 0, 0]])},
        {"size": np.array([10**7, 10**7, 10**7]), "blocked": np.zeros((0, 3), dtype=int)},
    ],
)
def test_bad_maps_are_one_line_and_exit_code_2(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str], arrays: dict[str, np.ndarray]
) -> None:
    np.savez(files[0], **arrays)
    assert main([str(file) for file in files]) == 2
    assert capsys.readouterr().err.startswith("error: ")
    files[0].write_bytes(b"no zip")
    assert main([str(file) for file in files]) == 2
    assert main(["nowhere.npz", str(files[1])]) == 2


def test_it_runs_as_a_module(files: tuple[Path, Path]) -> None:
    command = [sys.executable, "-m", "uavexp.planner.astar", *map(str, files), "--limit", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["problems"] == 1


def crossing(velocity: tuple[float, float, float], **changes: object) -> tuple[PlanStatus, np.ndarray]:
    """Path through a hall with a mover in the middle of it."""
    grid = empty((8.0, 5.0, 2.0))
    box(grid, (0.0, 0.0, 0.0), (8.0, 0.3, 2.0))
    request = ask(field_from(grid), np.array([1.0, 2.5, 1.0]), np.array([7.0, 2.5, 1.0]))
    tracks = Tracks(
        time_s=request.time_s,
        identity=np.array([0]),
        position_m=np.array([[4.0, 2.5, 1.0]]),
        velocity_mps=np.array([velocity]),
        covariance=np.zeros((1, 6, 6)),
        half_size_m=np.full((1, 3), 0.3),
    )
    planner = Astar(**changes)  # type: ignore[arg-type]
    planner.reset(LIMITS, np.random.default_rng(0))
    result = planner.plan(replace(request, tracks=tracks))
    return result.status, result.path_m


def test_movers_block_where_they_are_whatever_they_do() -> None:
    standing, moving = crossing((0.0, 0.0, 0.0)), crossing((0.0, 2.0, 0.0))
    assert standing[0] is moving[0] is PlanStatus.OK
    np.testing.assert_array_equal(standing[1], moving[1])
    near = np.linalg.norm(moving[1][1:-1] - [4.0, 2.5, 1.0], axis=1).min()
    assert near > 0.5  # goes round
    ahead = crossing((0.0, 2.0, 0.0), movers="predicted")
    assert ahead[0] is PlanStatus.OK
    assert np.abs(ahead[1][:, 1] - 2.5).max() < np.abs(moving[1][:, 1] - 2.5).max()  # it will be gone


def test_impossible_parameters_are_refused() -> None:
    for name, value in (("movers", "later"), ("unknown", "maybe"), ("z_band_m", -0.1)):
        with pytest.raises(ConfigError, match=name):
            Astar(**{name: value})
