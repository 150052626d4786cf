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
# From Python 3.13 on plain pip leaves dm_control out: it requires labmaze, which cannot be had there and which we do not need.
NO_DM_CONTROL = "the dm_control face needs dm_control: pip install --no-deps dm_control==1.0.50"


def __getattr__(name):
    if name not in HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(importlib.import_module(f".{HOMES[name]}", __name__), name)
    except ModuleNotFoundError as error:
        if str(error.name).partition(".")[0] != "dm_control":
            raise
        raise ModuleNotFoundError(NO_DM_CONTROL, name="dm_control") from None


def __dir__():
    return __all__


class _BeforeDmControl:
    """Finds no module, but an OpenGL that needs no screen, as soon as anybody imports dm_control: not before, it takes time."""

    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == "dm_control":
            importlib.import_module("..base.opengl", __name__).choose_backend()


sys.meta_path.insert(0, _BeforeDmControl)
