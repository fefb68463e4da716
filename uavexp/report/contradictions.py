"""Where the numbers and words of Chen et al. 2026 contradict each other, checked by arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator

from uavexp.report.parts import Table
from uavexp.report.reference import Reference

ARMS = ("TBR", "SSP", "MCR")
_SPEED_LIMIT_MPS = 2.5

_IN_WORDS = (
    (
        "§4.1: 20 trials with different seeds; §4.2 and Table 1: 10 trials with a fixed random seed",
        "two readings",
        "both are flown: experiments mcr/table1 and mcr/fixed_layout",
    ),
    (
        "Equation 20 compares consecutive updates; §4.5 speaks of accumulated variations",
        "two triggers",
        "both are flown: MCR literal and MCR",
    ),
    (
        "§4.3.2: SSP's path is longer because of frequent detours",
        "a plan made once cannot take a detour",
        "no way to follow the explanation",
    ),
    ("§4.1: Map Success Rate", "never defined", "not computed"),
)


def least_spread(mean: float, share_of_zeros: float) -> float:
    """Least standard deviation of a count >= 0 with this mean that is zero in such a share of cases.

    The least spread is that of zero and one other value: with probability q of zero and mean m
    it is m sqrt(q / (1 - q)).
    """
    return mean * math.sqrt(share_of_zeros / (1.0 - share_of_zeros)) if share_of_zeros < 1.0 else 0.0


def possible_rate(percent: float, trials: int) -> bool:
    """Whether a percentage, printed with one decimal, is a count out of so many trials."""
    nearest = 100.0 * round(percent * trials / 100.0) / trials
    return abs(nearest - percent) < 0.05 + 1e-9


def contradictions(reference: Reference) -> Table:
    """What is printed, the arithmetic, and what follows."""
    return Table(
        name="contradictions",
        title="Contradictions in the paper",
        columns=("printed", "check", "so"),
        rows=(*_computed(reference), *_IN_WORDS),
        notes=("Numbers from reference.csv; the checks are computed.",),
    )


def _computed(reference: Reference) -> Iterator[tuple[str, str, str]]:
    for arm in ARMS:
        if not {(name, arm) for name in ("success", "collision_count", "path_length_m")} <= reference.keys():
            continue
        yield from _rate(reference, arm)
        yield from _collisions(reference, arm)
        yield from _speed(reference, arm)
    yield from _interval(reference)


def _rate(reference: Reference, arm: str) -> Iterator[tuple[str, str, str]]:
    rate = reference["success", arm].mean
    impossible = [str(n) for n in (10, 20) if not possible_rate(rate, n)]
    if impossible:
        yield (
            f"{arm}: success rate {rate:g} %",
            f"no count out of {' or '.join(impossible)} trials",
            "the printed number of trials is not the one behind this rate",
        )


def _collisions(reference: Reference, arm: str) -> Iterator[tuple[str, str, str]]:
    rate, contacts = reference["success", arm].mean, reference["collision_count", arm]
    least = least_spread(contacts.mean, rate / 100.0)
    if contacts.sd < least:
        yield (
            f"{arm}: {rate:g} % of flights without collision, {contacts.mean:g} ± {contacts.sd:g} collisions",
            f"the spread must be at least {least:.1f}",
            "impossible as defined: success means no collision",
        )


def _speed(reference: Reference, arm: str) -> Iterator[tuple[str, str, str]]:
    speed = reference["path_length_m", arm].mean / reference["completion_time_s", arm].mean
    yield (
        f"{arm}: path over time",
        f"{speed:.2f} m/s on average, limit {_SPEED_LIMIT_MPS:g} m/s",
        "counts per mission do not compare with faster flights: see the rates per metre",
    )


def _interval(reference: Reference) -> Iterator[tuple[str, str, str]]:
    time, replans = reference.get(("completion_time_s", "TBR")), reference.get(("replans", "TBR"))
    if time and replans:
        yield (
            "TBR: the interval is never given",
            f"{time.mean:g} s / {replans.mean:g} replans = {time.mean / replans.mean:.1f} s",
            "the intervals flown here are ours",
        )
