"""Videos and pictures of a trace."""

import multiprocessing
import signal
from collections import deque
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from ..files import whole_file
from ..models.world import make_world
from .cameras import check_camera
from .canvas import Canvas
from .hud import Hud
from .moment import Timeline
from .overlay import Overlay
from .stage import Stage
from .video import to_yuv, write_mp4, write_png

CHUNK = 24  # pictures that one process makes in a row; labels keep their places within it
SHOWN_FOR = 0.45  # s of video: messages are shown at least this long
SMALLEST, LARGEST = 64, 4096  # pixels
MOST_PICTURES = 1_000_000  # in one video


def render_video(
    trace, out, camera="overview", size=(1280, 720), fps=24, speed=20.0, start=0.0, stop=None, workers=2, progress=None
):
    """Write an H.264 video of a mission.

    Args:
      trace: the mission's `Trace`.
      out: path ending in .mp4.
      camera: overview, station, map, orbit or follow:ROBOT.
      size: (width, height) in pixels, even numbers.
      fps: pictures per second of video.
      speed: seconds of the mission per second of video.
      start, stop: part of the mission [s]; None is its end.
      workers: processes that render; the video does not depend on it.
      progress: called with (pictures done, pictures in all) after each picture.

    Raises:
      ValueError: an argument is impossible; the message names it. Nothing is written.
      RuntimeError: OpenGL is missing.
    """
    _check(trace, out, ".mp4", camera, size)
    for name, value in (("fps", fps), ("speed", speed), ("workers", workers)):
        if not 0 < value < np.inf:
            raise ValueError(f"{name} must be positive, is {value}")
    stop = _duration(trace) if stop is None else stop
    _check_time(trace, "start", start)
    _check_time(trace, "stop", stop)
    if start > stop:
        raise ValueError(f"start = {start:g} s is after stop = {stop:g} s")
    if (stop - start) * fps / speed > MOST_PICTURES:
        raise ValueError(f"fps = {fps:g} at speed = {speed:g} asks for more than {MOST_PICTURES} pictures")
    times = np.arange(start, stop + 1e-9, speed / fps)
    chunks = [times[i : i + CHUNK] for i in range(0, len(times), CHUNK)]
    film = partial(Film, trace, camera, tuple(size), SHOWN_FOR * speed)
    with whole_file(out) as part:
        pictures = _in_order(film, chunks, workers)
        write_mp4(part, _counted(pictures, len(times), progress), size, fps)


def render_image(trace, out, at=0.0, camera="overview", size=(1280, 720), speed=20.0):
    """Write a PNG of the mission at `at` seconds: the same picture as a video at `speed` has there.

    Raises:
      ValueError: an argument is impossible; the message names it. Nothing is written.
      RuntimeError: OpenGL is missing.
    """
    _check(trace, out, ".png", camera, size)
    _check_time(trace, "at", at)
    with whole_file(out) as part, closing(Film(trace, camera, tuple(size), SHOWN_FOR * speed)) as film:
        write_png(part, film.picture(at))


class Film:
    """Makes the pictures of one trace in one process."""

    def __init__(self, trace, camera, size, lag):
        # Pictures are made in parallel by process: threads inside would only get in each other's way.
        cv2.setNumThreads(1)
        self.camera = camera
        world = make_world(trace.scenario, trace.seed)
        self.timeline = Timeline(trace, lag)
        self.stage = Stage(world, size)
        self.hud = Hud(trace, world, size)
        self.canvas = Canvas(*size)
        self.overlay = Overlay(trace, world, self.canvas, self.stage.pins)

    def picture(self, time: float) -> np.ndarray:
        """The picture [height, width, 3] at `time` [s] in blue, green, red."""
        moment = self.timeline.at(time)
        picture, projection = self.stage.render(moment, self.camera)
        self.hud.draw(moment, projection)
        self.canvas.pixels[:] = 0
        self.overlay.draw(moment, self.stage.positions(moment), projection, self.hud.boxes)
        self.hud.cover(self.canvas)
        return self.canvas.paste(picture)

    def chunk(self, times) -> list[np.ndarray]:
        """Pictures in a row, ready for the encoder."""
        self.overlay.slots = {}
        return [to_yuv(self.picture(time)) for time in times]

    def close(self):
        self.stage.close()


_film = None  # this worker's, and how to make it


def _start_worker(make_film):
    global _film
    _film = make_film
    # An interrupt is the main process's to handle.
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _work(times):
    """A chunk in a worker; the film is made by the first one, so that its errors reach the caller."""
    global _film
    if isinstance(_film, partial):
        _film = _film()
    return _film.chunk(times)


def _in_order(make_film, chunks, workers):
    """Yield the pictures of all chunks in order; at most one chunk more than workers is under way."""
    if workers == 1 or len(chunks) == 1:
        with closing(make_film()) as film:
            for chunk in chunks:
                yield from film.chunk(chunk)
        return
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _start_worker, (make_film,))
    try:
        ahead, waiting = deque(), deque(chunks)
        while ahead or waiting:
            while waiting and len(ahead) <= workers:
                ahead.append(pool.submit(_work, waiting.popleft()))
            yield from ahead.popleft().result()
    finally:
        pool.shutdown(cancel_futures=True)


def _counted(pictures, total, progress):
    for done, picture in enumerate(pictures, 1):
        yield picture
        if progress:
            progress(done, total)


def _duration(trace):
    return float(len(trace.robot_xy) - 1)


def _check_time(trace, name, value):
    if not 0 <= value <= _duration(trace):
        raise ValueError(f"{name} = {value:g} s lies outside the mission, 0..{_duration(trace):g} s")


def _check(trace, out, ending, camera, size):
    if Path(out).suffix.lower() != ending:
        raise ValueError(f"{out}: the name must end in {ending}")
    check_camera(camera, trace.scenario)
    if not all(isinstance(n, int) and SMALLEST <= n <= LARGEST and n % 2 == 0 for n in size):
        raise ValueError(f"size must be two even numbers in {SMALLEST}..{LARGEST}, is {'x'.join(map(str, size))}")
