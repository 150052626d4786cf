"""Many teams as one Gymnasium vector environment, straight over the batch kernel."""

from numbers import Integral

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from ..mission.batch import check_seed
from .gym import check_render_mode, inform_teams, observe_teams
from .spaces import team_space
from .team import Team


class MissionVectorEnv(gymnasium.vector.VectorEnv):
    """`MissionEnv` many times over: the same missions and observations as gymnasium's own vector environments make of it.

    A mission that is over begins anew with the next step (AutoresetMode.NEXT_STEP).

    Args:
      num_envs: missions side by side.
      copy: return observations of their own; False: arrays that the next step overwrites, which is faster.
      scenario, options: as for `MissionEnv`. There is nothing to render.

    Raises:
      ValueError: an argument is impossible; the message names it.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs=1, scenario="medium", copy=True, render_mode=None, **options):
        check_render_mode(render_mode, self.metadata)
        if isinstance(num_envs, bool) or not isinstance(num_envs, Integral) or num_envs < 1:
            raise ValueError(f"num_envs must be a whole number of at least 1, is {num_envs!r}")
        self.num_envs, self.copy, self.render_mode = int(num_envs), copy, render_mode
        self.team = Team(scenario, **options)
        self.single_observation_space = team_space(self.team.scenario, self.team.choices)
        self.single_action_space = spaces.MultiDiscrete(self.team.choices.sizes)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._randoms = [seeding.np_random()[0] for _ in range(num_envs)]

    def reset(self, *, seed=None, options=None):
        """New missions: of those seeds, of `seed`, `seed + 1`, …, or of the next ones. There are no options."""
        if seed is None or isinstance(seed, Integral):
            seeds = [None if seed is None else check_seed(seed) + e for e in range(self.num_envs)]
        else:
            seeds = [None if one is None else check_seed(one) for one in seed]
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed must be one number or {self.num_envs}, is {seed!r}")
        self._randoms = [old if new is None else seeding.np_random(new)[0] for new, old in zip(seeds, self._randoms)]
        self.team.begin([self._draw(e) if new is None else new for e, new in enumerate(seeds)])
        return self._observe(), self._inform()

    def step(self, actions):
        """Decide in every mission, and advance each to its next decision epoch."""
        self.team.step(actions, self._draw)
        rewards, ended = self.team.rewards, self.team.over
        return self._observe(), rewards, ended, np.zeros(self.num_envs, bool), self._inform()

    def close_extras(self, **kwargs):
        """There is nothing to close."""

    def _draw(self, e):
        return self.team.draw_seed(self._randoms[e])

    def _observe(self):
        return {name: array.copy() if self.copy else array for name, array in observe_teams(self.team).items()}

    def _inform(self):
        """Gymnasium's form: an array a name, and beside it `_name`, where it means something."""
        info = {name: values.copy() for name, values in inform_teams(self.team).items()}
        info["action_mask"] = self.team.choices.split(self.team.mask.copy() if self.copy else self.team.mask)
        known = {f"_{name}": np.ones(self.num_envs, bool) for name in info}
        over = self.team.over
        if over.any():
            scores = self.team.batch.scores()
            info["twcr"] = np.array([score.twcr if ended else 0.0 for score, ended in zip(scores, over)])
            known["_twcr"] = over
        return info | known
