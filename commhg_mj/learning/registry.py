"""Learned methods by name: every module of learning/methods is one, and fills itself in."""

import importlib
import pkgutil

from . import methods

METHODS = {}


def method(name: str):
    """Register the decorated class: a module with `robot`, `operator`, `critic`, `scale` and `communicates`."""

    def register(cls):
        METHODS[name] = cls
        cls.name = name
        return cls

    return register


def find_method(name: str):
    """The class of that name.

    Raises:
      ValueError: there is none.
    """
    for module in pkgutil.iter_modules(methods.__path__):
        importlib.import_module(f"{methods.__name__}.{module.name}")
    if name not in METHODS:
        raise ValueError(f"unknown method {name!r}: use {', '.join(METHODS)}")
    return METHODS[name]
