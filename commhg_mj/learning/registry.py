"""Learned methods by name: every module of learning/methods is one, and fills itself in."""

import importlib
import pkgutil
from collections.abc import Callable

from ..base.registries import Registry
from . import methods

METHODS = Registry("method", "commhg_mj.methods", adopt=lambda name, cls: method(name)(cls))


def method(name: str) -> Callable[[type], type]:
    """Register the decorated class: a module with `robot`, `operator`, `critic`, `scale` and `communicates`."""

    def register(cls):
        METHODS[name] = cls
        cls.name = name
        return cls

    return register


def find_method(name: str) -> type:
    """The class of that name.

    Raises:
      ValueError: there is none.
    """
    for module in pkgutil.iter_modules(methods.__path__):
        importlib.import_module(f"{methods.__name__}.{module.name}")
    return METHODS.find(name)
