"""Training speeds beside BenchMARL's, on the same missions with as many decisions, epochs and minibatches an update.

It wants an environment of its own, for BenchMARL requires other versions of what our examples use (docs/learning.md).
"""

import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import replace

from benchmarl.algorithms import IppoConfig, MappoConfig
from benchmarl.environments.pettingzoo.common import PettingZooClass
from benchmarl.experiment import Callback, Experiment, ExperimentConfig
from benchmarl.models import MlpConfig
from torchrl.envs import PettingZooWrapper

from ..learning.ppo import Hyper
from ..learning.train import Plan
from .speeds import Speed
from .task_env import TaskEnv, is_robot
from .training_rates import rows_of, training_rate

METHODS = {"mappo": MappoConfig, "ippo": IppoConfig}


def peer_rates(scenario, updates=3) -> list[Speed]:
    """Robot decisions per CPU-second of MAPPO and IPPO, ours and BenchMARL's in turns, and their ratios.

    A team of BenchMARL chooses and learns at every step of anybody, so that most of its robots' choices are KEEP and the only
    open one. Its rate counts them all, ours counts the robots that are due.
    """
    speeds = []
    for method in METHODS:
        ours, theirs = training_rate(scenario, method, updates), _benchmarl_rate(scenario, method, updates)
        what = f"{scenario.name}: training {method}"
        speeds += [*rows_of(what, ours), Speed(f"{what}, BenchMARL's", theirs, "robots' choices/CPU-s")]
        speeds.append(Speed(f"{what}, ours over BenchMARL's", ours.decisions / theirs, "ratio"))
    return speeds


class MissionTask(PettingZooClass):
    """A scenario's missions as a task of BenchMARL, with robots and humans as its two groups."""

    def get_env_fun(self, num_envs, continuous_actions, seed, device) -> Callable:
        def make_env():
            env = TaskEnv(self.config["scenario"])
            robots = list(filter(is_robot, env.possible_agents))
            groups = {"robots": robots, "humans": env.possible_agents[len(robots) :]}
            return PettingZooWrapper(env, group_map=groups, categorical_actions=True, seed=seed, device=device)

        return make_env

    def supports_continuous_actions(self) -> bool:
        return False

    def supports_discrete_actions(self) -> bool:
        return True

    def has_state(self) -> bool:
        return False

    def max_steps(self, env) -> int:
        return self.config["scenario"].time_limit


class Stopwatch(Callback):
    """CPU-seconds at the end of each collection."""

    def __init__(self):
        super().__init__()
        self.times = []

    def on_batch_collected(self, batch) -> None:
        self.times.append(time.process_time())


def _benchmarl_rate(scenario, method, updates):
    """Choices of robots per CPU-second, from the end of one collection to the end of the last; the first update warms up."""
    hyper, watch = Hyper.of(scenario.n_robots, False), Stopwatch()
    frames = hyper.decisions // scenario.n_robots
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        config = replace(
            ExperimentConfig.get_from_yaml(), prefer_continuous_actions=False, gamma=hyper.gamma, lr=hyper.learning_rate,
            max_n_frames=None, max_n_iters=updates + 2, on_policy_collected_frames_per_batch=frames,
            on_policy_n_envs_per_worker=Plan.side_by_side, on_policy_n_minibatch_iters=hyper.epochs,
            on_policy_minibatch_size=frames // hyper.minibatches, evaluation=False, loggers=[], create_json=False,
            save_folder=folder,
        )  # fmt: skip
        Experiment(
            MissionTask("MISSION", {"scenario": scenario}), METHODS[method].get_from_yaml(), MlpConfig.get_from_yaml(), 0, config,
            callbacks=[watch],
        ).run()  # fmt: skip
    return updates * frames * scenario.n_robots / (watch.times[-1] - watch.times[1])
