"""Social movers: the force against the paper's formula in complex numbers, and what comes of it."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from tests.unit.movers.test_movers import LIMITS, begin, room
from uavexp.movers.mixed import Mixed, Reaction
from uavexp.movers.social import force_of, wall_force

__all__ = ["room"]
CROWD = {"count": 10, "reaction": Reaction.SOCIAL, "start_margin_m": 0.2}


@pytest.mark.parametrize("seed", range(20))
def test_force_is_that_of_the_paper(seed):
    rng = np.random.default_rng(seed)
    apart, relative = rng.uniform(-1.0, 1.0, 2), rng.uniform(-2.0, 2.0, 2)
    e = complex(*apart) / abs(complex(*apart))
    interaction = 2.0 * complex(*relative) + e
    t, reach = interaction / abs(interaction), 0.35 * abs(interaction)
    theta = cmath.phase(e / t) + 0.005 * reach
    strength = 4.5 * math.exp(-abs(complex(*apart)) / reach)
    expected = -strength * (
        math.exp(-((3.0 * reach * theta) ** 2)) * t
        + math.copysign(1.0, theta) * math.exp(-((2.0 * reach * theta) ** 2)) * 1j * t
    )
    expected -= 62.5 * max(0.4 - abs(complex(*apart)), 0.0) * e
    np.testing.assert_allclose(force_of(apart, relative, 0.0), [expected.real, expected.imag], atol=1e-12)


def test_one_that_is_met_ahead_slows_and_turns_aside_the_one_behind_does_nothing():
    ahead, behind = (force_of(np.array([x, 0.0]), np.array([1.0, 0.0]), 0.0) for x in (2.0, -2.0))
    assert (ahead < 0.0).all()  # back and to the right
    assert np.linalg.norm(behind) < 0.01 * np.linalg.norm(ahead)
    np.testing.assert_allclose(wall_force(np.array([0.0, 0.5]), 0.25), [0.0, -3.0 * math.exp(-2.5)])


def overlaps(movers, seconds):
    """Number of instants and pairs in which two bodies' circles overlap by more than a tenth of a metre."""
    met = []
    for k in range(round(10 * seconds)):
        bodies = movers.at(0.1 * k)
        radius = bodies.half_size_m[:, :2].max(axis=1)
        apart = np.linalg.norm(bodies.position_m[:, None, :2] - bodies.position_m[None, :, :2], axis=2)
        level = np.abs(bodies.position_m[:, None, 2] - bodies.position_m[None, :, 2])
        near = (apart < radius[:, None] + radius - 0.1) & (
            level < bodies.half_size_m[:, 2][:, None] + bodies.half_size_m[:, 2]
        )
        met.append(np.triu(near, 1).sum())
    return sum(met)


def test_social_movers_keep_apart_where_blind_ones_walk_through_each_other(room):
    blind = sum(overlaps(begin(Mixed(count=10, start_margin_m=0.2), room, seed), 20.0) for seed in range(4))
    social = sum(overlaps(begin(Mixed(**CROWD), room, seed), 20.0) for seed in range(4))
    assert blind > 50
    assert social < 0.3 * blind


def test_they_stay_out_of_walls_and_below_their_fastest_speed(room):
    world, scene = room
    movers = begin(Mixed(**CROWD), room, 7)
    for k in range(0, 3000, 13):
        bodies = movers.at(0.01 * k)
        assert np.linalg.norm(bodies.velocity_mps[:, :2], axis=1).max() <= 1.5 + 1e-9
        for centre, half in zip(bodies.position_m, bodies.half_size_m, strict=True):
            assert not scene.touches_fixed(centre, np.eye(3), 2.0 * half)
            assert (centre[:2] - half[:2] >= world.flight_bounds_m[0, :2] - 1e-9).all()
    moved = [np.linalg.norm(movers.at(s).position_m - movers.at(s + 5.0).position_m, axis=1) for s in (5, 20)]
    assert np.max(moved, axis=0).min() > 0.3  # nobody is stuck


def test_they_start_as_the_blind_ones_do(room):
    blind, social = begin(Mixed(), room, 4).at(0.0), begin(Mixed(reaction=Reaction.SOCIAL), room, 4).at(0.0)
    np.testing.assert_array_equal(blind.position_m, social.position_m)
    np.testing.assert_allclose(blind.velocity_mps, social.velocity_mps, atol=0.05)


def least_gap_m(reaction, room, seed):
    """Least gap of the circles of one mover and of a vehicle that stands in its way."""
    movers = begin(Mixed(count=1, linear_share=1.0, circular_share=0.0, reaction=reaction), room, seed)
    first = movers.at(0.0)
    place = first.position_m[0] + 2.0 * first.velocity_mps[0]  # two seconds ahead
    least = np.inf
    for now_s in np.arange(0.0, 4.0, 0.01):
        movers.notice(place, np.zeros(3))
        bodies = movers.at(float(now_s))
        away = float(np.linalg.norm((bodies.position_m[0] - place)[:2]))
        least = min(least, away - bodies.half_size_m[0, :2].max())
    return least - LIMITS.body_radius_m


def test_they_make_way_for_the_vehicle_and_blind_ones_do_not(room):
    gaps = {kind: [least_gap_m(kind, room, seed) for seed in range(12)] for kind in Reaction}
    blind, social = (np.array(gaps[kind]) for kind in (Reaction.BLIND, Reaction.SOCIAL))
    hit = blind < 0.0
    assert hit.sum() >= 5
    assert (social[hit] > -0.1).all()  # touched at most, by the circle around its rotors
