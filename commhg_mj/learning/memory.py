"""What an actor remembers beside its records: the last reports of each robot that it has decided with.

It is the actor's own past and nobody else's. Deciding twice on one observation remembers nothing twice.
"""

import numpy as np

from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity, Mode
from ..mission.accessors import copy_record
from .features import LONG, PAST, columns_of

TRAVELLING, SERVICING, CONTROLLED = int(Activity.TRAVELLING), int(Activity.SERVICING), int(Mode.CONTROLLED)


class Memory:
    """Of all actors of E missions; in it `since` is the second in which a report was true.

    Attributes:
      of_robots: [E, R, R, n] PAST: the robot that remembers, the robot remembered, newest last.
      of_operators: [E, H, R, n] PAST.
    """

    def __init__(self, n_missions: int, scenario, n: int):
        r, h = scenario.n_robots, scenario.n_operators
        self.of_robots, self.of_operators = PAST.zeros(n_missions, r, r, n), PAST.zeros(n_missions, h, r, n)

    def room(self, *shape: int) -> np.ndarray:
        """[*shape, n] PAST for `recall` to fill in."""
        return PAST.zeros(*shape, self.of_robots.shape[-1])

    def columns(self) -> list[np.ndarray]:
        """All that is remembered, in the same memory."""
        return [columns_of(self.of_robots), columns_of(self.of_operators)]


@kernel
def forget(remembered):
    """Of one actor [R, n]: its mission begins."""
    for r in range(remembered.shape[0]):
        for i in range(remembered.shape[1]):
            remembered[r, i].exists = 0.0


@kernel
def recall(remembered, row, now, scale, out):
    """Remember a report, unless it is the last one that was; write all that are remembered to `out` [n]."""
    last = remembered.shape[0] - 1
    if last < 0:
        return
    time = now - row.age
    if not remembered[last].exists or time > remembered[last].since:
        for i in range(last):
            copy_record(remembered[i], remembered[i + 1])
        write_report(remembered[last], row, time, scale)
    for i in range(last + 1):
        if remembered[i].exists:
            copy_record(out[i], remembered[i])
            out[i].since = np.exp(-(now - remembered[i].since) / LONG)


@kernel
def write_report(out, row, time, scale):
    """A report as it is remembered."""
    out.exists, out.x, out.y, out.since = 1.0, row.x / scale.side, row.y / scale.side, time
    out.travelling, out.servicing = row.activity == TRAVELLING, row.activity == SERVICING
    out.controlled, out.has_task = row.mode == CONTROLLED, row.task != NOBODY
