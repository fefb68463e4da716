"""The replanning decision as a Gymnasium environment: one step is one map update of one flight.

    env = ReplanEnv("world=rooms", "vehicle=point_mass")
    observation, info = env.reset(seed=100)
    observation, reward, terminated, truncated, info = env.step(1)  # 1: replan now; 0: fly on

The observation is `uavexp.policy.vector_of`, numbers in `uavexp.policy.FEATURES`. A policy learned here
flies among the others as `uavexp.policy.PolicyTrigger`: the same decisions, the same flight.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, ClassVar

import numpy as np

try:
    import gymnasium
except ImportError as missing:
    raise ImportError("uavexp.env needs gymnasium: pip install gymnasium") from missing

from uavexp import trial as loop
from uavexp.arrays import Float32
from uavexp.config.build import build, with_own
from uavexp.config.own_metrics import own_metrics
from uavexp.errors import ConfigError
from uavexp.flight import one_trial
from uavexp.log import TrialLog
from uavexp.metrics.evaluate import METRICS, evaluate
from uavexp.policy import HIGH, LOW, PolicyTrigger
from uavexp.types import Outcome, World

# [ours]; a flight is worth what its columns weigh
WEIGHTS = {"success": 10.0, "collision_count": -5.0, "completion_time_s": -0.1, "replans": -0.05}
_MOST_SEED = 2**31
_TEXTS = {"outcome", "scene_kind"}  # columns that are no numbers


class ReplanEnv(gymnasium.Env[Float32, int]):  # type: ignore[misc]
    """When to replan. An episode's rewards add up to its flight's metrics times their weights.

    Time and plans are paid as they come, other columns at the end. It is truncated by the mission's time
    limit, else terminated. `info`: `seed` and `time_s`, at the end `outcome`, `metrics` (every column).
    `reset(seed=n)` begins the flight that `uavexp.fly(seed=n)` makes; without a seed one is drawn.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(
        self,
        *overrides: str,
        weights: Mapping[str, float] | None = None,
        config_dir: str | Path | None = None,
        **values: Any,
    ) -> None:
        """Set up what is flown.

        Args:
            overrides: as of `uavexp.fly`, without `seed` and `trigger`.
            weights: of columns of numbers of `uavexp.fly(...).metrics` in the reward; default: `WEIGHTS`.
            config_dir: as of `uavexp.fly`.
            values: as of `uavexp.fly`.

        Raises:
            ConfigError: an override or a weight is wrong.
        """
        typed = {text.partition("=")[0] for text in overrides} | set(values)
        for key in {"seed", "trigger"} & typed:
            raise ConfigError(
                f"{key} has no place here: seeds come with reset(seed=), the trigger is the agent"
            )
        self._cell, _, self._own = one_trial(overrides, config_dir, values)
        self._metrics = own_metrics(self._cell.metrics)
        self._weights = dict(WEIGHTS if weights is None else weights)
        columns = {metric.column for metric in (*METRICS, *self._metrics)} - _TEXTS
        for column in self._weights:
            if column not in columns:
                raise ConfigError(f"weights: no metric {column}; there are {', '.join(sorted(columns))}")
        self.observation_space = gymnasium.spaces.Box(LOW, HIGH, dtype=np.float32)
        self.action_space = gymnasium.spaces.Discrete(2)
        self._flight: _Flight | None = None
        self._paid = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32, dict[str, Any]]:
        """Begin a flight and fly until its first plan is flown."""
        super().reset(seed=seed)
        self.close()
        flown = int(self.np_random.integers(_MOST_SEED)) if seed is None else seed
        trigger = PolicyTrigger(lambda seen: False)
        parts = with_own(build(self._cell.config), {**self._own, "trigger": trigger})
        self._flight, self._paid = _Flight(parts, trigger, flown), 0.0
        return self._flight.seen, self._info()

    def step(self, action: int) -> tuple[Float32, float, bool, bool, dict[str, Any]]:
        """Replan (1) or not (0), and fly on to the next map update."""
        flight = self._flight
        if flight is None:
            raise gymnasium.error.ResetNeeded("the flight has ended or not begun: call reset")
        flight.go_on(bool(action))
        info, paid = self._info(), self._paid
        self._paid = self._worth(info)
        log = flight.log
        if log is not None:
            self._flight = None
        timeout = log is not None and log.outcome is Outcome.TIMEOUT
        return flight.seen, self._paid - paid, log is not None and not timeout, timeout, info

    def close(self) -> None:
        """Leave a flight before its end."""
        if self._flight is not None:
            self._flight.leave()
        self._flight = None

    def _info(self) -> dict[str, Any]:
        flight = self._flight
        assert flight is not None
        info: dict[str, Any] = {"seed": flight.seed, "time_s": flight.trigger.time_s}
        if flight.log is not None:
            info |= {
                "outcome": str(flight.log.outcome),
                "metrics": evaluate(flight.log, flight.world, self._metrics),
            }
        return info

    def _worth(self, info: Mapping[str, Any]) -> float:
        """Of the flight: what is known so far, at the end all; a number that does not exist is nothing."""
        flight = self._flight
        assert flight is not None
        soon = {"completion_time_s": flight.trigger.time_s, "replans": flight.trigger.plans - 1}
        values = info.get("metrics", soon)
        parts = (weight * float(values.get(column, 0.0)) for column, weight in self._weights.items())
        return float(np.nansum(list(parts)))


class _Left(Exception):
    """Nobody waits for the flight any more."""


class _Flight:
    """A flight in a thread of its own, which stands still while the agent thinks: one of the two runs."""

    def __init__(self, parts: loop.Parts, trigger: PolicyTrigger, seed: int) -> None:
        self.seed, self.trigger = seed, trigger
        self.seen = np.zeros_like(LOW)
        self.world: World = loop.make_world(parts, seed)
        self.log: TrialLog | None = None
        self._parts = parts
        self._answers: SimpleQueue[bool | None] = SimpleQueue()  # None: leave
        self._said: SimpleQueue[Float32 | TrialLog | BaseException] = SimpleQueue()
        trigger.policy = self._ask
        self._thread = Thread(target=self._fly, daemon=True)
        self._thread.start()
        self._listen()

    def go_on(self, replan: bool) -> None:
        """Answer, and wait for the next question; a flight that ended before the first has none."""
        if self.log is None:
            self._answers.put(replan)
            self._listen()

    def leave(self) -> None:
        """End the thread."""
        self._answers.put(None)
        self._thread.join()

    def _listen(self) -> None:
        said = self._said.get()
        if isinstance(said, BaseException):
            raise said
        if isinstance(said, TrialLog):
            self.log = said
        else:
            self.seen = said

    def _ask(self, seen: Float32) -> bool:
        self._said.put(seen)
        answer = self._answers.get()
        if answer is None:
            raise _Left
        return answer

    def _fly(self) -> None:
        try:
            self._said.put(loop.fly(self._parts, self.world, self.seed))
        except _Left:
            pass
        except BaseException as error:  # raised where the agent waits
            self._said.put(error)
