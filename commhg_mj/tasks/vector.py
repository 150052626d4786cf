"""Many teams as one Gymnasium vector environment, straight over the batch kernel."""

import copy
from collections.abc import Iterable
from numbers import Integral

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from ..base.arguments import check_seed, flag, missions_of
from ..mission.batch import MissionBatch
from .gym import RENDER_FPS, check_render_mode, inform_teams, make_film, observe_teams
from .registration import PlainSpec
from .spaces import team_space
from .team import Team


class MissionVectorEnv(PlainSpec, gymnasium.vector.VectorEnv):
    """`MissionEnv` many times over: the same missions and observations as gymnasium's own vector environments make of it.

    A mission that is over begins anew with the next step (AutoresetMode.NEXT_STEP).

    Args:
      num_envs: missions side by side.
      copy: return observations of their own; False: arrays that the next step overwrites, which is faster.
      scenario, render_mode, camera, size, record, options: as for `MissionEnv`; a mission is filmed, in a world that OpenGL
        keeps, once `render` is called.

    Raises:
      ValueError: an argument is impossible; the message names it.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": RENDER_FPS, "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self, num_envs=1, scenario="medium", copy=True, render_mode=None, camera="overview", size=(960, 540), record=False,
        **options,
    ):  # fmt: skip
        check_render_mode(render_mode, self.metadata)
        num_envs, self.copy, self.render_mode = missions_of("num_envs", num_envs), flag("copy", copy), render_mode
        self.num_envs = num_envs
        self.team = Team(scenario, record=record if render_mode is None else True, **options)
        self._films = [make_film(self.team, render_mode, camera, size) for _ in range(num_envs)]
        self.single_observation_space = team_space(self.team.scenario, self.team.choices)
        self.single_action_space = spaces.MultiDiscrete(self.team.choices.sizes)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._randoms = [seeding.np_random()[0] for _ in range(num_envs)]

    def reset(self, *, seed=None, options=None) -> tuple[dict, dict]:
        """New missions: of those seeds, of `seed`, `seed + 1`, …, or of the next ones. There are no options."""
        if seed is None or isinstance(seed, Integral):
            seeds = [None if seed is None else check_seed(seed) + e for e in range(self.num_envs)]
        elif isinstance(seed, Iterable) and not isinstance(seed, str):
            seeds = [None if one is None else check_seed(one) for one in seed]
        else:
            seeds = [check_seed(seed)]
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed must be one number or {self.num_envs}, is {seed!r}")
        self._randoms = [old if new is None else seeding.np_random(new)[0] for new, old in zip(seeds, self._randoms)]
        self.team.begin([self._draw(e) if new is None else new for e, new in enumerate(seeds)])
        self._no_scores = {}
        for e in range(self.num_envs):
            self._add_info(self._no_scores, self.team.score(e), e)
        freeze(self._no_scores)
        return self._observe(), self._inform()

    def step(self, actions) -> tuple[dict, np.ndarray, np.ndarray, np.ndarray, dict]:
        """Decide in every mission, and advance each to its next decision epoch."""
        self.team.step(actions, self._draw)
        rewards, ended = self.team.rewards, self.team.over
        return self._observe(), rewards, ended, np.zeros(self.num_envs, bool), self._inform()

    def render(self) -> tuple | None:
        """Every mission as it stands, [height, width, 3] u1; None without a render mode. ResetNeeded before `reset`."""
        if self.render_mode is None:
            return None
        return tuple(film.picture(Single(self.team.batch, e)) for e, film in enumerate(self._films) if film)

    def close_extras(self, **kwargs) -> None:
        """Close the films."""
        for film in filter(None, self._films):
            film.close()

    def _draw(self, e):
        return self.team.draw_seed(self._randoms[e])

    def _observe(self):
        return {name: array.copy() if self.copy else array for name, array in observe_teams(self.team).items()}

    def _inform(self):
        """Gymnasium's form of the single environments' infos: an array a name, and beside it `_name`, who has it: all."""
        info = {name: values.copy() for name, values in inform_teams(self.team).items()}
        info["action_mask"] = self._masks()
        return info | {f"_{name}": np.ones(self.num_envs, bool) for name in info} | self._scores()

    def _masks(self):
        """[E] objects: every mission's tuple of masks, one a choice."""
        masks = np.empty(self.num_envs, object)
        parts = self.team.choices.split(self.team.mask.copy() if self.copy else self.team.mask)
        for e, own in enumerate(zip(*parts)):
            masks[e] = own
        return masks

    def _scores(self):
        """The scores of the missions that are over; as long as none is, the same arrays again, which cannot be written to."""
        ended = np.flatnonzero(self.team.over).tolist()
        if not ended:
            return self._no_scores.copy()
        scores = copy.deepcopy(self._no_scores)
        for e in ended:
            self._add_info(scores, self.team.score(e), e)
        return scores


class Single:
    """One mission of a batch, of which a film or `make_traces` takes what it needs as of a batch of one."""

    def __init__(self, batch: MissionBatch, e: int):
        self.scenario, self.links, self.limitation, self.record = batch.scenario, batch.links, batch.limitation, batch.record
        own = slice(e, e + 1)
        self.seeds, self.worlds, self.time = batch.seeds[own], batch.worlds[own], batch.time[own]
        self.state, self.log = (type(arrays)(*(array[own] for array in arrays)) for arrays in (batch.state, batch.log))


def freeze(arrays: dict) -> None:
    """Let nobody write to the arrays of a nested dictionary."""
    for array in arrays.values():
        freeze(array) if isinstance(array, dict) else array.setflags(write=False)
