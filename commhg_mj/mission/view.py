"""One mission's slice of a batch, as the rules see it, with its ground, its log and the scenario's numbers."""

from typing import NamedTuple

import numpy as np

from ..kernels import kernel
from ..models.layout import unit_frame
from ..models.routes import MAX_VISIBLE
from ..models.world import World

FAR = 1e12  # where padding obstacles lie


class Ground(NamedTuple):
    """Worlds of a batch, padded to the same number of parts and corners; `view` slices one mission's."""

    frames: np.ndarray  # [E, parts, 6] footprints -> unit circle
    kinds: np.ndarray  # [E, parts] Footprint
    route_frames: np.ndarray  # [E, parts, 6] inflated footprints -> unit circle
    corners: np.ndarray  # [E, corners, 6]
    n_corners: np.ndarray  # [E, 1]
    to_goal: np.ndarray  # [E, T, corners]
    next_hop: np.ndarray  # [E, T, corners]
    scratch: np.ndarray  # [E, 2, parts] intervals of a link
    seen: np.ndarray  # [E, MAX_VISIBLE] corners seen by a route query
    seen_distance: np.ndarray  # [E, MAX_VISIBLE]


class Log(NamedTuple):
    """What a trace keeps (mission/log.py); arrays without rows when nothing is recorded."""

    robots: np.ndarray  # [E, ticks + 1, R] ROBOT_ROW
    operators: np.ndarray  # [E, ticks + 1, H] OPERATOR_ROW
    messages: np.ndarray  # [E, capacity] MESSAGE_ROW
    links: np.ndarray  # [E, samples, R, R + 1] u1
    beliefs: np.ndarray  # [E, samples, R + 1, T] BELIEF_ROW
    peers: np.ndarray  # [E, samples, R + 1, R] PEER_ROW
    resources: np.ndarray  # [E, samples, R, H] RESOURCE_ROW
    rewards: np.ndarray  # [E, ticks, 2] f8


class Mission(NamedTuple):
    """One mission: the arrays of `State` without their leading axis, and what surrounds them."""

    info: np.ndarray  # [1]
    rules: np.ndarray  # [1]
    robots: np.ndarray
    operators: np.ndarray
    tasks: np.ndarray
    beliefs: np.ndarray
    peers: np.ndarray
    inboxes: np.ndarray
    resources: np.ndarray
    tips: np.ndarray
    uplinks: np.ndarray
    downlinks: np.ndarray
    air: np.ndarray
    flying: np.ndarray
    counters: np.ndarray
    ground: Ground
    log: Log


@kernel
def view(state, rules, ground, log, e):
    """Mission `e` of the batch."""
    n = ground.n_corners[e, 0]
    own_ground = Ground(
        ground.frames[e], ground.kinds[e], ground.route_frames[e], ground.corners[e, :n], ground.n_corners[e],
        ground.to_goal[e, :, :n], ground.next_hop[e, :, :n], ground.scratch[e], ground.seen[e], ground.seen_distance[e],
    )  # fmt: skip
    own_log = Log(
        log.robots[e], log.operators[e], log.messages[e], log.links[e], log.beliefs[e], log.peers[e], log.resources[e],
        log.rewards[e],
    )  # fmt: skip
    return Mission(
        state.missions[e : e + 1], rules, state.robots[e], state.operators[e], state.tasks[e], state.beliefs[e],
        state.peers[e], state.inboxes[e], state.resources[e], state.tips[e], state.uplinks[e], state.downlinks[e],
        state.air[e], state.flying[e], state.counters[e], own_ground, own_log,
    )  # fmt: skip


def stack_ground(worlds: list[World]) -> Ground:
    """The worlds of a batch in padded arrays."""
    e, t = len(worlds), worlds[0].scenario.n_tasks
    parts = max(1, max(len(w.layout.parts) for w in worlds))
    corners = max(1, max(len(w.routes.corners) for w in worlds))
    frames = np.zeros((e, parts, 6))
    frames[..., :2], frames[..., 2], frames[..., 5] = FAR, 1.0, 1.0
    ground = Ground(
        frames=frames,
        kinds=np.zeros((e, parts), np.int32),
        route_frames=frames.copy(),
        corners=np.zeros((e, corners, 6)),
        n_corners=np.array([[len(w.routes.corners)] for w in worlds], np.int32),
        to_goal=np.full((e, t, corners), np.inf, np.float32),
        next_hop=np.full((e, t, corners), -1, np.int16),
        scratch=np.empty((e, 2, parts)),
        seen=np.empty((e, MAX_VISIBLE), np.int32),
        seen_distance=np.empty((e, MAX_VISIBLE)),
    )
    for i, world in enumerate(worlds):
        p, c = len(world.layout.parts), len(world.routes.corners)
        ground.frames[i, :p] = unit_frame(world.layout.parts)
        ground.kinds[i, :p] = world.layout.parts["kind"]
        ground.route_frames[i, :p] = world.routes.frames
        ground.corners[i, :c] = world.routes.corners
        ground.to_goal[i, :, :c] = world.routes.to_goal
        ground.next_hop[i, :, :c] = world.routes.next_hop
    return ground
