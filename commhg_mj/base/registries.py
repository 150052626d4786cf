"""What users look up by name and may add to from outside: scenarios, link models, policies and learned methods.

| registry | a name is added in this process by | entry points of installed packages |
|---|---|---|
| `commhg_mj.SCENARIOS` | `SCENARIOS["mine"] = scenario` | `commhg_mj.scenarios`: a `Scenario`, or the path of a TOML file |
| link models | `@commhg_mj.link_model("mine")` | `commhg_mj.link_models`: the undecorated function |
| `commhg_mj.POLICIES` | `@commhg_mj.policy("mine")` | `commhg_mj.policies`: a callable that makes one for a batch |
| `commhg_mj.learning.registry.METHODS` | `@method("mine")` | `commhg_mj.methods`: the class |

An entry point is loaded when its name is first asked for, in every process that asks: workers find it, too.
"""

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any

from .arguments import said


class Registry(dict):
    """Things of one kind by name, in the order in which they came; `find` looks into installed packages, too.

    Args:
      kind: what one of them is called, as "policy".
      group: of entry points.
      members: built-in ones by name.
      adopt: (name, object of an entry point) -> None, which adds it; by default as it is.
      beside: names that are found elsewhere; a message lists them first.
    """

    def __init__(self, kind: str, group: str, members=(), adopt: Callable[[str, Any], Any] | None = None, beside=()):
        super().__init__(members)
        self.kind, self.group, self.beside = kind, group, beside
        self.adopt: Callable[[str, Any], Any] = adopt or self.__setitem__

    def find(self, name, also: str = "") -> Any:
        """The member of that name.

        Args:
          also: what else the caller would take, for the message.

        Raises:
          ValueError: there is none, or its package does not load; the message names it.
        """
        if isinstance(name, str) and name not in self:
            for point in entry_points(group=self.group, name=name):
                self._load(point)
        if not isinstance(name, str) or name not in self:
            raise ValueError(f"unknown {self.kind} {said(name)}: use {', '.join(self.names())}{also}")
        return self[name]

    def names(self) -> list[str]:
        """Of all members and of all entry points."""
        return list(dict.fromkeys([*self.beside, *self, *(point.name for point in entry_points(group=self.group))]))

    def _load(self, point):
        try:
            self.adopt(point.name, point.load())
        except Exception as error:  # a stranger's package fails however it likes
            raise ValueError(f"{self.kind} {point.name!r} of {point.value}: {' '.join(str(error).split())}") from error
