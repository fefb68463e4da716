"""Being inside of a solid is a contact, and a negative clearance, though no surface is met."""

import dataclasses

import numpy as np
import pytest

from uavexp.check.building import building
from uavexp.log import Contact
from uavexp.recorder import _inside_solids
from uavexp.scene import Scene
from uavexp.world.boxes import Boxes
from uavexp.world.solidity import space_of_mesh

STEP_S = 0.01


def test_clearance_is_negative_inside_of_a_solid() -> None:
    boxes = Boxes()
    boxes.shell((8.0, 6.0, 3.0))
    boxes.span((4.0, 2.0, 0.0), (6.0, 4.0, 2.0))
    vertices, triangles = boxes.mesh()
    world = dataclasses.replace(
        building(), vertices_m=vertices, triangles=triangles, space=space_of_mesh(vertices, triangles)
    )
    points = np.array([[3.0, 3.0, 1.0], [4.3, 3.0, 1.0], [5.0, 3.0, 1.4]])
    assert Scene(world).fixed_clearance_m(points) == pytest.approx([1.0, -0.3, -0.6], abs=1e-6)
    assert Scene.from_mesh(vertices, triangles).fixed_clearance_m(points) == pytest.approx([1.0, 0.3, 0.6])


def test_a_stretch_inside_of_a_solid_is_one_contact_unless_its_surface_was_met() -> None:
    clearance_m = np.array([0.5, -0.1, -0.2, 0.3, 0.4, -0.1])
    position_m = np.arange(18.0).reshape(6, 3)
    first, second = _inside_solids(clearance_m, position_m, (), STEP_S)
    assert (first.start_s, first.end_s, first.mover) == (0.01, 0.02, -1)
    assert (second.start_s, second.end_s) == (0.05, 0.05)
    np.testing.assert_array_equal(first.position_m, position_m[1])
    met = Contact(start_s=0.0, end_s=0.015, position_m=position_m[0])
    assert [item.start_s for item in _inside_solids(clearance_m, position_m, (met,), STEP_S)] == [0.05]
    mover = dataclasses.replace(met, mover=2)
    assert len(_inside_solids(clearance_m, position_m, (mover,), STEP_S)) == 2
    assert _inside_solids(np.full(6, 0.2), position_m, (), STEP_S) == []
