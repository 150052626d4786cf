"""Speeds of the task interfaces, against the kernel below them and against a well-known environment."""

import importlib.util
import time
from functools import partial

import numpy as np

from ..mission.batch import MissionBatch, stay
from ..tasks.gym import MissionEnv
from ..tasks.parallel import MissionParallelEnv
from ..tasks.vector import MissionVectorEnv
from .speeds import Speed

YARDSTICK, FEW = "mpe2", 3  # the package of simple_spread, and its usual number of agents


def interface_rates(scenario, n_missions=64, steps=100, repeats=3) -> list[Speed]:
    """Steps per CPU-second of every interface.

    One environment: PettingZoo and Gymnasium with random legal actions, beside simple_spread where it is installed, with its
    usual agents and with as many as the mission has. Many missions: the native vector environment and the kernel, with the
    same decisions within the same missions. All take turns: the machine's moods meet all alike.
    """
    envs = {
        "PettingZoo": lambda: _step_parallel(MissionParallelEnv(scenario), steps),
        "Gymnasium": lambda: _step_gym(MissionEnv(scenario), steps),
    }
    counts = (FEW, scenario.n_robots + scenario.n_operators) if importlib.util.find_spec(YARDSTICK) else ()
    spreads = [f"simple_spread with {n} agents" for n in counts]
    envs |= {name: partial(_step_spread, n, steps) for name, n in zip(spreads, counts)}
    rates = _best_rates(envs, steps, repeats)
    speeds = [Speed(f"{scenario.name}: {name}, one environment", rate, "steps/CPU-s") for name, rate in rates.items()]
    ratios = [Speed(f"{scenario.name}: PettingZoo over {name}", rates["PettingZoo"] / rates[name], "ratio") for name in spreads]
    return speeds + ratios + _vector_rates(scenario, n_missions, steps, repeats)


def _best_rates(works: dict, steps, repeats) -> dict:
    """Steps per CPU-second of works that return how long so many `steps` took, the best of some turns each."""
    seconds = {name: [] for name in works}
    for _ in range(repeats):
        for name, work in works.items():
            seconds[name].append(work())
    return {name: steps / min(each) for name, each in seconds.items()}


def _vector_rates(scenario, n_missions, steps, repeats):
    """Steps of all missions together; nobody changes anything, and no mission ends."""
    batch = MissionBatch(scenario, range(n_missions))
    bare, copying = MissionVectorEnv(n_missions, scenario, copy=False), MissionVectorEnv(n_missions, scenario)
    works = {
        "kernel": partial(_step_batch, batch, steps),
        "vector environment": partial(_step_vector, copying, steps),
        "vector environment without copies": partial(_step_vector, bare, steps),
    }
    rates = _best_rates(works, n_missions * steps, repeats)
    what = f"{scenario.name}: {n_missions} missions, "
    speeds = [Speed(what + name, rate, "steps/CPU-s") for name, rate in rates.items()]
    return speeds + [
        Speed(f"{what}{name} over kernel", rate / rates["kernel"], "ratio") for name, rate in list(rates.items())[1:]
    ]


def _step_spread(n, steps) -> float:
    from mpe2 import simple_spread_v3

    return _step_parallel(simple_spread_v3.parallel_env(N=n), steps)


def _step_parallel(env, steps) -> float:
    """CPU-seconds of steps with random legal actions; choosing them is not counted."""
    observations, _ = env.reset(seed=0)
    for i, agent in enumerate(env.agents):
        env.action_space(agent).seed(i)
    seconds = 0.0
    for _ in range(steps):
        if not env.agents:
            observations, _ = env.reset()
        actions = {agent: env.action_space(agent).sample(_mask(observations[agent])) for agent in env.agents}
        start = time.process_time()
        observations, *_ = env.step(actions)
        seconds += time.process_time() - start
    return seconds


def _mask(observation):
    return observation["action_mask"] if isinstance(observation, dict) else None


def _step_gym(env, steps) -> float:
    """The same of the whole team as one agent."""
    env.action_space.seed(0)
    _, info = env.reset(seed=0)
    seconds, is_over = 0.0, False
    for _ in range(steps):
        if is_over:
            _, info = env.reset()
        action = env.action_space.sample(info["action_mask"])
        start = time.process_time()
        _, _, is_over, _, info = env.step(action)
        seconds += time.process_time() - start
    return seconds


def _step_batch(batch, steps) -> float:
    """CPU-seconds of steps in which everybody stays."""
    observations = batch.reset()
    start = time.process_time()
    for _ in range(steps):
        observations = batch.step(stay(observations))
    return time.process_time() - start


def _step_vector(env, steps) -> float:
    """The same of the vector environment."""
    env.reset(seed=0)
    actions = np.zeros(env.action_space.shape, int)
    start = time.process_time()
    for _ in range(steps):
        env.step(actions)
    return time.process_time() - start
