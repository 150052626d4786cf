import dataclasses

import av
import cv2
import numpy as np
import pytest
from synthetic import make_trace

from commhg_mj.models.world import make_world
from commhg_mj.render import overview_figure, render_image, render_video, video
from commhg_mj.render.film import Film, write_film
from commhg_mj.render.hud import Hud
from commhg_mj.render.moment import Timeline

SIZE = (320, 180)


def test_a_browser_plays_the_video(trace, tmp_path):
    out, calls = tmp_path / "mission.mp4", []
    render_video(trace, out, size=SIZE, stop=5.0, workers=1, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(i, 7) for i in range(1, 8)]
    with av.open(str(out)) as film:
        stream = film.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (stream.width, stream.height, stream.average_rate) == (*SIZE, 24)
        pictures = [frame.to_ndarray(format="bgr24") for frame in film.decode(stream)]
    assert len(pictures) == 7
    head = out.read_bytes()
    assert head.index(b"moov") < head.index(b"mdat"), "a browser wants the index first"
    assert [p.name for p in tmp_path.iterdir()] == ["mission.mp4"]


def test_names_and_folders_that_look_like_addresses(trace, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a:b").mkdir()
    render_video(trace, "clip-12:30.mp4", size=(64, 64), stop=0.0, workers=1)
    for out in ("a:b/http:x.mp4", "50%d.mp4", "-.mp4"):
        write_film(out, PlainFilm, [0.0], (64, 64), 24)
    for out in ("clip-12:30.mp4", "a:b/http:x.mp4", "50%d.mp4", "-.mp4"):
        with av.open(f"file:{out}") as film:
            assert len(list(film.decode(video=0))) == 1


class PlainFilm:
    """Nothing but grey."""

    def picture(self, time):
        return np.full((64, 64, 3), 99, np.uint8)

    def forget_labels(self):
        """There are none."""

    def close(self):
        """There is nothing to close."""


def test_what_the_video_library_refuses_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setitem(video.QUALITY, "preset", "none")
    with pytest.raises(ValueError, match=f"cannot write {tmp_path}/a.mp4: the video library says: ") as error:
        write_film(tmp_path / "a.mp4", PlainFilm, [0.0], (64, 64), 24)
    assert "\n" not in str(error.value) and not list(tmp_path.iterdir())


def test_video_and_picture_show_the_same(trace, tmp_path):
    render_video(trace, tmp_path / "a.mp4", size=SIZE, start=10.0, stop=10.0, workers=1)
    render_image(trace, tmp_path / "a.png", 10.0, "overview", SIZE)
    with av.open(str(tmp_path / "a.mp4")) as film:
        frame = next(film.decode(video=0)).to_ndarray(format="bgr24")
    assert np.abs(frame.astype(int) - cv2.imread(str(tmp_path / "a.png"))).mean() < 6


def test_the_number_of_workers_does_not_show(trace, tmp_path, monkeypatch):
    monkeypatch.setattr("commhg_mj.render.film.CHUNK", 5)
    stop = (5 + 3) * 20 / 24
    for workers in (1, 2):
        render_video(trace, tmp_path / f"{workers}.mp4", size=(192, 108), stop=stop, workers=workers)
    assert (tmp_path / "1.mp4").read_bytes() == (tmp_path / "2.mp4").read_bytes()


@pytest.mark.parametrize(
    "name, options, said",
    [
        ("mission.avi", {}, "mission.avi"),
        ("mission", {}, "mp4"),
        ("nowhere/mission.mp4", {}, "nowhere"),
        ("m.mp4", {"camera": "above"}, "above"),
        ("m.mp4", {"camera": "follow:uav7"}, "uav7"),
        ("m.mp4", {"size": (321, 180)}, "321x180"),
        ("m.mp4", {"size": (20, 180)}, "20x180"),
        ("m.mp4", {"start": -1.0}, "start"),
        ("m.mp4", {"stop": 61.0}, "stop"),
        ("m.mp4", {"start": 9.0, "stop": 8.0}, "start = 9 s is after stop = 8 s"),
        ("m.mp4", {"fps": 0}, "fps"),
        ("m.mp4", {"speed": float("nan")}, "speed"),
        ("m.mp4", {"workers": 0}, "workers"),
    ],
)
def test_impossible_videos_are_refused(trace, tmp_path, name, options, said):
    with pytest.raises(ValueError) as error:
        render_video(trace, tmp_path / name, **options)
    assert said in str(error.value) and "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("options, said", [({"at": 99.0}, "at 99"), ({"at": 0.0, "size": (3, 2)}, "3x2")])
def test_impossible_pictures_are_refused(trace, tmp_path, options, said):
    with pytest.raises(ValueError, match=said):
        render_image(trace, tmp_path / "x.png", **options)
    with pytest.raises(ValueError, match="x.jpg"):
        render_image(trace, tmp_path / "x.jpg")
    with pytest.raises(ValueError, match="x.jpg"):
        overview_figure(trace, tmp_path / "x.jpg")
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(ValueError, match="folder.png"):
        render_image(trace, tmp_path / "folder.png")


def test_a_failure_leaves_nothing_and_spares_the_old_file(trace, tmp_path):
    out = tmp_path / "mission.mp4"
    out.write_bytes(b"old")

    def fail(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_video(trace, out, size=SIZE, stop=2.0, workers=1, progress=fail)
    assert [p.name for p in tmp_path.iterdir()] == ["mission.mp4"] and out.read_bytes() == b"old"


def test_what_is_privileged_says_so(trace, monkeypatch):
    world, moment = make_world(trace.scenario, trace.seed), Timeline(trace, 9.0).at(3.0)
    said = []
    monkeypatch.setattr(Hud, "text", lambda self, x, y, string, *rest, **style: said.append(string) or 10.0)
    for policy, privileged in (("greedy", False), ("omniscient", True)):
        said.clear()
        hud = Hud(dataclasses.replace(trace, policy=policy), world, (1280, 720))
        hud._title_bar(moment)
        assert any("PRIVILEGED" in string for string in said) == privileged


CROWDS = [
    {"n_uav": 1, "n_ugv": 0, "n_operators": 0, "n_tasks": 1},
    {"n_uav": 0, "n_ugv": 2, "n_operators": 24},
    {"n_uav": 3, "n_ugv": 1, "n_operators": 0},
]
SIZES = [(320, 180), (640, 360), (180, 320)]


@pytest.mark.parametrize("changes, size", [*zip(CROWDS, SIZES), *((CROWDS[-1], size) for size in SIZES[:-1])])
def test_any_team_on_any_size(changes, size):
    draw_some(make_trace("small", seed=2, ticks=12, **changes), size)


@pytest.mark.slow
def test_the_largest_team():
    draw_some(make_trace("large", ticks=40, n_uav=32, n_ugv=32, n_operators=24, n_tasks=1024), (1280, 720))


def draw_some(trace, size):
    film = Film(trace, "overview", size, 9.0)
    for time in (0.0, 11.4, len(trace.robot_xy) - 1.0):
        picture = film.picture(time)
        assert picture.shape == (size[1], size[0], 3) and picture.std() > 5
    film.close()


@pytest.mark.slow
def test_overview_figures(trace, tmp_path):
    for source in (trace, make_world(trace.scenario, trace.seed)):
        overview_figure(source, tmp_path / "world.png")
        assert cv2.imread(str(tmp_path / "world.png")).shape == (1080, 1920, 3)
