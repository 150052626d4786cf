"""The missions as tasks for other people's algorithms: dm_control, Gymnasium and PettingZoo faces of one kernel.

>>> commhg_mj.tasks.load("surveillance", "medium")                  # dm_control
>>> gymnasium.make("commhg_mj/Surveillance-medium-v0")              # the whole team as one agent
>>> commhg_mj.tasks.parallel_env("medium")                          # PettingZoo, one agent an actor
"""

import importlib
import sys

# Each interface is loaded when it is first asked for: nobody needs all of their libraries.
HOMES = {
    "ALL_TASKS": "suite", "BENCHMARKING": "suite", "EASY": "suite", "HARD": "suite", "load": "suite",
    "COLUMNS": "columns", "MissionEnv": "gym", "MissionVectorEnv": "vector", "parallel_env": "parallel", "Team": "team",
}  # fmt: skip
__all__ = list(HOMES)


def __getattr__(name):
    if name not in HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{HOMES[name]}", __name__), name)


def __dir__():
    return __all__


class _BeforeDmControl:
    """Finds no module, but an OpenGL that needs no screen, as soon as anybody imports dm_control: not before, it takes time."""

    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == "dm_control":
            importlib.import_module("..base.opengl", __name__).choose_backend()


sys.meta_path.insert(0, _BeforeDmControl)
