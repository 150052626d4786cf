"""A policy of one's own, by hand: robots take what pays soonest, humans help the robot that asked last.

    python examples/own_policy.py                         # five missions, a few seconds
    python examples/own_policy.py --video runs/own        # and a film of the first, about a minute (needs moviepy)

It prints the TWCR of every mission beside that of doing nothing: on small about 0.7 beside 0.2. The policy reads tables by the
names of their columns and chooses among what the masks leave open, so it runs on any scenario as it stands.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import gymnasium
import numpy as np
import tyro

from commhg_mj.tasks import COLUMNS  # registers the missions, too

HELD_OUT = 30_000  # the first of the missions that the learning examples never train on
FRESH = 60.0  # s: older reports and requests are not believed
HARD = 0.5  # difficulty from which a robot asks for help
TIRED = 0.75  # fatigue from which a human rests
STAY, FIRST = 0, 2  # a choice's first number changes nothing, the second drops what is held, the others name something


@dataclass(frozen=True)
class Args:
    scenario: str = "small"
    """small, medium or large"""
    missions: int = 5
    """held out"""
    video: Path | None = None
    """folder of a film of the first mission"""
    frames: int = 0
    """of the film; 0: the whole mission"""
    tiny: bool = False
    """one mission, to see that all parts fit"""


def column(observation, table, name):
    """One column of a table, for all its rows."""
    return observation[table][..., COLUMNS[table].index(name)]


def own_policy(env, observation):
    """The team's action."""
    choices = env.unwrapped.team.choices
    masks = dict(zip(choices.names, choices.split(observation["action_mask"])))  # by "uav0 task", "operator1 robot", …
    chosen = dict.fromkeys(choices.names, STAY)
    for r, name in enumerate(env.unwrapped.team.scenario.robot_names):
        chosen[f"{name} task"] = choose_task(observation, r, masks[f"{name} task"])
        chosen[f"{name} broadcast"] = int(masks[f"{name} broadcast"][1])
        chosen[f"{name} message"] = choose_message(observation, r, masks[f"{name} message"])
    for h in range(env.unwrapped.team.scenario.n_operators):
        chosen[f"operator{h} robot"] = choose_robot(observation, h, masks[f"operator{h} robot"])
    return np.array(list(chosen.values()))


def choose_task(observation, r, mask):
    """What it has; else the open task with the most value a second that no peer is known to go to."""
    if mask[STAY]:
        return STAY
    tasks = {name: column(observation, "robot_tasks", name)[r] for name in COLUMNS["robot_tasks"]}
    seconds = tasks["distance"] / column(observation, "robots", "speed")[r] + 20 + 80 * tasks["difficulty"]
    late = np.maximum(0.0, observation["time"] + seconds - tasks["deadline"])
    worth = tasks["value"] * np.exp(-late / np.maximum(tasks["decay"], 1.0)) / seconds
    is_taken = (tasks["claimed_by"] >= 0) & (tasks["claim_age"] < FRESH)
    worth[(mask[FIRST:] == 0) | is_taken] = 0.0
    return FIRST + worth.argmax() if worth.any() else FIRST - 1


def choose_message(observation, r, mask):
    """A request for assistance, the last number, while it works on something hard; not too often."""
    task, asked = (int(column(observation, "robots", name)[r]) for name in ("task", "since_request"))
    is_hard = task >= 0 and column(observation, "robot_tasks", "difficulty")[r, task] > HARD
    return len(mask) - 1 if mask[-1] and is_hard and not 0 <= asked < FRESH else STAY


def choose_robot(observation, h, mask):
    """Keeps whom it has, rests when tired, else bids for the robot with the freshest request that nobody controls."""
    is_tired = column(observation, "operators", "fatigue")[h] >= TIRED
    if is_tired or mask[STAY]:
        return FIRST - 1 if is_tired and mask[FIRST - 1] else STAY
    age = column(observation, "operator_reports", "request_age")[h]
    is_free = column(observation, "operator_reports", "controller")[h] < 0
    age = np.where((mask[FIRST:] > 0) & is_free & (age >= 0) & (age < FRESH), age, np.inf)
    return FIRST + age.argmin() if np.isfinite(age).any() else STAY


def nothing(env, observation):
    """Robots finish what they began with, and wait."""
    return np.zeros(env.action_space.shape, int)


def fly(env, seed, policy, frames=0) -> float:
    """TWCR of a mission; nan if it was left after so many steps."""
    observation, info = env.reset(seed=seed)
    is_over, steps = False, 0
    while not is_over and (frames == 0 or steps < frames):
        observation, _, is_over, _, info = env.step(policy(env, observation))
        steps += 1
    return info.get("twcr", np.nan)


def main(args: Args):
    env_id, seeds = f"commhg_mj/Surveillance-{args.scenario}-v0", range(HELD_OUT, HELD_OUT + args.missions)
    env = gymnasium.make(env_id)
    for policy in (own_policy, nothing):
        twcr = [fly(env, seed, policy) for seed in seeds]
        print(f"{policy.__name__}: TWCR {np.mean(twcr):.3f} of {', '.join(f'{one:.3f}' for one in twcr)}")
    if args.video:
        film = gymnasium.make(env_id, render_mode="rgb_array", size=(640, 360))
        film = gymnasium.wrappers.RecordVideo(film, str(args.video), video_length=args.frames, name_prefix=args.scenario)
        fly(film, seeds[0], own_policy, args.frames)
        film.close()
        print(*sorted(map(str, args.video.glob(f"{args.scenario}-*.mp4"))))


if __name__ == "__main__":
    args = tyro.cli(Args, description=__doc__)
    main(replace(args, missions=1) if args.tiny else args)
