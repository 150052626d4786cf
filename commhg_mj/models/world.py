"""A world: one layout with its points of interest and ground routes, all drawn from one seed."""

import copy
import weakref
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ..base.arguments import check_seed, numbers, whole
from ..base.elementary_functions import distance
from ..base.terms import TaskType
from ..scenarios import Scenario, load_scenario
from .layout import STATION_CLEARING, Layout, draw_layout
from .routes import Roadmap, Routes, find_path

if TYPE_CHECKING:
    from .raymodel import RayModel

TRIES_PER_POI = 2000
BORDER = 0.02  # of the side: POIs keep off the border
STREAM = 1  # separates the world's random stream from the mission's


@dataclass(frozen=True)
class World:
    """Everything about a mission that stands still."""

    scenario: Scenario
    seed: int
    layout: Layout
    pois: np.ndarray  # [tasks, 2] m
    poi_types: np.ndarray  # [tasks] TaskType, as announced
    routes: Routes  # ground routes towards the POIs

    @cached_property
    def rays(self) -> "RayModel":
        """The world's `RayModel`, built when it is first asked for: few need MuJoCo."""
        from .raymodel import RayModel

        return RayModel(self.layout)

    def __getstate__(self):
        """Copies and other processes build a ray model of their own: it lives at an address."""
        return {name: value for name, value in self.__dict__.items() if name != "rays"}

    def path(self, start, task: int) -> np.ndarray:
        """Ground route [k, 2] from `start` [2] to a task's POI."""
        return find_path(self.routes, numbers("start", start, 2), whole("task", task, 0, len(self.pois) - 1))


def make_world(scenario, seed: int) -> World:
    """The world of a mission; the same arguments give the same world.

    Args:
      scenario: name, TOML file, `Scenario` or its table.

    Raises:
      ValueError: no such scenario or seed, or the POIs or the station do not fit on the map (names the field).
    """
    return kept_world(load_scenario(scenario), check_seed(seed)).hand_out()


class KeptWorld:
    """A drawn world, for whoever asks for it again.

    Most missions come once: what their users build with the world, such as its ray model, goes with them. From the second
    time on it stays.
    """

    def __init__(self, world: World):
        self.world = world
        self._first: weakref.ref[World] | None = None

    def hand_out(self) -> World:
        """One and the same object as long as somebody holds it."""
        if self._first is None:
            first = copy.copy(self.world)
            self._first = weakref.ref(first)
            return first
        return self._first() or self.world


@lru_cache(maxsize=256)
def kept_world(scenario: Scenario, seed: int) -> KeptWorld:
    """The place where `make_world` keeps a world, drawn when first asked for."""
    return KeptWorld(draw_world(scenario, seed))


def draw_world(scenario, seed: int) -> World:
    """A world drawn anew; arguments and errors as of `make_world`."""
    scenario, seed = load_scenario(scenario), check_seed(seed)
    rng = np.random.default_rng([seed, STREAM])
    layout = draw_layout(scenario, rng)
    roadmap = Roadmap(layout.parts, scenario.world.ugv_radius, layout.side, layout.starts.mean(axis=0))
    shares = np.array(scenario.tasks.type_shares)
    poi_types = rng.choice(3, size=scenario.n_tasks, p=shares / shares.sum()).astype(np.int8)
    pois = _draw_pois(scenario, layout, roadmap, poi_types, rng)
    return World(scenario, seed, layout, pois, poi_types, roadmap.routes_to(pois, poi_types != TaskType.UAV_ONLY))


def _draw_pois(scenario, layout, roadmap, poi_types, rng):
    side = layout.side
    spacing, clearing = scenario.world.poi_spacing * side, 0.5 * STATION_CLEARING * side
    pois = np.empty((len(poi_types), 2))
    for i, poi_type in enumerate(poi_types):
        for _ in range(TRIES_PER_POI):
            poi = np.round(rng.uniform(BORDER * side, (1 - BORDER) * side, 2), 2)
            crowded = i and np.min(np.sum((pois[:i] - poi) ** 2, axis=-1)) < spacing**2
            if crowded or distance(*(poi - layout.station)) < clearing:
                continue
            if poi_type == TaskType.UAV_ONLY or roadmap.is_reachable(poi):
                pois[i] = poi
                break
        else:
            mountains = "world.heightmap" if scenario.world.heightmap else "world.mountain_share"
            raise ValueError(
                f"n_tasks = {scenario.n_tasks} POIs do not fit on the map with world.poi_spacing = "
                f"{scenario.world.poi_spacing:g}, world.forest_share and {mountains} as they are"
            )
    return pois
