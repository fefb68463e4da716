"""Where the parts of a Gazebo model or world stand: poses (SDFormat 1.4 to 1.11)."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from uavexp.arrays import Float
from uavexp.errors import WorldError
from uavexp.formats.number_text import numbers

OWN = ("", "__model__", "world", "__root__")  # names of the frame of what holds a pose


def pose_matrix(path: Path, pose: Element | None) -> Float:
    """Return the matrix (4, 4) of a pose: x y z and roll pitch yaw, or a quaternion x y z w."""
    matrix = np.eye(4)
    if pose is None or not (pose.text or "").strip():
        return matrix
    if pose.get("rotation_format") == "quat_xyzw":
        values = numbers(path, pose.text or "", 7)
        if not values[3:].any():
            raise WorldError(f"world file {path} is damaged: a pose has the quaternion 0 0 0 0")
        turn = Rotation.from_quat(values[3:])
    else:
        values = numbers(path, pose.text or "", 6)
        turn = Rotation.from_euler("xyz", values[3:], degrees=pose.get("degrees") in ("true", "1"))
    matrix[:3, :3] = turn.as_matrix()
    matrix[:3, 3] = values[:3]
    return matrix


def placed(path: Path, scope: Element, item: Element, pose: Element | None = None) -> Float:
    """Return the matrix (4, 4) of an item in the frame of the model or world that holds it.

    Args:
        path: named in the errors.
        scope: what holds the item and the frames that its pose may be relative to.
        item: a model, link, collision ...
        pose: in place of its own.

    Raises:
        WorldError: the pose is relative to what the scope does not hold, or to itself.
    """
    matrix, seen = np.eye(4), set[str]()
    while True:
        pose = item.find("pose") if pose is None else pose
        matrix = pose_matrix(path, pose) @ matrix
        relative = "" if pose is None else pose.get("relative_to", pose.get("frame", ""))
        relative = relative or item.get("attached_to", "")
        if relative in OWN:
            return matrix
        other = next((held for held in scope if held.get("name") == relative), None)
        if other is None or relative in seen or other is item:
            raise WorldError(
                f"world file {path} has a pose relative to {relative!r}, which is not beside it; "
                "give it relative to what holds it"
            )
        seen.add(relative)
        item, pose = other, None
