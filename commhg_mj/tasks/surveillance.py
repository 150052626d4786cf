"""The domain of surveillance missions, one task a scenario, in the manner of dm_control's suite."""

import copy

import numpy as np
import tree
from dm_control.rl import control
from dm_control.utils import containers
from dm_env import TimeStep, specs
from dm_env.specs import BoundedArray

from ..base.arguments import check_seed, flag, number, options_of, said
from ..base.terms import Activity
from ..models.world import make_world
from ..scenarios import SCENARIOS
from .columns import COLUMNS, ROWS, table_bounds, table_shape
from .physics import Physics
from .team import Team

SUITE = containers.TaggedTasks()
TAGS = {"small": ("easy",), "medium": (), "large": ("hard",)}


def make(scenario, random=None, pictures=True, environment_kwargs=None, **options) -> control.Environment:
    """The environment of a scenario.

    Args:
      scenario: name, TOML file or `Scenario`.
      random: the seed of the first episode, from which the others follow; or a `RandomState` that draws them; None: any.
      pictures: whether the world looks like anything; without, episodes begin ten times faster.
      environment_kwargs: options of `MissionEnvironment`.
      options: of `commhg_mj.tasks.Team`.
    """
    task = Surveillance(scenario, random, **options)
    physics = Physics.from_world(make_world(task.team.scenario, task.next_seed), flag("pictures", pictures), task.timestep)
    return MissionEnvironment(physics, task, **options_of("environment_kwargs", environment_kwargs))


def _add(scenario):
    def load(**task_kwargs):
        return make(scenario, **task_kwargs)

    load.__name__, load.__doc__ = scenario, f"Returns the surveillance task of the {scenario} scenario; options as `make`."
    SUITE.add("benchmarking", "no_reward_visualization", *TAGS[scenario])(load)


for _scenario in SCENARIOS:
    _add(_scenario)


class Surveillance(control.Task):
    """A team's mission: decisions in, padded tables, masks and the team reward out.

    As the tasks of dm_control's suite have it, `random` draws the episodes, and wrappers of other people seed them by putting
    a `RandomState` of theirs in the place of `_random`.
    """

    def __init__(self, scenario, random=None, **options):
        self.team = Team(scenario, **options)
        self.visualize_reward = False  # dm_control sets it; colours here show the mission
        self.seed(random)

    def seed(self, random) -> None:
        """Fix the next episode and those after it; arguments as for `make`."""
        if random is None or isinstance(random, np.random.RandomState):
            self._random = random or np.random.RandomState()
        else:
            seed = check_seed(random)
            self._random = np.random.RandomState(np.random.PCG64(seed))  # the missions that follow in Gymnasium, too
            self._given = seed

    @property
    def random(self) -> np.random.RandomState:
        """What draws the next episodes."""
        return self._random

    @property
    def _random(self):
        return self._drawer

    @_random.setter
    def _random(self, drawer):
        if not isinstance(drawer, np.random.RandomState):
            raise ValueError(f"random must be a numpy RandomState, is {said(drawer)}")
        self._drawer, self._given = drawer, None

    @property
    def next_seed(self) -> int:
        """The mission that begins with the next episode."""
        return self._draw(copy.deepcopy(self._random)) if self._given is None else self._given

    def _draw(self, drawer):
        return self.team.draw_seed(np.random.Generator(drawer._bit_generator))

    @property
    def timestep(self) -> float:
        """Seconds of a step, at least."""
        return float(max(1, self.team.period))

    def initialize_episode(self, physics) -> None:
        """Begin the next mission in its own world."""
        self.team.begin([self._draw(self._random) if self._given is None else self._given])
        self._given = None
        physics.reload(self.team.batch.worlds[0])
        self.after_step(physics)

    def before_step(self, action, physics) -> None:
        """Decide and advance."""
        self.team.step(action, alone=True)

    def after_step(self, physics) -> None:
        """Put the bodies where the robots are."""
        robots = self.team.batch.state.robots[0]
        xy = np.stack([robots["x"], robots["y"]], axis=-1)
        physics.place_robots(xy, robots["activity"] == Activity.FAILED, self.team.time[0])

    def get_reward(self, physics) -> float:
        """The team reward of the seconds since the last step (paper, eq. 4)."""
        return float(self.team.rewards[0])

    def get_termination(self, physics) -> float | None:
        """The time limit is part of the mission: nothing comes after it."""
        return 0.0 if self.team.over[0] else None

    def get_observation(self, physics) -> dict:
        """Nested arrays of their own: tables by column, who is due, what is open, and the time."""
        team, n_robots = self.team, self.team.scenario.n_robots
        observation: dict = {
            name: {column: table[0, ..., c].copy() for c, column in enumerate(COLUMNS[name])}
            for name, table in team.tables._asdict().items()
        }
        observation["robots"]["due"] = team.due[0, :n_robots].copy()
        observation["operators"]["due"] = team.due[0, n_robots:].copy()
        observation["action_mask"] = team.mask[0].copy()
        observation["time"], observation["elapsed"] = team.time.astype(np.float32), team.elapsed.astype(np.float32)
        return observation

    def observation_spec(self, physics) -> dict:
        """Bounds, types and names of `get_observation`."""
        scenario, limit = self.team.scenario, self.team.scenario.time_limit
        spec: dict = {}
        for table in ROWS:
            shape, bounds = table_shape(table, scenario)[:-1], zip(COLUMNS[table], *table_bounds(table, scenario))
            spec[table] = {name: _bounded(f"{table}/{name}", shape, np.float32, low, high) for name, low, high in bounds}
        spec["robots"]["due"] = _bounded("robots/due", (scenario.n_robots,), np.int8, 0, 1)
        spec["operators"]["due"] = _bounded("operators/due", (scenario.n_operators,), np.int8, 0, 1)
        spec["action_mask"] = _bounded("action_mask", (self.team.choices.n_numbers,), np.int8, 0, 1)
        spec["time"] = _bounded("time", (1,), np.float32, 0, limit)
        spec["elapsed"] = _bounded("elapsed", (1,), np.float32, 0, limit)
        return spec

    def action_spec(self, physics) -> BoundedArray:
        """One number a choice (tasks/choices.py); their names, separated by tabs, are the spec's."""
        choices = self.team.choices
        return _bounded("\t".join(choices.names), choices.sizes.shape, np.int32, 0 * choices.sizes, choices.sizes - 1)


def _bounded(name, shape, dtype, low, high):
    return specs.BoundedArray(shape, dtype, low, high, name)


class MissionEnvironment(control.Environment):
    """dm_control's environment, whose steps last as long as nobody decides.

    Args:
      physics, task: of one scenario.
      flat_observation: one array in place of the nested ones, in the order of `tree.flatten`.
      gamma: discount of one second; a step that lasted dt seconds is discounted by gamma ** dt, None: not at all.
    """

    def __init__(self, physics, task, flat_observation=False, gamma=None):
        gamma, is_flat = gamma if gamma is None else number("gamma", gamma, 0, 1), flag("flat_observation", flat_observation)
        super().__init__(physics, task)
        self._is_flat, self._gamma = is_flat, gamma

    def reset(self, seed=None) -> TimeStep:
        """The first step of the next episode, or of the mission with that seed."""
        if seed is not None:
            self.task.seed(seed)
        return self._finish(super().reset())

    def step(self, action) -> TimeStep:
        """To the next decision epoch; after the last step of an episode, `reset`."""
        return self._finish(super().step(action))

    def _finish(self, timestep):
        if self._gamma is not None and timestep.mid():
            timestep = timestep._replace(discount=float(self._gamma ** self.task.team.elapsed[0]))
        if self._is_flat:
            timestep = timestep._replace(observation={control.FLAT_OBSERVATION_KEY: _flat(timestep.observation)})
        return timestep

    def observation_spec(self) -> dict:
        """Of `observation`: nested `BoundedArray`s, or one."""
        spec = super().observation_spec()
        if not self._is_flat:
            return spec
        low = _flat(tree.map_structure(lambda each: np.broadcast_to(each.minimum, each.shape), spec))
        high = _flat(tree.map_structure(lambda each: np.broadcast_to(each.maximum, each.shape), spec))
        return {control.FLAT_OBSERVATION_KEY: _bounded(control.FLAT_OBSERVATION_KEY, low.shape, np.float32, low, high)}


def _flat(nested):
    return np.concatenate([np.ravel(array) for array in tree.flatten(nested)]).astype(np.float32)
