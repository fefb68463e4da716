"""Learn when to replan: `python -m benchmarks.learn_policy [FILE.npz] [--generations N]`.

First a network imitates MCR: logistic regression on what it decided on some flights, replans weighed up,
for they are rare. Then evolution strategies (Salimans et al. 2017): pairs of networks with opposite noise
fly the same world in `uavexp.env.ReplanEnv`, and a step is taken towards the better one of each pair. Of
the imitation and what evolved, the one is kept that is worth more on seeds of neither. Seeds from
1,000,000 on, which no study flies. About 40 flights, some minutes; more of either option learns more.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import uavexp
from uavexp.arrays import Float
from uavexp.env import ReplanEnv
from uavexp.network import Network
from uavexp.policy import FEATURES, PolicyTrigger
from uavexp.trigger.learned import SHIPPED
from uavexp.trigger.mcr import Mcr
from uavexp.types import Decision, Observation

WORLDS = ("random_columns", "warehouse", "corridors", "rooms")
WORTH = {"success": 10.0, "collision_count": -5.0, "completion_time_s": -0.1, "replans": -0.15}
FIRST_SEED, UNITS, PAIRS, NOISE, RATE = 1_000_000, 16, 4, 0.1, 0.15


class Watched(PolicyTrigger):
    """MCR, with what it saw and decided."""

    def __init__(self) -> None:
        super().__init__(self._told)
        self.teacher, self.decided = Mcr(), False
        self.seen: list[Float] = []
        self.replans: list[bool] = []

    def _told(self, seen: Float) -> bool:
        self.seen.append(seen)
        self.replans.append(self.decided)
        return self.decided

    def reset(self, limits: object) -> None:
        super().reset(limits)
        self.teacher.reset(limits)

    def planned(self, trajectory: object, field: object) -> None:
        super().planned(trajectory, field)
        self.teacher.planned(trajectory, field)

    def decide(self, observation: Observation) -> Decision:
        self.decided = self.teacher.decide(observation).replan
        return super().decide(observation)


def flights(count: int, first: int) -> Iterator[tuple[str, int]]:
    """Worlds in turn, each with a seed of its own."""
    for number in range(count):
        yield WORLDS[number % len(WORLDS)], FIRST_SEED + first + number


def imitation(count: int, rng: np.random.Generator) -> Network:
    """A network that decides as MCR did on so many flights."""
    watched = Watched()
    for world, seed in flights(count, 0):
        uavexp.fly(world=world, seed=seed, trigger=watched)
    seen, replans = np.array(watched.seen, dtype=np.float64), np.array(watched.replans, dtype=np.float64)
    network = Network(
        mean=seen.mean(axis=0), scale=np.maximum(seen.std(axis=0), 1e-3),
        hidden=rng.normal(0.0, 1.0 / np.sqrt(len(FEATURES)), (UNITS, len(FEATURES))),
        hidden_bias=np.zeros(UNITS), out=rng.normal(0.0, 0.25, UNITS), out_bias=np.zeros(1),
    )  # fmt: skip
    network = fitted(network, seen, replans)
    said = network.value(seen) > 0.0
    print(
        f"imitation: {len(seen)} decisions, {replans.mean():.1%} replans, "
        f"{(said == (replans > 0.5)).mean():.1%} as MCR, {said.mean():.1%} replans",
        flush=True,
    )
    return network


def fitted(network: Network, seen: Float, replans: Float, steps: int = 3000) -> Network:
    """The network after steps of Adam (Kingma and Ba 2015) on the weighted logistic loss."""
    normal = (seen - network.mean) / network.scale
    weight = np.where(replans > 0.5, 0.5 / np.sqrt(replans.mean()), 1.0)
    place, first, second = flat(network), 0.0, 0.0
    for step in range(1, steps + 1):
        now = unflat(network, place)
        hidden = np.tanh(normal @ now.hidden.T + now.hidden_bias)
        error = weight * (1.0 / (1.0 + np.exp(-(hidden @ now.out + now.out_bias[0]))) - replans) / len(seen)
        back = error[:, None] * now.out * (1.0 - hidden**2)
        slope = np.concatenate(
            [(back.T @ normal).ravel(), back.sum(axis=0), hidden.T @ error, [error.sum()]]
        ) + 1e-5 * place  # fmt: skip
        first, second = 0.9 * first + 0.1 * slope, 0.999 * second + 0.001 * slope**2
        place = place - 0.01 * (first / (1 - 0.9**step)) / (np.sqrt(second / (1 - 0.999**step)) + 1e-8)
    return unflat(network, place)


def flat(network: Network) -> Float:
    """What is learned, in a row."""
    return np.concatenate([network.hidden.ravel(), network.hidden_bias, network.out, network.out_bias])


def unflat(network: Network, place: Float) -> Network:
    """The network with other numbers."""
    units, inputs = network.hidden.shape
    hidden, bias, out, last = np.split(place, np.cumsum([units * inputs, units, units]))
    return replace(network, hidden=hidden.reshape(units, inputs), hidden_bias=bias, out=out, out_bias=last)


def worth(network: Network, world: str, seed: int) -> float:
    """Of one flight with it."""
    env = ReplanEnv(world=world, weights=WORTH)
    seen, _ = env.reset(seed=seed)
    total, ended = 0.0, False
    while not ended:
        seen, reward, terminated, truncated, _ = env.step(int(network.value(seen) > 0.0))
        total, ended = total + reward, terminated or truncated
    return total


def evolved(network: Network, generations: int, rng: np.random.Generator) -> Network:
    """The network after so many generations."""
    place = flat(network)
    for generation in range(generations):
        step, gains = np.zeros_like(place), []
        for world, seed in flights(PAIRS, 1000 + generation * PAIRS):
            noise = rng.normal(0.0, 1.0, len(place))
            more, less = (
                worth(unflat(network, place + sign * NOISE * noise), world, seed) for sign in (1, -1)
            )
            step += np.clip(more - less, -2.0, 2.0) * noise / PAIRS
            gains += [more, less]
        place = place + RATE * NOISE * step
        print(f"generation {generation + 1}: {np.mean(gains):.2f}", flush=True)
    return unflat(network, place)


def main() -> None:
    """Imitate, evolve, keep the better."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", nargs="?", type=Path, default=SHIPPED)
    parser.add_argument("--flights", type=int, default=10, help="that MCR shows")
    parser.add_argument("--generations", type=int, default=2)
    asked, rng = parser.parse_args(), np.random.default_rng(0)
    networks = [imitation(asked.flights, rng)]
    networks.append(evolved(networks[0], asked.generations, rng))
    worths = [np.mean([worth(net, *flight) for flight in flights(6, 10_000)]) for net in networks]
    print(f"imitation {worths[0]:.2f}, evolved {worths[1]:.2f}, on 6 other flights")
    networks[int(np.argmax(worths))].save(asked.file)
    print(f"{asked.file}: {asked.file.stat().st_size / 1000:.1f} kB")


if __name__ == "__main__":
    main()
