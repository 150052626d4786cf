"""Videos and pictures of a trace, or of two side by side."""

import multiprocessing
from collections import deque
from collections.abc import Iterable
from contextlib import closing
from functools import partial

import cv2
import numpy as np

from ..base.arguments import instance, path_of, positive, second, workers_of
from ..base.files import whole_file
from ..base.processes import pool_of
from ..mission.trace import Trace
from ..models.world import make_world
from .cameras import check_camera
from .canvas import Canvas
from .divergence import check_same_mission
from .drape import Drape
from .hud import Hud
from .moment import Timeline
from .overlay import Overlay
from .pair import PairFilm, joined_size
from .stage import Stage
from .video import to_yuv, write_mp4, write_png

CHUNK = 24  # pictures that one process makes in a row; labels keep their places within it
SHOWN_FOR = 0.45  # s of video: messages are shown at least this long
SMALLEST, LARGEST = 64, 4096  # pixels
MOST_PICTURES = 1_000_000  # in one video
SIZES = {1: (1280, 720), 2: (960, 540)}  # pixels of a panel, by their number


def render_video(
    trace, out, camera="overview", size=None, fps=24, speed=20.0, start=0.0, stop=None, workers=2, progress=None, drape=None
) -> None:
    """Write an H.264 video of a mission.

    Args:
      trace: the mission's `Trace`, or a tuple of two of the same scenario and seed, shown left and right in step.
      out: path ending in .mp4.
      camera: overview, station, map, orbit or follow:ROBOT.
      size: (width, height) in pixels, even numbers, of one mission's picture; None is 1280x720, or 960x540 for two.
      fps: pictures per second of video.
      speed: seconds of the mission per second of video.
      start, stop: part of the mission [s]; None is its end.
      workers: processes that render; the video does not depend on it.
      progress: called with (pictures done, pictures in all) after each picture.
      drape: a `Drape` that covers the ground, or a tuple with one or None for each of two traces.

    Raises:
      ValueError: an argument is impossible; the message names it. Nothing is written.
      RuntimeError: OpenGL is missing.
    """
    traces, drapes, size = _check(trace, drape, out, ".mp4", camera, size)
    fps, speed, workers = positive("fps", fps), positive("speed", speed), workers_of(workers)
    last = _duration(traces)
    start, stop = second("start", start, last), last if stop is None else second("stop", stop, last)
    if start > stop:
        raise ValueError(f"start = {start:g} s is after stop = {stop:g} s")
    if (stop - start) * fps / speed > MOST_PICTURES:
        raise ValueError(f"fps = {fps:g} at speed = {speed:g} asks for more than {MOST_PICTURES} pictures")
    film = partial(_make_film, traces, drapes, camera, size, speed)
    times = np.arange(start, stop + 1e-9, speed / fps)
    write_film(out, film, times, size if len(traces) == 1 else joined_size(size), fps, workers, progress)


def write_film(out, make_film, times, size, fps, workers=1, progress=None) -> None:
    """Write the pictures [height, width, 3] of a film at `times` [s] as H.264.

    Args:
      make_film: makes an object with `picture(time)`, `forget_labels()` and `close()`; a partial of a module's function,
        which every process calls.
      size: (width, height) of the pictures.
    """
    chunks = [times[i : i + CHUNK] for i in range(0, len(times), CHUNK)]
    with whole_file(out) as part, closing(_in_order(make_film, chunks, workers)) as pictures:
        write_mp4(part, _counted(pictures, len(times), progress), size, fps)


def render_image(trace, out, at=0.0, camera="overview", size=None, speed=20.0, drape=None) -> None:
    """Write a PNG of the mission at `at` seconds: the same picture as a video at `speed` has there.

    Raises:
      ValueError: an argument is impossible; the message names it. Nothing is written.
      RuntimeError: OpenGL is missing.
    """
    traces, drapes, size = _check(trace, drape, out, ".png", camera, size)
    at, speed = second("at", at, _duration(traces)), positive("speed", speed)
    with whole_file(out) as part, closing(_make_film(traces, drapes, camera, size, speed)) as film:
        write_png(part, film.picture(at))


def _make_film(traces, drapes, camera, size, speed):
    """The film of one trace, or of two."""
    films = [Film(trace, camera, size, SHOWN_FOR * speed, drape) for trace, drape in zip(traces, drapes)]
    return films[0] if len(films) == 1 else PairFilm(films, size, speed)


class Film:
    """Makes the pictures of one trace in one process."""

    def __init__(self, trace, camera, size, lag, drape=None):
        # Pictures are made in parallel by process: threads inside would only get in each other's way. In a forked process
        # OpenCV would wait for ever for the end of those that it had before.
        if multiprocessing.get_start_method(allow_none=True) == "spawn":
            cv2.setNumThreads(1)
        self.camera = camera
        world = make_world(trace.scenario, trace.seed)
        self.timeline = Timeline(trace, lag)
        self.stage = Stage(world, size, drape)
        self.hud = Hud(trace, world, size, drape)
        self.canvas = Canvas(*size)
        self.overlay = Overlay(trace, world, self.canvas, self.stage.pins)

    def picture(self, time: float, ringed: str | None = None) -> np.ndarray:
        """The picture [height, width, 3] at `time` [s] in blue, green, red, with a ring around an actor."""
        moment = self.timeline.at(time)
        picture, projection = self.stage.render(moment, self.camera)
        self.hud.draw(moment, projection)
        self.canvas.pixels[:] = 0
        self.overlay.draw(moment, self.stage.positions(moment), projection, self.hud.boxes, ringed)
        self.hud.cover(self.canvas)
        return self.canvas.paste(picture)

    def go_on(self, trace) -> None:
        """Show a longer trace of the same mission from now on."""
        self.timeline = Timeline(trace, self.timeline.lag)
        self.hud.trace = self.hud.minimap.trace = self.overlay.trace = trace

    def forget_labels(self) -> None:
        """Labels may go to other places than in the picture before."""
        self.overlay.slots = {}

    def close(self) -> None:
        self.stage.close()


def _make_chunk(film, times) -> list[np.ndarray]:
    """Pictures in a row, ready for the encoder."""
    film.forget_labels()
    return [to_yuv(film.picture(time)) for time in times]


_film = None  # this worker's, and how to make it


def _start_worker(make_film):
    global _film
    _film = make_film


def _work(times):
    """A chunk in a worker; the film is made by the first one, so that its errors reach the caller."""
    global _film
    if isinstance(_film, partial):
        _film = _film()
    return _make_chunk(_film, times)


def _in_order(make_film, chunks, workers):
    """Yield the pictures of all chunks in order; at most one chunk more than workers is under way."""
    if workers == 1 or len(chunks) == 1:
        with closing(make_film()) as film:
            for chunk in chunks:
                yield from _make_chunk(film, chunk)
        return
    with pool_of(workers, _start_worker, (make_film,)) as pool:
        ahead, waiting = deque(), deque(chunks)
        while ahead or waiting:
            while waiting and len(ahead) <= workers:
                ahead.append(pool.submit(_work, waiting.popleft()))
            yield from ahead.popleft().result()


def _counted(pictures, total, progress):
    for done, picture in enumerate(pictures, 1):
        yield picture
        if progress:
            progress(done, total)


def _duration(traces):
    """Of the longest, in seconds."""
    return float(max(len(trace.robot_xy) for trace in traces) - 1)


def _check(trace, drape, out, ending, camera, size):
    """(traces, drapes, size of a panel), all as tuples; a single drape lies in all panels."""
    if path_of("out", out).suffix.lower() != ending:
        raise ValueError(f"{out}: the name must end in {ending}")
    traces = trace if isinstance(trace, tuple) else (trace,)
    if len(traces) not in SIZES:
        raise ValueError(f"one trace or two can be rendered, not {len(traces)}")
    for one in traces:
        instance("trace", one, Trace)
    if len(traces) == 2:
        check_same_mission(*traces)
    drapes = drape if isinstance(drape, tuple) else (drape,) * len(traces)
    for one in drapes:
        _ = one if one is None else instance("drape", one, Drape)
    if len(drapes) != len(traces):
        raise ValueError(f"there must be as many drapes as traces, {len(traces)}, not {len(drapes)}")
    check_camera(camera, traces[0].scenario)
    return traces, drapes, check_size(SIZES[len(traces)] if size is None else size)


def check_size(size) -> tuple:
    """The size of a picture; ValueError unless it is two even numbers of pixels."""
    values = tuple(size) if isinstance(size, Iterable) else (size,)
    if len(values) != 2 or not all(isinstance(n, (int, np.integer)) and SMALLEST <= n <= LARGEST and n % 2 == 0 for n in values):
        raise ValueError(f"size must be two even numbers in {SMALLEST}..{LARGEST}, is {'x'.join(map(str, values))}")
    return tuple(map(int, values))
