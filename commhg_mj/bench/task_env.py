"""Missions as other people's trainers want them: one vector and one mask an agent, one choice, the same agents to the end."""

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from ..tasks.parallel import MissionParallelEnv


class TaskEnv(ParallelEnv):
    """A robot chooses its task, and says and asks nothing; one that has failed stays, and has only KEEP open."""

    metadata = {"name": "commhg_mj_tasks"}

    def __init__(self, scenario):
        self.env = MissionParallelEnv(scenario)
        self.possible_agents = self.env.possible_agents
        self.agents, self.seen = [], {}
        self.sizes = {agent: first_choice(self.env.action_space(agent)) for agent in self.possible_agents}
        self.action_spaces = {agent: spaces.Discrete(n) for agent, n in self.sizes.items()}
        self.observation_spaces = {agent: self._space(agent) for agent in self.sizes}

    def _space(self, agent):
        flat = spaces.flatdim(self.env.observation_space(agent)["observation"])
        vector = spaces.Box(-np.inf, np.inf, (flat,), np.float32)
        return spaces.Dict({"observation": vector, "action_mask": spaces.MultiBinary(self.sizes[agent])})

    def observation_space(self, agent) -> spaces.Space:
        return self.observation_spaces[agent]

    def action_space(self, agent) -> spaces.Space:
        return self.action_spaces[agent]

    def reset(self, seed=None, options=None) -> tuple[dict, dict]:
        observations, _ = self.env.reset(seed)
        self.agents = self.possible_agents[:]
        return self._keep(observations), {agent: {} for agent in self.agents}

    def step(self, actions) -> tuple[dict, dict, dict, dict, dict]:
        joint = {agent: (choice, 0, 0) if is_robot(agent) else choice for agent, choice in actions.items()}
        observations, rewards, *_ = self.env.step(joint)
        reward, over, agents = next(iter(rewards.values())), not self.env.agents, self.agents  # the team's; humans never leave
        observations = self._keep(observations)
        if over:
            self.agents = []
        return (
            observations, dict.fromkeys(agents, reward), dict.fromkeys(agents, over), dict.fromkeys(agents, False),
            {agent: {} for agent in agents},
        )  # fmt: skip

    def _keep(self, observations):
        for agent, last in self.seen.items():
            last["action_mask"] = np.eye(1, self.sizes[agent], dtype=np.int8)[0]
        for agent, new in observations.items():
            mask = new["action_mask"][0] if is_robot(agent) else new["action_mask"]
            vector = np.concatenate([table.ravel() for table in new["observation"].values()]).astype(np.float32)
            self.seen[agent] = {"observation": vector, "action_mask": mask.astype(np.int8)}
        return {agent: dict(last) for agent, last in self.seen.items()}


def is_robot(agent: str) -> bool:
    """Whether a uav_… or ugv_…; the others are human_…"""
    return agent.startswith("u")


def first_choice(space: spaces.Discrete | spaces.MultiDiscrete) -> int:
    """Options of an agent's first choice."""
    return int(space.nvec[0] if isinstance(space, spaces.MultiDiscrete) else space.n)
