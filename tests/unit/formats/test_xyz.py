"""Clouds as text: every way to write the same rows."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.formats import only_world_errors
from uavexp.errors import WorldError
from uavexp.formats import Options, read

POINTS = np.array([[1.5, -2.0, 0.25], [4.0, 5.5, 6.0], [-7.0, 8.0, 9e-3]])
ROWS = ["1.5 -2.0 0.25", "4 5.5 6.0", "-7 8. 9E-3"]
BLANKS, COMMAS, MARKS = "\n".join(ROWS), "\n".join(ROWS).replace(" ", ","), "\n".join(ROWS).replace(" ", ";")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.xyz", BLANKS),
        ("a.XYZ", BLANKS + "\n\n"),
        ("a.txt", "\ufeff" + BLANKS.replace("\n", "\r\n")),
        ("a.asc", "  " + BLANKS.replace(" ", "\t  ").replace("\n", "  \n ")),
        ("a.xyz", COMMAS),
        ("a.xyz", COMMAS.replace(",", ", ")),
        ("a.xyz", MARKS),
        ("a.xyz", MARKS.replace(".", ",")),
        ("a.xyz", "# made by hand\n\n" + ROWS[0] + " # first\n# second\n" + "\n".join(ROWS[1:])),
        ("a.txt", "//X Y Z\n3\n" + BLANKS),  # CloudCompare
        ("a.txt", "x,y,z,r\n" + COMMAS.replace("\n", ",0\n") + ",0"),
        ("a.txt", "label z x y\n" + "\n".join(f"wall {z} {x} {y}" for x, y, z in map(str.split, ROWS))),
        ("a.xyz", "\n".join(f"{row} 255 0 0 leaf" for row in ROWS)),
        ("a.pts", "3\n" + "\n".join(f"{row} -120 255 0 0" for row in ROWS)),
        ("a.pts", f"1\n{ROWS[0]} 7\n2\n{ROWS[1]} 7\n{ROWS[2]} 7\n"),
    ],
)
def test_every_way_to_write_the_rows(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text, newline="")
    np.testing.assert_allclose(read(tmp_path / name, Options()).points, POINTS, rtol=1e-12)


def test_rows_that_are_not_finite_are_dropped_with_a_word(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text(f"{ROWS[0]}\nnan nan nan\n{ROWS[1]}\n-inf 0 0\n{ROWS[2]}\n")
    content = read(tmp_path / "a.xyz", Options())
    np.testing.assert_allclose(content.points, POINTS)
    assert "2 of 5" in content.warnings[0]


@pytest.mark.parametrize(
    ("name", "text", "word"),
    [
        ("a.pts", "4\n" + BLANKS, "4 points promised, 3 found"),
        ("a.pts", "2\n" + BLANKS, "2 points promised, 3 found"),
        ("a.xyz", BLANKS[:-6], "truncated"),
        ("a.xyz", "1 2 3 4 5 6\n1 2 3 4 5\n", "truncated"),
        ("a.xyz", "1 2 3\n1 b 3\n1 2 3", "damaged"),
        ("a.xyz", "1 2 3\n1 2\n1 2 3", "damaged"),
        ("a.xyz", "1 2\n3 4\n", "no cloud"),
        ("a.txt", "Dear reader,\nthis is no cloud\n", "no cloud"),
        ("a.xyz", "nan nan nan\n", "no valid points"),
        ("a.xyz", "# nothing else\n", "no cloud"),
        ("a.xyz", "\0" * 500, "no cloud"),
    ],
)
def test_other_text_is_one_line(tmp_path: Path, name: str, text: str, word: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(WorldError, match=word) as error:
        read(tmp_path / name, Options())
    assert "\n" not in str(error.value)


@settings(max_examples=50, deadline=None)
@given(place=st.integers(0), byte=st.integers(0, 255), name=st.sampled_from(["a.xyz", "a.pts"]))
def test_damaged_bytes_end_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, place: int, byte: int, name: str
) -> None:
    path = tmp_path_factory.mktemp("xyz") / name
    path.write_text(("3\n" if name == "a.pts" else "") + BLANKS)
    only_world_errors(path, place, byte)
