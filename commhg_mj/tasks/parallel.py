"""Every actor as one PettingZoo agent."""

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv

from ..base.arguments import check_seed, instance, said
from ..base.terms import Activity
from .choices import PER_ROBOT, as_array
from .gym import RENDER_FPS, check_render_mode, make_film
from .spaces import table_space
from .team import Team

# Name in the observation: the team's table. No "self": TorchRL's specs take names as keywords of methods.
ROBOT_VIEW = {"own": "robots", "tasks": "robot_tasks", "peers": "robot_peers", "operators": "robot_operators"}
OPERATOR_VIEW = {"own": "operators", "reports": "operator_reports"}


class Role:
    """What one actor sees and chooses of its team's tables and action.

    Args:
      actor: robots, then operators.
    """

    def __init__(self, team: Team, actor: int):
        scenario, sizes, n_robots = team.scenario, team.choices.sizes, team.scenario.n_robots
        is_robot = actor < n_robots
        first = PER_ROBOT * min(actor, n_robots) + max(0, actor - n_robots)
        self.choices = slice(first, first + (PER_ROBOT if is_robot else 1))
        self.row, self.view = (actor, ROBOT_VIEW) if is_robot else (actor - n_robots, OPERATOR_VIEW)
        own, starts = sizes[self.choices].tolist(), team.choices.starts[self.choices].tolist()
        self.masks = tuple(slice(start, start + size) for start, size in zip(starts, own))
        view = spaces.Dict({name: table_space(table, scenario, drop=1) for name, table in self.view.items()})
        mask = spaces.Tuple(spaces.MultiBinary(size) for size in own) if is_robot else spaces.MultiBinary(own[0])
        self.observation_space = spaces.Dict({"observation": view, "action_mask": mask})
        self.action_space = spaces.MultiDiscrete(own) if is_robot else spaces.Discrete(own[0])

    def observe(self, tables: dict, mask) -> dict:
        """Views of the role's rows; a mask a choice, an operator's alone."""
        masks = tuple([mask[own] for own in self.masks])
        row = self.row
        seen = {name: tables[table][row] for name, table in self.view.items()}
        return {"observation": seen, "action_mask": masks if len(masks) > 1 else masks[0]}


def parallel_env(scenario="medium", **kwargs) -> "MissionParallelEnv":
    """A mission as a PettingZoo parallel environment; arguments as for `MissionParallelEnv`."""
    return MissionParallelEnv(scenario, **kwargs)


class MissionParallelEnv(ParallelEnv):
    """Agents uav_0, …, ugv_0, …, human_0, …, who share the team's reward, stepped to the next decision epoch of anybody.

    An agent that is not due keeps what it saw when it last was, and has only KEEP open. A robot that fails is terminated
    and leaves `agents`. A masked choice counts as staying. Observations, actions and masks: docs/tasks.md.

    Args:
      scenario, render_mode, camera, size, record, options: as for `MissionEnv`.

    Raises:
      ValueError: an argument is impossible; the message names it.
    """

    metadata = {"name": "commhg_mj_v0", "render_modes": ["rgb_array"], "render_fps": RENDER_FPS, "is_parallelizable": True}

    def __init__(self, scenario="medium", render_mode=None, camera="overview", size=(960, 540), record=False, **options):
        check_render_mode(render_mode, self.metadata)
        self.render_mode = render_mode
        self.team = Team(scenario, record=record if render_mode is None else True, **options)
        self._film = make_film(self.team, render_mode, camera, size)
        scenario = self.team.scenario
        robots = [f"{name[:3]}_{name[3:]}" for name in scenario.robot_names]
        self.possible_agents = robots + [f"human_{h}" for h in range(scenario.n_operators)]
        self.agents = []
        self._roles = {agent: Role(self.team, i) for i, agent in enumerate(self.possible_agents)}
        self.np_random = None

    def observation_space(self, agent) -> spaces.Dict:
        """{"observation": the role's tables, "action_mask": …}."""
        return self._role(agent).observation_space

    def action_space(self, agent) -> spaces.Discrete | spaces.MultiDiscrete:
        """Robots: MultiDiscrete (task, broadcast, message); humans: Discrete."""
        return self._role(agent).action_space

    def reset(self, seed=None, options=None) -> tuple[dict, dict]:
        """A new mission: of that seed, or the next one that the last seed leads to. There are no options."""
        seed = None if seed is None else check_seed(seed)
        if seed is not None or self.np_random is None:
            self.np_random, _ = seeding.np_random(seed)
        self.team.begin([self.team.draw_seed(self.np_random) if seed is None else seed])
        self.agents = self.possible_agents[:]
        observations = self._observe()
        return observations, self._inform(observations)

    def step(self, actions) -> tuple[dict, dict, dict, dict, dict]:
        """Decide, and advance to the next decision epoch; agents without an action stay, those that are gone are ignored.

        Raises:
          ValueError: an action that does not exist, or of an unknown agent; nothing has changed then.
        """
        self.team.step(self._join(actions), alone=True)
        observations = self._observe()
        infos = self._inform(observations)
        reward, over = float(self.team.rewards[0]), bool(self.team.over[0])
        failed = self.team.batch.state.robots["activity"][0] == Activity.FAILED
        gone = {agent for agent, has_failed in zip(self.possible_agents, failed) if has_failed or over}
        terminations = {agent: over or agent in gone for agent in self.agents}
        rewards, truncations = dict.fromkeys(self.agents, reward), dict.fromkeys(self.agents, False)
        self.agents = [agent for agent in self.agents if not terminations[agent]]
        return observations, rewards, terminations, truncations, infos

    def render(self) -> np.ndarray | None:
        """The mission as it stands [height, width, 3] u1; None without a render mode. ResetNeeded before the first reset."""
        if self._film is None:
            return None
        return self._film.picture(self.team.batch)

    def close(self) -> None:
        if self._film:
            self._film.close()

    def _role(self, agent):
        if not isinstance(agent, str) or agent not in self._roles:
            raise ValueError(f"unknown agent {said(agent)}: use {', '.join(self.possible_agents)}")
        return self._roles[agent]

    def _join(self, actions):
        """The team's action of the agents' ones."""
        joint = np.zeros(len(self.team.choices.sizes))
        present = set(self.agents)
        for agent, action in instance("actions", actions, dict).items():
            own = self._role(agent).choices
            if agent in present:
                values = as_array(action)
                if values.size != own.stop - own.start or values.ndim > 1 or values.dtype.kind not in "iuf":
                    raise ValueError(f"action of {agent} must fit {self.action_space(agent)}, is {said(action)}")
                joint[own] = values
        return joint

    def _observe(self):
        """Views into one copy of the team's tables and masks."""
        tables = {name: table[0].copy() for name, table in self.team.tables._asdict().items()}
        mask = self.team.mask[0].copy()
        return {agent: self._roles[agent].observe(tables, mask) for agent in self.agents}

    def _inform(self, observations):
        team = self.team
        common = {"time": float(team.time[0]), "elapsed": float(team.elapsed[0])}
        if team.over[0]:
            common["twcr"] = team.batch.scores()[0].twcr
        due = dict(zip(self.possible_agents, team.due[0].astype(bool).tolist()))
        return {agent: {"due": due[agent], "action_mask": seen["action_mask"], **common} for agent, seen in observations.items()}
