"""Pictures of a mission while it is flown, as a video of its trace would show them."""

import cv2
import numpy as np

from ..base.arguments import instance
from ..mission.trace import make_traces
from ..models.world import World
from ..scenarios import Scenario
from .cameras import check_camera
from .film import SHOWN_FOR, Film, check_size

SPEED = 20.0  # s of the mission per second of video, as `render_video` has it: so long messages are shown
POLICY = "live"  # in the title bar


class LiveFilm:
    """Films one recorded mission after the other.

    Args:
      scenario: of the missions.
      camera: overview, station, map, orbit or follow:ROBOT.
      size: (width, height) in pixels, even numbers.

    Raises:
      ValueError: an argument is impossible; the message names it.
    """

    def __init__(self, scenario, camera="overview", size=(1280, 720)):
        check_camera(camera, instance("scenario", scenario, Scenario))
        self.camera, self.size = camera, check_size(size)
        self._film: Film | None = None
        self._world: World | None = None

    def picture(self, batch) -> np.ndarray:
        """The first mission of a recorded `MissionBatch`, or of what looks like one, as it stands.

        Returns:
          [height, width, 3] u1 in red, green, blue.

        Raises:
          RuntimeError: OpenGL is missing.
        """
        trace = make_traces(batch, POLICY)[0]
        if self._film is None or self._world is not batch.worlds[0]:
            self.close()
            self._film, self._world = Film(trace, self.camera, self.size, SHOWN_FOR * SPEED), batch.worlds[0]
        self._film.go_on(trace)
        return cv2.cvtColor(self._film.picture(float(batch.time[0])), cv2.COLOR_BGR2RGB)

    def __getstate__(self):
        """A copy makes pictures of its own."""
        return self.__dict__ | {"_film": None, "_world": None}

    def close(self) -> None:
        if self._film:
            self._film.close()
        self._film = self._world = None
