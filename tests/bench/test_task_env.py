"""Missions for other people's trainers keep PettingZoo's contract, and their agents."""

import numpy as np
from pettingzoo.test import parallel_api_test

from commhg_mj.bench.task_env import TaskEnv
from commhg_mj.scenarios import from_dict

FRAGILE = from_dict({"base": "small", "name": "fragile", "time_limit": 90, "robots": {"malfunction": 0.9}})


def test_pettingzoos_contract():
    parallel_api_test(TaskEnv(FRAGILE), num_cycles=100)


def test_robots_that_failed_stay_with_nothing_open():
    env, n_failed = TaskEnv(FRAGILE), 0
    env.reset(seed=3)
    while env.agents:
        observations, rewards, over, *_ = env.step(dict.fromkeys(env.agents, 0))
        assert list(observations) == list(rewards) == list(over) == env.possible_agents
        for agent in set(env.possible_agents) - set(env.env.agents):
            assert np.flatnonzero(observations[agent]["action_mask"]).tolist() == [0]
        n_failed = max(n_failed, len(env.possible_agents) - len(env.env.agents))
    assert n_failed and all(over.values())


def test_a_robots_choice_is_its_task(monkeypatch):
    env, done = TaskEnv(FRAGILE), []
    env.reset()
    step = env.env.step
    monkeypatch.setattr(env.env, "step", lambda actions: done.append(actions) or step(actions))
    env.step({"uav_0": 5, "human_1": 3})
    assert done == [{"uav_0": (5, 0, 0), "human_1": 3}]
