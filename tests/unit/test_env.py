"""The replanning decision as an environment: Gymnasium's own checker, and the same flight as `uavexp.fly`."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import uavexp
from uavexp.policy import FEATURES, HIGH, LOW, PolicyTrigger

pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env

from uavexp.env import WEIGHTS, ReplanEnv

SMALL = {"world": "random_columns", "vehicle": "point_mass", "world.size_m": [8, 6, 3]}
NAMES = [feature.name for feature in FEATURES]


def soon_lost(seen: np.ndarray) -> bool:
    """Replan where the plan has lost 0.1 m of clearance a second ahead, or is 1.5 s old."""
    value = dict(zip(NAMES, seen.tolist(), strict=True))
    return value["lost_1s_m"] > 0.1 or value["plan_age_s"] > 1.5


@pytest.fixture(scope="module")
def env() -> ReplanEnv:
    return ReplanEnv(**SMALL)


def episode(env: ReplanEnv, seed: int) -> tuple[list[np.ndarray], list[float], dict]:
    seen, info = env.reset(seed=seed)
    saw, rewards, ended = [seen], [], False
    while not ended:
        seen, reward, terminated, truncated, info = env.step(int(soon_lost(seen)))
        saw.append(seen)
        rewards.append(reward)
        ended = terminated or truncated
    return saw, rewards, info


@pytest.fixture(scope="module")
def flown(env):
    return episode(env, 100)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_gymnasium_finds_nothing_wrong(env):
    check_env(env, skip_render_check=True)


def test_an_episode_is_the_flight_of_its_policy(flown):
    trial = uavexp.fly(trigger=PolicyTrigger(soon_lost), seed=100, **SMALL)
    info = flown[2]
    assert info["metrics"] == pytest.approx(trial.metrics, nan_ok=True)
    assert trial.metrics["replans_policy"] > 0


def test_rewards_add_up_to_weighted_metrics(flown):
    _, rewards, info = flown
    worth = sum(weight * float(info["metrics"][column]) for column, weight in WEIGHTS.items())
    assert sum(rewards) == pytest.approx(worth)
    assert len(set(np.round(rewards, 6))) > 2  # replans are paid when they come


def test_what_is_seen_is_what_the_names_say(flown):
    saw = np.array(flown[0])
    assert ((saw >= LOW) & (saw <= HIGH)).all()
    column = {name: saw[:, index] for index, name in enumerate(NAMES)}
    assert column["target_m"][0] > column["target_m"][-1]
    assert 0.5 < column["speed_mps"].max() < 2.6
    assert column["clearance_0s_m"].min() > 0.0
    assert set(np.unique(column["seen_1s"])) <= {0.0, 1.0}
    assert column["plan_age_s"].max() >= 1.5


def test_a_flight_may_be_left_and_nobody_stays(env):
    env.reset(seed=101)
    env.step(0)
    env.close()
    assert not any("_fly" in thread.name for thread in threading.enumerate())
    from gymnasium.error import ResetNeeded

    with pytest.raises(ResetNeeded):
        env.step(0)


def test_between_steps_the_learner_may_draw(env):
    env.reset(seed=102)
    assert np.random.rand() < 1.0  # noqa: NPY002
    env.close()


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"seed": 3}, "seeds come with reset"),
        ({"trigger": "mcr"}, "the trigger is the agent"),
        ({"weights": {"succes": 1.0}}, "no metric succes"),
        ({"weights": {"outcome": 1.0}}, "no metric outcome"),
        ({"world": "roms"}, "did you mean 'rooms'"),
    ],
)
def test_what_makes_no_environment_is_refused(asked, said):
    with pytest.raises(uavexp.UavexpError, match=said):
        ReplanEnv(**asked)
