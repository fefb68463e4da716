"""What `pilot=holding` is told: the parameters of a pilot that flies plans as they come."""

from __future__ import annotations

from dataclasses import dataclass

from uavexp.parameters import Count, NonNegative, Positive, Whole


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """Parameters; no state."""

    settle_s: NonNegative = 0.5  # s, hovering and mapping before the first plan, or it is made
    # on a single scan [ours]
    recovers: bool = True  # whether a vehicle that fell behind, touches something or is held gets on by
    # itself; false: after the first plan only the trigger asks for one [ours]
    restart_error_m: NonNegative = 0.4  # m, tracking error at which the vehicle has fallen behind: it stops,
    # and a plan starts at the measured state instead of the reference; 0: every plan does [ours]
    held_s: NonNegative = 0.6  # s, held by the safety on a plan until another one is asked for [ours]
    fresh_goal: bool = (
        True  # whether a request takes the best goal now, else the one that the explorer keeps,
    )
    # however stale: with a slow clock this decides between arriving and not [ours]
    goals_per_request: Count = 3  # so many goals are tried before the vehicle brakes [ours]
    recover_after_s: Positive = 2.0  # s without a plan that leads on, until looking around, backing up and
    # the rest are tried, one after the other [ours]
    recoveries: Whole = 3  # so many places may be without a way on, with nothing new seen, until the vehicle
    # gives up [ours]
    back_up_m: NonNegative = 3.0  # m, of the way flown, along which it backs up at most [ours]
    back_up_clearance_m: Positive = 0.45  # m, the clearance of a place to back up to [ours]
    back_up_mps: Positive = 0.5  # m/s, of backing up [ours]
    lesser_clearance_m: NonNegative = 0.18  # m, tried at last, and never less than the body's half width and
    # 0.02 m; 0: not tried [ours]
    lesser_speed_mps: Positive = 0.3  # m/s, of such a plan [ours]
    look_around_radps: NonNegative = 0.8  # rad/s, turning on the spot while there is no plan:
    # only new sights can help [ours]
    turn_first_rad: NonNegative = 0.6  # rad, from standstill the vehicle turns until it looks this close
    # to its way (4: never) [ours]
    yaw_lookahead_s: NonNegative = 0.8  # s, the yaw looks at the path so far ahead [ours]
    glance_rad: NonNegative = 0.0  # rad, by which the yaw leaves the way at most, to look at a mover that
    # will come near, and all around as the flight comes to a rest; 0: never. Less than half the sensor's
    # view, or the way is not seen [ours]
