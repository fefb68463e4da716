"""TSPLIB files: every form of a written matrix is read back, and every fault is one line."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.inspection.tsplib import TsplibError, read

FORMS = {  # indices of the matrix in the order in which a form writes them (Reinelt 1995, page 5)
    "FULL_MATRIX": lambda n: [(i, j) for i in range(n) for j in range(n)],
    "UPPER_ROW": lambda n: [(i, j) for i in range(n) for j in range(i + 1, n)],
    "LOWER_ROW": lambda n: [(i, j) for i in range(n) for j in range(i)],
    "UPPER_DIAG_ROW": lambda n: [(i, j) for i in range(n) for j in range(i, n)],
    "LOWER_DIAG_ROW": lambda n: [(i, j) for i in range(n) for j in range(i + 1)],
    "UPPER_COL": lambda n: [(i, j) for j in range(n) for i in range(j)],
    "LOWER_COL": lambda n: [(i, j) for j in range(n) for i in range(j + 1, n)],
    "UPPER_DIAG_COL": lambda n: [(i, j) for j in range(n) for i in range(j + 1)],
    "LOWER_DIAG_COL": lambda n: [(i, j) for j in range(n) for i in range(j, n)],
}


def write(folder: Path, *lines: str) -> Path:
    file = folder / "some.tsp"
    file.write_text("\n".join(lines) + "\n")
    return file


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("nodes", [1, 2, 5])
def test_a_written_matrix_is_read_back_in_every_form(tmp_path, form, nodes):
    half = np.triu(np.random.default_rng(nodes).integers(1, 99, (nodes, nodes)), 1)
    matrix = half + half.T
    words = [str(matrix[place]) for place in FORMS[form](nodes)]
    lines = [" ".join(words[n : n + 4]) for n in range(0, len(words), 4)]  # rows end anywhere
    header = [
        "TYPE : TSP",
        f"DIMENSION: {nodes}",
        "EDGE_WEIGHT_TYPE: EXPLICIT",
        f"EDGE_WEIGHT_FORMAT: {form}",
    ]
    file = write(tmp_path, *header, "EDGE_WEIGHT_SECTION", *lines, "DISPLAY_DATA_SECTION", "1 0.0 0.0", "EOF")
    np.testing.assert_array_equal(read(file), matrix)


def test_distances_of_coordinates_follow_their_formulas(tmp_path):
    nodes = ["1 0 0", "2 3.0e0 4", "3 1 1"]
    for kind, expected in {
        "EUC_2D": [5, 1, 4],  # 1.414 and 3.606 to the nearest
        "CEIL_2D": [5, 2, 4],
        "ATT": [2, 1, 2],  # sqrt(25 / 10), sqrt(2 / 10), sqrt(13 / 10), rounded up
        "GEO": [556, 157, 400],  # about 111.3 km a degree
    }.items():
        file = write(tmp_path, "DIMENSION:3", f"EDGE_WEIGHT_TYPE:{kind}", "NODE_COORD_SECTION", *nodes)
        cost = read(file)
        found = [cost[0, 1], cost[0, 2], cost[1, 2]]
        np.testing.assert_allclose(found, expected, rtol=0.01 if kind == "GEO" else 0)


HEADER = [
    "DIMENSION: 2",
    "EDGE_WEIGHT_TYPE: EXPLICIT",
    "EDGE_WEIGHT_FORMAT: FULL_MATRIX",
    "EDGE_WEIGHT_SECTION",
]


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ([*HEADER, "0 1 2 0"], "FULL_MATRIX must be symmetric"),
        ([*HEADER, "0 1 1"], "EDGE_WEIGHT_SECTION must hold 4 numbers, got 3"),
        ([*HEADER, "0 a a 0"], "EDGE_WEIGHT_SECTION must hold numbers"),
        ([*HEADER, "0 nan nan 0"], "must hold finite numbers"),
        (["TYPE: ATSP", *HEADER, "0 1 1 0"], "TYPE must be TSP, got ATSP"),
        (["DIMENSION: 2"], "EDGE_WEIGHT_TYPE must be one of EUC_2D, CEIL_2D, ATT, GEO, EXPLICIT, got none"),
        (["EDGE_WEIGHT_TYPE: ATT", "DIMENSION: 99999999999"], "DIMENSION must be 1 to 8000"),
        (["EDGE_WEIGHT_TYPE: ATT", "DIMENSION: ²"], "DIMENSION must be 1 to 8000"),
        (["EDGE_WEIGHT_TYPE: MAX_3D", "DIMENSION: 2"], "got MAX_3D"),
        ([*HEADER[:2], "EDGE_WEIGHT_FORMAT: FUNCTION"], "EDGE_WEIGHT_FORMAT must be one of FULL_MATRIX"),
    ],
)  # fmt: skip
def test_faults_are_named_in_one_line(tmp_path, lines, says):
    with pytest.raises(TsplibError, match=says):
        read(write(tmp_path, *lines))


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=300), st.integers(0, 60))
def test_no_file_makes_reading_fail_otherwise(tmp_path_factory, noise, at):
    whole = "\n".join([*HEADER, "0 1 1 0", "EOF"]).encode()
    file = tmp_path_factory.mktemp("tsp") / "noisy.tsp"
    file.write_bytes(whole[:at] + noise + whole[at:])
    with contextlib.suppress(TsplibError):
        assert np.isfinite(read(file)).all()
