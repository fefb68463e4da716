"""What messages of poses have in common, whoever defines them: rows of a topic, and which topic it is."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import ConfigError, RecordError
from uavexp.geometry import rotation_from_quaternion
from uavexp.judge.recording import Plan, Recording, Track
from uavexp.parameters import nearest

Row = tuple[Float, Float | None, Float | None]  # position m, quaternion, velocity m/s, of the world
_BODIES = ("base_link", "body", "base_footprint")  # frames of a vehicle, the likeliest first
_MOST_TOLD = 12


def xyz(vector: Any) -> Float:
    """A vector of three."""
    return np.array([vector.x, vector.y, vector.z], dtype=np.float64)


def pose(message: Any) -> Row:
    """Position and orientation."""
    return xyz(message.position), _wxyz(message.orientation), None


def transform(message: Any) -> Row:
    """Translation and rotation."""
    return xyz(message.translation), _wxyz(message.rotation), None


def odometry(where: Any, body_mps: Any) -> Row:
    """A pose with the velocity of the body in its own frame (REP 145)."""
    position, quaternion = xyz(where.position), _wxyz(where.orientation)
    return position, quaternion, rotation_from_quaternion(quaternion) @ xyz(body_mps)


def topic_of(
    path: Path, kinds: Mapping[str, str], positions: Collection[str], asked: str | None
) -> tuple[str, str]:
    """The topic that tells positions, and a frame if one was asked for with it.

    Args:
        path: for errors.
        kinds: of message by topic.
        positions: kinds that tell positions, the likeliest first.
        asked: a topic, or TOPIC:FRAME; None: the only one of the likeliest kind.

    Raises:
        ConfigError: it tells none, or several might be meant.
        RecordError: there is none.
    """
    told = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(kinds.items())[:_MOST_TOLD]) or "no topic"
    if asked is not None:
        topic, _, frame = asked.partition(":")
        if kinds.get(topic) not in positions:
            raise ConfigError(f"{path}: {topic} tells no positions{nearest(topic, kinds)}; it has {told}")
        return topic, frame
    for kind in positions:
        found = sorted(topic for topic, its in kinds.items() if its == kind and topic != "/tf_static")
        if len(found) == 1:
            return found[0], ""
        if found:
            raise ConfigError(f"{path}: {', '.join(found)} tell positions; name one with --topic")
    raise RecordError(f"{path}: no position: no topic of {', '.join(positions)}; it has {told}")


def body_of(topic: str, frames: Sequence[str]) -> str:
    """The vehicle among the frames that a topic of transforms moves.

    Raises:
        ConfigError: several might be it.
    """
    known = [name for name in _BODIES if name in frames] or list(frames)
    if len(frames) > 1 and known == list(frames):
        told = ", ".join(frames[:_MOST_TOLD])
        raise ConfigError(f"{topic} moves {told}; name one with --topic {topic}:FRAME")
    return known[0] if known else ""


def recording_of(
    path: Path, source: str, times_s: Float, rows: Sequence[Row], plans: tuple[Plan, ...] | None = None
) -> Recording:
    """Rows of one topic as a recording.

    Raises:
        RecordError: there is none.
    """
    if not rows:
        raise RecordError(f"{path}: no position: {source} has no message")
    position, quaternion, velocity = (
        None if part[0] is None else Track(time_s=times_s, values=np.array(part))
        for part in zip(*rows, strict=True)
    )
    assert position is not None
    return Recording(
        path=path,
        source=source,
        position_m=position,
        quaternion_wxyz=quaternion,
        velocity_mps=velocity,
        plans=plans,
    )


def _wxyz(quaternion: Any) -> Float:
    return np.array([quaternion.w, quaternion.x, quaternion.y, quaternion.z], dtype=np.float64)
