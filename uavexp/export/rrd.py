"""A flight as a Rerun recording: vehicle, reference, map, plans and causes on the timeline `flight`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr

from uavexp.export import moments
from uavexp.export.map_voxels import mapped_until_m, spacing_m
from uavexp.log import TrialLog
from uavexp.store.stored_trial import StoredTrial

TIMELINE = "flight"  # seconds since the start


def write(trial: StoredTrial, file: Path) -> Sequence[Path]:
    """Write the recording."""
    recording = rr.RecordingStream("uavexp", recording_id=trial.name)
    recording.save(file)
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _poses(trial.log, recording)
    _maps(trial.log, recording)
    _plans(trial.log, recording)
    recording.flush()
    recording.disconnect()
    return [file]


def _poses(log: TrialLog, recording: rr.RecordingStream) -> None:
    rows = moments.rows_at(log, moments.POSE_HZ)
    steps, time = log.steps, rr.TimeColumn(TIMELINE, duration=log.steps.time_s[rows])
    poses = rr.Transform3D.columns(
        translation=steps.position_m[rows], quaternion=steps.quaternion_wxyz[rows][:, [1, 2, 3, 0]]
    )
    recording.send_columns("world/vehicle", indexes=[time], columns=poses)
    recording.log("world/vehicle/body", rr.Boxes3D(half_sizes=[[0.2, 0.2, 0.05]]), static=True)
    recording.log("world/flown", rr.LineStrips3D([steps.position_m[rows]], colors=[0, 114, 178]), static=True)
    figures = {
        "clearance_m": steps.clearance_m[rows],
        "speed_mps": np.linalg.norm(steps.velocity_mps[rows], axis=1),
    }
    for name, values in figures.items():
        recording.send_columns(f"figures/{name}", indexes=[time], columns=rr.Scalars.columns(scalars=values))


def _maps(log: TrialLog, recording: rr.RecordingStream) -> None:
    radius_m = 0.5 * spacing_m(log.mapped_m.reshape(-1, 3).astype(np.float64))
    for time_s in moments.map_times_s(log).tolist():
        recording.set_time(TIMELINE, duration=time_s)
        recording.log("world/map", rr.Points3D(mapped_until_m(log, time_s), radii=radius_m))


def _plans(log: TrialLog, recording: rr.RecordingStream) -> None:
    for change in moments.plan_changes(log):
        colour = [round(255 * share) for share in moments.colour_rgb(change.colour)]
        recording.set_time(TIMELINE, duration=change.time_s)
        recording.log("causes", rr.TextLog(change.words))
        recording.log(
            f"world/replans/{change.cause}", rr.Points3D([change.position_m], colors=colour, radii=0.12)
        )
        if np.isfinite(change.effective_s) and len(change.trajectory_m):
            recording.set_time(TIMELINE, duration=change.effective_s)
            recording.log("world/plan", rr.LineStrips3D([change.trajectory_m], colors=colour))
