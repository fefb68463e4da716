"""Replanning on a predicted encounter with a mover: equations (4-1) to (4-4) of paper 2.

    v_rel = v_uav - v_obs                               (4-1)
    d_safe = ‖v_rel‖ t_th + r_obs + δ                   (4-2)
    d_min = min ‖p - q‖, p on the path, q on the mover's predicted path, both within t_th   (4-3)
    replan if d_min < d_safe                            (4-4)
    or if the predicted path enters the buffer δ around the vehicle's path (intrusion)

Here ‖p - q‖ - r_obs is the distance to the upright box around the mover, exact for a box and
safe for every other body. The path segments within t_th are a window that slides along with
the vehicle. Readings:

- `instant: any` is the formula: p and q need not be there at the same time. `same` (the default)
  compares them at the same instant, so a mover that has long passed is no risk.
- `speed: relative` is the formula: ‖v_rel‖ counts even for a mover that goes away. `closing` (the
  default) is what the paper's text means: the rate at which the distance shrinks where it is
  least, so nothing is added for a mover that is being passed.
- `radii: mover` is the formula; `both` (the default) adds the vehicle's own radius.
- `speed_s` is the t_th of (4-2). Literally 1.2 s, which makes d_safe 3.8 m at 2.5 m/s: no plan in
  a room clears that. The default is the time in which an answer takes effect: one check, the
  latency, and the onset of a turn. With δ equal to the planner's margin a new plan is free
  of risk, so the event clears itself; only a mover that the planner expects to turn at a wall, which
  is not asked here, can fire again.
- `min_interval_s`: a risk that no plan can clear (a mover that comes nearer than d_safe whatever is
  done) asks again after this time, not at every check: a new plan is of use only once the
  prediction has changed, and each one disturbs the flight.

`literal` parameters: instant any, speed relative, radii mover, speed_s 1.2, min_interval_s 0.
"""

from __future__ import annotations

import math
from dataclasses import field
from enum import StrEnum

import numba as nb
import numpy as np

from uavexp import causes
from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.parameters import NonNegative, Positive, option
from uavexp.planner.movers.moving import box_gap
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Decision, Limits, Observation

_SAMPLE_S = 0.02  # at 5 m/s relative speed 0.1 m: a distance of 0.5 m is right to 3 mm
_TIME_S = 1e-9  # times are sums of steps


class Instant(StrEnum):
    """Which instants of path and prediction are compared."""

    SAME = "same"
    ANY = "any"


class Speed(StrEnum):
    """Which speed makes the safe distance longer."""

    CLOSING = "closing"
    RELATIVE = "relative"


class Radii(StrEnum):
    """Whose radius counts."""

    BOTH = "both"
    MOVER = "mover"


@nb.njit(cache=True)
def approaches(
    path_m: Float, velocity_mps: Float, ahead_s: Float, position_m: Float, drift_mps: Float, half_m: Float,
    same: bool, swerve_m: Float,
) -> Float:  # fmt: skip
    """Least distance to each mover, and relative and closing speed there, as rows (B, 3).

    Args:
        path_m: (N, 3) samples of the vehicle's path.
        velocity_mps: (N, 3) its velocity there.
        ahead_s: (N,) time of each sample from the movers' time.
        position_m: (B, 3) of the movers.
        drift_mps: (B, 3) their velocities.
        half_m: (B, 3) of the boxes around them.
        same: whether path and prediction are compared at the same instant only.
        swerve_m: (B, N, 3) by how much the movers will be elsewhere than at these velocities; (B, 0, 3): not.
    """
    found = np.zeros((position_m.shape[0], 3))
    for b in range(position_m.shape[0]):
        least, at_path, at_mover = np.inf, 0, 0
        for n in range(path_m.shape[0]):
            for m in range(n if same else 0, n + 1 if same else path_m.shape[0]):
                x = path_m[n, 0] - position_m[b, 0] - ahead_s[m] * drift_mps[b, 0]
                y = path_m[n, 1] - position_m[b, 1] - ahead_s[m] * drift_mps[b, 1]
                z = path_m[n, 2] - position_m[b, 2] - ahead_s[m] * drift_mps[b, 2]
                if swerve_m.shape[1] > 0:
                    x, y, z = x - swerve_m[b, m, 0], y - swerve_m[b, m, 1], z - swerve_m[b, m, 2]
                gap = box_gap(half_m[b, 0], half_m[b, 1], half_m[b, 2], x, y, z)
                if gap < least:
                    least, at_path, at_mover = gap, n, m
        squared, towards, away = 0.0, 0.0, 0.0
        next_ = min(at_mover + 1, swerve_m.shape[1] - 1)
        for axis in range(3):
            speed = velocity_mps[at_path, axis] - drift_mps[b, axis]
            offset = path_m[at_path, axis] - position_m[b, axis] - ahead_s[at_mover] * drift_mps[b, axis]
            if next_ > 0:
                offset -= swerve_m[b, at_mover, axis]
                turn_m = swerve_m[b, next_, axis] - swerve_m[b, next_ - 1, axis]
                speed -= turn_m / (ahead_s[next_] - ahead_s[next_ - 1])
            squared += speed * speed
            towards -= speed * offset
            away += offset * offset
        found[b, 0] = least
        found[b, 1] = math.sqrt(squared)
        found[b, 2] = max(towards, 0.0) / math.sqrt(away) if away > 0.0 else found[b, 1]
    return found


@option
class Risk:
    """Replans when the flown path and a mover's predicted path come too near to each other."""

    horizon_s: Positive = 1.2  # s, t_th: path and prediction are compared so far ahead (paper 2)
    margin_m: NonNegative = 0.5  # m, delta (paper 2); planner.mover_margin_m is the same,
    # so a new plan clears the event, unless the mover turns at a wall
    speed_s: NonNegative = 0.2  # s, safe distance per speed; the paper's is t_th, 1.2 s, which no plan clears
    # [ours: a check, the latency, the onset of a turn]
    instant: Instant = Instant.SAME  # same: at the same instant [ours] | any:
    # wherever the paths come near (eq. 4-3)
    speed: Speed = Speed.CLOSING  # closing: what the distance shrinks by [ours] | relative:
    # the norm of v_rel (eq. 4-2)
    radii: Radii = Radii.BOTH  # both: the vehicle's radius, too [ours] | mover (eq. 4-2)
    min_interval_s: NonNegative = 0.3  # s, between two events: a risk that no plan clears does not fire at
    # every check [ours]
    _radius_m: float = field(init=False, repr=False, default=0.0)
    _trajectory: Trajectory | None = field(init=False, repr=False, default=None)
    _fired_s: float = field(init=False, repr=False, default=-math.inf)

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""
        self._radius_m = limits.body_radius_m if self.radii is Radii.BOTH else 0.0
        self._trajectory, self._fired_s = None, -math.inf

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Watch the new plan; it takes effect at its start, until then the one before is flown."""
        self._trajectory = trajectory

    def decide(self, observation: Observation) -> Decision:
        """Replan when d_min < d_safe for any mover."""
        trajectory, now_s = self._trajectory, observation.time_s
        if trajectory is None or now_s < trajectory.start_s - _TIME_S or not len(observation.tracks):
            return Decision(replan=False)
        score = self.score(observation)
        if score <= 1.0 or now_s - self._fired_s < self.min_interval_s - _TIME_S:
            return Decision(replan=False, score=score)
        self._fired_s = now_s
        return Decision(replan=True, cause=causes.RISK.name, score=score)

    def score(self, observation: Observation) -> float:
        """Largest d_safe over d_min of any mover, distances taken from its surface; more than 1 fires.

        Held within [0, 100]: a mover that is touched has no d_min.
        """
        trajectory, tracks = observation.trajectory, observation.tracks
        if trajectory is None:
            return 0.0
        times_s = observation.time_s + np.arange(0.0, self.horizon_s + _TIME_S, _SAMPLE_S)
        path_m, velocity_mps, _ = evaluate(trajectory, times_s)
        found = approaches(
            path_m, velocity_mps, times_s - tracks.time_s, tracks.position_m, tracks.velocity_mps,
            tracks.half_size_m, self.instant is Instant.SAME, tracks.swerved_m(times_s),
        )  # fmt: skip
        speed_mps = found[:, 2 if self.speed is Speed.CLOSING else 1]
        safe_m = speed_mps * self.speed_s + self._radius_m + self.margin_m
        return float(np.clip(safe_m / np.maximum(found[:, 0], 1e-9), 0.0, 100.0).max())
