"""A part of a scenario: a smaller team on so much less ground, where robots, tasks and obstacles lie as densely."""

from dataclasses import replace
from math import ceil, sqrt

from .fields import Scenario

SHORTEST_SIDE = 50.0  # m


def part_of(scenario: Scenario, n_robots: int) -> Scenario:
    """What of a scenario falls to about so many robots; the whole where it has no more, or a picture of its mountains.

    Ways and ranges in metres, times and tasks a robot stay what they are.

    Raises:
      ValueError: the part is no scenario, for want of ground.
    """
    if scenario.n_robots <= n_robots or scenario.world.heightmap:
        return scenario
    share = n_robots / scenario.n_robots
    side = max(SHORTEST_SIDE, scenario.map_side * sqrt(share))
    wider = scenario.map_side / side  # what is told in sides
    world, some = scenario.world, lambda n: max(1, round(n * share)) if n else 0
    return replace(
        scenario,
        map_side=side, n_tasks=some(scenario.n_tasks), n_uav=some(scenario.n_uav), n_ugv=some(scenario.n_ugv),
        n_operators=ceil(scenario.n_operators * share),
        world=replace(
            world, n_forests=some(world.n_forests), n_mountains=some(world.n_mountains),
            poi_spacing=min(0.1, world.poi_spacing * wider),
        ),
        robots=replace(scenario.robots, sensing_radius=min(2.0, scenario.robots.sensing_radius * wider)),
        communication=replace(
            scenario.communication, range=tuple(min(2.0, reach * wider) for reach in scenario.communication.range)
        ),
    )  # fmt: skip
