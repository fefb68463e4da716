"""Writes the small world of this folder: a flat of two rooms, 8 x 6 x 2.5 m, in every format.

A wall at x = 4 m divides it, with one door of 1.2 m between y = 4.4 and 5.6 m, open to the
ceiling. The same flat as mesh (ply, obj, stl, glb with y up), as voxels and points of its
surfaces 0.2 m apart (npz, pcd), and as a ROS map of 0.1 m. Run: python tests/data/make_flat.py
"""

import json
import struct
from pathlib import Path

import numpy as np

from uavexp.world.boxes import Boxes

HERE = Path(__file__).parent
SIZE = (8.0, 6.0, 2.5)
WALLS = (((3.9, 0.0, 0.0), (4.1, 4.4, 2.5)), ((3.9, 5.6, 0.0), (4.1, 6.0, 2.5)))


def flat() -> tuple[np.ndarray, np.ndarray]:
    boxes = Boxes()
    boxes.shell(SIZE)
    for low, high in WALLS:
        boxes.span(low, high)
    return boxes.mesh()


def write_ply(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.zeros(len(triangles), dtype=[("n", "u1"), ("t", "<i4", 3)])
    rows["n"], rows["t"] = 3, triangles
    path.write_bytes(head.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())


def write_obj(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    lines = [f"v {x:g} {y:g} {z:g}" for x, y, z in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in triangles + 1]
    path.write_text("\n".join(lines) + "\n")


def write_stl(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    rows = np.zeros(len(triangles), dtype=[("v", "<f4", (4, 3)), ("a", "<u2")])
    rows["v"][:, 1:] = vertices[triangles]
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(triangles)) + rows.tobytes())


def write_glb(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    y_up = vertices[:, [0, 2, 1]] * np.array([1.0, 1.0, -1.0])
    body = y_up.astype("<f4").tobytes() + triangles.astype("<u4").tobytes()
    split = 12 * len(vertices)
    scene = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(vertices),
                "type": "VEC3",
                "min": y_up.min(axis=0).tolist(),
                "max": y_up.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5125, "count": triangles.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": split},
            {"buffer": 0, "byteOffset": split, "byteLength": len(body) - split},
        ],
        "buffers": [{"byteLength": len(body)}],
    }
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(body), 0x004E4942) + body
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)


def surface_voxels(size: float) -> np.ndarray:
    """Indices of the voxels around the flat's air that belong to its walls."""
    shape = np.rint(np.array(SIZE) / size).astype(int) + 2  # one layer of wall all round
    grid = np.ones(shape, dtype=bool)
    grid[1:-1, 1:-1, 1:-1] = False
    for low, high in WALLS:
        a, b = (np.rint(np.array(corner) / size).astype(int) + 1 for corner in (low, high))
        grid[a[0] : max(b[0], a[0] + 1), a[1] : b[1], a[2] : b[2]] = True
    return np.argwhere(grid)


def main() -> None:
    vertices, triangles = flat()
    write_ply(HERE / "flat.ply", vertices, triangles)
    write_obj(HERE / "flat.obj", vertices, triangles)
    write_stl(HERE / "flat.stl", vertices, triangles)
    write_glb(HERE / "flat.glb", vertices, triangles)
    voxels = surface_voxels(0.2)
    np.savez_compressed(
        HERE / "flat_voxels.npz",
        occupied_index=voxels.astype(np.int16),
        origin=np.full(3, -0.2),
        resolution=0.2,
    )
    points = ((voxels - 0.5) * 0.2).astype("<f4")
    head = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n"
        f"COUNT 1 1 1\nWIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\n"
        "DATA binary\n"
    )
    (HERE / "flat.pcd").write_bytes(head.encode() + points.tobytes())
    plan = np.zeros((82, 62), dtype=bool)
    plan[[0, -1]] = plan[:, [0, -1]] = True
    plan[40:42, 1:45] = plan[40:42, 57:61] = True
    image = np.where(plan, 0, 254).astype(np.uint8).T[::-1]
    (HERE / "flat_map.pgm").write_bytes(b"P5\n# two rooms\n82 62\n255\n" + image.tobytes())
    (HERE / "flat_map.yaml").write_text(
        "image: flat_map.pgm\nresolution: 0.1\norigin: [-0.1, -0.1, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


if __name__ == "__main__":
    main()
