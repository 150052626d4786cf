"""Where a world's robots stand in three dimensions, and how they are turned."""

import mujoco
import numpy as np

from .world import World

FALLEN_HEIGHT = 1.0  # m of a failed UAV's hull above the ground


def robot_positions(world: World, xy, failed) -> np.ndarray:
    """Positions [R, 3] m of the team at xy [R, 2] m, UAVs at their flight height unless they have failed [R] bool."""
    layout, is_uav = world.layout, np.arange(len(xy)) < world.scenario.n_uav
    on_ground = layout.ground_height(xy) + np.where(is_uav, FALLEN_HEIGHT, 0.0)
    flying = layout.flight_floor(xy) + world.scenario.world.uav_height
    return np.c_[xy, np.where(is_uav & ~failed, flying, on_ground)]


def attitude(heading, pitch=0.0, roll=0.0) -> np.ndarray:
    """Quaternion [4] of a yaw from east, then a pitch (nose down positive), then a roll (right wing down positive), rad."""
    quat = np.empty(4)
    mujoco.mju_euler2Quat(quat, np.array([heading, pitch, roll]), "zyx")
    return quat
