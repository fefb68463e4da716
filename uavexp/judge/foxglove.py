"""An MCAP of Foxglove's own messages (Protobuf), as `python -m uavexp.export --to mcap` writes it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from uavexp.judge.poses import Row, body_of, odometry, pose, recording_of, topic_of, transform
from uavexp.judge.recording import Recording

# the first kind that a file has tells positions
POSITIONS: dict[str, Callable[[Any], Row]] = {
    "foxglove.Odometry": lambda message: odometry(message.pose, message.linear_velocity),
    "foxglove.PoseInFrame": lambda message: pose(message.pose),
    "foxglove.FrameTransform": transform,
}


def read(path: Path, topic: str | None) -> Recording:
    """Read the topic asked for, else the only one of the likeliest kind."""
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        channels = {} if summary is None else summary.channels.values()
        kinds = {item.topic: summary.schemas[item.schema_id].name for item in channels if summary is not None}
        wanted, frame = topic_of(path, kinds, POSITIONS, topic)
        messages = [
            (item.message.log_time, item.decoded_message)
            for item in reader.iter_decoded_messages(topics=[wanted])
        ]
    source, kind = wanted, kinds[wanted]
    if kind == "foxglove.FrameTransform":
        frame = frame or body_of(wanted, sorted({item.child_frame_id for _, item in messages}))
        messages = [(time_ns, item) for time_ns, item in messages if item.child_frame_id == frame]
        source = f"{wanted}:{frame}"
    times_s = np.array([1e-9 * time_ns for time_ns, _ in messages])
    return recording_of(path, source, times_s, [POSITIONS[kind](item) for _, item in messages])
