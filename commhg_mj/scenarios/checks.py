"""What a scenario's fields refuse: each by its name, in one line."""

import dataclasses
import re

import numpy as np

from ..base.arguments import instance, said
from .heightmap import brightness

LONGEST_NAME = 64
NAME = re.compile(rf"[A-Za-z0-9][A-Za-z0-9._-]{{0,{LONGEST_NAME - 1}}}")  # names of scenarios go into names of files
UNNAMEABLE = re.compile(r"[^A-Za-z0-9._-]+")
RANGES = {
    ("world", "canopy_height"),
    ("world", "mountain_height"),
    ("tasks", "difficulty"),
    ("tasks", "deadline"),
    ("tasks", "decay"),
    ("operators", "capacity"),
    ("communication", "late_delay"),
}


def check(rules, prefix="") -> None:
    """ValueError unless every value of a dataclass has its field's type and lies in its field's bounds."""
    for field in dataclasses.fields(rules):
        name, kind = f"{prefix}{field.name}", type(field.default)
        value = _plain(getattr(rules, field.name))
        object.__setattr__(rules, field.name, value)
        if dataclasses.is_dataclass(kind):
            check(instance(name, value, kind), f"{name}.")
        elif field.metadata:
            _check_value(name, value, field)
            if (prefix.rstrip("."), field.name) in RANGES and value[0] > value[1]:
                raise ValueError(f"{name}: the lower end {value[0]} is above the upper end {value[1]}")


def _plain(value):
    """numpy's numbers and lists of them as Python's, which JSON holds."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    return tuple(map(_plain, value)) if isinstance(value, (list, tuple)) else value


def _check_value(name, value, field):
    default = field.default
    choices = field.metadata["choices"]
    if name == "world.heightmap":
        if not isinstance(value, str):
            raise ValueError(f"{name} must be the content of a picture, is {said(value)}")
        if value:
            brightness(value)
        return
    if choices:
        if value not in choices:
            raise ValueError(f"{name} must be one of {', '.join(choices)}, is {said(value)}")
        return
    if isinstance(default, str):
        if not isinstance(value, str) or not NAME.fullmatch(value):
            raise ValueError(f"{name} must be up to 64 letters, digits, '-', '_' or '.', and begin with one, is {said(value)}")
        return
    if isinstance(default, tuple) and not isinstance(value, tuple):
        raise ValueError(f"{name} must be a list of {len(default)} numbers, is {said(value)}")
    if isinstance(value, tuple) and not isinstance(default, tuple):
        raise ValueError(f"{name} must be one number, is {said(list(value))}")
    if isinstance(default, tuple) and name != "tasks.values" and len(value) != len(default):
        raise ValueError(f"{name} must hold {len(default)} numbers, holds {len(value)}")
    items = value if isinstance(value, tuple) else (value,)
    kind = default[0] if isinstance(default, tuple) else default
    if not items:
        raise ValueError(f"{name} must not be empty")
    for item in items:
        whole = isinstance(item, int) and not isinstance(item, bool)
        if not whole and (isinstance(kind, int) or not isinstance(item, float)):
            raise ValueError(f"{name} must be {'a whole number' if isinstance(kind, int) else 'a number'}, is {said(item)}")
        low, high = field.metadata["low"], field.metadata["high"]
        if not low <= item <= high:
            raise ValueError(f"{name} must lie in {low:g}..{high:g}, is {said(item)}")
