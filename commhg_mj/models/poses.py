"""Where a world's robots stand in three dimensions, and how they are turned."""

import mujoco
import numpy as np

from .world import World

FALLEN_HEIGHT = 1.0  # m of a failed UAV's hull above the ground


def robot_positions(world: World, xy, failed) -> np.ndarray:
    """Positions [R, 3] m of the team at xy [R, 2] m, UAVs at their flight height unless they have failed [R] bool."""
    n_uav, flight = world.scenario.n_uav, world.scenario.world.uav_height
    height = np.where(np.arange(len(xy)) < n_uav, np.where(failed, FALLEN_HEIGHT, flight), 0.0)
    return np.c_[xy, world.layout.ground_height(xy) + height]


def attitude(heading, pitch=0.0, roll=0.0) -> np.ndarray:
    """Quaternion [4] of a yaw from east, then a pitch (nose down positive), then a roll (right wing down positive), rad."""
    quat = np.empty(4)
    mujoco.mju_euler2Quat(quat, np.array([heading, pitch, roll]), "zyx")
    return quat
