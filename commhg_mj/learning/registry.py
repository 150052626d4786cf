"""Learned methods by name: every module of learning/methods is one, and fills itself in."""

import importlib
import pkgutil
from collections.abc import Callable
from typing import NamedTuple

from torch import Tensor, nn

from ..base.registries import Registry
from . import methods
from .critic import ReturnScale
from .graphs import NOTHING_MORE
from .heads import RobotLogits
from .plan_reader import PlanReader

METHODS = Registry("method", "commhg_mj.methods", adopt=lambda name, cls: method(name)(cls))


class About(NamedTuple):
    """A method in the table of methods (docs/learning.md), in words."""

    source: str = ""  # where it comes from
    reads: str = ""  # what its actors read
    relations: str = ""  # along which messages or attention pass
    heads: str = ""  # what its robots decide beside their task
    critic: str = ""  # what its critic reads
    inferred: str = ""  # what is ours, since no source says it or our missions need it otherwise


class Method(nn.Module):
    """What every learned method has. A subclass names its networks, and changes what it needs otherwise.

    Args:
      robot: (`batches.RobotBatch`, public table) -> `heads.RobotLogits`.
      operator: `OperatorGraphs` of tensors -> [K, 2 + R] logits of KEEP, REST and the robots.
      critic: values; see learning/critic.py for what it may read.

    Attributes:
      name: that it is registered under.
      communicates: broadcasts, queries and requests are the heads' to choose; otherwise the fixed schedule does, or the planner.
      picks_first: its robots choose their first targets at t = 0, one after the other; otherwise the initializer does.
      wants: what its graphs hold beside what all get.
      may_read_plans: it can be trained with the planner's numbers.
      plan: what reads them, None: nothing does.
    """

    name: str = ""
    communicates = False
    picks_first = False
    may_read_plans = True
    wants = NOTHING_MORE
    about = About()

    def __init__(self, robot: nn.Module, operator: nn.Module, critic: nn.Module):
        super().__init__()
        self.robot, self.operator, self.critic, self.scale = robot, operator, critic, ReturnScale()
        self.plan = None

    def read_plans(self) -> "Method":
        """Let it read the planner's numbers, too, and say what the planner would on its choices; before anything is learned.

        Raises:
          ValueError: this method never does.
        """
        if not self.may_read_plans:
            raise ValueError(f"plans: {self.name} never reads the planner's numbers")
        self.plan, self.wants, self.communicates = PlanReader(), self.wants._replace(plans=True), False
        return self

    def robot_logits(self, graphs, public: Tensor) -> RobotLogits:
        """What its robots' networks say of a `batches.RobotBatch`."""
        logits = self.robot(graphs, public)
        return logits if self.plan is None else self.plan.robots(graphs, logits)

    def operator_logits(self, graphs) -> Tensor:
        """[K, 2 + R] what its operators' network says of `OperatorGraphs` of tensors."""
        logits = self.operator(graphs)
        return logits if self.plan is None else self.plan.operators(graphs, logits)

    def auxiliary(self, decided, rng) -> Tensor | None:
        """A further loss of a minibatch, learned from the true state in training alone; None: there is none.

        Args:
          decided: `ppo.Minibatch`, what its actors saw and the true states of the same seconds.
          rng: numpy Generator for noise.
        """
        return None


def method(name: str) -> Callable[[type], type]:
    """Register the decorated class, a `Method` that is made without arguments."""

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


def make_method(name: str, plans: bool = False) -> Method:
    """An untrained method of that name, whose robots read the planner's numbers or not.

    Raises:
      ValueError: there is none, or it never reads them.
    """
    made = find_method(name)()
    return made.read_plans() if plans else made
