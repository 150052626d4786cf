"""Places: every way to name an end of a link, and what each refusal says."""

import numpy as np
import pytest
from strategies import change

from commhg_mj.models.world import make_world
from commhg_mj.planning.endpoints import Endpoint, antenna_at, parse_endpoint
from commhg_mj.radio.world_links import WorldLinks
from commhg_mj.scenarios import SCENARIOS

SMALL = SCENARIOS["small"]  # uav0, uav1, ugv0, ugv1 on 500 m


@pytest.mark.parametrize(
    "text, robot, point",
    [
        ("station", None, None),
        ("uav0", 0, None),
        ("uav1", 1, None),
        ("ugv0", 2, None),
        ("ugv1", 3, None),
        ("10,20", None, (10.0, 20.0, 1.0)),
        ("10,20,0", None, (10.0, 20.0, 0.0)),
        ("10, 2e1, 30.5", None, (10.0, 20.0, 30.5)),
        ("0,500,100000", None, (0.0, 500.0, 1e5)),
    ],
)
def test_every_form(text, robot, point):
    place = parse_endpoint(text, SMALL, "from")
    assert (place.name, place.robot, place.point) == (text, robot, point)
    assert place.is_station == (text == "station")
    assert place.text == ("the station" if text == "station" else text)


@pytest.mark.parametrize("height", [0.3, 7.0])
def test_a_point_is_as_high_as_a_ground_robots_antenna(height):
    assert parse_endpoint("1,2", change(SMALL, ugv_antenna=height), "to").point == (1.0, 2.0, height)


@pytest.mark.parametrize(
    "text",
    ["", "uav2", "ugv-1", "UAV0", "uav", "Station", "the station", "1", "1,", ",", "1,2,3,4", "1,2,", "a,b", "1;2", "uav0,uav1"],
)
def test_what_names_no_place(text):
    with pytest.raises(ValueError) as refusal:
        parse_endpoint(text, SMALL, "some-option")
    said = str(refusal.value)
    assert said.startswith("--some-option must be station, uav0, ugv1") and repr(text) in said and "X,Y,Z" in said


@pytest.mark.parametrize("text", ["-1,3", "3,500.1", "501,3", "1,2,-0.1", "nan,1", "1,inf", "1,2,nan", "1,2,1e6"])
def test_what_lies_outside(text):
    with pytest.raises(ValueError) as refusal:
        parse_endpoint(text, SMALL, "to")
    said = str(refusal.value)
    assert said.startswith("--to ") and text in said and "0..500 m" in said


@pytest.mark.parametrize("team", [(1, 0), (0, 1), (3, 0), (0, 2)])
def test_a_refusal_names_only_robots_of_the_team(team):
    scenario = change(SMALL, n_uav=team[0], n_ugv=team[1])
    with pytest.raises(ValueError) as refusal:
        parse_endpoint("nowhere", scenario, "from")
    assert ("uav" in str(refusal.value)) == (team[0] > 0) and ("ugv" in str(refusal.value)) == (team[1] > 0)


def test_antennas_stand_above_the_ground_below_them():
    world = make_world(SMALL, 1)
    links, summit = WorldLinks(world, "raycast"), world.layout.mountains[0]
    top = float(world.layout.ground_height([summit["x"], summit["y"]]))
    robots = np.array([[summit["x"], summit["y"]], [1.0, 2.0], [summit["x"], summit["y"]], [3.0, 4.0]])
    assert top > 5
    for place, xyz in (
        (Endpoint("uav0", robot=0), (summit["x"], summit["y"], top + 60)),
        (Endpoint("uav1", robot=1), (1, 2, 60)),
        (Endpoint("ugv0", robot=2), (summit["x"], summit["y"], top + 1)),
        (Endpoint("ugv1", robot=3), (3, 4, 1)),
        (Endpoint("station"), (*world.layout.station, 15)),
        (Endpoint("point", point=(summit["x"], summit["y"], 2.5)), (summit["x"], summit["y"], top + 2.5)),
        (Endpoint("corner", point=(0.0, 0.0, 9.0)), (0, 0, 9)),
    ):
        assert antenna_at(place, links, robots) == pytest.approx(xyz), place.name
