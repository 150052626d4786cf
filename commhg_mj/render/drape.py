"""Drapes: pictures that cover the map's ground, such as where messages would arrive."""

from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arguments import instance, numbers
from ..models.meshes import terrain_uv
from ..models.textures import MEADOW

COLOURS, SHADES = "viridis", 64  # the pink, orange and blue of tasks and robots stand out from it
ALPHA = 0.55


@dataclass(frozen=True)
class Drape:
    """An image over the whole map, blended by its alpha with the ground, and what its colours mean.

    Raises:
      ValueError: the image has another shape or type.
    """

    image: np.ndarray  # [n, n, 4] uint8 red, green, blue, alpha; row 0 south, column 0 west
    label: str
    low: str  # what the first colour stands for
    high: str  # and the last
    colours: np.ndarray  # [k, 3] uint8 red, green, blue, as they look on the ground

    def __post_init__(self):
        n = len(instance("a drape's image", self.image, np.ndarray))
        if self.image.shape != (n, n, 4) or self.image.dtype != np.uint8:
            raise ValueError(f"a drape's image must be [n, n, 4] uint8, is {list(self.image.shape)} {self.image.dtype}")


def coverage_drape(probability, label: str) -> Drape:
    """A drape that shows probabilities [n, n] in 0..1, row 0 south, column 0 west.

    Raises:
      ValueError: not a square of probabilities.
    """
    from matplotlib import colormaps

    probability = numbers("probability", probability, None, None)
    if not np.all((probability >= 0) & (probability <= 1)):
        raise ValueError("probability must be a table [n, n] of numbers in 0..1")
    colours = colormaps[COLOURS].resampled(SHADES)
    on_grass = ALPHA * 255 * colours(np.arange(SHADES))[:, :3] + (1 - ALPHA) * np.array(MEADOW)
    return Drape(colours(probability, alpha=ALPHA, bytes=True), label, "0", "1", on_grass.astype(np.uint8))


def lay_drape(model, image) -> None:
    """Blend a drape's image [n, n, 4] into the terrain texture of a compiled world, before it goes to the GPU."""
    terrain = model.texture("terrain").id
    height, width = model.tex_height[terrain], model.tex_width[terrain]
    start = model.tex_adr[terrain]
    texels = model.tex_data[start : start + 3 * height * width].reshape(height, width, 3)
    low, high = np.rint(terrain_uv(np.array([0.0, 1.0]), 1.0) * width).astype(int)
    ground = texels[low:high, low:high]  # the texture's rows run from north to south, the map lies in its middle
    alpha = image[..., 3:] / np.float32(255)
    # Enlarged with premultiplied alpha, so that transparent cells lend no colour to their neighbours.
    cover = cv2.resize(np.dstack([image[..., :3] * alpha, alpha]), (high - low,) * 2)[::-1]
    ground[:] = ground * (1 - cover[..., 3:]) + cover[..., :3] + 0.5
