"""MAPPO of TorchRL: a shared policy a kind of actor (UAVs, UGVs, humans) and one critic who sees what all of them see.

    pip install torchrl
    python examples/mappo_torchrl.py            # about five minutes of one core
    python examples/mappo_torchrl.py --tiny     # seconds, and learns nothing

It prints the mean TWCR on held-out missions of three policies: what was trained, random open choices, and staying.
It shows that TorchRL runs on the interface, not that it learns well there: one run of one seed gave 0.111 +- 0.009,
0.083 +- 0.008 and 0.217 +- 0.006 on 20 missions, little above random choices and far below staying. Settings
were chosen partly on those missions. The wrapper, not the mission, takes most of the time: 5 to 7 ms a step.
"""

import warnings
from dataclasses import dataclass, replace

import numpy as np
import torch
import tyro
from gymnasium import spaces
from pettingzoo import ParallelEnv
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import ExplorationType, PettingZooWrapper, SerialEnv
from torchrl.modules import MLP, MaskedCategorical, MultiAgentMLP, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

import commhg_mj

HELD_OUT = 30_000  # the first of the missions that are never trained on


@dataclass(frozen=True)
class Args:
    scenario: str = "small"
    """small, medium or large"""
    frames: int = 30_000
    """steps of all environments together"""
    period: int = 5
    """s of a step; 0: to the next decision of anybody, which makes up to five times as many steps"""
    environments: int = 8
    """side by side"""
    rollout: int = 128
    """steps of each environment between two updates"""
    epochs: int = 5
    """passes over what was collected"""
    minibatch: int = 256
    """steps of the team"""
    learning_rate: float = 5e-4
    """of Adam, for policies and critic"""
    gamma: float = 0.995
    """discount of a second"""
    lmbda: float = 0.95
    """of GAE, a step"""
    entropy: float = 0.003
    """its weight in the loss"""
    missions: int = 20
    """held out, to score a policy"""
    seed: int = 1
    """of the training"""
    tiny: bool = False
    """a few steps, to see that all parts fit"""


class FlatEnv(ParallelEnv):
    """Our environment as TorchRL wants it: one scaled vector and one flat mask an agent, infos of the same keys always."""

    metadata = {"name": "commhg_mj_flat"}

    def __init__(self, scenario, period):
        self.env = commhg_mj.tasks.parallel_env(scenario, period=period, seeds=range(20_000))
        self.possible_agents, self.action_space = self.env.possible_agents, self.env.action_space
        self.tables = {agent: self.env.observation_space(agent)["observation"] for agent in self.possible_agents}

    @property
    def agents(self):  # a robot that fails leaves; use_mask pads its rows with zeros and its mask with True
        return self.env.agents

    def observation_space(self, agent):
        return spaces.Box(-1, 1, (spaces.flatdim(self.tables[agent]),), np.float32)

    def reset(self, seed=None, options=None):
        return self.flatten(*self.env.reset(seed=seed))

    def step(self, actions):
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        observations, infos = self.flatten(observations, infos)
        return observations, rewards, terminations, truncations, infos

    def flatten(self, observations, infos):
        """The wrapper takes a mask from the infos, and knows no other keys of them than the first reset's."""
        vectors, flat_infos = {}, {}
        for agent, seen in observations.items():
            # By the space's names: Gymnasium sorts them, the observation does not.
            scaled = [2 * (seen["observation"][k] - t.low) / (t.high - t.low) - 1 for k, t in self.tables[agent].items()]
            vectors[agent] = np.concatenate([table.ravel() for table in scaled])
            twcr, elapsed = infos[agent].get("twcr", 0.0), infos[agent]["elapsed"]
            flat_infos[agent] = {"action_mask": np.hstack(seen["action_mask"]), "elapsed": elapsed, "twcr": twcr}
        return vectors, flat_infos


class MaskedChoices(torch.distributions.Distribution):
    """A robot's independent choices [..., choices]; their logits and masks lie side by side in the last dimension."""

    arg_constraints = {}

    def __init__(self, logits, mask, sizes):
        parts = zip(logits.split(sizes, dim=-1), mask.split(sizes, dim=-1))
        self.parts = [MaskedCategorical(logits=part, mask=is_open) for part, is_open in parts]
        super().__init__(logits.shape[:-1], torch.Size([len(sizes)]), validate_args=False)

    def sample(self, sample_shape=()):
        return torch.stack([part.sample(sample_shape) for part in self.parts], dim=-1)

    def log_prob(self, value):
        return sum(part.log_prob(choice) for part, choice in zip(self.parts, value.unbind(-1)))

    def entropy(self):
        return sum(part.entropy() for part in self.parts)


class Critic(nn.Module):
    """The team's value of what all agents see. MultiAgentMLP(centralized=True) would show it one group alone."""

    def __init__(self):
        super().__init__()
        self.mlp = MLP(out_features=1, num_cells=[256, 128], activation_class=nn.Tanh)

    def forward(self, *observations):
        return self.mlp(torch.cat([group.flatten(-2) for group in observations], dim=-1))


def make_envs(n, scenario, period):
    def make_env():  # over when all agents are, not when one robot fails
        return PettingZooWrapper(FlatEnv(scenario, period), use_mask=True, done_on_any=False)

    return SerialEnv(n, make_env)


@torch.no_grad()
def score(envs, policy) -> str:
    """Mean TWCR of held-out missions, all flown at once, with its standard error."""
    n = envs.num_workers
    seen, twcr = envs.reset(list_of_kwargs=[{"seed": HELD_OUT + i} for i in range(n)]), torch.full([n], torch.nan)
    while twcr.isnan().any():
        step, seen = envs.step_and_maybe_reset(policy(seen))
        first = step["next", "done"].squeeze(-1) & twcr.isnan()
        twcr[first] = step["next", "human", "info", "twcr"][first, 0]
    return f"TWCR {twcr.mean():.3f} +- {twcr.std(correction=0) / n**0.5:.3f}"


def main(args: Args):
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)
    torch.distributions.Distribution.set_default_validate_args(False)  # faster
    warnings.filterwarnings("ignore", message="PettingZoo in TorchRL is tested")
    envs = make_envs(args.environments, args.scenario, args.period)
    envs.set_seed(args.seed)
    seen, actors, at_random, stay = envs.reset(), {}, [], []
    robot = tuple(envs.full_action_spec["uav", "action"].nvec.flatten()[-3:].tolist())
    for group in ("uav", "ugv", "human"):
        (n_agents, n_inputs), n_numbers = seen[group, "observation"].shape[-2:], seen[group, "action_mask"].shape[-1]
        kind, kwargs = (MaskedCategorical, {}) if group == "human" else (MaskedChoices, {"sizes": robot})
        net = MultiAgentMLP(n_inputs, n_numbers, n_agents, centralized=False, share_params=True, depth=2, num_cells=128)
        actors[group] = ProbabilisticActor(
            TensorDictModule(net, [(group, "observation")], [(group, "logits")]),
            in_keys={"logits": (group, "logits"), "mask": (group, "action_mask")},
            out_keys=[(group, "action")],
            distribution_class=kind,
            distribution_kwargs=kwargs,
            default_interaction_type=ExplorationType.RANDOM,  # sample, always
            return_log_prob=True,
            log_prob_key=(group, "action_log_prob"),
        )
        draw = lambda mask, kind=kind, kwargs=kwargs: kind(logits=torch.zeros(mask.shape), mask=mask, **kwargs).sample()
        at_random.append(TensorDictModule(draw, [(group, "action_mask")], [(group, "action")]))
        stay.append(TensorDictModule(lambda mask, draw=draw: 0 * draw(mask), [(group, "action_mask")], [(group, "action")]))
    policy = TensorDictSequential(*actors.values())
    critic = TensorDictModule(Critic(), [(group, "observation") for group in actors], ["state_value"])
    critic(seen)  # sizes its first layer

    # One clipped loss a group, over the agents that are there and have something to choose.
    losses = {g: ClipPPOLoss(actor, None, entropy_coeff=args.entropy, functional=False) for g, actor in actors.items()}
    for group, loss in losses.items():
        loss.set_keys(advantage=(group, "advantage"))
        loss.loss_mask_key = (group, "chooses")
    gae = GAE(gamma=args.gamma, lmbda=args.lmbda, value_network=critic, average_gae=True)
    parameters = [*policy.parameters(), *critic.parameters()]
    optimizer = torch.optim.Adam(parameters, lr=args.learning_rate)

    batch = args.environments * args.rollout
    collector = Collector(envs, policy, frames_per_batch=batch, total_frames=args.frames, auto_register_policy_transforms=False)
    for data in collector:
        # Humans never fail, so their reward is the team's; gamma is raised to the seconds of a step.
        data["next", "reward"] = data["next", "human", "reward"][..., 0, :]
        data["steps_to_next_obs"] = data["next", "human", "info", "elapsed"][..., :1]
        with torch.no_grad():
            gae(data)
        for group, n_choices in ("uav", 3), ("ugv", 3), ("human", 1):
            data[group, "chooses"] = data[group, "mask"] & (data[group, "action_mask"].sum(-1) > n_choices)
            data[group, "advantage"] = data["advantage"].unsqueeze(-2).expand(*data[group].shape, 1)
        steps = data.reshape(-1)
        for _ in range(args.epochs):
            for rows in torch.randperm(len(steps)).split(args.minibatch):
                part = steps[rows]
                said = [loss(part) for loss in losses.values()]
                error = nn.functional.mse_loss(critic(part)["state_value"], part["value_target"])
                optimizer.zero_grad()
                (sum(loss["loss_objective"] + loss["loss_entropy"] for loss in said) + error).backward()
                nn.utils.clip_grad_norm_(parameters, 1.0)
                optimizer.step()

    torch.set_num_threads(1)  # the collector has closed its environments, which raised it
    held_out = make_envs(args.missions, args.scenario, args.period)
    for name, who in {"trained": policy, "random": TensorDictSequential(*at_random), "stay": TensorDictSequential(*stay)}.items():
        print(f"{name}: {score(held_out, who)}")


if __name__ == "__main__":
    args = tyro.cli(Args, description=__doc__)
    main(replace(args, frames=32, period=20, environments=2, rollout=16, epochs=1, missions=2) if args.tiny else args)
