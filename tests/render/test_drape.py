import dataclasses

import numpy as np
import pytest

from commhg_mj.models.world import make_world
from commhg_mj.render import Drape, coverage_drape, render_image
from commhg_mj.render.hud import Hud
from commhg_mj.render.moment import Timeline
from commhg_mj.render.stage import Stage

SIZE = (640, 360)
RED = np.array([255, 0, 0, 255], np.uint8)


def drape_of(image):
    return Drape(image, "label", "0", "1", np.array([[255, 0, 0]], np.uint8))


@pytest.fixture(scope="module")
def flat(trace):
    """A world without obstacles, so that all of the ground is seen, and a moment of its mission."""
    rules = dataclasses.replace(trace.scenario.world, n_forests=0, n_mountains=0)
    world = make_world(dataclasses.replace(trace.scenario, world=rules), trace.seed)
    return world, Timeline(trace, 9.0).at(0.0)


def ground(flat, drape=None):
    """(the ground [height, width, 3] as the map camera sees it, its projection)."""
    stage = Stage(flat[0], SIZE, drape)
    picture, projection = stage.render(flat[1], "map")
    stage.close()
    return picture.astype(int), projection


def test_a_drape_lies_in_its_quarter(flat):
    image = np.zeros((64, 64, 4), np.uint8)
    image[:32, :32] = RED  # south-west
    plain, projection = ground(flat)
    draped, _ = ground(flat, drape_of(image))
    side = flat[0].layout.side
    corner, middle = (projection.pixels([x, x, 0.0])[0] for x in (0.0, side / 2))
    inside = np.zeros(plain.shape[:2], bool)
    inside[round(middle[1]) : round(corner[1]), round(corner[0]) : round(middle[0])] = True
    changed = np.abs(draped - plain).sum(axis=-1) > 60
    assert corner[0] < middle[0] and corner[1] > middle[1]
    assert changed[inside].mean() > 0.97 and changed[~inside].mean() < 0.01
    reddest = draped[inside].mean(axis=0)
    assert reddest[2] > 230 and reddest[:2].max() < 40


def test_alpha_blends(flat):
    image = np.full((8, 8, 4), 255, np.uint8)
    image[..., 3] = 128
    plain, projection = ground(flat)
    draped, _ = ground(flat, drape_of(image))
    spot = np.s_[90:100, 300:310]
    np.testing.assert_allclose(draped[spot], (plain[spot] + 255) / 2, atol=4)


def test_every_stage_keeps_its_own_ground(flat):
    """Two contexts live side by side in one process."""
    image = np.tile(RED, (4, 4, 1))
    stages = [Stage(flat[0], SIZE, drape) for drape in (None, drape_of(image))]
    plain, red, again = (stages[i].render(flat[1], "map")[0] for i in (0, 1, 0))
    for stage in stages:
        stage.close()
    np.testing.assert_array_equal(plain, again)
    assert red[180, 320, 2] > 230 > plain[180, 320, 2]


def test_coverage_becomes_colours():
    probability = np.array([[0.0, 0.5], [0.5, 1.0]])
    drape = coverage_drape(probability, "delivery probability from the station")
    assert drape.image.shape == (2, 2, 4) and drape.image.dtype == np.uint8 and (drape.image[..., 3] == 140).all()
    brightness = drape.image[..., :3].astype(int).sum(axis=-1)
    assert brightness[0, 0] < brightness[0, 1] == brightness[1, 0] < brightness[1, 1]
    assert (drape.low, drape.high) == ("0", "1") and drape.colours.shape[1] == 3


@pytest.mark.parametrize("values", [[[0.5, 1.1], [0, 0]], [[-0.1]], [[np.nan]], [0.5], [[0.5, 0.5]]])
def test_impossible_coverage_is_refused(values):
    with pytest.raises(ValueError, match=r"\[n, n"):
        coverage_drape(values, "label")


def test_the_key_says_what_the_colours_mean(trace, flat, monkeypatch):
    said = []
    monkeypatch.setattr(Hud, "text", lambda self, x, y, string, *rest, **style: said.append(string) or 10.0)
    Hud(trace, flat[0], (960, 540), coverage_drape(np.zeros((2, 2)), "delivery probability"))
    assert said[-3:] == ["delivery probability", "0", "1"]


def test_pictures_take_drapes(trace, tmp_path):
    drape = drape_of(np.tile(RED, (4, 4, 1)))
    for name, traces, drapes in (("one", trace, drape), ("two", (trace, trace), (None, drape))):
        render_image(trace=traces, out=tmp_path / f"{name}.png", size=(96, 64), drape=drapes)
        assert (tmp_path / f"{name}.png").stat().st_size
