"""The missions as tasks for other people's algorithms: dm_control, Gymnasium and PettingZoo faces of one kernel.

>>> commhg_mj.tasks.load("surveillance", "medium")                  # dm_control
>>> gymnasium.make("commhg_mj/Surveillance-medium-v0")              # the whole team as one agent
>>> commhg_mj.tasks.parallel_env("medium")                          # PettingZoo, one agent an actor
"""

import importlib

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
