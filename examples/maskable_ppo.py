"""MaskablePPO of sb3-contrib learns to lead a whole team, as it comes: MultiInputPolicy, VecNormalize, action_masks().

    python examples/maskable_ppo.py                     # about eight minutes of one core
    python examples/maskable_ppo.py --tiny              # seconds, learns nothing

"""

import os
import time
from dataclasses import dataclass
from pathlib import Path

import gymnasium
import numpy as np
import torch
import tyro
from sb3_contrib import MaskablePPO
from sb3_contrib.common.maskable.utils import is_masking_supported
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecNormalize
from stable_baselines3.common.logger import configure

import commhg_mj  # registers the missions
from commhg_mj.study.statistics import mean_interval

HELD_OUT = 30000  # the first seed of the missions that are never trained on


@dataclass
class Args:
    scenario: str = "small"
    steps: int = 150_000  # of all environments together; a step ends when somebody decides again
    envs: int = 8
    rollout: int = 256  # steps of each environment between two updates
    missions: int = 100  # held out
    gamma: float = 0.99  # a step
    lr: float = 3e-4
    ent: float = 0.01
    epochs: int = 5
    keep_bias: float = 0.0
    normrew: bool = True
    norm: bool = True
    arch: int = 64
    seed: int = 1
    out: Path = Path("runs/maskable_ppo")
    tiny: bool = False


args = tyro.cli(Args)
torch.set_num_threads(1)
env_id = f"commhg_mj/Surveillance-{args.scenario}-v0"


def play(choose) -> np.ndarray:
    missions = gymnasium.make_vec(env_id, num_envs=args.missions)
    seen, info = missions.reset(seed=HELD_OUT)
    twcr = np.full(args.missions, np.nan)
    while np.isnan(twcr).any():
        seen, _, over, _, info = missions.step(choose(seen))
        first = over & np.isnan(twcr)
        if first.any():
            twcr[first] = info["twcr"][first]
    return twcr

nvec = None
rng = np.random.default_rng(0)
def random_masked(seen):
    keys = np.where(seen["action_mask"] > 0, rng.random(seen["action_mask"].shape), -1)
    return np.stack([k.argmax(1) for k in np.split(keys, np.cumsum(nvec)[:-1], 1)], 1)

env = make_vec_env(env_id, n_envs=args.envs, seed=args.seed, env_kwargs={"seeds": range(20000)})
nvec = env.action_space.nvec
tables = [k for k, s in env.observation_space.spaces.items() if isinstance(s, gymnasium.spaces.Box)]
env = VecNormalize(env, gamma=args.gamma, norm_obs_keys=tables, norm_obs=args.norm, norm_reward=args.normrew)
print("masking", is_masking_supported(env))
model = MaskablePPO("MultiInputPolicy", env, n_steps=args.rollout, batch_size=512, n_epochs=args.epochs, gamma=args.gamma,
    gae_lambda=0.95, ent_coef=args.ent, learning_rate=args.lr, seed=args.seed, device="cpu", verbose=0, policy_kwargs={"net_arch": [args.arch, args.arch]})
if args.keep_bias:
    starts = np.cumsum(nvec) - nvec
    with torch.no_grad():
        for s, n in zip(starts, nvec):
            if n > 2: model.policy.action_net.bias[s] = args.keep_bias
def policy(det):
    return lambda seen: model.predict(env.normalize_obs(seen), action_masks=seen["action_mask"], deterministic=det)[0]

print("stay", mean_interval(play(lambda seen: np.zeros((args.missions, len(nvec)), int))))
print("random", mean_interval(play(random_masked)))
print("untrained", mean_interval(play(policy(False))))

class Log(BaseCallback):
    def _on_rollout_end(self):
        eb = self.model.ep_info_buffer
        lg = self.model.logger.name_to_value
        if eb and self.num_timesteps // (args.envs*args.rollout) % 6 == 0:
            print(self.num_timesteps, f"{time.process_time()-t0:.0f}s", "R %.3f len %.0f" % (np.mean([e["r"] for e in eb]), np.mean([e["l"] for e in eb])), {k.split('/')[1]: round(float(v),4) for k,v in lg.items() if k.startswith('train/')}, flush=True)
    def _on_step(self): return True
t0 = time.process_time()
model.learn(args.steps, callback=Log())
print("train", time.process_time()-t0)
print("trained det", mean_interval(play(policy(True))))
print("trained sto", mean_interval(play(policy(False))))
