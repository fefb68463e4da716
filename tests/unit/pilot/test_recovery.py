"""The ladder as a state machine: the order of its rungs, that it ends, and that none repeats for ever."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.pilot.recovery import LADDER, Ladder, Patience, Rung, Situation, climbed

PATIENCE = Patience(wait_s=2.0, turn_s=8.0, climbs=3)
TICK_S = 0.2


def now(time_s: float, x_m: float = 0.0, **values: object) -> Situation:
    told = {"lost": True, "busy": False, "seen_m3": 0.0, "away_m": math.inf, **values}
    return Situation(time_s=time_s, here_m=(x_m, 0.0, 1.0), **told)  # type: ignore[arg-type]


def rungs(situations: list[Situation], impossible: frozenset[Rung] = frozenset()) -> list[tuple[float, Rung]]:
    """When each rung was entered."""
    ladder, entered = Ladder(), []
    for situation in situations:
        before, ladder = ladder, climbed(ladder, situation, PATIENCE, lambda rung: rung not in impossible)
        if ladder.rung is not before.rung:
            entered.append((situation.time_s, ladder.rung))
    return entered


def standing(until_s: float, x_m: float = 0.0, from_s: float = 0.0) -> list[Situation]:
    count = round((until_s - from_s) / TICK_S)
    return [now(round(from_s + TICK_S * n, 6), x_m) for n in range(count)]


def test_one_who_stands_lost_takes_every_rung_once_in_order_each_for_its_time() -> None:
    entered = rungs(standing(60.0))
    assert [rung for _, rung in entered] == list(LADDER[1:])
    assert [time_s for time_s, _ in entered] == [2.0, 10.0, 12.0, 14.0, 16.0]


def test_a_rung_that_is_not_possible_is_passed_over_and_without_an_end_it_goes_on() -> None:
    assert [rung for _, rung in rungs(standing(60.0), frozenset({Rung.LOOK, Rung.NOTE}))] == [
        Rung.BACK, Rung.LESSER, Rung.END,
    ]  # fmt: skip
    assert rungs(standing(60.0), frozenset({Rung.END}))[-1][1] is Rung.NOTE


def test_who_gets_on_within_the_wait_never_climbs() -> None:
    assert rungs([*standing(1.8), now(2.0, 2.0, lost=False), *standing(3.8, 2.0, from_s=2.2)]) == []


def test_goals_that_are_all_held_at_one_place_have_the_time_of_one() -> None:
    """Every other goal began the wait anew, and the vehicle stood until it was stuck."""
    again = [
        item
        for n in range(8)
        for item in (
            now(1.6 * n, 0.02 * n),
            now(1.6 * n + 0.2, 0.02 * n),
            now(1.6 * n + 0.4, 0.02 * n, lost=False, busy=True),
            now(1.6 * n + 0.6, 0.02 * n, lost=False),
        )
    ]
    assert rungs(again)[0] == (pytest.approx(3.4), Rung.LOOK)


def test_while_it_flies_or_backs_up_nothing_else_is_tried() -> None:
    backing = [now(round(2.0 + TICK_S * n, 6), 0.1 * n, busy=True) for n in range(60)]
    assert rungs([*standing(2.0), *backing]) == []


def test_lost_again_at_the_same_place_it_goes_on_where_it_was_and_elsewhere_from_below() -> None:
    away = [now(10.2, 0.3, lost=False, busy=True), now(10.4, 0.7, lost=False, busy=True)]
    same = rungs([*standing(10.0), *away, *standing(13.0, 0.4, from_s=10.6)])
    assert [rung for _, rung in same] == [Rung.LOOK, Rung.BACK]
    other = rungs([*standing(10.0), *away, *standing(14.0, 5.0, from_s=10.6)])
    assert [rung for _, rung in other] == [Rung.LOOK, Rung.GOALS, Rung.LOOK]


def test_the_fourth_place_without_a_gain_is_the_end_and_a_gain_begins_anew() -> None:
    def tour(gain_m3: float) -> list[Situation]:
        every, time_s = [], 0.0
        for place in range(4):
            for _ in range(12):
                every.append(now(time_s, 5.0 * place, seen_m3=gain_m3 * place))
                time_s = round(time_s + TICK_S, 6)
            every.append(now(time_s, 5.0 * place + 1.0, lost=False, busy=True, seen_m3=gain_m3 * place))
            time_s = round(time_s + TICK_S, 6)
        return every

    assert rungs(tour(0.0))[-1][1] is Rung.END
    assert rungs(tour(1.5))[-1][1] is Rung.LOOK


@settings(deadline=None, max_examples=60)
@given(
    st.lists(
        st.tuples(st.integers(0, 4), st.booleans(), st.booleans(), st.integers(1, 30)),
        min_size=1,
        max_size=60,
    )
)
def test_whatever_happens_rungs_are_climbed_in_order_and_never_more_of_them_than_ladders(
    course: list[tuple[int, bool, bool, int]],
) -> None:
    situations, time_s = [], 0.0
    for place, lost, busy, ticks in course:
        for _ in range(ticks):
            situations.append(now(time_s, 3.0 * place, lost=lost, busy=busy))
            time_s = round(time_s + TICK_S, 6)
    entered = [rung for _, rung in rungs(situations)]
    for before, after in zip([Rung.GOALS, *entered], entered, strict=False):
        assert after is Rung.GOALS or LADDER.index(after) > LADDER.index(before)
    for rung in LADDER[1:]:
        assert entered.count(rung) <= PATIENCE.climbs
    assert entered.count(Rung.END) <= 1
    assert Rung.END not in entered[:-1]


@given(st.floats(0.0, 50.0), st.sets(st.sampled_from(LADDER[1:-1])))
def test_one_who_stays_lost_comes_to_the_end(begin_s: float, impossible: set[Rung]) -> None:
    entered = rungs(standing(begin_s + 20.0, from_s=begin_s), frozenset(impossible))
    assert entered[-1][1] is Rung.END
