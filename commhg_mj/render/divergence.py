"""Two traces of one mission: whether they are that, and where their decisions part."""

from typing import NamedTuple

import numpy as np

from ..base.arguments import instance
from ..base.terms import IDLE, KEEP, NOBODY, REST
from ..mission.recorder import NOT_DECIDED
from ..mission.trace import Trace
from ..scenarios import describe

ROBOT_COLUMNS = ("robot_choice", "robot_broadcast", "robot_query", "robot_request")
OPERATOR_COLUMNS = ("operator_choice",)
TASK_WORDS = {NOT_DECIDED: "no decision", KEEP: "keeps its task", IDLE: "idles"}
OPERATOR_WORDS = {NOT_DECIDED: "no decision", KEEP: "keeps its robot", REST: "rests"}


class Divergence(NamedTuple):
    """The first decision that differs: who took it, and what it was on either side, in words."""

    second: int
    actor: str  # as in "uav2" or "operator1"
    left: str
    right: str


def check_same_mission(left, right, names=("left", "right")) -> None:
    """Refuse two traces of different missions; `names` are what the message calls them. Their radios may differ.

    Raises:
      ValueError: another scenario or seed; the message names the first difference.
    """
    _check_traces(left, right, names)
    for (fact, one), (_, other) in zip(_facts(left), _facts(right)):
        if one != other:
            raise ValueError(f"{names[0]} and {names[1]} are not the same mission: {fact} {one} and {other}")


def _check_traces(left, right, names=("left", "right")):
    for name, trace in zip(names, (left, right)):
        instance(name, trace, Trace)


def _facts(trace):
    """(name, value) of everything that makes a mission what it is."""
    fields = (field for field in describe(trace.scenario) if not field[0].startswith("radio."))
    yield from ((f"scenario's {field}", value) for field, value, *_ in fields)
    yield "seed", trace.seed


def first_divergence(left, right) -> Divergence | None:
    """Where the decisions of two traces of one mission part, robots before operators; None while both last the same."""
    _check_traces(left, right)
    found = []
    for kind, columns in (("robot", ROBOT_COLUMNS), ("operator", OPERATOR_COLUMNS)):
        seconds, actors = np.nonzero(_differs(left, right, columns))
        if len(seconds):
            found.append((int(seconds[0]), kind != "robot", int(actors[0])))
    if not found:
        return None
    second, is_operator, i = min(found)
    words = _operator_words if is_operator else _robot_words
    actor = f"operator{i}" if is_operator else left.scenario.robot_names[i]
    return Divergence(second, actor, words(left, second, i), words(right, second, i))


def _differs(left, right, columns):
    """[seconds that both lasted, actors] bool: whether any of the columns differs."""
    rows = min(len(left.robot_xy), len(right.robot_xy))
    return np.any([getattr(left, name)[:rows] != getattr(right, name)[:rows] for name in columns], axis=0)


def _robot_words(trace, second, robot):
    choice, broadcast, query, request = (getattr(trace, name)[second, robot] for name in ROBOT_COLUMNS)
    words = [TASK_WORDS.get(int(choice), f"task {choice}")]
    if broadcast:
        words.append("broadcasts")
    if query != NOBODY:
        words.append(f"asks operator {query}")
    if request:
        words.append("requests assistance")
    return ", ".join(words)


def _operator_words(trace, second, operator):
    choice = int(trace.operator_choice[second, operator])
    return OPERATOR_WORDS.get(choice) or f"takes {trace.scenario.robot_names[choice]}"
