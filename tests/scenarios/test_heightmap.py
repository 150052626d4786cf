"""Heightmaps: what a user's picture becomes, from the file to links, routes, rays and traces."""

import base64
import json

import cv2
import mujoco
import numpy as np
import pytest
from flying import fly
from strategies import change

from commhg_mj import cli, load_trace, make_traces, save_trace, with_heightmap
from commhg_mj.base.terms import Fate, TaskType
from commhg_mj.models import mjcf, obstacle_model, relief
from commhg_mj.models import world as worlds
from commhg_mj.models.layout import STATION_CLEARING, SURFACE_NODES, inside_any, unit_frame
from commhg_mj.models.rays import RAY, is_blocked
from commhg_mj.models.terrain import NOTHING, add_profile, ground_at
from commhg_mj.models.world import make_world
from commhg_mj.policies import prepare
from commhg_mj.scenarios import SCENARIOS, describe, from_dict, from_json, load_scenario, to_json
from commhg_mj.scenarios.heightmap import PIXELS, PLAIN, brightness, read_heightmap, to_text
from commhg_mj.study.comparison.plan import FREE, plan

TOP = SCENARIOS["medium"].world.mountain_height[1]
ALLOWED = 1.6  # footprints, of the raised ground


def rough(seed=0, power=2.0, cut=0.5, n=256):
    """Fractal ground in 0..1 that rises above `cut` of its height."""
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.fftfreq(n)))
    frequency[0, 0] = 1
    noise = np.fft.fft2(np.random.default_rng(seed).normal(size=(n, n)))
    ground = np.fft.ifft2(noise / frequency**power).real
    ground = (ground - ground.min()) / np.ptp(ground)
    return np.clip((ground - cut) / (1 - cut), 0, 1)


def disc(x=0.5, y=0.5, radius=0.2, n=256):
    """A round mesa around (x east, y north)."""
    east, north = np.meshgrid(np.linspace(0, 1, n), np.linspace(1, 0, n))
    return (np.hypot(east - x, north - y) < radius).astype(float)


def ranges():
    """A winding range and a mountain beside it."""
    east, north = np.meshgrid(np.linspace(0, 1, 256), np.linspace(1, 0, 256))
    winding = np.exp(-(((east - 0.35 - 0.12 * np.sin(5 * north)) / 0.06) ** 2)) * np.clip(10 * north - 3, 0, 1)
    return np.maximum(winding, 0.8 * np.exp(-((np.hypot(east - 0.75, north - 0.6) / 0.1) ** 2)))


PICTURES = {"ranges": ranges(), "rough": rough(), "rougher": rough(2, 1.6), "massifs": rough(3, 2.5, 0.55), "mesa": disc()}
every_picture = pytest.mark.parametrize("name", PICTURES)


def text_of(share):
    return to_text(cv2.resize(share, (PIXELS, PIXELS), interpolation=cv2.INTER_AREA))


def with_picture(share, base="medium", **fields):
    return change(SCENARIOS[base], heightmap=text_of(share), **fields)


def grid(n=500, margin=0.0):
    """Places [n, n, 2] in sides."""
    axis = -margin + (1 + 2 * margin) * (np.arange(n) + 0.5) / n
    return np.stack(np.meshgrid(axis, axis), axis=-1)


def written(path, picture):
    cv2.imwrite(str(path), picture)
    return path


# The picture


@pytest.mark.parametrize("size", [1, 7, 128, 200, 1000])
def test_any_size_is_brought_to_one(tmp_path, size):
    picture = np.full((size, size), 200, np.uint8)
    share = brightness(read_heightmap(written(tmp_path / "a.png", picture)))
    assert share.shape == (PIXELS, PIXELS) and np.all(share == 200 / 255) and not share.flags.writeable


def test_grey_colour_transparency_and_16_bits_mean_the_same(tmp_path):
    grey = np.rint(255 * rough()).astype(np.uint8)
    clear = np.random.default_rng(0).integers(0, 255, grey.shape, np.uint8)
    kinds = [grey, grey.astype(np.uint16) * 257, cv2.merge([grey] * 3), cv2.merge([grey] * 3 + [clear])]
    texts = [read_heightmap(written(tmp_path / f"{i}.png", kind)) for i, kind in enumerate(kinds)]
    shares = np.array([brightness(text) for text in texts])
    assert np.abs(shares - shares[0]).max() <= 1.001 / 255 and len(texts[0]) < 12_000
    assert len({read_heightmap(tmp_path / "0.png") for _ in range(2)}) == 1


def refused(path, *words):
    with pytest.raises(ValueError) as error:
        read_heightmap(path)
    for word in ("world.heightmap", str(path), *words):
        assert word in str(error.value)
    assert "\n" not in str(error.value)


def test_bad_files_are_refused_by_field_and_file(tmp_path):
    refused(tmp_path / "missing.png", "No such file")
    refused(tmp_path, "directory")
    refused("a\0b.png")
    for name, content in (("empty.png", b""), ("text.png", b"hello " * 99), ("photo.png", cv2.imencode(".jpg", disc() * 255)[1])):
        (tmp_path / name).write_bytes(content)
        refused(tmp_path / name, "not a PNG")
    whole = written(tmp_path / "whole.png", np.rint(255 * rough()).astype(np.uint8)).read_bytes()
    for name, content in (("cut.png", whole[:2000]), ("bent.png", whole[:2000] + b"????" + whole[2004:])):
        (tmp_path / name).write_bytes(content)
        refused(tmp_path / name, "damaged")
    refused(written(tmp_path / "wide.png", np.full((40, 60), 255, np.uint8)), "square", "60x40")
    refused(written(tmp_path / "black.png", np.zeros((9, 9), np.uint8)), "brighter than the plain")
    refused(written(tmp_path / "metres.png", np.full((9, 9), 1200, np.uint16)), "brighter than the plain")


def test_what_follows_a_pictures_end_does_not_count(tmp_path):
    whole = written(tmp_path / "whole.png", np.rint(255 * rough()).astype(np.uint8)).read_bytes()
    for name, tail in (("padded.png", bytes(100)), ("signed.png", b"a note, and IEND" * 99), ("twice.png", whole)):
        (tmp_path / name).write_bytes(whole + tail)
        assert read_heightmap(tmp_path / name) == read_heightmap(tmp_path / "whole.png")


def test_a_damaged_picture_is_refused_in_our_words_alone(tmp_path, capfd):
    whole = written(tmp_path / "whole.png", np.rint(255 * rough()).astype(np.uint8)).read_bytes()
    for n in (33, 40, 2000, len(whole) - 12, len(whole) - 1):
        (tmp_path / "cut.png").write_bytes(whole[:n])
        refused(tmp_path / "cut.png", "damaged")
        (tmp_path / "cut.png").write_bytes(whole[:n] + b"IEND")
        refused(tmp_path / "cut.png", "damaged")
    (tmp_path / "bent.png").write_bytes(whole[:2000] + b"????" + whole[2004:])
    refused(tmp_path / "bent.png", "damaged")
    assert capfd.readouterr() == ("", "")


def test_a_huge_picture_is_refused_before_it_is_decoded(tmp_path, monkeypatch):
    bomb = bytearray(written(tmp_path / "bomb.png", np.full((9, 9), 255, np.uint8)).read_bytes())
    bomb[16:24] = (8001).to_bytes(4, "big") * 2
    (tmp_path / "bomb.png").write_bytes(bomb)
    monkeypatch.setattr(cv2, "imdecode", None)
    refused(tmp_path / "bomb.png", "8001x8001", "at most 64 million")


def test_the_field_holds_nothing_but_such_a_picture():
    small = base64.b64encode(cv2.imencode(".png", np.full((9, 9), 255, np.uint8))[1]).decode()
    colour = base64.b64encode(cv2.imencode(".png", np.full((PIXELS, PIXELS, 3), 255, np.uint8))[1]).decode()
    deep = base64.b64encode(cv2.imencode(".png", np.full((PIXELS, PIXELS), 9999, np.uint16))[1]).decode()
    whole = text_of(rough())
    for value in ("valley.png", "é", "AAAA", small, colour, deep, whole[:400], whole + "!", 3, None, True, ["a"], {"a": 1}):
        for make in (from_dict, lambda table: from_json(json.dumps(table))):
            with pytest.raises(ValueError, match=r"world\.heightmap") as error:
                make({"world": {"heightmap": value}})
            assert "\n" not in str(error.value) and len(str(error.value)) < 250


# The scenario


def test_a_toml_file_names_its_picture_relative_to_itself(tmp_path, monkeypatch):
    (tmp_path / "maps").mkdir()
    picture = written(tmp_path / "maps" / "valley.png", np.rint(255 * ranges()).astype(np.uint8))
    (tmp_path / "mine.toml").write_text('base = "large"\n[world]\nheightmap = "maps/valley.png"\nn_forests = 2')
    monkeypatch.chdir("/")
    scenario = load_scenario(tmp_path / "mine.toml")
    assert scenario.world.heightmap == read_heightmap(picture) and (scenario.map_side, scenario.world.n_forests) == (2000, 2)
    assert with_heightmap("large", picture).world.heightmap == scenario.world.heightmap
    (tmp_path / "mine.toml").write_text('[world]\nheightmap = ""')
    assert load_scenario(tmp_path / "mine.toml") == SCENARIOS["medium"]


@pytest.mark.parametrize("value, match", [('"none.png"', "none.png: No such file"), ("3", "name of a PNG"), ("[1]", "name of a")])
def test_a_toml_file_with_a_bad_picture_is_refused_by_name(tmp_path, value, match, capsys):
    path = tmp_path / "mine.toml"
    path.write_text(f"[world]\nheightmap = {value}")
    with pytest.raises(ValueError, match=match) as error:
        load_scenario(path)
    assert "mine.toml: world.heightmap" in str(error.value) and "\n" not in str(error.value)
    assert cli.main(["scenarios", str(path)]) == 2 and "world.heightmap" in capsys.readouterr().err


def test_white_is_as_high_as_asked(tmp_path):
    path = written(tmp_path / "a.png", np.rint(255 * disc()).astype(np.uint8))
    for height, top in ((None, TOP), (40, 40), (432.5, 432.5)):
        layout = make_world(with_heightmap("medium", path, height), 0).layout
        assert layout.ground_height([500, 500]) == pytest.approx(top, abs=0.01) and layout.surfaces.max() == top
    for height in (-1, 1e9, "high", np.nan):
        with pytest.raises(ValueError, match="world.mountain_height"):
            with_heightmap("medium", path, height)
    with pytest.raises(ValueError, match="unknown scenario"):
        with_heightmap("huge", path)


def test_a_scenario_with_a_picture_is_printed_and_survives_json(tmp_path, capsys):
    scenario = with_picture(rough())
    assert from_json(to_json(scenario)) == scenario and hash(from_json(to_json(scenario))) == hash(scenario)
    shown = dict((name, value) for name, value, *_ in describe(scenario))["world.heightmap"]
    assert shown.startswith("picture-") and len(shown) == 16
    assert shown != dict((name, value) for name, value, *_ in describe(with_picture(disc())))["world.heightmap"]
    written(tmp_path / "a.png", np.rint(255 * rough()).astype(np.uint8))
    (tmp_path / "a.toml").write_text('[world]\nheightmap = "a.png"')
    assert cli.main(["scenarios", str(tmp_path / "a.toml")]) == 0
    assert "picture-" in capsys.readouterr().out


def test_a_comparison_without_obstacles_has_no_picture_either():
    conditions = plan(with_picture(rough()), ["greedy"], 2)
    assert all((condition.scenario.world.heightmap == "") == condition.label.startswith(FREE) for condition in conditions)


# The ground


def test_north_is_up_and_east_is_right():
    layout = make_world(with_picture(disc(0.75, 0.7, 0.1)), 0).layout
    assert layout.ground_height([750, 700]) == TOP
    np.testing.assert_array_equal(layout.ground_height([[250, 700], [750, 300], [250, 300], [700, 750 + 150]]), 0)


def test_the_share_is_the_picture_at_its_pixels_linear_between_and_0_on_the_plain():
    heightmap = text_of(rough())
    picture = brightness(heightmap)
    centres = (np.arange(PIXELS) + 0.5) / PIXELS
    share = relief.height_share(heightmap, np.stack(np.meshgrid(centres, centres), axis=-1))
    np.testing.assert_allclose(share, np.where(picture > PLAIN, picture, 0), atol=1e-12)
    halfway = relief.height_share(heightmap, np.stack(np.meshgrid(centres[:-1] + 0.5 / PIXELS, centres), axis=-1))
    np.testing.assert_allclose(halfway, (share[:, 1:] + share[:, :-1]) / 2, atol=1e-12)


@every_picture
def test_ellipses_cover_the_raised_ground_tightly(name):
    scenario = with_picture(PICTURES[name])
    xy, layout = grid(480, margin=0.1), make_world(scenario, 0).layout
    raised = relief.height_share(scenario.world.heightmap, xy) > 0
    covered = inside_any(unit_frame(layout.mountains), (xy * layout.side).reshape(-1, 2)).reshape(raised.shape)
    assert not np.any(raised & ~covered)
    assert np.mean(covered) <= ALLOWED * np.mean(raised) and len(layout.mountains) <= relief.MOST_PARTS
    pixel = layout.side / PIXELS
    assert layout.mountains["a"].max() <= 1.1 * relief.WIDEST * pixel, "nodes as near as pixels, or nearly"


@every_picture
@pytest.mark.parametrize("base", ["medium", "large"])
def test_the_ground_is_the_pictures(name, base):
    """No trench along a cut, nothing beside the raised ground, and little lost to the surfaces' own nodes."""
    scenario = with_picture(PICTURES[name], base)
    xy, layout = grid(600, margin=0.06), make_world(scenario, 0).layout
    expected = TOP * relief.height_share(scenario.world.heightmap, xy)
    error = layout.ground_height(xy * layout.side) - expected
    typical, most = np.percentile(np.abs(error[expected > 0]), [50, 95])
    cliff = np.abs(np.gradient(expected)).max() * (600 / 1.12 / PIXELS)  # the greatest rise over a pixel
    assert typical < 0.6 and (most < 3.0 or name == "mesa") and np.abs(error).max() < 0.5 * cliff
    from_raised = cv2.distanceTransform((expected == 0).astype(np.uint8), cv2.DIST_L2, 3) / 600 * 1.12
    assert np.all(error[from_raised > 1.5 / PIXELS] == 0)


def test_ground_at_the_edge_of_the_map_runs_out_beyond_it():
    layout = make_world(with_picture(disc(1.0, 0.6, 0.2)), 0).layout
    ramp = relief.RAMP / PIXELS * layout.side
    heights = layout.ground_height(np.stack([layout.side + np.linspace(-ramp, 1.5 * ramp, 200), np.full(200, 600.0)], axis=-1))
    assert heights[0] == pytest.approx(TOP) and heights[-1] == 0 and np.diff(heights).max() < 1.0


@pytest.mark.parametrize("radius", [0.15, 0.3])
def test_a_basin_within_mountains_stays_open(radius):
    """However little free ground there is, most of it stays free."""
    basin, points = disc(0.4, 0.6, radius), grid(400)
    scenario = with_picture(1 - basin)
    free = relief.height_share(scenario.world.heightmap, points) == 0
    mountains = make_world(change(scenario, n_tasks=1), 0).layout.mountains
    open_ground = ~inside_any(unit_frame(mountains), points.reshape(-1, 2) * scenario.map_side).reshape(free.shape)
    assert 0.7 * np.mean(free) < np.mean(open_ground) and not np.any(open_ground & ~free)


@pytest.mark.parametrize("specks", [1, 30, 400])
def test_specks_are_covered_however_many_they_are(specks):
    rng, share = np.random.default_rng(0), np.zeros((PIXELS, PIXELS))
    share[*rng.integers(20, PIXELS - 4, (2, specks))] = 1
    heightmap = to_text(share)
    ellipses = relief.cover(heightmap)
    assert len(ellipses) <= relief.MOST_PARTS and (specks > 30 or len(ellipses) >= 0.9 * specks)
    points = grid(1000)
    raised = points[relief.height_share(heightmap, points) > 0]
    x, y, a, b, angle = np.moveaxis(ellipses[:, :, None], 1, 0)
    dx, dy = raised[:, 0] - x, raised[:, 1] - y
    away = ((np.cos(angle) * dx + np.sin(angle) * dy) / a) ** 2 + ((np.cos(angle) * dy - np.sin(angle) * dx) / b) ** 2
    assert np.all(away.min(axis=0) < 1)


def test_the_faintest_relief_is_built():
    faint = np.where(disc(0.9, 0.9, 0.5) > 0, PLAIN + 0.003, 0)
    world = make_world(with_picture(faint, mountain_height=(5.0, 5.0)), 0)
    assert 0.1 <= world.layout.mountains["height"].max() < 0.2 and len(world.rays.arrays.mountains) == len(world.layout.mountains)


def test_regions_around_each_other_are_covered():
    """Their middles coincide: no cut between them."""
    rings = sum(disc(radius=r + 0.03, n=PIXELS) - disc(radius=r, n=PIXELS) for r in (0.1, 0.2, 0.3))
    scenario, points = change(SCENARIOS["medium"], heightmap=to_text((rings + rings[::-1] + rings.T) / 3)), grid(300)
    raised = relief.height_share(scenario.world.heightmap, points) > 0
    covered = inside_any(unit_frame(make_world(scenario, 0).layout.mountains), points[raised] * scenario.map_side)
    assert covered.all() and len(relief.cover(scenario.world.heightmap)) > 10


def test_a_picture_without_raised_ground_is_a_flat_world():
    layout = make_world(change(SCENARIOS["medium"], heightmap=to_text(np.zeros((PIXELS, PIXELS)))), 0).layout
    assert len(layout.mountains) == len(layout.surfaces) == 0 and len(layout.forests) > 0


# Rays and pictures


@pytest.fixture(scope="module", params=["rough", "mesa"])
def world(request):
    return make_world(with_picture(PICTURES[request.param]), 1)


def test_meshes_and_compiled_ground_are_the_layouts(world):
    layout, rays = world.layout, world.rays
    xy = np.random.default_rng(0).uniform(0, layout.side, (1500, 2))
    expected = layout.ground_height(xy)
    np.testing.assert_allclose([ground_at(rays.arrays.mountains, x, y) for x, y in xy], expected, atol=1e-9)
    model = mjcf.build_model(world, pictures=False)
    data, groups, hit = mujoco.MjData(model), np.zeros(6, np.uint8), np.zeros(1, np.int32)
    mujoco.mj_kinematics(model, data)
    groups[obstacle_model.Group.MOUNTAIN] = 1
    down = np.array([0.0, 0.0, -1.0])
    tops = np.array([mujoco.mj_ray(model, data, np.array([*p, 1e4]), down, groups, 1, -1, hit) for p in xy])
    np.testing.assert_allclose(np.where(tops >= 0, 1e4 - tops, 0), expected, atol=0.03)
    assert np.mean(expected > 1) > 0.1
    for mountain in rays.arrays.mountains:
        axis = np.linspace(-1, 1, SURFACE_NODES) * mountain["half"]
        away = np.hypot(*np.meshgrid(axis, axis))[mountain["height"] > 0].max()
        assert away + np.sqrt(2) * (axis[1] - axis[0]) <= mountain["reach"] + 1e-9


def test_rays_are_blocked_where_the_ground_rises_above_them(world):
    layout, rays, rng, sure, found = world.layout, world.rays, np.random.default_rng(1), 0, []
    scratch = np.zeros(1, RAY)[0]
    for _ in range(150):
        xy = rng.uniform(0, layout.side, (2, 2))
        a, b = (tuple(map(float, (*p, layout.ground_height(p) + h))) for p, h in zip(xy, rng.uniform(1, 60, 2)))
        length = float(np.linalg.norm(np.subtract(b, a)))
        highest = max(add_profile(each, a, b, NOTHING)[0] for each in rays.arrays.mountains)
        blocked = any(is_blocked(each, rays.arrays.calls[0], scratch, a, b, length) for each in rays.arrays.mountains)
        way = a[:2] + np.linspace(0, 1, 1500)[1:-1, None] * np.subtract(b[:2], a[:2])
        above = layout.ground_height(way) - np.linspace(a[2], b[2], 1500)[1:-1]
        if abs(highest) > 0.05 and abs(above.max()) > 1:
            sure += 1
            found.append(blocked)
            assert blocked == (highest > 0) == (above.max() > 0)
    assert sure > 90 and 0.1 < np.mean(found) < 0.9


def test_pictures_are_built_of_every_relief(world):
    model = mjcf.build_model(world)
    assert sum(model.geom_group == obstacle_model.Group.MOUNTAIN) == len(world.layout.mountains)
    edge = make_world(with_picture(disc(1.0, 1.0, 0.4)), 0)
    assert mjcf.build_model(edge).ngeom > 0


# Station, tasks and missions


@every_picture
def test_the_station_has_room_on_the_largest_open_ground(name):
    scenario, stations = with_picture(PICTURES[name], n_uav=32, n_ugv=32), []
    for seed in range(6):
        layout = make_world(scenario, seed).layout
        turn = np.linspace(0, 2 * np.pi, 60)
        circle = layout.station + 0.98 * STATION_CLEARING * layout.side * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        assert not inside_any(unit_frame(layout.mountains), np.concatenate([layout.station[None], circle])).any()
        assert not inside_any(unit_frame(layout.parts, scenario.world.ugv_radius), layout.starts).any()
        assert np.all((layout.starts > 0) & (layout.starts < layout.side)) and np.all(layout.ground_height(layout.starts) == 0)
        stations.append(layout.station)
    assert len(np.unique(stations, axis=0)) > 1 or name != "mesa", "the seed's own place where it is free"


def test_a_station_leaves_the_usual_place_for_the_nearest_open_one():
    usual = make_world(with_picture(disc(0.5, 0.9, 0.05)), 0).layout.station
    moved = make_world(with_picture(np.maximum(disc(0.5, 0.06, 0.15), disc(0.5, 0.9, 0.05))), 0).layout.station
    assert usual[1] < 70 and 150 < np.linalg.norm(moved - usual) < 300


def test_a_basin_without_a_way_out_is_no_place_for_the_station():
    east, north = np.meshgrid(np.linspace(0, 1, 256), np.linspace(1, 0, 256))
    away = np.hypot(east - 0.5, north - 0.14)
    wall = ((away > 0.12) & (away < 0.16)).astype(float)
    layout = make_world(with_picture(wall), 0).layout
    assert np.linalg.norm(layout.station / layout.side - [0.5, 0.14]) > 0.16


def test_no_room_for_station_or_tasks_is_refused_by_the_field():
    with pytest.raises(ValueError, match="world.heightmap leaves no room for the station"):
        make_world(with_picture(np.ones((9, 9))), 0)
    island = 1 - disc(0.5, 0.2, 0.14)
    with pytest.raises(ValueError, match="n_tasks = 56 .*world.heightmap"):
        make_world(with_picture(island, type_shares=(0.0, 1.0, 0.0)), 0)


def test_the_seed_draws_the_rest_and_drawn_mountains_do_not_count():
    one, other = (make_world(with_picture(ranges()), seed) for seed in (1, 2))
    for name in ("mountains", "surfaces"):
        assert np.array_equal(getattr(one.layout, name), getattr(other.layout, name))
    assert not np.array_equal(one.layout.forests, other.layout.forests) and not np.array_equal(one.pois, other.pois)
    same = make_world(with_picture(ranges(), n_mountains=9, mountain_share=0.0), 1)
    assert np.array_equal(one.layout.parts, same.layout.parts) and np.array_equal(one.pois, same.pois)


@every_picture
def test_ground_tasks_have_routes_around_the_mountains(name):
    world = make_world(with_picture(PICTURES[name]), 3)
    frames = unit_frame(world.layout.parts)
    for task in np.flatnonzero(world.poi_types != TaskType.UAV_ONLY):
        route = world.path(world.layout.starts[0], task)
        along = np.concatenate([a + np.linspace(0, 1, 50)[:, None] * (b - a) for a, b in zip(route, route[1:])])
        assert not inside_any(frames, along).any()


@pytest.mark.parametrize("links", ["abstract", "raycast"])
def test_missions_fly_and_their_traces_make_the_same_world_again(tmp_path, links):
    scenario = with_picture(ranges(), "small", name="valley")
    batch = fly(*prepare("greedy", scenario, [4, 5], links=links, record=True))
    assert batch.over.all() and all(score.twcr > 0.2 for score in batch.scores())
    assert batch.state.counters["fate"][..., Fate.TERRAIN].sum() > 0, "mountains stand between"
    trace = make_traces(batch, "greedy")[0]
    save_trace(trace, tmp_path / "a.npz")
    again = load_trace(tmp_path / "a.npz")
    assert again.scenario == scenario
    first = batch.worlds[0]
    worlds.kept_world.cache_clear(), relief.cover.cache_clear()
    worlds.draw_layout.__globals__["_heightmap_mountains"].cache_clear()
    second = make_world(again.scenario, again.seed)
    assert second is not first and np.array_equal(second.layout.parts, first.layout.parts)
    assert np.array_equal(second.layout.surfaces, first.layout.surfaces) and np.array_equal(second.pois, first.pois)
    assert np.array_equal(mjcf.build_model(second).tex_data, mjcf.build_model(first).tex_data), "and the same pictures"
