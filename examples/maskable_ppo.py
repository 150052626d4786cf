"""MaskablePPO of sb3-contrib leads a whole team: MultiInputPolicy, VecNormalize and action_masks(), as they come.

    python examples/maskable_ppo.py            # about eight minutes of one core
    python examples/maskable_ppo.py --tiny     # seconds, and learns nothing

It prints the mean TWCR on held-out missions of staying, of random open choices, and of the network before and after training.
Not a result: the settings here were never run to their end. The untrained network already keeps what it has, and steps last ten
seconds; most of what it scores over random choices comes from these two, not from learning. The missions that it is scored
on were also looked at while settings were chosen.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import gymnasium
import numpy as np
import torch
import tyro
from sb3_contrib import MaskablePPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecNormalize

import commhg_mj  # noqa: F401  registers the missions

HELD_OUT = 30_000  # the first of the missions that are never trained on


@dataclass(frozen=True)
class Args:
    scenario: str = "small"
    """small, medium or large"""
    steps: int = 300_000
    """of all environments together"""
    period: int = 10
    """seconds of a step; 0: until somebody decides again"""
    keep: float = 4.0
    """first logit of KEEP, of tasks and of robots to control"""
    environments: int = 16
    """side by side"""
    rollout: int = 256
    """steps of each environment between two updates"""
    gamma: float = 0.97
    """discount of a step"""
    missions: int = 100
    """held out, to score a policy"""
    seed: int = 1
    """of the training"""
    out: Path = Path("runs/maskable_ppo.zip")
    """the trained model"""
    tiny: bool = False
    """a few steps, to see that all parts fit"""


def score(env_id, n_missions, period, choose) -> str:
    """Mean TWCR of held-out missions, all flown at once, with its standard error."""
    missions = gymnasium.make_vec(env_id, num_envs=n_missions, vectorization_mode="vector_entry_point", period=period)
    seen, _ = missions.reset(seed=HELD_OUT)
    twcr = np.full(n_missions, np.nan)
    while np.isnan(twcr).any():
        seen, _, over, _, info = missions.step(choose(seen))
        first = over & np.isnan(twcr)
        if first.any():
            twcr[first] = info["twcr"][first]
    return f"TWCR {twcr.mean():.3f} +- {twcr.std() / np.sqrt(n_missions):.3f}"


def main(args: Args):
    torch.set_num_threads(1)
    env_id = f"commhg_mj/Surveillance-{args.scenario}-v0"
    env = make_vec_env(env_id, args.environments, seed=args.seed, env_kwargs={"seeds": range(20_000), "period": args.period})
    tables = [name for name, space in env.observation_space.items() if isinstance(space, gymnasium.spaces.Box)]
    env = VecNormalize(env, gamma=args.gamma, norm_obs_keys=tables)  # all but flags and masks
    sizes, rng = env.action_space.nvec, np.random.default_rng(0)

    def stay(seen):
        return np.zeros((args.missions, len(sizes)), int)

    def at_random(seen):
        keys = np.where(seen["action_mask"] > 0, rng.random(seen["action_mask"].shape), -1.0)
        return np.stack([part.argmax(axis=1) for part in np.split(keys, np.cumsum(sizes)[:-1], axis=1)], axis=1)

    def likeliest(seen):
        return model.predict(env.normalize_obs(seen), action_masks=seen["action_mask"], deterministic=True)[0]

    def sampled(seen):
        return model.predict(env.normalize_obs(seen), action_masks=seen["action_mask"])[0]

    def show(name, choose):
        print(f"{name}: {score(env_id, args.missions, args.period, choose)}", flush=True)

    model = MaskablePPO(
        "MultiInputPolicy", env, learning_rate=5e-4, n_steps=args.rollout, batch_size=2048, n_epochs=6, gamma=args.gamma,
        seed=args.seed, device="cpu",
    )  # fmt: skip
    names = env.get_attr("team")[0].choices.names  # "uav0 task", "uav0 broadcast", "uav0 message", …, "operator0 robot"
    holds = [name.endswith((" task", " robot")) for name in names]
    with torch.no_grad():
        model.policy.action_net.bias[(np.cumsum(sizes) - sizes)[holds]] += args.keep
    show("stay", stay)
    show("random", at_random)
    show("untrained, sampled", sampled)
    show("untrained, likeliest", likeliest)
    model.learn(args.steps)
    show("trained, sampled", sampled)
    show("trained, likeliest", likeliest)
    args.out.parent.mkdir(parents=True, exist_ok=True)
    model.save(args.out)
    env.save(args.out.with_suffix(".normalize.pkl"))


if __name__ == "__main__":
    args = tyro.cli(Args, description=__doc__)
    main(replace(args, steps=64, environments=2, rollout=32, missions=4) if args.tiny else args)
