import dataclasses

import av
import cv2
import numpy as np
import pytest

from commhg_mj.base.terms import IDLE, KEEP, REST
from commhg_mj.render import check_same_mission, first_divergence, render_image, render_video
from commhg_mj.render.film import _make_film
from commhg_mj.render.pair import joined_size

SIZE = (320, 180)


def changed(trace, ticks=None, **cells):
    """The trace with some cells of its columns changed, {(second, actor): value}, and cut after `ticks` seconds."""
    columns = {name: getattr(trace, name).copy() for name in cells}
    for name, values in cells.items():
        for cell, value in values.items():
            columns[name][cell] = value
    if ticks is not None:
        rows = [field.name for field in dataclasses.fields(trace) if field.name.startswith(("robot_", "operator_"))]
        columns = {name: columns.get(name, getattr(trace, name))[: ticks + 1] for name in rows}
    return dataclasses.replace(trace, **columns)


@pytest.mark.parametrize(
    "left, right, said",
    [
        ({"robot_choice": {(9, 3): 14}}, {"robot_choice": {(9, 3): KEEP}}, (9, "ugv1", "task 14", "keeps its task")),
        ({"robot_choice": {(9, 0): IDLE}}, {}, (9, "uav0", "idles", "no decision")),
        ({}, {"operator_choice": {(4, 1): REST}, "robot_choice": {(5, 0): 1}}, (4, "operator1", "no decision", "rests")),
        (
            {"operator_choice": {(4, 0): KEEP}},
            {"operator_choice": {(4, 0): 2}},
            (4, "operator0", "keeps its robot", "takes ugv0"),
        ),
        (
            {"operator_choice": {(4, 0): KEEP}, "robot_choice": {(4, 2): KEEP}},
            {"robot_choice": {(4, 2): KEEP}, "robot_request": {(4, 2): 1}},
            (4, "ugv0", "keeps its task", "keeps its task, requests assistance"),
        ),
        (
            {"robot_choice": {(0, 1): KEEP}, "robot_broadcast": {(0, 1): 1}},
            {"robot_choice": {(0, 1): KEEP}, "robot_query": {(0, 1): 1}},
            (0, "uav1", "keeps its task, broadcasts", "keeps its task, asks operator 1"),
        ),
    ],
)
def test_the_first_decision_that_differs(trace, left, right, said):
    assert first_divergence(changed(trace, **left), changed(trace, **right)) == said


def test_the_same_decisions_never_part(trace):
    assert first_divergence(trace, changed(trace, robot_xy={(5, 0): 0.0})) is None
    assert first_divergence(trace, changed(trace, ticks=20)) is None
    late = changed(trace, robot_choice={(30, 0): 2})
    assert first_divergence(late, changed(trace, ticks=20)) is None
    assert first_divergence(late, changed(trace, ticks=30)).second == 30


def test_other_missions_are_refused(trace, tmp_path):
    others = {
        "seed 1 and 2": dataclasses.replace(trace, seed=2),
        "scenario's n_tasks 22 and 23": dataclasses.replace(trace, scenario=dataclasses.replace(trace.scenario, n_tasks=23)),
    }
    for difference, other in others.items():
        with pytest.raises(ValueError, match=f"^A.npz and B.npz are not the same mission: {difference}$"):
            check_same_mission(trace, other, ("A.npz", "B.npz"))
        with pytest.raises(ValueError, match=f"left and right .*{difference}"):
            render_image((trace, other), tmp_path / "x.png")
    for traces in ((), (trace,) * 3):
        with pytest.raises(ValueError, match=f"not {len(traces)}"):
            render_video(traces, tmp_path / "x.mp4")
    with pytest.raises(ValueError, match="drapes"):
        render_video((trace, trace), tmp_path / "x.mp4", drape=(None,))
    assert not list(tmp_path.iterdir())


def test_a_video_of_two(trace, tmp_path):
    other = changed(dataclasses.replace(trace, links="raycast"), ticks=57, robot_choice={(56, 0): 2})
    render_video((trace, other), tmp_path / "side.mp4", size=SIZE, start=56.0, workers=1)
    with av.open(str(tmp_path / "side.mp4")) as video:
        pictures = [frame.to_ndarray(format="bgr24") for frame in video.decode(video=0)]
    width, height = joined_size(SIZE)
    assert [p.shape for p in pictures] == [(height, width, 3)] * 5
    render_image((trace, other), tmp_path / "side.png", 56.0, size=SIZE)
    assert np.abs(pictures[0].astype(int) - cv2.imread(str(tmp_path / "side.png"))).mean() < 6


@pytest.fixture(scope="module")
def pair(trace):
    parted = changed(trace, ticks=57, robot_choice={(30, 1): 2})
    film = _make_film((trace, dataclasses.replace(parted, limitation="high")), (None, None), "map", (640, 360), 4.0)
    yield film
    film.close()


def test_a_mission_that_is_over_stands_still(pair):
    early, late = (pair.picture(time) for time in (57.0, 60.0))
    assert np.array_equal(early[-360:, -640:], late[-360:, -640:])
    assert not np.array_equal(early[-360:, :640], late[-360:, :640])


def test_the_banner_and_the_captions(pair):
    assert pair.captions == ["abstract links  ·  nominal limitation", "abstract links  ·  high limitation"]
    assert pair._banner(29.9)[0] == "same decisions so far"
    assert pair._banner(30.0)[0] == "decisions differ since 30 s: uav1: no decision | task 2"


@pytest.mark.parametrize("time, ringed", [(25.0, None), (26.0, "uav1"), (46.0, "uav1"), (47.0, None)])
def test_the_ring_around_the_actor(pair, time, ringed):
    assert pair._ringed(time) == ringed


@pytest.mark.parametrize("actor", ["uav1", "operator0"])
def test_the_ring_lies_where_the_actor_is(pair, actor):
    film = pair.films[0]
    rows, columns = np.nonzero(np.any(film.picture(30.0, actor) != film.picture(30.0), axis=-1))
    moment = film.timeline.at(30.0)
    place = film.stage.positions(moment)[1] if actor == "uav1" else film.overlay.station
    at, _ = film.stage.render(moment, "map")[1].pixels(place)
    np.testing.assert_allclose([columns.min() + columns.max(), rows.min() + rows.max()], 2 * at, atol=4)
