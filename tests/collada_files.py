"""COLLADA files of a cube, with faces of every kind."""

import numpy as np

from tests.shaped_meshes import CUBE, QUADS, TRIANGLES


def words(values: np.ndarray) -> str:
    return " ".join(f"{value:g}" for value in np.ravel(values))


def inputs(step: int = 1) -> str:
    """The vertices' input, and before it others that say nothing of the shape."""
    others = "".join(f'<input semantic="N" source="#n" offset="{place}"/>' for place in range(step - 1))
    return f'{others}<input semantic="VERTEX" source="#v" offset="{step - 1}"/>'


def between(corners: np.ndarray, step: int) -> str:
    """Indices of corners, with others of another input before each."""
    return words(np.column_stack([np.full((corners.size, step - 1), 99), corners.reshape(-1)]))


def triangles(step: int = 1, corners: np.ndarray = TRIANGLES) -> str:
    faces = f"<p>{between(corners, step)}</p>"
    return f'<triangles count="{corners.size // 3}">{inputs(step)}{faces}</triangles>'


def polylist(step: int = 1) -> str:
    faces = f"<vcount>{words(np.full(6, 4))}</vcount><p>{between(QUADS, step)}</p>"
    return f'<polylist count="6">{inputs(step)}{faces}</polylist>'


def polygons(step: int = 1) -> str:
    faces = "".join(f"<p>{between(quad, step)}</p>" for quad in QUADS)
    return f'<polygons count="6">{inputs(step)}{faces}</polygons>'


def strips(step: int = 1) -> str:
    faces = "".join(f"<p>{between(quad[[0, 1, 3, 2]], step)}</p>" for quad in QUADS)
    return f'<tristrips count="6">{inputs(step)}{faces}</tristrips>'


def fans(step: int = 1) -> str:
    faces = "".join(f"<p>{between(quad, step)}</p>" for quad in QUADS)
    return f'<trifans count="6">{inputs(step)}{faces}</trifans>'


NODE = '<node><instance_geometry url="#cube"/></node>'


def dae(
    faces: str | None = None,
    nodes: str = NODE,
    asset: str = "",
    libraries: str = "",
    vertices: np.ndarray = CUBE,
) -> str:
    """A file of a cube, or of vertices (3 F, 3) that are each their own."""
    if faces is None:
        faces = triangles() if vertices is CUBE else triangles(1, np.arange(len(vertices)))
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{asset}</asset>
<library_images><image id="i"><init_from>nowhere.png</init_from></image></library_images>
<library_geometries><geometry id="cube"><mesh>
<source id="p"><float_array id="a" count="{vertices.size}">{words(vertices)}</float_array>
<technique_common><accessor source="#a" count="{len(vertices)}" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
{faces}
</mesh></geometry></library_geometries>{libraries}
<library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
