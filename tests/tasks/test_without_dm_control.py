"""Where dm_control is missing, its face says how to get it, and the others work."""

import subprocess
import sys
from pathlib import Path

import commhg_mj
from commhg_mj.tasks import HOMES, NO_DM_CONTROL

CODE = """
import sys
sys.modules["dm_control"] = None
import commhg_mj, commhg_mj.cli, gymnasium
for name in {names}:
    try:
        getattr(commhg_mj.tasks, name)
    except ModuleNotFoundError as error:
        print(error)
env = gymnasium.make("commhg_mj/Surveillance-small-v0")
env.reset(seed=1)
print(len(env.step(env.action_space.sample() * 0)))
env = commhg_mj.tasks.parallel_env("small")
env.reset(seed=1)
print(len(env.step({{agent: env.action_space(agent).sample() * 0 for agent in env.agents}})))
env = commhg_mj.tasks.MissionVectorEnv(2, "small")
env.reset(seed=1)
print(len(env.step(env.action_space.sample() * 0)))
"""


def test_each_name_of_the_dm_control_face_gives_the_command_and_the_other_interfaces_step():
    names = [name for name, home in HOMES.items() if home == "suite"]
    assert "load" in names
    root = Path(commhg_mj.__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", CODE.format(names=names)], cwd=root, capture_output=True, text=True)
    assert done.stdout.splitlines() == [NO_DM_CONTROL] * len(names) + ["5"] * 3, done.stderr
