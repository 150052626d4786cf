"""One link in section: what every model sees between two places, and a cross-section of the world there."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..base.arguments import instance, numbers, said, second
from ..base.charts import new_figure, styled
from ..models.layout import inside_any, unit_frame
from ..models.world import World
from ..policies import prepare
from ..radio.losses import FRESNEL_CLEAR
from ..radio.raycast import APART
from ..radio.world_links import WorldLinks
from ..scenarios import Scenario, load_scenario
from .endpoints import Endpoint, antenna_at

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MODELS = ("abstract", "raycast")
SAMPLES = 600  # along a cross-section


@dataclass(frozen=True)
class LinkView:
    """A link between two places of a world at one moment."""

    world: World
    places: tuple[Endpoint, Endpoint]
    antennas: np.ndarray  # [2, 3] m
    limitation: str
    size: int  # B, of the message
    links: dict  # model: WorldLinks
    seen: dict  # model: LINK record


def positions_at(scenario: Scenario, seed: int, at: float) -> np.ndarray:
    """Where the robots of a Greedy mission are [R, 2] at a second, under abstract links.

    Raises:
      ValueError: the mission does not last that long.
    """
    at = second("--at", at, load_scenario(scenario).time_limit)
    batch, act = prepare("greedy", scenario, [seed], record=True)
    observations = batch.observations
    while not batch.over.all() and at > batch.time[0]:
        observations = batch.step(act(observations))
    second("--at", at, batch.time[0])
    rows = batch.log.robots[0, round(at)]
    return np.stack([rows["x"], rows["y"]], axis=-1)


def view_link(world: World, places, robot_xy, limitation="nominal") -> LinkView:
    """Look at the link between two places, the robots being at robot_xy [R, 2]; None where no robot is an end.

    Raises:
      ValueError: both ends are one place.
    """
    instance("world", world, World)
    if not isinstance(places, (list, tuple)) or [type(place) for place in places] != [Endpoint, Endpoint]:
        raise ValueError(f"places must be two Endpoints, is {said(places)}")
    if any(place.robot is not None for place in places):
        robot_xy = numbers("robot_xy", robot_xy, world.scenario.n_robots, 2)
    transport, to_station = world.scenario.communication, any(place.is_station for place in places)
    size = transport.telemetry_bytes if to_station else transport.broadcast_bytes
    links = {model: WorldLinks(world, model, limitation) for model in MODELS}
    ends = np.stack([antenna_at(place, links["raycast"], robot_xy) for place in places])
    if np.linalg.norm(ends[1] - ends[0]) < APART:
        raise ValueError(f"--from and --to are the same place, {places[0].name}")
    if to_station:
        robot_end = ends[[not place.is_station for place in places]]
        seen = {model: links[model].to_station(robot_end, size)[0] for model in MODELS}
    else:
        seen = {model: links[model].between(ends[:1], ends[1:], size)[0] for model in MODELS}
    return LinkView(world, tuple(places), ends, limitation, size, links, seen)


@styled
def section_figure(link: LinkView) -> "Figure":
    """The vertical cross-section of a link: terrain, canopies, ray, first Fresnel zone; a matplotlib figure."""
    share = np.linspace(0, 1, SAMPLES)
    way = link.antennas[0] + share[:, None] * (link.antennas[1] - link.antennas[0])
    metres, layout = link.seen["raycast"]["metres"], link.world.layout
    ground = layout.ground_height(way[:, :2])
    x = share * np.hypot(*(link.antennas[1] - link.antennas[0])[:2])
    figure, axes = new_figure(9.0, 4.0)
    axes.fill_between(x, ground, min(0.0, ground.min()) - 3.0, color="#8a7a63", label="ground")
    crowns = np.zeros(SAMPLES)
    for part in layout.forests:
        crowns = np.maximum(crowns, part["height"] * inside_any(unit_frame(part[None]), way[:, :2]))
    axes.fill_between(x, ground, crowns, where=crowns > ground, color="#3d8b4f", alpha=0.75, lw=0, label="canopy")
    radius = np.sqrt(float(link.links["raycast"].rules["wavelength"]) * metres * share * (1 - share))
    axes.fill_between(x, way[:, 2] - radius, way[:, 2] + radius, color="#2f6db5", alpha=0.25, lw=0, label="first Fresnel zone")
    axes.plot(x, way[:, 2], color="#2f6db5", lw=1.4, label="ray")
    _mark_edge(axes, link, x)
    for i, place in enumerate(link.places):
        axes.plot(x[-i], way[-i, 2], "o", color="black", ms=5)
        axes.annotate(
            place.name, (x[-i], way[-i, 2]), (0, 8), textcoords="offset points", ha="left" if i == 0 else "right", weight="bold"
        )
    delivered = {model: link.seen[model]["on_time"] + link.seen[model]["late"] for model in MODELS}
    axes.set_title(f"delivered: abstract {delivered['abstract']:.3f}, ray cast {delivered['raycast']:.3f}", loc="left")
    axes.set(xlabel="metres along the link", ylabel="metres", xlim=(x[0], max(x[-1], 1.0)))
    axes.margins(y=0.12)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=5, frameon=False)
    return figure


def _mark_edge(axes, link, x):
    rays = link.seen["raycast"]
    if np.isfinite(rays["nu"]) and rays["nu"] > FRESNEL_CLEAR:
        at = rays["edge_at"]
        height = link.antennas[0, 2] + at * (link.antennas[1, 2] - link.antennas[0, 2]) + rays["edge_height"]
        axes.plot(at * x[-1], height, "v", color="#c0392b", ms=8, label=f"dominant edge, {rays['diffraction']:.1f} dB")
