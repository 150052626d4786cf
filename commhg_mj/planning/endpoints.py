"""Ends of links as a person names them: a robot, the station, or a point on the map."""

from dataclasses import dataclass

import numpy as np

from ..base.arguments import instance, said
from ..base.terms import Embodiment
from ..radio.world_links import WorldLinks
from ..scenarios import Scenario

HIGHEST = 1e5  # m above the ground: of any antenna


@dataclass(frozen=True)
class Endpoint:
    """One end of a link; exactly one of `robot`, `point` and neither (the station)."""

    name: str
    robot: int | None = None
    point: tuple | None = None  # x, y [m] and height above the ground [m]

    @property
    def text(self) -> str:
        """As part of a sentence."""
        return "the station" if self.is_station else self.name

    @property
    def is_station(self) -> bool:
        return self.robot is None and self.point is None


def parse_endpoint(text: str, scenario: Scenario, option: str) -> Endpoint:
    """The place that `uav0`, `station`, `X,Y` or `X,Y,Z` names; Z is above the ground, by default a UGV's antenna.

    Raises:
      ValueError: no such place; the message names the option.
    """
    instance("scenario", scenario, Scenario)
    if not isinstance(text, str):
        raise ValueError(f"--{option} must be the name of a place, is {said(text)}")
    if text == "station":
        return Endpoint(text)
    if text in scenario.robot_names:
        return Endpoint(text, robot=scenario.robot_names.index(text))
    try:
        x, y, *z = (float(number) for number in text.split(","))
        (z,) = z or (scenario.radio.ugv_antenna,)
    except ValueError:
        team = "station, " + ", ".join(scenario.robot_names[:: max(1, scenario.n_robots - 1)])
        raise ValueError(f"--{option} must be {team} …, X,Y or X,Y,Z in metres, is {text!r}") from None
    if not (np.isfinite([x, y, z]).all() and 0 <= x <= scenario.map_side and 0 <= y <= scenario.map_side and 0 <= z <= HIGHEST):
        raise ValueError(f"--{option} {text} lies outside the map, 0..{scenario.map_side:g} m, or below the ground")
    return Endpoint(text, point=(x, y, z))


def antenna_at(place: Endpoint, links: WorldLinks, robot_xy) -> np.ndarray:
    """[3] the antenna at a place, the robots being at robot_xy [R, 2]."""
    if place.is_station:
        return links.mast
    if place.point:
        return links.antennas(np.array([place.point[:2]]), place.point[2])[0]
    r = int(place.robot or 0)
    embodiment = Embodiment.UAV if r < links.world.scenario.n_uav else Embodiment.UGV
    return links.robot_antennas(robot_xy[r][None].astype(float), embodiment)[0]
