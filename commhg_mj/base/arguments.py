"""What public arguments refuse, each by its name, in one line; numpy's numbers count as Python's.

Every function returns the argument as its caller computes with it.
"""

import os
from collections.abc import Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np

LARGEST_SEED = 2**63 - 1
MOST_MISSIONS = 1_000_000  # of one call
MOST_WORKERS = 1024  # processes
LONGEST_WORDS = 80  # characters of a refused value


def said(value) -> str:
    """A refused value, in one line of a message."""
    words = " ".join(repr(value).split())
    return words if len(words) <= LONGEST_WORDS else f"{words[:LONGEST_WORDS]}…"


def whole(name: str, value, low: int, high: int | None = None) -> int:
    """A whole number in low..high."""
    if not _is_whole(value, low, high):
        bounds = f"of at least {low}" if high is None else f"in {low}..{high}"
        raise ValueError(f"{name} must be a whole number {bounds}, is {said(value)}")
    return int(value)


def _is_whole(value, low, high) -> bool:
    return not isinstance(value, bool) and isinstance(value, Integral) and low <= value and (high is None or value <= high)


def number(name: str, value, low: float, high: float) -> float:
    """A number in low..high; finite, as nothing bounds by infinity."""
    if not low <= _real(value) <= high:
        raise ValueError(f"{name} must be a number in {low:g}..{high:g}, is {said(value)}")
    return float(value)


def _real(value) -> float:
    """nan, which lies nowhere, for what is no number."""
    return float(value) if isinstance(value, Real) and not isinstance(value, bool) else np.nan


def positive(name: str, value) -> float:
    """A finite number above 0."""
    if not 0 < _real(value) < np.inf:
        raise ValueError(f"{name} must be positive, is {said(value)}")
    return float(value)


def second(name: str, value, last: float) -> float:
    """A second of a mission that lasts so long."""
    at = _real(value)
    if not 0 <= at <= last:
        lies = said(value) if np.isnan(at) else f"{at:g}"
        raise ValueError(f"{name} {lies} lies outside the mission, 0..{last:g} s")
    return at


def flag(name: str, value) -> bool:
    """True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"{name} must be True or False, is {said(value)}")
    return bool(value)


def one_of(name: str, value, choices: Sequence[str]) -> str:
    """One of some words."""
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"unknown {name} {said(value)}: use {', '.join(choices)}")
    return value


def names(name: str, value) -> list[str]:
    """At least one word, each once."""
    words = list(value) if isinstance(value, (list, tuple, np.ndarray)) else None
    if words is None or not all(isinstance(word, str) for word in words):
        raise ValueError(f"{name} must be a list of names, is {said(value)}")
    if not words:
        raise ValueError(f"{name}: at least one is needed")
    return list(dict.fromkeys(words))


def path_of(name: str, value) -> Path:
    """The name of a file or folder."""
    if not isinstance(value, (str, os.PathLike)):
        raise ValueError(f"{name} must be a path, is {said(value)}")
    return Path(value)


def instance(name: str, value, kind: type) -> Any:
    """An object of a class."""
    if not isinstance(value, kind):
        raise ValueError(f"{name} must be a {kind.__name__}, is {type(value).__name__}")
    return value


def options_of(name: str, value) -> dict:
    """Keyword arguments for somebody else; None is none."""
    return {} if value is None else instance(name, value, dict)


def numbers(name: str, value, *shape) -> np.ndarray:
    """Finite numbers as floats of a shape: None is any length, a first ... any axes before."""
    try:
        array = np.asarray(value)
    except ValueError:  # ragged
        array = np.empty(0, object)
    tail = shape[1:] if shape[:1] == (...,) else shape
    found = array.shape[array.ndim - len(tail) :] if len(tail) < len(shape) else array.shape
    fits = len(found) == len(tail) and all(wanted in (None, n) for wanted, n in zip(tail, found))
    if not fits or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        words = ", ".join("…" if n is ... else "n" if n is None else str(n) for n in shape)
        raise ValueError(f"{name} must be finite numbers of shape [{words}], is {array.dtype} of shape {list(array.shape)}")
    return array.astype(float)


def check_seed(seed) -> int:
    """The seed as an int; ValueError unless it is a whole number in 0..2^63 - 1."""
    if not _is_whole(seed, 0, LARGEST_SEED):
        raise ValueError(f"seed must be a whole number in 0..2^63 - 1, is {said(seed)}")
    return int(seed)


def missions_of(name: str, value) -> int:
    """How many missions are to be flown."""
    return whole(name, value, 1, MOST_MISSIONS)


def workers_of(value) -> int:
    """How many processes are to share the work."""
    return whole("workers", value, 1, MOST_WORKERS)


def seeds_of(seeds) -> list[int]:
    """One seed a mission, of anything that lists them."""
    try:
        found = None if isinstance(seeds, (str, bytes, dict)) else list(seeds)
    except (TypeError, OverflowError, MemoryError):
        found = None
    if found is None:
        raise ValueError(f"seeds must be a list or range of seeds, is {said(seeds)}")
    if not found:
        raise ValueError("seeds: at least one mission is needed")
    try:
        return [check_seed(seed) for seed in found]
    except ValueError as error:
        raise ValueError(f"seeds: {error}") from None
