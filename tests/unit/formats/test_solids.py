"""Solids enclose the volume of their formula, from outside, turned outward."""

from pathlib import Path

import numpy as np
import pytest

from uavexp.formats import solids
from uavexp.formats.solids import Mesh

L_SHAPE = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh[0][mesh[1][:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        (solids.box(np.array([2.0, 3.0, 4.0])), 24.0),
        (solids.cylinder(2.0, 3.0), 12.0 * np.pi),
        (solids.cone(2.0, 3.0), 4.0 * np.pi),
        (solids.ellipsoid(np.array([1.0, 2.0, 3.0])), 8.0 * np.pi),
        (solids.capsule(1.0, 2.0), (2.0 + 4.0 / 3.0) * np.pi),
        (solids.prism(Path("here"), L_SHAPE, 2.0), 6.0),
        (solids.prism(Path("here"), L_SHAPE[::-1], 2.0), 6.0),
    ],
)
def test_volume_and_closed_surface(mesh: Mesh, expected: float) -> None:
    assert expected - 1e-9 <= volume(mesh) <= 1.01 * expected  # round ones a little outside
    vertices, triangles = mesh
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    assert np.linalg.norm(normals, axis=1).min() > 0.0
    np.testing.assert_allclose(normals.sum(axis=0), 0.0, atol=1e-9)  # closed
    moved = (vertices + np.array([3.0, -2.0, 5.0]), triangles)
    assert volume(moved) == pytest.approx(volume(mesh))


@pytest.mark.parametrize("mesh", [solids.cylinder(2.0, 9.0), solids.ellipsoid(np.full(3, 2.0))])
def test_round_solids_are_nowhere_smaller_than_their_radius(mesh: Mesh) -> None:
    a, b, c = (mesh[0][mesh[1][:, corner]] for corner in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    distance = np.einsum("ij,ij->i", normal, a)[np.abs(normal[:, 2]) < 1.0 - 1e-9]  # of the faces' planes
    assert distance.min() >= 2.0 - 1e-9
    assert distance.max() <= 1.01 * 2.0
