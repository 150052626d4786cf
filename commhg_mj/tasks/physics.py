"""A mission's world as a `dm_control.mujoco.Physics`: bodies that stand where the robots are, and questions by name."""

from typing import Any

import mujoco as mj
import numpy as np
from dm_control import mujoco
from dm_control.mujoco import wrapper

from ..base.arguments import positive, said
from ..base.opengl_thread import use_gl
from ..models.mjcf import build_model
from ..models.poses import attitude, robot_positions
from ..models.world import World
from ..radio.world_links import WorldLinks

STATION = "station"
PROBE = 1.0  # B: geometry does not depend on a message's size
MOVED = 1e-3  # m: less is standing


class Physics(mujoco.Physics):
    """One world at a time; the mission moves its mocap bodies, nothing else moves.

    Places are read from the bodies, so that a body that the caller moves by hand is asked about where it stands (after
    `forward()`).
    """

    @classmethod
    def from_world(cls, world: World, pictures: bool, timestep: float) -> "Physics":
        """The physics of a world, its robots at their starts.

        Args:
          pictures: whether it looks like anything; without, it is made ten times faster.
          timestep: s of the mission that one step stands for.
        """
        physics = cls.from_model(_model_of(world, pictures, timestep))
        physics._know(world, pictures)
        physics._start()
        return physics

    def reload(self, world: World) -> None:
        """Another world in place of this one."""
        if world is not self.world:
            self._reload_from_model(_model_of(world, self.has_pictures, self.timestep()))
            self._know(world, self.has_pictures)
            self._start()

    def copy(self, share_model=False) -> "Physics":
        """The same world at the same moment."""
        twin = super().copy(share_model)
        twin._know(self.world, self.has_pictures)
        return twin

    @property
    def contexts(self) -> Any:
        """OpenGL's; RuntimeError in a process forked from one that has drawn."""
        use_gl()
        return super().contexts

    def _know(self, world, pictures):
        self.world, self.has_pictures, self._links = world, pictures, WorldLinks(world, "raycast")
        scenario = world.scenario
        self._antennas = dict.fromkeys(scenario.robot_names[: scenario.n_uav], scenario.radio.uav_antenna)
        self._antennas |= dict.fromkeys(scenario.robot_names[scenario.n_uav :], scenario.radio.ugv_antenna)
        self._antennas[STATION] = scenario.world.mast_height

    def _start(self):
        starts = self.world.layout.starts
        self.place_robots(starts, np.zeros(len(starts), bool), 0.0)

    def place_robots(self, xy, failed, time) -> None:
        """Put the team at xy [R, 2] m at `time` s; a robot faces the way that it has come."""
        places, data = robot_positions(self.world, xy, failed), self.data
        way = places - data.mocap_pos
        for i in np.flatnonzero(np.hypot(way[:, 0], way[:, 1]) > MOVED):
            data.mocap_quat[i] = attitude(np.arctan2(way[i, 1], way[i, 0]))
        data.mocap_pos[:] = places
        data.time = time
        mj.mj_kinematics(self.model.ptr, data.ptr)

    def robot_positions(self) -> np.ndarray:
        """[R, 3] m, in the order of `Scenario.robot_names`."""
        return np.array([self.position(name) for name in self.world.scenario.robot_names])

    def position(self, name: str) -> np.ndarray:
        """[3] m of a body: uav0, ugv0, station, operator0, poi0, …

        Raises:
          ValueError: there is no such body.
        """
        body = mj.mj_name2id(self.model.ptr, mj.mjtObj.mjOBJ_BODY, name) if isinstance(name, str) else -1
        if body < 0:
            raise ValueError(f"unknown body {said(name)}: use {', '.join(self._antennas)}, operator0, poi0, …")
        return self.data.xpos[body].copy()

    def distance(self, a: str, b: str) -> float:
        """Metres between two bodies, in three dimensions."""
        return float(np.linalg.norm(self.position(a) - self.position(b)))

    def antenna(self, name: str) -> np.ndarray:
        """[3] m of the antenna of a robot or the station.

        Raises:
          ValueError: it has none.
        """
        if not isinstance(name, str) or name not in self._antennas:
            raise ValueError(f"{said(name)} has no antenna: use {', '.join(self._antennas)}")
        return self.position(name) + [0.0, 0.0, self._antennas[name]]

    def canopy_depth(self, a: str, b: str) -> float:
        """Metres of the straight way between two antennas that lie in canopies."""
        return self._between(a, b)[1]

    def line_of_sight(self, a: str, b: str) -> bool:
        """Whether neither a mountain nor a canopy stands between two antennas."""
        is_blocked, canopy = self._between(a, b)
        return not is_blocked and canopy == 0.0

    def _between(self, a, b):
        """(is a mountain in the way, metres in canopies); antennas in one place have nothing between them."""
        link = self._links.between(self.antenna(a)[None], self.antenna(b)[None], PROBE)[0]
        return bool(link["is_blocked"] == 1.0), float(np.nan_to_num(link["forest"]))

    def __getstate__(self):
        return super().__getstate__(), self.world, self.has_pictures

    def __setstate__(self, state):
        data, world, pictures = state
        super().__setstate__(data)
        self._know(world, pictures)


def _model_of(world, pictures, timestep):
    model = build_model(world, pictures)
    model.opt.timestep = positive("timestep", timestep)
    return wrapper.MjModel(model)
