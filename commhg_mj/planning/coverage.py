"""The radio planner's picture: how likely a message from one place is delivered anywhere on the map."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..base.arguments import instance, names, number
from ..base.charts import new_figure, styled
from ..models.world import World
from ..radio.world_links import WorldLinks
from .endpoints import HIGHEST, Endpoint, antenna_at

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CELLS = 250  # a side
MODELS = ("abstract", "raycast")


@dataclass(frozen=True)
class Coverage:
    """Delivery probabilities [CELLS, CELLS] from one place, row 0 in the south, by link model."""

    world: World
    source: Endpoint
    height: float  # m of the receivers above the ground
    delivered: dict


def cover(
    world: World, source: Endpoint, height: float, limitation="nominal", models=MODELS, options=("from", "height")
) -> Coverage:
    """Messages between a place and receivers `height` metres above the ground.

    From the station they are telemetry or commands, without a range; from elsewhere broadcasts.

    Args:
      options: what messages call the source and the height.

    Raises:
      ValueError: the source is a robot (its place is a matter of the moment: name a point), or a negative height.
    """
    instance("world", world, World)
    if instance("source", source, Endpoint).robot is not None:
        raise ValueError(f"--{options[0]} must be station, X,Y or X,Y,Z, is {source.name!r}")
    height = number(f"--{options[1]}", height, 0, HIGHEST)
    transport = world.scenario.communication
    centres = (np.arange(CELLS) + 0.5) / CELLS * world.layout.side
    xy = np.stack(np.meshgrid(centres, centres), axis=-1).reshape(-1, 2)
    delivered = {}
    for model in names("models", models):
        links = WorldLinks(world, model, limitation)
        receivers = links.antennas(xy, height)
        if source.is_station:
            found = links.to_station(receivers, transport.telemetry_bytes)
        else:
            found = links.between(antenna_at(source, links, None)[None], receivers, transport.broadcast_bytes)
        delivered[model] = (found["on_time"] + found["late"]).reshape(CELLS, CELLS)
    return Coverage(world, source, height, delivered)


@styled
def coverage_figure(coverage: Coverage) -> "Figure":
    """Both models' maps and their difference, as a matplotlib figure."""
    side = coverage.world.layout.side
    planar, rays = (coverage.delivered[model] for model in MODELS)
    figure, axes = new_figure(12.5, 4.6, 3, sharey=True)
    style = {"origin": "lower", "extent": (0, side, 0, side), "interpolation": "nearest"}
    for ax, values, title in ((axes[0], planar, "abstract"), (axes[1], rays, "ray cast")):
        image = ax.imshow(values, vmin=0, vmax=1, cmap="viridis", **style)
        ax.set_title(f"{title}: mean {values.mean():.3f}", loc="left")
    figure.colorbar(image, ax=axes[:2], label="delivery probability", shrink=0.85)
    image = axes[2].imshow(rays - planar, vmin=-1, vmax=1, cmap="RdBu", **style)
    axes[2].set_title(f"ray cast - abstract: mean {np.mean(rays - planar):+.3f}", loc="left")
    figure.colorbar(image, ax=axes[2], label="difference", shrink=0.85)
    for ax in axes:
        draw_outlines(ax, coverage)
        ax.set(xlabel="x (m)", aspect="equal", xlim=(0, side), ylim=(0, side))
    axes[0].set_ylabel("y (m)")
    mission = f"{coverage.world.scenario.name}, seed {coverage.world.seed}"
    figure.suptitle(f"{mission}: from {coverage.source.text} to {coverage.height:g} m above the ground")
    return figure


def draw_outlines(ax, coverage: Coverage) -> None:
    """Footprints, station and source upon a map."""
    from matplotlib.patches import Ellipse

    layout = coverage.world.layout
    for parts, colour in ((layout.forests, "#0b5d1e"), (layout.mountains, "#6b3e1d")):
        for part in parts:
            place, size, angle = (part["x"], part["y"]), (2 * part["a"], 2 * part["b"]), np.degrees(part["angle"])
            ax.add_patch(Ellipse(place, *size, angle=angle, fill=False, ec=colour, lw=0.8))
    ax.plot(*layout.station, "^", color="white", mec="black", ms=8)
    if coverage.source.point:
        ax.plot(*coverage.source.point[:2], "o", color="white", mec="black", ms=7)
