"""Damage that a file can suffer, drawn by hypothesis."""

import tempfile
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from uavexp import formats
from uavexp.errors import WorldError

# where it is cut, as a share of its length; bytes that replace those from a place on, as a share, too
DAMAGES = st.tuples(
    st.one_of(st.just(1.0), st.floats(0.0, 1.0)),
    st.lists(st.tuples(st.floats(0.0, 1.0), st.binary(min_size=1, max_size=4)), max_size=6),
)


def damaged(whole: bytes, damage: tuple[float, list[tuple[float, bytes]]]) -> bytes:
    share, patches = damage
    data = bytearray(whole)
    for place, patch in patches:
        begin = int(place * len(whole))
        data[begin : begin + len(patch)] = patch
    return bytes(data[: int(share * len(data))])


def check_ends_well(name: str, data: bytes) -> None:
    """A file of these bytes is read to something whole, or refused in one line that names it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        try:
            content = formats.read(path, formats.Options())
        except WorldError as error:
            refusal = str(error)
        else:
            return _check_whole(content)
    assert str(path) in refusal
    assert "\n" not in refusal


def _check_whole(content: formats.Content) -> None:
    assert np.isfinite(content.vertices).all()
    assert np.isfinite(content.points).all()
    if content.triangles.size:
        assert 0 <= content.triangles.min() <= content.triangles.max() < content.vertices.shape[0]
    else:
        assert content.points.size or content.cells is not None
