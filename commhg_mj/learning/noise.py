"""Random numbers of learned policies in flight: a mission's choices do not depend on which others fly beside it."""

import numpy as np

from ..base.elementary_functions import log
from ..base.kernels import formula
from ..mission.observe import Observations
from ..mission.randomness import uniform

ROBOT, OPERATOR = 0, 1  # roles
EVENT = 65  # plus the role; policies/random.py has 64; indices: actor, component of its decision


@formula
def gumbel(seed, event, tick, actor, component):
    """A standard Gumbel number that depends on the arguments alone."""
    return -log(-log(max(uniform(seed, event, tick, actor, component), 2.0**-54)))


class Draws:
    """Gumbel noise for whoever is due: it depends on the mission's seed, the time, the actor and the component alone."""

    def __init__(self, seeds: np.ndarray, seen: Observations):
        self.actors = [
            (seeds[due["mission"]], due["time"].astype(np.int64), due[name].astype(np.int64))
            for due, name in ((seen.robots, "robot"), (seen.operators, "operator"))
        ]

    def __call__(self, role, rows, components) -> np.ndarray:
        """Noise of some rows' components, arrays that broadcast."""
        seed, time, actor = (column[rows] for column in self.actors[role])
        return gumbel(seed, EVENT + role, time, actor, components)
