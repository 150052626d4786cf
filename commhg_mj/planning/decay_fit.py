"""The abstract-fit preset: decay lengths of the planar model, fitted to links that the ray-cast model labels.

So a comparison can tell wrong parameters from the wrong, planar, structure (docs/radio.md).
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from ..base.arguments import missions_of
from ..flights.fly import fly_recorded
from ..flights.held_out import FIT
from ..scenarios import Scenario, load_scenario
from .link_pairs import STATION, links_of

DECAYS = 0.1, 1e6  # m: where nothing decides a length it ends at one of these
PERIOD = 5  # s between the links of a mission that count


class Fit(NamedTuple):
    """One scenario's fitted decay lengths [m] and how well they, and the scenario's own ones, tell the links' fates."""

    scenario: str
    forest_decay: float
    mountain_decay: float
    log_likelihood: float  # nat a link
    own_log_likelihood: float
    links: int


def fit(scenario: Scenario, n_missions=40, workers=1, advance=lambda missions: None) -> Fit:
    """Fit l_f and l_m by maximum likelihood to the ray-cast fates of all robot-robot links in range along missions.

    Raises:
      ValueError: there are no such links.
    """
    scenario, seeds = load_scenario(scenario), range(FIT, FIT + missions_of("n_missions", n_missions))
    found = fly_recorded(_links, scenario, "greedy", seeds, "raycast", workers=workers, advance=advance)
    links = np.concatenate(found)
    if not len(links):
        raise ValueError(f"{scenario.name}: no two robots came into range, there is nothing to fit")
    own = scenario.communication.forest_decay, scenario.communication.mountain_decay
    forest, mountain, delivered = links["planar_forest"], links["planar_mountain"], links["ray_delivered"]
    clear = delivered[(forest == 0) & (mountain == 0)].max(initial=0.0)

    def loss(logarithms):
        p = np.clip(clear * np.exp(-forest / np.exp(logarithms[0]) - mountain / np.exp(logarithms[1])), 1e-9, 1 - 1e-9)
        return -np.mean(delivered * np.log(p) + (1 - delivered) * np.log(1 - p))

    best = minimize(loss, np.log(own), method="Nelder-Mead", bounds=[np.log(DECAYS)] * 2, options={"xatol": 1e-4, "fatol": 1e-10})
    decays = np.exp(best.x)
    return Fit(scenario.name, float(decays[0]), float(decays[1]), -float(best.fun), -float(loss(np.log(own))), len(links))


def _links(trace):
    """Robot-robot links in range of one mission, every PERIOD seconds."""
    links = links_of(trace, PERIOD)
    return links[(links["kind"] != STATION) & links["in_range"]]
