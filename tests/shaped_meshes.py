"""A mesh by its facts: what a reader must have kept, whatever order it gave corners and triangles."""

import numpy as np

from uavexp.formats import Content

# a unit cube's corners, and its faces as quads, turned outward
CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
TRIANGLES = QUADS[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def area_and_volume(content: Content) -> tuple[float, float]:
    """Area, and the volume inside by the divergence theorem (turned outward: positive)."""
    corners = content.vertices[content.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(normal, axis=1).sum()
    return float(area), float(np.einsum("ij,ij->", corners[:, 0], normal) / 6.0)


def check_is_cube(content: Content, side: float = 1.0) -> None:
    area, volume = area_and_volume(content)
    np.testing.assert_allclose([area, volume], [6.0 * side**2, side**3], rtol=1e-5)
    assert content.triangles.shape[0] == 12
    np.testing.assert_allclose(np.ptp(content.vertices, axis=0), side, rtol=1e-6)
